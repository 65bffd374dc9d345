"""Plots, readouts and formulas of the lesson on the extended filter."""

from typing import TYPE_CHECKING

import numpy as np

from core import grid
from core.gaussian import log_density, marginal
from core.types import Array, Gaussian
from lessons.filtering._extended_model import PROBABILITY
from lessons.kit import figures as plot
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.extended import Params, Result

ALONG = np.linspace(-2.5, 2.5, 101)          # prior sigmas
LEAST_COST = 0.01                            # less is drawn there, on a logarithmic axis
PRIOR, LIKELIHOOD, POSTERIOR, TANGENT, UPDATE = range(5)


def shown_unit(p: "Params") -> tuple[float, str]:
    """How many shown units are one unit of the sensor, and its name: bearings are shown in degrees."""
    return (180.0 / np.pi, "°") if p.sensor == "bearing" else (1.0, "m")


def figures(p: "Params", r: "Result", i: int) -> dict[str, "go.Figure"]:
    """h and its tangent, the posterior of one coordinate, the share inside by the prior's spread, the cost."""
    return {"tangent": _tangent(p, r, i), "density": _density(p, r, i), "share": _share(r), "cost": _cost(r, i)}


def _tangent(p: "Params", r: "Result", i: int) -> "go.Figure":
    """Through x_i in the direction in which h bends most: h, its tangent and the measurement."""
    scale, _ = shown_unit(p)
    line = r.points[i] + ALONG[:, None] * r.bent[i]
    here = r.sensor.h(r.points[i])
    # Relative to h(x_i), so that a bearing does not jump at 180 degrees.
    curve = here[0] + r.sensor.innovation(r.sensor.h(line), here)[:, 0]
    straight = here[0] + ALONG * float(r.updates[i].jacobian[0] @ r.bent[i])
    y = here[0] + float(r.sensor.innovation(r.y, here)[0])
    sigma, ends = float(np.sqrt(r.sensor.R[0, 0])), ALONG[[0, -1]]
    return plot.chart(
        plot.band("band", ends, *(np.full(2, scale * (y + s * sigma)) for s in (-1, 1)), "measurement"),
        plot.line("y", ends, np.full(2, scale * y), "measurement", dash=True),
        plot.line("h", ALONG, scale * curve, "likelihood"),
        plot.line("straight", ALONG, scale * straight, "linearised"), marks=(-1.0, 1.0), cursor=0.0)


def _density(p: "Params", r: "Result", i: int) -> "go.Figure":
    """Marginal densities of one coordinate."""
    axis = ("x", "y").index(p.axis)
    exact = grid.marginal(r.exact, [axis])
    laws = [r.prior, r.updates[0].posterior] + ([r.updates[i].posterior] if i else [])
    low = min(float(exact.axes[0][0]), *(float(g.mean[axis] - 3 * np.sqrt(g.cov[axis, axis])) for g in laws))
    high = max(float(exact.axes[0][-1]), *(float(g.mean[axis] + 3 * np.sqrt(g.cov[axis, axis])) for g in laws))
    x = np.linspace(low, high, 241)

    def normal(g: Gaussian) -> Array:
        return np.exp(log_density(marginal(g, [axis]), x[:, None]))

    traces = [plot.line("prior", x, normal(r.prior), "prior", width=2),
              plot.line("exact", exact.axes[0], exact.density, "posterior", width=3),
              plot.line("ekf", x, normal(r.updates[0].posterior), "ekf", dash=i > 0)]
    if i:
        traces.append(plot.line("iterated", x, normal(r.updates[i].posterior), "vector"))
    return plot.chart(*traces, cursor=p.truth[axis])


def _share(r: "Result") -> "go.Figure":
    from lessons.filtering.extended import FACTORS

    ends = FACTORS[[0, -1]]
    return plot.chart(
        plot.line("claim", ends, np.full(2, 100 * PROBABILITY), "reference", dash=True),
        plot.line("ekf", FACTORS, 100 * r.shares[:, 0], "ekf", markers=True),
        plot.line("iterated", FACTORS, 100 * r.shares[:, 1], "vector", markers=True),
        cursor=1.0, log_x=True, x_range=(0.09, 2.2), y_range=(0.0, 100.0))


def _cost(r: "Result", i: int) -> "go.Figure":
    """What the iterations try to make small; logarithmic, since far from the peak it is huge."""
    n = np.arange(len(r.cost))
    cost, least = np.clip(r.cost, LEAST_COST, 1e9), max(r.cost_at_mode, LEAST_COST)
    return plot.chart(
        plot.line("mode", n[[0, -1]], np.full(2, least), "posterior", dash=True),
        plot.line("cost", n, cost, "vector", markers=True), cursor=i + 1, log_y=True)


def readouts(p: "Params", r: "Result", i: int) -> list[Readout]:
    """How curved h is for this prior, and what that does to the estimate."""
    scale, unit = shown_unit(p)
    return [
        Readout("y", scale * float(r.y[0]), unit),
        Readout("bend", r.bend, "σ", 3),
        Readout("inside_ekf", 100 * float(r.inside[0]), "%", 3),
        Readout("inside_here", 100 * float(r.inside[i]) if i else None, "%", 3),
        Readout("off_ekf", float(r.off[0]), "m", 3),
        Readout("off_here", float(r.off[i]) if i else None, "m", 3),
    ]


def equations(p: "Params", r: "Result", i: int, stage: int) -> list[Equation]:
    """The update at the tangent in x_i, from the same prior each time; bearings in degrees."""
    scale, _ = shown_unit(p)
    u = r.updates[i]
    gap = r.sensor.innovation(r.y, r.sensor.h(r.points[i]))
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("prior", PRIOR, r"\hat{\mathbf{x}}^- =", (r.prior.mean, r",\quad P^- =", r.prior.cov)),
        ("y", LIKELIHOOD, r"\mathbf{y} =", (scale * r.y, r",\quad R =", scale**2 * r.sensor.R)),
        ("exact", POSTERIOR, r"\mathrm{E}(\mathbf{x}\mid\mathbf{y}) =",
         (r.moments.mean, r",\quad \mathrm{V}(\mathbf{x}\mid\mathbf{y}) =", r.moments.cov)),
        ("expected", TANGENT, r"h(\mathbf{x}_i)", ("=", scale * r.sensor.h(r.points[i]))),
        ("jacobian", TANGENT, r"H_i = h'(\mathbf{x}_i)", ("=", scale * u.jacobian)),
        ("innovation", UPDATE, r"\nu_i = \mathbf{y} - h(\mathbf{x}_i) - H_i(\hat{\mathbf{x}}^- - \mathbf{x}_i)",
         ("=", scale * gap, "-", scale * (gap - u.innovation), "=", scale * u.innovation)),
        ("gain", UPDATE, r"K_i = P^-H_i^T(H_iP^-H_i^T + R)^{-1}", ("=", u.gain / scale)),
        ("mean", UPDATE, r"\mathbf{x}_{i+1} = \hat{\mathbf{x}}^- + K_i\nu_i", ("=", u.posterior.mean)),
        ("cov", UPDATE, r"P = (I - K_iH_i)P^-", ("=", u.posterior.cov)),
    ]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]
