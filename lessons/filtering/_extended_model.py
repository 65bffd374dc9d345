"""The measurement that the extended filter linearises, the true posterior on a grid, and how much h bends."""

from typing import TYPE_CHECKING

import numpy as np

from core import extended, grid
from core.gaussian import chi_square_level, mahalanobis_squared
from core.linalg import cholesky_psd
from core.sensors import Bearing, Range, RangeDifference
from core.types import Array, Gaussian, Sensor
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.filtering.extended import Params

PROBABILITY = 0.68
KEEP = 1e-7               # the grid covers cells whose posterior weight exceeds this share of the largest


def prior_of(p: "Params") -> Gaussian:
    """The law of the position before the measurement."""
    s = np.array([p.sigma_x_m, p.sigma_y_m])
    return Gaussian(np.array(p.mean), s[:, None] * np.array([[1.0, p.correlation], [p.correlation, 1.0]]) * s)


def sensor_of(p: "Params") -> Sensor:
    """The chosen sensor at the chosen stations."""
    match p.sensor:
        case "range":
            return Range([p.station_1], p.sigma_m)
        case "bearing":
            return Bearing([p.station_1], np.radians(p.sigma_deg))
        case "difference":
            return RangeDifference([p.station_1, p.station_2], p.sigma_m)
        case _:
            return Range([p.station_1, p.station_2], p.sigma_m)


def measured(sensor: Sensor, truth: Array, error: float) -> Array:
    """h(truth) + error sigma."""
    return sensor.h(truth) + error * np.sqrt(np.diagonal(sensor.R))


def exact_posterior(prior: Gaussian, y: Array, sensor: Sensor, cells: int, coarse: int = 80) -> grid.GridDensity:
    """p(x) p(y | x) on `cells` x `cells` cells that cover what a coarse look finds to matter.

    In the coarse look the noise is widened by what h changes across a cell, so that a thin ring cannot slip through.
    """
    wide = grid.gaussian_axes(prior, coarse, width=5.0)
    first = grid.from_gaussian(prior, wide)
    blur = np.square(np.linalg.norm(sensor.jacobian(first.points) * first.spacing, axis=-1))
    residual = sensor.innovation(y, sensor.h(first.points))
    variance = np.diagonal(sensor.R) + blur
    logs = first.log_weights - 0.5 * (np.square(residual) / variance + np.log(variance)).sum(axis=-1)
    matters = logs > logs.max() + np.log(KEEP)
    axes = []
    for i, axis in enumerate(wide):
        used = np.flatnonzero(matters.any(axis=1 - i))
        step = axis[1] - axis[0]
        axes.append(grid.cells(axis[used[0]] - step, axis[used[-1]] + step, cells))
    return grid.update(grid.from_gaussian(prior, axes), y, sensor).posterior


def share_inside(law: Gaussian, exact: grid.GridDensity, probability: float = PROBABILITY) -> float:
    """The true probability of the ellipse that claims to hold `probability`."""
    inside = mahalanobis_squared(law, exact.points) <= chi_square_level(probability, 2)
    return float(exact.weights[inside].sum())


def bend(prior: Gaussian, sensor: Sensor) -> float:
    """sqrt(E |(h(x) - h(x-) - H (x - x-)) / sigma|^2) over the prior: what the tangent misses, in noise sigmas.

    Below about 0.5 the extended filter is as good as exact.
    """
    p = grid.from_gaussian(prior, grid.gaussian_axes(prior, 60, width=4.0))
    H = sensor.jacobian(prior.mean)
    missed = sensor.innovation(sensor.h(p.points), sensor.h(prior.mean) + (p.points - prior.mean) @ H.T)
    return float(np.sqrt((p.weights * np.square(missed / np.sqrt(np.diagonal(sensor.R))).sum(axis=-1)).sum()))


def most_bent(prior: Gaussian, sensor: Sensor, x: Array) -> Array:
    """One prior standard deviation (2,) in the direction in which the first row of h bends most across the prior.

    L v, where v is the eigenvector of L' h'' L with the largest |eigenvalue|, P = L L'; h'' from differences of h'.
    """
    L = cholesky_psd(prior.cov)
    step = 1e-4 * float(np.sqrt(np.trace(prior.cov)))
    slopes = [sensor.jacobian(x + step * e)[0] - sensor.jacobian(x - step * e)[0] for e in np.eye(2)]
    B = L.T @ np.array(slopes) @ L
    values, vectors = np.linalg.eigh(0.5 * (B + B.T))
    u = L @ vectors[:, np.abs(values).argmax()]
    return u if u[0] + 1e-9 * u[1] >= 0 else -u


def picture_box(p: "Params", prior: Gaussian, exact: grid.GridDensity, first: Array) -> Array:
    """Corners (2, 2) of what must be visible; `first` is the EKF's estimate."""
    reach = 2.1 * np.sqrt(np.diagonal(prior.cov))
    law = grid.moments(exact)
    spread = 2.2 * np.sqrt(np.diagonal(law.cov))
    parts = [prior.mean - reach, prior.mean + reach, law.mean - spread, law.mean + spread,
             np.clip(first, prior.mean - 1.5 * reach, prior.mean + 1.5 * reach)]
    if p.zoom == "all":
        parts += [np.array(p.truth), np.array(p.station_1)]
        parts += [np.array(p.station_2)] if p.sensor in ("difference", "two_ranges") else []
    low, high = np.min(parts, axis=0), np.max(parts, axis=0)
    margin = 0.08 * float((high - low).max())
    return np.array([low - margin, high + margin])


def shares_by_spread(p: "Params", factors: Array, iterations: int, progress: Progress) -> Array:
    """share_inside of the EKF's and the iterated filter's ellipse, (k, 2), for narrower and wider priors.

    The prior's sigmas and the truth's distance from its mean are multiplied together, so that the truth stays as
    likely as it is.
    """
    sensor, prior, found = sensor_of(p), prior_of(p), []
    for i, c in enumerate(factors):
        progress(0.2 + 0.7 * i / len(factors))
        wider = Gaussian(prior.mean, c**2 * prior.cov)
        y = measured(sensor, prior.mean + c * (np.array(p.truth) - prior.mean), p.error)
        exact = exact_posterior(wider, y, sensor, 100, 60)
        steps = extended.iterate(wider, y, sensor, iterations)
        found.append([share_inside(step.posterior, exact) for step in (steps[0], steps[-1])])
    return np.array(found)
