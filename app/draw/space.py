"""Scene units to display units: every view becomes ten units high, round the origin.

viser renders saved pictures with fixed clipping planes and keeps points as float32, so a city and a planet must
both come in at the size of a table.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from app.draw.primitives import Primitive
from core.types import Array
from lessons.kit.scene import Camera, Plane

HEIGHT = 10.0

_POINTS = ("points", "vertices")
_LENGTHS = ("point_size", "shaft_radius", "head_radius", "head_length", "render_width", "render_height")


@dataclass(frozen=True, slots=True)
class Space:
    """display = scale (scene - origin)."""

    origin: tuple[float, float, float]
    scale: float

    def display(self, at: Array | tuple[float, float, float]) -> Array:
        """Points (..., 3) in display units."""
        return (np.asarray(at, dtype=np.float64) - self.origin) * self.scale

    def scene(self, at: Array | tuple[float, float, float]) -> Array:
        """Points (..., 3) in scene units."""
        return np.asarray(at, dtype=np.float64) / self.scale + self.origin

    def place(self, primitives: Iterable[Primitive]) -> list[Primitive]:
        """The primitives in display units."""
        return [self._place(p) for p in primitives]

    def _place(self, p: Primitive) -> Primitive:
        props = dict(p.props)
        for key in _LENGTHS:
            if key in props:
                props[key] = float(props[key] * self.scale)
        for key in _POINTS:
            if key in props:
                props[key] = ((np.asarray(props[key], np.float64) - self.origin) * self.scale).astype(np.float32)
                return Primitive(p.name, p.kind, props, tuple(v * self.scale for v in p.position))
        x, y, z = self.display(p.position)
        return Primitive(p.name, p.kind, props, (float(x), float(y), float(z)))


def space_for(camera: Camera) -> Space:
    """The space in which what `camera` must show is ten units high."""
    if isinstance(camera, Plane):
        height = max(camera.y[1] - camera.y[0], (camera.x[1] - camera.x[0]) / 1.4)
        return Space(((camera.x[0] + camera.x[1]) / 2, (camera.y[0] + camera.y[1]) / 2, 0.0), HEIGHT / height)
    return Space(camera.centre, HEIGHT / 2 / camera.radius)
