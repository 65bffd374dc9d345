"""Heat maps or surfaces of the likelihoods, one after the other, and of their product."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit.lesson import Moment, View
from lessons.kit.roles import Role
from lessons.kit.scene import HeatMap, Item, Label, Orbit, Plane, Points, Polyline, Stations, Surface
from lessons.static._likelihood_plane import AXES, BOX, Plane2D
from lessons.static._likelihood_plane_figures import equations, figures, measured, readouts

if TYPE_CHECKING:
    from lessons.static.likelihood import Params

FACTOR, PRODUCT = range(2)
HIGH = 70.0                                  # metres of a surface's height for the value 1


def view(p: "Params", r: Plane2D, at: Moment) -> View:
    """Measurement k alone over the product of the earlier ones, or the product of all up to it."""
    camera = Plane((BOX[0, 0], BOX[1, 0]), (BOX[0, 1], BOX[1, 1]), "x, east (m)", "y, north (m)")
    if p.shown == "surface":
        camera = Orbit((24.0, 15.0, 18.0), 136.0, azimuth_deg=-68.0, elevation_deg=36.0)
    if not r.factors:
        return View(scene=_known(p), camera=camera, note="Nothing is measured: no place is better than another.")
    k = at.step
    f = r.factors[k]
    caption = f"{k + 1}. {f.name}" + (f": {measured(f)}" if f.kind != "inside" else "")
    if at.stage == PRODUCT and k:
        caption = f"product of the first {k + 1}"
    return View(scene=_scene(p, r, k, at.stage), camera=camera, figures=figures(p, r, k, at.stage),
                readouts=readouts(p, r, k, at.stage), equations=equations(p, r, k, at.stage), caption=caption,
                note=_note(p, r, k, at.stage))


def _note(p: "Params", r: Plane2D, k: int, stage: int) -> str:
    if stage == FACTOR:
        return ""
    if not r.possible[k]:
        return "No place in the picture explains all measurements: their bounded errors contradict each other."
    if not r.single[k]:
        return "There is no single most likely place: everything of the strongest colour is equally likely."
    return ""


def _scene(p: "Params", r: Plane2D, k: int, stage: int) -> list[Item]:
    """The product in green, the newest measurement in orange over it."""
    draw = _surface if p.shown == "surface" else _heat
    before = r.products[k - 1] if k else None
    items: list[Item] = []
    if stage == PRODUCT:
        items = [draw("factor", r.parts[k], "measurement", 0.35), draw("product", r.products[k], "likelihood", 0.85)]
    else:
        items = [draw("factor", r.parts[k], "measurement", 0.75)]
        if before is not None:
            items.insert(0, draw("product", before, "likelihood", 0.45))
    items += _known(p)
    if stage == PRODUCT and r.single[k]:
        lift = 1.02 * HIGH if p.shown == "surface" else 0.0
        items.append(Points("ml", [[*r.best[k], lift]], role="posterior", size=22, shape="square"))
    if stage == PRODUCT and np.isfinite(r.squares[k]).all():
        lift = 1.04 * HIGH if p.shown == "surface" else 0.0
        items.append(Points("wls", [[*r.squares[k], lift]], role="linearised", size=14, shape="diamond"))
    return items


def _heat(name: str, values: Array, role: Role, opacity: float) -> HeatMap:
    """As strong as it is likely, on the same scale for every measurement; nothing where nothing is possible."""
    top = float(values.max())
    return HeatMap(name, *AXES, values.T, role=role, opacity=opacity * min(top, 1.0))


def _surface(name: str, values: Array, role: Role, opacity: float) -> Surface:
    few = slice(None, None, 2)
    return Surface(f"{name}_surface", AXES[0][few], AXES[1][few], HIGH * values[few, few].T - 1.0, role=role,
                   opacity=0.7 * opacity, contours=6 if opacity > 0.5 else 0)


def _known(p: "Params") -> list[Item]:
    """Stations that are used, the truth, and the place at which the formulas are evaluated."""
    used = [i for i in range(3) if _uses(p, i)]
    items: list[Item] = []
    if p.shown == "surface":
        (x0, y0), (x1, y1) = BOX
        items += [Polyline("rim", [(x0, y0), (x1, y0), (x1, y1), (x0, y1)], role="muted", width=1.5, closed=True),
                  Label("x_title", f"x, east: {x0:.0f} to {x1:.0f} m".replace("-", "−"), (20.0, y0 - 16.0, 0.0), 0.9),
                  Label("y_title", f"y, north: {y0:.0f} to {y1:.0f} m".replace("-", "−"), (x1 + 14.0, -15.0, 0.0), 0.9)]
    if used:
        stations = np.array([p.station_1, p.station_2, p.station_3])[used]
        items.append(Stations("stations", stations, tuple(f"S{i + 1}" for i in used)))
    return [*items, Points("truth", [p.truth], role="truth", size=10, shape="diamond"),
            Label("probe_name", "x", np.array(p.probe) + np.array([0.0, 5.0]), 0.95, "bottom")]


def _uses(p: "Params", station: int) -> bool:
    more = (False, p.difference or p.strength, p.inside != "off")[station]
    return p.ranges > station or (station < 2 and p.bearings > station) or more or (station == 0 and p.difference)
