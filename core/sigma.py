"""Sigma points and the unscented transform.  MAT 3.3.2, (3.16)-(3.17).

The 2n + 1 points lie at x and at x +- sqrt(n + kappa) times the columns of a root L of P.  What the images do in
opposite directions splits into an odd part, g_i = [f(x + d_i) - f(x - d_i)] / (2 sqrt(n + kappa)), which acts like a
Jacobian times L, and an even part e_i = [f(x + d_i) + f(x - d_i)] / 2 - f(x), which is curvature.  With G = [g_1 ...]
and b = sum e_i / (n + kappa) the sums of (3.16) are

    mean = f(x) + b,   cross = L G',   cov = G G' + M,   M = sum e_i e_i' / (n + kappa) - b b'.

M >= 0 for kappa >= 0.  With kappa < 0 (kappa = 3 - n for n > 3) it can be indefinite, and so can everything that is
built on it (erratum M17).  Wherever the covariance that is wanted, noise included, is not positive semidefinite, the
deviations are taken from f(x) instead of from the mean, which leaves out - b b' (the modified form of Julier and
Uhlmann); `definite` is False there, so that a lesson can say so.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from core.linalg import sqrt_psd
from core.stacks import (
    batch_last,
    cholesky,
    empty_stack,
    is_batch_last,
    is_finite,
    law,
    lower_root,
    symmetric,
    times,
)
from core.types import Array, Gaussian

Root = Literal["cholesky", "symmetric"]
Difference = Callable[[Array, Array], Array]


class SigmaPoints(NamedTuple):
    """points (..., 2n + 1, n): x, x + d_1, ..., x + d_n, x - d_1, ..., x - d_n; weights (2n + 1,), sum 1."""

    points: Array
    weights: Array


class Transform(NamedTuple):
    """Moments of f(x): mean (..., m), cov (..., m, m), cross = cov(x, f(x)) (..., n, m).

    points (..., 2n + 1, n), their images (..., 2n + 1, m), weights (2n + 1,).  definite (...): False where the
    covariance of (3.16) was indefinite and the modified form stands in for it.
    """

    mean: Array
    cov: Array
    cross: Array
    points: Array
    images: Array
    weights: Array
    definite: Array


class Parts(NamedTuple):
    """Odd part G (..., m, n), even part M (..., m, m), shift b and mean (..., m) of the images; root L, points."""

    L: Array
    points: Array
    images: Array
    mean: Array
    b: Array
    G: Array
    M: Array


def sigma_points(g: Gaussian, kappa: float, root: Root = "cholesky") -> SigmaPoints:
    """chi_0 = x,  chi_i = x +- sqrt(n + kappa) L e_i;  w_0 = kappa / (n + kappa),  w_i = 1 / (2 (n + kappa)).

    g: mean (..., n), cov (n, n) or (..., n, n), possibly singular.  root: columns of the lower Cholesky factor or of
    the symmetric root.  Both sets have the mean and covariance of g.  ValueError for kappa <= -n.  MAT (3.17).

    >>> sigma_points(Gaussian(np.zeros(1), np.eye(1)), 2.0).weights.round(4)
    array([0.6667, 0.1667, 0.1667])
    """
    x, P = law("g", g)
    weights = sigma_weights(x.shape[-1], kappa)
    return SigmaPoints(_points(x, root_of(P, root), kappa), weights)


def transform(
    f: Callable[[Array], Array],
    g: Gaussian,
    kappa: float,
    *,
    difference: Difference = np.subtract,
    root: Root = "cholesky",
) -> Transform:
    """E f = sum w_i f_i,  V f = sum w_i (f_i - E f)(f_i - E f)',  cov(x, f) = sum w_i (chi_i - x)(f_i - E f)'.

    f maps (..., n) to (..., m), f_i = f(chi_i); g as in `sigma_points`.  difference(a, b) gives a - b for outputs
    that are angles (pass a sensor's `innovation`): images are averaged by their differences from the centre's image.
    The mean is exact for polynomials of third degree.  ValueError for kappa <= -n or images that are not finite.
    MAT (3.16).

    >>> t = transform(lambda x: x**2, Gaussian(np.array([1.0]), np.array([[4.0]])), 2.0)
    >>> t.mean.round(9), t.cov.round(9)
    (array([5.]), array([[48.]]))
    """
    x, P = law("g", g)
    weights = sigma_weights(x.shape[-1], kappa)
    parts = split(f, x, root_of(P, root), kappa, difference)
    cov, definite = safe(symmetric(times(parts.G, parts.G.mT)) + parts.M, parts.b, kappa)
    return Transform(parts.mean, cov, times(parts.L, parts.G.mT), parts.points, parts.images, weights, definite)


def sigma_weights(n: int, kappa: float) -> Array:
    """w_0 = kappa / (n + kappa),  w_i = 1 / (2 (n + kappa)), shape (2n + 1,).  ValueError for kappa <= -n."""
    try:
        valid = kappa > -n and np.isfinite(kappa)
    except TypeError:
        valid = False
    if not valid:
        raise ValueError(f"kappa: expected a number > -n = {-n}, got {kappa!r}")
    w = np.full(2 * n + 1, 0.5 / (n + kappa))
    w[0] = kappa / (n + kappa)
    return w


def root_of(P: Array, root: Root) -> Array:
    """L with L L' = P, of the kind that is asked for."""
    if root == "symmetric":
        return sqrt_psd(P)
    if root != "cholesky":
        raise ValueError(f"root: expected 'cholesky' or 'symmetric', got {root!r}")
    return lower_root(P)


def split(f: Callable[[Array], Array], x: Array, L: Array, kappa: float, difference: Difference) -> Parts:
    """The images of the sigma points of x (..., n) and L (..., n, n), in odd and even parts."""
    n = x.shape[-1]
    points = _points(x, L, kappa)
    images = images_of(f, points)
    d = difference(images[..., 1:, :], images[..., :1, :])
    plus, minus = d[..., :n, :], d[..., n:, :]
    G = ((plus - minus) * (0.5 / np.sqrt(n + kappa))).mT
    even = (plus + minus) * 0.5
    b = even.sum(axis=-2) / (n + kappa)
    M = symmetric(times(even.mT, even)) / (n + kappa) - b[..., :, None] * b[..., None, :]
    return Parts(L, points, images, images[..., 0, :] + b, b, G, M)


def images_of(f: Callable[[Array], Array], points: Array) -> Array:
    """f(points), checked: shape (..., 2n + 1, m) and finite."""
    images = np.asarray(f(points), dtype=np.float64)
    if images.shape[:-1] != points.shape[:-1]:
        raise ValueError(f"f: expected images of shape {points.shape[:-1]} and a last axis, got {images.shape}")
    if not is_finite(images):
        raise ValueError("f: expected finite images of the sigma points, got NaN or infinity")
    return batch_last(images, 2) if is_batch_last(points) and not is_batch_last(images) else images


def safe(A: Array, b: Array, kappa: float) -> tuple[Array, Array]:
    """A where it is positive semidefinite and A + b b' elsewhere; and a flag (...) for the first."""
    if kappa >= 0:
        return A, np.ones(A.shape[:-2], dtype=bool)
    definite = is_definite(A)
    if definite.all():
        return A, definite
    return np.where(definite[..., None, None], A, A + b[..., :, None] * b[..., None, :]), definite


def is_definite(A: Array) -> Array:
    """True (...) where A (..., n, n) is positive semidefinite to within rounding."""
    if cholesky(A) is not None:
        return np.ones(A.shape[:-2], dtype=bool)
    values = np.linalg.eigvalsh(A)
    return values[..., 0] >= -1e-12 * np.abs(values).max(axis=-1)


def _points(x: Array, L: Array, kappa: float) -> Array:
    n = x.shape[-1]
    d = np.sqrt(n + kappa) * L.mT                         # rows are the columns of L
    points = empty_stack(np.broadcast_shapes(x.shape[:-1], L.shape[:-2]), 2 * n + 1, n)
    points[..., 0, :] = x
    np.add(x[..., None, :], d, out=points[..., 1:n + 1, :])
    np.subtract(x[..., None, :], d, out=points[..., n + 1:, :])
    return points
