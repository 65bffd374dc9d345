"""Plots, numbers and formulas of the search for garbage."""

from typing import TYPE_CHECKING

import numpy as np

from core.levels import chi_square_probability
from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout
from lessons.static._garbage_model import MISSED, SWEEP_M, Garbage

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.garbage_measurements import Params

MEASURE, SOLVE, TEST, REPAIR, REPEAT = range(5)
FAR_M = 1e4


def suspect(r: Garbage) -> int | None:
    """The row that the test points at; None where it is content or cannot tell."""
    if r.test.passed or r.test.freedom == 1:
        return None
    return int(r.test.suspect)


def figures(p: "Params", r: Garbage, k: int) -> dict[str, "go.Figure"]:
    """Normalised residuals, errors against the size of the garbage, power of the tests, weights."""
    return {"residuals": _residuals(r), "sweep": _sweep(p, r), "power": _power(p, r), "weights": _weights(r, k)}


def _named(chart: "go.Figure", m: int) -> "go.Figure":
    chart.layout.xaxis.update(tickvals=np.arange(1, m + 1), ticktext=[f"S{i + 1}" for i in range(m)])
    return chart


def _residuals(r: Garbage) -> "go.Figure":
    m = len(r.y)
    size, limit, rows = np.abs(r.test.normalised), r.test.each_level, np.arange(1, m + 1)
    over = size > limit
    traces = [fig.bars(key, rows[which], size[which], role, width=0.6)
              for key, which, role in (("good", ~over, "measurement"), ("over", over, "warning")) if which.any()]
    traces.append(fig.line("limit", [0.4, m + 0.6], [limit, limit], "reference", dash=True))
    return _named(fig.chart(*traces, y_range=(0.0, 1.15 * max(limit, float(size.max())))), m)


def _sweep(p: "Params", r: Garbage) -> "go.Figure":
    error = np.minimum(r.errors, FAR_M)
    top = 1.1 * float(np.quantile(error[:, 0], 0.9))
    return fig.chart(*(fig.line(key, SWEEP_M, error[:, i], role) for i, (key, role) in enumerate(
        (("plain", "posterior"), ("cleaned", "likelihood"), ("huber", "innovation")))),
        cursor=p.error_m, y_range=(0.0, max(top, 5.0)))


def _power(p: "Params", r: Garbage) -> "go.Figure":
    """How likely an error of the bad range is noticed at all, and pinned on it."""
    from scipy.special import ndtr, ndtri

    z = float(ndtri(1.0 - 0.5 * p.false_alarm))
    size = float(r.detectable[r.bad]) / (z + float(ndtri(1.0 - MISSED)))            # one sigma of what w sees
    b = np.linspace(0.0, max(150.0, abs(p.error_m)), 76)
    if not np.isfinite(size):
        none = np.full(len(b), p.false_alarm)
        return fig.chart(fig.line("test", b, none, "reference"), y_range=(0.0, 1.02), cursor=abs(p.error_m))
    noticed = 1.0 - chi_square_probability(r.test.level, r.test.freedom, (b / size)**2)
    pinned = ndtr(b / size - z) + ndtr(-b / size - z)
    return fig.chart(fig.line("test", b, noticed, "reference"), fig.line("each", b, pinned, "measurement"),
                     marks=[float(r.detectable[r.bad])], cursor=abs(p.error_m), x_range=(0.0, float(b[-1])),
                     y_range=(0.0, 1.02))


def _weights(r: Garbage, k: int) -> "go.Figure":
    m = len(r.y)
    rows = np.arange(1, m + 1)
    return _named(fig.chart(fig.bars("first", rows - 0.2, r.robust.weights[0], "muted", width=0.36),
                            fig.bars("now", rows + 0.2, r.robust.weights[k], "innovation", width=0.36),
                            y_range=(0.0, 1.05)), m)


def readouts(p: "Params", r: Garbage, stage: int, k: int) -> list[Readout]:
    """What the test says, and how wrong the estimates are."""
    def off(x: Array) -> float:
        return float(np.linalg.norm(x - p.user))

    found, smallest = suspect(r), float(r.detectable[r.bad])
    tested, repaired = stage >= TEST, stage >= REPAIR
    return [
        Readout("statistic", float(r.test.statistic) if tested else None),
        Readout("level", r.test.level),
        Readout("p_value", _percent(100.0 * float(r.test.p_value)) if tested else None),
        Readout("suspect", ("none" if found is None else f"S{found + 1}") if tested else None),
        Readout("detectable", smallest if smallest < FAR_M else None, "m", 3),
        Readout("error_plain", off(r.fix.x) if stage >= SOLVE else None, "m", 3),
        Readout("error_cleaned", off(r.cleaned.x) if repaired else None, "m", 3),
        Readout("error_huber", off(r.robust.iterates[k]) if stage == REPEAT else None, "m", 3),
    ]


def _percent(value: float) -> str:
    return f"{value:.2g} %" if value >= 1e-3 else "< 0.001 %"


def equations(p: "Params", r: Garbage, stage: int, k: int) -> list[Equation]:
    """The argument, line by line."""
    excluded = r.cleaned.excluded
    left: tuple[Piece, ...] = (r"\ \text{(nothing left out)} =", r.cleaned.x) if not excluded else (
        r"\ \text{(left out:}", float(excluded[0] + 1), r"\text{)} =", r.cleaned.x)
    weights, x = r.robust.weights[k], r.robust.iterates
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("ranges", MEASURE, r"\mathbf{y} = h(\mathbf{x}) + \mathbf{v}", ("=", r.y)),
        ("solution", SOLVE, r"\hat{\mathbf{x}} = \mathrm{argmin}\ \mathbf{p}^TR^{-1}\mathbf{p}", ("=", r.fix.x)),
        ("residual", SOLVE, r"\mathbf{p} = h(\hat{\mathbf{x}}) - \mathbf{y}", ("=", r.test.residuals)),
        ("test", TEST, r"\mathbf{p}^TR^{-1}\mathbf{p}", (
            "=", float(r.test.statistic), r"\ \leq\ " if r.test.passed else r"\ >\ ", r.test.level,
            r"= \chi^2_{1-\alpha}(m-n)")),
        ("each", TEST, r"w_i = p_i\,/\sqrt{V(\mathbf{p})_{ii}}", ("=", r.test.normalised, r",\quad |w_i| \leq",
                                                                   r.test.each_level)),
        ("smallest", TEST, r"b_i = (z_{1-\alpha/2} + z_{0.8})\,\sigma^2/\sqrt{V(\mathbf{p})_{ii}}",
         ("=", r.detectable) if (r.detectable < FAR_M).all() else ()),
        ("left_out", REPAIR, r"\hat{\mathbf{x}}_{(i)}", left),
        ("weights", REPEAT, r"\omega_i = \min(1,\ c\,\sigma/|p_i|)", ("=", weights)),
        ("huber", REPEAT, r"\mathbf{x}_{k} = \mathbf{x}_{k-1} - (J^T\Omega J)^{-1}J^T\Omega\,\mathbf{p}", ("=", x[k])),
    ]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage, digits=4)
            for name, at, rule, numbers in lines]
