"""How far walls and doors are at least: a raster per area, so that most particles need no geometry at all."""

from typing import NamedTuple

import numpy as np

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

    and metres[cell] <= the distance from any of its points to the nearest wall or door.
    """

    metres: Array
    first: Numbers
    columns: Array
    x0: Array
    y0: Array
    per_m: Array

    def at(self, a: Numbers, x: Array, y: Array) -> Array:
        """A lower bound of the clearance of the points (x, y) (M,) in their areas a (M,); 0 outside."""
        scale = self.per_m[a]
        column = (x - self.x0[a]) * scale
        row = (y - self.y0[a]) * scale
        cell = row.astype(np.intp)
        cell *= self.columns[a]
        cell += column.astype(np.intp)
        cell += self.first[a]
        return self.metres.take(cell, mode="clip")


def clearance(graph: FloorGraph) -> Clearance:
    """max(|c - nearest wall or door| - half the diagonal of a cell, 0), c the middle of the cell; made once."""
    return graph.cached("clearance", lambda: _make(graph))


def _make(graph: FloorGraph) -> Clearance:
    maps = map_arrays(graph)
    metres, first, columns, low, cells = [], [], [], [], []
    count = 0
    for k, area in enumerate(graph.areas.values()):
        P = area.polygon
        size = P.max(axis=0) - P.min(axis=0)
        cell = max(_CELL_M, float(np.sqrt(size.prod() / _MOST_CELLS)))
        x0, y0 = P.min(axis=0) - cell                     # a rim of cells outside catches round-off
        nx, ny = (np.ceil(size / cell) + 2).astype(int)
        centres = np.stack(np.meshgrid(x0 + cell * (np.arange(nx) + 0.5), y0 + cell * (np.arange(ny) + 0.5)), axis=-1)
        distance = nearest_on_border(P, centres).distance
        for j in range(len(area.accessor_nodes)):
            distance = np.minimum(distance, np.sqrt(np.square(centres - maps.doors[k, j]).sum(axis=-1)))
        metres.append(np.maximum(distance - cell / np.sqrt(2.0), 0.0).ravel())
        first.append(count)
        columns.append(nx)
        low.append((x0, y0))
        cells.append(cell)
        count += nx * ny
    x0, y0 = np.array(low).reshape(-1, 2).T.copy()
    return Clearance(np.concatenate(metres) if metres else np.zeros(1), np.array(first, np.intp),
                     np.array(columns, np.intp), x0, y0, 1.0 / np.array(cells))
