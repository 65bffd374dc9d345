"""Where curves and surfaces of measurements meet: points in the plane, curves and points in space."""

from itertools import combinations

import numpy as np

from core.level_lines import level_lines
from core.types import Array
from lessons.static._surfaces_model import Row, best_places
from lessons.static._surfaces_shapes import Patch, grid

MET = 1e-5                                   # sigmas: a place with smaller residuals fulfils an equation


def crossings(rows: list[Row], assumed_m: float, curves: list[list[Array]]) -> Array:
    """Points (k, 2) where two of the curves cross; each of them once."""
    found = []
    for i, j in combinations(range(len(rows)), 2):
        pieces = [np.stack([c[:-1], c[1:]], axis=1) for c in _fine(curves[i])]
        if pieces:
            found.append(_roots([rows[i], rows[j]], assumed_m, np.concatenate(pieces), rows[j]))
    return distinct(np.concatenate(found)) if found else np.empty((0, 2))


def _fine(pieces: list[Array]) -> list[Array]:
    """A straight line of two points as many short ones."""
    return [c if len(c) > 2 else c[0] + np.linspace(0.0, 1.0, 201)[:, None] * (c[1] - c[0]) for c in pieces]


def _roots(rows: list[Row], assumed_m: float, pairs: Array, last: Row) -> Array:
    """Where `last` changes sign along the segments (m, 2, n), improved until all rows are fulfilled."""
    n = pairs.shape[-1]
    a, b = (last.residual(pairs[:, k], assumed_m) for k in (0, 1))
    change = (a <= 0.0) != (b <= 0.0)
    if not change.any():
        return np.empty((0, n))
    share = (a / np.where(change, a - b, 1.0))[change][:, None]
    starts = pairs[change, 0] + share * (pairs[change, 1] - pairs[change, 0])
    places, _ = best_places(rows, starts, np.array(assumed_m))
    return places[met(rows, places, assumed_m)]


def met(rows: list[Row], places: Array, assumed_m: float) -> Array:
    """Which places (..., n) fulfil all rows."""
    off = np.stack([row.residual(places, assumed_m) / row.sigma for row in rows], axis=-1)
    return (np.abs(off) < MET).all(axis=-1)


def distinct(points: Array) -> Array:
    """The points without repetitions."""
    kept: list[Array] = []
    for x in points:
        if all(np.linalg.norm(x - other) > 1e-3 for other in kept):
            kept.append(x)
    return np.array(kept).reshape(-1, points.shape[-1])


def on_patch(shape: Patch, row: Row, assumed_m: float) -> Array:
    """Segments (m, 2, 3) of the curve in which `row` is fulfilled on a surface."""
    u, v, uu, vv = grid()
    values = row.residual(shape(uu, vv), assumed_m)
    if row.kind != "bearing":
        return _lifted(shape, level_lines(v, u, values))
    pairs = _lifted(shape, level_lines(v, u, np.sin(values)))          # an angle jumps at 180°, its sine does not
    return pairs[(np.abs(row.residual(pairs, assumed_m)) < 1.0).all(axis=1)]


def at_height(shape: Patch, z: float) -> Array:
    """Segments (m, 2, 3) of the surface's cut with a horizontal plane."""
    u, v, uu, vv = grid()
    return _lifted(shape, level_lines(v, u, shape(uu, vv)[..., 2] - z))


def _lifted(shape: Patch, pairs: Array) -> Array:
    return shape(pairs[..., 1], pairs[..., 0])


def triple_points(rows: list[Row], assumed_m: float, curve: Array) -> Array:
    """Points (k, 3) where the curve (m, 2, 3) of two surfaces meets the third."""
    return distinct(_roots(rows, assumed_m, curve, rows[2])) if len(curve) else np.empty((0, 3))
