"""The two problems of the closed-form lesson, solved at once and by iteration, with and without noise."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.closed_form import ClosedForm, bancroft, multilaterate
from core.dop import dop
from core.gauss_newton import gauss_newton, gauss_newton_batch
from core.sensors import Pseudorange, Range
from core.types import Array
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.static.closed_form import Params

EXPERIMENTS = 50
DRAWS = 200                                  # per point of the plot of the rms errors
MEGAMETRE = 1e6


class Problem(NamedTuple):
    """What is measured from where; positions and clock biases in metres."""

    stations_m: Array            # (m, n)
    truth: Array                 # (n,) or (n + 1,), then with the clock bias
    sensor: Pseudorange | Range
    given: Array                 # (m,) errors of the first measurements
    sigma_m: float
    unit_m: float                # length of a unit in the scene and in the formulas


class Spread(NamedTuple):
    """Root mean square errors of the position over DRAWS experiments for each noise."""

    sigmas_m: Array              # (s,)
    closed_m: Array              # (s,)
    gauss_newton_m: Array        # (s,)
    linear_m: Array              # (s,) sigma DOP
    without: Array               # (s,) share of experiments without a real root


def problem_of(p: "Params") -> Problem:
    """Satellites around the globe, or stations in the plane."""
    if p.mode == "globe":
        satellites = MEGAMETRE * np.array([p.sat_1, p.sat_2, p.sat_3, p.sat_4, p.sat_5, p.sat_6])[:p.count]
        truth = np.append(MEGAMETRE * np.array(p.user), 1e3 * p.clock_km)
        return Problem(satellites, truth, Pseudorange(satellites, p.sigma_m), np.zeros(p.count), p.sigma_m, MEGAMETRE)
    stations = np.array([p.station_1, p.station_2, p.station_3])[:p.stations]
    given = np.array([p.error_1_m, p.error_2_m, p.error_3_m])[:p.stations]
    return Problem(stations, np.array(p.place), Range(stations, p.sigma_m), given, p.sigma_m, 1.0)


def measurements(problem: Problem, p: "Params") -> Array:
    """The given measurements, then EXPERIMENTS with normal errors; no range is negative."""
    noise = problem.sigma_m * np.random.default_rng(p.seed).standard_normal((EXPERIMENTS, len(problem.given)))
    return positive(problem, problem.sensor.h(problem.truth) + np.vstack([problem.given, noise]))


def positive(problem: Problem, y: Array) -> Array:
    """y, without negative ranges; a pseudorange may be negative."""
    return y if isinstance(problem.sensor, Pseudorange) else np.maximum(y, 0.0)


def closed(problem: Problem, y: Array) -> ClosedForm | None:
    """Both roots for every row of y; None where satellites coincide or lie in a line."""
    try:
        return (bancroft if isinstance(problem.sensor, Pseudorange) else multilaterate)(problem.stations_m, y)
    except ValueError:
        return None


def nearest(problem: Problem, fix: ClosedForm) -> Array:
    """The position of the root that is taken.

    Two ranges fit both roots: the one nearer to the truth, as if it were known roughly.  Else the better fit.
    """
    n = problem.stations_m.shape[1]
    if problem.stations_m.shape[0] > n or len(problem.truth) > n:
        return fix.best[..., :n]
    off = np.linalg.norm(fix.roots - problem.truth, axis=-1)
    off = np.where(fix.admissible, off, np.inf)
    chosen = np.take_along_axis(fix.roots, off.argmin(axis=-1)[..., None, None], axis=-2)[..., 0, :]
    return np.where(fix.admissible.any(axis=-1, keepdims=True), chosen, np.nan)


def iterated(problem: Problem, y: Array) -> Array:
    """Gauss-Newton's positions for every row of y, from the centre of the Earth or from the true place."""
    n = problem.stations_m.shape[1]
    start = np.zeros(n + 1) if len(problem.truth) > n else problem.truth
    try:
        runs = gauss_newton_batch(problem.sensor, y, start)
    except ValueError:
        return np.full((len(y), n), np.nan)
    return np.where(runs.converged[:, None], runs.x[:, :n], np.nan)


def from_afar(problem: Problem, y: Array) -> Array:
    """Errors of Gauss-Newton's iterates in metres; it begins at zero: the centre of the Earth."""
    n = problem.stations_m.shape[1]
    try:
        fix = gauss_newton(problem.sensor, y, np.zeros(len(problem.truth)), max_iterations=12)
    except ValueError:
        return np.zeros(0)
    return np.linalg.norm(fix.iterates[:, :n] - problem.truth[:n], axis=-1)


def spread(problem: Problem, seed: int, progress: Progress) -> Spread | None:
    """The same errors, scaled from small to large; None where some of them have no closed form."""
    n = problem.stations_m.shape[1]
    sigmas = np.geomspace(0.1, 1e5 if problem.unit_m > 1.0 else 100.0, 13)
    unit = np.random.default_rng(seed).standard_normal((DRAWS, len(problem.given)))
    exact = problem.sensor.h(problem.truth)
    rows = []
    for i, sigma in enumerate(sigmas):
        progress(0.5 + 0.5 * i / len(sigmas))
        y = positive(problem, exact + sigma * unit)
        fix = closed(problem, y)
        if fix is None:
            return None
        off, other = (np.linalg.norm(x - problem.truth[:n], axis=-1) for x in (nearest(problem, fix),
                                                                               iterated(problem, y)))
        both = np.isfinite(off) & np.isfinite(other)
        rms = [float(np.sqrt(np.mean(np.square(e[both])))) if both.any() else np.nan for e in (off, other)]
        rows.append((*rms, float(np.isnan(fix.roots).any(axis=(-1, -2)).mean())))
    closed_m, gauss_newton_m, without = np.array(rows).T
    pdop = float(dop(problem.sensor.jacobian(problem.truth), clock=len(problem.truth) > n).pdop)
    return Spread(sigmas, closed_m, gauss_newton_m, sigmas * pdop, without)
