"""Linear and quadratic forms of a random vector: a'x, A x against B x, x'Ax.  MAT 1.3.1-1.3.2."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.gaussian import checked
from core.linalg import cholesky_positive
from core.types import Array, Gaussian


class QuadraticForm(NamedTuple):
    """x'Ax ~ chi2(n, noncentrality)."""

    n: int
    noncentrality: float


def correlation(P: ArrayLike) -> Array:
    """R = D P D,  D = diag(1 / sqrt(P_ii)).

    P (..., n, n) a covariance -> (..., n, n) with a diagonal of ones.  ValueError for a zero variance, whose
    correlations are undefined, or an indefinite P.  MAT (1.7).

    >>> correlation([[16.0, 24.0], [24.0, 52.0]]).round(6).tolist()
    [[1.0, 0.83205], [0.83205, 1.0]]
    """
    P = covariance("P", P)
    variances = np.diagonal(P, axis1=-2, axis2=-1)
    if np.any(variances <= 0.0):
        raise ValueError(f"P: expected positive variances, got {variances.min():g}")
    sd = np.sqrt(variances)
    R = P / sd[..., :, None] / sd[..., None, :]
    return np.where(np.eye(P.shape[-1], dtype=bool), 1.0, R)


def cross_covariance(g: Gaussian, A: ArrayLike, B: ArrayLike) -> Array:
    """cov(A x, B x) = A P B'; A x and B x are independent exactly when it is zero.

    g with n components, A (..., k, n), B (..., l, n) -> (..., k, l).  ValueError for shapes that do not match.
    MAT Theorem 5.

    >>> cross_covariance(Gaussian(np.zeros(2), np.eye(2)), [[1.0, 1.0]], [[1.0, -1.0]]).tolist()
    [[0.0]]
    """
    x, P = checked(g)
    return finite("A", A, None, x.shape[-1]) @ P @ finite("B", B, None, x.shape[-1]).mT


def half_space_probability(g: Gaussian, a: ArrayLike, c: ArrayLike) -> Array:
    """P(a'x <= c) = Phi((c - a'mu) / sqrt(a'Pa)).

    g with mean (..., n), a (..., n), c (...) -> (...).  0 or 1 where a'x is constant.  ValueError for a wrong shape
    or an indefinite cov.  MAT exercise 1.11.

    >>> float(half_space_probability(Gaussian(np.array([1.0, -1.0]), [[5.0, -4.0], [-4.0, 5.0]]), [1.0, 1.0], 0.0))
    0.5
    """
    from scipy.special import ndtr
    x, P = checked(g)
    a = finite("a", a, x.shape[-1])
    gap = finite("c", c) - np.vecdot(a, x)
    sd = np.sqrt(np.maximum(np.vecdot(a, np.matvec(P, a)), 0.0))
    return np.where(sd > 0.0, ndtr(gap / np.where(sd > 0.0, sd, 1.0)), np.where(gap >= 0.0, 1.0, 0.0))


def quadratic_form(g: Gaussian, A: ArrayLike) -> QuadraticForm:
    """x'Ax ~ chi2(rank A, mu'A mu)  if A = A' and A P is idempotent.

    g with mean (n,), cov (n, n) positive definite; A (n, n) symmetric.  ValueError if A P A P differs from A P.
    MAT Theorem 6.

    >>> quadratic_form(Gaussian(np.array([3.0]), np.array([[4.0]])), [[0.25]])
    QuadraticForm(n=1, noncentrality=2.25)
    """
    mean = finite("mean", g.mean, None)
    n = mean.shape[-1]
    A, P = finite("A", A, n, n), finite("cov", g.cov, n, n)
    cholesky_positive("cov", P)
    AP = A @ P
    if not np.allclose(A, A.mT) or not np.allclose(AP @ AP, AP, rtol=0.0, atol=1e-9 * max(1.0, np.abs(AP).max())):
        raise ValueError("A: expected a symmetric A with A cov idempotent, got a different product A cov A cov")
    return QuadraticForm(round(float(np.trace(AP))), float(mean @ A @ mean))
