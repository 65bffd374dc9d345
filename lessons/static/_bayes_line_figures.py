"""Plots, numbers and formulas of Bayes' rule for one number."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import product
from core.types import Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static._bayes_line import Line, Step
    from lessons.static.bayes import Params

PRIOR, LIKELIHOOD, POSTERIOR, ESTIMATE = range(4)
PARABOLA = 121


def figures(p: "Params", r: "Line", k: int) -> dict[str, "go.Figure"]:
    """The mean square error over the estimate, the way of mean and spread, and what a wide or a sign prior does."""
    found = {"mse": _mse(p, r, k), "sequence": _sequence(r, k)}
    if r.wide is not None:
        from lessons.static._bayes_line import SPREADS_M

        spread = r.wide.spread_m
        for i, (name, limit) in enumerate((("wide_mean", p.y1), ("wide_sd", p.sigma_m))):
            found[name] = fig.chart(
                fig.line("limit", SPREADS_M[[0, -1]], [limit, limit], "likelihood", dash=True),
                fig.line("uniform", SPREADS_M, r.wide.uniform[i], "posterior"),
                fig.line("normal", SPREADS_M, r.wide.normal[i], "kf", dash=True), cursor=spread, log_x=True)
        return found
    y = np.linspace(-1.0, 1.0, 81)
    now = r.steps[max(k, 1)].y or 0.0
    found["model"] = fig.chart(fig.line("positive", y, 0.5 * (1.0 + y), "likelihood"),
                               fig.line("negative", y, 0.5 * (1.0 - y), "measurement"), cursor=now)
    found["variance"] = fig.chart(fig.line("prior", y[[0, -1]], [1.0 / 3.0, 1.0 / 3.0], "prior", dash=True),
                                  fig.line("variance", y, 1.0 / 3.0 - 0.25 * y**2, "posterior"), cursor=p.s1)
    return found


def _mse(p: "Params", r: "Line", k: int) -> "go.Figure":
    """E (x - z)^2 = V + (E x - z)^2: a parabola for every posterior."""
    step = r.steps[k]
    if step.posterior is None:
        return fig.chart(fig.line("mse", [], [], "posterior"))
    mine = p.estimate if p.problem == "sign" else p.estimate_m
    reach = max(2.5 * np.sqrt(step.var), 1.2 * abs(mine - step.mean))
    z = np.linspace(step.mean - reach, step.mean + reach, PARABOLA)

    def cost(at: float) -> float:
        return step.var + (at - step.mean) ** 2

    traces = [fig.line("mse", z, step.var + np.square(z - step.mean), "posterior"),
              fig.markers("mean", [step.mean], [step.var], "innovation", size=12),
              fig.markers("mine", [mine], [cost(mine)], "handle", size=12)]
    if p.problem == "line":
        traces.insert(2, fig.markers("mode", [step.mode], [cost(step.mode)], "sigma", size=12))
    return fig.chart(*traces)


def _sequence(r: "Line", k: int) -> "go.Figure":
    steps = [(i, s) for i, s in enumerate(r.steps) if s.posterior is not None]
    n = np.array([i for i, _ in steps], dtype=float)
    mean, sd = np.array([s.mean for _, s in steps]), np.sqrt([s.var for _, s in steps])
    y = [(i, s.y) for i, s in enumerate(r.steps) if s.y is not None]
    return fig.chart(fig.band("band", n, mean - sd, mean + sd, "posterior"),
                     fig.line("mean", n, mean, "innovation", markers=True),
                     fig.markers("y", [i for i, _ in y], [v for _, v in y], "measurement", size=9), cursor=k,
                     x_range=(-0.15, 3.15))


def readouts(p: "Params", r: "Line", k: int) -> list[Readout]:
    """What the posterior says, and what the two usual estimates and the user's own cost."""
    step = r.steps[k]
    unit, square = ("", "") if p.problem == "sign" else ("m", "m²")
    known = step.posterior is not None
    mine = p.estimate if p.problem == "sign" else p.estimate_m
    found = [Readout("mean", step.mean if known else None, unit, 5),
             Readout("sd", float(np.sqrt(step.var)) if known else None, unit),
             Readout("var", step.var if known else None, square, 5)]
    if p.problem == "line":
        found += [Readout("mode", step.mode if known else None, unit),
                  Readout("mse_mode", step.var + (step.mode - step.mean) ** 2 if known else None, square)]
    else:
        positive = float(step.posterior.weights[r.axis >= 0.0].sum()) if step.posterior else None
        found.append(Readout("positive", positive))
    return [*found, Readout("mse_mine", step.var + (mine - step.mean) ** 2 if known else None, square),
            Readout("evidence", step.evidence if k else None, "" if p.problem == "sign" else "1/m")]


def equations(p: "Params", step: "Step", k: int, stage: int) -> list[Equation]:
    """(2.7) term by term, and the closed form where there is one."""
    evidence: tuple[Piece, ...] = (step.evidence,) if step.evidence is not None else ()
    y: tuple[Piece, ...] = (r",\quad y =", step.y) if step.y is not None else ()
    known = step.posterior is not None
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("prior", PRIOR, _prior_rule(p, k), _prior_numbers(p, k)),
        ("likelihood", LIKELIHOOD, r"p(y \mid x) = \frac{1}{2}(1 \pm y)" if p.problem == "sign" else
         r"p(y \mid x) = \frac{1}{\sqrt{2\pi}\,\sigma}\exp\left(-\frac{(x - y)^2}{2\sigma^2}\right)", y),
        ("evidence", POSTERIOR, r"\int p(x)\,p(y \mid x)\,dx =", evidence),
        ("posterior", POSTERIOR, r"p(x \mid y) = \frac{p(x)\,p(y \mid x)}{\int p(x)\,p(y \mid x)\,dx}", ()),
    ]
    if p.problem == "line" and p.prior == "uniform" and k == 1 and known:
        factor = 1.0 / (p.length_m * (step.evidence or 1.0) * np.sqrt(2.0 * np.pi) * p.sigma_m)
        lines[-1] = ("posterior", POSTERIOR,
                     r"p(x \mid y) = c\,\exp\left(-\frac{(x - y)^2}{2\sigma^2}\right),\quad c =", (float(factor),))
    if p.problem == "line" and p.prior == "normal" and k == 1:
        law = product(Gaussian(np.array([p.mean_m]), np.array([[p.prior_sigma_m**2]])),
                      Gaussian(np.array([p.y1]), np.array([[p.sigma_m**2]]))).gaussian
        lines += [("normal_mean", POSTERIOR, r"\frac{\sigma^2\mu + \sigma_0^2y}{\sigma^2 + \sigma_0^2} =",
                   (float(law.mean[0]),)),
                  ("normal_var", POSTERIOR, r"\frac{\sigma^2\sigma_0^2}{\sigma^2 + \sigma_0^2} =",
                   (float(law.cov[0, 0]),))]
    mine = p.estimate if p.problem == "sign" else p.estimate_m
    lines += [
        ("mean", ESTIMATE, r"\mathrm{E}(x \mid y) = \int x\,p(x \mid y)\,dx =", (step.mean,) if known else ()),
        ("var", ESTIMATE, r"V(x \mid y) = \int (x - \mathrm{E}(x \mid y))^2\,p(x \mid y)\,dx =",
         (step.var,) if known else ()),
        ("mse", ESTIMATE, r"\mathrm{MSE}(\hat{x}) = V(x \mid y) + (\hat{x} - \mathrm{E}(x \mid y))^2 =",
         (step.var + (mine - step.mean) ** 2,) if known else ()),
    ]
    if not k:
        lines = lines[:1]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]


def _prior_rule(p: "Params", k: int) -> str:
    if k > 1:
        return r"p(x) = p(x \mid y_1" + (r", y_2)" if k == 3 else ")")
    if p.problem == "sign":
        return r"p(x) = \frac{1}{2},\quad -1 \leq x \leq 1"
    return {"uniform": r"p(x) = \frac{1}{L},\quad 0 \leq x \leq L =",
            "rough": r"p(x) \propto N(x;\,\mu,\,\sigma_0^2),\quad 0 \leq x \leq L =",
            "normal": r"p(x) = N(x;\,\mu,\,\sigma_0^2),\quad \mu =",
            "flat": r"p(x) \propto 1"}[p.prior]


def _prior_numbers(p: "Params", k: int) -> tuple[Piece, ...]:
    if k > 1 or p.problem == "sign":
        return ()
    return {"uniform": (p.length_m, r"\mathrm{m}"), "rough": (p.length_m, r"\mathrm{m}"),
            "normal": (p.mean_m, r"\mathrm{m},\quad \sigma_0 =", p.prior_sigma_m, r"\mathrm{m}"), "flat": ()}[p.prior]
