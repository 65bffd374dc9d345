"""Level lines of a grid by marching squares."""

import numpy as np

from core.types import Array


def contour_segments(x: Array, y: Array, z: Array, level: float) -> Array:
    """The segments (n, 2, 2) of {z = level} over the grid x, y; z (len(y), len(x)).

    Each cell is cut into two triangles, so that there are no ambiguous cells.
    """
    xx, yy = np.meshgrid(x, y)
    corner = np.stack([xx, yy, np.asarray(z, dtype=np.float64) - level], axis=-1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    triangles = np.concatenate([np.stack([a, b, c], axis=-2).reshape(-1, 3, 3),
                                np.stack([a, c, d], axis=-2).reshape(-1, 3, 3)])
    above = triangles[..., 2] > 0
    crossed = triangles[above.any(axis=1) & ~above.all(axis=1)]
    if len(crossed) == 0:
        return np.zeros((0, 2, 2))
    above = crossed[..., 2] > 0
    # the corner that is alone on its side of the level
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(crossed))
    tip = crossed[rows, lone]
    ends = []
    for shift in (1, 2):
        other = crossed[rows, (lone + shift) % 3]
        t = tip[:, 2] / (tip[:, 2] - other[:, 2])
        ends.append(tip[:, :2] + t[:, None] * (other[:, :2] - tip[:, :2]))
    return np.stack(ends, axis=1)
