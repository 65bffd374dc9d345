"""Two integrals, and the densities from which their samples are drawn.

Both problems are products over the axes: one axis for the parabola of Example 21, two for the square of exercise 3.13.
"""

from typing import TYPE_CHECKING

import numpy as np

from core.importance import truncated_normal
from core.types import Array

if TYPE_CHECKING:
    from lessons.filtering.monte_carlo import Params

SMALLEST = 0.2                           # side of the rectangle
WIDTHS = np.geomspace(0.3, 5.0, 60)       # of proposals that are compared
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(200)


def box(p: "Params") -> Array:
    """Ends of the interval where the integrand lives, one row for each axis: (1 or 2, 2)."""
    if p.problem == "parabola":
        return np.array([[-1.0, 1.0]])
    corners = np.array([p.corner_1, p.corner_2])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return np.column_stack([low, np.maximum(high, low + SMALLEST)])


def target(p: "Params", z: Array) -> Array:
    """g(z) for z (..., d): the parabola, or the normal density on the rectangle, which is not normalised."""
    if p.problem == "parabola":
        return 0.75 * np.maximum(1.0 - np.square(z[..., 0]), 0.0)
    total = np.exp(-0.5 * (np.square(z[..., 0]) + np.square(z[..., 1]))) / (2.0 * np.pi)
    for i, (low, high) in enumerate(box(p)):
        total *= z[..., i] >= low
        total *= z[..., i] <= high
    return total


def support(p: "Params") -> Array:
    """Where samples can fall, one row for each axis; infinite ends for the normal."""
    ends = box(p)
    if p.proposal == "normal":
        return np.tile([-np.inf, np.inf], (len(ends), 1))
    if p.proposal == "uniform" and p.problem == "parabola":
        return np.array([[p.centre - p.width, p.centre + p.width]])
    return ends


def sample(p: "Params", size: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Independent draws from f, (*size, d), each component contiguous."""
    from scipy.special import ndtr, ndtri

    def axis(low: float, high: float) -> Array:
        if p.proposal == "normal":
            return p.centre + p.width * rng.standard_normal(size)
        if p.proposal == "uniform":
            return rng.uniform(low, high, size)
        if p.problem == "parabola":
            a, b, c = rng.uniform(-1.0, 1.0, (3, *size))      # the middle of three has this density
            return np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
        return np.clip(ndtri(rng.uniform(ndtr(low), ndtr(high), size)), low, high)

    return np.moveaxis(np.array([axis(*ends) for ends in support(p)]), 0, -1)


def density(p: "Params", z: Array) -> Array:
    """f(z) for z (..., d)."""
    found = axis_density(p, 0, z[..., 0])
    for i in range(1, z.shape[-1]):
        found = found * axis_density(p, i, z[..., i])
    return found


def axis_density(p: "Params", axis: int, z: Array, width: float | None = None) -> Array:
    """The factor of f that belongs to one axis; width: another one than the parameter's."""
    width = p.width if width is None else width
    if p.proposal == "normal":
        return np.exp(-0.5 * np.square((z - p.centre) / width)) / (width * np.sqrt(2.0 * np.pi))
    if p.proposal == "uniform":
        low, high = (p.centre - width, p.centre + width) if p.problem == "parabola" else box(p)[axis]
        return ((z >= low) & (z <= high)) / (high - low)
    if p.problem == "parabola":
        return 0.75 * np.maximum(1.0 - np.square(z), 1e-12)
    low, high = box(p)[axis]
    P = float(truncated_normal(low, high).probability)
    return ((z >= low) & (z <= high)) * np.exp(-0.5 * np.square(z)) / np.sqrt(2.0 * np.pi) / P


def exact(p: "Params") -> Array:
    """The integral that is wanted: 1, or the mean of the normal law on the rectangle, (1 or 2,)."""
    if p.problem == "parabola":
        return np.ones(1)
    low, high = box(p).T
    return truncated_normal(low, high).mean


def term_variance(p: "Params", width: float | None = None) -> float:
    """n V(estimate) as n grows: int g^2/f - I^2, or for the ratio  int (g/f)^2 (x_1 - mean_1)^2 f / P^2.

    By Gauss-Legendre quadrature over the part of the box that samples reach.
    """
    ends, want, total, P = box(p), exact(p), 1.0, 1.0
    first = 0.0
    for axis, (low, high) in enumerate(ends):
        if p.problem == "parabola" and p.proposal == "uniform":
            half = p.width if width is None else width
            low, high = max(low, p.centre - half), min(high, p.centre + half)
            if low >= high:
                return 0.0
        z = 0.5 * (low + high) + 0.5 * (high - low) * NODES
        w = 0.5 * (high - low) * NODE_WEIGHTS
        g = 0.75 * (1.0 - z * z) if p.problem == "parabola" else np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
        h = g / axis_density(p, axis, z, width)
        error = np.square(z - want[0]) if p.problem == "square" and axis == 0 else 1.0
        total *= float(w @ (g * h * error))
        P *= float(w @ g)
        first = P
    if p.problem == "parabola":
        return max(total - first * first, 0.0)
    return total / (P * P)
