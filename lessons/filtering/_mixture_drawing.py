"""A mixture in the plane: outlines whose width follows the weight, and its density as a fill."""

import numpy as np

from core.levels import chi_square_level, ellipse
from core.mixture import Mixture
from core.types import Array, Gaussian
from lessons.kit.roles import Role
from lessons.kit.scene import HeatMap, Item, Segments

PROBABILITY = 0.68
LEVEL = float(chi_square_level(PROBABILITY, 2))
RIM = 37                                  # points of one outline
MOST = 48                                 # components that are drawn
CELLS = 96                                # of the fill, along each axis
# Below this share of the largest weight: width in pixels, fade.
CLASSES = ((0.03, 1.2, 0.55), (0.15, 2.0, 0.3), (0.5, 3.5, 0.1), (np.inf, 5.5, 0.0))


def shown(m: Mixture) -> Array:
    """The numbers of the heaviest components, at most MOST, from low to high x2."""
    heavy = np.argsort(-m.log_weights, kind="stable")[:MOST]
    heavy = heavy[m.log_weights[heavy] > -np.inf]
    return heavy[np.argsort(m.means[heavy, 1], kind="stable")]


def rims(m: Mixture) -> Array:
    """The 68 % ellipses of all components, (c, RIM, 2)."""
    return ellipse(Gaussian(m.means[:, :2], m.covs[:, :2, :2]), LEVEL, RIM)


def outlines(name: str, m: Mixture, role: Role, faint: bool = False) -> list[Item]:
    """The 68 % ellipses in four classes of weight: the heavier, the wider, class 3 is never empty; faint: all thin."""
    chosen = shown(m)
    weights, lines = m.weights[chosen], rims(m)[chosen]
    pairs = np.stack([lines[:, :-1], lines[:, 1:]], axis=2)
    if faint:
        return [Segments(f"{name}_all", pairs.reshape(-1, 2, 2), role=role, width=1.5, fade=0.35)]
    kind = np.searchsorted([top for top, *_ in CLASSES], weights / weights.max(), side="right")
    return [Segments(f"{name}_{k}", pairs[kind == k].reshape(-1, 2, 2), role=role, width=width, fade=fade)
            for k, (_, width, fade) in enumerate(CLASSES) if (kind == k).any()]


def heat(name: str, m: Mixture, role: Role, opacity: float = 0.75) -> HeatMap:
    """The density of the first two entries, relative to its largest value, over the box of its components."""
    chosen = shown(m)
    w, x, P = m.weights[chosen], m.means[chosen, :2], m.covs[chosen, :2, :2]
    heavy = w > 1e-3 * w.max()
    reach = 3.0 * np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    low, high = (x - reach)[heavy].min(axis=0), (x + reach)[heavy].max(axis=0)
    axes = [np.linspace(a, b, CELLS) for a, b in zip(low, high, strict=True)]
    return HeatMap(name, *axes, density(w, x, P, *axes).T, role=role, opacity=opacity)


def density(w: Array, x: Array, P: Array, first: Array, second: Array) -> Array:
    """sum_i w_i N([a, b]; mu_i, P_i) on a grid (len(first), len(second)): N(a) N(b | a), each along its own axis."""
    a = first - x[:, :1]                                                     # (c, i)
    slope, rest = P[:, 0, 1] / P[:, 0, 0], P[:, 1, 1] - P[:, 0, 1] ** 2 / P[:, 0, 0]
    b = (second - x[:, 1:])[:, None, :] - (slope[:, None] * a)[:, :, None]   # (c, i, j)
    outer = w / (2.0 * np.pi * np.sqrt(P[:, 0, 0] * rest))
    return np.einsum("ci,cij->ij", outer[:, None] * np.exp(-0.5 * a**2 / P[:, :1, 0]),
                     np.exp(-0.5 * b**2 / rest[:, None, None]))


def links(name: str, start: Array, end: Array, role: Role, width: float = 2.0) -> list[Item]:
    """Lines from parents to children (n, 2); none where nothing moved."""
    moved = np.abs(end - start).max(axis=1, initial=0.0) > 1e-6
    return [Segments(name, np.stack([start, end], axis=1)[moved], role=role, width=width)] if moved.any() else []
