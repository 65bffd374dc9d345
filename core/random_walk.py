"""The simulation of the Kalman filter thesis: a walk with random headings, tracked by a six-state filter.

The thesis mixes three things that this module keeps apart: the start velocity (erratum K8), the process noise, and the
measurement noise, which is drawn with one standard deviation and assumed with another (K9).  The walk is not drawn
from the filter's model (K11).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import checks
from core.kalman import Update, run
from core.motion import LinearMotion, constant_velocity
from core.sensors_linear import Position
from core.types import Array, Gaussian


class Walk(NamedTuple):
    """points (..., n, 2) in metres; headings_deg (..., n - 1) of the steps; reset (..., n - 1): was it set back?"""

    points: Array
    headings_deg: Array
    reset: Array


class Simulation(NamedTuple):
    """walk; ys (n, ..., 2) measured positions, time first; steps of the filter; errors (T, ..., 2) estimate - truth."""

    walk: Walk
    ys: Array
    steps: Update
    errors: Array


@dataclass(frozen=True, slots=True)
class Setting:
    """One column of the thesis's Table 4.2 with the rest of its choices, every one of them free.

    sigma_xy, sigma_z: process noise (m/s per square root of a second); v0_mps: start velocity; R_sd_m: measurement
    noise the filter assumes; noise_sd_m: the noise that is drawn; start_twice: the first measurement both starts the
    filter and updates it one step later, as printed (erratum K10), instead of filtering from the second one on.
    """

    sigma_xy: float = 0.01
    v0_mps: tuple[float, float] = (3.0, 4.0)
    R_sd_m: tuple[float, float] = (1.0, 4.0)
    noise_sd_m: tuple[float, float] = (1.0, 1.0)
    sigma_z: float = 0.0
    dt_s: float = 1.0
    start_twice: bool = True


STIFF = Setting()                                         # Table 4.2 as printed; its v0 may belong to the other (K8)
FLEXIBLE = Setting(sigma_xy=0.1, v0_mps=(15.0, 25.0))


def walk(increments_deg: Array, limit_deg: float = 45.0, reset_deg: float = 40.0, step_m: float = 1.0) -> Walk:
    """a_k = a_{k-1} + d_k, set to +-reset if |a_k| > limit;  p_k = p_{k-1} + step [cos a_k, sin a_k].

    increments_deg (..., n - 1); starts at the origin with heading 0 along x.  KF thesis, appendix A.

    >>> walk([30.0, 20.0]).headings_deg
    array([30., 40.])
    """
    d = checks.finite("increments_deg", increments_deg, None)
    a, headings, reset = np.zeros(d.shape[:-1]), np.empty(d.shape), np.empty(d.shape, dtype=bool)
    for k in range(d.shape[-1]):
        a = a + d[..., k]
        reset[..., k] = np.abs(a) > limit_deg
        a = np.where(reset[..., k], np.copysign(reset_deg, a), a)
        headings[..., k] = a
    points = np.zeros((*d.shape[:-1], d.shape[-1] + 1, 2))
    a = np.radians(headings)
    points[..., 1:, :] = np.cumsum(step_m * np.stack([np.cos(a), np.sin(a)], axis=-1), axis=-2)
    return Walk(points, headings, reset)


def random_walk(n: int, rng: "np.random.Generator", runs: tuple[int, ...] = (), spread_deg: float = 5.0) -> Walk:
    """`walk` with n points and increments d_k ~ U(-spread, spread), for each of `runs`.

    KF thesis, appendix A.  ValueError for n < 1.
    """
    if n != int(n) or n < 1:
        raise ValueError(f"n: expected at least one point, got {n}")
    return walk(rng.uniform(-spread_deg, spread_deg, (*runs, int(n) - 1)))


def motion(setting: Setting) -> LinearMotion:
    """Six states [p_x, p_y, p_z, v_x, v_y, v_z].  KF thesis (4.1)-(4.5); Q has rank 4 for sigma_z = 0 (K7)."""
    return constant_velocity(setting.dt_s, [setting.sigma_xy, setting.sigma_xy, setting.sigma_z], 3)


def sensor(setting: Setting) -> Position:
    """y = [p_x, p_y] + r with the noise that the filter assumes.  KF thesis (4.6)-(4.7)."""
    return Position(2, setting.R_sd_m)


def start(first: Array, setting: Setting) -> Gaussian:
    """x_0 = [y_x, y_y, 0, v0, 0],  P_0 = diag(3^2 I, 10^2 I).  first (..., 2).  KF thesis, Tables 4.1-4.2."""
    first = checks.finite("first", first, 2)
    x = np.zeros((*first.shape[:-1], 6))
    x[..., :2] = first
    x[..., 3:5] = setting.v0_mps
    return Gaussian(x, np.diag([9.0] * 3 + [100.0] * 3))


def track(ys: Array, setting: Setting) -> Update:
    """The thesis's filter on measured positions ys (n, ..., 2), time first.

    n steps if the first measurement is used twice, else n - 1.  KF thesis Algorithm 1, appendix A.
    """
    ys = checks.finite("ys", ys, 2)
    if ys.ndim < 2 or len(ys) < 2:
        raise ValueError(f"ys: expected shape (n, ..., 2) with n >= 2, got {ys.shape}")
    return run(start(ys[0], setting), ys if setting.start_twice else ys[1:], motion(setting), sensor(setting))


def simulate(setting: Setting, rng: "np.random.Generator", n: int = 100, runs: tuple[int, ...] = ()) -> Simulation:
    """A walk of n points, its measurements and the filter's answer, for each of `runs`.

    KF thesis chapter 4.
    """
    path = random_walk(n, rng, runs)
    truth = np.moveaxis(path.points, -2, 0)
    ys = truth + rng.standard_normal(truth.shape) * _spread(setting.noise_sd_m)
    steps = track(ys, setting)
    return Simulation(path, ys, steps, steps.posterior.mean[..., :2] - truth[n - len(steps.y_hat):])


def cross_track_sigma(spread_deg: float = 5.0, speed_mps: float = 1.0) -> float:
    """speed * spread / sqrt(3): the velocity noise across the track that heading steps U(-spread, spread) amount to.

    >>> round(cross_track_sigma(), 4)
    0.0504
    """
    return speed_mps * math.radians(spread_deg) / math.sqrt(3.0)


def _spread(sd: tuple[float, float]) -> Array:
    sd = checks.finite("noise_sd_m", sd, 2)
    if (sd < 0).any():
        raise ValueError(f"noise_sd_m: expected non-negative numbers, got {sd.min()}")
    return sd
