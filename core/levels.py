"""Which level sets of a distribution hold which probability, and their points and axes.

A level is always a squared Mahalanobis radius c: the set (x - mu)' P^-1 (x - mu) <= c.  MAT 1.3.1-1.3.2, 2.6.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.linalg import schur, sqrt_psd
from core.types import Array, Gaussian


class Axes(NamedTuple):
    """center (..., n); semi_axes (..., n) in falling order; directions (..., n, n), a right-handed basis in columns."""

    center: Array
    semi_axes: Array
    directions: Array


def chi_square_level(probability: ArrayLike, n: int, noncentrality: ArrayLike = 0.0) -> Array:
    """c with P(z <= c) = probability for z ~ chi2(n, lambda);  for n = 2, lambda = 0: c = -2 ln(1 - probability).

    probability (...) in [0, 1), n >= 1 degrees of freedom, noncentrality lambda (...) >= 0 -> c (...), a squared
    Mahalanobis radius: an n-dimensional normal law lies within it with this probability.  ValueError outside these
    ranges.  MAT Definitions 5 and 6, exercise 1.10.

    >>> float(chi_square_level(0.68, 2).round(6))
    2.278869
    """
    p, nc = _probability(probability), _noncentrality(noncentrality)
    n = degrees_of_freedom(n)
    if n == 2 and not np.any(nc):
        return -2.0 * np.log1p(-p) + np.zeros(nc.shape)
    from scipy.special import chndtrix, gammaincinv
    central = 2.0 * gammaincinv(0.5 * n, p)
    return np.where(nc > 0.0, chndtrix(p, n, nc), central) if np.any(nc) else central + np.zeros(nc.shape)


def chi_square_probability(level: ArrayLike, n: int, noncentrality: ArrayLike = 0.0) -> Array:
    """P(z <= c)  for z ~ chi2(n, lambda);  for n = 2, lambda = 0: 1 - exp(-c / 2).

    level c (...) >= 0, n >= 1, noncentrality (...) >= 0 -> (...) in [0, 1].  ValueError outside these ranges.
    MAT Definitions 5 and 6.

    >>> float(chi_square_probability(1.0, 2).round(6))
    0.393469
    """
    c, nc, n = _level(level), _noncentrality(noncentrality), degrees_of_freedom(n)
    if n == 2 and not np.any(nc):
        return -np.expm1(-0.5 * c) + np.zeros(nc.shape)
    from scipy.special import chndtr, gammainc
    central = gammainc(0.5 * n, 0.5 * c)
    return np.where(nc > 0.0, chndtr(c, n, nc), central) if np.any(nc) else central + np.zeros(nc.shape)


def chi_square_density(x: ArrayLike, n: int, noncentrality: ArrayLike = 0.0) -> Array:
    """f(x) = exp(-(x + lambda)/2) / 2  (x/lambda)^(n/4 - 1/2)  I_{n/2-1}(sqrt(lambda x)), its limit for lambda = 0.

    x (...), n >= 1, noncentrality lambda (...) >= 0 -> (...).  Zero for x < 0; infinite at x = 0 for n = 1.  Mean
    n + lambda, variance 2 (n + 2 lambda).  ValueError outside these ranges.  MAT Definitions 5 and 6, exercise 1.12.

    >>> float(chi_square_density(1.0, 2).round(6))                 # exp(-1/2) / 2
    0.303265
    """
    from scipy.special import gammaln, hyp0f1, ive, xlogy
    x, nc, n = finite("x", x), _noncentrality(noncentrality), degrees_of_freedom(n)
    x, nc = np.broadcast_arrays(x, nc)
    half, inside = 0.5 * n, np.maximum(x, 0.0)
    z = np.sqrt(nc * inside)
    near = z < max(50.0, half)                            # there I_nu(z) may underflow: use its power series 0F1
    power = xlogy(half - 1.0, np.where(inside > 0.0, 0.5 * inside, 1.0)) - 0.5 * (inside + nc) - gammaln(half)
    series = 0.5 * np.exp(power) * hyp0f1(half, np.where(near, 0.25 * nc * inside, 0.0))
    ratio = np.where(near, 1.0, inside) / np.where(near, 1.0, nc)
    gap = np.sqrt(inside) - np.sqrt(nc)
    bessel = 0.5 * np.exp(-0.5 * np.square(gap) + (0.5 * half - 0.5) * np.log(ratio)) * ive(half - 1.0, z)
    at_zero = np.inf if n == 1 else 0.5 * np.exp(-0.5 * nc) if n == 2 else 0.0
    f = np.where(near, np.where(inside > 0.0, series, at_zero), bessel)
    return np.where(x < 0.0, 0.0, f)


def chebyshev_level(probability: ArrayLike, n: int) -> Array:
    """c = n / (1 - probability):  P((x - mu)' P^-1 (x - mu) < c) >= probability for every law with this mean and P.

    probability (...) in [0, 1), n >= 1 -> c (...).  Holds for deviations from the mean only.  ValueError outside
    these ranges.  MAT (2.9).

    >>> float(chebyshev_level(0.95, 2).round(9))
    40.0
    """
    return degrees_of_freedom(n) / (1.0 - _probability(probability))


def ellipse(g: Gaussian, level: ArrayLike, points: int = 91) -> Array:
    """mu + sqrt(c) P^(1/2) [cos t, sin t]',  0 <= t <= 2 pi.

    g with mean (..., 2) and cov (..., 2, 2), level c (...) a squared Mahalanobis radius (see `chi_square_level`) ->
    (..., points, 2), a closed line: the last point repeats the first.  A singular covariance gives a segment walked
    to and fro, a zero one a point.  ValueError for another dimension, an indefinite cov or a negative level.
    MAT Fig 1.1, exercise 1.10.

    >>> ellipse(Gaussian(np.array([9.0, 9.0]), np.diag([4.0, 1.0])), 1.0, points=5).round(12).tolist()
    [[11.0, 9.0], [9.0, 10.0], [7.0, 9.0], [9.0, 8.0], [11.0, 9.0]]
    """
    mean, P = finite("mean", g.mean, 2), covariance("cov", g.cov, 2)
    c = _level(level)
    if points < 4:
        raise ValueError(f"points: expected at least 4, got {points}")
    t = np.linspace(0.0, 2.0 * np.pi, points)
    circle = np.stack([np.cos(t), np.sin(t)], axis=-1)
    circle[-1] = circle[0]
    return np.sqrt(c)[..., None, None] * (circle @ sqrt_psd(P)) + mean[..., None, :]


def ellipsoid(g: Gaussian, level: ArrayLike) -> Axes:
    """semi-axes sqrt(c lambda_i) along the eigenvectors q_i of P.

    g with mean (..., n) and cov (..., n, n), level c (...) a squared Mahalanobis radius -> center (..., n), semi_axes
    (..., n) in falling order, directions (..., n, n): orthonormal columns with determinant 1, so in 3-D a rotation
    from the axes of the ellipsoid to those of x.  ValueError for an indefinite cov or a negative level.
    MAT Example 7.

    >>> ellipsoid(Gaussian(np.zeros(2), [[16.0, 24.0], [24.0, 52.0]]), 1.0).semi_axes.round(12).tolist()
    [8.0, 2.0]
    """
    mean = finite("mean", g.mean, None)
    values, Q = schur(covariance("cov", g.cov, mean.shape[-1]))
    Q = Q.copy()
    Q[..., :, -1] *= np.sign(np.linalg.det(Q))[..., None]
    semi_axes = np.sqrt(_level(level))[..., None] * np.sqrt(np.maximum(values, 0.0))
    batch = np.broadcast_shapes(mean.shape[:-1], semi_axes.shape[:-1])
    n = mean.shape[-1]
    return Axes(*(np.broadcast_to(a, (*batch, *s)) for a, s in ((mean, (n,)), (semi_axes, (n,)), (Q, (n, n)))))


def degrees_of_freedom(n: int) -> int:
    """n as an int, ValueError unless it is a whole number >= 1."""
    if n != int(n) or n < 1:
        raise ValueError(f"n: expected a whole number of at least 1, got {n}")
    return int(n)


def _probability(probability: ArrayLike) -> Array:
    p = finite("probability", probability)
    if np.any((p < 0.0) | (p >= 1.0)):
        raise ValueError(f"probability: expected at least 0 and below 1, got {p[(p < 0.0) | (p >= 1.0)].flat[0]:g}")
    return p


def _noncentrality(value: ArrayLike) -> Array:
    nc = finite("noncentrality", value)
    if np.any(nc < 0.0):
        raise ValueError(f"noncentrality: expected at least 0, got {nc.min():g}")
    return nc


def _level(level: ArrayLike) -> Array:
    c = finite("level", level)
    if np.any(c < 0.0):
        raise ValueError(f"level: expected a squared radius of at least 0, got {c.min():g}")
    return c
