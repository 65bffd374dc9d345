"""The Kalman filter on a track with constant velocity.  MAT 3.1, 3.2, Algorithm 3, Example 20, Figure 3.1."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import kalman
from core.gaussian import chi_square_level, mahalanobis_squared, sample
from core.motion import LinearMotion, constant_velocity
from core.sensors import Position
from core.types import Array, Gaussian
from lessons.filtering._kalman_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider

STEPS = 60
RUNS = 100                               # tracks behind the mean NEES; the first one is drawn
START = np.array([0.0, 0.0, 5.0, 0.0])   # m and m/s: (3.14)


@dataclass(frozen=True, slots=True)
class Params:
    """What really happens, and how the filter's assumptions differ from it (1: it knows the truth)."""

    sigma_x_m: float = slider(30.0, low=1.0, high=200.0, step=1.0, unit="m", group="truth")
    sigma_y_m: float = slider(50.0, low=1.0, high=200.0, step=1.0, unit="m", group="truth")
    sigma_c: float = slider(1.0, low=0.01, high=10.0, unit="m/s/√s", log=True, group="truth")
    r_ratio: float = slider(1.0, low=0.05, high=20.0, log=True, group="filter")
    q_ratio: float = slider(1.0, low=0.01, high=100.0, log=True, group="filter")
    p0_ratio: float = slider(1.0, low=0.05, high=20.0, log=True, group="filter")
    dt_s: float = slider(1.0, low=0.2, high=5.0, step=0.1, unit="s", group="more")
    start_sigma_m: float = slider(10.0, low=1.0, high=200.0, step=1.0, unit="m", group="more")
    start_sigma_mps: float = slider(3.0, low=0.5, high=50.0, step=0.5, unit="m/s", group="more")
    seed: int = seed(805, group="more")
    axis: str = choice("x", ("x", "y"), group="view")


class Result(NamedTuple):
    """One track in full, and how consistent the filter is over many."""

    truth: Array                 # (STEPS + 1, 4)
    y: Array                     # (STEPS, 2)
    initial: Gaussian            # what the filter starts from
    updates: kalman.Update       # every field (STEPS, ...)
    steady: kalman.Update        # where the same filter ends after infinitely many steps
    nis: Array                   # (STEPS,) nu' S^-1 nu
    mean_nees: Array             # (STEPS,) (x - x_hat)' P^-1 (x - x_hat), mean over RUNS
    nees_band: Array             # (2,) where 95 % of such means lie if the filter is consistent


def compute(p: Params, progress: Progress) -> Result:
    """Draws RUNS tracks with the true model and filters them with the assumed one."""
    begin, move, measure = np.random.default_rng(p.seed).spawn(3)
    sigma_m = np.array([p.sigma_x_m, p.sigma_y_m])
    start_sigma = np.repeat([p.start_sigma_m, p.start_sigma_mps], 2)
    world = constant_velocity(p.dt_s, p.sigma_c, 2)

    truth = np.empty((STEPS + 1, RUNS, 4))
    truth[0] = sample(Gaussian(START, np.diag(start_sigma**2)), RUNS, begin)
    for k in range(STEPS):
        truth[k + 1] = world.sample(truth[k], move)                          # (3.4)
    y = truth[1:, :, :2] + sigma_m * measure.standard_normal((STEPS, RUNS, 2))  # (3.5)
    progress(0.2)

    initial = Gaussian(START, np.diag((p.p0_ratio * start_sigma)**2))
    motion = constant_velocity(p.dt_s, p.q_ratio * p.sigma_c, 2)
    sensor = Position(2, p.r_ratio * sigma_m)
    every = kalman.run(initial, y, motion, sensor)                           # Algorithm 3
    one = kalman.run(initial, y[:, 0], motion, sensor)
    progress(0.9)
    nees = mahalanobis_squared(every.posterior, truth[1:])
    nis = mahalanobis_squared(Gaussian(one.innovation, one.innovation_cov), np.zeros((STEPS, 2)))
    return Result(truth[:, 0], y[:, 0], initial, one, _steady(motion, sensor), nis, nees.mean(axis=1),
                  chi_square_level(np.array([0.025, 0.975]), 4 * RUNS) / RUNS)


def _steady(motion: LinearMotion, sensor: Position) -> kalman.Update:
    """P = Phi (I - K H) P Phi' + Q: the update from the prior covariance that reproduces itself."""
    from scipy.linalg import solve_discrete_are

    origin = np.zeros(4)
    P = solve_discrete_are(motion.Phi.T, sensor.jacobian(origin).T, motion.Q, sensor.R)
    return kalman.update(Gaussian(origin, (P + P.T) / 2), np.zeros(2), sensor)


def timeline(p: Params) -> Timeline:
    """One minute of measurements at the default; a step in its middle with a clear innovation is shown first."""
    return Timeline(STEPS, ("predict", "innovation", "gain", "update"), start=36, scale=p.dt_s, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("MAT 3.1", "MAT 3.2", "MAT Algorithm 3", "MAT Example 20", "MAT Figure 3.1", "MAT (3.14)"),
    presets={
        "Example 20": {},
        "trusts the measurements too much": {"r_ratio": 0.2},
        "trusts the model too much": {"q_ratio": 0.05, "axis": "y", "step": 45},
        # 0.2 times these is P0 of Example 20, so the covariances are the same; at this seed the start is far off.
        "optimistic P0": {"start_sigma_m": 50.0, "start_sigma_mps": 15.0, "p0_ratio": 0.2, "seed": 265, "step": 4},
    },
)
