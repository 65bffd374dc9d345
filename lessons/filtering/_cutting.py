"""What of a scene lies in a rectangle: for pictures with several frames side by side."""

from dataclasses import replace

import numpy as np

from core.types import Array
from lessons.kit.curves import clipped
from lessons.kit.scene import HeatMap, Item, Label, LevelEllipse, Particles, Points, Polyline, Segments


def cut(items: list[Item], box: Array) -> list[Item]:
    """What of the items lies in the box: lines are cut or left out, points and labels outside are left out."""
    return [part for item in items if (part := _cut(item, box)) is not None]


def _cut(item: Item, box: Array) -> Item | None:
    match item:
        case Segments():
            pairs = item.pairs[_inside(item.pairs, box).all(axis=1)]
            return replace(item, pairs=pairs) if len(pairs) else None
        case Polyline(dashed=True):
            points = np.asarray(item.points)[_inside(item.points, box)]
            return replace(item, points=points) if len(points) > 1 else None
        case Polyline():
            points = np.asarray(item.points)
            pairs = clipped(np.vstack([points, points[:1]]) if item.closed else points, box)
            return Segments(item.name, pairs, item.role, item.width, item.fade) if len(pairs) else None
        case Points():
            positions = np.asarray(item.positions)[_inside(item.positions, box)]
            return replace(item, positions=positions) if len(positions) else None
        case Particles():
            inside = _inside(item.positions, box)
            if not inside.any():
                return None
            return replace(item, positions=np.asarray(item.positions)[inside],
                           weights=None if item.weights is None else item.weights[inside])
        case HeatMap():
            x, y = (_inside(axis, box[:, i]) for i, axis in enumerate((item.x, item.y)))
            if x.sum() < 2 or y.sum() < 2:
                return None
            return replace(item, x=item.x[x], y=item.y[y], values=item.values[y][:, x])
        case LevelEllipse():
            return item if _inside(np.asarray(item.gaussian.mean)[:2], box) else None
        case Label():
            return item if _inside(np.asarray(item.position)[:2], box) else None
    return item


def _inside(points: Array, box: Array) -> Array:
    """Which points (..., 2) lie in the box (2, 2), or numbers (n,) in the limits (2,)."""
    p = np.asarray(points)
    within = (p >= box[0]) & (p <= box[1])
    return within if box.ndim == 1 else within.all(axis=-1)
