"""Sensors of radio signal strength: path loss, and fingerprints.  MAT exercise 2.9, GBPF 5.2."""

import math
from dataclasses import dataclass

import numpy as np

from core import checks
from core.distances import offsets_to, rows_last, squared, squared_distances
from core.sensor_noise import NormalNoise, StepFunction, derived, per_row, positions, set_fields, set_noise, state
from core.stacks import frozen, vector, zero_stack
from core.types import Array


@dataclass(frozen=True, slots=True, eq=False)
class SignalStrength(NormalNoise):
    """y_i = A_i - 10 n_i log10(max(|s_i - x|, 1 m)) + v_i.

    stations_m (m, d); power_dbm A (at 1 m), exponent n and sigma_db are numbers or one per access point.  A NaN in y
    is an access point that was not heard; the likelihood leaves it out.  GBPF 5.2.

    >>> SignalStrength([[0, 0]], -40.0, 2.5, 6.0).h(np.array([6.0, 8.0]))
    array([-65.])
    """

    stations_m: Array
    power_dbm: float | Array
    exponent: float | Array
    sigma_db: float | Array
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        stations = positions("stations_m", self.stations_m)
        m = len(stations)
        set_fields(self, stations_m=stations, power_dbm=frozen(per_row("power_dbm", self.power_dbm, m)),
                   exponent=frozen(per_row("exponent", self.exponent, m)))
        set_noise(self, "sigma_db", self.sigma_db, m)

    def _column(self, v: Array, x: Array) -> Array:
        return v.reshape(-1, *(1,) * (x.ndim - 1))

    def h(self, x: Array) -> Array:
        """Expected signal strength, shape (..., m), in dBm."""
        x = state(x, self.stations_m.shape[1])
        rows = squared_distances(x, self.stations_m)
        np.log(np.maximum(rows, 1.0, out=rows), out=rows)
        rows *= self._column(-5.0 / math.log(10.0) * self.exponent, x)       # 10 log10 d = 5 log10 d^2
        rows += self._column(self.power_dbm, x)
        return rows_last(rows)

    def jacobian(self, x: Array) -> Array:
        """-10 n_i / ln 10 (x - s_i)' / |x - s_i|^2, shape (..., m, n), in dB/m; zero within 1 m of the station."""
        x = state(x, self.stations_m.shape[1])
        offsets = offsets_to(x, self.stations_m)
        squares = squared(offsets)
        slope = self._column(-10.0 / math.log(10.0) * self.exponent, x) / np.maximum(squares, 1.0)
        slope *= squares > 1.0
        J = zero_stack(x.shape[:-1], len(self.stations_m), x.shape[-1])
        for j, d in enumerate(offsets):
            J[..., j] = rows_last(slope * d)
        return J

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """Normal log density of the powers heard, shape (...); NaN in y (m,) or (..., m) means not heard."""
        y = np.asarray(y, dtype=np.float64)
        missing = np.isnan(y)
        if not missing.any():
            return NormalNoise.log_likelihood(self, y, x)
        vector("y", np.where(missing, 0.0, y), len(self.R))
        z = np.where(missing, 0.0, self.innovation(y, self.h(x)) * self.precision)
        constants = np.log(self.precision) - 0.5 * math.log(2 * math.pi)
        return np.where(missing, 0.0, constants).sum(axis=-1) - 0.5 * np.square(z).sum(axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Fingerprint(StepFunction):
    """y = a_i + v,  v ~ N(0, sigma^2 I),  i the point of the data base nearest to x.

    points_m (k, d); powers_dbm a (k, m), the mean powers at the points; sigma_db > 0.  A NaN in y is an access point
    that was not heard and is left out.  MAT exercise 2.9.
    """

    points_m: Array
    powers_dbm: Array
    sigma_db: float
    R: Array = derived()

    def __post_init__(self) -> None:
        points = positions("points_m", self.points_m)
        powers = checks.finite("powers_dbm", self.powers_dbm, len(points), None)
        sigma = float(checks.finite("sigma_db", self.sigma_db))
        if powers.ndim != 2 or sigma <= 0:
            raise ValueError(f"expected powers ({len(points)}, m) and sigma_db > 0, got {powers.shape} and {sigma}")
        set_fields(self, points_m=points, powers_dbm=frozen(powers), sigma_db=sigma,
                   R=frozen(sigma**2 * np.eye(powers.shape[1])))

    def nearest_point(self, x: Array) -> Array:
        """Index of the point nearest to x, shape (...)."""
        d = self.points_m.shape[1]
        x = state(x, d)
        best, index = np.full(x.shape[:-1], np.inf), np.zeros(x.shape[:-1], dtype=np.intp)
        for i, p in enumerate(self.points_m):
            squares = sum((x[..., j] - p[j]) ** 2 for j in range(d))
            index = np.where(squares < best, i, index)
            best = np.minimum(squares, best)
        return index

    def h(self, x: Array) -> Array:
        """Powers at the nearest point, shape (..., m), in dBm."""
        return self.powers_dbm[self.nearest_point(x)]

    def squared_distances(self, y: Array) -> Array:
        """|y - a_i|^2 for every point, shape (..., k), in dB^2."""
        y = np.asarray(y, dtype=np.float64)
        m = self.powers_dbm.shape[1]
        if y.ndim == 0 or y.shape[-1] != m or np.isinf(y).any():
            raise ValueError(f"y: expected finite or missing (NaN) powers of shape (..., {m}), got {y!r}")
        return np.square(np.nan_to_num(y[..., None, :] - self.powers_dbm, nan=0.0)).sum(axis=-1)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """-|y - a_i|^2 / (2 sigma^2) - m log(sigma sqrt(2 pi)), i nearest to x, m the access points heard."""
        at_points = self.point_log_likelihoods(y)
        index = self.nearest_point(x)
        if at_points.ndim == 1:
            return at_points[index]
        shape = np.broadcast_shapes(at_points.shape[:-1], index.shape)
        at_points = np.broadcast_to(at_points, (*shape, at_points.shape[-1]))
        return np.take_along_axis(at_points, np.broadcast_to(index, shape)[..., None], axis=-1)[..., 0]

    def point_log_likelihoods(self, y: Array) -> Array:
        """log p(y | x = p_i) for every point, shape (..., k)."""
        squares = self.squared_distances(y)
        heard = np.isfinite(y).sum(axis=-1, keepdims=True)
        return -0.5 * squares / self.sigma_db**2 - heard * math.log(self.sigma_db * math.sqrt(2 * math.pi))

    def posterior(self, y: Array, prior: Array | None = None) -> Array:
        """P(x = p_i | y), shape (..., k); prior (k,) positive weights, equal if not given."""
        logs = self.point_log_likelihoods(y)
        if prior is not None:
            prior = checks.finite("prior", prior, len(self.points_m))
            if (prior < 0).any() or not prior.any():
                raise ValueError(f"prior: expected weights >= 0 that do not all vanish, got {prior}")
            with np.errstate(divide="ignore"):
                logs = logs + np.log(prior)
        w = np.exp(logs - logs.max(axis=-1, keepdims=True))
        return w / w.sum(axis=-1, keepdims=True)

    def weighted_neighbours(self, y: Array, k: int) -> Array:
        """Mean of the k best points with weights 1 / |y - a_i|, shape (..., d); k = 1 is the nearest neighbour.

        A point that fits exactly takes all the weight.
        """
        if k != int(k) or not 1 <= k <= len(self.points_m):
            raise ValueError(f"k: expected 1 to {len(self.points_m)}, got {k}")
        distances = np.sqrt(self.squared_distances(y))
        index = np.argsort(distances, axis=-1, kind="stable")[..., :k]
        distances = np.take_along_axis(distances, index, axis=-1)
        exact = distances == 0
        w = np.where(exact.any(axis=-1, keepdims=True), exact, 1 / np.where(exact, 1.0, distances))
        return (w[..., None] * self.points_m[index]).sum(axis=-2) / w.sum(axis=-1, keepdims=True)
