"""P(|x - x_hat| >= lambda sigma) <= 1 / lambda^2: sets that hold the truth, whatever the law.  MAT 2.6, exercise 2.15.

The bounds (2.8), (2.9) and the n-dimensional one between them hold about the mean of the law only (erratum M10).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.confidence import chebyshev_radius
from core.levels import Axes, chebyshev_level, chi_square_level, ellipsoid
from core.types import Array, Gaussian
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider
from lessons.static._confidence_model import ErrorLaw, draw, error_law, exact_radius, inside
from lessons.static._confidence_view import view

EXPERIMENTS = 100
CLOUD = 1500                             # further draws that show the law in the plane
LAMBDAS = np.linspace(0.05, 5.0, 100)    # of the plotted tails
SHARES = 1.0 - np.geomspace(0.5, 0.01, 30)   # of the plotted radii
LAWS = ("normal", "laplace", "uniform", "student", "extremal")


@dataclass(frozen=True, slots=True)
class Params:
    """What is asked for, the law of the errors, and what is believed of it: its mean and its covariance."""

    percent: float = slider(95.0, low=50.0, high=99.0, step=0.1, unit="%", group="set")
    reading: str = choice("repeated", ("repeated", "bayes"), group="set")
    space: str = choice("line", ("line", "plane"), group="set")
    law: str = choice("extremal", LAWS, group="law")
    lam: float = slider(2.0, low=1.0, high=6.0, step=0.05, group="law")
    nu: float = slider(3.0, low=2.1, high=30.0, step=0.1, group="law")
    off_m: float = slider(0.0, low=-20.0, high=20.0, step=0.5, unit="m", group="law")
    truth: Point = draggable((0.0, 0.0), low=-50.0, high=50.0, role="truth", group="law")
    estimate: Point = draggable((0.0, 0.0), low=-50.0, high=50.0, role="measurement", group="law")
    sigma_x_m: float = slider(4.0, low=0.5, high=20.0, unit="m", log=True, group="spread")
    sigma_y_m: float = slider(7.0, low=0.5, high=20.0, unit="m", log=True, group="spread")
    correlation: float = slider(0.8, low=-0.95, high=0.95, step=0.05, group="spread")
    seed: int = seed(1, group="spread")


class Set(NamedTuple):
    """An ellipsoid round the estimate (radius in standard deviations) or a ball (in m), and what it truly holds."""

    radius: float
    holds: float


class Result(NamedTuple):
    """Draws e_k round the mean 0 of their law; q is the point from which they are looked at.

    Repeated experiments: e_k are the estimates, q the truth.  Bayesian: e_k are possible truths, q the estimate.
    """

    e: ErrorLaw
    cov: Array                   # (n, n) m^2
    axes: Axes                   # of the one-sigma ellipse
    q: Array                     # (n,) m
    normal: Set
    chebyshev: Set
    circle: Set                  # of the bound with the trace
    exact_radius: float          # of the set that holds what is asked for, in standard deviations
    draws: Array                 # (EXPERIMENTS, n) m
    far: Array                   # (EXPERIMENTS,) Mahalanobis distances from q
    cloud: Array                 # (CLOUD, n) m
    tail: Array                  # (LAMBDAS,) P(d >= lambda sqrt n)
    normal_tail: Array           # (LAMBDAS,) the same for a normal law round q
    circle_tail: Array           # (LAMBDAS,) P(|x - q| >= lambda sqrt tr Sigma)
    radii: Array                 # (SHARES, 3) normal, Chebyshev, exact


def compute(p: Params, progress: Progress) -> Result:
    """Sets for the probability asked for, what they really hold, and a hundred experiments."""
    n = 1 if p.space == "line" else 2
    cov = np.array([[p.sigma_x_m**2]])
    if n == 2:
        cross = p.correlation * p.sigma_x_m * p.sigma_y_m
        cov = np.array([[p.sigma_x_m**2, cross], [cross, p.sigma_y_m**2]])
    axes = ellipsoid(Gaussian(np.zeros(n), cov), 1.0)
    q = np.array([-p.off_m]) if n == 1 else np.array(p.truth if p.reading == "repeated" else p.estimate)
    z_q = (axes.directions.T @ q) / axes.semi_axes        # q in standard deviations along the axes
    share = p.percent / 100.0
    e, one = error_law(p.law, n, p.lam, p.nu), np.ones(n)

    def measured(a: Array, radius: Array) -> Set:
        return Set(float(radius), float(inside(e, a, z_q, radius)))

    normal = measured(one, np.sqrt(chi_square_level(share, n)))
    chebyshev = measured(one, np.sqrt(chebyshev_level(share, n)))                          # (2.9)
    circle = measured(axes.semi_axes, chebyshev_radius(cov, share))
    exact = float(exact_radius(e, z_q, np.array(share)))
    progress(0.3)
    scales = np.sqrt(LAMBDAS**2 * n)
    tail = 1.0 - inside(e, one, z_q, scales)
    circle_tail = 1.0 - inside(e, axes.semi_axes, z_q, LAMBDAS * np.sqrt(np.trace(cov)))
    normal_tail = 1.0 - inside(error_law("normal", n, p.lam, p.nu), one, 0.0 * z_q, scales)
    progress(0.6)
    radii = np.column_stack([np.sqrt(chi_square_level(SHARES, n)), np.sqrt(chebyshev_level(SHARES, n)),
                             exact_radius(e, z_q, SHARES)])
    own, others = np.random.default_rng(p.seed).spawn(2)
    turn = axes.directions * axes.semi_axes               # A of x = A z
    z = draw(e, EXPERIMENTS, own)
    return Result(e, cov, axes, q, normal, chebyshev, circle, exact, z @ turn.T,
                  np.sqrt(np.square(z - z_q).sum(axis=1)), draw(e, CLOUD, others) @ turn.T, tail, normal_tail,
                  circle_tail, radii)


def timeline(p: Params) -> Timeline:
    """Experiments, or possible truths, one after the other."""
    return Timeline(EXPERIMENTS, ("draw", "sets", "check"), start=EXPERIMENTS, unit_name="k")


def unused(p: Params) -> set[str]:
    """What belongs to the other dimension, reading or law."""
    hidden = {"sigma_y_m", "correlation", "truth", "estimate"} if p.space == "line" else {
        "off_m", "estimate" if p.reading == "repeated" else "truth"}
    return hidden | ({"lam"} if p.law != "extremal" else set()) | ({"nu"} if p.law != "student" else set())


EXAMPLE_7 = {"sigma_x_m": 4.0, "sigma_y_m": float(np.sqrt(52.0)), "correlation": float(3.0 / np.sqrt(13.0))}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.6", "MAT (2.8)", "MAT (2.9)", "MAT exercise 2.15"),
    presets={
        "a law that fools the rule 2σ": {},
        "8/9 within 3σ": {"lam": 3.0, "percent": 800.0 / 9.0},
        "exercise 2.15 a": {"law": "laplace", "percent": 67.0, "sigma_x_m": float(np.sqrt(2.0))},
        "exercise 2.15 b": {"lam": 1.0, "percent": 67.0, "sigma_x_m": 1.0},
        "100 normal intervals": {"law": "normal"},
        "the Bayesian reading": {"reading": "bayes", "law": "laplace"},
        "E 95 %: n/0.05 = 40": {"space": "plane", "law": "normal", **EXAMPLE_7},
        "circle or ellipse, λ = 2": {"space": "plane", "law": "normal", "percent": 75.0, **EXAMPLE_7},
        "a law that fools the ellipse": {"space": "plane"},
        "biased: nothing is promised": {"space": "plane", "law": "normal", "percent": 75.0, "truth": (9.0, -6.0)},
    },
)
