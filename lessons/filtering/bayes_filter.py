"""The Bayes filter on a grid: prediction spreads, a measurement multiplies, and an estimate needs a cost.

MAT 3.4, (3.18)-(3.20), exercises 3.9 and 3.10.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import grid
from core.gaussian import log_density
from core.grid import GridDensity
from core.motion import constant_position
from core.sensors import Range
from core.sensors_discrete import UniformNoise
from core.types import Array, Gaussian, Sensor
from lessons.filtering._bayes_filter_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, slider

STEPS = 3
LINE = (grid.cells(-0.5 * np.pi, 3.5 * np.pi, 600),)      # room for the prediction beside (0, 3 pi); k pi are edges
WIDER = (grid.cells(-5.0, 3.5 * np.pi, 700),)
PEAKS = Gaussian(np.array([[0.0], [5.0]]), np.array([[[1.0]], [[0.25]]]))       # with the weights 0.6 and 0.4
HALF_M = 200.0
PLANE = (grid.cells(-HALF_M, HALF_M, 80),) * 2
PRIOR_SIGMA_M = 70.0
ESTIMATES = 161                                            # places at which the costs are computed


@dataclass(frozen=True, slots=True)
class Params:
    """On the line: exercise 3.10 and more of its measurements.  In the plane: ranges to two stations in turn."""

    space: str = choice("line", ("line", "plane"))
    prior: str = choice("uniform", ("uniform", "peaks"), group="model")
    noise: str = choice("uniform", ("uniform", "normal"), group="model")
    width: float = slider(0.5, low=0.1, high=1.0, step=0.05, group="model")
    y1: float = slider(0.5, low=-1.4, high=1.4, step=0.05, group="model")
    y2: float = slider(0.8, low=-1.4, high=1.4, step=0.05, group="model")
    y3: float = slider(0.3, low=-1.4, high=1.4, step=0.05, group="model")
    sigma_w: float = slider(0.3, low=0.0, high=1.0, step=0.05, unit="rad", group="model")
    delta: float = slider(0.5, low=0.05, high=5.0, step=0.05, unit="rad", group="model")
    target: Point = draggable((70.0, 10.0), low=-180.0, high=180.0, role="truth", group="model")
    prior_mean: Point = draggable((-15.0, 10.0), low=-150.0, high=150.0, role="prior", group="model")
    station_1: Point = draggable((0.0, -60.0), low=-190.0, high=190.0, role="station", group="model")
    station_2: Point = draggable((0.0, 60.0), low=-190.0, high=190.0, role="station", group="model")
    sigma_m: float = slider(10.0, low=4.0, high=60.0, step=1.0, unit="m", group="model")
    sigma_w_m: float = slider(15.0, low=0.0, high=60.0, step=1.0, unit="m", group="model")
    delta_m: float = slider(30.0, low=5.0, high=200.0, step=5.0, unit="m", group="model")


class Wave:
    """y = sin x + v for a state x of one component; the noise is added by the sensor around it."""

    def __init__(self, sigma: float) -> None:
        self.R = np.array([[sigma * sigma]])

    def h(self, x: Array) -> Array:
        return np.sin(x[..., :1])

    def jacobian(self, x: Array) -> Array:
        return np.cos(x[..., :1])[..., None]

    def innovation(self, y: Array, y_hat: Array) -> Array:
        return np.subtract(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        R = self.R[0, 0]
        return -0.5 * (np.square(y - self.h(x))[..., 0] / R + np.log(2.0 * np.pi * R))


class Step(NamedTuple):
    """One prediction and one update; estimates (d,), costs at `places` along the first axis."""

    before: GridDensity          # posterior of the step before; at the first step the prior itself
    update: grid.GridUpdate
    y: float
    possible: bool               # False: the prior excludes y, which is then ignored
    law: Gaussian                # moments of the posterior
    mode: Array
    hit: grid.HitOrMiss
    middle: Array                # componentwise median
    places: Array                # (ESTIMATES,)
    costs: Array                 # (3, ESTIMATES): squared, absolute, miss; other coordinate at that cost's minimum
    least: Array                 # (3, d): the minimisers


class Result(NamedTuple):
    """Step 0 has no measurement: its posterior is the prior."""

    steps: tuple[Step, ...]      # STEPS + 1


def compute(p: Params, progress: Progress) -> Result:
    """Predicts (from the second step on) and updates, and minimises the costs."""
    if p.space == "line":
        motion, delta = constant_position(1.0, p.sigma_w, 1), p.delta
        density = _start(p)
    else:
        motion, delta = constant_position(1.0, p.sigma_w_m, 2), p.delta_m
        density = grid.from_gaussian(Gaussian(np.array(p.prior_mean), PRIOR_SIGMA_M**2 * np.eye(2)), PLANE)
    nothing = grid.multiply(density, np.zeros(density.weights.shape))
    steps = [_estimate(density, nothing, 0.0, True, delta)]
    for k in range(STEPS):
        before = density
        prior = density if k == 0 else grid.predict(density, motion)
        sensor, y = measurement(p, k)
        try:
            update, possible = grid.update(prior, y, sensor), True
        except ValueError:                                 # the noise is bounded: y may contradict the prior
            update, possible = grid.GridUpdate(prior, np.zeros(prior.weights.shape), prior, -np.inf), False
        density = update.posterior
        steps.append(_estimate(before, update, float(y[0]), possible, delta))
        progress((k + 1) / STEPS)
    return Result(tuple(steps))


def _start(p: Params) -> GridDensity:
    """Uniform on (0, 3 pi), or 0.6 N(0, 1) + 0.4 N(5, 0.5^2)."""
    if p.prior == "uniform":
        inside = (LINE[0] > 0.0) & (LINE[0] < 3.0 * np.pi)
        return GridDensity(LINE, inside.astype(np.float64))
    logs = log_density(PEAKS, grid.mesh(WIDER)[:, None, :])
    return GridDensity.from_log_weights(WIDER, np.logaddexp(np.log(0.6) + logs[:, 0], np.log(0.4) + logs[:, 1]))


def measurement(p: Params, k: int) -> tuple[Sensor, Array]:
    """The sensor of step k, counted from 0, and what it says."""
    if p.space == "line":
        wave = Wave(p.width)
        sensor: Sensor = UniformNoise(wave, p.width) if p.noise == "uniform" else wave
        return sensor, np.array([(p.y1, p.y2, p.y3)[k]])
    ranges = Range(np.array([p.station_1 if k % 2 == 0 else p.station_2]), p.sigma_m)
    return ranges, ranges.h(np.array(p.target))


def _estimate(before: GridDensity, update: grid.GridUpdate, y: float, possible: bool, delta: float) -> Step:
    post = update.posterior
    law, hit = grid.moments(post), grid.hit_or_miss(post, delta)
    middle, mode = grid.median(post), grid.mode(post)
    axis = post.axes[0]
    places = np.linspace(axis[0], axis[-1], ESTIMATES)

    def along(through: Array) -> Array:
        """Places on the line parallel to the first axis through a point."""
        return np.column_stack([places, *(np.full(ESTIMATES, v) for v in through[1:])])

    squared = np.trace(grid.mean_square_error(law, along(law.mean)), axis1=-2, axis2=-1)
    absolute = grid.expected_loss(post, along(middle), lambda e: np.sqrt(np.square(e).sum(axis=-1)))
    row = hit.hits if post.dim == 1 else hit.hits[:, int(np.argmin(np.abs(post.axes[1] - hit.x[1])))]
    miss = 1.0 - np.interp(places, axis, row)
    least = np.array([law.mean, [places[absolute.argmin()], *middle[1:]], hit.x])
    return Step(before, update, y, possible, law, mode, hit, middle, places, np.array([squared, absolute, miss]), least)


def timeline(p: Params) -> Timeline:
    """Three measurements; the first is that of exercise 3.10."""
    return Timeline(STEPS, ("predict", "likelihood", "update", "estimate"), start=1)


_LINE = {"prior", "noise", "width", "y1", "y2", "y3", "sigma_w", "delta"}
_PLANE = {"target", "prior_mean", "station_1", "station_2", "sigma_m", "sigma_w_m", "delta_m"}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=lambda p: _PLANE if p.space == "line" else _LINE,
    refs=("MAT 3.4", "MAT (3.18)-(3.20)", "MAT exercise 3.9", "MAT exercise 3.10"),
    presets={
        "exercise 3.10": {},
        "normal noise": {"noise": "normal", "width": 0.3, "y1": 0.6},
        "three measurements": {"noise": "normal", "width": 0.25, "y1": 0.5, "step": 3},
        "three estimates, three answers": {"prior": "peaks", "step": 0},
        "δ small: the mode": {"noise": "normal", "width": 0.3, "y1": 0.9, "y2": 0.2, "delta": 0.05, "step": 2},
        "δ large": {"noise": "normal", "width": 0.3, "y1": 0.9, "y2": 0.2, "delta": 4.5, "step": 2},
        "in the plane": {"space": "plane", "step": 1},
        "in the plane, two ranges": {"space": "plane", "step": 2},
    },
)
