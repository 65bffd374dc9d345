"""A stiff and a flexible Kalman filter on the same random walk.  KF thesis chapter 4, Tables 4.1-4.2, Figures 4.1-4.4.

The thesis's choices are kept apart here, so that its table can be shown as printed and as corrected (errata K8-K11).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from core import kalman
from core.metrics import rmse
from core.motion import constant_velocity
from core.random_walk import Setting, cross_track_sigma, random_walk, start, track
from core.sensors import Position
from core.types import Array, Gaussian
from lessons.bayes_kalman._random_walk_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider, switch

POINTS = 100                             # n of Table 4.1
RUNS = 100                               # walks behind every mean; the first one is drawn
SIGMAS = np.geomspace(1e-3, 1.0, 16)     # m/s per square root of a second: the curve of RMSE against sigma_xy
WINDOW = 10                              # how far the walk turned: the last 10 steps against the 10 before
TURNS_DEG = np.array([0.0, 2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0, 40.0, 60.0])
FEWEST = 20                              # moments that a mean over them needs to be shown
START_MPS = {"slow": (3.0, 4.0), "fast": (15.0, 25.0), "true": (1.0, 0.0)}


@dataclass(frozen=True, slots=True)
class Params:
    """Both filters, what they share, and the walk; the default is the table as it is printed."""

    sigma_stiff: float = slider(0.01, low=0.001, high=1.0, unit="m/s/√s", log=True, group="filters")
    sigma_flexible: float = slider(0.1, low=0.001, high=1.0, unit="m/s/√s", log=True, group="filters")
    v0_stiff: str = choice("slow", tuple(START_MPS), group="filters")
    v0_flexible: str = choice("fast", tuple(START_MPS), group="filters")
    R_x_m: float = slider(1.0, low=0.2, high=10.0, step=0.1, unit="m", group="both")
    R_y_m: float = slider(4.0, low=0.2, high=10.0, step=0.1, unit="m", group="both")
    start_twice: bool = switch(True, group="both")
    world: str = choice("headings", ("headings", "model"), group="truth")
    spread_deg: float = slider(5.0, low=0.0, high=15.0, step=0.5, unit="°", group="truth")
    noise_x_m: float = slider(1.0, low=0.0, high=10.0, step=0.1, unit="m", group="truth")
    noise_y_m: float = slider(1.0, low=0.0, high=10.0, step=0.1, unit="m", group="truth")
    seed: int = seed(69, group="truth")
    axis: str = choice("y", ("x", "y"), group="view")


class Track(NamedTuple):
    """One filter on the drawn walk, and how it does over all of them."""

    setting: Setting
    start: Gaussian              # what the filter starts from
    steps: kalman.Update         # every field (T, ...): the drawn walk
    errors: Array                # (T, 2) estimate - truth of it
    rmse: float                  # of the position in it, m
    mean_rmse: Array             # (3,) over RUNS walks: position, x, y, m
    spread: Array                # (T, 2) root mean square error over the walks at each step
    by_turn: Array               # (bins,) root mean square position error where the walk turned that much; NaN: too few
    steady_gain: Array           # (2,) where K_11 and K_22 end after infinitely many steps
    steady_sd_m: Array           # (2,) the same for the standard deviations


class Result(NamedTuple):
    """The walk, both filters on it, and the mean over many walks for any process noise."""

    truth: Array                 # (POINTS, 2)
    y: Array                     # (POINTS, 2)
    offset: int                  # the estimate after step k belongs to truth[k - 1 + offset]
    stiff: Track
    flexible: Track
    raw_rmse: Array              # (3,) measurements over all walks: position, x, y, m
    curve: Array                 # (len(SIGMAS), 3) mean RMSE: position, x, y, m, with the stiff filter's start
    world_sigma: float           # the process noise that the walk's turns amount to


def compute(p: Params, progress: Progress) -> Result:
    """Draws RUNS walks with their noise and gives every filter the same ones."""
    go, measure = np.random.default_rng(p.seed).spawn(2)
    truth = walks(p, go)
    ys = truth + measure.standard_normal(truth.shape) * [p.noise_x_m, p.noise_y_m]
    shared = Setting(R_sd_m=(p.R_x_m, p.R_y_m), start_twice=p.start_twice, v0_mps=START_MPS[p.v0_stiff])
    turned = turn_deg(truth)
    stiff = follow(replace(shared, sigma_xy=p.sigma_stiff), truth, ys, turned)
    flexible = follow(replace(shared, sigma_xy=p.sigma_flexible, v0_mps=START_MPS[p.v0_flexible]), truth, ys, turned)
    curve = np.empty((len(SIGMAS), 3))
    for i, sigma in enumerate(SIGMAS):
        progress(0.2 + 0.8 * i / len(SIGMAS))
        curve[i] = mean_rmse(errors_of(track(ys, replace(shared, sigma_xy=float(sigma))), truth))
    return Result(truth[:, 0], ys[:, 0], 0 if p.start_twice else 1, stiff, flexible, mean_rmse(ys - truth), curve,
                  cross_track_sigma(p.spread_deg))


def walks(p: Params, rng: np.random.Generator) -> Array:
    """True positions (POINTS, RUNS, 2), time first."""
    if p.world == "headings":
        return np.moveaxis(random_walk(POINTS, rng, (RUNS,), p.spread_deg).points, -2, 0)
    motion = constant_velocity(1.0, cross_track_sigma(p.spread_deg), 2)      # erratum K11: what the text promises
    x = np.tile([0.0, 0.0, 1.0, 0.0], (RUNS, 1))
    states = [x]
    for _ in range(POINTS - 1):
        states.append(motion.sample(states[-1], rng))
    return np.array(states)[..., :2]


def follow(setting: Setting, truth: Array, ys: Array, turned: Array) -> Track:
    """One filter on all walks (POINTS, RUNS, 2)."""
    every = track(ys, setting)
    errors = errors_of(every, truth)
    squares = np.square(errors).sum(axis=-1)[len(errors) - len(turned):]
    bins = np.digitize(turned, TURNS_DEG) - 1
    by_turn = [np.sqrt(squares[bins == i].mean()) if (bins == i).sum() >= FEWEST else np.nan
               for i in range(len(TURNS_DEG) - 1)]
    gains, sds = zip(*(steady(setting, axis) for axis in (0, 1)), strict=True)
    return Track(setting, start(ys[0, 0], setting), track(ys[:, 0], setting), errors[:, 0],
                 float(rmse(errors[:, 0], np.zeros(2))), mean_rmse(errors), np.sqrt(np.square(errors).mean(axis=1)),
                 np.array(by_turn), np.array(gains), np.array(sds))


def errors_of(steps: kalman.Update, truth: Array) -> Array:
    """Estimated minus true position (T, ..., 2); a start with its own measurement makes one step more."""
    return steps.posterior.mean[..., :2] - truth[len(truth) - len(steps.y_hat):]


def mean_rmse(errors: Array) -> Array:
    """Mean over the runs of each run's RMSE: position, x, y.  errors (T, RUNS, 2) -> (3,)."""
    each = np.square(errors).mean(axis=0)
    return np.sqrt(np.column_stack([each.sum(axis=-1), each])).mean(axis=0)


def turn_deg(truth: Array) -> Array:
    """How far the walk's direction turned: its last WINDOW steps against the ones before, (POINTS - 2 WINDOW, RUNS)."""
    d = truth[WINDOW:] - truth[:-WINDOW]
    after, before = d[WINDOW:], d[:-WINDOW]
    cross = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
    return np.abs(np.degrees(np.arctan2(cross, (before * after).sum(axis=-1))))


def steady(setting: Setting, axis: int) -> tuple[float, float]:
    """K_ii and sqrt(P_ii) after infinitely many steps; the axes do not influence each other."""
    from scipy.linalg import solve_discrete_are

    motion, sensor = constant_velocity(1.0, setting.sigma_xy, 1), Position(1, setting.R_sd_m[axis])
    P = solve_discrete_are(motion.Phi.T, sensor.jacobian(np.zeros(2)).T, motion.Q, sensor.R)
    last = kalman.update(Gaussian(np.zeros(2), (P + P.T) / 2), np.zeros(1), sensor)
    return float(last.gain[0, 0]), float(np.sqrt(last.posterior.cov[0, 0]))


def timeline(p: Params) -> Timeline:
    """One step for each measurement that is filtered; the first picture is in the turn."""
    return Timeline(POINTS if p.start_twice else POINTS - 1, ("predict", "gain", "update"), start=85, unit_name="k")


AS_CORRECTED = {"v0_stiff": "fast", "v0_flexible": "slow", "start_twice": False}
LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("KF thesis 4.1-4.2", "KF thesis (4.1)-(4.7)", "KF thesis Tables 4.1, 4.2", "KF thesis Figures 4.1-4.4"),
    presets={
        "Table 4.2 as printed": {},
        "K8: start velocities swapped": {"v0_stiff": "fast", "v0_flexible": "slow", "step": 4},
        "K9: the filters know the noise (R = I)": {"R_y_m": 1.0},
        "K9: the noise is as assumed (4 m in y)": {"noise_y_m": 4.0},
        "K10: the first sample only once": {"start_twice": False, "step": 1},
        "K11: a walk from the filters' model": {"world": "model", "R_y_m": 1.0},
        "Table 4.2 as corrected": {**AS_CORRECTED, "R_y_m": 1.0},
        "a straight walk": {**AS_CORRECTED, "R_y_m": 1.0, "spread_deg": 0.5},
    },
)
