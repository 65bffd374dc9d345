"""Plots, numbers and formulas of ranges in the plane."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout
from lessons.static._dop_ground import AXIS, CUT, SIGMAS_M, WEIGHTS, Ground, rms

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.dilution_of_precision import Params

HUGE = 1e6
GROWTH_TOP = 3.0


def figures(p: "Params", r: Ground, x: Array) -> dict[str, "go.Figure"]:
    """DOP along two lines; or how normal the errors are, how they grow, and what the weights do."""
    if p.mode in ("map", "surface"):
        found = {"section": _section(p, r)}
        return found if p.third else {**found, "angle": _by_angle(p, r)}
    found = {"errors": _errors(p, r, x), "noise": _noise(p, r)}
    return {"weights": _weights(p, r), **found} if p.third else found


def _section(p: "Params", r: Ground) -> "go.Figure":
    """Through the user, to the east and to the north."""
    i, j = (int(np.abs(AXIS - v).argmin()) for v in p.user)
    return fig.chart(fig.line("east", AXIS, r.map[:, j], "axis_x"), fig.line("north", AXIS, r.map[i], "axis_y"),
                     y_range=(0.0, CUT + 0.5))


def _by_angle(p: "Params", r: Ground) -> "go.Figure":
    """DOP of two stations depends on the angle between the lines of sight only."""
    theta = np.linspace(3.0, 177.0, 117)
    traces = [fig.line("rule", theta, np.minimum(np.sqrt(2.0) / np.sin(np.radians(theta)), CUT), "reference")]
    if (angle := _angle(p, r)) is not None:
        traces.append(fig.markers("here", [angle], [min(float(r.dop.gdop), CUT)], "posterior", size=12))
    return fig.chart(*traces, marks=[90.0], x_range=(0.0, 180.0), y_range=(0.0, CUT + 0.5))


def _errors(p: "Params", r: Ground, x: Array) -> "go.Figure":
    """Histogram of the north error against its normal law."""
    sigma = 1.0 if r.V is None else max(float(np.sqrt(r.V[1, 1])), 1e-9)
    edges = np.linspace(-4.0, 4.0, 33) * sigma
    counts, _ = np.histogram(x[:, 1] - p.user[1], edges)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), float(edges[1] - edges[0])
    traces = [fig.bars("sampled", middle, counts / max(len(x), 1) / width, "monte_carlo")]
    if r.V is not None:
        z = np.linspace(-4.0, 4.0, 121)
        traces.append(fig.line("promised", z * sigma, np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi) / sigma, "posterior"))
    return fig.chart(*traces)


def _noise(p: "Params", r: Ground) -> "go.Figure":
    """At which noise the linearisation stops to be true."""
    good = np.isfinite(r.growth[:, 0])
    ratio = np.minimum(r.growth[good, 0], GROWTH_TOP)
    ends, top = SIGMAS_M[[0, -1]], max(1.5, 1.1 * float(ratio.max(initial=1.0)))
    return fig.chart(
        fig.line("claim", ends, np.ones(2), "reference", dash=True),
        fig.line("ratio", SIGMAS_M[good], ratio, "measurement", markers=True),
        fig.line("missing", SIGMAS_M, r.growth[:, 1], "warning", markers=True),
        cursor=p.sigma_m, log_x=True, x_range=(0.45, 56.0), y_range=(-0.05, top))


def _weights(p: "Params", r: Ground) -> "go.Figure":
    """The rms error when one weight is another and the rest stays."""
    least, now = rms(r.best), rms(r.V)
    if not np.isfinite(now):
        return fig.chart(fig.line("least", [], [], "likelihood"), log_x=True)
    return fig.chart(
        fig.line("least", WEIGHTS[[0, -1]], np.full(2, least), "likelihood", dash=True),
        fig.line("second", WEIGHTS, r.traces[0], "sigma"), fig.line("third", WEIGHTS, r.traces[1], "innovation"),
        fig.markers("now", [p.weight_2, p.weight_3], [now, now], "posterior", size=11),
        log_x=True, marks=[p.ratio_2**-2.0, p.ratio_3**-2.0], x_range=(WEIGHTS[0], WEIGHTS[-1]),
        y_range=(0.9 * least, max(1.5 * least, 1.1 * now)))


def readouts(p: "Params", r: Ground, n: int, x: Array, share: float | None) -> list[Readout]:
    """What the geometry promises, and what came."""
    dop, now = float(r.dop.gdop), rms(r.V)
    shown = [Readout("dop", dop if dop < HUGE else None)]
    if p.mode == "surface":
        return [*shown, Readout("lowest", r.lowest if r.lowest < HUGE else None), Readout("angle", _angle(p, r), "°")]
    if p.mode == "map":
        shown += [Readout("lowest", r.lowest if r.lowest < HUGE else None), Readout("angle", _angle(p, r), "°")]
    off = x - np.array(p.user)
    known = len(x) > 2
    shown += [
        Readout("promised", now if now < HUGE else None, "m"),
        Readout("rms", float(np.sqrt(np.square(off).sum(axis=1).mean())) if known else None, "m"),
        Readout("bias", float(np.linalg.norm(off.mean(axis=0))) if known else None, "m", 3),
        Readout("inside", None if share is None else 100.0 * share, "%", 3),
        Readout("missing", f"{n - len(x)} of {n:,}"),
    ]
    if p.third and p.mode == "cloud":
        least = rms(r.best)
        shown += [Readout("trace", now**2 if now < HUGE else None, "m²"),
                  Readout("least", least**2 if least < HUGE else None, "m²")]
    return shown


def _angle(p: "Params", r: Ground) -> float | None:
    """Between the lines of sight to the first two stations."""
    a, b = r.J[:2]
    if not (a.any() and b.any()):
        return None
    return float(np.degrees(np.arctan2(abs(a[0] * b[1] - a[1] * b[0]), a @ b)))


def equations(p: "Params", r: Ground, x: Array) -> list[Equation]:
    """J, DOP and the covariances with the numbers of this geometry."""
    def known(value: Array | None) -> tuple[Piece, ...]:
        return () if value is None else ("=", value)

    dop = float(r.dop.gdop)
    lines = [
        Equation("ranges", (r"J_i = (\mathbf{x} - \mathbf{s}_i)^T / \|\mathbf{x} - \mathbf{s}_i\|,\quad J =", r.J)),
        Equation("dop", (r"\mathrm{DOP} = \sqrt{\mathrm{tr}\,(J^TJ)^{-1}}", *(("=", dop) if dop < HUGE else ()))),
    ]
    if not p.third:
        lines.append(Equation("angle", (r"\mathrm{DOP} = \sqrt{2}\,/\,|\sin\theta|",)))
    if p.mode == "surface":
        return lines
    weighted = p.third and not np.allclose(r.W, r.W[0])
    unequal = not np.allclose(r.sigma, r.sigma[0])
    if p.third and (weighted or unequal):
        rule = r"V(\mathbf{u}) = (J^TWJ)^{-1}J^TW\Sigma WJ(J^TWJ)^{-1}"
        lines += [Equation("weight", (r"W = \mathrm{diag}\,", r.W)),
                  Equation("noise", (r"\Sigma = \mathrm{diag}\,", r.sigma**2))]
    else:
        rule = r"V(\mathbf{u}) = (J^TJ)^{-1}J^T\Sigma J(J^TJ)^{-1}" if unequal else (
            r"V(\mathbf{u}) = \sigma^2(J^TJ)^{-1}")
    lines.append(Equation("cov", (rule, *known(r.V))))
    if p.third:
        lines.append(Equation("best", (r"(J^T\Sigma^{-1}J)^{-1}", *known(r.best))))
    sampled = np.cov(x.T) if len(x) > 2 else None
    return [*lines, Equation("sampled", (r"\frac{1}{n-1}\sum(\hat{\mathbf{x}}_i - \bar{\mathbf{x}})"
                                         r"(\hat{\mathbf{x}}_i - \bar{\mathbf{x}})^T", *known(sampled)), current=True)]
