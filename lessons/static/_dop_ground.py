"""Ranges to two or three stations: a map of DOP, and a thousand estimates against what the linearisation promises."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.dop import Dop, dop, position_covariance
from core.gauss_newton import gauss_newton_batch
from core.likelihood import states_on_grid
from core.sensors import Range
from core.types import Array
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.static.dilution_of_precision import Params

DRAWS = 1000
LOW, HIGH, CELLS = -50.0, 150.0, 81          # exercise 2.17 (b)
AXIS = np.linspace(LOW, HIGH, CELLS)
CUT = 10.0                                   # the map shows min(DOP, 10)
SIGMAS_M = np.geomspace(0.5, 50.0, 9)        # at which the growth of the errors is computed
WEIGHTS = np.geomspace(1e-3, 10.0, 33)


class Spread(NamedTuple):
    """Estimates of repeated experiments that found a solution."""

    x: Array                     # (DRAWS, 2) NaN where Gauss-Newton did not converge
    found: Array                 # (DRAWS,) truth values


class Ground(NamedTuple):
    """One user, two or three stations."""

    stations: Array              # (m, 2)
    sigma: Array                 # (m,) of the ranges, in metres
    W: Array                     # (m,) weights
    J: Array                     # (m, 2) at the true position
    dop: Dop
    V: Array | None              # (2, 2) error covariance by linearisation; None where J is singular
    best: Array | None           # (2, 2) the same with W = Sigma^-1
    unweighted: Array | None     # (2, 2) the same with W = I
    map: Array                   # (CELLS, CELLS) min(DOP, CUT) over x and y
    lowest: float                # least DOP on the map
    spread: Spread
    growth: Array                # (SIGMAS_M, 2) rms error / promised rms error, share without a solution
    traces: Array                # (2, WEIGHTS) rms error when the weight of station 2, or 3, is another


def ground(p: "Params", progress: Progress) -> Ground:
    """DOP everywhere, covariances at the user, and the experiments."""
    k = 3 if p.third else 2
    stations = np.array([p.station_1, p.station_2, p.station_3][:k])
    ratios = np.array([1.0, p.ratio_2, p.ratio_3][:k])
    W, user = np.array([1.0, p.weight_2, p.weight_3][:k]), np.array(p.user)
    J = Range(stations, 1.0).jacobian(user)
    sigma = p.sigma_m * ratios
    DOP = dop(Range(stations, 1.0).jacobian(states_on_grid([AXIS, AXIS])), clock=False).gdop
    progress(0.2)
    noise = np.random.default_rng(p.seed).standard_normal((DRAWS, 3))[:, :k]
    V = _covariance(J, W, sigma)
    growth = []
    for i, s in enumerate(SIGMAS_M):
        spread = experiments(stations, user, s * ratios, W, noise)
        growth.append(_growth(spread, user, V, s / p.sigma_m))
        progress(0.2 + 0.6 * (i + 1) / len(SIGMAS_M))
    return Ground(
        stations, sigma, W, J, dop(J, clock=False), V, _covariance(J, 1.0 / sigma**2, sigma),
        _covariance(J, np.ones(k), sigma), np.minimum(DOP, CUT), float(DOP.min()),
        experiments(stations, user, sigma, W, noise), np.array(growth),
        np.array([[rms(_covariance(J, np.where(np.arange(k) == i, w, W), sigma)) for w in WEIGHTS] for i in (1, 2)]))


def experiments(stations: Array, user: Array, sigma: Array, W: Array, noise: Array) -> Spread:
    """Gauss-Newton from the true position for every row of noise (..., m) of standard deviation 1."""
    y = Range(stations, 1.0).h(user) + sigma * noise
    runs = gauss_newton_batch(Range(stations, 1.0 / np.sqrt(W)), y, user, max_iterations=25)
    found = runs.converged & (np.abs(runs.x) < 1e4).all(axis=-1)
    return Spread(np.where(found[:, None], runs.x, np.nan), found)


def rms(V: Array | None) -> float:
    """sqrt(tr V), infinite without a V."""
    return np.inf if V is None else float(np.sqrt(np.trace(V)))


def _covariance(J: Array, W: Array, sigma: Array) -> Array | None:
    """(2.6) for a general weight, exercise 2.5; None where J has dependent columns."""
    try:
        return position_covariance(J, W, sigma**2)
    except ValueError:
        return None


def _growth(spread: Spread, user: Array, V: Array | None, scale: float) -> tuple[float, float]:
    """How many times the promised size the errors have, and the share of experiments without a solution."""
    missing = 1.0 - float(spread.found.mean())
    if V is None or spread.found.sum() < 10:
        return np.nan, missing
    error = np.cov(spread.x[spread.found].T)
    return float(np.sqrt(np.trace(error) / np.trace(V)) / scale), missing
