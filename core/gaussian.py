"""The algebra of normal laws: sampling, density, affine maps, marginals, conditioning, products, mixtures.  MAT 1.3.

Level sets (`chi_square_level`, `ellipse`, ...) live in `core.levels` and can be imported from here too; linear and
quadratic forms of a normal vector are in `core.forms`.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.levels import (
    Axes,
    chebyshev_level,
    chi_square_density,
    chi_square_level,
    chi_square_probability,
    ellipse,
    ellipsoid,
)
from core.linalg import cholesky_positive, cholesky_psd, solve_vectors
from core.types import Array, Gaussian

__all__ = [
    "Axes",
    "Product",
    "affine",
    "chebyshev_level",
    "checked",
    "chi_square_density",
    "chi_square_level",
    "chi_square_probability",
    "condition",
    "ellipse",
    "ellipsoid",
    "log_density",
    "mahalanobis_squared",
    "marginal",
    "mixture_moments",
    "product",
    "regression_gain",
    "sample",
]

_LOG_2PI = np.log(2.0 * np.pi)


class Product(NamedTuple):
    """N(x; m1, P1) N(x; m2, P2) = exp(log_scale) N(x; gaussian): gaussian (..., n), log_scale (...)."""

    gaussian: Gaussian
    log_scale: Array


def sample(
    g: Gaussian, size: int | tuple[int, ...], rng: "np.random.Generator", *,
    root: Callable[[Array], Array] = cholesky_psd,
) -> Array:
    """x = mu + C u  with u ~ N(0, I) and C C' = P.

    g with mean (..., n), cov (..., n, n), singular or not -> (*size, ..., n).  `root` is the C to use: `cholesky_psd`
    or `sqrt_psd`; they turn the same u into different points of the same law.  ValueError for an indefinite cov.
    MAT Theorem 4, Example 8.

    >>> sample(Gaussian(np.zeros(2), np.eye(2)), 5, np.random.default_rng(1)).shape
    (5, 2)
    """
    x, P = checked(g)
    C = root(P)
    batch = np.broadcast_shapes(x.shape[:-1], C.shape[:-2])
    size = (size,) if isinstance(size, (int, np.integer)) else tuple(size)
    u = rng.standard_normal((*size, *batch, x.shape[-1]))
    return x + (u @ C.T if C.ndim == 2 else np.matvec(C, u))


def mahalanobis_squared(g: Gaussian, x: ArrayLike) -> Array:
    """(x - mu)' P^-1 (x - mu).

    g with cov positive definite, x (..., n), broadcast -> (...).  chi2(n) if x has the law g.  ValueError for a
    singular cov or a wrong shape.  MAT Example 10.

    >>> float(mahalanobis_squared(Gaussian(np.zeros(1), np.array([[4.0]])), [6.0]))
    9.0
    """
    mean = finite("mean", g.mean, None)
    L = cholesky_positive("cov", finite("cov", g.cov, mean.shape[-1], mean.shape[-1]))
    return np.square(solve_vectors(L, finite("x", x, mean.shape[-1]) - mean)).sum(axis=-1)


def log_density(g: Gaussian, x: ArrayLike) -> Array:
    """log N(x; mu, P) = -(n log 2 pi + log det P + (x - mu)' P^-1 (x - mu)) / 2.

    g with mean (..., n) and cov (..., n, n) positive definite, x (..., n), broadcast -> (...).  ValueError for a
    singular cov, which has no density, or a wrong shape.  MAT (1.8).

    >>> float(np.exp(log_density(Gaussian(np.zeros(1), np.eye(1)), [0.0])).round(6))
    0.398942
    """
    mean = finite("mean", g.mean, None)
    n = mean.shape[-1]
    L = cholesky_positive("cov", finite("cov", g.cov, n, n))
    z = solve_vectors(L, finite("x", x, n) - mean)
    log_det = 2.0 * np.log(np.diagonal(L, axis1=-2, axis2=-1)).sum(axis=-1)
    return -0.5 * (n * _LOG_2PI + log_det + np.square(z).sum(axis=-1))                     # (1.8)


def affine(g: Gaussian, A: ArrayLike, b: ArrayLike = 0.0) -> Gaussian:
    """A x + b ~ N(A mu + b, A P A').

    g with mean (..., n); A (..., k, n), b (..., k) or a number -> a Gaussian of k components.  ValueError for shapes
    that do not match or an indefinite cov.  MAT Theorems 3 and 4, exercise 1.8.

    >>> affine(Gaussian(np.zeros(2), np.eye(2)), [[1.0, 1.0]], [3.0]).cov.tolist()
    [[2.0]]
    """
    x, P = checked(g)
    A = finite("A", A, None, x.shape[-1])
    b = finite("b", b, A.shape[-2]) if np.ndim(b) else finite("b", b)
    return Gaussian(np.matvec(A, x) + b, _symmetrised(A @ P @ A.mT))


def marginal(g: Gaussian, components: Sequence[int]) -> Gaussian:
    """The law of (x_i) for the chosen components i: those entries of mu, those rows and columns of P.

    g with mean (..., n); components: k different indices from 0 -> a Gaussian of k components, in that order.
    ValueError for an index that is repeated or out of range.

    >>> marginal(Gaussian(np.array([1.0, 2.0]), np.diag([3.0, 4.0])), [1]).mean.tolist()
    [2.0]
    """
    x, P = checked(g)
    n, i = x.shape[-1], [int(c) for c in components]
    if not i or len(set(i)) != len(i) or min(i) < 0 or max(i) >= n:
        raise ValueError(f"components: expected different indices from 0 to {n - 1}, got {list(components)}")
    return Gaussian(x[..., i], P[..., i, :][..., i])


def regression_gain(joint: Gaussian, n_x: int) -> Array:
    """K = P_xy P_yy^-1: x - K y is independent of y.

    joint: law of (x, y) with the first n_x components x -> (..., n_x, n - n_x).  ValueError for a singular P_yy or
    an n_x that leaves no x or no y.  MAT Example 9.

    >>> regression_gain(Gaussian(np.zeros(2), [[16.0, 24.0], [24.0, 52.0]]), 1).round(6).tolist()
    [[0.461538]]
    """
    x, P = checked(joint)
    _split(x.shape[-1], n_x)
    cholesky_positive("covariance of y", P[..., n_x:, n_x:])
    return np.linalg.solve(P[..., n_x:, n_x:], P[..., n_x:, :n_x]).mT


def condition(joint: Gaussian, y: ArrayLike, n_x: int) -> Gaussian:
    """x | y ~ N(mu_x + P_xy P_yy^-1 (y - mu_y),  P_xx - P_xy P_yy^-1 P_yx).

    joint: law of (x, y) with the first n_x components x; y (..., n - n_x) the value of the rest -> law of x.
    ValueError for a singular P_yy, an indefinite cov or a wrong shape.  MAT (1.10), Definition 7.

    >>> posterior = condition(Gaussian(np.zeros(2), [[16.0, 24.0], [24.0, 52.0]]), [-12.0], 1)
    >>> posterior.mean.round(6).tolist(), posterior.cov.round(6).tolist()
    ([-5.538462], [[4.923077]])
    """
    x, P = checked(joint)
    _split(x.shape[-1], n_x)
    y = finite("y", y, x.shape[-1] - n_x)
    L = cholesky_positive("covariance of y", P[..., n_x:, n_x:])
    B = np.linalg.solve(L, P[..., n_x:, :n_x])            # L^-1 P_yx, so that K = B' L^-1
    z = solve_vectors(L, y - x[..., n_x:])
    mean = x[..., :n_x] + np.vecmat(z, B)
    cov = _symmetrised(P[..., :n_x, :n_x] - B.mT @ B)
    batch = np.broadcast_shapes(mean.shape[:-1], cov.shape[:-2])
    return Gaussian(np.broadcast_to(mean, (*batch, n_x)), np.broadcast_to(cov, (*batch, n_x, n_x)))


def product(g1: Gaussian, g2: Gaussian) -> Product:
    """N(x; m1, P1) N(x; m2, P2) = N(m1; m2, P1 + P2) N(x; m, P),  m = m1 + K (m2 - m1),  K = P1 (P1 + P2)^-1.

    g1, g2 with means (..., n), broadcast -> the normalised product, P = P1 - K P1, and the logarithm of its scale.
    One of the covariances may be singular.  ValueError for a singular P1 + P2 or shapes that do not match.
    MAT exercise 2.13.

    >>> product(Gaussian(np.zeros(1), np.eye(1)), Gaussian(np.array([2.0]), np.eye(1))).gaussian.mean.round(9).tolist()
    [1.0]
    """
    (m1, P1), (m2, P2) = checked(g1), checked(g2)
    if m1.shape[-1] != m2.shape[-1]:
        raise ValueError(f"g2: expected {m1.shape[-1]} components as in g1, got {m2.shape[-1]}")
    S = P1 + P2
    log_scale = log_density(Gaussian(m2, S), m1)          # raises for a singular S
    K = np.linalg.solve(S, P1).mT
    A = np.eye(m1.shape[-1]) - K
    P = A @ P1 @ A.mT + K @ P2 @ K.mT
    return Product(Gaussian(m1 + np.matvec(K, m2 - m1), _symmetrised(P)), log_scale)


def mixture_moments(weights: ArrayLike, means: ArrayLike, covs: ArrayLike) -> Gaussian:
    """mu = sum_i w_i mu_i,  P = sum_i w_i (P_i + (mu_i - mu)(mu_i - mu)').

    weights (..., k) >= 0 with sum 1, means (..., k, n), covs (..., k, n, n) -> the Gaussian with the mixture's mean
    and covariance, batch (...).  ValueError for other weights, an indefinite cov or a wrong shape.

    >>> mixture_moments([0.5, 0.5], [[-3.0], [3.0]], [[[1.0]], [[1.0]]]).cov.tolist()
    [[10.0]]
    """
    w, m = finite("weights", weights, None), finite("means", means, None, None)
    k, n = m.shape[-2:]
    w, P = finite("weights", w, k), covariance("covs", finite("covs", covs, k, n, n))
    total = w.sum(axis=-1)
    if np.any(w < 0.0) or np.any(np.abs(total - 1.0) > 1e-9):
        raise ValueError(f"weights: expected numbers >= 0 with sum 1, got the least {w.min():g} and the sum {total}")
    mean = np.vecmat(w, m)
    d = m - mean[..., None, :]
    cov = (w[..., None, None] * P).sum(axis=-3) + (w[..., None] * d).mT @ d
    return Gaussian(mean, _symmetrised(cov))


def checked(g: Gaussian) -> Gaussian:
    """g as float64 arrays; ValueError unless mean (..., n) is finite and cov (..., n, n) positive semidefinite."""
    mean = finite("mean", g.mean, None)
    return Gaussian(mean, covariance("cov", g.cov, mean.shape[-1]))


def _symmetrised(P: Array) -> Array:
    return 0.5 * (P + P.mT)


def _split(n: int, n_x: int) -> None:
    if not 0 < n_x < n:
        raise ValueError(f"n_x: expected from 1 to {n - 1}, so that both x and y have components, got {n_x}")
