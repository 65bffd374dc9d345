"""How people walk: the parameters of the motion model, and the laws of speed and heading.  GBPF 5.1, details ours."""

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.indoor.choice import check_rule
from core.types import Array


@dataclass(frozen=True, slots=True)
class Walk:
    """v_t = clamp(v_{t-1} + sigma_v sqrt(dt) xi, v_min, v_max),  alpha_t = alpha_{t-1} + sigma_alpha sqrt(dt) xi.

    sigma_v_mps, sigma_heading_rad: per square root of a second; the heading matters in open areas only.  turn_rate_hz:
    sharp turns, reversing on a link; stop_rate_hz: stops; go_rate_hz: a stopped walker goes on with a speed drawn from
    U(start_speeds_mps).  rule, l_max_m, u_turn: `core.indoor.choice_probabilities`.  capture_radius_m: so near an
    accessor node a walker in an area decides about leaving through it, and not again before having been twice as far.
    entry_sigma_rad: spread of the heading on entering an area.  stairs_factor slows the walk on stairs; a lift comes
    after an exponential time of mean lift_wait_s and rides at lift_speed_mps.  ValueError for values out of range.

    The notation list of the thesis names sigma_v, sigma_alpha, v_min, v_max and l_max; all numbers are ours.
    """

    sigma_v_mps: float = 0.15
    sigma_heading_rad: float = math.radians(25.0)
    v_min_mps: float = 0.0
    v_max_mps: float = 2.0
    start_speeds_mps: tuple[float, float] = (0.4, 1.6)
    turn_rate_hz: float = 0.005
    stop_rate_hz: float = 0.01
    go_rate_hz: float = 0.1
    rule: str = "tll"
    l_max_m: float | None = 100.0
    u_turn: float = 0.0
    capture_radius_m: float = 1.5
    entry_sigma_rad: float = math.radians(45.0)
    stairs_factor: float = 0.6
    lift_speed_mps: float = 1.0
    lift_wait_s: float = 15.0

    def __post_init__(self) -> None:
        check_rule(self.rule, self.l_max_m, self.u_turn)
        for f in fields(self):
            value = getattr(self, f.name)
            if f.type in (float, "float") and not float(finite(f.name, value)) >= 0.0:
                raise ValueError(f"{f.name}: expected a number >= 0, got {value}")
        low, high = finite("start_speeds_mps", self.start_speeds_mps, 2)
        if not self.v_min_mps <= self.v_max_mps or not 0.0 <= low <= high:
            raise ValueError(f"v_min_mps <= v_max_mps and start_speeds_mps = (low, high) expected, got "
                             f"{self.v_min_mps}, {self.v_max_mps} and {self.start_speeds_mps}")
        for name in ("stairs_factor", "lift_speed_mps", "capture_radius_m"):
            if getattr(self, name) == 0.0:
                raise ValueError(f"{name}: expected a positive number, got 0")


def clamped_speed(v: ArrayLike, xi: ArrayLike, dt_s: float, walk: Walk) -> Array:
    """min(max(v + sigma_v sqrt(dt) xi, v_min), v_max).

    v (...) in m/s, xi (...) standard normal -> (...).  Speeds cut off at 0 stand still for a moment.

    >>> clamped_speed(1.5, [2.0, -6.0], 1.0, Walk(sigma_v_mps=0.3)).tolist()
    [2.0, 0.0]
    """
    v = np.asarray(v) + walk.sigma_v_mps * math.sqrt(dt_s) * np.asarray(xi)
    return np.clip(v, walk.v_min_mps, walk.v_max_mps)


def chance(rate_hz: float, dt_s: float) -> float:
    """1 - exp(-rate dt): at least one event of a Poisson process."""
    return -math.expm1(-rate_hz * dt_s)
