"""Plots, numbers and formulas of the lesson on conditioning."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import log_density, mahalanobis_squared
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.conditioning import Params, Result

JOINT, CUT, SCALE, COMPARE, REGRESSION = range(5)
LEAST = 25                               # samples in the strip, for a histogram


def figures(p: "Params", r: "Result") -> dict[str, "go.Figure"]:
    """Slice and marginal at area 1, the slice as it is, and the line of the conditional means."""
    from lessons.background.conditioning import HALF_M

    t = np.linspace(-HALF_M, HALF_M, 257)
    x, y = p.probe

    def normal(g: Gaussian) -> Array:
        return np.exp(log_density(g, t[:, None]))

    compared = [fig.line("alone", t, normal(r.x_law), "prior"), fig.line("given", t, normal(r.given), "posterior")]
    if r.near.sum() >= LEAST:
        counts, edges = np.histogram(r.draws[r.near, 0], 32, (-HALF_M, HALF_M))
        compared.insert(0, fig.bars("sample", 0.5 * (edges[1:] + edges[:-1]),
                                    counts / (r.near.sum() * (edges[1] - edges[0])), "monte_carlo"))
    slices = [fig.line("other", t, np.exp(log_density(r.joint, np.column_stack([t, np.zeros(len(t))]))), "prior",
                       dash=True),
              fig.line("slice", t, np.exp(log_density(r.joint, np.column_stack([t, np.full(len(t), y)]))),
                       "measurement")]
    sd = float(np.sqrt(r.given.cov[0, 0]))
    line = [fig.band("band", t, r.K * t - sd, r.K * t + sd, "posterior"), fig.line("mean", t, r.K * t, "vector")]
    if abs(p.gain) > 0.05:
        line.append(fig.line("backwards", t, t / p.gain, "reference", dash=True))
    return {
        "conditional": fig.chart(*compared, cursor=x, x_range=(-HALF_M, HALF_M)),
        "slice": fig.chart(*slices),
        "regression": fig.chart(*line, cursor=y, y_range=(-HALF_M, HALF_M)),
    }


def readouts(p: "Params", r: "Result") -> list[Readout]:
    """The conditional law, what it was before, and what the samples in the strip say."""
    enough = r.near.sum() >= LEAST
    return [
        Readout("mean", float(r.given.mean[0]), "m"), Readout("var", float(r.given.cov[0, 0]), "m²"),
        Readout("sd", float(np.sqrt(r.given.cov[0, 0])), "m"), Readout("sd_before", p.sigma_x_m, "m"),
        Readout("f_y", r.f_y, "1/m"), Readout("K", r.K, "m/m"), Readout("below", 100.0 * r.below, "%"),
        Readout("sampled", float(r.draws[r.near, 0].mean()) if enough else None, "m", 3),
    ]


def equations(p: "Params", r: "Result", stage: int) -> list[Equation]:
    """Exercise 1.14 with the numbers at the probe."""
    x, y = p.probe
    P = np.asarray(r.joint.cov)
    S = float(r.given.cov[0, 0])
    both = float(mahalanobis_squared(r.joint, [x, y]))
    left = both - y * y / float(P[1, 1])
    here, quotient = (float(np.exp(log_density(g, at))) for g, at in ((r.joint, [x, y]), (r.given, [x])))
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("joint", JOINT, r"\Sigma = \begin{bmatrix}\sigma_x^2 & H\sigma_x^2\\ H\sigma_x^2 & H^2\sigma_x^2 + \sigma_v^2"
                         r"\end{bmatrix} =", (P,)),
        ("f_y", CUT, r"f_y(y) = \int f(x, y)\,dx = N(y;\,0,\,\Sigma_{yy}) =", (r.f_y,)),
        ("quotient", SCALE, r"f(x \mid y) = \frac{f(x, y)}{f_y(y)} =", (here, "/", r.f_y, "=", quotient)),
        ("square", SCALE, r"\begin{bmatrix}x & y\end{bmatrix}\Sigma^{-1}\begin{bmatrix}x\\ y\end{bmatrix} - "
                          r"\frac{y^2}{\Sigma_{yy}} = \frac{(x - \Sigma_{xy}\Sigma_{yy}^{-1}y)^2}{V(x \mid y)} =",
         (left,)),
        ("var", COMPARE, r"V(x \mid y) = \Sigma_{xx} - \Sigma_{xy}\Sigma_{yy}^{-1}\Sigma_{yx} =", (S,)),
        ("gain", REGRESSION, r"\Sigma_{xy}\Sigma_{yy}^{-1} =", (r.K,)),
        ("mean", REGRESSION, r"\mathrm{E}(x \mid y) = \Sigma_{xy}\Sigma_{yy}^{-1}\,y =", (float(r.given.mean[0]),)),
    ]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]
