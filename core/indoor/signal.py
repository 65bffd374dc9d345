"""Received signal strength by path loss, access point by access point, and radio maps.  GBPF 5.2 and ch. 1."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.indoor.graph import FloorGraph
from core.types import Array

_CACHE = 32_768                                           # numbers that stay in the cache during a few passes
_LOG_2PI = math.log(2.0 * math.pi)


@dataclass(frozen=True, slots=True, eq=False)
class AccessPoints:
    """RSS_a = A_a - 10 n_a log10(max(d_a, 1 m)) - loss |floor - floor_a| + w_a,  w_a ~ N(0, sigma_a^2).

    xy_m (m, 2) and floor (m,) of the access points; power_dbm A (at 1 m), exponent n and sigma_db: numbers or (m,).
    d is three-dimensional with floor_height_m between floors; each floor between costs floor_loss_db more.

    A scan y is (m,) in dBm, NaN for what was not heard.  unheard "ignore" leaves it out of the likelihood; "censored"
    gives it the factor Phi((threshold_dbm - mu) / sigma), the probability to fall below the receiver's threshold.
    freedom: degrees of freedom of a Student t law for w / sigma instead of the normal one, against outliers.
    most_independent: with more access points heard than this, the likelihood is raised to the power most_independent /
    heard, against over-confidence.  ValueError for wrong shapes or values.
    GBPF ch. 1 and 5.2 name the attenuation model; the formula and the options are ours.

    >>> AccessPoints([[0, 0]]).expected([6, 8, 0], 0)
    array([-65.])
    """

    xy_m: Array
    floor: Array | int = 0
    power_dbm: float | Array = -40.0
    exponent: float | Array = 2.5
    sigma_db: float | Array = 6.0
    floor_loss_db: float = 12.0
    floor_height_m: float = 4.0
    unheard: str = "ignore"
    threshold_dbm: float = -95.0
    freedom: float | None = None
    most_independent: float | None = None

    def __post_init__(self) -> None:
        xy = finite("xy_m", self.xy_m, None, 2)
        if xy.ndim != 2 or not len(xy):
            raise ValueError(f"xy_m: expected access points (m, 2), m >= 1, got shape {xy.shape}")
        values = {"xy_m": xy.copy()}
        for name in ("floor", "power_dbm", "exponent", "sigma_db"):
            value = finite(name, getattr(self, name))
            if value.shape not in ((), (len(xy),)):
                raise ValueError(f"{name}: expected a number or {len(xy)} of them, got shape {value.shape}")
            values[name] = np.array(np.broadcast_to(value, len(xy)))
        if (values["floor"] != np.rint(values["floor"])).any():
            raise ValueError(f"floor: expected whole numbers, got {values['floor']}")
        for name in ("exponent", "sigma_db"):
            if (values[name] <= 0.0).any():
                raise ValueError(f"{name}: expected positive numbers, got {values[name].min()}")
        for name, value in values.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        for name in ("floor_loss_db", "floor_height_m"):
            if not float(finite(name, getattr(self, name))) >= 0.0:
                raise ValueError(f"{name}: expected a number >= 0, got {getattr(self, name)}")
        finite("threshold_dbm", self.threshold_dbm)
        for name in ("freedom", "most_independent"):
            value = getattr(self, name)
            if value is not None and not float(finite(name, value)) > 0.0:
                raise ValueError(f"{name}: expected a positive number or None, got {value}")
        if self.unheard not in ("ignore", "censored"):
            raise ValueError(f"unheard: expected ignore or censored, got {self.unheard!r}")

    def __len__(self) -> int:
        return len(self.xy_m)

    def scan(self, y: ArrayLike) -> Array:
        """y as one scan (m,) or several (..., m), NaN allowed.  ValueError otherwise."""
        y = np.asarray(y, dtype=np.float64)
        if y.ndim == 0 or y.shape[-1] != len(self) or np.isinf(y).any():
            raise ValueError(f"y: expected {len(self)} signal strengths in dBm, NaN where none was heard, got "
                             f"{f'shape {y.shape}' if y.ndim == 0 or y.shape[-1] != len(self) else 'an infinite one'}")
        return y

    def expected(self, position_m: ArrayLike, floor: ArrayLike) -> Array:
        """mu = A - 10 n log10(max(d, 1 m)) - loss |floor - floor_a|.

        position_m (..., 3): x, y and the height, as in `Cloud`; floor (...) -> (..., m) in dBm.
        """
        return np.moveaxis(self._mean(finite("position_m", position_m, 3), np.asarray(floor), slice(None)), 0, -1)

    def log_likelihood(self, y: ArrayLike, position_m: Array, floor: Array) -> Array:
        """log p(y | x) = sum over the access points heard of log N(y_a; mu_a, sigma_a^2).

        y (m,), position_m (..., 3), floor (...) -> (...).  0 if nothing was heard (and `unheard` is "ignore").  With
        `freedom` a t law takes the place of the normal one.
        """
        y = self.scan(y)
        if y.ndim != 1:
            raise ValueError(f"y: expected one scan ({len(self)},), got shape {y.shape}")
        heard = np.flatnonzero(~np.isnan(y))
        position_m, floor = np.asarray(position_m), np.asarray(floor)
        rows = (-1,) + (1,) * (position_m.ndim - 1)
        total = np.zeros(position_m.shape[:-1])
        few = max(_CACHE // max(total.size, 1), 1)
        for some in (heard[k:k + few] for k in range(0, heard.size, few)):
            z = self._mean(position_m, floor, some)
            z -= y[some].reshape(rows)
            z *= (1.0 / self.sigma_db[some]).reshape(rows)
            z *= z
            if self.freedom is not None:
                z /= self.freedom
                np.log1p(z, out=z)
            total += z.sum(axis=0) if len(some) > 1 else z[0]
        total *= -0.5 if self.freedom is None else -0.5 * (self.freedom + 1.0)
        total += heard.size * self._log_constant() - np.log(self.sigma_db[heard]).sum()
        if self.unheard == "censored" and heard.size < len(self):
            from scipy.special import log_ndtr

            silent = np.flatnonzero(np.isnan(y))
            mean = self._mean(position_m, floor, silent)
            total = total + log_ndtr((self.threshold_dbm - mean) / self.sigma_db[silent].reshape(rows)).sum(axis=0)
        return total * self._power(heard.size)

    def typical_log_likelihood(self, y: ArrayLike) -> float:
        """E(log p(y | x)) at the true place x, over the noise of the access points heard.

        Normal law: -m/2 - sum log(sigma sqrt(2 pi)); access points that were not heard are not counted.
        """
        heard = ~np.isnan(self.scan(y))
        m = int(heard.sum())
        each = -0.5
        if self.freedom is not None:                      # E log(1 + t^2/f) = psi((f+1)/2) - psi(f/2)
            each = -0.5 * (self.freedom + 1.0) * (_digamma(0.5 * self.freedom + 0.5) - _digamma(0.5 * self.freedom))
        return float((m * (each + self._log_constant()) - np.log(self.sigma_db[heard]).sum()) * self._power(m))

    def _mean(self, x: Array, floor: Array, which: slice | Array) -> Array:
        """Expected strengths of some access points, those first: (k, ...)."""
        rows = (-1,) + (1,) * (x.ndim - 1)
        xy, at = self.xy_m[which], self.floor[which].reshape(rows)
        d = x[..., 0] - xy[:, 0].reshape(rows)
        squares = d * d
        np.subtract(x[..., 1], xy[:, 1].reshape(rows), out=d)
        d *= d
        squares += d
        flat = bool((x[..., 2] == self.floor_height_m * self.floor[0]).all() and (self.floor == self.floor[0]).all())
        if not flat:
            np.subtract(x[..., 2], self.floor_height_m * at, out=d)
            d *= d
            squares += d
        np.maximum(squares, 1.0, out=squares)
        np.log10(squares, out=squares)
        squares *= (-5.0 * self.exponent[which]).reshape(rows)         # 10 log10 d = 5 log10 d^2
        squares += self.power_dbm[which].reshape(rows)
        if not flat and self.floor_loss_db:
            np.subtract(floor, at, out=d)
            np.abs(d, out=d)
            d *= self.floor_loss_db
            squares -= d
        return squares

    def _log_constant(self) -> float:
        if self.freedom is None:
            return -0.5 * _LOG_2PI
        f = self.freedom
        return math.lgamma(0.5 * f + 0.5) - math.lgamma(0.5 * f) - 0.5 * math.log(f * math.pi)

    def _power(self, heard: int) -> float:
        return min(1.0, self.most_independent / heard) if self.most_independent and heard else 1.0


class RadioMap(NamedTuple):
    """Expected strengths rss_dbm (m, ny, nx) on one floor, at the points x_m (nx,), y_m (ny,)."""

    x_m: Array
    y_m: Array
    rss_dbm: Array


def radio_map(
    graph: FloorGraph, points: AccessPoints, floor: int = 0, *, cell_m: float = 1.0, margin_m: float = 5.0
) -> RadioMap:
    """mu_a(x) of every access point a on a grid of places x of one floor.

    The grid covers the whole graph and margin_m around it, with cell_m between its points.  ValueError for a floor that
    the graph does not have or a cell that is not positive.  GBPF ch. 1 (radio map).
    """
    if floor not in graph.floors:
        raise ValueError(f"floor: expected one of {graph.floors}, got {floor}")
    if not float(finite("cell_m", cell_m)) > 0.0 or not float(finite("margin_m", margin_m)) >= 0.0:
        raise ValueError(f"cell_m, margin_m: expected metres > 0 and >= 0, got {cell_m} and {margin_m}")
    corners = np.concatenate([np.array([n[:2] for n in graph.nodes.values()]).reshape(-1, 2),
                              *(a.polygon for a in graph.areas.values())])
    low, high = corners.min(axis=0) - margin_m, corners.max(axis=0) + margin_m
    x, y = (low[k] + cell_m * np.arange(int((high[k] - low[k]) / cell_m + 1e-9) + 1) for k in (0, 1))
    place = np.empty((3, len(y), len(x)))
    place[0], place[1], place[2] = x, y[:, None], points.floor_height_m * floor
    return RadioMap(x, y, np.moveaxis(points.expected(np.moveaxis(place, 0, -1), floor), -1, 0))


def _digamma(x: float) -> float:
    h = 1e-4                                              # central difference: error h^2 psi'' / 6, about 1e-9
    return (math.lgamma(x + h) - math.lgamma(x - h)) / (2.0 * h)
