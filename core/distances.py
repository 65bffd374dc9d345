"""Differences and distances between states and known points, rows first so that a large batch stays contiguous."""

import numpy as np

from core.stacks import zero_stack
from core.types import Array


def offsets_to(x: Array, points: Array) -> list[Array]:
    """x_j - s_ij for each coordinate j, shape (m, ...): rows first, so that the batch axes stay contiguous."""
    extra = (1,) * (x.ndim - 1)
    return [x[..., j] - points[:, j].reshape(-1, *extra) for j in range(points.shape[1])]


def squared(offsets: list[Array]) -> Array:
    """|x - s_i|^2, shape (m, ...)."""
    total = offsets[0] * offsets[0]
    for d in offsets[1:]:
        total += d * d
    return total


def squared_distances(x: Array, points: Array) -> Array:
    """|x - s_i|^2 for x (..., >= d) and points (m, d), shape (m, ...)."""
    if x.ndim == 1:
        return squared(offsets_to(x, points))
    rows = np.empty((len(points), *x.shape[:-1]))
    d = np.empty(x.shape[:-1])                            # two vectors in the cache instead of many in memory
    for row, point in zip(rows, points, strict=True):
        np.subtract(x[..., 0], point[0], out=row)
        np.multiply(row, row, out=row)
        for j in range(1, len(point)):
            np.subtract(x[..., j], point[j], out=d)
            np.multiply(d, d, out=d)
            np.add(row, d, out=row)
    return rows


def nonzero(r: Array) -> Array:
    """r with 1 in the place of 0 (and of what is as good as 0), so that 0 / r is 0 at a station."""
    return np.where(r > 1e-300, r, 1.0)


def rows_last(rows: Array) -> Array:
    """(m, ...) -> (..., m) without copying."""
    return np.moveaxis(rows, 0, -1)


def unit_rows(x: Array, points: Array) -> tuple[Array, Array]:
    """(x - s_i) / |x - s_i| as (..., m, n) with zero columns after the position, and |x - s_i| as (m, ...)."""
    offsets = offsets_to(x, points)
    r = np.sqrt(squared(offsets))
    J = zero_stack(x.shape[:-1], len(points), x.shape[-1])
    scale = 1.0 / nonzero(r)
    for j, d in enumerate(offsets):
        J[..., j] = rows_last(d * scale)
    return J, r
