"""Plots, readouts and formulas of the lesson of the unscented transform."""

from typing import TYPE_CHECKING

import numpy as np

from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    from lessons.filtering.unscented import Params, Result

BEST = 1.0               # kappa = 3 - n for n = 2
KAPPAS = np.round(np.arange(-1.9, 8.01, 0.1), 1)
DEGREES = np.arange(1, 7)
SMALLEST_SHARE = 1e-6    # errors below this share of the spread are drawn there: an exact result has no logarithm


def figures(p: "Params", r: "Result") -> dict:
    """Errors against kappa, errors by degree, weights against kappa."""
    spread_m = float(np.sqrt(np.trace(r.truth.cov)))
    shown = {"cursor": p.kappa, "marks": (BEST,), "x_range": (-2.0, 8.0)}
    ends = KAPPAS[[0, -1]]

    def error(i: int, floor: float) -> object:
        constant = [np.full(2, max(e[i], floor)) for e in (r.linear_errors, r.sampled_errors)]
        return plot.chart(
            plot.line("ut", KAPPAS, np.maximum(r.sweep[:, i], floor), "ukf"),
            plot.line("linear", ends, constant[0], "linearised"),
            plot.line("sampled", ends, constant[1], "monte_carlo", dash=True), log_y=True, **shown)

    return {
        "mean_error": error(0, SMALLEST_SHARE * spread_m),
        "cov_error": error(1, 100.0 * SMALLEST_SHARE),
        "degrees": plot.chart(
            plot.bars("here", DEGREES, r.degree_errors[0], "ukf"),
            plot.bars("best", DEGREES, r.degree_errors[1], "sigma"),
            plot.bars("linear", DEGREES, r.degree_errors[2], "linearised"), categories=True),
        "weights": plot.chart(
            plot.line("centre", KAPPAS, KAPPAS / (2.0 + KAPPAS), "sigma"),
            plot.line("others", KAPPAS, 0.5 / (2.0 + KAPPAS), "reference"), y_range=(-4.0, 2.0), **shown),
    }


def readouts(p: "Params", r: "Result") -> list[Readout]:
    """How far the mean and the covariance are off (to a nanometre), and whether the covariance is one."""
    return [
        Readout("ut_mean_error", round(r.ut_errors.mean_m, 9), "m", 3),
        Readout("linear_mean_error", round(r.linear_errors.mean_m, 9), "m", 3),
        Readout("sampled_mean_error", round(r.sampled_errors.mean_m, 9), "m", 3),
        Readout("ut_cov_error", r.ut_errors.cov_percent, "%", 3),
        Readout("linear_cov_error", r.linear_errors.cov_percent, "%", 3),
        Readout("spread", float(np.sqrt(2.0 + p.kappa))),
        Readout("smallest_variance", float(np.linalg.eigvalsh(r.ut_cov)[0]), "m²"),
    ]


def equations(r: "Result", kappa: float, stage: int) -> list[Equation]:
    """The lines of (3.17) and (3.16), and of the linearisation, with their numbers."""
    lines = (
        (0, Equation("prior", (r"\hat{\mathbf{x}} =", r.prior.mean, r",\quad P =", r.prior.cov))),
        (1, Equation("root", (r"\sqrt{n+\kappa} =", float(np.sqrt(2.0 + kappa)), r",\quad \sqrt{P} =", r.L))),
        (1, Equation("points", (r"[\,\chi_0 \ldots \chi_4\,] =", r.ut.points.T))),
        (1, Equation("weights", (r"\omega_0 = \frac{\kappa}{\kappa+n} =", float(r.ut.weights[0]),
                                 r",\quad \omega_i = \frac{1}{2(\kappa+n)} =", float(r.ut.weights[1])))),
        (2, Equation("images", (r"[\,f(\chi_0) \ldots f(\chi_4)\,] =", r.ut.images.T))),
        (3, Equation("ut_mean", (r"\bar{\mathbf{y}} = \sum_i \omega_i f(\chi_i) =", r.ut.mean))),
        (3, Equation("ut_cov", (r"P_{yy} = \sum_i \omega_i (f(\chi_i) - \bar{\mathbf{y}})(f(\chi_i) - "
                                r"\bar{\mathbf{y}})^T =", r.ut_cov))),
        (3, Equation("linear", (r"f(\hat{\mathbf{x}}) =", r.linear.mean, r",\quad J P J^T =", r.linear.cov))),
        (3, Equation("truth", (r"\mathrm{E}\,\mathbf{y} =", r.truth.mean, r",\quad \mathrm{V}(\mathbf{y}) =",
                               r.truth.cov))),
    )
    return [Equation(e.name, e.pieces, current=at == stage) for at, e in lines if at <= stage]
