"""Triangles of a simple polygon by clipping ears, and uniform points in it without rejection."""

import numpy as np
from numpy.typing import ArrayLike

from core.indoor.geometry import corners, signed_area
from core.types import Array


def triangulate(polygon: ArrayLike) -> Array:
    """V - 2 triangles that tile the polygon.

    polygon (V, 2) simple, either orientation -> (V - 2, 3, 2), counterclockwise.  An ear is a convex corner whose
    triangle holds no other corner; every simple polygon has two (Meisters 1975).  ValueError if none is found, which
    happens only (and not always) when the border crosses itself.

    >>> len(triangulate([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]]))
    3
    """
    P = corners(polygon)
    ring = list(P if signed_area(P) > 0.0 else P[::-1])
    triangles = []
    while len(ring) > 3:
        k = _ear(np.array(ring))
        triangles.append((ring[k - 1], ring[k], ring[(k + 1) % len(ring)]))
        del ring[k]
    return np.array([*triangles, ring])


def sample_in(triangles: Array, size: int, rng: "np.random.Generator") -> Array:
    """x = a + r (b - a) + s (c - a),  (r, s) uniform on r + s <= 1, the triangle drawn by its area.

    triangles (K, 3, 2) -> (size, 2), uniform on their union.
    """
    a, b, c = triangles.transpose(1, 0, 2)
    u, v = b - a, c - a
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    k = rng.choice(len(area), size=size, p=area / area.sum()) if len(area) > 1 else np.zeros(size, np.intp)
    r, s = rng.random((2, size))
    over = r + s > 1.0                                    # the other half of the parallelogram, folded back
    r, s = np.where(over, 1.0 - r, r), np.where(over, 1.0 - s, s)
    return a[k] + r[:, None] * u[k] + s[:, None] * v[k]


def sample_polygon(polygon: ArrayLike, size: int, rng: "np.random.Generator") -> Array:
    """size points, uniform in a simple polygon (V, 2) -> (size, 2)."""
    return sample_in(triangulate(polygon), size, rng)


def _ear(ring: Array) -> int:
    a, b, c = np.roll(ring, 1, axis=0), ring, np.roll(ring, -1, axis=0)
    turn = _cross(b - a, c - a)
    for k in np.argsort(-turn):                           # large ears first: fewer slivers
        if turn[k] < 0.0:
            break
        p, q, r = a[k], b[k], c[k]
        rest = np.delete(ring, [k - 1, k, (k + 1) % len(ring)], axis=0)
        inside = (_cross(q - p, rest - p) >= 0) & (_cross(r - q, rest - q) >= 0) & (_cross(p - r, rest - r) >= 0)
        if not inside.any():
            return int(k)
    raise ValueError("polygon: expected a border that does not cross itself")


def _cross(u: Array, v: Array) -> Array:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
