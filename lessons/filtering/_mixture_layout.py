"""The pictures of the mixture lesson: the map alone, or the map in a frame with room for the family tree beside it."""

from typing import NamedTuple

import numpy as np

from core.types import Array
from lessons.kit.panels import Panel
from lessons.kit.scene import Item, Plane

X_LABEL, Y_LABEL = "x₁ (m)", "x₂ (m)"


class Layout(NamedTuple):
    """box (2, 2): the corners of the map; tree: the limits of the family tree's columns, or None; camera."""

    box: Array
    tree: tuple[float, float] | None
    camera: Plane

    def frame(self) -> list[Item]:
        """Axes of the map where the camera draws none."""
        if self.camera.axes:
            return []
        low, high = self.box
        pixel = float(high[1] - low[1]) / 620.0
        return [item for item in Panel(low, high, low, high - low).axes("map", ("", X_LABEL, Y_LABEL), pixel)
                if item.name != "map_title"]


def layout(zoom: str) -> Layout:
    """The picture of this name."""
    return LAYOUTS[zoom]


def _with_tree(x: tuple[float, float], y: tuple[float, float]) -> Layout:
    """The map of this box, and at its right a tree that is somewhat wider than high."""
    height = y[1] - y[0]
    tree = (x[1] + 0.12 * height, x[1] + 0.85 * height)
    return Layout(np.column_stack([x, y]), tree,
                  Plane((x[0] - 0.1 * height, tree[1] + 0.07 * height), (y[0] - 0.09 * height, y[1] + 0.1 * height),
                        axes=False))


LAYOUTS = {
    "track": Layout(np.array([[-200.0, -132.0], [50.0, 132.0]]), None,
                    Plane((-200.0, 50.0), (-132.0, 132.0), X_LABEL, Y_LABEL)),
    "tree": _with_tree((-180.0, 15.0), (-135.0, 135.0)),
    "crossing": _with_tree((-165.0, -85.0), (-62.0, 62.0)),
}
