"""Plots, readouts and formulas of the lesson on the rate of an attitude."""

from typing import TYPE_CHECKING

import numpy as np

from core.rotation import bortz_coefficient, dcm_rate, rotation_angle
from core.types import Array
from lessons.background._attitude_rate_model import METHODS, motion_of
from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout
from lessons.kit.roles import Role

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.attitude_rate import Params, Result

ROLES: dict[str, Role] = {"naive": "linearised", "start": "innovation", "middle": "likelihood", "bortz": "posterior"}
LEAST_DEG = 1e-10                            # smaller errors are rounding
POINTS = 300
H = 1e-5                                     # of a turn, in the difference quotient among the formulas


def figures(r: "Result", step: int) -> dict[str, "go.Figure"]:
    """Error over time, largest error against the step, and difference quotients against (1.21)."""
    t, now = r.track.t_s, float(r.frames_s[step])
    thin = slice(None, None, max(1, len(t) // POINTS))
    def over_time(name: str) -> Array:
        return np.maximum(r.track.error_deg[name][thin], LEAST_DEG)

    order = np.argsort(r.steps_s)
    found = {
        "error": plot.chart(*(plot.line(name, t[thin], over_time(name), ROLES[name]) for name in METHODS), cursor=now,
                            log_y=True, y_range=(0.3 * LEAST_DEG, 360.0), x_range=(0.0, float(t[-1]))),
        "order": plot.chart(*(plot.line(name, r.steps_s[order], np.maximum(r.largest_deg[name][order], LEAST_DEG),
                                        ROLES[name], markers=True) for name in METHODS),
                            log_x=True, log_y=True, marks=(float(t[1]),), y_range=(0.3 * LEAST_DEG, 360.0)),
        "quotient": plot.chart(plot.line("forward", r.h_s, _seen(r.quotient_errors[0]), "linearised"),
                               plot.line("central", r.h_s, _seen(r.quotient_errors[1]), "posterior"),
                               log_x=True, log_y=True),
    }
    for figure in found.values():                            # 10^-9, not 1n: these are no prefixes of degrees
        for axis in (figure.layout.xaxis, figure.layout.yaxis):
            axis.exponentformat = "power"
    return found


def _seen(errors: Array) -> Array:
    return np.maximum(errors, 1e-16)


def measured_order(r: "Result", method: str) -> float | None:
    """Slope of log error over log step between the two finest steps; None where only rounding is left."""
    errors = r.largest_deg[method][-2:]
    if errors.min() < 1e-8:
        return None
    return float(np.diff(np.log(errors))[0] / np.diff(np.log(r.steps_s[-2:]))[0])


def readouts(p: "Params", r: "Result", sample: int) -> list[Readout]:
    found = [Readout(f"error_{name}", float(r.track.error_deg[name][sample])
                     if r.track.error_deg[name][sample] > LEAST_DEG else 0.0, "°", digits=3) for name in METHODS]
    drift = 360.0 * (1.0 - np.cos(np.radians(p.half_angle_deg))) if p.motion == "coning" else 0.0
    return [*found, Readout("drift", float(drift), "°", digits=5),
            *(Readout(f"order_{name}", measured_order(r, name), digits=3) for name in METHODS[1:])]


def equations(p: "Params", r: "Result", step: int, sample: int) -> list[Equation]:
    """Gyros, both integrals, the Bortz equation with its three terms, and (1.21) against a difference quotient."""
    motion, t = motion_of(p), float(r.frames_s[step])
    vector, w = motion.p(t), motion.w(t)
    gamma = float(bortz_coefficient(rotation_angle(vector)))
    half, double = 0.5 * np.cross(vector, w), gamma * np.cross(vector, np.cross(vector, w))
    h = H * motion.turn_s
    quotient = (motion.C(t + h) - motion.C(t - h)) / (2.0 * h)
    rate = r"\mathrm{rad/s}"
    return [
        Equation("gyros", (r"\mathbf{w}_{IB}^B =", _clean(w), rate), digits=5),
        Equation("p", (r"\mathbf{p} =", _clean(vector), r"\mathrm{rad},\quad \gamma(p) =", gamma), digits=5),
        Equation("naive", (r"\mathbf{p}(0) + \int\mathbf{w}\,dt =", _clean(r.track.naive[sample]), r"\mathrm{rad}"),
                 current=p.method == "naive"),
        Equation("bortz", (r"\dot{\mathbf{p}} = \mathbf{w} + \frac{1}{2}\mathbf{p}\times\mathbf{w} + "
                           r"\gamma\,\mathbf{p}\times(\mathbf{p}\times\mathbf{w})",), current=p.method == "bortz"),
        Equation("terms", ("=", _clean(w), "+", _clean(half), "+", _clean(double), "=", _clean(w + half + double),
                           rate), current=p.method == "bortz", digits=3),
        Equation("chain", (r"C_k = C_{k-1}\,C(\mathbf{w}\,\Delta t)",), current=p.method in ("start", "middle")),
        Equation("dcm_rate", (r"\dot C_B^I = C_B^I(\mathbf{w}\times) =", _clean(dcm_rate(motion.C(t), w)),
                              r"\mathrm{s}^{-1}"), digits=5),
        Equation("quotient", (r"\frac{C(t+h)-C(t-h)}{2h} =", np.round(quotient, 7) + 0.0, r"\mathrm{s}^{-1}"),
                 digits=5),
    ]


def _clean(values: Array) -> Array:
    return np.round(values, 12) + 0.0
