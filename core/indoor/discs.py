"""Discs and polygons: the rolling-disc test for open areas, and how much of a disc lies in a polygon or on a link."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.indoor.geometry import border, contains, corners, nearest_on_border
from core.types import Array

OPEN_RADIUS_M = 4.0
_COARSE = 0.01                                            # of the larger side of the bounding box


class Disc(NamedTuple):
    """centre (2,) and radius_m."""

    centre: Array
    radius_m: float


def inscribed_disc(polygon: ArrayLike) -> Disc:
    """max r  such that |c - b| >= r for every border point b, c inside.

    polygon (V, 2) simple.  First a search over squares that discards those whose best case is worse than what is known
    by less than 1 % of the polygon's size; then linear programmes max r, d_e + n_e . (c' - c) >= r over the edges e:
    the distance to an edge is convex, so every solution is a true disc and the radius only grows.  GBPF ch. 3.

    >>> round(inscribed_disc([[0, 0], [16, 0], [0, 12]]).radius_m, 9)
    4.0
    """
    P = border(polygon).start
    c = _coarse_centre(P)
    r = float(nearest_on_border(P, c).distance)
    for _ in range(60):
        c_next, r_next = _grow(P, c)
        if r_next <= r * (1.0 + 1e-13):
            break
        c, r = c_next, r_next
    return Disc(c, r)


def is_open_area(polygon: ArrayLike, radius_m: float = OPEN_RADIUS_M) -> bool:
    """True if a disc of this radius fits into the polygon (equality fits).  GBPF ch. 3: 4 m.

    >>> is_open_area([[0, 0], [30, 0], [30, 7], [0, 7]]), is_open_area([[0, 0], [8, 0], [8, 8], [0, 8]])
    (False, True)
    """
    return inscribed_disc(polygon).radius_m >= radius_m * (1.0 - 1e-12)


def disc_area_in_polygon(polygon: ArrayLike, centre: ArrayLike, radius_m: float) -> float:
    """|D n P| = sum over the edges of the signed area that the disc D cuts from the triangle (centre, p_i, p_{i+1}).

    polygon (V, 2) simple, centre (2,), radius_m > 0 -> m^2, exact.  Inside the disc the piece is a triangle, outside a
    sector.

    >>> round(disc_area_in_polygon([[-20, -8], [0, -8], [0, 8], [-20, 8]], [0, 0], 5) / np.pi, 12)
    12.5
    """
    r = _radius(radius_m)
    P = border(polygon).start - finite("centre", centre, 2)
    total = 0.0
    for a, b in zip(P, np.roll(P, -1, axis=0), strict=True):
        t = [0.0, *_inside_interval(a, b, r), 1.0]
        points = [a + s * (b - a) for s in t]
        total += _sector(points[0], points[1], r) + _sector(points[2], points[3], r)
        total += 0.5 * _cross(points[1], points[2])
    return max(float(total), 0.0)


def length_in_disc(start: ArrayLike, end: ArrayLike, centre: ArrayLike, radius_m: float) -> Array:
    """|e - s| (t_2 - t_1), the part s + t (e - s), t_1 <= t <= t_2, that lies in the disc.

    start, end (..., n), centre (n,) -> (...) in metres.

    >>> float(length_in_disc([0, 0], [10, 0], [0, 0], 5))
    5.0
    """
    r = _radius(radius_m)
    s, e = finite("start", start), finite("end", end)
    a, d = s - finite("centre", centre, s.shape[-1]), e - s
    squares = np.square(d).sum(axis=-1)
    safe = np.where(squares > 0.0, squares, 1.0)
    middle = -(a * d).sum(axis=-1) / safe
    reach = middle * middle - (np.square(a).sum(axis=-1) - r * r) / safe
    half = np.sqrt(np.maximum(reach, 0.0))
    return np.sqrt(squares) * (np.clip(middle + half, 0.0, 1.0) - np.clip(middle - half, 0.0, 1.0))


def _radius(radius_m: float) -> float:
    r = float(finite("radius_m", radius_m))
    if r <= 0.0:
        raise ValueError(f"radius_m: expected a positive number of metres, got {r}")
    return r


def _inside_interval(a: Array, b: Array, r: float) -> tuple[float, float]:
    """t_1, t_2 in [0, 1]: a + t (b - a) is inside the circle of radius r about 0 between them; equal if nowhere."""
    d = b - a
    squares = float(d @ d)
    middle = -float(a @ d) / squares
    reach = middle * middle - (float(a @ a) - r * r) / squares
    half = np.sqrt(max(reach, 0.0))
    return min(max(middle - half, 0.0), 1.0), min(max(middle + half, 0.0), 1.0)


def _sector(p: Array, q: Array, r: float) -> float:
    return 0.5 * r * r * float(np.arctan2(_cross(p, q), p @ q))


def _cross(u: Array, v: Array) -> float:
    return float(u[0] * v[1] - u[1] * v[0])


def _coarse_centre(P: Array) -> Array:
    """The best of a shrinking set of squares: those that may still hold a better centre are cut into four."""
    low, high = P.min(axis=0), P.max(axis=0)
    size = float((high - low).max())
    half = float((high - low).min()) / 2.0
    grid = [np.arange(low[k] + half, high[k] + half, 2.0 * half) for k in (0, 1)]
    centres = np.stack(np.meshgrid(*grid), axis=-1).reshape(-1, 2)
    best, where = -np.inf, corners(P).mean(axis=0)
    while len(centres):
        distance = nearest_on_border(P, centres).distance
        distance = np.where(contains(P, centres), distance, -distance)
        k = int(distance.argmax())
        if distance[k] > best:
            best, where = float(distance[k]), centres[k]
        centres = centres[distance + half * np.sqrt(2.0) > best + _COARSE * size]
        half /= 2.0
        centres = (centres[:, None] + half * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])).reshape(-1, 2)
    return where


def _grow(P: Array, c: Array) -> tuple[Array, float]:
    from scipy.optimize import linprog

    start, end = P, np.roll(P, -1, axis=0)
    d = end - start
    t = np.clip(((c - start) * d).sum(axis=1) / np.square(d).sum(axis=1), 0.0, 1.0)
    away = c - (start + t[:, None] * d)
    distance = np.sqrt(np.square(away).sum(axis=1))
    n = away / distance[:, None]
    # r - n . c' <= d - n . c
    answer = linprog([0.0, 0.0, -1.0], np.column_stack([-n, np.ones(len(n))]), distance - (n * c).sum(axis=1),
                     bounds=[(None, None), (None, None), (0.0, None)])
    if not answer.success:
        return c, 0.0
    return answer.x[:2], float(nearest_on_border(P, answer.x[:2]).distance)
