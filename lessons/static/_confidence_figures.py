"""Plots, readouts and formulas of the lesson on confidence sets."""

from typing import TYPE_CHECKING

import numpy as np

from core.confidence import chebyshev_tail
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout
from lessons.static._confidence_model import STRICT

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.confidence import Params, Result

DRAW, SETS, CHECK = range(3)
LEAST = 1e-3                             # smaller tails are not drawn


def figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """Tails against the bound, radius against probability, coverage against the number of experiments."""
    from lessons.static.confidence import LAMBDAS, SHARES

    root = np.sqrt(r.e.n)
    tails = [fig.line("bound", LAMBDAS, chebyshev_tail(LAMBDAS), "sigma", width=3),
             fig.line("normal", LAMBDAS, _drawn(r.normal_tail), "posterior", dash=True),
             fig.line("law", LAMBDAS, _drawn(r.tail), "likelihood", width=3)]
    if r.e.n > 1:
        tails.append(fig.line("circle", LAMBDAS, _drawn(r.circle_tail), "linearised"))
    normal, chebyshev, exact = r.radii.T
    return {
        "tails": fig.chart(*tails, log_y=True, x_range=(0.0, 5.0), y_range=(LEAST, 1.6),
                           marks=[radius / root for radius in (r.normal.radius, r.chebyshev.radius)
                                  if radius / root <= 5.0]),
        "radius": fig.chart(fig.line("chebyshev", 100 * SHARES, chebyshev, "sigma", width=3),
                            fig.line("normal", 100 * SHARES, normal, "posterior"),
                            fig.line("exact", 100 * SHARES, exact, "likelihood", width=3), cursor=p.percent),
        "coverage": _coverage(p, r, k),
    }


def _drawn(tail: np.ndarray) -> np.ndarray:
    return np.maximum(tail, 0.1 * LEAST)


def _coverage(p: "Params", r: "Result", k: int) -> "go.Figure":
    """Share that was covered so far, in the band where it should be 95 % of the times."""
    count = np.arange(1, len(r.far) + 1)
    shares = [100.0 * np.cumsum(r.far < STRICT * radius) / count for radius in (r.normal.radius, r.chebyshev.radius)]
    spread = 196.0 * np.sqrt(r.normal.holds * (1.0 - r.normal.holds) / count)
    expected = 100.0 * r.normal.holds
    low = np.clip(expected - spread, 0.0, 100.0)
    return fig.chart(
        fig.band("band", count, low, np.clip(expected + spread, 0.0, 100.0), "posterior"),
        fig.line("asked", count[[0, -1]], np.full(2, p.percent), "reference", dash=True),
        fig.line("chebyshev", count[:k], shares[1][:k], "sigma"),
        fig.line("normal", count[:k], shares[0][:k], "posterior", width=3),
        x_range=(0.0, len(count) + 1.0), y_range=(max(0.0, min(40.0, float(low[9:].min()) - 5.0)), 102.0))


def readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    """What was asked for, what the sets really hold, and how many of the k draws they held."""
    def count(radius: float) -> str | None:
        return f"{int((r.far[:k] < STRICT * radius).sum())} of {k}" if k else None

    plane = r.e.n == 2
    return [
        Readout("holds_normal", 100 * r.normal.holds, "%", 4),
        Readout("count_normal", count(r.normal.radius)),
        Readout("holds_chebyshev", 100 * r.chebyshev.holds, "%", 5),
        Readout("count_chebyshev", count(r.chebyshev.radius)),
        Readout("ratio", r.chebyshev.radius / r.normal.radius, digits=4),
        Readout("exact", r.exact_radius, "σ", 4),
        Readout("holds_circle", 100 * r.circle.holds if plane else None, "%", 5),
        Readout("area", float(r.circle.radius**2 / (r.chebyshev.radius**2 * np.prod(r.axes.semi_axes)))
                if plane else None, digits=3),
    ]


def equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """One experiment: the error, the three sets, and whether they hold the truth."""
    k, n = at.step, r.e.n
    share = p.percent / 100.0
    first = r"\hat{\mathbf{x}}_k - \mathbf{x} =" if p.reading == "repeated" else r"\mathbf{x}_k - \hat{\mathbf{x}} ="
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("draw", DRAW, first, (r.draws[k - 1] - r.q,) if k else ()),
        ("normal", SETS, r"d^2 < \chi^2_n(p)", (rf",\quad \chi^2_{n} =", r.normal.radius**2)),
        ("chebyshev", SETS, r"d^2 < n\lambda^2 = \frac{n}{1 - p}",
         (r",\quad \lambda =", float(np.sqrt(1.0 / (1.0 - share))), r",\quad n\lambda^2 =", r.chebyshev.radius**2)),
    ]
    if n == 2:
        lines.append(("circle", SETS, r"\|\mathbf{x} - \hat{\mathbf{x}}\| < \lambda\sqrt{\mathrm{tr}\,\Sigma}",
                      ("=", r.circle.radius)))
    far = float(r.far[k - 1]) if k else 0.0
    found = r.far[:k]
    lines += [
        ("distance", CHECK, r"d^2 = (\mathbf{x} - \hat{\mathbf{x}})^T\Sigma^{-1}(\mathbf{x} - \hat{\mathbf{x}}) =",
         (far**2,) if k else ()),
        ("share", CHECK, r"\frac{\mathrm{held}}{k}:", (
            r"\mathrm{normal}\;", float((found < STRICT * r.normal.radius).mean()),
            r",\quad\mathrm{Chebyshev}\;", float((found < STRICT * r.chebyshev.radius).mean())) if k else ()),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=bool(k) and stage == at.stage)
            for name, stage, rule, numbers in lines]
