"""How one scan is drawn: its likelihood over the floor, or the radio map of one transmitter as a hilly surface."""

from typing import TYPE_CHECKING

import numpy as np

from lessons.indoor._floors import WALL_M, floor_camera, floor_objects, height, house_camera, link_pairs, outline
from lessons.kit.equations import Equation
from lessons.kit.figures import band, bars, chart, line, markers
from lessons.kit.lesson import Moment, Readout, Target, View
from lessons.kit.scene import HeatMap, Item, Label, Points, Polygon, Segments, Stations, Surface, Walls

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.indoor.signal_strength import Params, Result

FLOOR_DBM, HILL_M = -100.0, 22.0        # of the height field: -100 dBm lies at 0, -40 dBm at HILL_M
DISTANCES = np.geomspace(1.0, 120.0, 80)


def view(p: "Params", r: "Result", at: Moment) -> View:
    k = min(at.step, len(r.maps) - 1)
    draw = _likelihood if p.show == "likelihood" else _field
    camera = floor_camera(r.building, r.floor) if p.show == "likelihood" else house_camera(
        r.building, floors=[r.floor], elevation_deg=36.0)
    return View(scene=draw(p, r, k), camera=camera, figures=_figures(p, r, k), readouts=_readouts(p, r, k),
                equations=_equations(r, k), caption=_caption(p, r, k), note=r.note, targets=_targets(r))


def _caption(p: "Params", r: "Result", k: int) -> str:
    if p.show == "field":
        return f"mean signal strength of {r.names[r.chosen]} on floor {r.floor}"
    return f"floor {r.floor}: {k} of the {len(r.order)} transmitters heard"


def _targets(r: "Result") -> list[Target]:
    return [Target(xy, {"transmitter": (name,), "place": tuple(float(v) for v in xy)})
            for name, xy, f in zip(r.names, r.points.xy_m, r.points.floor, strict=True) if f == r.floor]


def _likelihood(p: "Params", r: "Result", k: int) -> list[Item]:
    g, f = r.building.graph, r.building.graph.floors.index(r.floor)
    items: list[Item] = []
    if k:
        items.append(HeatMap("likelihood", *r.axes, r.maps[k, f], role="likelihood", opacity=0.95))
    _, areas = floor_objects(g, [r.floor])
    items += [Polygon(f"area_{i}", g.areas[o].polygon, role="area", opacity=0.12) for i, o in enumerate(areas)]
    if len(walls := r.building.walls[r.floor]):
        items.append(Segments("walls", walls, role="muted", width=1.5, fade=0.2))
    used = set(r.order[:k].tolist())
    here = [a for a in range(len(r.points)) if r.points.floor[a] == r.floor]
    for name, chosen, role in (("silent", [a for a in here if np.isnan(r.y[a])], "muted"),
                               ("heard", [a for a in here if not np.isnan(r.y[a]) and a not in used], "satellite"),
                               ("used", [a for a in here if a in used], "measurement")):
        if chosen:
            items.append(Points(name, r.points.xy_m[chosen], role=role, size=10.0, shape="square"))
    items.append(Points("truth", [p.truth], role="truth", size=15, shape="diamond"))
    if k and r.best[k, 2] == r.floor:
        items.append(Points("best", [r.best[k, :2]], role="posterior", size=14))
    a = r.chosen
    if r.points.floor[a] == r.floor:
        items.append(Label("chosen", r.names[a], (*(r.points.xy_m[a] + [0.0, 2.5]), 0.0), 0.9, "bottom"))
    return items


def _field(p: "Params", r: "Result", k: int) -> list[Item]:
    g = r.building.graph
    z = HILL_M * (np.maximum(r.field, FLOOR_DBM) - FLOOR_DBM) / 60.0
    items: list[Item] = [Surface("field", *r.axes, z + 0.4, role="likelihood", opacity=0.6, contours=6)]
    links, areas = floor_objects(g, [r.floor])
    level = [o for o in links if g.links[o].kind == "corridor"]
    flat = np.array([1.0, 1.0, 0.0])
    if level:
        items.append(Segments("links", link_pairs(g, level) * flat, role="link", width=2.5))
    items += [Polygon(f"area_{i}", outline(g, o) * flat, role="area") for i, o in enumerate(areas)]
    if len(walls := r.building.walls[r.floor]):
        items.append(Walls("walls", walls, WALL_M, opacity=0.15))
    a = r.chosen
    below = float(height(g, int(r.points.floor[a]))) - float(height(g, r.floor))
    top = (*r.points.xy_m[a], HILL_M + 4.0)
    items += [Stations("transmitter", [(*r.points.xy_m[a], HILL_M + 1.5)], role="measurement"),
              Label("transmitter_name", r.names[a] + ("" if below == 0 else f" (floor {r.points.floor[a]})"), top, 1.0),
              Segments("mast", np.array([[(*r.points.xy_m[a], 0.0), (*r.points.xy_m[a], HILL_M + 1.5)]]),
                       role="measurement", width=2.0),
              Points("truth", [(*p.truth, 1.0)], role="truth", size=13, shape="diamond")]
    return items


def _figures(p: "Params", r: "Result", k: int) -> "dict[str, go.Figure]":
    a = r.chosen
    mean = r.points.power_dbm[a] - 10.0 * r.points.exponent[a] * np.log10(np.maximum(DISTANCES, 1.0))
    d = np.sqrt(np.square(r.points.xy_m - p.truth).sum(axis=1)
                + (r.points.floor_height_m * (r.points.floor - r.floor)) ** 2).clip(1.0)
    same = (r.points.floor == r.floor) & ~np.isnan(r.y)
    other = (r.points.floor != r.floor) & ~np.isnan(r.y)
    two = 2.0 * p.sigma_db
    traces = [band("band", DISTANCES, mean - two, mean + two, "muted"), line("mean", DISTANCES, mean, "measurement")]
    if same.any():
        traces.append(markers("same", d[same], r.y[same], "truth"))
    if other.any():
        traces.append(markers("other", d[other], r.y[other], "vector", symbol="diamond"))
    curve = chart(*traces, log_x=True, x_range=(1.0, 120.0), y_range=(-105.0, -25.0))
    heard = r.order[:25]
    x = np.arange(1, len(heard) + 1)
    scan = chart(bars("y", x, r.y[heard] - r.points.threshold_dbm, "measurement"),
                 markers("expected", x, r.expected[heard] - r.points.threshold_dbm, "truth"), cursor=k + 0.5)
    steps = np.arange(len(r.maps))
    error = np.sqrt(np.square(r.best[:, :2] - p.truth).sum(axis=1))
    used = chart(line("error", steps, error, "posterior", markers=True),
                 line("spread", steps, r.spread, "likelihood", markers=True), cursor=k)
    return {"curve": curve, "scan": scan, "used": used}


def _readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    strongest = r.names[r.order[0]] if len(r.order) else None
    off = float(np.sqrt(np.square(r.best[k, :2] - p.truth).sum())) if k else None
    mean_off = float(np.sqrt(np.square(r.mean[k] - p.truth).sum())) if k else None
    return [Readout("heard", len(r.order)), Readout("strongest", strongest),
            Readout("level", float(r.y[r.order[0]]) if len(r.order) else None, "dBm"),
            Readout("ml_error", off, "m"), Readout("mean_error", mean_off, "m"),
            Readout("spread", float(r.spread[k]) if k else None, "m"),
            Readout("right_floor", 100.0 * float(r.right[k]), "%")]


def _equations(r: "Result", k: int) -> list[Equation]:
    a = r.chosen
    law = (r"\mu(d) =", float(r.points.power_dbm[a]), r"-\,10\cdot", float(r.points.exponent[a]),
           r"\,\log_{10} d,\qquad \sigma =", float(r.points.sigma_db[a]))
    shown = r.order[:min(k, 4)]
    return [Equation("law", law, digits=3),
            Equation("scan", (r"y =", r.y[shown]) if len(shown) else (r"y",), current=k > 0),
            Equation("expected", (r"\mu(x) =", r.expected[shown]) if len(shown) else (r"\mu(x)",), current=k > 0)]
