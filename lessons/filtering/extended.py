"""One update of the extended Kalman filter in slow motion: a tangent instead of h.  MAT 3.3.1, Algorithm 4."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import extended, grid
from core.gaussian import mahalanobis_squared
from core.kalman import Update
from core.likelihood import likelihood_map, weighted_cost
from core.types import Array, Gaussian, Sensor
from lessons.filtering._extended_model import (
    bend,
    exact_posterior,
    measured,
    most_bent,
    picture_box,
    prior_of,
    sensor_of,
    share_inside,
    shares_by_spread,
)
from lessons.filtering._extended_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, slider

ITERATIONS = 10
CELLS = 200                                  # per axis of the grid behind the true posterior
MAP = 90                                     # per axis of the drawn likelihood
FACTORS = np.geomspace(0.1, 2.0, 14)         # of the prior's sigmas in the plot of the shares
UNUSED = {"range": {"sigma_deg", "station_2"}, "bearing": {"sigma_m", "station_2"}, "difference": {"sigma_deg"},
          "two_ranges": {"sigma_deg"}}


@dataclass(frozen=True, slots=True)
class Params:
    """What is measured, what is known before, and where the user really is."""

    sensor: str = choice("range", ("range", "bearing", "difference", "two_ranges"), group="measurement")
    sigma_m: float = slider(3.0, low=2.0, high=50.0, unit="m", log=True, group="measurement")
    sigma_deg: float = slider(3.0, low=1.0, high=30.0, unit="°", log=True, group="measurement")
    error: float = slider(0.0, low=-3.0, high=3.0, step=0.1, unit="σ", group="measurement")
    sigma_x_m: float = slider(30.0, low=2.0, high=60.0, unit="m", group="prior")
    sigma_y_m: float = slider(10.0, low=2.0, high=60.0, unit="m", group="prior")
    correlation: float = slider(0.7, low=-0.95, high=0.95, step=0.05, group="prior")
    mean: Point = draggable((15.0, 70.0), role="prior", group="points")
    truth: Point = draggable((65.0, 85.0), role="truth", group="points")
    station_1: Point = draggable((0.0, 0.0), role="station", group="points")
    station_2: Point = draggable((60.0, 0.0), role="station", group="points")
    zoom: str = choice("all", ("all", "prior"), group="view")
    axis: str = choice("x", ("x", "y"), group="view")


class Result(NamedTuple):
    """The true posterior, and the filter's at every linearisation; index i belongs to the tangent at x_i."""

    sensor: Sensor
    prior: Gaussian
    y: Array                     # (m,) in m or rad
    exact: grid.GridDensity
    moments: Gaussian            # of the true posterior
    mode: Array                  # (2,)
    updates: tuple[Update, ...]  # ITERATIONS of them
    points: Array                # (ITERATIONS + 1, 2) x_0 = prior mean, x_1 = EKF, ...
    cost: Array                  # (ITERATIONS + 1,) |y - h(x_i)|^2 / R + |x_i - x-|^2 / P
    cost_at_mode: float
    inside: Array                # (ITERATIONS,) true probability of the 68 % ellipses
    off: Array                   # (ITERATIONS,) distance from the true mean, in m
    bend: float                  # what the tangent misses across the prior, in sigmas of the noise
    bent: Array                  # (ITERATIONS, 2) one prior sigma in the direction in which h bends most at x_i
    box: Array                   # (2, 2) corners of the picture
    map_axes: tuple[Array, Array]
    likelihood: Array            # (MAP, MAP) over the axes x, y, relative to its largest value
    shares: Array                # (FACTORS, 2) of the EKF and of the iterated filter for narrower and wider priors


def compute(p: Params, progress: Progress) -> Result:
    """Measures from the truth, updates on a grid, and with the tangent, again and again."""
    prior, sensor = prior_of(p), sensor_of(p)
    y = measured(sensor, np.array(p.truth), p.error)
    exact = exact_posterior(prior, y, sensor, CELLS)
    moments = grid.moments(exact)
    progress(0.1)

    def cost(x: Array) -> Array:
        return weighted_cost(sensor, y, x) + mahalanobis_squared(prior, x)

    updates = extended.iterate(prior, y, sensor, ITERATIONS)                 # Algorithm 4 with (3.15), then again
    points = np.vstack([prior.mean, [u.posterior.mean for u in updates]])
    progress(0.2)
    mode = grid.mode(exact)
    box = picture_box(p, prior, exact, points[1])
    map_axes = tuple(grid.cells(low, high, MAP) for low, high in box.T)
    shares = shares_by_spread(p, FACTORS, ITERATIONS, progress)
    return Result(
        sensor, prior, y, exact, moments, mode, updates, points, cost(points), float(cost(mode)),
        np.array([share_inside(u.posterior, exact) for u in updates]),
        np.linalg.norm(points[1:] - moments.mean, axis=1), bend(prior, sensor),
        np.array([most_bent(prior, sensor, x) for x in points[:-1]]), box, map_axes,
        likelihood_map(sensor, y, map_axes).relative, shares)


def timeline(p: Params) -> Timeline:
    """Linearisations at x_0 (the EKF), x_1, x_2, ...: each of them in five stages."""
    return Timeline(ITERATIONS - 1, ("prior", "likelihood", "posterior", "tangent", "update"), unit_name="i")


# The point whose ranges to (-250, 0) and (250, 0) are 118 m and 390 m: the oracle's measurement (C3-17).
EXAMPLE_22 = {"sensor": "two_ranges", "sigma_m": 10.0, "sigma_x_m": math.sqrt(1276.0 / 3.0),
              "sigma_y_m": math.sqrt(1276.0 / 3.0), "correlation": 0.0, "mean": (-147.0, -27.0),
              "truth": (-138.176, -math.sqrt(118.0**2 - 111.824**2)), "station_1": (-250.0, 0.0),
              "station_2": (250.0, 0.0), "zoom": "prior"}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=lambda p: UNUSED[p.sensor],
    refs=("MAT 3.3.1", "MAT Algorithm 4", "MAT (3.15)", "MAT Example 22"),
    presets={
        "a range from close by": {},
        "the same from far away": {"station_1": (0.0, -600.0), "zoom": "prior"},
        "a bearing": {"sensor": "bearing", "mean": (-20.0, 40.0), "sigma_x_m": 15.0, "sigma_y_m": 25.0,
                      "truth": (10.0, 60.0)},
        "a range difference": {"sensor": "difference", "mean": (10.0, 60.0), "sigma_x_m": 40.0, "sigma_y_m": 10.0,
                               "correlation": 0.5, "truth": (60.0, 65.0), "station_1": (-50.0, 0.0),
                               "station_2": (50.0, 0.0)},
        "two peaks": {"mean": (5.0, 40.0), "sigma_x_m": 30.0, "sigma_y_m": 10.0, "correlation": 0.0,
                      "truth": (45.0, 40.0)},
        "iterations that do not settle": {"mean": (-35.0, 60.0), "sigma_x_m": 30.0, "sigma_y_m": 20.0,
                                          "correlation": 0.5, "truth": (-20.0, 35.0), "step": 9},
        "Example 22, first step": EXAMPLE_22,
    },
)
