"""How far walls and doors are at least: a raster per area, so that most particles need no geometry at all."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.indoor.cloud import Numbers
from core.indoor.geometry import nearest_on_border
from core.indoor.graph import FloorGraph
from core.indoor.map_arrays import map_arrays
from core.types import Array

_CELL_M = 0.5
_MOST_CELLS = 40_000


class Clearance(NamedTuple):
    """Square cells over the bounding box of each area a: the cell of (x, y) has the number

        first[a] + floor((y - y0[a]) per_m[a]) columns[a] + floor((x - x0[a]) per_m[a])

    and walls[cell], doors[cell] <= the distances from any of its points to the nearest wall and the nearest door.
    """

    walls: Array
    doors: Array
    first: Numbers
    columns: Numbers
    x0: Array
    y0: Array
    per_m: Array

    def near(
        self, a: Numbers, x: Array, y: Array, wall_m: Array, door_m: Array
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which of the points (x, y) (M,) in areas a (M,) may be within wall_m of a wall, and which of a door."""
        scale = self.per_m[a]
        column = (x - self.x0[a]) * scale
        row = (y - self.y0[a]) * scale
        cell = row.astype(np.intp)
        cell *= self.columns[a]
        cell += column.astype(np.intp)
        cell += self.first[a]
        return self.walls.take(cell, mode="clip") <= wall_m, self.doors.take(cell, mode="clip") <= door_m


def clearance(graph: FloorGraph) -> Clearance:
    """|c - nearest wall or door| - half the diagonal of a cell, c the middle of the cell; made once."""
    return graph.cached("clearance", lambda: _make(graph))


def _make(graph: FloorGraph) -> Clearance:
    maps = map_arrays(graph)
    walls, doors, first, columns, low, cells = [], [], [], [], [], []
    count = 0
    for k, area in enumerate(graph.areas.values()):
        P = area.polygon
        size = P.max(axis=0) - P.min(axis=0)
        cell = max(_CELL_M, float(np.sqrt(size.prod() / _MOST_CELLS)))
        x0, y0 = P.min(axis=0) - cell                     # a rim of cells outside catches round-off
        nx, ny = (np.ceil(size / cell) + 2).astype(int)
        centres = np.stack(np.meshgrid(x0 + cell * (np.arange(nx) + 0.5), y0 + cell * (np.arange(ny) + 0.5)), axis=-1)
        centres = centres.reshape(-1, 2)
        loss = cell / np.sqrt(2.0)
        walls.append(nearest_on_border(P, centres).distance - loss)
        to_doors = np.square(centres[:, None] - maps.doors[k]).sum(axis=-1)
        doors.append(np.sqrt(to_doors.min(axis=1, initial=1e18)) - loss)
        first.append(count)
        columns.append(nx)
        low.append((x0, y0))
        cells.append(cell)
        count += nx * ny
    x0, y0 = np.array(low).reshape(-1, 2).T.copy()
    walls, doors = (np.concatenate(c) if c else np.zeros(1) for c in (walls, doors))
    return Clearance(walls, doors, np.array(first, np.intp), np.array(columns, np.intp), x0, y0, 1.0 / np.array(cells))
