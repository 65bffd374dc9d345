"""Ranges of which one is garbage: tests, leaving it out, robust weights; and a sector that confines the position."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.closed_form import multilaterate
from core.constrained import Constrained, constrained_least_squares, sector
from core.gauss_newton import Solution, gauss_newton, gauss_newton_batch
from core.residual_test import (
    Exclusion,
    LeaveOneOut,
    ResidualTest,
    exclude,
    leave_one_out,
    residual_test,
    smallest_detectable,
)
from core.robust import huber
from core.sensors import Range
from core.types import Array
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.static.garbage_measurements import Params

LARGEST = 6                                  # stations
SWEEP_M = np.linspace(-80.0, 100.0, 19)      # errors of the bad range in the plots
REPEATS = 300                                # experiments in the sector
MISSED = 0.2                                 # of errors as large as the smallest detectable one


class Robustly(NamedTuple):
    """Huber's estimate, step by step: row i belongs to the iterate x_i."""

    iterates: Array              # (k + 1, 2)
    weights: Array               # (k + 1, m)
    converged: bool


class Garbage(NamedTuple):
    """One set of ranges and all that can be done about it."""

    stations: Array              # (m, 2)
    y: Array                     # (m,)
    bad: int                     # the row that is wrong
    fix: Solution
    test: ResidualTest
    detectable: Array            # (m,) smallest detectable errors
    single: LeaveOneOut
    cleaned: Exclusion
    robust: Robustly
    errors: Array                # (SWEEP_M, 3) of least squares, after the test, robust


class Confined(NamedTuple):
    """One set of ranges, and the knowledge that the user is in the sector."""

    stations: Array
    y: Array
    fix: Solution
    G: Array                     # (2, 2) G x <= g: clockwise edge first
    g: Array                     # (2,)
    inside: Constrained
    free: Array                  # (REPEATS, 2) estimates of repeated experiments, NaN where not converged
    confined: Array              # (REPEATS, 2) the same with the sector


def measured(p: "Params", error_m: float | None = None) -> tuple[Array, Array]:
    """Stations (m, 2) and ranges (m,); the noise of a station does not depend on how many there are."""
    stations = np.array([getattr(p, f"station_{i + 1}") for i in range(p.count)])
    y = Range(stations, 1.0).h(np.array(p.user)) + p.sigma_m * np.random.default_rng(p.seed).standard_normal(LARGEST)[
        :p.count]
    y[bad_row(p)] += p.error_m if error_m is None else error_m
    return stations, np.maximum(y, 0.0)


def bad_row(p: "Params") -> int:
    return min(p.bad, p.count) - 1


def start(stations: Array, y: Array) -> Array:
    """The closed form of exercise 2.8, or the point half-way between its complex roots."""
    found = multilaterate(stations, y)
    return found.best if np.isfinite(found.best).all() else found.middle


def solve(sensor: Range, y: Array) -> Solution:
    """Least squares from the closed form; damped where plain Gauss-Newton does not settle."""
    x0 = start(np.asarray(sensor.stations_m), y)
    fix = gauss_newton(sensor, y, x0)
    return fix if fix.converged else gauss_newton(sensor, y, x0, damping=1e-3)


def garbage(p: "Params", progress: Progress) -> Garbage | None:
    """None where the stations do not determine a position."""
    try:
        return _garbage(p, progress)
    except ValueError:
        return None


def _garbage(p: "Params", progress: Progress) -> Garbage:
    stations, y = measured(p)
    sensor = Range(stations, p.sigma_m)
    fix = solve(sensor, y)
    errors = []
    for i, error in enumerate(SWEEP_M):
        progress(0.1 + 0.8 * i / len(SWEEP_M))
        other = measured(p, float(error))[1]
        plain = solve(sensor, other).x
        without = exclude(sensor, other, plain, false_alarm=p.false_alarm).x
        errors.append([plain, without, huber(sensor, other, plain, threshold=p.huber).x])
    off = np.array(errors) - np.array(p.user)
    return Garbage(
        stations, y, bad_row(p), fix, residual_test(sensor, y, fix.x, false_alarm=p.false_alarm),
        smallest_detectable(sensor, fix.x, false_alarm=p.false_alarm, missed=MISSED),
        leave_one_out(sensor, y, fix.x), exclude(sensor, y, fix.x, false_alarm=p.false_alarm),
        _robustly(sensor, y, fix.x, p.huber), np.sqrt(np.square(off).sum(axis=-1)))


def _robustly(sensor: Range, y: Array, x0: Array, threshold: float) -> Robustly:
    found = huber(sensor, y, x0, threshold=threshold)
    z = np.abs(sensor.innovation(y, sensor.h(found.iterates))) * sensor.precision
    return Robustly(found.iterates, threshold / np.maximum(z, threshold), found.converged)


def confined(p: "Params") -> Confined | None:
    """None where the stations do not determine a position."""
    try:
        return _confined(p)
    except ValueError:
        return None


def _confined(p: "Params") -> Confined:
    stations, y = measured(p)
    sensor, user = Range(stations, p.sigma_m), np.array(p.user)
    fix = solve(sensor, y)
    G, g = sector(stations[0], np.radians(p.direction_deg), np.radians(p.width_deg))
    noise = np.random.default_rng([p.seed, 1]).standard_normal((REPEATS, p.count))
    ys = sensor.h(user) + p.sigma_m * noise
    runs = gauss_newton_batch(sensor, ys, user)
    found = runs.converged & (np.abs(runs.x) < 1e4).all(axis=-1)
    free, held = np.full((2, REPEATS, 2), np.nan)
    free[found] = runs.x[found]
    if found.any():
        held[found] = constrained_least_squares(sensor, ys[found], runs.x[found], G, g, max_iterations=15).x
    return Confined(stations, y, fix, G, g, constrained_least_squares(sensor, y, fix.x, G, g), free, held)


def outside_m(r: Confined, x: Array) -> Array:
    """How far x (..., 2) lies beyond the edges of the sector, in metres; 0 inside."""
    return np.maximum((x @ r.G.T - r.g).max(axis=-1), 0.0)


def repeated(p: "Params", r: Confined) -> tuple[Array, Array, Array]:
    """Errors (k,) in metres without and with the sector, and whether the sector changed the estimate."""
    good = np.isfinite(r.free).all(axis=1) & np.isfinite(r.confined).all(axis=1)
    off = np.stack([r.free[good], r.confined[good]]) - np.array(p.user)
    error = np.sqrt(np.square(off).sum(axis=-1))
    return error[0], error[1], outside_m(r, r.free[good]) > 1e-6
