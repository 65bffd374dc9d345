"""Products, solves and checks that serve one small matrix as well as a stack of them.

For one matrix the cost of a numpy call is its overhead: `dot` and LAPACK's plain routines are used.  For a large stack
it is memory: a stack of small matrices is kept "batch last", so that entry [..., i, j] is one contiguous vector over
the batch, and products are sums of such vectors.  Shapes are (..., m, n) always; only the strides differ.
"""

import math
from functools import cache
from types import ModuleType

import numpy as np

from core import checks
from core.linalg import cholesky_psd
from core.types import Array, Gaussian

_FLOAT = np.dtype(np.float64)
_HALF = np.array(0.5)
_FEW = 64                                                 # numbers that are added faster one by one
_LARGE = 32                                               # a stack of this size gains from being kept batch last
_SMALL = 8                                                # and its matrices, up to this size, from unrolled loops


class Law(Gaussian):
    """A Gaussian that has been checked, or computed from one, and need not be checked again."""

    __slots__ = ()


@cache
def _lapack() -> ModuleType:
    from scipy.linalg import lapack

    return lapack


def frozen(a: object) -> Array:
    """A read-only float64 copy, for a field of an immutable record."""
    out = np.array(a, dtype=np.float64)
    out.setflags(write=False)
    return out


def is_finite(x: Array) -> bool:
    """True if no entry of x (..., n) is NaN or infinite."""
    if x.size <= _FEW:                                    # Python's sum never warns; it may overflow
        return math.isfinite(sum(x.ravel().tolist())) or bool(np.isfinite(x).all())
    with np.errstate(all="ignore"):                       # a sum is cheaper than a mask
        total = x.sum()
    return math.isfinite(total) or bool(np.isfinite(x).all())


def vector(name: str, value: object, n: int) -> Array:
    """value as a finite float64 array (..., n).  ValueError otherwise."""
    x = value if type(value) is np.ndarray and value.dtype is _FLOAT else checks.finite(name, value)
    if x.ndim == 0 or x.shape[-1] != n:
        raise ValueError(f"{name}: expected shape (..., {n}), got {x.shape}")
    return x if is_finite(x) else checks.finite(name, x)


def law(name: str, g: Gaussian) -> Law:
    """g with a finite mean (..., n) and a symmetric positive semidefinite cov (n, n) or (..., n, n).

    Large stacks come back batch last.  Raises ValueError for anything else.
    """
    if type(g) is Law:
        return g
    try:
        x, P = g
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected a Gaussian (mean, cov), got {type(g).__name__}") from None
    # One exactly symmetric matrix with a Cholesky factor is the usual case and is recognised in two microseconds.
    if (type(x) is np.ndarray is type(P) and x.dtype is _FLOAT is P.dtype and x.ndim == 1 and x.size
            and P.shape == x.shape * 2 and P.tobytes() == P.T.tobytes() and math.isfinite(sum(P.ravel().tolist()))
            and _lapack().dpotrf(P)[1] == 0 and is_finite(x)):
        return Law(x, P)
    P = checks.covariance(f"{name} covariance", P)
    x = vector(f"{name} mean", x, P.shape[-1])
    try:
        batch = np.broadcast_shapes(x.shape[:-1], P.shape[:-2])
    except ValueError:
        raise ValueError(f"{name}: expected batch axes of mean and cov that fit, got mean {x.shape} and "
                         f"cov {P.shape}") from None
    if math.prod(batch) >= _LARGE:
        x, P = batch_last(x, 1), batch_last(P, 2)
    return Law(x, P)


def batch_last(a: Array, core: int) -> Array:
    """a, its batch axes contiguous in memory and its last `core` axes not; a copy unless it is already so."""
    last = tuple(range(-core, 0))
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(a, last, tuple(range(core)))), tuple(range(core)), last)


def empty_stack(batch: tuple[int, ...], *core: int) -> Array:
    """An array (*batch, *core) to be filled, batch last."""
    a = np.empty((*core, *batch))
    k = len(core)
    return a.transpose(*range(k, a.ndim), *range(k)) if batch else a


def empty_like(x: Array, m: int) -> Array:
    """An array (..., m) to be filled, for x (..., n), with the axes in x's own order in memory."""
    order = sorted(range(x.ndim), key=lambda i: -x.strides[i])
    shape = (*x.shape[:-1], m)
    return np.empty([shape[i] for i in order]).transpose([order.index(i) for i in range(x.ndim)])


def zero_stack(batch: tuple[int, ...], *core: int) -> Array:
    """Zeros (*batch, *core), batch last."""
    a = empty_stack(batch, *core)
    a[...] = 0.0
    return a


def shared(A: Array) -> Array:
    """The matrix (m, n) of a stack that repeats one matrix without copying it; any other stack unchanged."""
    if A.ndim > 2 and not any(A.strides[:-2]) and A.size:
        return A[(0,) * (A.ndim - 2)]
    return A


def times(A: Array, B: Array) -> Array:
    """A B for one pair of matrices or stacks of them."""
    if A.ndim == 2 == B.ndim:
        return A.dot(B)
    if is_batch_last(A) or is_batch_last(B):
        out = empty_stack(np.broadcast_shapes(A.shape[:-2], B.shape[:-2]), A.shape[-2], B.shape[-1])
        return np.einsum("...ik,...kj->...ij", A, B, out=out)
    return A @ B


def apply(A: Array, x: Array) -> Array:
    """A x: A (..., m, n), x (..., n)."""
    if A.ndim == 2:
        if x.ndim == 1:
            return A.dot(x)
        if x.strides[-1] == x.itemsize:
            return (x.reshape(-1, x.shape[-1]) @ A.T).reshape(*x.shape[:-1], A.shape[0])
        out = empty_like(x, A.shape[0])
    else:
        out = empty_stack(np.broadcast_shapes(A.shape[:-2], x.shape[:-1]), A.shape[-2])
    return np.einsum("...ij,...j->...i", A, x, out=out)


def symmetric(A: Array) -> Array:
    """(A + A') / 2."""
    S = A.mT.copy() if A.ndim == 2 else A.mT.copy(order="K")
    S += A
    return np.multiply(S, _HALF, S)


def congruence(A: Array, P: Array) -> Array:
    """A P A' for a symmetric P."""
    if A.ndim == 2 == P.ndim:
        return A.dot(P).dot(A.T)
    return times(times(A, P), A.mT)


def cholesky(P: Array) -> Array | None:
    """L lower triangular with L L' = P, or None unless every matrix is positive definite.  P (..., n, n) symmetric."""
    n = P.shape[-1]
    if not is_batch_last(P) or n > _SMALL:
        try:
            return np.linalg.cholesky(P)
        except np.linalg.LinAlgError:
            return None
    L = zero_stack(P.shape[:-2], n, n)
    for j in range(n):
        d = P[..., j, j]
        for k in range(j):
            d = d - L[..., j, k] * L[..., j, k]
        if not (d > 0).all():
            return None
        L[..., j, j] = np.sqrt(d)
        reciprocal = 1 / L[..., j, j]
        for i in range(j + 1, n):
            s = P[..., i, j]
            for k in range(j):
                s = s - L[..., i, k] * L[..., j, k]
            L[..., i, j] = s * reciprocal
    return L


def solve_spd(S: Array, B: Array) -> Array:
    """X with S X = B: S (..., m, m) symmetric positive definite, B (..., m, n).

    Raises ValueError if S is not positive definite.
    """
    if S.ndim == 2 == B.ndim:
        _, X, info = _lapack().dposv(S, B)
        if info:
            raise ValueError(f"expected a positive definite matrix, got {S.tolist()}")
        return X
    L = cholesky(S)
    if L is None:
        raise ValueError("expected positive definite matrices, got one that is not")
    if not is_batch_last(L):
        return np.linalg.solve(S, B)
    m = S.shape[-1]
    X = [B[..., i, :] for i in range(m)]
    factor = [[L[..., i, j, None] for j in range(i + 1)] for i in range(m)]
    for i in range(m):                                    # L Z = B
        for k in range(i):
            X[i] = X[i] - factor[i][k] * X[k]
        X[i] = X[i] / factor[i][i]
    for i in reversed(range(m)):                          # L' X = Z
        for k in range(i + 1, m):
            X[i] = X[i] - factor[k][i] * X[k]
        X[i] = X[i] / factor[i][i]
    out = empty_stack(np.broadcast_shapes(L.shape[:-2], B.shape[:-2]), m, B.shape[-1])
    for i in range(m):
        out[..., i, :] = X[i]
    return out


def lower_root(P: Array) -> Array:
    """L lower triangular with L L' = P.  P (..., n, n) positive semidefinite: singular ones go a slower way."""
    L = cholesky(P)
    return cholesky_psd(P) if L is None else L


def is_batch_last(A: Array) -> bool:
    """True for a stack whose first, second, ... matrix lie side by side entry by entry."""
    return A.ndim > 2 and A.strides[-3] == A.itemsize and A.strides[-1] != A.itemsize
