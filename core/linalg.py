"""Matrix facts behind estimation: spectral and triangular roots, subspaces, least squares.  MAT 1.1-1.2."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.types import Array

_EPS = np.finfo(np.float64).eps


class Spectrum(NamedTuple):
    """A = Q diag(values) Q': values (..., n) in falling order, Q (..., n, n) with the eigenvectors as columns."""

    values: Array
    Q: Array


class Subspaces(NamedTuple):
    """Orthonormal bases as columns: column_space (m, rank), null_space (n, n - rank); rank, a whole number."""

    rank: int
    column_space: Array
    null_space: Array


class LeastSquares(NamedTuple):
    """The terms of MAT (1.5)-(1.6): x (..., n), y_hat = A x and residual = y - A x (..., m), cost (...), A'WA (n, n).

    cost is the weighted sum of squared residuals; `information` is A'WA, the inverse of V(x) if W is V(y)^-1.
    """

    x: Array
    y_hat: Array
    residual: Array
    cost: Array
    information: Array


def symmetric(name: str, A: ArrayLike) -> Array:
    """A, after checking that A = A'.  A (..., n, n); ValueError for any other shape, NaN or an asymmetric matrix."""
    A = finite(name, A, None, None)
    if A.shape[-1] != A.shape[-2]:
        raise ValueError(f"{name}: expected a square matrix, got shape {A.shape}")
    asymmetry, scale = np.abs(A - A.mT).max(initial=0.0), np.abs(A).max(initial=0.0)
    if asymmetry > 1e-8 * scale:
        raise ValueError(f"{name}: expected a symmetric matrix, got an asymmetry of {asymmetry:.3g}")
    return A


def schur(A: ArrayLike) -> Spectrum:
    """A = Q diag(lambda) Q'  for A = A'.

    A (..., n, n) symmetric -> eigenvalues (..., n) in falling order and orthonormal eigenvectors, each up to its
    sign.  ValueError for an asymmetric matrix.  MAT Theorem 1, (1.2).

    >>> schur([[16.0, 24.0], [24.0, 52.0]]).values.round(12).tolist()
    [64.0, 4.0]
    """
    values, Q = np.linalg.eigh(symmetric("A", A))
    return Spectrum(values[..., ::-1], Q[..., ::-1])


def sqrt_psd(A: ArrayLike) -> Array:
    """A^(1/2) = Q diag(sqrt(lambda)) Q', the one positive semidefinite root: S S = A, S = S'.

    A (..., n, n) symmetric positive semidefinite -> (..., n, n).  ValueError for an asymmetric or indefinite matrix.
    MAT Definition 1.

    >>> sqrt_psd([[16.0, 24.0], [24.0, 52.0]]).round(12).tolist()
    [[3.2, 2.4], [2.4, 6.8]]
    """
    values, Q = np.linalg.eigh(covariance("A", A))
    S = (Q * np.sqrt(np.maximum(values, 0.0))[..., None, :]) @ Q.mT
    return 0.5 * (S + S.mT)


def cholesky_psd(P: ArrayLike) -> Array:
    """P = L L' with L lower triangular and a diagonal >= 0, also for singular P.

    P (..., n, n) symmetric positive semidefinite -> (..., n, n).  A definite matrix gives the Cholesky factor; a
    singular one the triangular factor of a spectral root, scaled by its standard deviations so that units do not
    matter.  ValueError for an asymmetric or indefinite matrix.  MAT footnote p. 5.

    >>> cholesky_psd([[16.0, 24.0], [24.0, 52.0]]).tolist()
    [[4.0, 0.0], [6.0, 4.0]]
    >>> cholesky_psd([[1.0, 2.0], [2.0, 4.0]]).round(12).tolist()
    [[1.0, 0.0], [2.0, 0.0]]
    """
    P = covariance("P", P)
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        if P.ndim == 2:
            return _semidefinite_factor(P)
        flat = P.reshape(-1, *P.shape[-2:])               # in a stack each matrix takes its own way, as if alone
        return np.stack([cholesky_psd(one) for one in flat]).reshape(P.shape)


def cholesky_positive(name: str, P: ArrayLike) -> Array:
    """P = L L' for a matrix that must be invertible.

    P (..., n, n) symmetric -> L (..., n, n) lower triangular.  ValueError unless P is positive definite: a component
    whose variance is explained by the earlier ones to within rounding counts as singular.

    >>> cholesky_positive("P", [[4.0, 0.0], [0.0, 9.0]]).tolist()
    [[2.0, 0.0], [0.0, 3.0]]
    """
    P = symmetric(name, P)
    variances = np.diagonal(P, axis1=-2, axis2=-1)
    try:
        L = np.linalg.cholesky(P)
        unexplained = np.square(np.diagonal(L, axis1=-2, axis2=-1))
        if np.all(unexplained > 8 * P.shape[-1] * _EPS * variances):
            return L
    except np.linalg.LinAlgError:
        pass
    raise ValueError(
        f"{name}: expected a positive definite matrix, got the smallest eigenvalue {np.linalg.eigvalsh(P).min():.3g}"
    )


def solve_vectors(A: ArrayLike, b: ArrayLike) -> Array:
    """x = A^-1 b for vectors.

    A (..., n, n) invertible, b (..., n), broadcast -> (..., n).  One matrix is factorised once for all vectors.

    >>> solve_vectors([[2.0, 0.0], [0.0, 4.0]], [[2.0, 4.0], [4.0, 4.0]]).tolist()
    [[1.0, 1.0], [2.0, 1.0]]
    """
    A, b = np.asarray(A, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if A.ndim == 2:
        return np.linalg.solve(A, b.reshape(-1, b.shape[-1]).T).T.reshape(b.shape)
    return np.linalg.solve(A, b[..., None])[..., 0]


def subspaces(A: ArrayLike) -> Subspaces:
    """R(A) = {A x},  N(A) = {x: A x = 0},  dim N(A) + rank A = n.

    A (m, n) -> orthonormal bases of both from the singular value decomposition.  Singular values below
    max(m, n) eps times the largest count as zero.  ValueError for a wrong shape or a non-finite entry.  MAT 1.1.

    >>> subspaces([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]]).rank
    1
    """
    A = finite("A", A, None, None)
    if A.ndim != 2:
        raise ValueError(f"A: expected one matrix (m, n), got shape {A.shape}")
    U, s, Vt = np.linalg.svd(A)
    rank = int(np.sum(s > max(A.shape) * _EPS * s.max(initial=0.0)))
    return Subspaces(rank, U[:, :rank], Vt[rank:].T)


def projection(A: ArrayLike) -> Array:
    """P = A (A'A)^-1 A' = Q Q', the orthogonal projection on the column space.

    A (..., m, n) of rank n -> (..., m, m), symmetric and idempotent; its diagonal are the leverages of the rows.
    ValueError for dependent columns.  MAT Example 1 with (1.6).

    >>> projection([[1.0], [1.0]]).round(12).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """
    Q, _ = _full_rank_qr(finite("A", A, None, None))
    return Q @ Q.mT


def least_squares(A: ArrayLike, y: ArrayLike, W: ArrayLike | None = None) -> Array:
    """x = argmin (y - A x)' W (y - A x) = (A'WA)^-1 A'W y,  W = I if not given.

    A (..., m, n) of rank n, y (..., m); W one weight per row (m,) or a symmetric positive semidefinite matrix
    (..., m, m); broadcast -> x (..., n).  Solved by QR, not by the normal equations.  ValueError for fewer rows than
    columns, dependent columns or a bad W.  MAT (1.4), (1.6).

    >>> least_squares([[-1, 1], [0, 1], [0, 1], [1, 1], [2, 1]], [0, 0, 1, 1, 2]).round(6).tolist()
    [0.653846, 0.538462]
    """
    return least_squares_fit(A, y, W).x


def least_squares_fit(A: ArrayLike, y: ArrayLike, W: ArrayLike | None = None) -> LeastSquares:
    """|y - A z|^2 = |A (x - z)|^2 + |y - A x|^2  for the minimiser x and every z, in the norm of W.

    The arguments and errors of `least_squares`; returns every term.  MAT (1.5).

    >>> float(least_squares_fit([[1.0], [1.0]], [1.0, 3.0]).cost.round(12))
    2.0
    """
    A = finite("A", A, None, None)
    y = finite("y", y, A.shape[-2])
    B, z = A, y
    if W is not None and np.ndim(W) == 1:
        w = finite("W", W, A.shape[-2])
        if w.min(initial=0.0) < 0.0:
            raise ValueError(f"W: expected weights >= 0, got {w.min():.3g}")
        B, z = np.sqrt(w)[:, None] * A, np.sqrt(w) * y
    elif W is not None:
        Lt = cholesky_psd(covariance("W", W, A.shape[-2])).mT
        B, z = Lt @ A, np.matvec(Lt, y)
    Q, R = _full_rank_qr(B)
    x = solve_vectors(R, np.vecmat(z, Q))
    y_hat = np.matvec(A, x)
    cost = np.square(z - np.matvec(B, x)).sum(axis=-1)
    return LeastSquares(x, y_hat, y - y_hat, cost, R.mT @ R)


def regularized_least_squares(H: ArrayLike, y: ArrayLike, x0: ArrayLike, *, weight: float = 1.0) -> Array:
    """x = argmin |y - H x|^2 + |x0 - x|^2 = (H'H + I)^-1 (H'y + x0);  `weight` multiplies the second term.

    H (..., m, n), y (..., m), x0 (..., n), broadcast -> x (..., n).  Any H will do, as the guess x0 makes the columns
    of the stacked system independent.  ValueError for a wrong shape or a weight that is not positive.
    MAT Example 3, exercise 2.7.

    >>> regularized_least_squares([[1.0]], [4.0], [0.0]).round(12).tolist()
    [2.0]
    """
    H = finite("H", H, None, None)
    y, x0 = finite("y", y, H.shape[-2]), finite("x0", x0, H.shape[-1])
    if not 0.0 < weight < np.inf:
        raise ValueError(f"weight: expected a positive number, got {weight}")
    n, root = H.shape[-1], np.sqrt(weight)
    identity = np.broadcast_to(root * np.eye(n), (*H.shape[:-2], n, n))
    batch = np.broadcast_shapes(y.shape[:-1], x0.shape[:-1])
    right = [np.broadcast_to(y, (*batch, y.shape[-1])), np.broadcast_to(root * x0, (*batch, n))]
    return least_squares(np.concatenate([H, identity], axis=-2), np.concatenate(right, axis=-1))


def _full_rank_qr(A: Array) -> tuple[Array, Array]:
    """A = Q R with Q'Q = I, R upper triangular; ValueError for dependent columns."""
    m, n = A.shape[-2:]
    if m < n:
        raise ValueError(f"A: expected at least as many rows as columns, got shape {A.shape}")
    Q, R = np.linalg.qr(A)
    new = np.abs(np.diagonal(R, axis1=-2, axis2=-1))      # what each column adds to the ones before it
    if np.any(new <= 8 * m * _EPS * np.sqrt(np.square(A).sum(axis=-2))):
        raise ValueError(f"A: expected linearly independent columns, got rank below {n} for shape {A.shape}")
    return Q, R


def _semidefinite_factor(P: Array) -> Array:
    """L of P = L L' from P = B B' and B' = Q R: L = R'.  P (n, n), singular."""
    sd = np.sqrt(np.maximum(np.diagonal(P), 0.0))
    scale = np.where(sd > 0.0, sd, 1.0)
    values, V = np.linalg.eigh(P / np.outer(scale, scale))
    if values[0] < -1e-8 * max(values[-1], 1e-300):
        raise ValueError(f"P: expected a positive semidefinite matrix, got a scaled eigenvalue {values[0]:.3g}")
    R = np.linalg.qr((V * np.sqrt(np.maximum(values, 0.0))).T, mode="r")
    L = np.tril(scale[:, None] * R.T)
    return L * np.where(np.diagonal(L) < 0.0, -1.0, 1.0) + 0.0
