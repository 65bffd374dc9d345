"""Plane geometry of simple polygons, convex or not: area, inside, nearest border point, crossings.

A polygon is an array (V, 2) of corners in metres, without repeating the first corner at the end.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.checks import finite
from core.types import Array

SLACK_M = 1e-9                                            # round-off of a position that lies on the border


class Border(NamedTuple):
    """The E edges of a counterclockwise polygon.

    start (E, 2), tangent (E, 2) unit vectors, length (E,), normal (E, 2) unit vectors out of the polygon, and
    offset (E,) = normal . start.  Of A polygons together, see `together`: (E, A, 2) and (E, A).
    """

    start: Array
    tangent: Array
    length: Array
    normal: Array
    offset: Array


class Nearest(NamedTuple):
    """point (..., 2) on the border, its edge (...) and its distance (...) in metres."""

    point: Array
    edge: NDArray[np.intp]
    distance: Array


class Crossings(NamedTuple):
    """K exits from the polygon: segment k of the caller leaves through `edge` at p + fraction (q - p).  All (K,)."""

    segment: NDArray[np.intp]
    edge: NDArray[np.intp]
    fraction: Array


def signed_area(polygon: ArrayLike) -> float:
    """A = 1/2 sum (x_i y_{i+1} - x_{i+1} y_i), positive counterclockwise.

    polygon (V, 2) -> m^2.  The coordinates are taken relative to the first corner: a far origin does not cancel.

    >>> signed_area([[0, 0], [3, 0], [3, 2], [0, 2]])
    6.0
    """
    P = corners(polygon)
    d = P - P[0]
    x, y = d.T
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def corners(polygon: ArrayLike) -> Array:
    """polygon as (V, 2) finite numbers, V >= 3.  ValueError otherwise."""
    P = finite("polygon", polygon, None, 2)
    if P.ndim != 2 or len(P) < 3:
        raise ValueError(f"polygon: expected corners (V, 2), V >= 3, got shape {P.shape}")
    return P


def border(polygon: ArrayLike) -> Border:
    """Edges from corner i to corner i+1, the last one back to the first; normals point out.

    polygon (V, 2), either orientation; the edges of a clockwise one are listed in reverse.  ValueError for an edge of
    length 0.
    """
    P = corners(polygon)
    if signed_area(P) < 0.0:
        P = P[::-1]
    d = np.roll(P, -1, axis=0) - P
    length = np.sqrt(np.square(d).sum(axis=1))
    if not (length > 0.0).all():
        raise ValueError(f"polygon: expected distinct corners, got {P[int(length.argmin())]} twice in a row")
    tangent = d / length[:, None]
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    return Border(P, tangent, length, normal, np.vecdot(normal, P))


def contains(polygon: ArrayLike, points: ArrayLike) -> NDArray[np.bool_]:
    """Even-odd rule: a ray to the right of the point meets the border an odd number of times.

    polygon (V, 2), points (..., 2) -> (...).  Points within 1e-9 m of the border count as inside.

    >>> contains([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]], [[1, 1], [2, 3], [2, 1]]).tolist()
    [True, False, True]
    """
    P, x = corners(polygon), finite("points", points, 2)
    Q = np.roll(P, -1, axis=0)
    px, py = x[..., 0, None], x[..., 1, None]
    straddles = (P[:, 1] > py) != (Q[:, 1] > py)
    rise = np.where(P[:, 1] == Q[:, 1], 1.0, Q[:, 1] - P[:, 1])
    at = P[:, 0] + (py - P[:, 1]) / rise * (Q[:, 0] - P[:, 0])
    inside = (straddles & (px < at)).sum(axis=-1) % 2 == 1
    return inside | (nearest_on_border(P, x).distance <= SLACK_M)


def nearest_on_segments(start: Array, end: Array, points: Array) -> tuple[Array, Array]:
    """Nearest points s + clip(t, 0, 1) (e - s),  t = (x - s) . (e - s) / |e - s|^2.

    start, end (E, n), points (..., n) -> points (..., E, n) and squared distances (..., E).
    """
    d = end - start
    squares = np.square(d).sum(axis=-1)
    t = ((points[..., None, :] - start) * d).sum(axis=-1) / np.where(squares > 0.0, squares, 1.0)
    near = start + np.clip(t, 0.0, 1.0)[..., None] * d
    return near, np.square(points[..., None, :] - near).sum(axis=-1)


def nearest_on_border(polygon: ArrayLike, points: ArrayLike) -> Nearest:
    """argmin |x - b| over the border points b.

    polygon (V, 2), points (..., 2).  Edge i runs from corner i to corner i+1 in the order given.

    >>> nearest_on_border([[0, 0], [4, 0], [4, 4], [0, 4]], [1, 3.5]).point.tolist()
    [1.0, 4.0]
    """
    P, x = corners(polygon), finite("points", points, 2)
    near, squares = nearest_on_segments(P, np.roll(P, -1, axis=0), x)
    edge = squares.argmin(axis=-1)
    point = np.take_along_axis(near, edge[..., None, None], axis=-2)[..., 0, :]
    return Nearest(point, edge, np.sqrt(np.take_along_axis(squares, edge[..., None], axis=-1)[..., 0]))


def nearest_in_polygon(polygon: ArrayLike, points: ArrayLike) -> Array:
    """The point itself if it is inside, else the nearest border point.

    polygon (V, 2), points (..., 2) -> (..., 2).
    """
    x = finite("points", points, 2)
    return np.where(contains(polygon, x)[..., None], x, nearest_on_border(polygon, x).point)


def together(borders: Sequence[Border]) -> Border:
    """The borders of A polygons as arrays (E, A, ...), filled up with edges that no segment can cross."""
    E = max((len(b.length) for b in borders), default=0)

    def filled(column: int, value: float, *shape: int) -> Array:
        out = np.full((E, len(borders), *shape), value)
        for k, b in enumerate(borders):
            out[: len(b.length), k] = b[column]
        return out

    return Border(filled(0, 0.0, 2), filled(1, 0.0, 2), filled(2, 0.0), filled(3, 0.0, 2), filled(4, 1.0))


def exits(edges: Border, p: Array, q: Array, a: NDArray[np.intp] | None = None) -> Crossings:
    """fraction t = (c - n . p) / (n . q - n . p) of every edge that the segment p q crosses from inside to outside.

    edges of one counterclockwise polygon; or of several `together`, and then segment k runs in polygon a[k].  p, q
    (M, 2), p inside or on the border.  A corner belongs to both its edges.  A segment that starts on the border and
    leaves at once has t = 0; one that runs along an edge does not leave.
    """
    to = (slice(None), None) if a is None else (slice(None), a)
    nx, ny, c = edges.normal[..., 0][to], edges.normal[..., 1][to], edges.offset[to]
    (px, py), (qx, qy) = p.T.copy(), q.T.copy()
    s0 = nx * px                                          # (E, M): the long axis last, and contiguous
    s0 += ny * py
    s0 -= c
    s1 = nx * qx
    s1 += ny * qy
    s1 -= c
    edge, segment = ((s1 > 0.0) & (s0 <= SLACK_M) & (s1 > s0)).nonzero()
    if not len(segment):
        return Crossings(segment, edge, np.empty(0))
    before, after = s0[edge, segment], s1[edge, segment]
    t = np.maximum(-before, 0.0) / (after - before)
    which = edge if a is None else (edge, a[segment])
    at = p[segment] + t[:, None] * (q[segment] - p[segment]) - edges.start[which]
    along = (at * edges.tangent[which]).sum(axis=1)
    hit = (along >= -SLACK_M) & (along <= edges.length[which] + SLACK_M)
    return Crossings(segment[hit], edge[hit], t[hit])


def is_simple(polygon: ArrayLike) -> tuple[bool, str]:
    """True if no two edges meet except neighbours at their common corner; and what is wrong otherwise.

    polygon (V, 2).  Corners are named by their number, from 0.
    """
    P = corners(polygon)
    V = len(P)
    Q = np.roll(P, -1, axis=0)
    if (repeated := np.flatnonzero((P == Q).all(axis=1))).size:
        i = int(repeated[0])
        return False, f"corners {i} and {(i + 1) % V} are the same point {_point(P[i])}"
    before = np.roll(P, 1, axis=0)
    folds = (_side(before, P, Q) == 0.0) & (np.vecdot(P - before, Q - P) < 0.0)
    if folds.any():
        i = int(folds.argmax())
        return False, f"the border turns back on itself at corner {i}, {_point(P[i])}"
    for i in range(V):
        others = np.arange(i + 2, V if i else V - 1)      # edges that share no corner with edge i
        if others.size:
            a, b = P[others], Q[others]
            s1, s2 = _side(P[i], Q[i], a), _side(P[i], Q[i], b)
            s3, s4 = _side(a, b, P[i]), _side(a, b, Q[i])
            overlap = ((np.minimum(a, b) <= np.maximum(P[i], Q[i])) & (np.maximum(a, b) >= np.minimum(P[i], Q[i])))
            meet = (s1 * s2 <= 0) & (s3 * s4 <= 0) & overlap.all(axis=1)
            if meet.any():
                j = int(others[meet.argmax()])
                return False, (f"the edge from corner {i} {_point(P[i])} meets the edge from corner {j} "
                               f"{_point(P[j])}")
    return True, ""


def _side(a: Array, b: Array, c: Array) -> NDArray:
    """Sign of the turn a -> b -> c, 0 if the three points lie on a line to round-off."""
    d, e = b - a, c - a
    u, v = d[..., 0] * e[..., 1], d[..., 1] * e[..., 0]
    turn = u - v
    return np.where(np.abs(turn) <= 1e-14 * (np.abs(u) + np.abs(v)), 0.0, np.sign(turn))


def _point(p: Array) -> str:
    return f"({p[0]:g}, {p[1]:g})"
