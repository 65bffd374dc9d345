"""Ranges in the plane with a flat prior: the exact posterior on a grid, and the linearised one.  MAT Example 19."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core import grid
from core.gaussian import chi_square_level, mahalanobis_squared
from core.likelihood import likelihood_map, linearised_posterior
from core.sensors import Range
from core.types import Array, Gaussian
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.static.bayes import Params

COARSE, FINE, MAP = 120, 180, 110         # cells per axis: the first look, the posterior, the drawn likelihood
KEEP = 1e-9                               # of the highest density: less is not covered by the fine grid
SCALES = np.linspace(-2.0, 2.0, 13)       # times the realised errors
PROBABILITY = 0.68


class Step(NamedTuple):
    """The first k ranges together: the posterior of k - 1 of them times the likelihood of the last."""

    sensor: Range
    y: Array                     # (k,) m
    dy: Array                    # (k,) m, realised errors
    exact: grid.GridDensity
    law: Gaussian                # its moments
    linear: Gaussian | None      # None where the ranges do not determine a point
    J: Array                     # (k, 2) at the truth
    inside: float                # exact probability of the linearised 68 % ellipse
    ring: Array                  # (MAP, MAP) likelihood of the last range over the picture, relative


class Plane2D(NamedTuple):
    """steps[k - 1] has k ranges."""

    steps: tuple[Step, ...]
    box: Array                   # (2, 2) corners of the picture
    axes: tuple[Array, Array]    # of the drawn likelihood
    rms: Array                   # (SCALES,) sqrt tr V of the exact posterior for larger and smaller errors


def plane(p: "Params", progress: Progress) -> Plane2D:
    """One range after the other, measured from the truth with given errors."""
    stations = np.array([p.station_1, p.station_2, p.station_3])
    dy, truth = np.array([p.dy1_m, p.dy2_m, p.dy3_m]), np.array(p.truth)
    parts = []
    for k in range(1, 4):
        sensor = Range(stations[:k], p.sigma_range_m)
        y = sensor.h(truth) + dy[:k]
        exact = posterior(sensor, y, FINE)
        try:
            linear = linearised_posterior(sensor, y, truth) if k > 1 else None
        except ValueError:
            linear = None
        parts.append((sensor, y, exact, grid.moments(exact), linear))
        progress(0.15 * k)
    box = _box(p, [g for *_, law, linear in parts[1 if p.zoom == "all" else 2:] for g in (law, linear) if g], stations)
    axes = tuple(grid.cells(float(low), float(high), MAP) for low, high in box.T)
    steps = []
    for k, (sensor, y, exact, law, linear) in enumerate(parts, 1):
        ring = likelihood_map(Range(stations[k - 1:k], p.sigma_range_m), y[-1:], axes).relative
        inside = np.nan if linear is None else float(
            exact.weights[mahalanobis_squared(linear, exact.points) <= chi_square_level(PROBABILITY, 2)].sum())
        steps.append(Step(sensor, y, dy[:k], exact, law, linear, sensor.jacobian(truth), inside, ring))
    rms = []
    for i, scale in enumerate(SCALES):
        progress(0.5 + 0.5 * i / len(SCALES))
        law = grid.moments(posterior(steps[-1].sensor, steps[-1].sensor.h(truth) + scale * dy, 100))
        rms.append(float(np.sqrt(np.trace(law.cov))))
    return Plane2D(tuple(steps), box, axes, np.array(rms))


def posterior(sensor: Range, y: Array, cells: int) -> grid.GridDensity:
    """p(y | x) normalised, on `cells` x `cells` cells that cover what coarser looks find to matter.

    In the first look the noise is widened by what a range changes across a cell, so that no thin ring slips through.
    """
    sigma = np.sqrt(np.diagonal(sensor.R))
    s = np.asarray(sensor.stations_m)
    reach = (np.maximum(y, 0.0) + 5.0 * sigma)[:, None]
    low, high = (s - reach).min(axis=0), (s + reach).max(axis=0)
    axes = tuple(grid.cells(float(a), float(b), COARSE) for a, b in zip(low, high, strict=True))
    variance = sigma**2 + float(np.square([a[1] - a[0] for a in axes]).sum())
    logs = -0.5 * (np.square(y - sensor.h(grid.mesh(axes))) / variance).sum(axis=-1)
    first = grid.update(grid.uniform(_covering(axes, logs, cells)), y, sensor).posterior
    return grid.update(grid.uniform(_covering(first.axes, first.log_weights, cells)), y, sensor).posterior


def _covering(axes: tuple[Array, ...], logs: Array, cells: int) -> tuple[Array, ...]:
    """Axes of `cells` cells round all places that matter, and one old cell more at each end."""
    matters = logs > logs.max() + np.log(KEEP)
    found = []
    for i, axis in enumerate(axes):
        used, step = np.flatnonzero(matters.any(axis=1 - i)), axis[1] - axis[0]
        found.append(grid.cells(float(axis[used[0]] - step), float(axis[used[-1]] + step), cells))
    return tuple(found)


def _box(p: "Params", laws: list[Gaussian], stations: Array) -> Array:
    """Corners of the picture: round these laws, and all stations if they are wanted."""
    points = [np.array([p.truth]), np.array([p.guess])]
    if p.zoom == "all":
        points.append(stations)
    for g in laws:
        half = 2.5 * np.sqrt(np.diagonal(g.cov))
        points += [np.array([g.mean - half, g.mean + half])]
    every = np.clip(np.concatenate(points), -400.0, 400.0)
    low, high = every.min(axis=0), every.max(axis=0)
    pad = 0.08 * float((high - low).max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + pad
    half = np.maximum(half, 0.85 * half.max())            # no strips
    return np.array([middle - half, middle + half])
