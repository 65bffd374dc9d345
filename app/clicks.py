"""Clicks into the scene: the target nearest to the pointer is meant, else the point that follows clicks."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from app.controls import Change
from app.draw.primitives import Style
from app.draw.space import Space
from app.handles import base_of, in_space, picked, where_ray_meets
from core.types import Array
from lessons.kit.lesson import Target
from lessons.kit.params import Parameter, values

REACH = 18.0   # pixels round a target
NEAR = 12.0    # pixels round a point in which a click is none for a new one


class Clicks:
    """What a click does in the lesson shown.  The scene is asked for clicks only where there is something to click."""

    def __init__(self, client: Any, parameters: Mapping[str, Parameter], change: Change,
                 notify: Callable[[str, str], None], height: Callable[[], float]) -> None:
        """height: of the canvas in pixels."""
        self._client, self._change, self._notify, self._height = client, change, notify, height
        self._followers = [p for p in parameters.values() if p.click]
        self._targets: Sequence[Target] = ()
        self._params: Any = None
        self._unused: Collection[str] = ()
        self._space = Space((0.0, 0.0, 0.0), 1.0)
        self._style: Style | None = None
        self._listening = False

    def show(self, params: Any, targets: Sequence[Target], style: Style, space: Space,
             unused: Collection[str] = ()) -> None:
        """Clicks are meant for this view from now on."""
        self._params, self._targets, self._style, self._space, self._unused = params, targets, style, space, unused
        wanted = bool(targets) or self._follower is not None
        if wanted != self._listening:
            self._listening = wanted
            if wanted:
                self._client.scene.on_click()(self._clicked)
            else:
                self._client.scene.remove_click_callback(self._clicked)

    def remove(self) -> None:
        if self._listening:
            self._listening = False
            self._client.scene.remove_click_callback(self._clicked)

    @property
    def _follower(self) -> Parameter | None:
        return next((p for p in self._followers if p.name not in self._unused), None)

    async def _clicked(self, event: Any) -> None:
        origin, direction = (np.asarray(v, dtype=np.float64) for v in (event.ray_origin, event.ray_direction))
        if origin.shape != (3,) or direction.shape != (3,) or not np.isfinite([origin, direction]).all():
            return
        origin, through = (self._space.scene(v) for v in (origin, origin + direction))
        if not (direction := through - origin).any():
            return
        hit = self._nearest([t.position for t in self._targets], origin, direction, REACH)
        if hit is not None:
            self._change(self._targets[hit].changes)
        elif (follower := self._follower) is not None:
            self._follow(follower, origin, through)

    def _follow(self, p: Parameter, origin: Array, through: Array) -> None:
        """Move the point there, or add one."""
        assert self._style is not None
        known: Mapping[str, Any] = values(self._params)
        current = known[p.name]
        stands = np.add(current, base_of(p, known)) if p.kind == "point" else (0.0, 0.0)
        start = np.array(in_space(stands, self._style))
        found = where_ray_meets(p.plane if p.kind == "point" else "xy", start, origin, through)
        if found is None or p.plane == "free":
            return
        point = picked(p, found, known)
        if p.kind == "point":
            self._change({p.name: p.nearest(point)})
        elif len(current) >= p.limit:
            self._notify("No more points", f"{p.limit} points are the most; remove one first.")
        elif self._nearest([in_space(q, self._style) for q in current], origin, through - origin, NEAR) is None:
            self._change({p.name: p.nearest([*current, point])})

    def _nearest(self, positions: Sequence[Sequence[float]], origin: Array, direction: Array,
                 reach: float) -> int | None:
        """The position nearest to the ray on the screen, at most `reach` pixels from it."""
        if not len(positions):
            return None
        at = np.array([(*p, 0.0)[:3] for p in positions], dtype=np.float64) - origin
        u = direction / np.sqrt(direction @ direction)
        along = at @ u
        across = np.sqrt(np.maximum((at**2).sum(axis=1) - along**2, 0.0))
        slope = np.divide(across, along, out=np.full(len(at), np.inf), where=along > 0)
        pixels = slope * self._height() / (2 * np.tan(self._client.camera.fov / 2))
        best = int(np.argmin(pixels))
        return best if pixels[best] <= reach else None
