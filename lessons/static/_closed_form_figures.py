"""Plots of the closed-form lesson: the parabola, the errors of both methods, and their growth with the noise."""

from typing import TYPE_CHECKING

import numpy as np

from core.frames import dcm_enu_from_ecef
from core.geodesy import geodetic_from_ecef
from lessons.kit import figures as plot
from lessons.kit.lesson import Moment
from lessons.static._closed_form_numbers import lambdas, quadratic

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.closed_form import Params, Result

LEAST_M = 1e-9                               # less is drawn there, on logarithmic axes
HIGHEST = 100.0                              # times sigma DOP; more is drawn there, outside the plot


def figures(p: "Params", r: "Result", at: Moment) -> dict[str, "go.Figure"]:
    """The parabola, the errors of the experiments, their rms over the noise, and what the mode adds."""
    found = {}
    if r.fix is not None:
        found["parabola"] = _parabola(r, at.step)
    if p.mode == "globe":
        found["cloud"] = _cloud(r, at.step)
    if r.spread is not None:
        found["noise"] = _noise(p, r)
        if p.mode == "plane":
            share = 100.0 * r.spread.without
            found["complex"] = plot.chart(plot.line("without", r.spread.sigmas_m, share, "warning", markers=True),
                                          log_x=True, cursor=p.sigma_m, y_range=(0.0, max(10.0, 1.1 * share.max())))
    if p.mode == "globe" and len(r.approach):
        found["approach"] = _approach(r)
    return found


def _parabola(r: "Result", k: int) -> "go.Figure":
    """a lambda^2 + b lambda + c round its roots, or round its vertex where it has none."""
    a, b, c = quadratic(r, k)
    ends = lambdas(r, k)
    ends = ends[np.isfinite(ends)]
    if len(ends) < 2 and abs(a) > 1e-12:
        ends = np.append(ends, [-0.5 * b / a, 0.0])
    low, high = float(ends.min(initial=0.0)), float(ends.max(initial=0.0))
    width = max(high - low, 1.0)
    x = np.linspace(low - 0.15 * width, high + 0.15 * width, 121)
    roots = lambdas(r, k)
    roots = roots[np.isfinite(roots)]
    return plot.chart(plot.line("zero", x[[0, -1]], np.zeros(2), "reference", dash=True),
                      plot.line("parabola", x, (a * x + b) * x + c, "linearised"),
                      plot.markers("roots", roots, np.zeros(len(roots)), "posterior", size=11))


def _cloud(r: "Result", k: int) -> "go.Figure":
    """East and north errors of both methods at the user."""
    truth = r.problem.truth[:3]
    where = geodetic_from_ecef(truth) if truth.any() else None
    C = np.eye(3) if where is None else dcm_enu_from_ecef(where.lat_rad, where.lon_rad)
    traces = []
    for key, x, role, size in (("iterated", r.gauss_newton, "vector", 10), ("closed", r.chosen, "posterior", 6)):
        e = (x[1:k + 1] - truth) @ C.T
        e = e[np.isfinite(e).all(axis=1)]
        traces.append(plot.markers(key, e[:, 0], e[:, 1], role, size=size))
    return plot.chart(plot.markers("truth", [0.0], [0.0], "truth", size=9, symbol="x"), *traces, equal=True)


def _noise(p: "Params", r: "Result") -> "go.Figure":
    """Rms errors over sigma, as multiples of what the linearisation promises."""
    s = r.spread
    traces = [plot.line("linear", s.sigmas_m[[0, -1]], np.ones(2), "reference", dash=True)]
    for key, values, role in (("iterated", s.gauss_newton_m, "vector"), ("closed", s.closed_m, "posterior")):
        ratio = values / s.linear_m
        good = np.isfinite(ratio)
        traces.append(plot.line(key, s.sigmas_m[good], np.minimum(ratio[good], HIGHEST), role, markers=True))
    return plot.chart(*traces, log_x=True, cursor=p.sigma_m, y_range=(0.0, 2.0))


def _approach(r: "Result") -> "go.Figure":
    """Gauss-Newton from the centre of the Earth, and the closed form at once."""
    n = np.arange(len(r.approach))
    traces = [plot.line("iterates", n, np.maximum(r.approach, LEAST_M), "vector", markers=True)]
    off = np.linalg.norm(r.chosen[0] - r.problem.truth[:3])
    if np.isfinite(off):
        traces.append(plot.line("closed", n[[0, -1]], np.full(2, max(float(off), LEAST_M)), "posterior", dash=True))
    return plot.chart(*traces, log_y=True)
