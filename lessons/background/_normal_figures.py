"""Plots, numbers and formulas of the normal law."""

from typing import TYPE_CHECKING

import numpy as np

from core.levels import chi_square_probability
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.normal_distribution import Params, Result

BINS = 31


def figures(p: "Params", r: "Result") -> "dict[str, go.Figure]":
    return {"form": _form(p, r), "share": _share(p, r)}


def _form(p: "Params", r: "Result") -> "go.Figure":
    """Histogram of a'x and its normal curve."""
    s = max(r.form_sd, 1e-3)
    edges = np.linspace(r.form_mean - 3.6 * s, r.form_mean + 3.6 * s, BINS + 1)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), float(edges[1] - edges[0])
    share = np.histogram(r.x @ r.a, edges)[0] / (len(r.x) * width)
    t = np.linspace(edges[0], edges[-1], 121)
    density = np.exp(-0.5 * ((t - r.form_mean) / s) ** 2) / (s * np.sqrt(2 * np.pi))
    return chart(bars("samples", middle, share, "measurement", width=0.9 * width), line("law", t, density, "posterior"),
                 cursor=p.limit if p.show == "form" and edges[0] < p.limit < edges[-1] else None)


def _share(p: "Params", r: "Result") -> "go.Figure":
    """How many samples an ellipse of probability P holds, for every P."""
    claimed = line("claimed", [0.0, 100.0], [0.0, 100.0], "posterior", dash=True)
    if not r.rank:
        return chart(claimed, cursor=100 * p.probability)
    distance = np.sort(r.distance)
    probability = chi_square_probability(distance, r.rank)
    held = (np.arange(len(distance)) + 1.0) / len(distance)
    some = np.unique(np.round(np.linspace(0, len(distance) - 1, 200)).astype(int))
    return chart(claimed,
                 line("held", 100 * probability[some], 100 * held[some], "measurement"), cursor=100 * p.probability)


def readouts(p: "Params", r: "Result") -> list[Readout]:
    rho = r.law.cov[0, 1] / np.sqrt(max(r.law.cov[0, 0] * r.law.cov[1, 1], 1e-300))
    found = [
        Readout("level", r.level), Readout("long", float(np.sqrt(max(r.values[0], 0.0) * r.level)), "m"),
        Readout("short", float(np.sqrt(max(r.values[1], 0.0) * r.level)), "m"),
        Readout("correlation", float(rho), "", 3), Readout("inside", 100.0 * float(r.inside.mean()), "%", 3),
        Readout("form_sd", r.form_sd, "m"),
    ]
    if p.show == "form":
        found += [Readout("below", 100.0 * r.form_probability, "%"), Readout("share", 100.0 * r.form_share, "%", 3)]
    return found


def equations(p: "Params", r: "Result") -> list[Equation]:
    values = np.maximum(r.values, 0.0)
    return [
        Equation("cov", (r"\Sigma =", r.law.cov), digits=4),
        Equation("schur", (r"= Q \Lambda Q^T,\quad Q =", r.vectors, r"\Lambda =", np.diag(values))),
        Equation("ellipse", (r"(x-\mu)^T\Sigma^{-1}(x-\mu) \leq", r.level), digits=5),
        Equation("form", (r"a =", r.a, r"a^T\mu =", r.form_mean, r"\sqrt{a^T\Sigma a} =", r.form_sd)),
    ]
