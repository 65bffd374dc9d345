"""Weights that are only multiplied end on one particle; resampling stops that and costs ancestors.

MAT 3.5.2, Algorithm 5: SIS against SIR on the same measurements, the effective sample size, and four proposals.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import kalman, particle
from core.motion import LinearMotion, constant_position
from core.sensors import Position, Range
from core.types import Array, Gaussian, Sensor
from lessons.filtering._degeneracy_view import PROPOSALS, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider

STEPS = 12
INITIAL = Gaussian(np.array([20.0]), np.array([[25.0]]))       # m, m^2
MAST = np.array([[25.0, 10.0]])                                 # beside the road, in metres
RUNS = 8                                                       # behind the comparison of the proposals


@dataclass(frozen=True, slots=True)
class Params:
    """One walk along a road; both filters use the same proposal and differ in the threshold."""

    n_particles: int = slider(30, low=5, high=200, log=True)
    threshold: float = slider(1.0, low=0.0, high=1.0, step=0.05)
    proposal: str = choice("prior", PROPOSALS)
    sigma_m: float = slider(2.0, low=0.1, high=20.0, unit="m", log=True, group="world")
    sigma_c: float = slider(3.0, low=0.5, high=10.0, step=0.5, unit="m/√s", group="world")
    sensor: str = choice("position", ("position", "mast"), group="world")
    resampler: str = choice("systematic", ("systematic", "stratified", "multinomial", "residual"), group="more")
    seed: int = seed(7, group="more")


class Road:
    """A range sensor for somebody who walks on the line y = 0: its state is x alone."""

    def __init__(self, ranges: Range) -> None:
        self._ranges = ranges
        self.R = ranges.R

    def _place(self, x: Array) -> Array:
        return np.stack([x[..., 0], np.zeros(x.shape[:-1])], axis=-1)

    def h(self, x: Array) -> Array:
        return self._ranges.h(self._place(x))

    def jacobian(self, x: Array) -> Array:
        return self._ranges.jacobian(self._place(x))[..., :1]

    def innovation(self, y: Array, y_hat: Array) -> Array:
        return self._ranges.innovation(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        return self._ranges.log_likelihood(y, self._place(x))


class Filter(NamedTuple):
    """A run with everything its tree needs; the first row of each array belongs to the start."""

    x: Array                     # (STEPS + 1, N) predicted places, x[0] the initial ones
    before: Array                # (STEPS + 1, N) weights before resampling
    parent: Array                # (STEPS + 1, N) number of the particle at the step before that it moved on from
    ancestors: Array             # (STEPS + 1, N) what resampling at this step chose
    resampled: Array             # (STEPS + 1,)
    n_eff: Array                 # (STEPS + 1,)
    mean: Array                  # (STEPS + 1,)
    roots: Array                 # (STEPS + 1,) how many initial particles have offspring (SIS: that carry weight)


class Result(NamedTuple):
    """Both filters on one walk."""

    truth: Array                 # (STEPS + 1,)
    y: Array                     # (STEPS,)
    sis: Filter
    sir: Filter
    exact: Gaussian | None       # (STEPS + 1,) moments of the Kalman filter, where it is exact
    proposal: str                # the one used: "optimal" exists for the linear sensor only
    study: Array                 # (4, 2) N_eff/N of SIS at the end and of the other, mean; NaN where not possible


def compute(p: Params, progress: Progress) -> Result:
    """Walks, measures, filters twice; then every proposal a few times."""
    walk, measure, draw, repeat = np.random.default_rng(p.seed).spawn(4)
    motion = constant_position(1.0, p.sigma_c, 1)
    sensor: Sensor = Position(1, p.sigma_m) if p.sensor == "position" else Road(Range(MAST, p.sigma_m))
    truth = np.empty((STEPS + 1, 1))
    truth[0] = INITIAL.mean
    for k in range(STEPS):
        truth[k + 1] = motion.sample(truth[k], walk)
    y = sensor.h(truth[1:]) + p.sigma_m * measure.standard_normal((STEPS, 1))
    possible = [name for name in PROPOSALS if p.sensor == "position" or name != "optimal"]
    proposal = p.proposal if p.proposal in possible else "ekf"

    key = int(draw.integers(2**31))                            # the same start and the same noise for both
    sis = _filter(p, y, motion, sensor, proposal, 0.0, key)
    sir = _filter(p, y, motion, sensor, proposal, p.threshold, key)
    progress(0.2)
    exact = None
    if p.sensor == "position":
        post = kalman.run(INITIAL, y, motion, sensor).posterior
        exact = Gaussian(np.append(INITIAL.mean, post.mean[:, 0]), np.append(INITIAL.cov, post.cov[:, 0, 0]))

    study = np.full((len(PROPOSALS), 2), np.nan)
    for i, name in enumerate(possible):
        found = []
        for _ in range(RUNS):
            k = int(repeat.integers(2**31))
            found.append([_filter(p, y, motion, sensor, name, 0.0, k).n_eff[-1],
                          _filter(p, y, motion, sensor, name, p.threshold, k).n_eff[1:].mean()])
            progress(0.2 + 0.8 * (i + len(found) / RUNS) / len(possible))
        study[i] = np.mean(found, axis=0) / p.n_particles
    return Result(truth[:, 0], y[:, 0], sis, sir, exact, proposal, study)


def _filter(p: Params, y: Array, motion: LinearMotion, sensor: Sensor, proposal: str, threshold: float,
            key: int) -> Filter:
    N = p.n_particles
    run = particle.run(INITIAL, y, motion, sensor, N, np.random.default_rng(key), resampler=p.resampler,
                       threshold=threshold, proposal=proposal, subsample=N)
    one = np.arange(N)
    ancestors = np.vstack([one, run.ancestors])
    parent = np.vstack([one, ancestors[:-1]])
    before = np.vstack([np.full(N, 1.0 / N), run.weights_before])
    roots, origin = [N], one
    for k in range(1, STEPS + 1):
        origin = origin[parent[k]]
        alive = ancestors[k] if run.resampled[k - 1] else np.flatnonzero(before[k] > 0.01 * before[k].max())
        roots.append(len(np.unique(origin[alive])))
    return Filter(np.vstack([run.initial[:, 0], run.predicted[:, :, 0]]), before, parent, ancestors,
                  np.append(False, run.resampled), np.append(float(N), run.n_eff),
                  np.append(run.initial.mean(), run.mean[:, 0]), np.array(roots))


def timeline(p: Params) -> Timeline:
    """Twelve seconds; the end is shown first."""
    return Timeline(STEPS, ("predict", "weigh", "resample"), start=STEPS, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("MAT 3.5.2", "MAT Algorithm 5", "MAT Algorithm 6", "MAT exercise 3.14"),
    presets={
        "SIS and SIR": {},
        "threshold N/2": {"threshold": 0.5},
        "sharp measurements": {"sigma_m": 0.3},
        "sharp, optimal proposal": {"sigma_m": 0.3, "proposal": "optimal"},
        "more particles do not help SIS": {"n_particles": 200},
        "range to a mast": {"sensor": "mast", "sigma_m": 1.0, "n_particles": 60},
    },
)
