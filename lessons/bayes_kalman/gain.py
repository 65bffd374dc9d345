"""The Kalman gain as the bottom of a bowl: trace of the error covariance over the gain.  KF thesis (3.11)-(3.19)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import kalman
from core.gaussian import sample
from core.linear_update import joseph_form, short_form, trace_gradient
from core.sensors import Linear
from core.types import Array, Gaussian
from lessons.bayes_kalman._gain_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider

SWEEP = 40                               # steps of the timeline: the used gain is step / 20 times the best one
PER_UNIT = 20
PERTURBED = 150                          # random gains beside the best one
RATIOS = np.geomspace(0.01, 100.0, 61)   # R against what it is, for the curve of trust
# The thesis has no numbers in chapter 3; these are ours.
PAIR_P = np.array([[4.0, 1.0], [1.0, 3.0]])
PAIR_H = np.array([[1.0, 0.0], [1.0, 1.0]])
PAIR_R = np.array([[2.0, 0.5], [0.5, 1.0]])
PAIR_X, PAIR_Y = np.array([2.0, -1.0]), np.array([3.0, 2.0])


@dataclass(frozen=True, slots=True)
class Params:
    """How sure the prediction and the measurement are; both whole matrices are scaled with their first entry."""

    model: str = choice("pair", ("pair", "one"), group="law")
    P_m2: float = slider(4.0, low=0.1, high=40.0, unit="m²", log=True, group="law")
    R_m2: float = slider(2.0, low=0.05, high=40.0, unit="m²", log=True, group="law")
    row: str = choice("1", ("1", "2"), group="law")
    wobble: float = slider(0.3, low=0.0, high=1.0, step=0.05, group="tests")
    runs: int = slider(4000, low=200, high=20000, step=200, group="tests")
    seed: int = seed(1, group="tests")


class Sweep(NamedTuple):
    """The multiples c K of the best gain, all arrays (SWEEP + 1, ...)."""

    scale: Array                 # c
    joseph: Array                # (., n, n) covariance of the error
    short: Array                 # (., n, n) what (I - K H) P says
    real: Array                  # (., n) mean square error of each component in the experiment
    gradient: Array              # (., n, m) d tr P / dK


class Perturbed(NamedTuple):
    """Random gains K + D, all arrays (PERTURBED, ...)."""

    gains: Array                 # (., n, m)
    price: Array                 # (.,) tr(D S D')
    joseph: Array                # (.,) trace
    short: Array                 # (.,) trace
    real: Array                  # (.,) mean square error in the experiment


class Result(NamedTuple):
    """The best update, and what other gains would give."""

    step: kalman.Update
    R: Array                     # (m, m)
    sweep: Sweep
    perturbed: Perturbed
    trust: Array                 # (len(RATIOS), n) eigenvalues of K H when R is RATIOS times as large


def model_of(p: Params) -> tuple[Gaussian, Linear, Array]:
    """Prior, sensor and measurement."""
    if p.model == "one":
        return Gaussian(np.zeros(1), np.array([[p.P_m2]])), Linear([[1.0]], [[p.R_m2]]), np.array([4.0])
    P, R = PAIR_P * (p.P_m2 / PAIR_P[0, 0]), PAIR_R * (p.R_m2 / PAIR_R[0, 0])
    return Gaussian(PAIR_X, P), Linear(PAIR_H, R), PAIR_Y


def compute(p: Params, progress: Progress) -> Result:
    """Theory for all gains at once, and one experiment whose random errors every gain has to handle."""
    prior, sensor, y = model_of(p)
    before, measure, wobble = np.random.default_rng(p.seed).spawn(3)
    best = kalman.update(prior, y, sensor)
    P, H, R, K = prior.cov, sensor.H, sensor.R, best.gain
    errors = sample(Gaussian(np.zeros(len(P)), P), p.runs, before)           # x - x^-
    noise = sample(Gaussian(np.zeros(len(R)), R), p.runs, measure)
    progress(0.3)

    scale = np.arange(SWEEP + 1) / PER_UNIT
    gains = scale[:, None, None] * K
    sweep = Sweep(scale, joseph_form(P, H, R, gains), short_form(P, H, gains), mean_square(errors, noise, H, gains),
                  trace_gradient(P, H, R, gains))
    D = p.wobble * np.abs(K).max() * wobble.standard_normal((PERTURBED, *K.shape))
    progress(0.6)
    others = Perturbed(K + D, trace(D @ best.innovation_cov @ D.mT), trace(joseph_form(P, H, R, K + D)),
                       trace(short_form(P, H, K + D)), mean_square(errors, noise, H, K + D).sum(axis=-1))
    return Result(best, R, sweep, others, np.array([trust(prior, H, r * R) for r in RATIOS]))


def mean_square(errors: Array, noise: Array, H: Array, gains: Array) -> Array:
    """Mean of (x - x+)_i^2 over the experiment, x - x+ = (I - K H)(x - x^-) - K r, for each gain (N, n, m).  (3.12)"""
    A = np.eye(errors.shape[-1]) - gains @ H
    return np.square(errors @ A.mT - noise @ gains.mT).mean(axis=-2)


def trace(P: Array) -> Array:
    return np.trace(P, axis1=-2, axis2=-1)


def trust(prior: Gaussian, H: Array, R: Array) -> Array:
    """Eigenvalues of K H, rising: real and from 0 to 1 for every P, H and R."""
    K = kalman.update(prior, np.zeros(len(R)), Linear(H, R)).gain
    return np.sort(np.linalg.eigvals(K @ H).real)


def timeline(p: Params) -> Timeline:
    """The used gain goes from 0 to twice the best one; too large a gain is shown first."""
    return Timeline(SWEEP, ("gain", "joseph", "short", "slope"), start=27, scale=1 / PER_UNIT, unit="× K",
                    unit_name="gain")


def unused(p: Params) -> tuple[str, ...]:
    return ("row",) if p.model == "one" else ()


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("KF thesis 2.5", "KF thesis (3.11)-(3.19)"),
    presets={
        "two coordinates": {},
        "the best gain": {"step": PER_UNIT},
        "second row": {"row": "2", "step": 27},
        "one coordinate": {"model": "one", "step": PER_UNIT},
        "one coordinate, gain 1: only the measurement": {"model": "one", "P_m2": 2.0, "step": 40},
        "a poor measurement": {"model": "one", "R_m2": 36.0, "step": PER_UNIT},
        "a poor prediction": {"model": "one", "P_m2": 36.0, "R_m2": 1.0, "step": PER_UNIT},
    },
)
