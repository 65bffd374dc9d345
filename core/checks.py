"""Validation at the boundary: every message says what was expected and what came."""

import numpy as np

from core.types import Array


def finite(name: str, value: object, *shape: int | None) -> Array:
    """value as a float64 array whose last axes are `shape` (None: any length) and whose entries are finite.

    Raises ValueError otherwise.  The array may be the caller's own: never write to it.

    >>> finite("x", [1, 2], 2)
    array([1., 2.])
    """
    try:
        a = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, got {value!r}") from None
    if shape:
        tail = a.shape[-len(shape):]
        if a.ndim < len(shape) or any(s is not None and s != t for s, t in zip(shape, tail, strict=True)):
            wanted = ", ".join(["...", *("n" if s is None else str(s) for s in shape)])
            raise ValueError(f"{name}: expected shape ({wanted}), got {a.shape}")
    if not np.isfinite(a).all():
        raise ValueError(f"{name}: expected finite numbers, got {a[~np.isfinite(a)].flat[0]}")
    return a


def covariance(name: str, value: object, n: int | None = None) -> Array:
    """value as a symmetric positive semidefinite matrix (..., n, n).

    Raises ValueError for a wrong shape, a non-finite or asymmetric matrix, or an eigenvalue that is negative beyond
    round-off.  Cholesky decides the usual positive definite case; eigenvalues are computed only when it fails.
    """
    P = finite(name, value, n, n)
    if P.shape[-1] != P.shape[-2]:
        raise ValueError(f"{name}: expected a square matrix, got shape {P.shape}")
    scale = np.abs(P).max(axis=(-2, -1), initial=0.0)
    asymmetry = np.abs(P - P.mT).max(axis=(-2, -1), initial=0.0)
    if (asymmetry > 1e-8 * scale).any():
        raise ValueError(f"{name}: expected a symmetric matrix, got an asymmetry of {asymmetry.max():.3g}")
    try:
        np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        smallest = np.linalg.eigvalsh(P).min(axis=-1)
        if (smallest < -1e-8 * scale).any():
            raise ValueError(
                f"{name}: expected a positive semidefinite matrix, got the eigenvalue {smallest.min():.3g}"
            ) from None
    return P
