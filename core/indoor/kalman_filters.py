"""The comparison filters without a map: CPKF and CVKF on position fixes from the same scans.  GBPF ch. 6.

Which measurements the thesis gave to its Kalman filters is unknown; here a static solution of each scan is the
default, and `extended` feeds the signal strengths themselves to an extended filter.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core import extended as ekf
from core import kalman
from core.checks import covariance, finite
from core.indoor.cloud import Numbers
from core.indoor.signal import AccessPoints
from core.kalman import Update
from core.motion import LinearMotion, constant_position, constant_velocity
from core.sensors import Linear, SignalStrength
from core.types import Array, Gaussian


class Grid(NamedTuple):
    """The places low + k cell_m <= high in both coordinates, in metres, as candidates for a position fix."""

    low_m: tuple[float, float]
    high_m: tuple[float, float]
    cell_m: float = 0.5

    def points(self) -> Array:
        """(K, 2), x varying slowest.  ValueError for an empty grid."""
        low, high = finite("low_m", self.low_m, 2), finite("high_m", self.high_m, 2)
        if not float(finite("cell_m", self.cell_m)) > 0.0 or not (low <= high).all():
            raise ValueError(f"grid: expected low <= high and a positive cell, got {self}")
        axes = [low[k] + self.cell_m * np.arange(int((high[k] - low[k]) / self.cell_m + 1e-9) + 1) for k in (0, 1)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


class Fixes(NamedTuple):
    """Static positions xy_m (T, 2) and their misfit (T,), NaN where there was no scan; floor (T,) of the last scan."""

    xy_m: Array
    floor: Numbers
    misfit: Array


class Track(NamedTuple):
    """time_s (T,), xy_m (T, 2) the filtered positions, floor (T,), fixes and the Kalman filter's full record."""

    time_s: Array
    xy_m: Array
    floor: Numbers
    fixes: Fixes
    record: Update


def strongest_floor(scans: ArrayLike, points: AccessPoints) -> Numbers:
    """Floor of argmax_a y_a.

    scans (T, m), at least one of them not empty -> (T,).  Between scans the floor stays; before the first it is that of
    the first.
    """
    y = points.scan(scans)
    if y.ndim != 2 or np.isnan(y).all():
        raise ValueError(f"scans: expected shape (T, {len(points)}) with at least one signal, got {y.shape}")
    scanned = np.flatnonzero(~np.isnan(y).all(axis=1))
    latest = np.searchsorted(scanned, np.arange(len(y)), side="right").clip(1) - 1
    return points.floor[np.nanargmax(y[scanned], axis=1)].astype(np.intp)[latest]


def position_fixes(scans: ArrayLike, points: AccessPoints, grid: Grid) -> Fixes:
    """argmin_x sum_a ((y_a - mu_a(x)) / sigma_a)^2  over the grid, on the floor of the strongest access point.

    scans (T, m) in dBm, NaN left out.  With normal noise this is the maximum likelihood position of one scan.
    """
    y = points.scan(scans)
    places, floor = grid.points(), strongest_floor(y, points)
    xy, misfit = np.full((len(y), 2), np.nan), np.full(len(y), np.nan)
    scanned = ~np.isnan(y).all(axis=1)
    for f in np.unique(floor[scanned]):
        place = np.column_stack([places, np.full(len(places), points.floor_height_m * f)])
        mu = points.expected(place, f)
        for k in np.flatnonzero((floor == f) & scanned):
            heard = ~np.isnan(y[k])
            cost = np.square((y[k] - mu)[:, heard] / points.sigma_db[heard]).sum(axis=1)
            best = int(cost.argmin())
            xy[k], misfit[k] = places[best], cost[best]
    return Fixes(xy, floor, misfit)


def cpkf(
    scans: ArrayLike, points: AccessPoints, grid: Grid, initial: Gaussian, *,
    dt_s: float = 1.0, q: float = 8.0, R: ArrayLike = ((100.0, 0.0), (0.0, 36.0)), extended: bool = False,
) -> Track:
    """Phi = I,  Q = q dt I: the Kalman filter with the constant-position model.

    scans (T, m), a row of NaN for an epoch without a scan; the first epoch is updated without a prediction.  initial:
    position (2,) and its covariance; q in m^2/s; R (2, 2), covariance of a fix in m^2.  extended True: no fixes, the
    signal strengths are linearised (only access points on the floor of the strongest one).  GBPF ch. 6.
    """
    return _run(scans, points, grid, initial, constant_position(dt_s, _root("q", q), 2), dt_s, R, extended)


def cvkf(
    scans: ArrayLike, points: AccessPoints, grid: Grid, initial: Gaussian, *,
    dt_s: float = 1.0, q: float = 0.05, R: ArrayLike = ((100.0, 0.0), (0.0, 36.0)), extended: bool = False,
    velocity_variance: float = 1.0,
) -> Track:
    """Phi = [[I, dt I], [0, I]],  Q of MAT 3.1 with q: the Kalman filter with the constant-velocity model.

    As `cpkf`; q in m^2/s^3; initial: position alone, then the velocity is 0 with velocity_variance (m^2/s^2), or
    position and velocity (4,).  GBPF ch. 6; MAT 3.1.
    """
    mean = finite("initial.mean", initial.mean)
    if mean.shape == (2,):
        P = np.zeros((4, 4))
        P[:2, :2] = covariance("initial.cov", initial.cov, 2)
        P[2:, 2:] = float(finite("velocity_variance", velocity_variance)) * np.eye(2)
        initial = Gaussian(np.concatenate([mean, np.zeros(2)]), P)
    return _run(scans, points, grid, initial, constant_velocity(dt_s, _root("q", q), 2), dt_s, R, extended)


def _run(
    scans: ArrayLike, points: AccessPoints, grid: Grid, initial: Gaussian, motion: LinearMotion, dt_s: float,
    R: ArrayLike, extended: bool,
) -> Track:
    y = points.scan(scans)
    fixes = position_fixes(y, points, grid)
    n = len(motion.Q)
    motions = [LinearMotion(np.eye(n), np.zeros((n, n))), *[motion] * (len(y) - 1)]
    if extended:
        sensor = SignalStrength(points.xy_m, points.power_dbm, points.exponent, points.sigma_db)
        same_floor = points.floor == fixes.floor[:, None]
        record = ekf.run(initial, np.where(same_floor, y, np.nan), motions, sensor)
    else:
        record = kalman.run(initial, fixes.xy_m, motions, Linear(np.eye(2, n), covariance("R", R, 2)))
    return Track(dt_s * np.arange(len(y)), record.posterior.mean[:, :2], fixes.floor, fixes, record)


def _root(name: str, q: float) -> float:
    q = float(finite(name, q))
    if q < 0.0:
        raise ValueError(f"{name}: expected a number >= 0, got {q}")
    return float(np.sqrt(q))
