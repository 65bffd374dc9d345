"""f(x | y) = f(x, y) / f_y(y): a slice of the joint density, scaled to area 1.

MAT 1.3.3 (Definitions 7 and 8, Example 11, (1.10), Fig 1.4), exercise 1.14.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.forms import half_space_probability
from core.gaussian import affine, condition, log_density, marginal, regression_gain, sample
from core.types import Array, Gaussian
from lessons.background._conditioning_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, draggable, seed, slider, switch

DRAWS = 6000
HALF_M = 16.0                             # half the side of the floor
STRIP_M = 1.0                             # half width of the strip of samples


@dataclass(frozen=True, slots=True)
class Params:
    """x ~ N(0, sigma_x^2), y = H x + v with v ~ N(0, sigma_v^2); the joint law is cut at the y of the probe."""

    probe: Point = draggable((-4.0, -12.0), low=-HALF_M, high=HALF_M, role="measurement", group="cut")
    whole: bool = switch(False, group="cut")
    sigma_x_m: float = slider(4.0, low=0.5, high=8.0, step=0.1, unit="m", group="law")
    gain: float = slider(1.5, low=-3.0, high=3.0, step=0.1, unit="m/m", group="law")
    sigma_v_m: float = slider(4.0, low=0.2, high=20.0, unit="m", log=True, group="law")
    seed: int = seed(1, group="law")


class Result(NamedTuple):
    """The joint law, and what the cut says."""

    joint: Gaussian              # of (x, y)
    x_law: Gaussian              # marginals
    y_law: Gaussian
    given: Gaussian              # x | y at the probe
    K: float                     # slope of E(x | y)
    f_y: float                   # 1/m, at the probe
    below: float                 # P(x < x of the probe | y)
    draws: Array                 # (DRAWS, 2) of the joint law
    near: Array                  # (DRAWS,) those in the strip


def compute(p: Params, progress: Progress) -> Result:
    """The joint law of x and its measurement, conditioned on y."""
    prior = Gaussian(np.zeros(2), np.diag([p.sigma_x_m**2, p.sigma_v_m**2]))               # (x, v) independent
    joint = affine(prior, [[1.0, 0.0], [p.gain, 1.0]])                                     # Theorem 4
    x, y = p.probe
    x_law, y_law = marginal(joint, [0]), marginal(joint, [1])
    given = condition(joint, [y], 1)                                                       # (1.10)
    draws = sample(joint, DRAWS, np.random.default_rng(p.seed))
    return Result(joint, x_law, y_law, given, float(regression_gain(joint, 1)[0, 0]),
                  float(np.exp(log_density(y_law, [y]))), float(half_space_probability(given, [1.0], x)), draws,
                  np.abs(draws[:, 1] - y) < STRIP_M)


def timeline(p: Params) -> Timeline:
    return Timeline(0, ("joint", "cut", "scale", "compare", "regression"))


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("MAT 1.3.3", "MAT Definition 7", "MAT Definition 8", "MAT Example 11", "MAT (1.10)", "MAT Fig 1.4",
          "MAT exercise 1.14"),
    presets={
        "Example 11, y = −12": {},
        "y = 0: the same width": {"probe": (-4.0, 0.0)},
        "exercise 1.14": {"stage": "scale"},
        "an accurate measurement": {"sigma_v_m": 1.0},
        "a poor measurement": {"sigma_v_m": 16.0},
        "H = 0: nothing is learnt": {"gain": 0.0, "probe": (-4.0, -6.0)},
        "H < 0": {"gain": -1.5},
    },
)
