"""How positioning by fingerprints is drawn: the hall with its survey, heat maps, neighbours and the posterior."""

from typing import TYPE_CHECKING

import numpy as np

from core.confidence import highest_density
from core.grid import GridDensity
from core.types import Array
from lessons.kit.lesson import Moment, View
from lessons.kit.roles import Role
from lessons.kit.scene import HeatMap, Item, Label, Orbit, Plane, Points, Polyline, Segments, Stations, Surface
from lessons.static._fingerprint_figures import equations, figures, readouts
from lessons.static._fingerprint_model import PROBABILITY, SIDE_M, axes, posterior

if TYPE_CHECKING:
    from lessons.static.fingerprint import Params, Result

SURVEY, SCAN, NEIGHBOURS, POSTERIOR = range(4)
MARKS: tuple[tuple[str, Role], ...] = (("nn", "innovation"), ("knn", "linearised"), ("wknn", "sigma"),
                                       ("mean", "posterior"))
MESH = 51
HIGH = 26.0                              # of the surface, in m of the scene
WALL = np.array([[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]])


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The scan of this step up to this stage; at step 0 nothing has been scanned."""
    at = at if at.step else Moment(0, SURVEY)
    law = posterior(r.map, r.scans[at.step]) if r.map is not None else None
    shown = min(p.chosen, p.count) - 1
    if p.show == "surface":
        scene, camera = _surface(p, r, shown), Orbit((0.5 * SIDE_M, 0.5 * SIDE_M, 0.4 * HIGH), 40.0, -55.0, 32.0)
    else:
        scene, camera = _plan(p, r, at, law, shown), Plane((-3.0, SIDE_M + 3.0), (-3.0, SIDE_M + 3.0))
    return View(scene=scene, camera=camera, figures=figures(p, r, at.step), readouts=readouts(p, r, at, law),
                equations=equations(p, r, at), caption=_caption(p, at, shown), note=_note(p, r))


def _caption(p: "Params", at: Moment, shown: int) -> str:
    name = f"AP{shown + 1}"
    if p.show == "surface":
        return f"power of {name}: surface true, dots learned"
    if p.show == "field":
        return f"true power of {name}"
    if p.show == "learned" or at.stage == SURVEY:
        return f"learned power of {name}: that of the nearest survey point"
    return f"scan {at.step}" + (f": likelihood of {name} alone" if at.stage == SCAN else "")


def _note(p: "Params", r: "Result") -> str:
    if r.map is None:
        return "No survey point yet: click into the hall."
    if p.neighbours > len(r.map.share):
        return f"There are only {len(r.map.share)} survey points for {p.neighbours} neighbours."
    return ""


def _plan(p: "Params", r: "Result", at: Moment, law: GridDensity | None, shown: int) -> list[Item]:
    items: list[Item] = [*_heat(p, r, at, law, shown), Polyline("walls", WALL, role="muted", width=2.5, closed=True)]
    m, stage = r.map, at.stage if p.show == "stages" else SURVEY     # a map is shown alone
    if m is not None:
        items.append(Points("survey", m.sensor.points_m, role="measurement", size=7, shape="square"))
        if stage == NEIGHBOURS:
            items += _neighbours(p, r, at)
        if stage >= POSTERIOR and law is not None:
            region = highest_density(law, PROBABILITY).inside
            items.append(Segments("region", outline(region, law.axes), role="posterior", width=3.0))
        items += _found(r, at.step, stage)
    y = r.scans[at.step]
    names = tuple(f"AP{i + 1}" + (f" {v:.0f} dBm".replace("-", "−") if stage >= SCAN else "") for i, v in enumerate(y))
    return [*items, Points("truth", [p.truth], role="truth", size=15, shape="diamond"),
            Stations("stations", r.field.loss.stations_m, names)]


def _heat(p: "Params", r: "Result", at: Moment, law: GridDensity | None, shown: int) -> list[Item]:
    """The heat map that belongs to the choice or to the stage."""
    x, y = axes(MESH - 1)
    if p.show == "field":
        power = r.field.power(np.stack(np.meshgrid(x, y), axis=-1))[..., shown]
        return [HeatMap("map", x, y, power - power.min(), role="likelihood", opacity=0.7)]
    if r.map is None or law is None:
        return []
    sensor = r.map.sensor
    if p.show == "learned" or at.stage == SURVEY:
        means = sensor.powers_dbm[:, shown]
        low = means.min() - 0.1 * max(float(np.ptp(means)), 1.0)
        return [HeatMap("map", *law.axes, (means - low)[r.map.index].T, role="likelihood", opacity=0.7)]
    if at.stage == SCAN:
        z = (r.scans[at.step, shown] - sensor.powers_dbm[:, shown]) / sensor.sigma_db
        return [HeatMap("likelihood", *law.axes, np.exp(-0.5 * (z**2 - np.min(z**2)))[r.map.index].T,
                        role="likelihood", opacity=0.7)]
    if at.stage == POSTERIOR:
        return [HeatMap("posterior", *law.axes, law.weights.T, role="grid", opacity=0.75)]
    return []


def _neighbours(p: "Params", r: "Result", at: Moment) -> list[Item]:
    """The points whose fingerprints are most like the scan, with their distances in dB."""
    assert r.map is not None
    sensor = r.map.sensor
    distances = np.sqrt(sensor.squared_distances(r.scans[at.step]))
    best = np.argsort(distances, kind="stable")[:p.neighbours]
    places = sensor.points_m[best]
    spokes = np.stack([places, np.broadcast_to(r.found[at.step, 2], places.shape)], axis=1)
    return [Segments("spokes", spokes, role="sigma", width=1.8), Points("neighbours", places, role="sigma", size=12,
                                                                        shape="square"),
            *(Label(f"distance{i}", f"{distances[j]:.1f} dB", sensor.points_m[j] + [0.0, 0.9], 0.8, "bottom")
              for i, j in enumerate(best))]


def _found(r: "Result", step: int, stage: int) -> list[Item]:
    """The estimates of this scan, and small those of the earlier ones."""
    items: list[Item] = []
    for i, (name, role) in enumerate(MARKS):
        if name in ("nn", "mean") and step > 1 and stage > SURVEY:
            items.append(Points(f"{name}_before", r.found[1:step, i], role=role, size=5.0, fade=0.35))
        if stage >= (POSTERIOR if name == "mean" else NEIGHBOURS):
            # the two means may coincide
            items.append(Points(name, r.found[step, i][None], role=role, size=19.0 if name == "knn" else 13.0))
    return items


def outline(inside: Array, cells: tuple[Array, ...]) -> Array:
    """The edges (n, 2, 2) between cells that are inside and cells that are not."""
    half = [0.5 * (a[1] - a[0]) for a in cells]
    x, y = (np.append(a - h, a[-1] + h) for a, h in zip(cells, half, strict=True))
    padded = np.pad(inside, 1)
    i, j = np.nonzero(padded[1:, 1:-1] != padded[:-1, 1:-1])             # across x: upright edges
    upright = np.stack([np.column_stack([x[i], y[j]]), np.column_stack([x[i], y[j + 1]])], axis=1)
    i, j = np.nonzero(padded[1:-1, 1:] != padded[1:-1, :-1])
    level = np.stack([np.column_stack([x[i], y[j]]), np.column_stack([x[i + 1], y[j]])], axis=1)
    return np.concatenate([upright, level])


def _surface(p: "Params", r: "Result", shown: int) -> list[Item]:
    """The true power of one access point over the hall, and what was learned at the survey points."""
    line = np.linspace(0.0, SIDE_M, MESH)
    power = r.field.power(np.stack(np.meshgrid(line, line), axis=-1))[..., shown]
    low, high = 10.0 * np.floor(power.min() / 10.0), 10.0 * np.ceil(power.max() / 10.0)

    def height(dbm: Array) -> Array:
        return 3.0 + HIGH * (dbm - low) / (high - low)

    steps = np.arange(low, high + 1.0, 10.0)
    x, y = -1.0, SIDE_M + 1.0                             # the corner at the back
    items: list[Item] = [
        Polyline("walls", WALL, role="muted", width=2.0, closed=True),
        Surface("surface", line, line, height(power), role="likelihood", opacity=0.6, contours=len(steps) * 2),
        Polyline("scale", [(x, y, float(height(low))), (x, y, float(height(high)))], role="reference"),
        *(Label(f"scale{i}", f"{s:.0f} dBm".replace("-", "−"), (x - 1.0, y, float(height(s))), 0.9, "right")
          for i, s in enumerate(steps)),
        Stations("stations", r.field.loss.stations_m, tuple(f"AP{i + 1}" for i in range(p.count))),
    ]
    if r.map is not None:
        points = r.map.sensor.points_m
        true, learned = (height(v[:, shown]) for v in (r.field.power(points), r.map.sensor.powers_dbm))
        tops = np.column_stack([points, learned])
        errors = np.stack([np.column_stack([points, true]), tops], axis=1)
        items += [Segments("errors", errors, role="warning", width=3.0),
                  Points("learned", tops, role="measurement", size=6.0)]
    return items
