"""x_mean = (1/n) sum x_i ~ mu, V(x_mean) = Sigma / n: unbiased and consistent.  MAT Example 6."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.gaussian import chi_square_level, mahalanobis_squared, sample
from core.types import Array, Gaussian
from lessons.background._sample_mean_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

NUMBERS = np.unique(np.round(np.geomspace(1, 1000, 25)).astype(int))      # n of the timeline
DRAWN = 400                                                               # means that are drawn


@dataclass(frozen=True, slots=True)
class Params:
    """The law of one draw, and how often the experiment of n draws is repeated."""

    law: str = choice("normal", ("normal", "uniform", "exponential", "cauchy"))
    sigma_x_m: float = slider(20.0, low=2.0, high=40.0, unit="m", group="law")
    sigma_y_m: float = slider(10.0, low=2.0, high=40.0, unit="m", group="law")
    correlation: float = slider(0.6, low=-0.95, high=0.95, step=0.05, group="law")
    truth: Point = draggable((0.0, 0.0), low=-60.0, high=60.0, role="truth", group="law")
    repeats: int = slider(400, low=20, high=2000, log=True, group="experiment")
    seed: int = seed(3, group="experiment")


class Result(NamedTuple):
    """For every n of NUMBERS: means (NUMBERS, repeats, 2) of the first n draws of each repetition.

    draws (1000, 2) of the first repetition; law: mean and covariance of one draw (of the normal one where there is
    none); rms, bias (NUMBERS,): root mean square error of the means, and length of their mean error, in metres; inside
    (NUMBERS,): share of the means in the 68 % ellipse of Sigma / n.
    """

    law: Gaussian
    draws: Array
    means: Array
    rms: Array
    bias: Array
    inside: Array


def compute(p: Params, progress: Progress) -> Result:
    """All repetitions use their draws one after the other, so that n = 10 continues n = 5."""
    covariance = p.correlation * p.sigma_x_m * p.sigma_y_m
    law = Gaussian(np.array(p.truth), np.array([[p.sigma_x_m**2, covariance], [covariance, p.sigma_y_m**2]]))
    rng = np.random.default_rng(p.seed)
    means = np.empty((len(NUMBERS), p.repeats, 2))
    first = np.empty((0, 2))
    block = max(1, 200_000 // NUMBERS[-1])
    for start in range(0, p.repeats, block):
        x = _draws(p.law, law, (min(block, p.repeats - start), int(NUMBERS[-1])), rng)
        first = x[0] if start == 0 else first
        sums = np.cumsum(x, axis=1)
        means[:, start:start + block] = (sums[:, NUMBERS - 1] / NUMBERS[:, None]).swapaxes(0, 1)
        progress(min(1.0, (start + block) / p.repeats))
    errors = means - law.mean
    level = float(chi_square_level(0.68, 2))
    inside = np.array([(mahalanobis_squared(Gaussian(law.mean, law.cov / n), m) <= level).mean()
                       for n, m in zip(NUMBERS, means, strict=True)])
    return Result(law, first, means, np.sqrt(np.square(errors).sum(axis=-1).mean(axis=1)),
                  np.sqrt(np.square(errors.mean(axis=1)).sum(axis=-1)), inside)


def _draws(name: str, law: Gaussian, size: tuple[int, int], rng: np.random.Generator) -> Array:
    """Draws (repeats, n, 2) of a law with this mean and covariance; Cauchy has neither, and takes its scale."""
    if name == "normal":
        return sample(law, size, rng)
    if name == "uniform":
        u = rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), (*size, 2))
    elif name == "exponential":
        u = rng.exponential(1.0, (*size, 2)) - 1.0
    else:
        u = rng.standard_cauchy((*size, 2))
    return law.mean + np.matvec(np.linalg.cholesky(law.cov), u)


def timeline(p: Params) -> Timeline:
    """Larger and larger n."""
    return Timeline(len(NUMBERS) - 1, start=9, unit_name="step")


LESSON = Lesson(
    Params, compute, view, timeline=timeline, budget_s=1.0, refs=("MAT Example 6", "MAT Theorem 3", "MAT exercise 1.8"),
    presets={
        "normal draws": {},
        "one draw": {"step": 0},
        "a thousand draws": {"step": len(NUMBERS) - 1},
        "uniform draws": {"law": "uniform"},
        "exponential draws": {"law": "exponential", "step": 3},
        "Cauchy: no mean at all": {"law": "cauchy", "step": len(NUMBERS) - 1},
    },
)
