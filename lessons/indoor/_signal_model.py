"""Transmitters with a changed law, shadows behind walls and people, and the likelihood of a scan over the floors."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from core.indoor import AccessPoints, FloorGraph
from core.types import Array
from lessons.kit.lesson import Progress

WAVES = 24                    # of which a shadow is the sum
SHADOW_M = (12.0, 50.0)       # their wavelengths


class Shadows(NamedTuple):
    """A smooth random field for each of m transmitters: a sum of plane waves, of standard deviation sigma_db."""

    waves: Array              # (m, WAVES, 2) in rad/m
    phases: Array             # (m, WAVES)
    sigma_db: float

    def at(self, xy_m: Array) -> Array:
        """xy_m (..., 2) -> (..., m) in dB."""
        if self.sigma_db == 0.0:
            return np.zeros((*xy_m.shape[:-1], len(self.phases)))
        turn = np.tensordot(xy_m, self.waves, axes=(-1, -1)) + self.phases
        return self.sigma_db * np.sqrt(2.0 / WAVES) * np.cos(turn).sum(axis=-1)


def shadows(m: int, sigma_db: float, rng: np.random.Generator) -> Shadows:
    """Shadows of m transmitters."""
    direction = rng.uniform(0.0, 2 * np.pi, (m, WAVES))
    number = 2 * np.pi / rng.uniform(*SHADOW_M, (m, WAVES))
    waves = number[..., None] * np.stack([np.cos(direction), np.sin(direction)], axis=-1)
    return Shadows(waves, rng.uniform(0.0, 2 * np.pi, (m, WAVES)), sigma_db)


def changed(points: AccessPoints, chosen: int, place: Sequence[float], power_db: float, exponent: float,
            sigma_db: float, floor_loss_db: float, unheard: str) -> AccessPoints:
    """The transmitters with a shifted law, and one of them (if chosen >= 0) at another place."""
    xy = points.xy_m.copy()
    if chosen >= 0:
        xy[chosen] = place
    return replace(points, xy_m=xy, power_dbm=points.power_dbm + power_db,
                   exponent=np.maximum(points.exponent + exponent, 0.5), sigma_db=sigma_db,
                   floor_loss_db=floor_loss_db, unheard=unheard)


def likelihoods(g: FloorGraph, points: AccessPoints, y: Array, order: Array, axes: tuple[Array, Array],
                progress: Progress) -> Array:
    """(len(order) + 1, floors, ny, nx): laws of the place after 0, 1, 2, ... transmitters, from a flat prior.

    With `unheard` = "censored" the silent ones have their say at the end, with the last transmitter.
    """
    xx, yy = np.meshgrid(*axes)
    floors = np.broadcast_to(np.array(g.floors)[:, None, None], (len(g.floors), *xx.shape))
    place = np.stack([*np.broadcast_arrays(xx, yy, g.floor_height_m * floors)], axis=-1)
    mean = points.expected(place, floors)
    total = np.zeros(place.shape[:-1])
    found = [_normalised(total)]
    for k, a in enumerate(order):
        total = total - 0.5 * ((y[a] - mean[..., a]) / points.sigma_db[a]) ** 2
        if points.unheard == "censored" and k == len(order) - 1:
            total = total + points.log_likelihood(y, place, floors)
            total = total - _heard_only(points, y, mean)
        found.append(_normalised(total))
        progress(0.1 + 0.9 * (k + 1) / len(order))
    return np.array(found)


def _heard_only(points: AccessPoints, y: Array, mean: Array) -> Array:
    heard = ~np.isnan(y)
    return -0.5 * np.square((y[heard] - mean[..., heard]) / points.sigma_db[heard]).sum(axis=-1)


def _normalised(log_p: Array) -> Array:
    p = np.exp(log_p - log_p.max())
    return p / p.sum()
