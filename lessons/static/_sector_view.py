"""A sector of a base station as an inequality: the best point without it, the best point in it."""

from typing import TYPE_CHECKING

import numpy as np

from core.likelihood import likelihood_map, weighted_cost
from core.sensors import Range
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import (
    Arrow,
    HeatMap,
    Item,
    Label,
    LevelEllipse,
    Points,
    Polygon,
    Polyline,
    Segments,
)
from lessons.static._garbage_model import Confined, outside_m, repeated
from lessons.static._garbage_view import EMPTY, PROBABILITY, camera, circles, iterate, picture, stations_in

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.garbage_measurements import Params

MEASURE, SOLVE, TEST, REPAIR, REPEAT = range(5)
CELLS = 80


def view(p: "Params", r: Confined | None, at: Moment, steps: int) -> View:
    """Ranges and sector, least squares, its distance from the sector, the constrained minimum, and again and again."""
    if r is None:
        stations = np.array([getattr(p, f"station_{i + 1}") for i in range(p.count)])
        return View(scene=stations_in(stations, [f"S{i + 1}" for i in range(p.count)]),
                    camera=camera(picture(p, stations, np.zeros((0, 2)))), note=EMPTY)
    box, k = picture(p, r.stations, r.inside.iterates), iterate(at.step, steps, len(r.inside.iterates) - 1)
    gap = float(outside_m(r, r.fix.x))
    return View(scene=_scene(p, r, at.stage, k, box), camera=camera(box), figures=_figures(p, r, at.stage),
                readouts=_readouts(p, r, at.stage, k), equations=_equations(p, r, at.stage, k),
                caption=_caption(at.stage, k, gap), note=_note(p, r, at.stage))


def _caption(stage: int, k: int, gap: float) -> str:
    if stage == TEST:
        return f"The estimate lies {gap:.1f} m outside the sector" if gap else "The estimate lies in the sector"
    return f"Iteration {k} in the sector" if stage == REPAIR else ""


def _note(p: "Params", r: Confined, stage: int) -> str:
    if outside_m(r, np.array(p.user)) > 1e-9:
        return "The true position is outside the sector: the inequality is a wrong measurement here."
    if stage >= REPAIR and not outside_m(r, r.fix.x):
        return "The estimate lies in the sector already: the inequality changes nothing."
    return ""


def _in_sector(r: Confined, box: Array) -> Array:
    """The corners (k, 2) of the part of the picture that lies in the sector; Sutherland and Hodgman's clipping."""
    (x0, y0), (x1, y1) = box
    corners = [np.array(c) for c in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    for normal, bound in zip(r.G, r.g, strict=True):
        kept = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            at_a, at_b = normal @ a - bound, normal @ b - bound
            if at_a <= 0.0:
                kept.append(a)
            if (at_a < 0.0) != (at_b < 0.0) and at_a != at_b:
                kept.append(a + at_a / (at_a - at_b) * (b - a))
        corners = kept
    return np.array(corners).reshape(-1, 2)


def _scene(p: "Params", r: Confined, stage: int, k: int, box: Array) -> list[Item]:
    sensor, items = Range(r.stations, p.sigma_m), []
    if stage in (SOLVE, TEST, REPAIR):
        axes = [np.linspace(low, high, CELLS) for low, high in box.T]
        items.append(HeatMap("fit", *axes, likelihood_map(sensor, r.y, axes).relative.T, role="prior", opacity=0.8))
    corners = _in_sector(r, box)
    if len(corners) > 2:
        items.append(Polygon("sector", corners, role="likelihood", opacity=0.12))
    items += circles(r.stations, r.y, box, ["measurement"] * len(r.y), np.full(len(r.y), 0.35 * (stage > MEASURE)))
    if stage == REPEAT:
        for name, x, role in (("free", r.free, "monte_carlo"), ("confined", r.confined, "likelihood")):
            seen = x[((x >= box[0]) & (x <= box[1])).all(axis=1)]
            if len(seen):
                items.append(Points(name, seen, role=role, size=4.5))
    if SOLVE <= stage < REPEAT:
        items.append(LevelEllipse("least_squares", Gaussian(r.fix.x, r.fix.cov), role="posterior",
                                  probability=PROBABILITY, width=3.0))
    if stage == TEST and (gap := outside_m(r, r.fix.x)) > 0.0:
        i = int((r.G @ r.fix.x - r.g).argmax())
        foot = r.fix.x - gap * r.G[i]
        items += [Segments("gap", np.array([[r.fix.x, foot]]), role="warning", width=4.0),
                  Label("gap_name", f"{gap:.1f} m", 0.5 * (r.fix.x + foot), 0.9, "left")]
    if stage == REPAIR:
        items += _confined(r, k, box)
    items.append(Points("truth", [p.user], role="truth", size=10, shape="diamond"))
    seen = np.flatnonzero(((r.stations >= box[0]) & (r.stations <= box[1])).all(axis=1))
    return [*items, *stations_in(r.stations[seen], [f"S{i + 1}" for i in seen])]


def _confined(r: Confined, k: int, box: Array) -> list[Item]:
    """The iterates, and at the last one the cost's downhill direction, which the edge holds."""
    path = r.inside.iterates[:k + 1]
    items: list[Item] = [Polyline("steps", path, role="likelihood", width=2.5),
                         Points("inside", path[-1:], role="likelihood", size=15, shape="square")]
    pull = r.inside.multipliers @ r.G
    size = float(np.linalg.norm(pull))
    if k == len(r.inside.iterates) - 1 and size > 1e-9:
        items.append(Arrow("downhill", r.inside.x, r.inside.x + 0.13 * float(np.ptp(box, axis=0).max()) * pull / size,
                           role="innovation"))
    return items


def _figures(p: "Params", r: Confined, stage: int) -> dict[str, "go.Figure"]:
    return {"edge": _edge(p, r), "repeated": _repeated(p, r)}


def _edge(p: "Params", r: Confined) -> "go.Figure":
    """The cost along the edge that is nearest to the estimate, from the apex outwards."""
    i = int((r.G @ r.fix.x - r.g).argmax())
    along = np.array([-r.G[i, 1], r.G[i, 0]]) * (1.0 if i == 0 else -1.0)
    t = np.linspace(0.0, 250.0, 126)
    apex = r.stations[0]
    cost = weighted_cost(Range(r.stations, p.sigma_m), r.y, apex + t[:, None] * along)
    traces = [fig.line("cost", t, cost, "measurement"),
              fig.line("free", t[[0, -1]], np.full(2, float(r.fix.costs[-1])), "posterior", dash=True)]
    if r.inside.active[i]:
        traces.append(fig.markers("held", [float((r.inside.x - apex) @ along)], [float(r.inside.cost)], "likelihood",
                                  size=12, symbol="square"))
    top = max(4.0 * float(r.inside.cost), float(r.inside.cost) + 10.0)
    return fig.chart(*traces, y_range=(0.0, top))


def _repeated(p: "Params", r: Confined) -> "go.Figure":
    """Shares of the errors below a bound."""
    free, held, _ = repeated(p, r)
    share = np.arange(1, len(free) + 1) / max(len(free), 1)
    return fig.chart(fig.line("free", np.sort(free), 100.0 * share, "monte_carlo"),
                     fig.line("confined", np.sort(held), 100.0 * share, "likelihood"), y_range=(0.0, 100.0))


def _readouts(p: "Params", r: Confined, stage: int, k: int) -> list[Readout]:
    def off(x: Array) -> float:
        return float(np.linalg.norm(x - p.user))

    free, held, moved = repeated(p, r)
    again = stage == REPEAT and len(free)
    return [
        Readout("gap", float(outside_m(r, r.fix.x)) if stage >= TEST else None, "m", 3),
        Readout("error_plain", off(r.fix.x) if stage >= SOLVE else None, "m", 3),
        Readout("error_confined", off(r.inside.iterates[k]) if stage >= REPAIR else None, "m", 3),
        Readout("cost_free", float(r.fix.costs[-1]) if stage >= SOLVE else None, digits=3),
        Readout("cost_confined", float(r.inside.cost) if stage >= REPAIR else None, digits=3),
        Readout("outside", 100.0 * float(moved.mean()) if again else None, "%", 3),
        Readout("rms_free", float(np.sqrt(np.square(free).mean())) if again else None, "m", 3),
        Readout("rms_confined", float(np.sqrt(np.square(held).mean())) if again else None, "m", 3),
    ]


def _equations(p: "Params", r: Confined, stage: int, k: int) -> list[Equation]:
    lam = r.inside.multipliers
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("ranges", MEASURE, r"\mathbf{y} = h(\mathbf{x}) + \mathbf{v}", ("=", r.y)),
        ("sector", MEASURE, r"G\mathbf{x} \leq \mathbf{g}", (r",\quad G =", r.G, r",\quad \mathbf{g} =", r.g)),
        ("solution", SOLVE, r"\hat{\mathbf{x}} = \mathrm{argmin}\ \mathbf{p}^TR^{-1}\mathbf{p}", ("=", r.fix.x)),
        ("check", TEST, r"G\hat{\mathbf{x}} - \mathbf{g}", ("=", r.G @ r.fix.x - r.g)),
        ("confined", REPAIR,
         r"\mathrm{argmin}\ \mathbf{p}^TR^{-1}\mathbf{p}\quad \text{with}\ G\mathbf{x} \leq \mathbf{g}",
         ("=", r.inside.iterates[k])),
        ("multiplier", REPAIR, r"J^TR^{-1}\mathbf{p} + G^T\boldsymbol{\lambda} = \mathbf{0},\quad \boldsymbol{\lambda}",
         ("=", lam)),
    ]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]
