"""Plots, numbers and formulas of the lesson on independence."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import log_density, marginal
from core.types import Gaussian
from lessons.background._independence_model import coefficient, facts, law_of, probe_of, remainder, total_variation
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.independence import Params, Result

POINTS = 241
JOINT, MARGINALS, SLICE, DIFFERENCE = range(4)


def figures(p: "Params", r: "Result", at: Moment) -> dict[str, "go.Figure"]:
    """The conditional law over all slices, the product along one slice, and the law turned over its range."""
    if p.picture == "directions":
        return {"by_angle": _by_angle(r), "compared": _compared(r)}
    law, (x, c) = law_of(p, at.step), probe_of(p)
    ends = np.linspace(-1.0, 1.0, 121) * 0.9999 * law.reach[1]
    mean, sd = law.given(ends)
    t = np.linspace(-law.half, law.half, POINTS)
    joint = law.density(np.column_stack([t, np.full(POINTS, c)]))
    product = law.marginal(0, t) * float(law.marginal(1, c))
    found = {
        "given": fig.chart(fig.band("band", ends, mean - sd, mean + sd, "posterior"),
                           fig.line("mean", ends, mean, "vector"), cursor=float(c)),
        "product": fig.chart(fig.line("product", t, product, "prior", width=3.5),
                             fig.line("joint", t, joint, "posterior"), cursor=float(x)),
    }
    if r.sweep is not None:
        now = {"square": p.turn_deg, "normal": p.correlation}.get(p.picture, coefficient(p, at.step))
        if p.picture == "remainder":
            sd_z = r.sweep.second / float(np.sqrt(r.P[0, 0]))
            found["by_k"] = fig.chart(fig.line("correlation", r.sweep.at, r.sweep.correlation, "vector"),
                                      fig.line("spread", r.sweep.at, sd_z, "prior"), cursor=now, marks=[r.K])
        else:
            name = "by_turn" if p.picture == "square" else "by_correlation"
            found[name] = fig.chart(fig.line("correlation", r.sweep.at, np.round(r.sweep.correlation, 6), "vector"),
                                    fig.line("apart", r.sweep.at, r.sweep.second, "warning"), cursor=now)
    return found


def _by_angle(r: "Result") -> "go.Figure":
    """The correlation for every direction of B, with the one shown and the one that is independent."""
    assert r.sweep is not None
    now = float(np.degrees(np.arctan2(r.b[1], r.b[0])) % 180.0)
    seen = r.P @ r.a
    free = float(np.degrees(np.arctan2(seen[0], -seen[1])) % 180.0)
    return fig.chart(fig.line("correlation", r.sweep.at, r.sweep.correlation, "vector"), cursor=now, marks=[free],
                     y_range=(-1.05, 1.05))


def _compared(r: "Result") -> "go.Figure":
    """The law of Ax alone, and given that Bx lies 1.2 standard deviations above its mean."""
    image = Gaussian(np.zeros(2), np.array([r.a, r.b]) @ r.P @ np.array([r.a, r.b]).T)
    sd_a, sd_b = np.sqrt(np.diagonal(image.cov))
    slope = image.cov[0, 1] / image.cov[1, 1]
    left = max(image.cov[0, 0] - slope * image.cov[0, 1], 1e-3 * image.cov[0, 0])
    t = np.linspace(-3.5 * sd_a, 3.5 * sd_a, POINTS)
    alone = np.exp(log_density(marginal(image, [0]), t[:, None]))
    given = np.exp(log_density(Gaussian(np.array([slope * 1.2 * sd_b]), np.array([[left]])), t[:, None]))
    return fig.chart(fig.line("alone", t, alone, "prior", width=3.5), fig.line("given", t, given, "posterior"))


def readouts(p: "Params", r: "Result", at: Moment) -> list[Readout]:
    """How correlated, and how dependent."""
    if p.picture == "directions":
        cross = float(r.a @ r.P @ r.b)
        sd = np.sqrt([r.a @ r.P @ r.a, r.b @ r.P @ r.b])
        images = r.cloud @ np.array([r.a, r.b]).T
        return [Readout("cross", round(cross, 9), "m²"), Readout("correlation", round(cross / float(sd.prod()), 9)),
                Readout("sampled", float(np.corrcoef(images.T)[0, 1]), digits=3),
                Readout("angle", float(np.degrees(np.arccos(np.clip(r.a @ r.b, -1.0, 1.0)))), "°"),
                Readout("sd_a", float(sd[0]), "m"), Readout("sd_b", float(sd[1]), "m")]
    law, (x, c), k = law_of(p, at.step), probe_of(p), coefficient(p, at.step)
    known = facts(law) if p.picture == "remainder" else r.facts
    cloud = r.cloud @ np.array([[1.0, 0.0], [-k, 1.0]])
    unit = "" if p.picture in ("disc", "square") else "m"
    found = [Readout("correlation", round(known.correlation, 5)),
             Readout("sampled", float(np.corrcoef(cloud.T)[0, 1]), digits=3),
             Readout("squares", round(known.squares, 5)),
             Readout("apart", round(total_variation(law), 9), digits=3)]
    if p.picture == "remainder":
        found += [Readout("var_z", known.sd**2, "m²"), Readout("K", r.K, "m/m")]
    per = "1/m²" if unit else ""
    return [*found,
            Readout("sd_given", float(law.given(np.array(c))[1]), unit),
            Readout("joint_here", float(law.density(np.array([x, c]))), per),
            Readout("product_here", float(law.marginal(0, x) * law.marginal(1, c)), per)]


def equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """The definitions with the numbers at the probe, or those of Theorem 5."""
    if p.picture == "directions":
        cross = float(r.a @ r.P @ r.b)
        lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
            ("joint", 0, r"\Sigma =", (r.P,)),
            ("a", MARGINALS, r"A =", (r.a[None], r",\quad B =", r.b[None])),
            ("cross", MARGINALS, r"\mathrm{cov}(A\mathbf{x}, B\mathbf{x}) = A\Sigma B^T =", (round(cross, 9),)),
            ("conjugate", SLICE, r"\Sigma B^T =", (r.P @ r.b,)),
        ]
    else:
        law, (x, c), k = law_of(p, at.step), probe_of(p), coefficient(p, at.step)
        f, f1, f2 = (float(v) for v in (law.density(np.array([x, c])), law.marginal(0, x), law.marginal(1, c)))
        lines = [
            ("joint", JOINT, r"f(x_1, x_2) =", (f,)),
            ("marginal_1", MARGINALS, r"f_1(x_1) = \int f(x_1, x_2)\,dx_2 =", (f1,)),
            ("marginal_2", MARGINALS, r"f_2(x_2) = \int f(x_1, x_2)\,dx_1 =", (f2,)),
            ("slice", SLICE, r"f(x_1 \mid x_2) = \frac{f(x_1, x_2)}{f_2(x_2)} =", (f / f2,) if f2 > 0.0 else ()),
            ("difference", DIFFERENCE, r"f - f_1 f_2 =", (round(f - f1 * f2, 12),)),
        ]
        if p.picture == "remainder":
            P = remainder(r.P, k).cov
            lines = [("k", JOINT, r"\mathbf{z} = \mathbf{x} - k\,\mathbf{y},\quad k =", (k,)),
                     ("best", JOINT, r"\Sigma_{xy}\Sigma_{yy}^{-1} =", (r.K,)),
                     ("cov", JOINT, r"\mathrm{cov}(\mathbf{z}, \mathbf{y}) = \Sigma_{xy} - k\,\Sigma_{yy} =",
                      (round(float(P[0, 1]), 9),)),
                     ("var", JOINT, r"V(\mathbf{z}) = \Sigma_{xx} - 2k\,\Sigma_{xy} + k^2\,\Sigma_{yy} =",
                      (float(P[0, 0]),)), *lines]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


