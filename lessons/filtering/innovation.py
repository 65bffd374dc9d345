"""What the innovation tells: garbage among the measurements, and wrong beliefs about the noise.  MAT 3.2."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import adaptive, innovation, kalman
from core.gaussian import chi_square_level, sample
from core.linalg import cholesky_positive, solve_vectors
from core.motion import constant_velocity
from core.sensors import Position
from core.types import Array, Gaussian
from lessons.filtering._innovation_view import LAGS, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

STEPS = 60
RUNS = 100                                               # tracks behind the means; the first one is drawn
INITIAL = Gaussian(np.array([0.0, 0.0, 5.0, 0.0]), np.diag([10.0, 10.0, 3.0, 3.0])**2)    # (3.14), 1 s a step


@dataclass(frozen=True, slots=True)
class Params:
    """Garbage among the measurements, what the filter does about it, and what it believes of the noise."""

    treatment: str = choice("gate", ("plain", "gate", "adaptive"), group="filter")
    gate_percent: float = slider(99.0, low=50.0, high=99.9, step=0.1, unit="%", group="filter")
    memory: float = slider(0.9, low=0.5, high=0.99, step=0.01, group="filter")
    garbage_step: int = slider(38, low=0, high=STEPS, group="garbage")
    garbage: Point = draggable((600.0, 40.0), low=-2000.0, high=2000.0, group="garbage")
    share_percent: float = slider(10.0, low=0.0, high=40.0, step=1.0, unit="%", group="garbage")
    garbage_m: float = slider(200.0, low=50.0, high=1000.0, step=10.0, unit="m", group="garbage")
    r_ratio: float = slider(1.0, low=0.05, high=20.0, log=True, group="belief")
    q_ratio: float = slider(1.0, low=0.01, high=100.0, log=True, group="belief")
    sigma_x_m: float = slider(30.0, low=1.0, high=200.0, step=1.0, unit="m", group="more")
    sigma_y_m: float = slider(50.0, low=1.0, high=200.0, step=1.0, unit="m", group="more")
    sigma_c: float = slider(1.0, low=0.01, high=10.0, unit="m/s/√s", log=True, group="more")
    seed: int = seed(96, group="more")
    axis: str = choice("x", ("x", "y"), group="view")


class Filtered(NamedTuple):
    """A run with its test: arrays with a leading time axis, and one of the runs where there are many."""

    step: kalman.Update
    nis: Array                   # (STEPS, ...)
    accepted: Array              # (STEPS, ...) used for the update
    R: Array                     # (STEPS, ..., 2, 2) the noise that the filter works with


class Result(NamedTuple):
    """One track with the chosen filter and the plain one, and the statistics of many."""

    initial: Gaussian            # what the filters start from
    truth: Array                 # (STEPS + 1, 4)
    y: Array                     # (STEPS, 2)
    garbage: Array               # (STEPS,) which of them are garbage
    used: Filtered
    plain: Filtered
    level: float                 # NIS that a right model's measurement stays below with the gate's probability
    correlation: Array           # (LAGS,) of neighbouring innovations on this track, lags 1, 2, ...
    many_correlation: Array      # (LAGS,) mean over RUNS tracks
    many_nis: float              # mean over RUNS tracks of the accepted measurements' NIS


def compute(p: Params, progress: Progress) -> Result:
    """Draws RUNS tracks, spoils some of their measurements, and filters them."""
    begin, move, measure, spoil, where = np.random.default_rng(p.seed).spawn(5)
    world = constant_velocity(1.0, p.sigma_c, 2)
    truth = np.empty((STEPS + 1, RUNS, 4))
    truth[0] = sample(INITIAL, RUNS, begin)
    for k in range(STEPS):
        truth[k + 1] = world.sample(truth[k], move)                          # (3.4)
    sigma_m = np.array([p.sigma_x_m, p.sigma_y_m])
    y = truth[1:, :, :2] + sigma_m * measure.standard_normal((STEPS, RUNS, 2))  # (3.5)
    # The same draws for every share: with a larger one there is more garbage, and the old garbage stays.
    garbage = spoil.random((STEPS, RUNS)) < p.share_percent / 100.0
    y = np.where(garbage[..., None], truth[1:, :, :2] + p.garbage_m * where.standard_normal(y.shape), y)
    if p.garbage_step:
        garbage[p.garbage_step - 1, 0] = True
        y[p.garbage_step - 1, 0] = p.garbage
    progress(0.3)

    used = filtered(p, y[:, 0], p.treatment)
    plain = used if p.treatment == "plain" else filtered(p, y[:, 0], "plain")
    progress(0.5)
    many = filtered(p, y, p.treatment)
    progress(0.9)
    return Result(
        INITIAL, truth[:, 0], y[:, 0], garbage[:, 0], used, plain, float(chi_square_level(p.gate_percent / 100.0, 2)),
        correlation(used)[:, 0], correlation(many).mean(axis=1), float(many.nis[many.accepted].mean()))


def filtered(p: Params, y: Array, treatment: str) -> Filtered:
    """The filter with the noise that it believes in, on measurements (STEPS, 2) or (STEPS, RUNS, 2)."""
    motion = constant_velocity(1.0, p.q_ratio * p.sigma_c, 2)
    sensor = Position(2, p.r_ratio * np.array([p.sigma_x_m, p.sigma_y_m]))
    R = np.broadcast_to(sensor.R, (*y.shape, 2))
    if treatment == "gate":
        tested = innovation.run(INITIAL, y, motion, sensor, p.gate_percent / 100.0)
        return Filtered(tested.step, tested.nis, tested.accepted, R)
    if treatment == "adaptive":
        learnt = adaptive.run(INITIAL, y, motion, sensor, p.memory)
        return Filtered(learnt.step, innovation.nis(learnt.step), np.full(y.shape[:-1], True), learnt.R)
    step = kalman.run(INITIAL, y, motion, sensor)
    return Filtered(step, innovation.nis(step), np.full(y.shape[:-1], True), R)


def correlation(f: Filtered) -> Array:
    """r_j = mean e_k' e_{k+j} / mean e_k' e_k,  e = L^-1 nu,  S = L L':  0 for every lag if the filter is right.

    (LAGS, runs), over the accepted measurements.  Both axes count: with n steps the standard deviation is about
    1 / sqrt(2 n) for a right filter.
    """
    u = f.step
    e = solve_vectors(cholesky_positive("S", u.innovation_cov), u.innovation).reshape(STEPS, -1, 2)
    ok = f.accepted.reshape(STEPS, -1)
    e = np.where(ok[..., None], e, 0.0)
    power = np.square(e).sum(axis=(0, 2)) / np.maximum(ok.sum(axis=0), 1)
    found = []
    for j in range(1, LAGS + 1):
        pairs = np.maximum((ok[j:] & ok[:-j]).sum(axis=0), 1)
        found.append((e[j:] * e[:-j]).sum(axis=(0, 2)) / pairs / np.maximum(power, 1e-300))
    return np.array(found)


def timeline(p: Params) -> Timeline:
    """One minute of measurements; the step with the user's garbage is shown first."""
    return Timeline(STEPS, ("predict", "innovation", "test", "update"), start=p.garbage_step or 38, unit="s")


def unused(p: Params) -> set[str]:
    """What has no effect at these choices."""
    found = {"memory"} if p.treatment != "adaptive" else set()
    found |= {"garbage"} if p.garbage_step == 0 else set()
    return found | ({"garbage_m"} if p.share_percent == 0 else set())


# At this seed one track alone shows what is wrong in each of the four cases.
CLEAN = {"treatment": "plain", "garbage_step": 0, "share_percent": 0.0, "seed": 15, "step": STEPS}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 3.2", "MAT exercise 3.1", "MAT Example 20", "MAT (3.14)"),
    presets={
        "gate against garbage": {},
        "no gate": {"treatment": "plain"},
        "145 m off at the first step": {"garbage_step": 1, "garbage": (150.0, 0.0), "share_percent": 0.0, "step": 1},
        "R too small": {**CLEAN, "r_ratio": 0.3},
        "R too large": {**CLEAN, "r_ratio": 3.0},
        "Q too small": {**CLEAN, "q_ratio": 0.05},
        "Q too large": {**CLEAN, "q_ratio": 30.0},
        "R learnt from the residuals": {**CLEAN, "treatment": "adaptive", "r_ratio": 0.2, "seed": 57},
        "a gate that shuts out the truth": {"garbage_step": 0, "share_percent": 0.0, "q_ratio": 0.1,
                                            "gate_percent": 95.0, "seed": 79, "step": STEPS},
    },
)
