"""The lines f = c of a function that is known on a grid.  Marching triangles."""

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.types import Array


def level_lines(x: ArrayLike, y: ArrayLike, f: ArrayLike, level: float = 0.0) -> Array:
    """{(x, y): f(x, y) = level} as segments (n, 2, 2), f linear on two triangles of each cell.

    x (c,) and y (r,) are the axes, f (r, c) the values; y goes with the rows.  The segments come in no order, and
    neighbouring ones share their ends.  None where f never crosses the level; grid points on the level count
    as below it.  ValueError for wrong shapes or values that are not finite.

    >>> level_lines([0.0, 1.0], [0.0, 2.0], [[0.0, 0.0], [1.0, 1.0]], 0.5).tolist()
    [[[0.5, 1.0], [1.0, 1.0]], [[0.5, 1.0], [0.0, 1.0]]]
    """
    x, y = finite("x", x, None), finite("y", y, None)
    f = finite("f", f, len(y), len(x))
    xx, yy = np.meshgrid(x, y)
    p = np.stack([xx, yy, f - level], axis=-1)
    a, b, c, d = (v.reshape(-1, 3) for v in (p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    above = triangles[..., 2] > 0.0
    mixed = above.any(axis=1) & ~above.all(axis=1)
    triangles, above = triangles[mixed], above[mixed]
    # The corner that is alone on its side of the level: both ends lie on its edges.
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    row = np.arange(len(triangles))
    tip = triangles[row, lone]
    others = np.stack([triangles[row, (lone + k) % 3] for k in (1, 2)], axis=1)
    share = tip[:, None, 2] / (tip[:, None, 2] - others[..., 2])
    return tip[:, None, :2] + share[..., None] * (others[..., :2] - tip[:, None, :2])
