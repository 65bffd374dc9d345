"""Points that the user drags in the scene: the ray under the pointer meets the point's plane or sphere."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from app.controls import Change
from app.draw.primitives import Style
from app.draw.space import Space
from core.types import Array
from lessons.kit.params import Parameter, values

RADIUS = 9.0  # pixels of the standard picture


def where_ray_meets(kind: str, start: Array, origin: Array, through: Array) -> Array | None:
    """Where the ray from `origin` through `through` meets what the point may move on; None when it does not.

    kind "xy": the horizontal plane through start; "sphere": the sphere round the scene's origin through start (its
    nearest point where the ray passes by); "free": the point `through` itself.  All shapes (3,), scene units.
    """
    direction = through - origin
    size = np.sqrt(direction @ direction)
    if not np.isfinite(size) or size < 1e-12:
        return None
    direction = direction / size
    if kind == "free":
        return through
    if kind == "xy":
        if abs(direction[2]) < 1e-6:
            return None
        along = (start[2] - origin[2]) / direction[2]
        return origin + along * direction if along > 0 else None
    radius = np.sqrt(start @ start)
    middle = -(origin @ direction)
    closest = origin + middle * direction
    gap = radius**2 - closest @ closest
    found = closest if gap <= 0 else origin + (middle - np.sqrt(gap)) * direction
    length = np.sqrt(found @ found)
    return found * (radius / length) if length > 1e-12 else None


class Handles:
    """One ball for each draggable point of a lesson; its drags become changes of the scenario."""

    def __init__(self, client: Any, parameters: Mapping[str, Parameter], change: Change,
                 released: Callable[[], None] = lambda: None) -> None:
        """released: called when the user lets a ball go."""
        self._client = client
        self._change = change
        self._released = released
        self.dragging = False
        self._parameters = {name: p for name, p in parameters.items() if p.kind in ("point", "points")}
        self._current: Mapping[str, Any] = {}
        self._balls: dict[str, Any] = {}
        self._drawn: dict[str, tuple[Any, ...]] = {}
        self._space = Space((0.0, 0.0, 0.0), 1.0)

    def show(self, params: Any, style: Style, space: Space, unused: Collection[str] = ()) -> None:
        """Put the balls where the parameters say; there are none for the unused ones."""
        self._current, self._space = values(params), space
        wanted = {name: p for name, p in self._parameters.items() if name not in unused}
        shown: set[str] = set()
        for name, parameter in wanted.items():
            points = self._current[name] if parameter.kind == "points" else [self._current[name]]
            for k, point in enumerate(points):
                key = f"{name}.{k}" if parameter.kind == "points" else name
                shown.add(key)
                at = np.add(point, base_of(parameter, self._current))
                self._show(key, k, parameter, space.display(in_space(at, style)), style)
        for key in set(self._balls) - shown:
            self._discard(key)

    def _show(self, key: str, k: int, parameter: Parameter, at: Array, style: Style) -> None:
        x, y, z = (float(v) for v in at)
        # rounded, as a ball that is made anew for a rounding error would be lost from under the pointer
        color, radius = style.theme.color(parameter.role), round(RADIUS * style.pixel * self._space.scale, 9)
        if self._drawn.get(key) == (color, radius):
            self._balls[key].position = (x, y, z)
            return
        self._discard(key)
        ball = self._client.scene.add_icosphere(f"/handle.{key}", radius, color, subdivisions=2, position=(x, y, z),
                                                cast_shadow=False, receive_shadow=False)
        self._listen(parameter, k, ball)
        self._balls[key], self._drawn[key] = ball, (color, radius)

    def remove(self) -> None:
        for name in list(self._balls):
            self._discard(name)

    @property
    def names(self) -> list[str]:
        return [f"handle.{name}" for name in self._balls]

    def _discard(self, name: str) -> None:
        self._drawn.pop(name, None)
        ball = self._balls.pop(name, None)
        if ball is not None:
            ball.remove()

    def _listen(self, parameter: Parameter, k: int, ball: Any) -> None:
        async def dragged(event: Any) -> None:
            self.dragging = event.phase != "end"
            move(event)
            if not self.dragging:
                self._released()

        def move(event: Any) -> None:
            eye, through = (np.asarray(v, dtype=np.float64) for v in (self._client.camera.position, event.end_position))
            if through.shape != (3,) or not np.isfinite([eye, through]).all():
                return
            origin, start, through = (self._space.scene(v) for v in (eye, ball.position, through))
            found = where_ray_meets(parameter.plane, start, origin, through)
            if found is None:
                return
            point = picked(parameter, found, self._current)
            if parameter.kind == "point":
                self._change({parameter.name: parameter.nearest(point)})
            elif k < len(points := self._current[parameter.name]):
                self._change({parameter.name: parameter.nearest([*points[:k], point, *points[k + 1:]])})

        ball.on_drag("left")(dragged)


def in_space(point: Any, style: Style) -> tuple[float, float, float]:
    """The point of 2 or 3 coordinates where its handle is drawn, in scene units."""
    x, y, *z = point
    # above the flat layers of a plane view
    return (x, y, z[0] if z else (40 * style.pixel if style.layered else 0.0))


def base_of(parameter: Parameter, current: Mapping[str, Any]) -> Any:
    """What the parameter's point is an offset from, among the current values."""
    return current[parameter.about] if parameter.about else 0.0


def picked(parameter: Parameter, place: Array, current: Mapping[str, Any]) -> tuple[float, ...]:
    """The point that means this place (3,) of the scene, with decimals for about a thousandth of the range."""
    n = len(parameter.default) if parameter.kind == "point" else 2  # type: ignore[arg-type]
    digits = max(0, 3 - int(np.floor(np.log10(parameter.high - parameter.low))))
    return tuple(round(float(v), digits) + 0.0 for v in place[:n] - base_of(parameter, current))  # no minus zero
