"""QR factors of many small matrices at once, for iterations and maps over thousands of points.

The matrices are walked through column by column with whole batches as vectors: for a few columns and a large batch
this is several times faster than LAPACK called for each matrix, and as accurate for least squares (the right side is
carried along).
"""

from typing import NamedTuple

import numpy as np

from core.types import Array

_EPS = np.finfo(np.float64).eps


class Factors(NamedTuple):
    """A = Q R with R upper triangular: R (..., n, n), Q'b (..., n), singular (...): A has dependent columns.

    R and Q'b of a singular A hold the rows of the columns that are independent; do not solve with them.
    """

    R: Array
    Qb: Array
    singular: Array


def factorise(A: Array, b: Array | None = None) -> Factors:
    """A = Q R,  Q'Q = I, and Q'b, by modified Gram-Schmidt.

    A (..., m, n) and b (..., m), broadcast (b zero if not given).  A column counts as dependent if the ones before it
    explain it to within rounding.  No checks: callers pass finite arrays.  Bjorck, Numerical Methods for Least
    Squares Problems, 2.4.

    >>> factorise(np.array([[3.0, 0.0], [4.0, 5.0]]), np.array([5.0, 5.0])).R.round(12).tolist()
    [[5.0, 4.0], [0.0, 3.0]]
    """
    m, n = A.shape[-2:]
    columns = [np.ascontiguousarray(np.moveaxis(A[..., j], -1, 0)) for j in range(n)]     # rows first: (m, ...)
    b = None if b is None else np.ascontiguousarray(np.moveaxis(b, -1, 0))
    batch = columns[0].shape[1:] if b is None else np.broadcast_shapes(columns[0].shape[1:], b.shape[1:])
    R, Qb = np.zeros((n, n, *batch)), np.zeros((n, *batch))
    singular = np.zeros(batch, dtype=bool)
    sizes = [np.square(c).sum(axis=0) for c in columns]
    for j in range(n):
        square = np.square(columns[j]).sum(axis=0)
        dependent = square <= (8.0 * m * _EPS) ** 2 * sizes[j]
        singular |= dependent
        R[j, j] = np.sqrt(square)
        q = columns[j] / np.where(dependent, 1.0, R[j, j])
        for k in range(j + 1, n):
            R[j, k] = (q * columns[k]).sum(axis=0)
            columns[k] = columns[k] - R[j, k] * q
        if b is not None:
            Qb[j] = (q * b).sum(axis=0)
            b = b - Qb[j] * q
    return Factors(np.moveaxis(R, (0, 1), (-2, -1)), np.moveaxis(Qb, 0, -1), singular)


def back_substitute(factors: Factors) -> Array:
    """x = R^-1 Q'b, the least-squares solution, shape (..., n); NaN where A has dependent columns."""
    R, n = factors.R, factors.R.shape[-1]
    x: list[Array] = [np.empty(0)] * n
    diagonal = [np.where(factors.singular, np.nan, R[..., i, i]) for i in range(n)]
    for i in reversed(range(n)):
        rest = factors.Qb[..., i]
        for j in range(i + 1, n):
            rest = rest - R[..., i, j] * x[j]
        x[i] = rest / diagonal[i]
    return np.stack(x, axis=-1)


def inverse_gram(factors: Factors) -> Array:
    """(A'A)^-1 = R^-1 R^-T, shape (..., n, n), exactly symmetric; NaN where A has dependent columns."""
    R, n = factors.R, factors.R.shape[-1]
    inverse = np.zeros((n, n, *R.shape[:-2]))             # R^-1, upper triangular
    diagonal = [np.where(factors.singular, np.nan, R[..., i, i]) for i in range(n)]
    for j in range(n):
        inverse[j, j] = 1.0 / diagonal[j]
        for i in reversed(range(j)):
            inverse[i, j] = -sum(R[..., i, k] * inverse[k, j] for k in range(i + 1, j + 1)) / diagonal[i]
    G = np.empty_like(inverse)
    for i in range(n):
        for j in range(i, n):
            G[i, j] = sum(inverse[i, k] * inverse[j, k] for k in range(j, n))
            G[j, i] = G[i, j]
    return np.moveaxis(G, (0, 1), (-2, -1))
