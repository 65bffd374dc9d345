"""Plots, numbers and formulas of likelihoods in the plane."""

import math
from typing import TYPE_CHECKING

import numpy as np

from core.likelihood import weighted_cost
from core.sensors import Stack
from core.sensors_discrete import BinarySector
from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout
from lessons.static._likelihood_plane import BOX, Factor, Plane2D, relative, top

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.likelihood import Params

FACTOR, PRODUCT = range(2)
FLOOR = 10.0                                 # logarithms below minus this are cut in the plot
UNITS = {"range": "m", "bearing": "°", "difference": "m", "strength": "dBm"}
RULES = {
    "normal": r"p(y_i \mid \mathbf{x}) = \frac{1}{\sigma_i\sqrt{2\pi}}\,e^{-(y_i - h_i(\mathbf{x}))^2/2\sigma_i^2}",
    "uniform": r"p(y_i \mid \mathbf{x}) = \frac{1}{2w_i}\ \text{if}\ |y_i - h_i(\mathbf{x})| \leq w_i,\ \text{else}\ 0",
    "sharp": r"P(1 \mid \mathbf{x}) = 1\ \text{if}\ \|\mathbf{s} - \mathbf{x}\| \leq r,\ \text{else}\ 0;\quad "
             r"P(y_i \mid \mathbf{x})",
    "soft": r"P(1 \mid \mathbf{x}) = \Phi((r - \|\mathbf{s} - \mathbf{x}\|)/\sigma);\quad P(y_i \mid \mathbf{x})",
}


def measured(f: Factor) -> str:
    """The value as it is shown."""
    if f.kind == "inside":
        return "yes" if f.y[0] == 1.0 else "no"
    value = math.degrees(float(f.y[0])) % 360.0 if f.kind == "bearing" else float(f.y[0])
    return f"{value:.1f} {UNITS[f.kind]}".replace("-", "−").replace(" °", "°")


def figures(p: "Params", r: Plane2D, k: int, stage: int) -> dict[str, "go.Figure"]:
    """Along the line through x from west to east: factors and product, and the logarithm against the cost."""
    east = np.linspace(BOX[0, 0], BOX[1, 0], 201)
    points = np.column_stack([east, np.full(len(east), p.probe[1])])
    found = {"section": _section(p, r, k, stage, east, points), "mirror": _mirror(p, r, k, east, points)}
    if p.inside != "off":
        found["edge"] = _edge(p)
    return found


def _section(p: "Params", r: Plane2D, k: int, stage: int, east: Array, points: Array) -> "go.Figure":
    values = np.array([relative(f, points) for f in r.factors[:k + 1]])
    traces = []
    if k:
        traces.append(fig.line("before", east, values[:k].prod(axis=0), "muted"))
    traces.append(fig.line("factor", east, values[k], "measurement"))
    if stage == PRODUCT:
        traces.append(fig.line("product", east, values.prod(axis=0), "likelihood", width=3.5))
    return fig.chart(*traces, marks=[p.probe[0]], y_range=(0.0, 1.05))


def _mirror(p: "Params", r: Plane2D, k: int, east: Array, points: Array) -> "go.Figure":
    """Example 17: with normal errors the logarithm is half the cost, turned upside down."""
    logs = sum(f.sensor.log_likelihood(f.y, points) - top(f) for f in r.factors[:k + 1])
    traces = [fig.line("log", east, np.maximum(logs, -FLOOR), "likelihood")]
    if (cost := _cost(r, k, points)) is not None:
        traces.append(fig.line("cost", east, np.minimum(0.5 * cost, FLOOR), "linearised"))
    return fig.chart(*traces, marks=[p.probe[0]], y_range=(-FLOOR, FLOOR))


def _cost(r: Plane2D, k: int, x: Array) -> Array | None:
    """(y - h)' R^-1 (y - h) of what has an h; None if nothing has."""
    used = [f for f in r.factors[:k + 1] if f.normal is not None]
    if not used:
        return None
    return weighted_cost(Stack(tuple(f.normal for f in used)), np.concatenate([f.y for f in used]), x)


def _edge(p: "Params") -> "go.Figure":
    """Exercise 2.10 (c) and (d): the probability of each answer, over the distance."""
    distance = np.linspace(max(p.radius_m - 40.0, 0.0), p.radius_m + 40.0, 321)
    sensor = BinarySector(np.zeros((1, 1)), p.radius_m, p.edge_m)
    yes, no = (np.exp(sensor.log_likelihood(np.array([y]), distance[:, None])) for y in (1.0, 0.0))
    traces = fig.line("yes", distance, yes, "measurement"), fig.line("no", distance, no, "reference", dash=True)
    return fig.chart(*traces, marks=[math.dist(p.probe, p.station_3)], y_range=(0.0, 1.05))


def readouts(p: "Params", r: Plane2D, k: int, stage: int) -> list[Readout]:
    """This measurement, both likelihoods at x, and the estimates."""
    x, f = np.array(p.probe), r.factors[k]
    alone = float(relative(f, x))
    product = float(np.prod([relative(g, x) for g in r.factors[:k + 1]]))
    shown, known = stage == PRODUCT and bool(r.single[k]), bool(np.isfinite(r.squares[k]).all())
    both = shown and known
    return [
        Readout("measured", measured(f)),
        Readout("alone", alone), Readout("product", product if stage == PRODUCT else None),
        Readout("ml", _pair(r.best[k]) if shown else None, "m"),
        Readout("wls", _pair(r.squares[k]) if stage == PRODUCT and known else None, "m"),
        Readout("gap", round(float(np.linalg.norm(r.best[k] - r.squares[k])), 2) if both else None, "m", 3),
        Readout("error", round(float(np.linalg.norm(r.best[k] - p.truth)), 2) if shown else None, "m", 3),
    ]


def _pair(x: Array) -> str:
    return f"{x[0]:.2f}, {x[1]:.2f}".replace("-", "−")


def equations(p: "Params", r: Plane2D, k: int, stage: int) -> list[Equation]:
    """The likelihood of this measurement, of all, its logarithm and the cost, at the place x; then both estimates."""
    x, f = np.array(p.probe), r.factors[k]
    kind = p.noise if f.kind != "inside" else "soft" if p.edge_m > 0.0 else "sharp"
    logs = [float(g.sensor.log_likelihood(g.y, x)) for g in r.factors[:k + 1]]
    total, cost = sum(logs), _cost(r, k, x)
    bell = p.noise == "normal" and all(g.kind != "inside" for g in r.factors[:k + 1])
    finite: tuple[Piece, ...] = ("=", total) if np.isfinite(total) else (r"= -\infty",)
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("here", FACTOR, r"\mathbf{x}", ("=", x)),
        ("factor", FACTOR, RULES[kind], ("=", math.exp(logs[k]))),
        ("product", PRODUCT, r"p(\mathbf{y} \mid \mathbf{x}) = \prod_i p(y_i \mid \mathbf{x})", ("=", math.exp(total))),
        ("log", PRODUCT, r"\ln p(\mathbf{y} \mid \mathbf{x})", finite),
    ]
    if bell and cost is not None:
        constant = sum(top(g) for g in r.factors[:k + 1])
        rule = r"\ln C - \frac{1}{2}(\mathbf{y} - h)^T\Sigma^{-1}(\mathbf{y} - h)"
        lines.append(("mirror", PRODUCT, rule, ("=", constant, r"-\ \frac{1}{2}\cdot", float(cost), "=",
                                                constant - 0.5 * float(cost))))
    ml: tuple[Piece, ...] = ("=", r.best[k]) if r.single[k] else ()
    wls: tuple[Piece, ...] = ("=", r.squares[k]) if np.isfinite(r.squares[k]).all() else ()
    lines += [("ml", PRODUCT, r"\hat{\mathbf{x}} = \mathrm{argmax}\ p(\mathbf{y} \mid \mathbf{x})", ml),
              ("wls", PRODUCT, r"\mathrm{argmin}\ (\mathbf{y} - h)^T\Sigma^{-1}(\mathbf{y} - h)", wls)]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]
