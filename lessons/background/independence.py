"""f(x1, x2) = f1(x1) f2(x2): independent is more than uncorrelated, except for normal laws.

MAT 1.3 (Definition 2, Theorems 2 and 5, Examples 5 and 9).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.forms import correlation, cross_covariance
from core.gaussian import regression_gain
from core.types import Array, Gaussian
from lessons.background._independence_model import (
    STEPS,
    Facts,
    covariance,
    facts,
    law_of,
    normal,
    remainder,
    square,
    total_variation,
)
from lessons.background._independence_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

PICTURES = ("disc", "square", "normal", "remainder", "directions")
SWEEP = 81
RHO = float(3.0 / np.sqrt(13.0))          # correlation of Example 7
COEFFICIENT = 6.0 / 13.0                  # of Example 9 with the numbers of Example 11
HIDDEN = {
    "disc": {"turn_deg", "correlation", "k", "probe_m", "a", "b"},
    "square": {"correlation", "k", "probe_m", "a", "b"},
    "normal": {"turn_deg", "k", "probe", "a", "b"},
    "remainder": {"turn_deg", "probe", "a", "b"},
    "directions": {"turn_deg", "k", "probe", "probe_m"},
}


@dataclass(frozen=True, slots=True)
class Params:
    """Which law, and where it is cut; Example 9's coefficient; the two directions of Theorem 5."""

    picture: str = choice("disc", PICTURES)
    turn_deg: float = slider(30.0, low=0.0, high=90.0, step=1.0, unit="°", group="law")
    correlation: float = slider(RHO, low=-0.99, high=0.99, step=0.01, group="law")
    k: float = slider(COEFFICIENT, low=-1.0, high=1.0, step=0.01, unit="m/m", group="law")
    probe: Point = draggable((0.0, 0.8), low=-1.5, high=1.5, unit="", role="handle", group="law")
    probe_m: Point = draggable((0.0, -12.0), low=-18.0, high=18.0, role="handle", group="law")
    a: Point = draggable((12.0, 0.0), low=-18.0, high=18.0, unit="", role="measurement", group="law")
    b: Point = draggable((0.0, 12.0), low=-18.0, high=18.0, unit="", role="posterior", group="law")
    n: int = slider(1200, low=100, high=3000, log=True, group="sample")
    seed: int = seed(1, group="sample")


class Sweep(NamedTuple):
    """Something turned over its whole range: the correlation, and the distance to the product of the marginals."""

    at: Array                    # (SWEEP,) angle in degrees, correlation, or k
    correlation: Array           # (SWEEP,)
    second: Array                # (SWEEP,) total variation, or the standard deviation of z in m


class Result(NamedTuple):
    """The cloud before Example 9's coefficient is subtracted, and the law's facts; a and b are unit vectors."""

    cloud: Array                 # (n, 2)
    facts: Facts                 # at the whole coefficient
    sweep: Sweep | None          # None for the disc
    K: float                     # P_xy / P_yy of the unchanged normal law
    P: Array                     # (2, 2) its covariance
    a: Array
    b: Array


def compute(p: Params, progress: Progress) -> Result:
    """Draws the cloud, and turns the law over its range."""
    P = covariance(p.correlation)
    cloud = law_of(p, 0).draw(p.n, np.random.default_rng(p.seed))
    a, b = (_unit(v, default) for v, default in ((p.a, (1.0, 0.0)), (p.b, (0.0, 1.0))))
    progress(0.1)
    K = float(regression_gain(Gaussian(np.zeros(2), P), 1)[0, 0])
    return Result(cloud, facts(law_of(p)), _sweep(p, P, a, progress), K, P, a, b)


def _unit(v: Point, default: tuple[float, float]) -> Array:
    """The direction of v; `default` for the zero vector."""
    size = float(np.hypot(*v))
    return np.array(v) / size if size > 1e-9 else np.array(default)


def _sweep(p: Params, P: Array, a: Array, progress: Progress) -> Sweep | None:
    if p.picture == "remainder":
        at = np.linspace(-1.0, 1.0, SWEEP)
        laws = np.array([remainder(P, float(k)).cov for k in at])
        return Sweep(at, correlation(laws)[:, 0, 1], np.sqrt(laws[:, 0, 0]))
    if p.picture == "directions":
        at = np.linspace(0.0, 180.0, 181)
        b = np.column_stack([np.cos(np.radians(at)), np.sin(np.radians(at))])
        cross = cross_covariance(Gaussian(np.zeros(2), P), a[None], b)[0]
        sd = np.sqrt(np.vecdot(b, b @ P))
        return Sweep(at, cross / (sd * np.sqrt(a @ P @ a)), sd)
    if p.picture == "disc":
        return None
    at = np.linspace(0.0, 90.0, SWEEP) if p.picture == "square" else np.linspace(-0.99, 0.99, SWEEP)
    rho, apart = [], []
    for i, value in enumerate(at):
        law = square(np.radians(value)) if p.picture == "square" else normal(covariance(float(value)))
        rho.append(facts(law).correlation)
        apart.append(total_variation(law, 81))
        progress(0.1 + 0.9 * i / SWEEP)
    return Sweep(at, np.array(rho), np.array(apart))


def timeline(p: Params) -> Timeline:
    """Stage by stage; in Example 9 the coefficient grows from 0 to k."""
    if p.picture == "directions":
        return Timeline(0, ("joint", "marginals", "slice"))
    stages = ("joint", "marginals", "slice", "difference")
    if p.picture == "remainder":
        return Timeline(STEPS, stages, start=STEPS, start_stage=2, scale=p.k / STEPS, unit_name="k")
    return Timeline(0, stages, start_stage=2)


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=lambda p: HIDDEN[p.picture],
    refs=("MAT 1.3", "MAT Definition 2", "MAT Theorem 2", "MAT Theorem 5", "MAT Example 5", "MAT Example 9"),
    presets={
        "Example 5: the disc": {},
        "Example 5: at the centre": {"probe": (0.0, 0.0), "stage": "difference"},
        "independent: an upright square": {"picture": "square", "turn_deg": 0.0},
        "the same square, turned": {"picture": "square", "stage": "difference"},
        "normal, ρ = 0.83": {"picture": "normal", "stage": "difference"},
        "normal and uncorrelated": {"picture": "normal", "correlation": 0.0, "stage": "difference"},
        "Example 9: k = 6/13": {"picture": "remainder"},
        "Theorem 5: orthogonal is not enough": {"picture": "directions"},
        "Theorem 5: AΣBᵀ = 0": {"picture": "directions", "b": (-9.0, 6.0)},
        "Theorem 5: the axes of the ellipse": {"picture": "directions", "a": (6.0, 12.0), "b": (-12.0, 6.0)},
    },
)
