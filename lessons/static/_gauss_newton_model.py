"""The runs of the Gauss-Newton lesson: from one start, and from every place of the map."""

from typing import TYPE_CHECKING

import numpy as np

from core.closed_form import multilaterate
from core.gauss_newton import Solution, Solutions, basins, gauss_newton, gauss_newton_batch
from core.sensors import Range
from core.types import Array

if TYPE_CHECKING:
    from lessons.static.gauss_newton import Params

LIMIT = 40                                   # iterations
LOW, HIGH = -50.0, 150.0                     # the square of exercise 2.16
MARGIN_M = 15.0                              # round a solution
SAME_M = 1.0                                 # ends closer than this are one


def sensor_of(p: "Params") -> Range:
    """The stations in use."""
    stations = np.array([p.station_1, p.station_2, p.station_3])[:p.count]
    return Range(stations, np.array([p.sigma_1_m, p.sigma_2_m, p.sigma_3_m])[:p.count])


def measured(p: "Params") -> Array:
    """The ranges (m,) to the stations in use."""
    return np.array([p.y_1_m, p.y_2_m, p.y_3_m])[:p.count]


def run(p: "Params", weighted: bool) -> Solution | None:
    """All steps from the start; None where the Jacobian is singular there."""
    try:
        return gauss_newton(sensor_of(p), measured(p), np.array(p.start), weighted=weighted, **_options(p))
    except ValueError:
        return None


def all_starts(p: "Params", points: Array) -> Solutions:
    """The same method from all points (..., 2)."""
    return gauss_newton_batch(sensor_of(p), measured(p), points, weighted=p.weighted, **_options(p))


def _options(p: "Params") -> dict:
    return {"tolerance": p.tolerance_m, "max_iterations": LIMIT, "damping": p.damping if p.damped else None}


def sorted_ends(runs: Solutions, y: Array, sensor: Range) -> tuple[Array, Array]:
    """The ends (s, 2) of at least one start in a thousand, at most three, and the number of each run's end.

    The best fit comes first; of equally good ones the western one.
    """
    left = runs.x[runs.converged]
    enough = max(1.0, 1e-3 * runs.steps.size)
    found: list[Array] = []
    while len(left) >= enough and len(found) < 3:
        near = np.linalg.norm(left - left[0], axis=-1) < SAME_M
        if near.sum() >= enough:
            found.append(np.median(left[near], axis=0))
        left = left[~near]
    if not found:
        return np.empty((0, 2)), np.full(runs.steps.shape, -1)
    ends = np.array(found)
    misfit = np.linalg.norm(sensor.h(ends) - y, axis=-1)
    ends = ends[np.lexsort((ends[:, 0], misfit.round(1)))]
    return ends, basins(runs, ends, radius=SAME_M)


def residual_norms(p: "Params", points: Array) -> Array:
    """What is minimised, before squaring: |p(x)| in m, or (p' R^-1 p)^(1/2) without unit if weighted."""
    sensor = sensor_of(p)
    residual = sensor.h(points) - measured(p)
    return np.linalg.norm(residual / np.sqrt(np.diagonal(sensor.R)) if p.weighted else residual, axis=-1)


def picture_box(p: "Params") -> Array:
    """Corners (2, 2) of a square: that of exercise 2.16, larger for stations, starts and solutions outside it."""
    stations = sensor_of(p).stations_m
    points = [(LOW, LOW), (HIGH, HIGH), p.start, *stations]
    if p.count == 2 and np.linalg.norm(stations[1] - stations[0]) > SAME_M:
        roots = multilaterate(stations, measured(p)).roots
        points += [root + side * MARGIN_M for root in roots if np.isfinite(root).all() for side in (-1.0, 1.0)]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
    return np.array([middle - half, middle + half])
