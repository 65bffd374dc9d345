"""Plots, numbers and formulas of the lesson on the chi-square distribution."""

from typing import TYPE_CHECKING

import numpy as np

from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Readout
from lessons.kit.roles import Role

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.chi_square import Params, Result

COLOURS: tuple[Role, ...] = ("prior", "likelihood", "linearised", "sigma")
LAMBDAS = np.array([0.0, 25.0])
DRAW, SQUARE, LAW = range(3)


def figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """The densities of Fig 1.3, the distribution function against the sample's, mean and variance over lambda."""
    from lessons.background.chi_square import FAMILY

    some = slice(None, None, 2)
    highest = 1.1 * max(0.3, float(r.family[1:].max()))
    gallery = [fig.line(f"n{n}", r.t[some], np.minimum(f[some], 2.0 * highest), role, width=2.0)
               for n, f, role in zip(FAMILY, r.family, COLOURS, strict=True)]
    gallery.append(fig.line("this", r.t[some], np.minimum(r.density[some], 2.0 * highest), "posterior", width=4.0))
    z = np.sort(r.z[:k])
    share = np.arange(1, k + 1) / max(k, 1)
    thin = slice(None, None, max(1, k // 300))
    distribution = [fig.line("law", r.t[some], r.probability[some], "posterior", width=3.5)]
    if k:
        distribution.append(fig.line("sample", z[thin], share[thin], "monte_carlo"))
    lambdas = np.array([0.0, max(25.0, 1.1 * r.lam)])
    moments = [fig.line("mean", lambdas, r.df + lambdas, "vector"),
               fig.line("variance", lambdas, 2.0 * (r.df + 2.0 * lambdas), "reference")]
    if k > 1:
        moments.append(fig.markers("sampled", [r.lam, r.lam], [r.z[:k].mean(), r.z[:k].var()], "monte_carlo", size=11))
    return {
        "gallery": fig.chart(*gallery, marks=[r.level], y_range=(0.0, highest)),
        "distribution": fig.chart(*distribution, marks=[r.level], y_range=(0.0, 1.02)),
        "moments": fig.chart(*moments, cursor=r.lam),
    }


def readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    """The law's numbers and the sample's."""
    z = r.z[:k]
    inside = 100.0 * float((z <= r.level).mean()) if k else None
    return [
        Readout("df", float(r.df), digits=3), Readout("lam", round(r.lam, 9), digits=5),
        Readout("mean", r.df + r.lam, digits=5), Readout("sampled_mean", float(z.mean()) if k else None),
        Readout("sd", float(np.sqrt(2.0 * (r.df + 2.0 * r.lam)))),
        Readout("sampled_sd", float(z.std()) if k else None),
        Readout("level", r.level, digits=5), Readout("inside", inside, "%", 3),
    ]


def equations(p: "Params", r: "Result", k: int, stage: int) -> list[Equation]:
    """The last sample, its square, and the law with its numbers."""
    norm = p.picture == "norm"
    rule = r"\mathbf{x}^T\mathbf{x}" if norm else r"\mathbf{x}^TA\mathbf{x}"
    last: tuple[Piece, ...] = ("=", r.x[k - 1]) if k else ()
    value: tuple[Piece, ...] = ("=", float(r.z[k - 1])) if k else ()
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [("x", DRAW, r"\mathbf{x}", last)]
    if not norm:
        AS = r.A @ np.asarray(r.law.cov)
        lines += [("A", DRAW, "A =", (r.A, r",\quad A\Sigma =", AS)),
                  ("idempotent", DRAW, r"(A\Sigma)^2 =", (AS @ AS,))]
    lambda_rule = r"\lambda = \mu^T\mu =" if norm else r"\lambda = \mu^TA\mu ="
    lines += [
        ("z", SQUARE, "z = " + rule, value),
        ("df", LAW, "n =" if norm else r"\mathrm{rank}\,A = \mathrm{tr}(A\Sigma) =",
         (float(r.df) if r.is_chi_square else float(np.trace(r.A @ r.law.cov)),)),
        ("lam", LAW, lambda_rule, (round(r.lam, 9),)),
        ("mean", LAW, r"\mathrm{E}(z) = n + \lambda =", (r.df + r.lam,)),
        ("variance", LAW, r"V(z) = 2(n + 2\lambda) =", (2.0 * (r.df + 2.0 * r.lam),)),
        ("level", LAW, r"P(z \leq c) =", (p.percent / 100.0, r"\;\Rightarrow\; c =", r.level)),
    ]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]
