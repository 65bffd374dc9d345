"""Exercise 3.11: a law of two normal parts goes through y = F x + w, which is the prediction step of the filter."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core import gaussian, mixture
from core.mixture import Mixture
from core.motion import LinearMotion
from core.types import Array, Gaussian
from lessons.filtering._mixture_drawing import heat, outlines
from lessons.kit import figures as fig
from lessons.kit.equations import Equation
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Item, Label, LevelEllipse, Plane, Points, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.mixture import Params

COMPONENTS, MAP, BLUR, LAW = range(4)
CAPTIONS = ("x: two normal components", "F x: each is mapped", "y = F x + w: each is blurred by Q", "the law of y")
DRAWS = 500
ALONG = np.linspace(-1.0, 2.0, 241)      # of the line from F mu_1 (0) to F mu_2 (1)


class Blurred(NamedTuple):
    """The law of x, of F x, and of y = F x + w, and draws of all three."""

    x: Mixture
    image: Mixture
    y: Mixture
    law: Gaussian                # E(y), V(y)
    density: float               # p(y) at the probe
    belongs: Array               # (2,) probability that the probe comes from each part
    draws: Array                 # (3, DRAWS, 2) of x, F x, y


def solve(p: "Params") -> Blurred:
    """p(y) = alpha N(y; F mu_1, F Sigma F' + Q) + (1 - alpha) N(y; F mu_2, F Sigma F' + Q)."""
    F, Q = np.column_stack([p.f_1, p.f_2]), np.diag([p.q_1, p.q_2])
    x = mixture.mixture([p.alpha, 1.0 - p.alpha], [p.mu_1, p.mu_2], np.broadcast_to(p.sigma**2 * np.eye(2), (2, 2, 2)))
    image, y = (mixture.predict(x, LinearMotion(F, noise)) for noise in (np.zeros((2, 2)), Q))
    rng = np.random.default_rng(p.seed)
    first = rng.random((DRAWS, 1)) < p.alpha
    drawn = np.where(first, p.mu_1, p.mu_2) + p.sigma * rng.standard_normal((DRAWS, 2))
    noisy = gaussian.sample(Gaussian(np.zeros(2), Q), DRAWS, rng)
    probe = np.array(p.probe)
    return Blurred(x, image, y, mixture.moments(y), float(np.exp(mixture.log_density(y, probe))),
                   mixture.responsibilities(y, probe), np.stack([drawn, drawn @ F.T, drawn @ F.T + noisy]))


def view(p: "Params", r: Blurred, at: Moment) -> View:
    """Everything up to this step of the solution."""
    return View(scene=_scene(p, r, at.step), camera=_camera(r), figures=_figures(r), readouts=_readouts(r),
                equations=_equations(p, r, at.step), caption=CAPTIONS[at.step])


def _scene(p: "Params", r: Blurred, stage: int) -> list[Item]:
    items: list[Item] = [heat("density", r.y, "mixture", 0.9)] if stage == LAW else []
    items += [
        Points("draws", r.draws[min(stage, BLUR)], role="monte_carlo", size=4, fade=0.25),
        *outlines("x", r.x, "prior", faint=stage > COMPONENTS),
    ]
    if stage >= MAP:
        items += [Arrow("column_1", (0.0, 0.0), p.f_1, role="vector", width=3),
                  Arrow("column_2", (0.0, 0.0), p.f_2, role="vector", width=3),
                  Segments("moved", np.stack([r.x.means, r.image.means], axis=1), role="muted", width=2),
                  *outlines("image", r.image, "linearised", faint=stage > MAP)]
    if stage >= BLUR:
        items += [*outlines("y", r.y, "mixture"),
                  *(Label(f"share_{i + 1}", f"{100 * w:.0f} %", (m[0], m[1] + 1.7 * np.sqrt(P[1, 1])), 1.0, "bottom")
                    for i, (w, m, P) in enumerate(zip(r.y.weights, r.y.means, r.y.covs, strict=True)))]
    if stage == LAW:
        items += [LevelEllipse("law", r.law, role="posterior", width=3, dashed=True, cross=False),
                  Points("mean", r.law.mean[None], role="posterior", size=14, shape="square")]
    return items


def _camera(r: Blurred) -> Plane:
    """Both laws, in steps of two units so that the picture keeps still while a point is dragged a little."""
    means = np.vstack([r.x.means, r.y.means])
    reach = 2.0 * np.sqrt(np.array([np.diagonal(P) for P in (*r.x.covs, *r.y.covs)]))
    low, high = 2.0 * np.floor((means - reach).min(axis=0) / 2.0), 2.0 * np.ceil((means + reach).max(axis=0) / 2.0)
    low, high = np.minimum(low, (-2.0, -2.0)), np.maximum(high, (2.0, 4.0))
    return Plane((float(low[0]), float(high[0])), (float(low[1]), float(high[1])), "x₁ and y₁ (no unit)",
                 "x₂ and y₂ (no unit)")


def _readouts(r: Blurred) -> list[Readout]:
    sample = r.draws[BLUR]
    return [
        Readout("mean_1", float(r.law.mean[0])), Readout("mean_2", float(r.law.mean[1])),
        Readout("drawn_1", float(sample[:, 0].mean()), "", 3), Readout("drawn_2", float(sample[:, 1].mean()), "", 3),
        Readout("density", r.density), Readout("belongs", 100.0 * float(r.belongs[0]), "%", 3),
    ]


def _equations(p: "Params", r: Blurred, stage: int) -> list[Equation]:
    lines = [
        ("x_law", COMPONENTS, r"p(x) = \alpha N(x; \mu_1, \Sigma) + (1 - \alpha) N(x; \mu_2, \Sigma)",
         (r",\quad \alpha =", p.alpha)),
        ("image", MAP, r"F\mu_1,\; F\mu_2", ("=", r.image.means[0], ",", r.image.means[1])),
        ("image_cov", MAP, r"F\Sigma F^T", ("=", r.image.covs[0])),
        ("y_cov", BLUR, r"F\Sigma F^T + Q", ("=", r.y.covs[0])),
        ("y_mean", LAW, r"\mathrm{E}(y) = F(\alpha\mu_1 + (1 - \alpha)\mu_2)", ("=", r.law.mean)),
        ("y_total", LAW, r"\mathrm{V}(y)", ("=", r.law.cov)),
        ("y_density", LAW, r"p(y) = \sum_i \alpha_i N(y; F\mu_i, F\Sigma F^T + Q)",
         (r",\quad y =", np.array(p.probe), r",\quad p(y) =", r.density)),
    ]
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]


def _figures(r: Blurred) -> dict[str, "go.Figure"]:
    """The density along the line through both means, and to which part the probe belongs."""
    a, b = r.y.means
    d = b - a if np.linalg.norm(b - a) > 1e-6 else np.array([1.0, 0.0])
    line = a + ALONG[:, None] * d
    length = float(np.linalg.norm(d))
    parts = r.y.weights[:, None] * np.exp([gaussian.log_density(Gaussian(m, P), line)
                                           for m, P in zip(r.y.means, r.y.covs, strict=True)])
    n = np.array([1.0, 2.0])
    return {
        "line": fig.chart(
            fig.line("first", length * ALONG, parts[0], "prior", dash=True),
            fig.line("second", length * ALONG, parts[1], "linearised", dash=True),
            fig.line("sum", length * ALONG, np.exp(mixture.log_density(r.y, line)), "mixture", width=4),
            fig.line("one", length * ALONG, np.exp(gaussian.log_density(r.law, line)), "posterior", width=2)),
        "belongs": fig.chart(fig.bars("before", n - 0.2, 100.0 * r.y.weights, "prior", width=0.36),
                             fig.bars("after", n + 0.2, 100.0 * r.belongs, "mixture", width=0.36),
                             x_range=(0.4, 2.6), y_range=(0.0, 100.0)),
    }
