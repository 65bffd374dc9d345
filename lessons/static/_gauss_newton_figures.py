"""Plots, readouts and formulas of the Gauss-Newton lesson."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as plot
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout
from lessons.static._gauss_newton_model import LIMIT, residual_norms

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.gauss_newton import Params, Result

LINEARISE, SOLVE, STEP, TEST = range(4)
ALONG = np.linspace(-1.0, 2.5, 141)          # steps
LEAST = 1e-12                                # less is drawn there, on logarithmic axes


def figures(p: "Params", r: "Result", at: Moment) -> dict[str, "go.Figure"]:
    """How the steps shrink, a cut along the step, and how many steps the starts of the map need."""
    found = {"starts": _starts(r)}
    if r.fix is None:
        return found
    return {"shrink": _shrink(p, r, at.step), "cut": _cut(p, r, at.step), **found}


def _shrink(p: "Params", r: "Result", k: int) -> "go.Figure":
    """The lengths of the steps and the residual norms, over the number of the iteration."""
    lengths = np.clip(np.linalg.norm(r.fix.steps, axis=1), LEAST, 1e12)
    norms = np.clip(r.fix.residual_norms, LEAST, 1e12)
    n = np.arange(len(norms))
    return plot.chart(
        plot.line("tolerance", n[[0, -1]], np.full(2, p.tolerance_m), "reference", dash=True),
        plot.line("norm", n, norms, "prior", markers=True),
        plot.line("step", n[:-1], lengths, "vector", markers=True), cursor=k, log_y=True)


def _cut(p: "Params", r: "Result", k: int) -> "go.Figure":
    """The residual norm and its linear model along the step: at 0 the iterate, at 1 the next one."""
    x, dx, J, residual = r.fix.iterates[k], r.fix.steps[k], r.fix.jacobians[k], r.fix.residuals[k]
    gone = residual + ALONG[:, None] * (J @ dx)
    if p.weighted:
        gone = gone / np.sqrt(np.diagonal(r.sensor.R))
    return plot.chart(plot.line("exact", ALONG, residual_norms(p, x + ALONG[:, None] * dx), "prior"),
                      plot.line("model", ALONG, np.linalg.norm(gone, axis=-1), "linearised", dash=True),
                      marks=(0.0, 1.0))


def _starts(r: "Result") -> "go.Figure":
    """Shares of the starts in the map by number of steps."""
    from lessons.static._gauss_newton_view import ENDS

    n = np.arange(1, 21)
    steps = np.minimum(r.starts.steps, n[-1])
    traces = [plot.bars("abc"[i], n + 0.25 * (i - 0.5), _percent(steps[r.where == i], n, steps.size), ENDS[i],
                        width=0.24) for i in range(len(r.ends))]
    cursor = None if r.fix is None else min(len(r.fix.steps), int(n[-1]))
    lost = 100.0 * float((r.where < 0).mean())
    traces.append(plot.bars("lost", np.array([n[-1] + 3.0]), np.array([lost]), "warning", width=0.8))
    figure = plot.chart(*traces, cursor=cursor, x_range=(0.0, n[-1] + 4.0))
    figure.layout.xaxis.update(tickvals=[1, 5, 10, 15, 20, 23], ticktext=["1", "5", "10", "15", "20+", "never"],
                               tickangle=0)
    return figure


def _percent(steps: Array, n: Array, total: int) -> Array:
    return 100.0 * np.array([(steps == k).sum() for k in n]) / total


def _pair(x: Array) -> str:
    return f"({x[0]:.3f}, {x[1]:.3f})".replace("-", "−") if np.abs(x).max() < 1e6 else "far away"


def readouts(p: "Params", r: "Result", at: Moment) -> list[Readout]:
    """This iteration, the whole run, and the other starts."""
    shares = [100.0 * float((r.where == i).mean()) for i in range(len(r.ends))]
    lost = 100.0 * float((r.where < 0).mean())
    starts = Readout("starts", ", ".join([*(f"{'ABC'[i]} {s:.1f}" for i, s in enumerate(shares)),
                                          f"none {lost:.1f}"]), "%")
    if r.fix is None:
        return [starts]
    k = at.step
    shown = k + (at.stage >= STEP)
    sound = r.fix.converged and np.isfinite(r.fix.cov).all()
    return [
        Readout("x", _pair(r.fix.iterates[shown]), "m"),
        Readout("norm", float(min(r.fix.residual_norms[shown], 1e12)), "m"),
        Readout("length", float(min(np.linalg.norm(r.fix.steps[k]), 1e12)) if at.stage >= SOLVE else None, "m", 3),
        Readout("needed", str(len(r.fix.steps)) if r.fix.converged else f"more than {LIMIT}"),
        Readout("end", _pair(r.fix.x) if r.fix.converged else None, "m"),
        Readout("rms", float(np.sqrt(np.trace(r.fix.cov))) if sound else None, "m", 3),
        starts,
    ]


def equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """Algorithm 1 or 2 with the numbers of iteration k; damped if so chosen."""
    k, stage = at.step, at.stage
    if r.fix is None:
        return []
    x, J, residual, dx = r.fix.iterates[k], r.fix.jacobians[k], r.fix.residuals[k], r.fix.steps[k]
    inverse_root = 1.0 / np.sqrt(np.diagonal(r.sensor.R))
    W = r"\Sigma^{-1}" if p.weighted else ""
    step: tuple[str, str] = (rf"\Delta\mathbf{{x}}_k = -(J_k^T{W}J_k)^{{-1}}J_k^T{W}\mathbf{{p}}", "=")
    lines: list[tuple[str, int, tuple[Piece, ...], tuple[Piece, ...]]] = [
        ("x", LINEARISE, (r"\mathbf{x}_k",), ("=", x)),
        ("h", LINEARISE, (r"h(\mathbf{x}_k)",), ("=", r.sensor.h(x))),
        ("residual", LINEARISE, (r"\mathbf{p} = h(\mathbf{x}_k) - \mathbf{y}",), ("=", residual)),
        ("jacobian", LINEARISE, (r"J_k = h'(\mathbf{x}_k)",), ("=", J)),
    ]
    if p.weighted:
        lines.append(("white", SOLVE, (r"\Sigma^{-1/2}J_k",),
                      ("=", inverse_root[:, None] * J, r",\ \Sigma^{-1/2}\mathbf{p} =", inverse_root * residual)))
    if p.damped:
        lines.append(("damping", SOLVE, (rf"N = J_k^T{W}J_k,\quad \mu_k",), ("=", float(r.fix.dampings[k]))))
        step = (rf"(N + \mu_k\,\mathrm{{diag}}\,N)\,\Delta\mathbf{{x}}_k = -J_k^T{W}\mathbf{{p}}",
                r",\quad \Delta\mathbf{x}_k =")
    lines += [
        ("step", SOLVE, step[:1], (step[1], dx)),
        ("next", STEP, (r"\mathbf{x}_{k+1} = \mathbf{x}_k + \Delta\mathbf{x}_k",), ("=", r.fix.iterates[k + 1])),
        ("test", TEST, (r"\|\Delta\mathbf{x}_k\|",),
         ("=", float(np.linalg.norm(dx)), r"\ \mathrm{m},\quad \delta =", p.tolerance_m, r"\ \mathrm{m}")),
    ]
    if k == len(r.fix.steps) - 1 and r.fix.converged and np.isfinite(r.fix.cov).all():
        law = (r"(J^T\Sigma^{-1}J)^{-1}" if p.weighted else r"(J^TJ)^{-1}J^T\Sigma J(J^TJ)^{-1}")
        lines.append(("cov", TEST, (rf"V(\mathbf{{u}}) = {law}",), ("=", r.fix.cov)))
    return [Equation(name, (*formula, *numbers) if when <= stage else formula, current=when == stage)
            for name, when, formula, numbers in lines]
