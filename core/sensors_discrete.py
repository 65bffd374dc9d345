"""Sensors whose likelihood is not a bell around h(x): quantised, binary, bounded and squared.

Grids and particle filters use `log_likelihood`.  The Jacobian is the derivative almost everywhere (zero for the
sensors with steps), so a Gaussian filter learns nothing from a step: that is what the derivative says.
"""

import math
from dataclasses import dataclass

import numpy as np

from core import checks
from core.sensor_noise import StepFunction, derived, per_row, positions, set_fields, state, wrap_angle
from core.stacks import frozen, vector
from core.types import Array, Sensor


def _log_normal_mass(a: Array, b: Array) -> Array:
    """log(Phi(b) - Phi(a)) for a < b, exact far out in both tails."""
    from scipy.special import log_ndtr

    flip = a > 0
    low, high = log_ndtr(np.where(flip, -b, a)), log_ndtr(np.where(flip, -a, b))
    with np.errstate(divide="ignore"):                    # equal masses: log 0
        return high + np.log1p(-np.exp(low - high))


@dataclass(frozen=True, slots=True, eq=False)
class Quantised(StepFunction):
    """y = floor((x_axis + v) / step),  v ~ N(0, sigma^2).

    A whole number, such as a floor.  sigma and step > 0 in the units of the state's component `axis`.  R is
    (sigma / step)^2 + 1/12, the variance of y when sigma is not small against step.  MAT exercise 2.11.

    >>> float(np.exp(Quantised(0.5).log_likelihood([0.0], np.array([0.5]))).round(6))
    0.682689
    """

    sigma: float
    axis: int = 0
    step: float = 1.0
    R: Array = derived()

    def __post_init__(self) -> None:
        for name in ("sigma", "step"):
            value = float(checks.finite(name, getattr(self, name)))
            if value <= 0:
                raise ValueError(f"{name}: expected a positive number, got {value}")
            set_fields(self, **{name: value})
        if self.axis != int(self.axis) or self.axis < 0:
            raise ValueError(f"axis: expected the number of a state component, got {self.axis}")
        set_fields(self, R=frozen([[(self.sigma / self.step) ** 2 + 1 / 12]]))

    def h(self, x: Array) -> Array:
        """floor(x_axis / step), shape (..., 1)."""
        return np.floor(state(x, self.axis + 1)[..., self.axis:self.axis + 1] / self.step)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """log(Phi((step (y + 1) - x) / sigma) - Phi((step y - x) / sigma)), shape (...).  y whole numbers."""
        x = state(x, self.axis + 1)[..., self.axis]
        k = vector("y", y, 1)[..., 0]
        if (k != np.floor(k)).any():
            raise ValueError(f"y: expected whole numbers, got {k[k != np.floor(k)].flat[0] if k.ndim else k}")
        return _log_normal_mass((self.step * k - x) / self.sigma, (self.step * (k + 1) - x) / self.sigma)


@dataclass(frozen=True, slots=True, eq=False)
class BinarySector(StepFunction):
    """y_i = 1 if |s_i - x| + v_i <= radius_i and the user is in the sector, else 0.

    stations_m (m, d); radius_m > 0, sigma_m >= 0 (0: a sharp edge), direction_rad (clockwise from north, the middle
    of the sector) and width_rad (full opening, at least 2 pi: all round) are numbers or one per station.  R is 1/4,
    the largest variance that y can have.  MAT exercise 2.10(c)-(d).

    >>> float(np.exp(BinarySector([[0, 0]], 100.0, 1.0).log_likelihood([1.0], np.array([101.0, 0.0]))).round(6))
    0.158655
    """

    stations_m: Array
    radius_m: float | Array
    sigma_m: float | Array = 0.0
    direction_rad: float | Array = 0.0
    width_rad: float | Array = 2 * math.pi
    R: Array = derived()

    def __post_init__(self) -> None:
        stations = positions("stations_m", self.stations_m)
        m = len(stations)
        set_fields(self, stations_m=stations, R=frozen(np.eye(m) / 4))
        for name, low in (("radius_m", 0.0), ("sigma_m", 0.0), ("direction_rad", -math.inf), ("width_rad", 0.0)):
            value = frozen(per_row(name, getattr(self, name), m))
            if (value < low).any() or (name in ("radius_m", "width_rad") and not value.all()):
                raise ValueError(f"{name}: expected numbers {'>=' if name == 'sigma_m' else '>'} 0, got {value.min()}")
            set_fields(self, **{name: value})
        if stations.shape[1] < 2 and (self.width_rad < 2 * math.pi).any():
            raise ValueError(f"width_rad: expected stations in a plane for a sector, got shape {stations.shape}")

    def _geometry(self, x: Array) -> tuple[Array, Array]:
        """Distance beyond the edge and whether the direction lies in the sector, both (..., m)."""
        d = self.stations_m.shape[1]
        offsets = state(x, d)[..., None, :d] - self.stations_m
        beyond = np.sqrt(np.square(offsets).sum(axis=-1)) - self.radius_m
        if (self.width_rad >= 2 * math.pi).all():
            return beyond, np.ones(beyond.shape, dtype=bool)
        off_axis = np.abs(wrap_angle(np.arctan2(offsets[..., 0], offsets[..., 1]) - self.direction_rad))
        return beyond, off_axis <= self.width_rad / 2

    def h(self, x: Array) -> Array:
        """1 inside and 0 outside, shape (..., m)."""
        beyond, in_sector = self._geometry(x)
        return ((beyond <= 0) & in_sector).astype(np.float64)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """sum log P(y_i | x), shape (...); -inf where y is impossible.  y of zeros and ones."""
        from scipy.special import log_ndtr

        y = vector("y", y, len(self.stations_m))
        if not np.isin(y, (0.0, 1.0)).all():
            raise ValueError(f"y: expected zeros and ones, got {y[~np.isin(y, (0.0, 1.0))].flat[0]}")
        beyond, in_sector = self._geometry(x)
        soft = self.sigma_m > 0
        u = -beyond / np.where(soft, self.sigma_m, 1.0)
        sharp = np.where(beyond <= 0, np.inf, -np.inf)
        u = np.where(in_sector, np.where(soft, u, sharp), -np.inf)
        return log_ndtr(np.where(y == 1.0, u, -u)).sum(axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class UniformNoise:
    """y = h(x) + v,  v_i ~ U(-w_i, w_i).

    sensor gives h, its derivative and its innovation; half_width w > 0 is a number or one per row.  R is w^2 / 3.
    MAT exercise 2.10(a)-(b).
    """

    sensor: Sensor
    half_width: float | Array
    R: Array = derived()

    def __post_init__(self) -> None:
        w = per_row("half_width", self.half_width, len(self.sensor.R))
        if (w <= 0).any():
            raise ValueError(f"half_width: expected positive numbers, got {w.min()}")
        set_fields(self, half_width=frozen(w), R=frozen(np.diag(w * w / 3)))

    def h(self, x: Array) -> Array:
        """The sensor's own h, shape (..., m)."""
        return self.sensor.h(x)

    def jacobian(self, x: Array) -> Array:
        """The sensor's own derivative, shape (..., m, n)."""
        return self.sensor.jacobian(x)

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """The sensor's own innovation, shape (..., m)."""
        return self.sensor.innovation(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """-sum log(2 w_i) where every |y_i - h_i(x)| <= w_i, else -inf; shape (...)."""
        nu = self.innovation(vector("y", y, len(self.half_width)), self.h(x))
        inside = (np.abs(nu) <= self.half_width).all(axis=-1)
        return np.where(inside, -np.log(2 * self.half_width).sum(), -np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class SquaredRange:
    """y = |s - x|^2,  s ~ N(station, sigma^2 I):  y / sigma^2 is non-central chi-square.

    A squared distance to a station whose place is uncertain.  station_m (d,), sigma_m > 0; y (..., 1) >= 0 in m^2.
    h is the mean |station - x|^2 + d sigma^2; R is 2 d sigma^4, the part of V(y) that does not depend on x.
    MAT exercise 2.10(e), Definition 6.
    """

    station_m: Array
    sigma_m: float
    R: Array = derived()

    def __post_init__(self) -> None:
        station = checks.finite("station_m", self.station_m, None)
        sigma = float(checks.finite("sigma_m", self.sigma_m))
        if station.ndim != 1 or not station.size or sigma <= 0:
            raise ValueError(f"expected a station (d,) and sigma_m > 0, got shape {station.shape} and {sigma}")
        set_fields(self, station_m=frozen(station), sigma_m=sigma, R=frozen([[2 * len(station) * sigma**4]]))

    def _squares(self, x: Array) -> Array:
        d = len(self.station_m)
        return np.square(state(x, d)[..., :d] - self.station_m).sum(axis=-1, keepdims=True)

    def h(self, x: Array) -> Array:
        """E(y | x), shape (..., 1), in m^2."""
        return self._squares(x) + len(self.station_m) * self.sigma_m**2

    def jacobian(self, x: Array) -> Array:
        """2 (x - station)', shape (..., 1, n)."""
        d = len(self.station_m)
        x = state(x, d)
        J = np.zeros((*x.shape[:-1], 1, x.shape[-1]))
        J[..., 0, :d] = 2 * (x[..., :d] - self.station_m)
        return J

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat, shape (..., 1)."""
        return np.subtract(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """log of the non-central chi-square density with d degrees of freedom at y / sigma^2, shape (...)."""
        from scipy.special import gammaln, ive, xlogy

        half = len(self.station_m) / 2
        t = vector("y", y, 1)[..., 0] / self.sigma_m**2
        if (t < 0).any():
            raise ValueError(f"y: expected squared distances >= 0, got {t.min() * self.sigma_m**2}")
        lam = self._squares(x)[..., 0] / self.sigma_m**2
        t, lam = np.broadcast_arrays(t, lam)
        central = xlogy(half - 1, t) - (t + lam) / 2 - half * math.log(2.0) - gammaln(half)
        z = np.sqrt(lam * t)
        near = z < 1e-6                                   # there the Bessel function is (z/2)^v / Gamma(v + 1)
        safe_t, safe_lam, safe_z = (np.where(near, 1.0, v) for v in (t, lam, z))
        bessel = np.log(ive(half - 1, safe_z)) + safe_z   # log I_v(z) for v = d/2 - 1
        out = -math.log(2.0) - (t + lam) / 2 + (half - 1) / 2 * np.log(safe_t / safe_lam) + bessel
        return np.where(near, central, out) - 2 * math.log(self.sigma_m)
