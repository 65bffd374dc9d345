"""How Monte Carlo integration is drawn: densities and samples, the terms h(z), and four plots."""

from typing import TYPE_CHECKING

import numpy as np

from core.cloud import thinned
from core.types import Array, Gaussian
from lessons.filtering import _monte_carlo_problems as problems
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.panels import Panel
from lessons.kit.scene import HeatMap, Item, LevelEllipse, Particles, Plane, Points, Polygon, Polyline

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.monte_carlo import Params, Result

DRAW, EVALUATE, AVERAGE = range(3)
DRAWN = 600
BINS = 41
PIXEL = 0.0095                           # scene units per pixel of the two panels
FLOOR = 1e-7                             # errors below this are drawn there: an exact result has no logarithm


def view(p: "Params", r: "Result", at: Moment) -> View:
    """All samples up to this step's number, up to this stage."""
    n = int(r.counts[at.step])
    scene, camera = (_curves if p.problem == "parabola" else _square)(p, r, at, n)
    return View(scene=scene, camera=camera, figures=_figures(p, r, n), readouts=_readouts(p, r, at.step),
                equations=_equations(p, r, at, n), caption=f"n = {n:,}", note=_note(p, r, n))


def _note(p: "Params", r: "Result", n: int) -> str:
    found = []
    low, high = problems.support(p)[0]
    if p.problem == "parabola" and (low > -1.0 or high < 1.0):
        found.append("f is 0 where g is not: the mean tends to something else than the integral.")
    if p.problem == "square" and not (r.h[:n] > 0.0).any():
        found.append("No sample fell into the rectangle.")
    if n > DRAWN:
        found.append(f"{DRAWN} of {n:,} samples are drawn.")
    return " ".join(found)


def _curves(p: "Params", r: "Result", at: Moment, n: int) -> tuple[list[Item], Plane]:
    """Below: the integrand g and the density f with its samples.  Above: the terms h = g/f and their mean."""
    fine = np.linspace(-3.2, 3.2, 321)
    f = problems.axis_density(p, 0, fine)
    tall = 1.12 * max(0.75, float(f.max()))
    inner = np.linspace(-1.0, 1.0, 201)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = problems.target(p, inner) / problems.density(p, inner)
    roof = float(np.clip(1.15 * np.nanmax(np.where(np.isfinite(ratio), ratio, 0.0)), 1.6, 6.0))
    size = np.array([6.4, 2.5])
    below = Panel(np.array([-3.2, 0.0]), np.array([3.2, tall]), np.array([-3.2, 0.0]), size)
    above = Panel(np.array([-3.2, 0.0]), np.array([3.2, roof]), np.array([-3.2, 3.95]), size)

    items: list[Item] = [
        *below.axes("below", ("integrand and density", "z", "g, f"), PIXEL),
        *above.axes("above", ("terms h = g/f", "z", "h"), PIXEL),
        Polyline("g", below.place(np.column_stack([fine, problems.target(p, fine[:, None])])), role="truth", width=3.5),
        Polyline("f", below.place(np.column_stack([fine, f])), role="prior", width=3.5),
    ]
    some = thinned(n, DRAWN)
    z, h = r.z[some, 0], r.h[some]
    shown = np.abs(z) < 3.2
    # Spread over the height below f, the samples fill its area evenly.
    share = 0.04 + 0.92 * ((np.arange(len(z)) * 0.618034) % 1.0)
    items.append(Points("samples", below.place(np.column_stack([z, share * problems.axis_density(p, 0, z)])[shown]),
                        role="prior", size=4.0, fade=0.35))
    if at.stage >= EVALUATE:
        inside = shown & (h <= roof)
        zero = h == 0.0
        items.append(Points("terms", above.place(np.column_stack([z, h])[inside & ~zero]), role="sigma", size=5.0))
        if (inside & zero).any():
            items.append(Points("zeros", above.place(np.column_stack([z, h])[inside & zero]), role="warning", size=5.0))
    items.append(Polyline("exact", above.place(np.array([[-3.2, 1.0], [3.2, 1.0]])), role="truth", width=2.0,
                          dashed=True))
    if at.stage >= AVERAGE:
        mean, sd = float(r.running[at.step, 0]), float(r.running_sd[at.step, 0])
        low, high = (float(np.clip(mean + s * 2.0 * sd, 0.0, roof)) for s in (-1.0, 1.0))
        if high - low > 1e-4 * roof:
            items.append(Polygon("band", above.place(np.array([[-3.2, low], [3.2, low], [3.2, high], [-3.2, high]])),
                                 role="posterior", opacity=0.3))
        items.append(Polyline("mean", above.place(np.array([[-3.2, min(mean, roof)], [3.2, min(mean, roof)]])),
                              role="posterior", width=3.0))
    return items, Plane((-3.9, 3.4), (-0.65, 7.2), axes=False)


def _square(p: "Params", r: "Result", at: Moment, n: int) -> tuple[list[Item], Plane]:
    """The plane with the rectangle, the samples, those inside sized by h, and the mean."""
    (x0, x1), (y0, y1) = problems.box(p)
    axis = np.linspace(-3.4, 3.4, 69)
    bell = np.exp(-0.5 * (axis[:, None]**2 + axis**2))
    items: list[Item] = [
        HeatMap("law", axis, axis, bell, role="prior", opacity=0.35),
        Polygon("rectangle", [(x0, y0), (x1, y0), (x1, y1), (x0, y1)], role="likelihood", opacity=0.14),
    ]
    some = thinned(n, DRAWN)
    z, h = r.z[some], r.h[some]
    shown, kept = (np.abs(z) < 3.4).all(axis=1), h > 0.0
    if at.stage == DRAW:
        items.append(Points("samples", z[shown], role="monte_carlo", size=5.0))
    else:
        if (shown & ~kept).any():
            items.append(Points("zeros", z[shown & ~kept], role="monte_carlo", size=4.0, fade=0.3))
        if kept.any():
            items.append(Particles("terms", z[kept], h[kept], role="sigma", size=6.0))
    if at.stage >= AVERAGE and np.isfinite(r.running[at.step]).all():
        mean, sd = r.running[at.step], np.maximum(r.running_sd[at.step], 1e-4)
        items += [LevelEllipse("mean_law", Gaussian(mean, np.diag(np.square(sd))), role="posterior", probability=0.95,
                               width=3.0, cross=False),
                  Points("mean", mean[None], role="posterior", size=13, shape="square")]
    items.append(Points("exact", r.exact[None], role="truth", size=11, shape="diamond"))
    return items, Plane((-3.4, 3.4), (-3.4, 3.4), "x₁", "x₂")


def _equations(p: "Params", r: "Result", at: Moment, n: int) -> list[Equation]:
    """The estimate of (3.22) and its variance (3.23) with this step's numbers."""
    i = n - 1
    mean, sd = r.running[at.step], r.running_sd[at.step]
    zeros = int((r.h[:n] == 0.0).sum())
    last: Piece = float(r.z[i, 0]) if p.problem == "parabola" else r.z[i]
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("draw", DRAW, r"\mathbf{z}_i \,\sim\, f", (r",\quad \mathbf{z}_n =", last)),
        ("term", EVALUATE, r"h(\mathbf{z}) = g(\mathbf{z}) / f(\mathbf{z})",
         (r",\quad h(\mathbf{z}_n) =", float(r.h[i]), r",\quad h = 0\;\mathrm{in}", 100.0 * zeros / n, r"\%")),
    ]
    if p.problem == "parabola":
        left_out = float(np.square(r.h[:n][r.h[:n] > 0.0] - mean[0]).sum() / n**2)
        lines += [
            ("mean", AVERAGE, r"\bar{h}_n = \frac{1}{n}\sum_i h(z_i)", ("=", float(mean[0]))),
            ("variance", AVERAGE, r"V(\bar{h}_n) \approx \frac{1}{n^2}\sum_i (h(z_i) - \bar{h}_n)^2",
             ("=", 1e5 * float(sd[0]**2), r"\cdot 10^{-5}")),
            ("left_out", AVERAGE, r"\frac{1}{n^2}\sum_{h(z_i) > 0} (h(z_i) - \bar{h}_n)^2",
             ("=", 1e5 * left_out, r"\cdot 10^{-5}")),
        ]
    else:
        known = np.isfinite(mean).all()
        lines += [
            ("ratio", AVERAGE, r"\hat{\mathbf{x}} = \sum_i h_i\mathbf{z}_i \,/ \sum_i h_i",
             ("=", mean) if known else ()),
            ("ratio_sd", AVERAGE,
             r"\sigma^2 \approx \sum_i h_i^2(\mathbf{z}_i - \hat{\mathbf{x}})^2 \,/ (\sum_i h_i)^2",
             (r",\quad \sigma =", sd) if known else ()),
        ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _slope(r: "Result") -> float | None:
    """Of the line through log error against log n, from 100 samples on."""
    use = (r.counts >= 100) & (r.rms > FLOOR)
    if use.sum() < 2:
        return None
    return float(np.polyfit(np.log(r.counts[use]), np.log(r.rms[use]), 1)[0])


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _readouts(p: "Params", r: "Result", step: int) -> list[Readout]:
    n = int(r.counts[step])
    found = [Readout("estimate", _number(r.running[step, 0])), Readout("exact", float(r.exact[0])),
             Readout("sd", _number(r.running_sd[step, 0]), digits=3)]
    if p.problem == "parabola":
        found.append(Readout("left_out_sd", r.left_out_sd if step == len(r.counts) - 1 else None, digits=3))
    known = r.answers[np.isfinite(r.answers)]
    return [
        *found,
        Readout("repeated_sd", float(known.std()) if len(known) > 1 else None, digits=3),
        Readout("exact_sd", float(np.sqrt(r.term_variance / p.n)), digits=3),
        Readout("slope", _slope(r), digits=3),
        Readout("zeros", 100.0 * float((r.h[:n] == 0.0).mean()), "%", 3),
    ]


def _figures(p: "Params", r: "Result", n: int) -> dict[str, "go.Figure"]:
    ends = r.counts[[0, -1]]
    known = np.isfinite(r.running[:, 0])
    counts, mean, sd = r.counts[known], r.running[known, 0], r.running_sd[known, 0]
    theory = np.sqrt(r.term_variance / r.counts)
    sweep = fig.chart(fig.line("variance", problems.WIDTHS, np.maximum(r.sweep, FLOOR), "prior"),
                      fig.markers("here", [p.width], [max(r.term_variance, FLOOR)], "warning", size=11),
                      log_x=True, log_y=True, y_range=_sweep_range(r))
    return {
        "running": fig.chart(
            fig.band("band", counts, mean - 2.0 * sd, mean + 2.0 * sd, "posterior"),
            fig.line("mean", counts, mean, "posterior", markers=True),
            fig.line("exact", ends, np.full(2, r.exact[0]), "truth", dash=True, width=1.5), log_x=True, cursor=n),
        "histogram": _histogram(p, r),
        "error": fig.chart(
            fig.markers("rms", r.counts, np.maximum(r.rms, FLOOR), "posterior", size=8),
            fig.line("theory", r.counts, np.maximum(theory, FLOOR), "reference", dash=True),
            fig.line("one", counts, np.maximum(np.abs(mean - r.exact[0]), FLOOR), "muted", width=1.5),
            log_x=True, log_y=True, cursor=n),
        "proposal": sweep,
    }


def _sweep_range(r: "Result") -> tuple[float, float]:
    low = max(float(r.sweep.min()), 1e-3)
    return 0.5 * low, float(np.clip(2.0 * r.sweep.max(), 10.0 * low, 1e4 * low))


def _histogram(p: "Params", r: "Result") -> "go.Figure":
    """Answers of all repetitions, and two normal curves: with the right variance, and without the zeros."""
    answers = r.answers[np.isfinite(r.answers)]
    if not len(answers):
        answers = r.exact[:1]
    middle, right = float(np.median(answers)), float(np.sqrt(r.term_variance / p.n))
    spread = max(float(answers.std()), 1e-6)
    edges = np.linspace(middle - 4.0 * spread, middle + 4.0 * spread, BINS + 1)
    share = np.histogram(answers, edges)[0] / (len(answers) * (edges[1] - edges[0]))
    fine = np.linspace(edges[0], edges[-1], 161)

    def bell(sd: float) -> Array:
        return np.exp(-0.5 * np.square((fine - limit(p, r)) / sd)) / (sd * np.sqrt(2.0 * np.pi))

    traces = [fig.bars("answers", (edges[1:] + edges[:-1]) / 2.0, share, "monte_carlo", width=edges[1] - edges[0])]
    if 0.2 * spread < right < 50.0 * spread:              # a variance that nobody has seen yet has no place here
        traces.append(fig.line("right", fine, bell(right), "posterior"))
        wrong = float(np.sqrt(r.left_out_variance / p.n))
        if p.problem == "parabola" and 0.05 * right < wrong < 0.98 * right:
            traces.append(fig.line("left_out", fine, bell(wrong), "warning", dash=True))
    return fig.chart(*traces, marks=[float(r.exact[0])])


def limit(p: "Params", r: "Result") -> float:
    """What the estimate tends to: the integral over the part that samples reach."""
    if p.problem == "square" or p.proposal != "uniform":
        return float(r.exact[0])
    low, high = np.clip(problems.support(p)[0], -1.0, 1.0)
    return float(0.75 * ((high - high**3 / 3.0) - (low - low**3 / 3.0)))
