"""Plots, numbers and formulas of Example 19."""

from typing import TYPE_CHECKING

import numpy as np

from core.grid import mean_square_error
from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static._bayes_plane import Plane2D
    from lessons.static.bayes import Params

PRIOR, LIKELIHOOD, POSTERIOR, ESTIMATE = range(4)
PARABOLA = 121


def figures(p: "Params", r: "Plane2D", k: int) -> dict[str, "go.Figure"]:
    """The mean square error along the line to the user's estimate, and the spread over the realised errors."""
    from lessons.static._bayes_plane import SCALES

    last = r.steps[-1]
    top = float(r.rms.max())
    spread = [fig.line("exact", SCALES, r.rms, "posterior", markers=True)]
    if last.linear is not None:
        flat = float(np.sqrt(np.trace(last.linear.cov)))
        top = max(top, flat)
        spread.append(fig.line("linear", SCALES[[0, -1]], [flat, flat], "linearised", dash=True))
    return {"mse_plane": _mse(p, r, k), "errors": fig.chart(*spread, cursor=1.0, y_range=(0.0, 1.15 * top))}


def _mse(p: "Params", r: "Plane2D", k: int) -> "go.Figure":
    if not k:
        return fig.chart(fig.line("exact", [], [], "posterior"))
    step = r.steps[k - 1]
    mean, guess = np.asarray(step.law.mean), np.array(p.guess)
    way = guess - mean
    length = float(np.hypot(*way))
    e = way / length if length > 1e-9 else np.array([1.0, 0.0])
    trace = float(np.trace(step.law.cov))
    reach = max(1.3 * length, 2.0 * float(np.sqrt(trace)))
    t = np.linspace(-reach, reach, PARABOLA)
    traces = [fig.line("exact", t, trace + t**2, "posterior")]
    if step.linear is not None:
        off = mean + t[:, None] * e - step.linear.mean
        traces.append(fig.line("linear", t, np.trace(step.linear.cov) + np.square(off).sum(axis=1), "linearised",
                               dash=True))
    return fig.chart(*traces, fig.markers("mean", [0.0], [trace], "innovation", size=12),
                     fig.markers("mine", [length], [trace + length**2], "handle", size=12))


def _pair(x: Array) -> str:
    return f"{x[0]:.2f}, {x[1]:.2f}".replace("-", "−")


def readouts(p: "Params", r: "Plane2D", k: int) -> list[Readout]:
    """Exact and linearised side by side."""
    step = r.steps[k - 1] if k else None
    linear = step.linear if step else None

    def rms(cov: Array) -> float:
        return float(np.sqrt(np.trace(cov)))

    mine = rms(mean_square_error(step.law, np.array(p.guess))) if step else None
    return [
        Readout("mean_exact", _pair(step.law.mean) if step else None, "m"),
        Readout("mean_linear", _pair(linear.mean) if linear else None, "m"),
        Readout("rms_exact", rms(step.law.cov) if step else None, "m"),
        Readout("rms_linear", rms(linear.cov) if linear else None, "m"),
        Readout("rms_mine", mine, "m"),
        Readout("inside", 100.0 * step.inside if linear and step else None, "%", 3),
    ]


def equations(p: "Params", r: "Plane2D", k: int, stage: int) -> list[Equation]:
    """Example 19 with the numbers of these ranges."""
    prior = Equation("prior", (r"p(\mathbf{x}) \propto 1" if k < 2 else
                               r"p(\mathbf{x}) = p(\mathbf{x} \mid y_1" + (r", y_2)" if k == 3 else ")"),),
                     current=stage == PRIOR)
    if not k:
        return [prior]
    step = r.steps[k - 1]
    gaps = np.asarray(step.dy)
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("likelihood", LIKELIHOOD,
         r"p(y_k \mid \mathbf{x}) \propto \exp\left(-\frac{(\|\mathbf{x} - \mathbf{s}_k\| - y_k)^2}{2\sigma^2}\right),"
         r"\quad y_k =", (float(step.y[-1]), r"\mathrm{m}")),
        ("mean_exact", POSTERIOR, r"\mathrm{E}(\mathbf{x} \mid \mathbf{y}) =", (step.law.mean,)),
        ("cov_exact", POSTERIOR, r"V(\mathbf{x} \mid \mathbf{y}) =", (step.law.cov,)),
        ("J", ESTIMATE, r"J = h'(\bar{\mathbf{x}}) =", (step.J, r",\quad \Delta\mathbf{y} =", gaps)),
    ]
    if step.linear is not None:
        lines += [("mean_linear", ESTIMATE, r"\bar{\mathbf{x}} + (J^TJ)^{-1}J^T\Delta\mathbf{y} =",
                   (step.linear.mean,)),
                  ("cov_linear", ESTIMATE, r"\sigma^2(J^TJ)^{-1} =", (step.linear.cov,))]
    lines.append(("mse_plane", ESTIMATE, r"\mathrm{MSE}(\hat{\mathbf{x}}) = V + (\hat{\mathbf{x}} - \mathrm{E})"
                  r"(\hat{\mathbf{x}} - \mathrm{E})^T =", (mean_square_error(step.law, np.array(p.guess)),)))
    return [prior, *(Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
                     for name, at, rule, numbers in lines)]
