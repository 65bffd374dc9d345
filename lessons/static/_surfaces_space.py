"""The measurements as surfaces in space: spheres, planes, half-planes, hyperboloids and cones."""

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from core.levels import chi_square_level
from core.types import Array, Gaussian
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import (
    Arrow,
    Ellipsoid,
    Item,
    Orbit,
    Points,
    Polygon,
    Segments,
    Stations,
    Walls,
)
from lessons.static._surfaces_meeting import at_height, met, on_patch, triple_points
from lessons.static._surfaces_model import Row, truth_of, velocity_of
from lessons.static._surfaces_numbers import caption, equations, figures, note, readouts
from lessons.static._surfaces_plane import picture_box, stations
from lessons.static._surfaces_shapes import Patch, patch

if TYPE_CHECKING:
    from lessons.static.measurement_surfaces import Params, Result

TRUTH, MEASURE, SURFACE, MEET = range(4)
HALF = 0.5                                   # the probability that an `Ellipsoid` is asked for: it fixes its size
SPHERE_SCALE = float(np.sqrt(chi_square_level(HALF, 3)))


def view(p: "Params", r: "Result", at: Moment, rows: list[Row], assumed_m: float, time_s: float) -> View:
    """Everything up to this stage: the truth, what is measured, the surfaces, and where they meet."""
    box = picture_box(p, rows)
    patches = [patch(row, row.target(assumed_m), box) for row in rows]
    curves = [(i, j, _inside(on_patch(patches[i], rows[j], assumed_m), box))
              for i, j in combinations(range(len(rows)), 2) if patches[i] is not None and patches[j] is not None]
    common = np.empty((0, 3))
    if len(rows) >= 3 and curves:
        common = triple_points(rows[:3], assumed_m, curves[0][2])
        common = common[met(rows, common, assumed_m)]
    items = [*_truth(p, rows, time_s), *(_measured(p, rows) if at.stage >= MEASURE else [])]
    if at.stage >= SURFACE:
        for i, (row, shape) in enumerate(zip(rows, patches, strict=True)):
            if shape is not None:
                items += _surface(i, row, shape, row.target(assumed_m), box)
                items += _trace(i, row, shape, float(truth_of(p)[2]), box)
    if at.stage >= MEET:
        items += [Segments(f"meet_{i + 1}{j + 1}", pairs, role="posterior", width=5.0)
                  for i, j, pairs in curves if len(pairs)]
        if len(common):
            items.append(Points("common", common, role="posterior", size=18, shape="diamond"))
    middle, half = box.mean(axis=0), 0.5 * (box[1] - box[0])
    ground = float(half[:2].max())
    return View(
        scene=items, figures=figures(p, r, rows, at, assumed_m, time_s),
        camera=Orbit(tuple(middle.tolist()), 1.15 * float(half.max()), -58.0, 24.0, ground=ground),
        readouts=readouts(p, r, rows, assumed_m, common), equations=equations(p, rows, at.stage),
        caption=caption(p, assumed_m, time_s), note=note(p, rows, assumed_m))


def _inside(pairs: Array, box: Array) -> Array:
    """The segments (m, 2, 3) with both ends in the box, a hair beyond included."""
    hair = 1e-6 * float((box[1] - box[0]).max())
    return pairs[((pairs >= box[0] - hair) & (pairs <= box[1] + hair)).all(axis=(1, 2))]


def _truth(p: "Params", rows: list[Row], time_s: float) -> list[Item]:
    """The user above the ground, the stations on their masts, and the true distances."""
    x = truth_of(p)
    moving, used = stations(p, rows, time_s)
    items: list[Item] = [Segments("user_height", np.array([[(x[0], x[1], 0.0), x]]), role="truth", width=2.0),
                         Points("user_place", [x], role="truth", size=14), *moving]
    for i, row in enumerate(rows):
        away = [(s, x) for s in row.stations if row.kind != "rate" and np.linalg.norm(s - x) > 0.0]
        if away:
            items.append(Segments(f"exact_{i + 1}", np.array(away), role=row.role, width=1.8, fade=0.4))
    v = velocity_of(p, 3)
    if v.any() and any(row.kind == "rate" for row in rows):
        items.append(Arrow("velocity", x, x + v, role="truth", width=4.0))
    if used:
        places = np.array(list(used.values()))
        feet = places * [1.0, 1.0, 0.0]
        items += [Segments("masts", np.stack([feet, places], axis=1), role="station", width=2.5),
                  Stations("stations", places, tuple(used))]
    return items


def _measured(p: "Params", rows: list[Row]) -> list[Item]:
    """Measured ranges as long as they are, from the station towards the user."""
    x = truth_of(p)
    items: list[Item] = []
    for i, row in enumerate(rows):
        if row.kind in ("range", "pseudorange") and np.linalg.norm(x - row.stations[0]) > 0.0:
            s = row.stations[0]
            tip = s + (x - s) / np.linalg.norm(x - s) * row.y
            items.append(Arrow(f"measured_{i + 1}", s, tip, role=row.role, width=4.0))
    return items


def _surface(i: int, row: Row, shape: Patch, value: float, box: Array) -> list[Item]:
    """The surface of one measurement."""
    name = f"surface_{i + 1}"
    tall = float(box[1, 2] - box[0, 2])
    match row.kind:
        case "range" | "pseudorange":
            law = Gaussian(row.stations[0], (value / SPHERE_SCALE)**2 * np.eye(3))
            return [Ellipsoid(name, law, role=row.role, probability=HALF, opacity=0.16)]
        case "height":
            corners = shape(np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0]))
            return [Polygon(name, corners, role=row.role, opacity=0.22)]
        case "x1" | "x2" | "bearing":
            foot = shape(np.array([0.0, 1.0]), np.zeros(2))
            return [Walls(name, foot[None], height=tall, role=row.role, opacity=0.22)]
    fine, coarse = np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.0, 13)
    paths = [shape(np.full_like(fine, u), fine) for u in coarse[1:]] + [shape(fine, np.full_like(fine, v))
                                                                        for v in coarse[:-1]]
    pairs = _inside(np.concatenate([np.stack([path[:-1], path[1:]], axis=1) for path in paths]), box)
    return [Segments(name, pairs, role=row.role, width=1.5, fade=0.2)] if len(pairs) else []


def _trace(i: int, row: Row, shape: Patch, z: float, box: Array) -> list[Item]:
    """The surface's cut with the horizontal plane through the user: the curve of the picture in the plane."""
    if row.kind == "height":
        return []
    pairs = _inside(at_height(shape, z), box)
    return [Segments(f"curve_{i + 1}", pairs, role=row.role, width=3.5)] if len(pairs) else []
