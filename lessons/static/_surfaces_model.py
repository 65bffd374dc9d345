"""The measurements of the lesson on surfaces: one row each, with what it measures and what came out."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.gauss_newton import gauss_newton_batch
from core.sensors import Bearing, Linear, Range, RangeDifference, RangeRate, Stack
from core.types import Array, Sensor
from lessons.kit.roles import Role

if TYPE_CHECKING:
    from lessons.static.measurement_surfaces import Params

KINDS = ("none", "x1", "x2", "height", "range", "pseudorange", "difference", "bearing", "radar")
ROLES: tuple[Role, ...] = ("measurement", "likelihood", "vector")
RATE_ROLE: Role = "innovation"
ROWS = 4                                     # at most: a radar makes two of them


@dataclass(frozen=True, slots=True, eq=False)
class RateAlone:
    """The range rate as a function of the position only: velocities are known."""

    rate: RangeRate
    velocity_mps: Array          # (n,) of the user

    @property
    def R(self) -> Array:
        return self.rate.R

    def _state(self, x: Array) -> Array:
        return np.concatenate([x, np.broadcast_to(self.velocity_mps, x.shape)], axis=-1)

    def h(self, x: Array) -> Array:
        """(x - s)'(u - u_s) / |x - s|, shape (..., 1), in m/s."""
        return self.rate.h(self._state(x))

    def jacobian(self, x: Array) -> Array:
        """Its derivative by the position, shape (..., 1, n)."""
        return self.rate.jacobian(self._state(x))[..., :x.shape[-1]]

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat."""
        return self.rate.innovation(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """log p(y | x), shape (...)."""
        return self.rate.log_likelihood(y, self._state(x))


class Row(NamedTuple):
    """One measurement equation of the position x (n,)."""

    kind: str                    # as in KINDS, but "range" and "rate" for the two of a radar
    slot: int                    # 0, 1, 2: which of the chosen measurements
    sensor: Sensor               # one row, without clock bias
    stations: Array              # (k, n) in m
    exact: float                 # h(x) of the true place and clock
    y: float                     # with the error; m, rad or m/s
    sigma: float
    role: Role

    def target(self, assumed_m: float) -> float:
        """What h(x) must be when the clock bias is taken to be `assumed_m`."""
        return self.y - assumed_m if self.kind == "pseudorange" else self.y

    def residual(self, x: Array, assumed_m: float) -> Array:
        """h(x) - target, shape (...), angles wrapped."""
        return -self.sensor.innovation(np.array([self.target(assumed_m)]), self.sensor.h(x))[..., 0]


def truth_of(p: "Params") -> Array:
    """The true place (n,) in m."""
    return np.array([*p.user, p.height_m] if p.space == "space" else p.user)


def stations_of(p: "Params") -> Array:
    """All three stations (3, n) in m."""
    flat = np.array([p.station_1, p.station_2, p.station_3])
    return np.column_stack([flat, [p.height_1_m, p.height_2_m, p.height_3_m]]) if p.space == "space" else flat


def velocity_of(p: "Params", n: int) -> Array:
    """The user's velocity (n,) in m/s; it moves horizontally."""
    return np.array([p.velocity_1_mps, p.velocity_2_mps, 0.0])[:n]


def antenna(p: "Params", hub: Array, time_s: float) -> tuple[Array, Array]:
    """Place and velocity of the antenna at the end of the arm: arm [cos t, sin t] and its derivative."""
    turn = np.zeros((2, len(hub)))
    turn[:, :2] = p.arm_m * np.array([[np.cos(time_s), np.sin(time_s)], [-np.sin(time_s), np.cos(time_s)]])
    return hub + turn[0], turn[1]


def standard_errors(p: "Params") -> Array:
    """(ROWS,) standard normal, or zero."""
    return np.random.default_rng(p.seed).standard_normal(ROWS) if p.noisy else np.zeros(ROWS)


def rows_of(p: "Params", errors: Array, time_s: float) -> list[Row]:
    """The equations of the chosen measurements."""
    x, all_stations = truth_of(p), stations_of(p)
    found: list[Row] = []

    def add(kind: str, slot: int, sensor: Sensor, stations: Array, sigma: float, role: Role, bias: float = 0.0) -> None:
        exact = float(sensor.h(x)[0]) + bias
        found.append(Row(kind, slot, sensor, stations, exact, exact + sigma * float(errors[len(found)]), sigma, role))

    for slot, kind in enumerate((p.first, p.second, p.third)):
        one, role = all_stations[[slot]], ROLES[slot]
        match kind:
            case "x1" | "x2" | "height":
                axis = ("x1", "x2", "height").index(kind)
                if axis < len(x):
                    add(kind, slot, Linear(np.eye(len(x))[[axis]], p.sigma_m**2), one[:0], p.sigma_m, role)
            case "range":
                add(kind, slot, Range(one, p.sigma_m), one, p.sigma_m, role)
            case "pseudorange":
                add(kind, slot, Range(one, p.sigma_m), one, p.sigma_m, role, p.bias_m)
            case "difference":
                two = all_stations[[slot, (slot + 1) % 3]]
                add(kind, slot, RangeDifference(two, p.sigma_m), two, p.sigma_m, role)
            case "bearing":
                sigma = float(np.radians(p.sigma_deg))
                add(kind, slot, Bearing(one, sigma), one, sigma, role)
            case "radar":
                place, moving = antenna(p, one[0], time_s)
                add("range", slot, Range([place], p.sigma_m), place[None], p.sigma_m, role)
                rate = RangeRate([place], p.sigma_mps, [moving])
                add("rate", slot, RateAlone(rate, velocity_of(p, len(x))), place[None], p.sigma_mps, RATE_ROLE)
    return found


def best_places(rows: list[Row], starts: Array, assumed_m: Array) -> tuple[Array, Array]:
    """Places (..., n) that explain the rows best, and whether they were found; assumed_m broadcasts with the starts."""
    assumed = np.asarray(assumed_m, dtype=np.float64)[..., None]
    y = np.array([row.y for row in rows]) - assumed * np.array([row.kind == "pseudorange" for row in rows])
    try:
        runs = gauss_newton_batch(Stack(tuple(row.sensor for row in rows)), y, starts, tolerance=1e-7, damping=1e-3)
    except ValueError:
        return np.broadcast_to(starts, (*np.broadcast_shapes(y.shape[:-1], starts.shape[:-1]), starts.shape[-1])), \
            np.zeros(np.broadcast_shapes(y.shape[:-1], starts.shape[:-1]), dtype=bool)
    return runs.x, runs.converged


def bias_curve(p: "Params", errors: Array, biases_m: Array) -> Array | None:
    """Rms misfit, in sigmas times sigma_m, of the best place for every assumed bias.

    None without a pseudorange, or if there are so few measurements that a range of biases explains them all.
    """
    rows, x = rows_of(p, errors, 0.0), truth_of(p)
    if p.first == "radar" or not any(row.kind == "pseudorange" for row in rows) or len(rows) <= len(x):
        return None
    places, _ = best_places(rows, x, biases_m)
    off = np.stack([[row.residual(place, b) / row.sigma for row in rows]
                    for place, b in zip(places, biases_m, strict=True)])
    return p.sigma_m * np.sqrt(np.square(off).mean(axis=1))


def radar_curve(p: "Params", times_s: Array) -> Array | None:
    """Range (m) and range rate (m/s) of the radar over the time, without errors; None without a radar."""
    if p.first != "radar":
        return None
    hub, x = stations_of(p)[0], truth_of(p)
    found = []
    for t in times_s:
        place, moving = antenna(p, hub, float(t))
        rate = RateAlone(RangeRate([place], 1.0, [moving]), velocity_of(p, len(x)))
        found.append((np.linalg.norm(x - place), rate.h(x)[0]))
    return np.array(found)
