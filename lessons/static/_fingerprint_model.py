"""a_i = mean power at p_i, y = a_i + v: the hall with its radio field, the survey of it, and what a scan tells.

MAT exercise 2.9.  The field of an access point is path loss and shadowing: a smooth normal random field with
covariance s^2 exp(-|d|^2 / 2 l^2), as a sum of waves with random directions and phases.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.grid import GridDensity, cells, mesh, uniform
from core.grid import multiply as bayes
from core.sensors_radio import Fingerprint, SignalStrength
from core.types import Array

if TYPE_CHECKING:
    from lessons.static.fingerprint import Params

SIDE_M = 50.0                # of the square hall
POWER_DBM = -40.0            # at 1 m
WAVES = 64
LIMIT = 24                   # survey points set by hand
METHODS = ("nn", "knn", "wknn", "mean")
PROBABILITY = 0.95           # of the region


class Field(NamedTuple):
    """What the access points are received with: path loss, and shadowing by waves."""

    loss: SignalStrength
    waves: Array             # (m, WAVES, 2) wave numbers, rad/m
    phases: Array            # (m, WAVES)
    shadow_db: float

    def power(self, x: Array) -> Array:
        """Mean powers (..., m) in dBm at x (..., 2)."""
        shadow = np.cos(np.einsum("mwc,...c->...mw", self.waves, x) + self.phases).sum(axis=-1)
        return self.loss.h(x) + self.shadow_db * np.sqrt(2.0 / WAVES) * shadow


class RadioMap(NamedTuple):
    """The data base: points with their mean powers, and the cells of the hall that are nearest to each of them."""

    sensor: Fingerprint
    index: Array             # (n, n) the point nearest to each cell
    share: Array             # (k,) of the hall
    centroids: Array         # (k, 2) of these parts; the point itself where there is none


class Performance(NamedTuple):
    """Many scans at places all over the hall."""

    errors: Array            # (N, METHODS) m
    covered: float           # share of the scans whose 95 % region held the true place

    @property
    def rms(self) -> Array:
        """(METHODS,) m."""
        return np.sqrt(np.square(self.errors).mean(axis=0))


def field_of(p: "Params") -> Field:
    """The field that the seed stands for."""
    stations = np.array([p.ap_1, p.ap_2, p.ap_3, p.ap_4])[:p.count]
    rng = np.random.default_rng([p.seed, 1])
    waves, phases = rng.standard_normal((4, WAVES, 2)), rng.uniform(0.0, 2.0 * np.pi, (4, WAVES))
    return Field(SignalStrength(stations, POWER_DBM, p.exponent, p.noise_db), waves[:p.count] / p.length_m,
                 phases[:p.count], p.shadow_db)


def grid_points(spacing_m: float) -> Array:
    """Centres (k, 2) of squares of about this side that fill the hall."""
    n = max(1, round(SIDE_M / spacing_m))
    line = (np.arange(n) + 0.5) * SIDE_M / n
    return mesh([line, line]).reshape(-1, 2)


def surveyed(p: "Params", field: Field, grid: Array, by_hand: Array, samples: int, per_axis: int) -> RadioMap | None:
    """The means of `samples` measurements at each point; None without a point."""
    points = np.concatenate([grid, by_hand])
    if not len(points):
        return None
    # Each list has noise of its own, so that a further click changes nothing that has been measured before.
    noise = np.concatenate([np.random.default_rng([p.seed, stream]).standard_normal((most, 4))[:len(some)]
                            for stream, most, some in ((2, len(grid), grid), (3, LIMIT, by_hand))])
    means = field.power(points) + p.noise_db / np.sqrt(samples) * noise[:, :p.count]
    return radio_map(Fingerprint(points, means, p.assumed_db), per_axis)


def radio_map(sensor: Fingerprint, per_axis: int) -> RadioMap:
    """The data base with its cells: the model of exercise 2.9 takes the powers of the nearest point everywhere."""
    centres = mesh(axes(per_axis))
    index, k = sensor.nearest_point(centres), len(sensor.points_m)
    count = np.bincount(index.ravel(), minlength=k)
    sums = np.column_stack([np.bincount(index.ravel(), centres[..., c].ravel(), k) for c in range(2)])
    centroids = np.where(count[:, None] > 0, sums / np.maximum(count, 1)[:, None], sensor.points_m)
    return RadioMap(sensor, index, count / count.sum(), centroids)


def axes(per_axis: int) -> tuple[Array, Array]:
    """Cell centres along x and y."""
    line = cells(0.0, SIDE_M, per_axis)
    return line, line


def posterior(m: RadioMap, y: Array) -> GridDensity:
    """p(x | y) ~ exp(-|y - a_i|^2 / 2 sigma^2), i nearest to x: (2.7) with a flat prior over the hall."""
    return bayes(uniform(axes(len(m.index))), m.sensor.point_log_likelihoods(y)[m.index]).posterior


def estimates(m: RadioMap, y: Array, k: int) -> Array:
    """Nearest neighbour, mean of k neighbours, weighted mean of them, posterior mean: (..., METHODS, 2)."""
    sensor = m.sensor
    k = min(k, len(sensor.points_m))
    best = np.argsort(sensor.squared_distances(y), axis=-1, kind="stable")[..., :k]
    weights = sensor.posterior(y, m.share)
    return np.stack([sensor.points_m[best[..., 0]], sensor.points_m[best].mean(axis=-2),
                     sensor.weighted_neighbours(y, k), weights @ m.centroids], axis=-2)


def performance(m: RadioMap, places: Array, ys: Array, k: int) -> Performance:
    """Errors of all methods for the scans ys (N, m) taken at places (N, 2), and how often the region is right."""
    errors = np.linalg.norm(estimates(m, ys, k) - places[:, None], axis=-1)
    weights = m.sensor.posterior(ys, m.share)
    order = np.argsort(m.sensor.squared_distances(ys), axis=-1, kind="stable")     # densest part first
    before = np.cumsum(np.take_along_axis(weights, order, axis=-1), axis=-1)
    before = np.concatenate([np.zeros((len(ys), 1)), before[:, :-1]], axis=1)
    rank = (order == m.sensor.nearest_point(places)[:, None]).argmax(axis=1)
    inside = before[np.arange(len(ys)), rank] < PROBABILITY
    return Performance(errors, float(inside.mean()))
