"""From learning data to access points: path-loss parameters, positions, coverage areas.  GBPF ch. 1."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.types import Array, Gaussian


class PathLoss(NamedTuple):
    """power_dbm A, exponent n, sigma_db s (degrees of freedom K - 2); residual (K,) in dB; xy_m (2,) of the station."""

    power_dbm: float
    exponent: float
    sigma_db: float
    residual: Array
    xy_m: Array


def fit_path_loss(positions_m: ArrayLike, rss_dbm: ArrayLike, station_m: ArrayLike) -> PathLoss:
    """min over A, n of sum (y_k - A + 10 n log10(max(d_k, 1 m)))^2: a straight line in the logarithm of the distance.

    positions_m (K, 2) where rss_dbm (K,) was measured, NaN left out; station_m (2,).  sigma^2 = cost / (K - 2).
    ValueError for fewer than three measurements or distances that are all the same.  GBPF ch. 1.

    >>> fit = fit_path_loss([[1, 0], [10, 0], [0, 100]], [-40, -65, -90], [0, 0])
    >>> round(fit.power_dbm, 9), round(fit.exponent, 9)
    (-40.0, 2.5)
    """
    x, y = _heard(positions_m, rss_dbm)
    cost, A, n, residual = _line(x, y, finite("station_m", station_m, 2)[None])
    if not np.isfinite(cost[0]):
        raise ValueError("positions_m: expected measurements at different distances of more than 1 m, got only one")
    return PathLoss(float(A[0]), float(n[0]), float(np.sqrt(cost[0] / (len(y) - 2))), residual[0],
                    finite("station_m", station_m, 2))


def locate_access_point(
    positions_m: ArrayLike, rss_dbm: ArrayLike, *, margin_m: float = 30.0, cell_m: float = 2.0
) -> PathLoss:
    """min over s, A, n of sum (y_k - A + 10 n log10(max(|x_k - s|, 1 m)))^2: where the access point is.

    For each s of a grid around the learning data A and n follow from linear least squares; the grid is then refined
    five times about the best s.  Places where n would not be positive are left out.  positions_m (K, 2), rss_dbm (K,),
    NaN where nothing was heard.  ValueError for fewer than five measurements or if no place fits.  GBPF ch. 1.
    """
    x, y = _heard(positions_m, rss_dbm)
    if len(y) < 5:
        raise ValueError(f"rss_dbm: expected at least 5 measurements for 4 unknowns, got {len(y)}")
    low, high, best = x.min(axis=0) - margin_m, x.max(axis=0) + margin_m, np.zeros(2)
    for _ in range(6):
        axes = [np.arange(low[k], high[k] + 0.5 * cell_m, cell_m) for k in (0, 1)]
        s = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        cost, _, n, _ = _line(x, y, s)
        cost = np.where(n > 0.0, cost, np.inf)
        if not np.isfinite(cost.min()):
            raise ValueError("rss_dbm: expected signals that fade with the distance from some place, got none")
        best = s[int(cost.argmin())]
        low, high, cell_m = best - 2.0 * cell_m, best + 2.0 * cell_m, cell_m / 4.0
    return fit_path_loss(x, y, best)


def coverage_area(positions_m: ArrayLike, rss_dbm: ArrayLike) -> Gaussian:
    """Mean and covariance of the places where an access point was heard: an ellipse as its coverage area.

    positions_m (K, 2), rss_dbm (K,), NaN where nothing was heard.  ValueError for fewer than three places.  GBPF ch. 1.
    """
    x, _ = _heard(positions_m, rss_dbm)
    d = x - x.mean(axis=0)
    return Gaussian(x.mean(axis=0), d.T @ d / (len(x) - 1))


def _heard(positions_m: ArrayLike, rss_dbm: ArrayLike) -> tuple[Array, Array]:
    x, y = finite("positions_m", positions_m, None, 2), np.asarray(rss_dbm, dtype=np.float64)
    if x.ndim != 2 or y.shape != x.shape[:1] or np.isinf(y).any():
        raise ValueError(f"rss_dbm: expected {x.shape[:1]} numbers or NaN, one for each position, got {y.shape}")
    heard = ~np.isnan(y)
    if heard.sum() < 3:
        raise ValueError(f"rss_dbm: expected at least 3 measurements that are not NaN, got {heard.sum()}")
    return x[heard], y[heard]


def _line(x: Array, y: Array, s: Array) -> tuple[Array, Array, Array, Array]:
    """Least squares of y (K,) on -10 log10 d for stations s (S, 2): cost, A, n (S,), residual (S, K)."""
    squares = np.square(x[:, 0] - s[:, :1]) + np.square(x[:, 1] - s[:, 1:])
    a = -5.0 * np.log10(np.maximum(squares, 1.0))
    da, dy = a - a.mean(axis=1, keepdims=True), y - y.mean()
    spread = np.square(da).sum(axis=1)
    flat = spread < 1e-12
    n = (da @ dy) / np.where(flat, 1.0, spread)
    A = y.mean() - n * a.mean(axis=1)
    residual = y - A[:, None] - n[:, None] * a
    return np.where(flat, np.inf, np.square(residual).sum(axis=1)), A, n, residual
