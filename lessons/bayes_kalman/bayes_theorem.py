"""Bayes' theorem as areas and as bells: prior, likelihood, evidence, posterior, again and again.  KF thesis 2.1-2.2."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import grid
from core.sensors import Position
from core.types import Array, Gaussian
from lessons.bayes_kalman._bayes_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider

DATA = 30
CELLS = np.arange(3.0)
COIN = grid.cells(0.0, 1.0, 200)
REACH_M = 20.0
LINE = grid.cells(-REACH_M, REACH_M, 400)


@dataclass(frozen=True, slots=True)
class Params:
    """Somebody's prior, the measurement, the truth; a second person has another prior and sees the same data."""

    case: str = choice("cells", ("cells", "normal", "coin"), group="prior")
    prior_a: float = slider(0.5, low=0.0, high=1.0, step=0.01, group="prior")
    prior_b: float = slider(0.3, low=0.0, high=1.0, step=0.01, group="prior")
    prior_c: float = slider(0.2, low=0.0, high=1.0, step=0.01, group="prior")
    heard_a: float = slider(0.1, low=0.0, high=1.0, step=0.01, group="data")
    heard_b: float = slider(0.6, low=0.0, high=1.0, step=0.01, group="data")
    heard_c: float = slider(0.3, low=0.0, high=1.0, step=0.01, group="data")
    mean_m: float = slider(-4.0, low=-10.0, high=10.0, step=0.5, unit="m", group="prior")
    prior_sigma_m: float = slider(3.0, low=0.5, high=8.0, step=0.1, unit="m", group="prior")
    sigma_m: float = slider(2.0, low=0.5, high=8.0, step=0.1, unit="m", group="data")
    heads: float = slider(2.0, low=0.5, high=50.0, step=0.5, group="prior")
    tails: float = slider(2.0, low=0.5, high=50.0, step=0.5, group="prior")
    true_cell: str = choice("b", ("a", "b", "c"), group="truth")
    true_x_m: float = slider(3.0, low=-8.0, high=8.0, step=0.5, unit="m", group="truth")
    true_bias: float = slider(0.7, low=0.0, high=1.0, step=0.01, group="truth")
    seed: int = seed(1, group="truth")


USED = {
    "cells": ("prior_a", "prior_b", "prior_c", "heard_a", "heard_b", "heard_c", "true_cell"),
    "normal": ("mean_m", "prior_sigma_m", "sigma_m", "true_x_m"),
    "coin": ("heads", "tails", "true_bias"),
}


class Result(NamedTuple):
    """What both people believe after each datum; index 0 is their prior."""

    axis: Array                  # (n,) cells, positions in m, or probabilities of heads
    truth: float                 # on that axis
    y: Array                     # (DATA,) 1 or 0, or m
    mine: Array                  # (DATA + 1, n) probabilities of the cells
    theirs: Array                # (DATA + 1, n) from the flat prior
    likelihood: Array            # (DATA, n) of each datum
    evidence: Array              # (DATA,) p(y_k | y_1 .. y_{k-1}) under my prior
    evidence_theirs: Array       # (DATA,)
    laws: Array                  # (DATA + 1, 2) my mean and standard deviation on the axis
    density: float               # what a probability of a cell is to be divided by for a density


def compute(p: Params, progress: Progress) -> Result:
    """The same data for both: multiply by the likelihood, divide by the evidence, begin again.  (2.1)-(2.2)"""
    rng = np.random.default_rng(p.seed)
    axis, prior, truth, y, likelihood = {"cells": _cells, "normal": _normal, "coin": _coin}[p.case](p, rng)
    mine, theirs = prior, grid.uniform(axis)
    beliefs, others, evidence, evidence_theirs = [mine], [theirs], [], []
    with np.errstate(divide="ignore"):
        logs = np.log(likelihood)
    for k in range(DATA):
        progress(k / DATA)
        for law, chain, found in ((mine, beliefs, evidence), (theirs, others, evidence_theirs)):
            done = _multiply(law, logs[k])
            chain.append(done.posterior)
            found.append(done.evidence)
        mine, theirs = beliefs[-1], others[-1]
    weights = np.array([b.weights for b in beliefs])
    means = weights @ axis
    spread = np.sqrt((weights @ np.square(axis) - means**2).clip(0.0))
    return Result(axis, truth, y, weights, np.array([b.weights for b in others]), likelihood, np.array(evidence),
                  np.array(evidence_theirs), np.column_stack([means, spread]), mine.cell_volume)


class Impossible(NamedTuple):
    """An update by something that the prior excludes: there is no posterior, so the belief stays."""

    posterior: grid.GridDensity
    evidence: float


def _multiply(law: grid.GridDensity, log_likelihood: Array) -> grid.GridUpdate | Impossible:
    if (log_likelihood[law.weights > 0] == -np.inf).all():
        return Impossible(law, 0.0)
    return grid.multiply(law, log_likelihood)


def _cells(p: Params, rng: np.random.Generator) -> tuple[Array, grid.GridDensity, float, Array, Array]:
    """Three hypotheses, a bell that is heard or not."""
    prior = np.array([p.prior_a, p.prior_b, p.prior_c])
    heard = np.array([p.heard_a, p.heard_b, p.heard_c])
    truth = "abc".index(p.true_cell)
    y = (rng.random(DATA) < heard[truth]).astype(float)
    if prior.sum() == 0.0:
        prior = np.ones(3)
    return CELLS, grid.GridDensity(CELLS, prior), float(truth), y, np.where(y[:, None] > 0, heard, 1.0 - heard)


def _normal(p: Params, rng: np.random.Generator) -> tuple[Array, grid.GridDensity, float, Array, Array]:
    """A position on a line, measured with normal noise."""
    y = p.true_x_m + p.sigma_m * rng.standard_normal(DATA)
    prior = grid.from_gaussian(Gaussian(np.array([p.mean_m]), np.array([[p.prior_sigma_m**2]])), LINE)
    sensor = Position(1, p.sigma_m)
    likelihood = np.exp(sensor.log_likelihood(y[:, None, None], LINE[:, None]))
    return LINE, prior, p.true_x_m, y, likelihood


def _coin(p: Params, rng: np.random.Generator) -> tuple[Array, grid.GridDensity, float, Array, Array]:
    """The probability of heads, from tosses; the prior is worth `heads` and `tails` tosses seen before."""
    y = (rng.random(DATA) < p.true_bias).astype(float)
    prior = grid.from_log_density(COIN, lambda x: ((p.heads - 1) * np.log(x) + (p.tails - 1) * np.log1p(-x))[..., 0])
    return COIN, prior, p.true_bias, y, np.where(y[:, None] > 0, COIN, 1.0 - COIN)


def timeline(p: Params) -> Timeline:
    """One datum per step."""
    return Timeline(DATA, ("prior", "likelihood", "evidence", "posterior"), start=1, unit_name="datum")


def unused(p: Params) -> tuple[str, ...]:
    return tuple(name for case, names in USED.items() if case != p.case for name in names)


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("KF thesis 2.1", "KF thesis 2.2", "KF thesis (2.1)-(2.2)"),
    presets={
        "three places": {},
        "a rare disease": {"prior_a": 0.01, "prior_b": 0.99, "prior_c": 0.0, "heard_a": 0.9, "heard_b": 0.05,
                           "heard_c": 0.0, "true_cell": "a", "seed": 2, "step": 1},
        "never say never": {"prior_a": 0.5, "prior_b": 0.0, "prior_c": 0.5, "step": 30},
        "two bells": {"case": "normal"},
        "a stubborn prior": {"case": "normal", "prior_sigma_m": 0.5, "step": 12},
        "an unfair coin": {"case": "coin", "step": 10},
        "sure that it is fair": {"case": "coin", "heads": 50.0, "tails": 50.0, "step": 30},
    },
)
