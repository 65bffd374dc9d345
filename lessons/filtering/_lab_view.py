"""How the laboratory is drawn: tracks and ellipses over each other, the table, and what the many runs say."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import chi_square_level
from core.types import Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Item, Label, LevelEllipse, Particles, Plane, Points, Polyline, Stations

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.filter_lab import Params, Result, Track

FLOOR = 1e-3                             # of a NEES on its logarithmic axis
WIDTHS = {"ekf": 5.5, "grid": 5.0, "kf": 4.5, "ukf": 3.0, "mixture": 3.0, "pf": 2.5}      # lines that coincide show


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this step."""
    k = at.step
    return View(
        scene=_scene(r, k), camera=_camera(r), figures=_figures(r, k), readouts=_readouts(p, r, k),
        equations=_equations(r, k), caption=f"t = {k} s", note=_note(p, r),
    )


def _note(p: "Params", r: "Result") -> str:
    if p.grid and not r.world.cells:
        return "No grid here: six dimensions would need billions of cells."
    if p.runs and p.grid:
        return f"The grid takes no part in the {p.runs} runs."
    return ""


def _law(t: "Track", k: int) -> Gaussian:
    return Gaussian(t.law.mean[k, :2], t.law.cov[k, :2, :2])


def _scene(r: "Result", k: int) -> list[Item]:
    w = r.world
    items: list[Item] = []
    if len(w.stations):
        items.append(Stations("stations", w.stations, tuple(f"S{i + 1}" for i in range(len(w.stations)))))
    if r.clouds.shape[1]:
        items.append(Particles("cloud", r.clouds[k], r.weights[k] if r.weights[k].sum() > 0.0 else None, role="pf",
                               size=3.5))
    items += [Polyline("truth", r.truth[:, :2], role="truth", dashed=True),
              Points("truth_now", r.truth[[k], :2], role="truth", size=13, shape="diamond")]
    if not len(w.stations) and not len(w.directions) and k:
        items.append(Points("fixes", r.y[:k], role="measurement", size=5, fade=0.4))
    for name, t in sorted(r.tracks.items(), key=lambda pair: -WIDTHS[pair[0]]):
        if k:
            items.append(Polyline(f"{name}_track", t.law.mean[:k + 1, :2], role=name, width=WIDTHS[name] - 1.0))
        items.append(LevelEllipse(f"{name}_now", _law(t, k), role=name, width=WIDTHS[name]))
    if r.parts:
        means, weights = r.parts[k]
        items.append(Particles("parts", means, weights, role="mixture", size=9))
    if len(w.directions):
        c = _camera(r)
        centre = np.array([sum(c.x) / 2, sum(c.y) / 2])
        reach = 0.5 * min(c.x[1] - c.x[0], c.y[1] - c.y[0])
        for i, u in enumerate(w.directions):
            items += [Arrow(f"to_satellite_{i + 1}", centre + 0.72 * reach * u, centre + 0.86 * reach * u,
                            role="satellite", width=3),
                      Label(f"satellite_{i + 1}", f"G{i + 1}", centre + 0.93 * reach * u, size=0.9)]
    return items


def _camera(r: "Result") -> Plane:
    """The true track, those estimates that stay near it, and the stations that are not far away."""
    truth = r.truth[:, :2]
    centre, size = truth.mean(axis=0), max(float(np.ptp(truth, axis=0).max()), 60.0)
    candidates = np.vstack([r.world.stations, *(t.law.mean[:, :2] for t in r.tracks.values())])
    near = candidates[np.abs(candidates - centre).max(axis=1) < 1.6 * size]
    spread = np.sqrt(np.diagonal(r.world.initial.cov)[:2])
    points = np.vstack([truth, near, truth[0] + 1.2 * spread, truth[0] - 1.2 * spread])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.08 * float((high - low).max()) + 5.0
    (x0, y0), (x1, y1) = low - margin, high + margin + (0.0, margin)      # the caption stands at the top
    return Plane((float(x0), float(x1)), (float(y0), float(y1)), "x₁ (m)", "x₂ (m)")


def _equations(r: "Result", k: int) -> list[Equation]:
    """The measurement of this step and what each filter makes of the position."""
    lines = [] if k == 0 else [Equation("measured", (r"\mathbf{y}_k =", r.y[k - 1]), digits=5)]
    lines.append(Equation("truth", (r"\mathbf{x}_{k,1:2} =", r.truth[k, :2])))
    return lines + [Equation(f"{name}_law", (r"\hat{\mathbf{x}}_{1:2} =", t.law.mean[k, :2], r",\quad P_{1:2} =",
                                             t.law.cov[k, :2, :2])) for name, t in r.tracks.items()]


def _readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    """One row per filter: numbers of this step and this track; then one row per filter over the many runs."""
    found = [Readout("columns", "error · RMSE · NEES · h/step")]
    for name, t in r.tracks.items():
        rmse = float(np.sqrt(np.square(t.error[1:]).mean()))
        work = f"{t.work:.0f}" if t.work else "fix"
        found.append(Readout(f"{name}_row", f"{t.error[k]:.3g} m · {rmse:.3g} m · {t.nees[k]:.3g} · {work}"))
    if len(r.n_eff):
        found.append(Readout("n_eff", float(r.n_eff[k]), "", 3))
    if r.many:
        found.append(Readout("runs_columns", "RMSE · in 68 % · in 95 % · lost"))
        for name, m in r.many.items():
            inside, wider = 100.0 * m.coverage
            found.append(Readout(f"{name}_runs", f"{m.total_rmse:.3g} m · {inside:.0f} % · {wider:.0f} % · "
                                                 f"{100.0 * m.lost:.3g} %"))
    return found


def _figures(r: "Result", k: int) -> dict[str, "go.Figure"]:
    t = np.arange(float(len(r.truth)))
    whole, limit = t[[0, -1]], float(chi_square_level(0.95, 2))
    found = {
        "error": fig.chart(*(fig.line(name, t, track.error, name) for name, track in r.tracks.items()), cursor=k),
        "nees": fig.chart(
            *(fig.line(name, t, np.maximum(track.nees, FLOOR), name) for name, track in r.tracks.items()),
            fig.line("limit", whole, np.full(2, limit), "reference", dash=True), log_y=True, cursor=k),
    }
    counts = []
    if len(r.n_eff):
        counts.append(fig.line("n_eff", t, r.n_eff, "pf"))
    if r.parts:
        counts.append(fig.line("parts", t, np.array([float(len(w)) for _, w in r.parts]), "mixture"))
    if counts:
        found["counts"] = fig.chart(*counts, log_y=True, cursor=k)
    if r.many:
        low, high = r.band
        found["runs_rmse"] = fig.chart(*(fig.line(name, t[1:], m.rmse, name) for name, m in r.many.items()), cursor=k)
        found["runs_nees"] = fig.chart(
            fig.band("band", t[1:], np.full(len(t) - 1, low), np.full(len(t) - 1, high), "reference"),
            *(fig.line(name, t[1:], np.maximum(m.mean_nees, FLOOR), name) for name, m in r.many.items()),
            log_y=True, cursor=k)
    return found
