"""How SIS and SIR are drawn: two panels over time with the clouds, their weights as sizes, and the lines of descent."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.panels import Panel
from lessons.kit.scene import Item, Particles, Plane, Points, Polygon, Polyline, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.degeneracy import Filter, Params, Result

PREDICT, WEIGH, RESAMPLE = range(3)
PROPOSALS = ("prior", "ekf", "ukf", "optimal")
WIDE, TALL, GAP = 12.0, 5.2, 2.4         # of a panel, and between the two, in scene units
PIXEL = 0.019
MOST_LINES = 900
RULES = {
    "prior": r"p(x_k \mid x_{k-1}^i)", "ekf": r"g_{\mathrm{EKF}}(x_k \mid x_{k-1}^i, y_k)",
    "ukf": r"g_{\mathrm{UKF}}(x_k \mid x_{k-1}^i, y_k)", "optimal": r"p(x_k \mid x_{k-1}^i, y_k)",
}


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Both filters up to this step, the step up to this stage."""
    low, high = _reach(r)
    size = np.array([WIDE, TALL])
    corners = np.array([0.0, low]), np.array([float(len(r.y)), high])
    lower, upper = (Panel(*corners, np.array([0.0, y]), size) for y in (0.0, TALL + GAP))
    name = "SIR: resampled every step" if p.threshold == 1.0 else (
        "SIS" if p.threshold == 0.0 else f"resampled when N_eff < {p.threshold:.2f} N")
    scene = [*_panel("sis", r.sis, r, at, upper, "SIS: never resampled"),
             *_panel("sir", r.sir, r, at, lower, name)]
    camera = Plane((-1.5, WIDE + 0.4), (-1.3, 2.0 * TALL + GAP + 1.5), axes=False)
    return View(scene=scene, camera=camera, figures=_figures(p, r, at), readouts=_readouts(p, r, at),
                equations=_equations(p, r, at), caption=f"t = {at.step} s, N = {p.n_particles}", note=_note(p, r, at))


def _note(p: "Params", r: "Result", at: Moment) -> str:
    if r.proposal != p.proposal:
        return "The optimal proposal is known for the linear sensor only; EKF is used."
    heaviest = float(r.sis.before[at.step].max())
    return f"The heaviest SIS particle carries {heaviest:.0%} of the weight." if at.step and at.stage >= WEIGH else ""


def _reach(r: "Result") -> tuple[float, float]:
    """Places that must be visible: the walk, the surviving cloud, and most of the SIS cloud."""
    cloud = np.quantile(r.sis.x, (0.02, 0.98))
    low = min(float(r.truth.min()), float(cloud[0]), float(r.sir.mean.min())) - 3.0
    high = max(float(r.truth.max()), float(cloud[1]), float(r.sir.mean.max())) + 3.0
    return 5.0 * np.floor(low / 5.0), 5.0 * np.ceil(high / 5.0)


def _weights(f: "Filter", at: Moment) -> Array:
    """Weights (step + 1, N) as they are drawn: at the current step those of the stage."""
    k = at.step
    w = f.before[:k + 1].copy()
    N = w.shape[1]
    if k and at.stage == PREDICT:
        w[k] = 1.0 / N if f.resampled[k - 1] or k == 1 else f.before[k - 1]
    if k and at.stage == RESAMPLE and f.resampled[k]:
        w[k] = np.bincount(f.ancestors[k], minlength=N) / N
    return w


def lines_alive(f: "Filter", at: Moment) -> Array:
    """Which of the particles (step + 1, N) have offspring in the cloud of this moment that carries weight."""
    k = at.step
    w = _weights(f, at)[k]
    alive = np.zeros((k + 1, w.shape[0]), dtype=bool)
    alive[k] = w > 0.01 * w.max()
    for t in range(k, 0, -1):
        alive[t - 1, f.parent[t][alive[t]]] = True
    return alive


def _panel(name: str, f: "Filter", r: "Result", at: Moment, panel: Panel, title: str) -> list[Item]:
    k = at.step
    items: list[Item] = [*panel.axes(name, (title, "time t (s)", "place x (m)"), PIXEL)]
    t = np.arange(len(r.truth), dtype=np.float64)
    if r.exact is not None:
        sd = 2.0 * np.sqrt(r.exact.cov)
        rim = np.concatenate([np.column_stack([t, r.exact.mean + sd]),
                              np.column_stack([t, r.exact.mean - sd])[::-1]])
        rim[:, 1] = np.clip(rim[:, 1], *(float(v) for v in (panel.low[1], panel.high[1])))
        items.append(Polygon(f"{name}_exact", panel.place(rim), role="kf", opacity=0.14))
    alive = lines_alive(f, at)
    edges = [np.array([[step - 1, f.x[step - 1, f.parent[step, i]], step, f.x[step, i], alive[step, i]]
                       for i in range(f.x.shape[1])]) for step in range(1, k + 1)]
    if edges:
        every = np.concatenate(edges)
        pairs, kept = every[:, :4].reshape(-1, 2, 2), every[:, 4] > 0.0
        inside = panel.inside(pairs).all(axis=1)
        dead = pairs[~kept & inside]
        if len(dead):
            items.append(Segments(f"{name}_dead", panel.place(dead[:MOST_LINES]), role="muted", width=1.0, fade=0.25))
        if (kept & inside).any():
            items.append(Segments(f"{name}_alive", panel.place(pairs[kept & inside]), role="pf", width=2.2))
    points = np.stack(np.broadcast_arrays(t[:k + 1, None], f.x[:k + 1]), axis=-1)
    w = _weights(f, at)
    inside = panel.inside(points)
    items += [
        Particles(f"{name}_cloud", panel.place(points[inside]), w[inside] + 1e-12, role="pf", size=4.8),
        Polyline(f"{name}_truth", panel.place(np.column_stack([t, r.truth])), role="truth", width=2.5, dashed=True),
    ]
    known = k if at.stage >= WEIGH else k - 1
    if known > 0 and r.exact is not None:
        y = np.column_stack([t[1:known + 1], r.y[:known]])
        items.append(Points(f"{name}_y", panel.place(y[panel.inside(y)]), role="measurement", size=9, shape="square"))
    if known > 0:
        items.append(Polyline(f"{name}_mean", panel.place(np.column_stack([t, f.mean])[:known + 1]), role="innovation",
                              width=2.5))
    return items


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """Algorithm 5 with the numbers of the heaviest SIS particle."""
    k = at.step
    if k == 0:
        return [Equation("start", (r"x_0^i \,\sim\, N(\hat{x}_0, P_0),\quad \omega_0^i = 1/N =", 1.0 / p.n_particles),
                         current=True)]
    i = int(r.sis.before[k].argmax())
    factor = r"p(y_k \mid x_k^i)" if r.proposal == "prior" else (
        r"p(y_k \mid x_{k-1}^i)" if r.proposal == "optimal"
        else r"\frac{p(y_k \mid x_k^i)\,p(x_k^i \mid x_{k-1}^i)}{g(x_k^i)}")
    N = float(p.n_particles)
    resampled = bool(r.sir.resampled[k])
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("draw", PREDICT, r"x_k^i \,\sim\, " + RULES[r.proposal], (r",\quad x_k^i =", float(r.sis.x[k, i]))),
        ("weigh", WEIGH, r"\omega_k^i \propto \omega_{k-1}^i\," + factor,
         (r",\quad \omega_{k-1}^i =", float(r.sis.before[k - 1, i]), r",\quad \omega_k^i =",
          float(r.sis.before[k, i]))),
        ("n_eff_sis", WEIGH, r"N_{\mathrm{eff}} = 1 \,/ \sum_i (\omega_k^i)^2", ("=", float(r.sis.n_eff[k]))),
        ("n_eff_sir", WEIGH, r"N_{\mathrm{eff}} = 1 \,/ \sum_i (\omega_k^i)^2", ("=", float(r.sir.n_eff[k]))),
        ("resample", RESAMPLE, r"N_{\mathrm{eff}} < \tau N \,?",
         (r"\quad", float(r.sir.n_eff[k]), "<" if r.sir.n_eff[k] < p.threshold * N else r"\geq", p.threshold * N,
          r",\quad \mathrm{resample}" if resampled else r",\quad \mathrm{go\ on}")),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage, digits=3)
            for name, stage, rule, numbers in lines]


def _readouts(p: "Params", r: "Result", at: Moment) -> list[Readout]:
    k = at.step
    return [
        Readout("n_eff_sis", float(r.sis.n_eff[k]), digits=3),
        Readout("n_eff_sir", float(r.sir.n_eff[k]), digits=3),
        Readout("heaviest", 100.0 * float(r.sis.before[k].max()), "%", 3),
        Readout("error_sis", float(abs(r.sis.mean[k] - r.truth[k])), "m", 3),
        Readout("error_sir", float(abs(r.sir.mean[k] - r.truth[k])), "m", 3),
        Readout("roots_sir", float(r.sir.roots[k]), digits=3),
        Readout("times", float(r.sir.resampled[:k + 1].sum()), digits=2),
    ]


def _figures(p: "Params", r: "Result", at: Moment) -> dict[str, "go.Figure"]:
    k, N = at.step, p.n_particles
    t = np.arange(len(r.truth), dtype=np.float64)
    shown = np.arange(1, min(N, 60) + 1)
    sorted_sis, sorted_sir = (np.sort(f.before[k])[::-1][:len(shown)] for f in (r.sis, r.sir))
    order = np.arange(1, len(PROPOSALS) + 1)
    known = np.isfinite(r.study[:, 0])
    return {
        "weights": fig.chart(fig.bars("sis", shown, 100.0 * sorted_sis, "warning"),
                             fig.bars("sir", shown, 100.0 * sorted_sir, "pf"),
                             fig.line("equal", shown[[0, -1]], np.full(2, 100.0 / N), "reference", dash=True)),
        "n_eff": fig.chart(
            fig.line("sis", t, r.sis.n_eff, "warning", markers=True),
            fig.line("sir", t, r.sir.n_eff, "pf", markers=True),
            fig.line("threshold", t[[0, -1]], np.full(2, max(p.threshold * N, 0.5)), "reference", dash=True),
            log_y=True, y_range=(0.8, 1.3 * N), cursor=k),
        "roots": fig.chart(fig.line("sis", t, r.sis.roots, "warning", markers=True),
                           fig.line("sir", t, r.sir.roots, "pf", markers=True), log_y=True, y_range=(0.8, 1.3 * N),
                           cursor=k),
        "proposals": fig.chart(fig.bars("sis", order[known], 100.0 * r.study[known, 0], "warning"),
                               fig.bars("sir", order[known], 100.0 * r.study[known, 1], "pf"), categories=True),
    }
