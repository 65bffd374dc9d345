"""Sensors of the geometry between a user and known points: ranges, differences, bearings, range rates."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from core.distances import nonzero, offsets_to, rows_last, squared, squared_distances, unit_rows
from core.sensor_noise import NormalNoise, derived, positions, set_fields, set_noise, state, wrap_angle
from core.stacks import frozen, zero_stack
from core.types import Array


@dataclass(frozen=True, slots=True, eq=False)
class Range(NormalNoise):
    """y_i = |s_i - x| + v_i.

    stations_m (m, d), sigma_m a number or (m,).  jacobian rows are the unit vectors from the stations to the user.
    MAT Examples 14 and 16.

    >>> Range([[0, 0], [0, 50]], 1.0).h(np.array([30.0, 40.0])).round(3)
    array([50.   , 31.623])
    """

    stations_m: Array
    sigma_m: float | Array
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        set_fields(self, stations_m=positions("stations_m", self.stations_m))
        set_noise(self, "sigma_m", self.sigma_m, len(self.stations_m))

    def h(self, x: Array) -> Array:
        """|s_i - x|, shape (..., m), in metres."""
        squares = squared_distances(state(x, self.stations_m.shape[1]), self.stations_m)
        return rows_last(np.sqrt(squares, out=squares))

    def jacobian(self, x: Array) -> Array:
        """(x - s_i)' / |x - s_i|, shape (..., m, n); a zero row at the station itself."""
        return unit_rows(state(x, self.stations_m.shape[1]), self.stations_m)[0]


@dataclass(frozen=True, slots=True, eq=False)
class Pseudorange(NormalNoise):
    """y_i = |s_i - x| + b + v_i.

    satellites_m (m, d), sigma_m a number or (m,).  State: d position components, then the clock bias b in metres.
    MAT Example 14.

    >>> Pseudorange([[0, 0], [0, 50]], 1.0).h(np.array([30.0, 40.0, 5.0])).round(3)
    array([55.   , 36.623])
    """

    satellites_m: Array
    sigma_m: float | Array
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        set_fields(self, satellites_m=positions("satellites_m", self.satellites_m))
        set_noise(self, "sigma_m", self.sigma_m, len(self.satellites_m))

    def h(self, x: Array) -> Array:
        """|s_i - x| + b, shape (..., m), in metres."""
        d = self.satellites_m.shape[1]
        x = state(x, d + 1)
        rows = squared_distances(x, self.satellites_m)
        np.sqrt(rows, out=rows)
        rows += x[..., d]
        return rows_last(rows)

    def jacobian(self, x: Array) -> Array:
        """[(x - s_i)' / |x - s_i|, 1], shape (..., m, n); zero direction at the satellite itself."""
        d = self.satellites_m.shape[1]
        J, _ = unit_rows(state(x, d + 1), self.satellites_m)
        J[..., d] = 1.0
        return J


@dataclass(frozen=True, slots=True, eq=False)
class RangeDifference(NormalNoise):
    """y_i = |s_1 - x| - |s_{i+1} - x| + v_i.

    stations_m (m + 1, d): the first is the reference.  sigma_m a number or (m,), the error of each difference; errors
    are taken as independent.  MAT exercise 2.1(d).

    >>> RangeDifference([[0, 0], [70, 0]], 1.0).h(np.array([30.0, 40.0])).round(4)
    array([-6.5685])
    """

    stations_m: Array
    sigma_m: float | Array
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        stations = positions("stations_m", self.stations_m)
        if len(stations) < 2:
            raise ValueError(f"stations_m: expected at least 2 stations, got {len(stations)}")
        set_fields(self, stations_m=stations)
        set_noise(self, "sigma_m", self.sigma_m, len(stations) - 1)

    def h(self, x: Array) -> Array:
        """|s_1 - x| - |s_{i+1} - x|, shape (..., m), in metres."""
        r = np.sqrt(squared_distances(state(x, self.stations_m.shape[1]), self.stations_m))
        return rows_last(r[0] - r[1:])

    def jacobian(self, x: Array) -> Array:
        """Difference of the unit vectors from both stations, shape (..., m, n)."""
        J, _ = unit_rows(state(x, self.stations_m.shape[1]), self.stations_m)
        return J[..., :1, :] - J[..., 1:, :]


@dataclass(frozen=True, slots=True, eq=False)
class Bearing(NormalNoise):
    """y_i = atan2(x_1 - s_i1, x_2 - s_i2) + v_i  (mod 2 pi).

    Direction from the station to the user, in radians clockwise from north (the x_2 axis; x_1 is east).  stations_m
    (m, d) with d >= 2, only east and north count; sigma_rad a number or (m,).  The innovation is wrapped to (-pi, pi]
    and the likelihood is normalised over one turn.  MAT exercise 2.1(c), Fig 2.2.

    >>> np.degrees(Bearing([[0, 0]], 0.1).h(np.array([30.0, 40.0]))).round(2)
    array([36.87])
    """

    stations_m: Array
    sigma_rad: float | Array
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()
    circular: ClassVar[bool] = True

    def __post_init__(self) -> None:
        stations = positions("stations_m", self.stations_m)
        if stations.shape[1] < 2:
            raise ValueError(f"stations_m: expected at least east and north, got shape {stations.shape}")
        set_fields(self, stations_m=stations)
        set_noise(self, "sigma_rad", self.sigma_rad, len(stations))

    def h(self, x: Array) -> Array:
        """Bearing in (-pi, pi], shape (..., m); 0 at the station itself."""
        east, north = offsets_to(state(x, 2), self.stations_m[:, :2])
        return rows_last(np.arctan2(east, north))

    def jacobian(self, x: Array) -> Array:
        """[north, -east] / (east^2 + north^2), shape (..., m, n), in rad/m; a zero row at the station itself."""
        x = state(x, 2)
        east, north = offsets_to(x, self.stations_m[:, :2])
        scale = 1.0 / nonzero(east * east + north * north)
        J = zero_stack(x.shape[:-1], len(self.stations_m), x.shape[-1])
        J[..., 0] = rows_last(north * scale)
        J[..., 1] = rows_last(-east * scale)
        return J

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat wrapped to (-pi, pi], shape (..., m)."""
        return wrap_angle(np.subtract(y, y_hat))


@dataclass(frozen=True, slots=True, eq=False)
class RangeRate(NormalNoise):
    """y_i = (x - s_i)'(u - u_i) / |x - s_i| + v_i,  u the user's velocity, u_i the antenna's.

    stations_m (m, d); sigma_mps (m/s) a number or (m,); velocities_mps (m, d) or 0 for antennas at rest.  State: d
    position components, then d velocities (m/s).  MAT exercise 2.6.

    >>> RangeRate([[1, 0]], 1.0, [[0, 1]]).h(np.array([3.0, 4.0, 1.0, -0.5])).round(4)
    array([-0.8944])
    """

    stations_m: Array
    sigma_mps: float | Array
    velocities_mps: Array | float = 0.0
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        stations = positions("stations_m", self.stations_m)
        velocities = np.asarray(self.velocities_mps, dtype=np.float64)
        if velocities.shape not in ((), stations.shape[1:], stations.shape) or not np.isfinite(velocities).all():
            raise ValueError(f"velocities_mps: expected finite numbers of shape {stations.shape}, got {velocities!r}")
        set_fields(self, stations_m=stations, velocities_mps=frozen(np.broadcast_to(velocities, stations.shape)))
        set_noise(self, "sigma_mps", self.sigma_mps, len(stations))

    def _parts(self, x: Array) -> tuple[Array, list[Array], list[Array], Array, Array]:
        d = self.stations_m.shape[1]
        x = state(x, 2 * d)
        offsets, speeds = offsets_to(x, self.stations_m), offsets_to(x[..., d:2 * d], self.velocities_mps)
        r = nonzero(np.sqrt(squared(offsets)))
        return x, offsets, speeds, r, sum(p * u for p, u in zip(offsets, speeds, strict=True)) / r

    def h(self, x: Array) -> Array:
        """Speed of the distance's growth, shape (..., m), in m/s; 0 at the station itself."""
        return rows_last(self._parts(x)[-1])

    def jacobian(self, x: Array) -> Array:
        """[(u - u_i)'/r - rate (x - s_i)'/r^2, (x - s_i)'/r], shape (..., m, n)."""
        x, offsets, speeds, r, rate = self._parts(x)
        J = zero_stack(x.shape[:-1], len(self.stations_m), x.shape[-1])
        away = np.logical_or.reduce([p != 0 for p in offsets])
        for j, (p, u) in enumerate(zip(offsets, speeds, strict=True)):
            J[..., j] = rows_last(np.where(away, (u - rate * p / r) / r, 0.0))
            J[..., len(offsets) + j] = rows_last(p / r)
        return J
