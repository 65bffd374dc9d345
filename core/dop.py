"""How the geometry of the measurements multiplies their errors: DOP numbers, error covariances.  MAT 2.3.1-2.3.2."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.linalg import cholesky_psd
from core.orthogonal import factorise, inverse_gram
from core.types import Array

_EPS = np.finfo(np.float64).eps
_BLOCK = 4096                                             # matrices that are worked on together while in the cache


class Dop(NamedTuple):
    """The DOP numbers (...), None for those that the state does not have; cofactor (J'J)^-1 (..., n, n).

    Infinite (cofactor NaN) where J has dependent columns: there is no solution at such a point.
    """

    gdop: Array
    pdop: Array
    hdop: Array | None
    vdop: Array | None
    tdop: Array | None
    cofactor: Array


def dop(J: ArrayLike, *, clock: bool | None = None) -> Dop:
    """GDOP = sqrt(tr (J'J)^-1); PDOP, HDOP, VDOP, TDOP: the same of the position, horizontal, vertical, clock blocks.

    J (..., m, n), m >= n, with the columns east, north, up (metres per metre; 1 to 3 of them) and, last, the clock.
    The position columns must be in local East-North-Up axes for HDOP and VDOP to mean anything (erratum M7): see
    `local_jacobian`.  The last column is taken for a clock if it is all ones (no range in a solvable geometry has
    such a column) or the fourth; `clock` says it outright.  For equal, independent errors of 1 sigma the error
    covariance is sigma^2 (J'J)^-1.  Leading axes make a map.  ValueError for fewer rows than columns, more than 3
    position columns, or NaN.  MAT 2.3.2, exercise 2.17(b).

    >>> dop([[-1.0, 0.0], [0.0, -1.0]]).hdop.round(6)
    np.float64(1.414214)
    """
    J = finite("J", J, None, None)
    m, n = J.shape[-2:]
    if clock is None:
        clock = n == 4 or (n > 1 and bool((J[..., -1] == 1.0).all()))
    dim = n - bool(clock)
    if not 1 <= dim <= 3:
        raise ValueError(f"J: expected 1 to 3 position columns and perhaps a clock column, got shape {J.shape}")
    if m < n:
        raise ValueError(f"J: expected at least as many rows (measurements) as columns (unknowns), got {J.shape}")
    G = _cofactors(J)
    variances = np.diagonal(G, axis1=-2, axis2=-1)
    pdop = _root(variances[..., :dim])
    return Dop(
        gdop=_root(variances),
        pdop=pdop,
        hdop=pdop.copy() if dim == 2 else _root(variances[..., :2]) if dim == 3 else None,
        vdop=_root(variances[..., 2:3]) if dim == 3 else None,
        tdop=_root(variances[..., dim:]) if clock else None,
        cofactor=G,
    )


def local_jacobian(J: ArrayLike, C: ArrayLike) -> Array:
    """J [C' 0; 0 I]: the same measurements as functions of local coordinates x^L = C (x^E - r_0).

    J (..., m, n) with n >= 3, its first three columns in the axes E; C = C_E^L (..., 3, 3), for instance
    `core.frames.dcm_enu_from_ecef`, broadcast -> (..., m, n).  MAT 2.3.2 with (1.12); erratum M7.

    >>> local_jacobian([[1.0, 0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]).tolist()
    [[0.0, 0.0, 1.0, 1.0]]
    """
    J, C = finite("J", J, None, None), finite("C", C, 3, 3)
    if J.shape[-1] < 3:
        raise ValueError(f"J: expected at least 3 columns, got shape {J.shape}")
    rotated = J[..., :3] @ C.mT
    rest = np.broadcast_to(J[..., 3:], (*rotated.shape[:-1], J.shape[-1] - 3))
    return np.concatenate([rotated, rest], axis=-1)


def position_covariance(J: ArrayLike, W: ArrayLike, Sigma: ArrayLike) -> Array:
    """V(u) = (J'WJ)^-1 J'W Sigma W J (J'WJ)^-1,  the law of the error u = (J'WJ)^-1 J'W v for v ~ N(0, Sigma).

    J (..., m, n) of rank n; W and Sigma: a number, one per row (m,), or symmetric positive semidefinite matrices
    (..., m, m); broadcast -> (..., n, n) in the state's units.  W = I is (2.6); W = Sigma^-1 is the best choice and
    gives (J' Sigma^-1 J)^-1.  ValueError for fewer rows than columns, dependent columns or a bad W or Sigma.
    MAT (2.6), exercise 2.5.

    >>> position_covariance([[1.0], [1.0]], 1.0, [1.0, 9.0]).round(12).tolist()
    [[2.5]]
    """
    J = finite("J", J, None, None)
    m, n = J.shape[-2:]
    if m < n:
        raise ValueError(f"J: expected at least as many rows (measurements) as columns (unknowns), got {J.shape}")
    Lt = cholesky_psd(_matrix("W", W, m)).mT
    Sigma = _matrix("Sigma", Sigma, m)
    A = Lt @ J
    Q, R = np.linalg.qr(A)
    new = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    if (new <= 8 * m * _EPS * np.sqrt(np.square(A).sum(axis=-2))).any():
        raise ValueError(f"J: expected linearly independent columns under the weight W, got rank below {n}")
    K = np.linalg.solve(R, Q.mT @ Lt)                     # (J'WJ)^-1 J'W
    P = K @ Sigma @ K.mT
    return 0.5 * (P + P.mT)


def _cofactors(J: Array) -> Array:
    """(J'J)^-1 (..., n, n), NaN where J has dependent columns."""
    *batch, m, n = J.shape
    flat = J.reshape(-1, m, n) if J.ndim > 2 else J[None]
    G = np.empty((n, n, len(flat)))
    for start in range(0, len(flat), _BLOCK):
        part = slice(start, start + _BLOCK)
        G[..., part] = np.moveaxis(inverse_gram(factorise(flat[part])), 0, -1)
    return np.moveaxis(G, -1, 0).reshape(*batch, n, n)


def _root(variances: Array) -> Array:
    total = variances.sum(axis=-1)
    return np.sqrt(np.where(np.isnan(total), np.inf, total))


def _matrix(name: str, value: ArrayLike, m: int) -> Array:
    """value as (..., m, m): a number or one per row is a diagonal."""
    A = finite(name, value)
    if A.ndim < 2:
        if A.shape not in ((), (m,)):
            raise ValueError(f"{name}: expected a number, {m} numbers or a matrix (..., {m}, {m}), got shape {A.shape}")
        A = np.diag(np.broadcast_to(A, (m,)))
    return covariance(name, A, m)
