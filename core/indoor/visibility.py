"""Sight and shortest paths inside a simple polygon, convex or not."""

import heapq

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.checks import finite
from core.indoor.geometry import SLACK_M, contains, corners, signed_area
from core.types import Array


def visible(polygon: ArrayLike, p: ArrayLike, q: ArrayLike) -> bool:
    """True if p + t (q - p) is in the polygon for all t in [0, 1]; touching the border is allowed.

    polygon (V, 2), p and q (2,).  The segment is cut at every edge it meets; the middle of each piece must be inside.

    >>> L = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]]
    >>> visible(L, [0.5, 3.5], [3.5, 0.5]), visible(L, [0.5, 3.5], [0.9, 0.5])
    (False, True)
    """
    P = corners(polygon)
    p, q = finite("p", p, 2), finite("q", q, 2)
    d, e, a = q - p, np.roll(P, -1, axis=0) - P, P - p
    turn = _cross(d, e)
    oblique = np.abs(turn) > 1e-12 * np.abs(d).sum() * np.abs(e).sum(axis=1)
    safe = np.where(oblique, turn, 1.0)
    t, u = _cross(a, e) / safe, _cross(a, d) / safe
    cuts = t[oblique & (u >= -1e-9) & (u <= 1.0 + 1e-9)]
    squares = float(d @ d)
    if squares > 0.0:
        on_line = np.abs(_cross(d, a)) <= SLACK_M * np.sqrt(squares)
        cuts = np.concatenate([cuts, (a @ d)[on_line] / squares])
    cuts = np.unique(np.concatenate([[0.0, 1.0], cuts[(cuts > 0.0) & (cuts < 1.0)]]))
    middles = 0.5 * (cuts[1:] + cuts[:-1])
    return bool(contains(P, p + np.concatenate([[0.0], middles, [1.0]])[:, None] * d).all())


def reflex_corners(polygon: ArrayLike) -> NDArray[np.intp]:
    """Numbers of the corners where the border turns away from the inside: only there can a shortest path bend."""
    P = corners(polygon)
    before, after = P - np.roll(P, 1, axis=0), np.roll(P, -1, axis=0) - P
    return np.flatnonzero(_cross(before, after) * np.sign(signed_area(P)) < 0.0)


def shortest_path(polygon: ArrayLike, p: ArrayLike, q: ArrayLike) -> Array:
    """The shortest polyline from p to q inside the polygon: straight between reflex corners that see each other.

    polygon (V, 2) simple, p and q (2,) inside -> (K, 2), K >= 2, ends included.  ValueError if an end is outside.

    >>> shortest_path([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]], [0.5, 3.5], [3.5, 0.5]).tolist()
    [[0.5, 3.5], [1.0, 1.0], [3.5, 0.5]]
    """
    P = corners(polygon)
    ends = np.stack([finite("p", p, 2), finite("q", q, 2)])
    if not (inside := contains(P, ends)).all():
        raise ValueError(f"p, q: expected points in the polygon, got {ends[~inside][0]} outside")
    if visible(P, *ends):
        return ends
    X = np.concatenate([ends, P[reflex_corners(P)]])
    best, queue, done = {0: (0.0, -1)}, [(0.0, 0)], set()
    while queue:
        cost, i = heapq.heappop(queue)
        if i in done:
            continue
        done.add(i)
        if i == 1:
            break
        for j in set(range(1, len(X))) - done:
            total = cost + float(np.sqrt(np.square(X[j] - X[i]).sum()))
            if total < best.get(j, (np.inf, 0))[0] and visible(P, X[i], X[j]):
                best[j] = total, i
                heapq.heappush(queue, (total, j))
    path, i = [], 1
    while i >= 0:
        path.append(X[i])
        i = best[i][1]
    return np.array(path[::-1])


def _cross(u: Array, v: Array) -> Array:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
