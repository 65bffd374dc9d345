"""The measurements as curves in the plane."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit.curves import clipped
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import Arrow, Item, Plane, Points, Segments, Stations
from lessons.static._surfaces_meeting import crossings, met
from lessons.static._surfaces_model import Row, antenna, stations_of, truth_of, velocity_of
from lessons.static._surfaces_numbers import caption, equations, figures, note, readouts
from lessons.static._surfaces_shapes import curve

if TYPE_CHECKING:
    from lessons.static.measurement_surfaces import Params, Result

TRUTH, MEASURE, SURFACE, MEET = range(4)


def view(p: "Params", r: "Result", at: Moment, rows: list[Row], assumed_m: float, time_s: float) -> View:
    """Everything up to this stage: the truth, what is measured, the curves, and where they meet."""
    box = picture_box(p, rows)
    curves = [curve(row, row.target(assumed_m), box) for row in rows]
    points = crossings(rows, assumed_m, curves)
    common = points[met(rows, points, assumed_m)] if len(points) else points
    if len(rows) == 1:
        common = np.empty((0, 2))
    moving, used = stations(p, rows, time_s)
    items = [*_truth(p, rows), *moving, *(_measured(p, rows) if at.stage >= MEASURE else [])]
    if at.stage >= SURFACE:
        items += _curves(rows, assumed_m, curves, box)
    if at.stage >= MEET:
        items += _meeting(points, common, box)
    if used:
        items.append(Stations("stations", np.array(list(used.values())), tuple(used)))
    (x0, y0), (x1, y1) = box.tolist()
    return View(
        scene=items, camera=Plane((x0, x1), (y0, y1), "x₁, east (m)", "x₂, north (m)"),
        figures=figures(p, r, rows, at, assumed_m, time_s), readouts=readouts(p, r, rows, assumed_m, common),
        equations=equations(p, rows, at.stage), caption=caption(p, assumed_m, time_s), note=note(p, rows, assumed_m))


def picture_box(p: "Params", rows: list[Row]) -> Array:
    """Corners (2, n) round the user, the stations and the circles; it stands still in time."""
    x, hubs = truth_of(p), stations_of(p)
    points = [x]
    for row in rows:
        if row.kind in ("range", "rate", "pseudorange"):
            reach = float(np.linalg.norm(x - hubs[row.slot]))
            reach += {"pseudorange": p.bias_m, "range": 0.0, "rate": p.arm_m}[row.kind]
            points += [hubs[row.slot] - reach, hubs[row.slot] + reach]
        else:
            points += list(row.stations)
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    size = float((high - low)[:2].max())
    size = size if size > 0.5 else 60.0
    grown = 0.08 if any(row.kind in ("range", "pseudorange") for row in rows) else 0.6
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + grown * size
    half = np.maximum(half, 0.6 * size if len(x) == 3 else 0.35 * size)
    return np.array([middle - half, middle + half])


def _truth(p: "Params", rows: list[Row]) -> list[Item]:
    """What the true values are: distances, directions, and coordinates; how the user moves."""
    x = truth_of(p)
    items: list[Item] = []
    for i, row in enumerate(rows):
        feet = [s for s in row.stations if np.linalg.norm(s - x) > 0.0]
        if row.kind in ("x1", "x2"):
            feet = [np.where(np.arange(2) == ("x1", "x2").index(row.kind), 0.0, x)]
        if feet and row.kind != "rate":
            items.append(Segments(f"exact_{i + 1}", np.array([(foot, x) for foot in feet]), role=row.role, width=1.8,
                                  fade=0.5))
    v = velocity_of(p, 2)
    if v.any() and any(row.kind == "rate" for row in rows):
        items.append(Arrow("velocity", x, x + v, role="truth", width=4.0))
    return items


def _measured(p: "Params", rows: list[Row]) -> list[Item]:
    """Measured ranges as long as they are, from the station towards the user; measured bearings as arrows."""
    x = truth_of(p)
    items: list[Item] = []
    for i, row in enumerate(rows):
        if row.kind not in ("range", "pseudorange", "bearing"):
            continue
        s = row.stations[0]
        away = x - s
        distance = float(np.linalg.norm(away))
        if distance == 0.0:
            continue
        tip = s + (away / distance * row.y if row.kind != "bearing"
                   else 0.6 * distance * np.array([np.sin(row.y), np.cos(row.y)]))
        items.append(Arrow(f"measured_{i + 1}", s, tip, role=row.role, width=5.0))
    return items


def _curves(rows: list[Row], assumed_m: float, curves: list[list[Array]], box: Array) -> list[Item]:
    """{h = y}, and one sigma to each side."""
    items: list[Item] = []
    for i, (row, pieces) in enumerate(zip(rows, curves, strict=True)):
        value = row.target(assumed_m)
        for name, lines, width, fade in ((f"curve_{i + 1}", pieces, 3.0, 0.0),
                                         (f"low_{i + 1}", curve(row, value - row.sigma, box), 1.2, 0.35),
                                         (f"high_{i + 1}", curve(row, value + row.sigma, box), 1.2, 0.35)):
            cut = [c for c in (clipped(line, box) for line in lines) if len(c)]
            if cut:
                items.append(Segments(name, np.concatenate(cut), role=row.role, width=width, fade=fade))
    return items


def _meeting(points: Array, common: Array, box: Array) -> list[Item]:
    items: list[Item] = []
    for name, found, size in (("crossings", points, 11), ("common", common, 20)):
        seen = found[((found >= box[0]) & (found <= box[1])).all(axis=1)] if len(found) else found
        if len(seen):
            items.append(Points(name, seen, role="posterior", size=size, shape="diamond"))
    return items


def stations(p: "Params", rows: list[Row], time_s: float) -> tuple[list[Item], dict[str, Array]]:
    """Names and places of the stations in use; of a radar its arm, how the antenna moves, and the antenna."""
    hubs = stations_of(p)
    items: list[Item] = []
    used: dict[str, Array] = {}
    turning = [row.slot for row in rows if row.kind == "rate"]
    for slot in turning:
        place, moving = antenna(p, hubs[slot], time_s)
        items.append(Segments("arm", np.array([[hubs[slot], place]]), role="station", width=4.0))
        if moving.any():
            items.append(Arrow("antenna_velocity", place, place + moving, role="station", width=3.0))
        used["radar"] = place
    for row in rows:
        if row.slot not in turning:
            used |= {f"S{k % 3 + 1}": hubs[k % 3] for k in range(row.slot, row.slot + len(row.stations))}
    return items, used
