"""The cost as a bowl over the plane, the laws on its floor, the numbers of both formulas, and three plots."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.gaussian import affine
from core.grid_estimates import mean_square_error
from core.linear_update import map_cost
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.curves import clipped, square
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, LevelEllipse, Orbit, Points, Polyline, Segments, Surface

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.bayes_kalman.map_and_mmse import Params, Result

PRIOR, MEASUREMENT, SUM, MINIMUM, MEAN = range(5)
MESH = 41
SHOWN = 400                              # imagined worlds that are drawn


class Box(NamedTuple):
    """The piece of the plane that is shown, and how costs become heights."""

    middle: Array                # (2,) m
    half: float                  # m
    top: float                   # highest cost shown
    z: float                     # scene units for a cost of 1


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The derivation up to this stage, with the imagined worlds of all batches up to this step."""
    from lessons.bayes_kalman.map_and_mmse import BATCH

    box = _box(r)
    centre = (float(box.middle[0]), float(box.middle[1]), 0.6 * box.z * box.top)
    return View(
        scene=_scene(p, r, at, box), camera=Orbit(centre, 1.6 * box.half, -58.0, 24.0),
        figures=_figures(r, at.step), readouts=_readouts(r, at.step), equations=_equations(r, at),
        caption="" if at.stage < MEAN else f"{at.step * BATCH:,} worlds imagined, {r.counts[at.step]:,} fit",
    )


def _box(r: "Result") -> Box:
    """Round the minimum, with the prior mean in it."""
    best, prior = r.info.posterior, r.gain_form.prior
    sd = float(np.sqrt(np.linalg.eigvalsh(best.cov).max()))
    told = r.told if len(r.y) == 2 else best.mean         # a single measurement has no place, only a line
    half = 1.25 * max(float(np.abs([prior.mean - best.mean, told - best.mean]).max()), 2.2 * sd)
    least, at_prior = (float(_cost(r, x, "sum")) for x in (best.mean, prior.mean))
    top = max(least + 10.0, 1.1 * at_prior)
    return Box(best.mean, half, top, 0.85 * half / top)


def _scene(p: "Params", r: "Result", at: Moment, box: Box) -> list[Item]:
    prior, best, stage = r.gain_form.prior, r.info.posterior, at.stage
    items = [*_floor(box), LevelEllipse("prior", prior, role="prior", filled=stage == PRIOR),
             Label("prior_label", "x\u0302⁻", prior.mean - np.array([0.14 * box.half, 0.0]))]
    if stage in (PRIOR, MEASUREMENT):
        items.append(_surface(r, box, "prior", "prior", p.surface))
    if stage >= MEASUREMENT:
        items += _told(r, box)
    if stage == MEASUREMENT:
        items.append(_surface(r, box, "measurement", "measurement", p.surface))
    if stage >= SUM:
        items.append(_surface(r, box, "sum", "posterior", p.surface))
    if stage >= MINIMUM:
        low = box.z * (float(_cost(r, best.mean, "sum")) if p.surface == "cost" else 0.8 * box.top)
        items += [LevelEllipse("posterior", best, role="posterior", filled=True, width=4),
                  Segments("drop", np.array([[[*best.mean, 0.0], [*best.mean, low]]]), role="reference", width=3),
                  Points("minimum", [[*best.mean, low]], role="handle", size=13, shape="diamond"),
                  Label("minimum_label", "x\u0302 = " + _pair(best.mean), [*best.mean, low + 0.2 * box.half])]
    if stage >= MEAN:
        kept = r.x[:r.counts[at.step]][-SHOWN:]
        if len(kept):
            kept = kept[(np.abs(kept - box.middle) < box.half).all(axis=1)]
            items += [Points("worlds", kept, role="monte_carlo", size=4, fade=0.25),
                      Points("mean", [[*r.means[at.step], 0.0]], role="vector", size=13, shape="square")]
    return items


def _surface(r: "Result", box: Box, name: str, role: Role, surface: str) -> Surface:
    """The cost `name` (prior, measurement, sum) as far as `top`, or the density that belongs to it."""
    prior, told = r.gain_form.prior, r.told
    measured, known = r.info.measured, r.info.known
    centre, W = {"prior": (prior.mean, known), "measurement": (told, measured),
                 "sum": (r.info.posterior.mean, measured + known)}[name]
    least = _cost(r, centre, name)
    if surface == "cost":
        # Up to the top along each axis, then smaller until no corner is more than twice as high.
        along = np.sqrt((box.top - least) / np.maximum(np.diagonal(W), 1e-12)).clip(None, 1.2 * box.half)
        corners = least + max(float(v @ W @ v) for v in (along, along * [1.0, -1.0]))
        along = along * np.sqrt(min(1.0, 2.0 * (box.top - least) / max(corners - least, 1e-12)))
    else:
        centre, along = box.middle, np.full(2, box.half)
    x, y = (c + np.linspace(-w, w, MESH) for c, w in zip(centre, along, strict=True))
    height = _cost(r, np.stack(np.meshgrid(x, y), axis=-1), name)
    if surface != "cost":
        height = 0.8 * box.top * np.exp(-(height - least) / 2)
    return Surface(f"{name}_cost", x, y, box.z * height, role=role, opacity=0.5 if name == "sum" else 0.4, contours=10)


def _cost(r: "Result", x: Array, name: str) -> Array:
    measured, known = map_cost(r.gain_form.prior, r.y, r.sensor, x)
    return {"prior": known, "measurement": measured, "sum": measured + known}[name]


def _told(r: "Result", box: Box) -> list[Item]:
    """What the measurement says alone: an ellipse, or a strip of one standard deviation to each side of a line."""
    H, R = r.sensor.H, r.sensor.R
    if len(H) == 2:
        inverse = np.linalg.inv(H)
        return [LevelEllipse("told", affine(Gaussian(r.y, R), inverse, np.zeros(2)), role="measurement"),
                Label("told_label", "H⁻¹y", r.told - [0.0, 0.14 * box.half])]
    normal = H[0] / float(H[0] @ H[0])
    along = np.array([-H[0, 1], H[0, 0]]) * 40.0
    lines = [np.array([normal * value - along, normal * value + along]) for value in
             (r.y[0], r.y[0] - np.sqrt(R[0, 0]), r.y[0] + np.sqrt(R[0, 0]))]
    middle, *edges = [clipped(line, square(box.middle, box.half)) for line in lines]
    found: list[Item] = []
    if len(middle):
        found += [Segments("told", middle, role="measurement", width=4), Label("told_label", "Hx = y", middle[0, 0])]
    edges = [e for e in edges if len(e)]
    return found + ([Segments("told_edges", np.concatenate(edges), role="measurement", width=1.5)] if edges else [])


def _floor(box: Box) -> list[Item]:
    """The plane of states with its axes, and an upright for the cost."""
    low, high = box.middle - box.half, box.middle + box.half
    step = max((s for s in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if 2 * box.half / s >= 4), default=0.1)
    xs, ys = (np.arange(np.ceil(a / step), np.floor(b / step) + 1) * step + 0.0 for a, b in zip(low, high, strict=True))
    rim = np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])
    lines = [[[x, low[1], 0], [x, high[1], 0]] for x in xs] + [[[low[0], y, 0], [high[0], y, 0]] for y in ys]
    pad = 0.12 * box.half
    return [Polyline("floor", rim, role="reference", width=1.5, closed=True),
            Segments("grid", np.array(lines), role="muted", width=0.8, fade=0.5),
            *(Label(f"x_{i}", f"{x:g}", (x, low[1] - pad, 0.0), size=0.75) for i, x in enumerate(xs)),
            *(Label(f"y_{i}", f"{y:g}", (high[0] + pad, y, 0.0), size=0.75) for i, y in enumerate(ys)),
            Label("x_title", "x₁ (m)", (box.middle[0], low[1] - 3 * pad, 0.0)),
            Label("y_title", "x₂ (m)", (high[0] + 3 * pad, box.middle[1], 0.0))]


def _pair(v: Array) -> str:
    return f"({v[0]:.3f}, {v[1]:.3f})"


def _equations(r: "Result", at: Moment) -> list[Equation]:
    """(3.4) to (3.10) with the numbers."""
    u, info, n = r.gain_form, r.info, at.step
    mean: tuple[Piece, ...] = ("=", r.means[n]) if r.counts[n] else ()
    lines: list[tuple[str, int, tuple[Piece, ...], tuple[Piece, ...]]] = [
        ("prior", PRIOR, (r"(\mathbf{x} - \hat{\mathbf{x}}^-)^T(P^-)^{-1}(\mathbf{x} - \hat{\mathbf{x}}^-)",),
         (r",\quad (P^-)^{-1} =", info.known)),
        ("measurement", MEASUREMENT, (r"(\mathbf{y} - H\mathbf{x})^TR^{-1}(\mathbf{y} - H\mathbf{x})",),
         (r",\quad H^TR^{-1}H =", info.measured)),
        ("hessian", SUM, (r"2(H^TR^{-1}H + (P^-)^{-1})",), ("=", info.hessian)),
        ("information", MINIMUM,
         (r"(H^TR^{-1}H + (P^-)^{-1})^{-1}(H^TR^{-1}\mathbf{y} + (P^-)^{-1}\hat{\mathbf{x}}^-)",),
         ("=", info.posterior.mean)),
        ("gain", MINIMUM, (r"K = P^-H^T(HP^-H^T + R)^{-1}",), ("=", u.gain)),
        ("gain_form", MINIMUM, (r"\hat{\mathbf{x}}^- + K(\mathbf{y} - H\hat{\mathbf{x}}^-)",), ("=", u.posterior.mean)),
        ("cov", MINIMUM, (r"(H^TR^{-1}H + (P^-)^{-1})^{-1} = (I - KH)P^-",), ("=", u.posterior.cov)),
        ("mean", MEAN, (r"\mathrm{E}(\mathbf{x}\,|\,\mathbf{y}) \approx \frac{1}{n}\sum\mathbf{x}_i",), mean),
    ]
    return [Equation(name, (*rule, *numbers) if stage <= at.stage else rule, current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _readouts(r: "Result", n: int) -> list[Readout]:
    best = r.info.posterior
    return [
        Readout("map", _pair(best.mean), "m"),
        Readout("mmse", _pair(r.means[n]) if r.counts[n] else None, "m"),
        Readout("kept", float(r.counts[n]), digits=6),
        Readout("gap", f"{r.gap_m:.1e}", "m"),
        Readout("least", float(_cost(r, best.mean, "sum")), digits=4),
        Readout("rms", float(np.sqrt(np.trace(best.cov))), "m", 4),
    ]


def _figures(r: "Result", n: int) -> dict[str, "go.Figure"]:
    """The cost and the mean square error along one line through the minimum, and how the mean comes to it."""
    best, prior = r.info.posterior, r.gain_form.prior
    way = best.mean - prior.mean
    length = float(np.linalg.norm(way))
    way = way / length if length > 1e-9 else np.array([1.0, 0.0])
    reach = 1.15 * max(length, 2.0 * float(np.sqrt(np.trace(best.cov))))
    t = np.linspace(-reach, reach, 121)
    points = best.mean + t[:, None] * way
    measured, known = map_cost(prior, r.y, r.sensor, points)
    few = slice(None, None, 6)
    theory = np.array([np.trace(mean_square_error(best, z)) for z in points[few]])
    traces = [fig.line("theory", t[few], theory, "posterior")]
    if kept := int(r.counts[n]):
        d = r.x[:kept, None, :] - points[None, few]
        traces.append(fig.markers("worlds", t[few], np.square(d).sum(axis=-1).mean(axis=0), "monte_carlo", size=6))
    some = np.flatnonzero(r.counts)
    distance = np.sqrt(np.square(r.means[some] - best.mean).sum(axis=1))
    expected = np.sqrt(np.trace(best.cov) / r.counts[some])
    return {
        "slice": fig.chart(fig.line("prior", t, known, "prior"), fig.line("measurement", t, measured, "measurement"),
                           fig.line("sum", t, measured + known, "posterior", width=3.5), marks=[0.0],
                           y_range=(0.0, float(1.05 * (measured + known).max()))),
        "mmse": fig.chart(*traces, marks=[0.0]),
        "mean": fig.chart(fig.line("distance", r.counts[some], distance, "vector", markers=True),
                          fig.line("expected", r.counts[some], expected, "reference", dash=True),
                          cursor=float(max(r.counts[n], 1)), log_x=True, log_y=True),
    }
