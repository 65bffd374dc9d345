"""One point for a cloud: mean, the mean forced to the map, nearest particle, medoid, mode.  GBPF 5.3 (title only)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.indoor.cloud import Cloud
from core.indoor.geometry import contains, nearest_on_segments
from core.indoor.graph import FloorGraph, Id
from core.indoor.map_arrays import map_arrays
from core.resampling import systematic
from core.types import Array

MOST_PAIRS = 2000


class Projection(NamedTuple):
    """The nearest point of the map: its object, xy_m (2,), and how far it is."""

    object_id: Id
    xy_m: Array
    distance_m: float


class Estimates(NamedTuple):
    """All point estimates of a cloud, on its most likely floor; particles by their number in the cloud.

    mean (2,), cov (2, 2); projection: the mean forced to the map; nearest: the particle nearest to the mean, by
    Mahalanobis distance; medoid: the particle of least mean distance to the others; mode: the particle where the cloud
    is densest.
    """

    floor: int
    mean: Array
    cov: Array
    projection: Projection
    nearest: int
    medoid: int
    mode: int


def floor_weights(floor: ArrayLike, w: ArrayLike) -> dict[int, float]:
    """{floor: sum of the weights of its particles}, rising.  floor (N,), w (N,) >= 0, normalised here."""
    floor, w = np.asarray(floor), _weights(w)
    numbers, index = np.unique(floor, return_inverse=True)
    return dict(zip(numbers.tolist(), np.bincount(index, w / w.sum()).tolist(), strict=True))


def floor_rate(floor: ArrayLike, truth: ArrayLike) -> float:
    """Share of the epochs with floor = truth.  Both (T,), T >= 1.  GBPF ch. 6 (ours)."""
    floor, truth = np.asarray(floor), np.asarray(truth)
    if floor.shape != truth.shape or floor.ndim != 1 or not floor.size:
        raise ValueError(f"floor, truth: expected equal shapes (T,), T >= 1, got {floor.shape} and {truth.shape}")
    return float((floor == truth).mean())


def most_likely_floor(floor: ArrayLike, w: ArrayLike) -> int:
    """argmax over floors of the sum of the weights; the lowest of equals."""
    weights = floor_weights(floor, w)
    return max(weights, key=weights.__getitem__)


def mean_and_cov(xy_m: ArrayLike, w: ArrayLike) -> tuple[Array, Array]:
    """x = sum w_i x_i,  S = sum w_i (x_i - x)(x_i - x)'.

    xy_m (N, n), w (N,) >= 0, normalised here -> (n,), (n, n).  Minimum mean square error; may lie in a wall.
    """
    x, w = np.asarray(xy_m), _weights(w)
    w = w / w.sum()
    mean = w @ x
    d = x - mean
    return mean, (d.T * w) @ d


def project(graph: FloorGraph, xy_m: ArrayLike, floor: int) -> Projection:
    """argmin |x - m| over the points m of the links and areas of one floor.

    xy_m (2,).  Stairs belong to the floors of both their ends; a lift is a point.  ValueError for an empty floor.
    """
    x = finite("xy_m", xy_m, 2)
    if floor not in graph.floors:
        raise ValueError(f"floor: expected one of {graph.floors}, got {floor}")
    start, end, owner, areas = graph.cached(("segments", floor), lambda: _segments(graph, floor))
    near, squares = nearest_on_segments(start, end, x)
    k = int(squares.argmin())
    if squares[k] > 0.0:
        for o, low, high, polygon in areas:
            if (low <= x).all() and (x <= high).all() and contains(polygon, x):
                return Projection(o, x, 0.0)
    return Projection(owner[k], near[k], float(np.sqrt(squares[k])))


def nearest_particle(xy_m: ArrayLike, w: ArrayLike) -> int:
    """argmin_i (x_i - x)' S^-1 (x_i - x), x and S mean and covariance of the cloud.

    xy_m (N, 2), w (N,).  Always a possible position.  If S is singular (a straight corridor) its spread across the line
    counts as 1e-6 of that along it.
    """
    x = np.asarray(xy_m, dtype=np.float64)
    mean, cov = mean_and_cov(x, w)
    d = x - mean
    size = float(np.trace(cov))
    if size == 0.0:
        return int(np.square(d).sum(axis=1).argmin())
    y = np.linalg.solve(cov + 1e-6 * size * np.eye(len(cov)), d.T)
    return int((d.T * y).sum(axis=0).argmin())


def nearest_to_mean(xy_m: ArrayLike, w: ArrayLike) -> int:
    """argmin_i |x_i - x| = argmin_i sum_j w_j |x_i - x_j|^2,  x = sum w_i x_i.  xy_m (N, 2), w (N,)."""
    x = np.asarray(xy_m, dtype=np.float64)
    return int(np.square(x - mean_and_cov(x, w)[0]).sum(axis=1).argmin())


def medoid(xy_m: ArrayLike, w: ArrayLike) -> int:
    """argmin_i sum_j w_j |x_i - x_j|.

    xy_m (N, 2), w (N,).  A possible position, and robust: it picks one mode.  A cloud of more than 2000 particles is
    thinned to at most 2000 systematically resampled ones.
    """
    return _best(xy_m, w, lambda squares: -np.sqrt(squares))


def density_mode(xy_m: ArrayLike, w: ArrayLike, bandwidth_m: float = 2.0) -> int:
    """argmax_i sum_j w_j exp(-|x_i - x_j|^2 / (2 h^2)): a maximum a posteriori estimate from a kernel density.

    xy_m (N, 2), w (N,).  Jumps between modes.  Large clouds as in `medoid`.
    """
    if not bandwidth_m > 0.0:
        raise ValueError(f"bandwidth_m: expected a positive number of metres, got {bandwidth_m}")
    return _best(xy_m, w, lambda squares: np.exp(squares * (-0.5 / bandwidth_m**2)))


def estimates(graph: FloorGraph, cloud: Cloud, w: ArrayLike) -> Estimates:
    """Every point estimate of a weighted cloud: first the most likely floor, then its particles only.

    w (N,) >= 0, normalised here.  ValueError for weights that do not fit.
    """
    w = _weights(w, len(cloud.floor))
    floor = most_likely_floor(cloud.floor, w)
    here = np.flatnonzero(cloud.floor == floor)
    x, v = cloud.position_m[here, :2], w[here]
    mean, cov = mean_and_cov(x, v)
    return Estimates(floor, mean, cov, project(graph, mean, floor), int(here[nearest_particle(x, v)]),
                     int(here[medoid(x, v)]), int(here[density_mode(x, v)]))


def object_weights(graph: FloorGraph, cloud: Cloud, w: ArrayLike) -> dict[Id, float]:
    """P(x on object) = sum of the weights of its particles: {object: probability}.  w (N,) >= 0, normalised here."""
    w = _weights(w, len(cloud.object))
    share = np.bincount(cloud.object, w / w.sum(), minlength=len(graph.object_ids))
    return dict(zip(graph.object_ids, share.tolist(), strict=True))


def _segments(graph: FloorGraph, floor: int) -> tuple[Array, Array, list[Id], list[tuple[Id, Array, Array, Array]]]:
    """Links and borders of one floor as segments with their objects; its areas with their bounding boxes."""
    maps = map_arrays(graph)
    links = np.flatnonzero((maps.floors[:maps.n_links] == floor).any(axis=1))
    start = [maps.origin[links, :2]]
    end = [start[0] + maps.unit[links, :2] * maps.length[links, None]]
    owner, areas = [graph.object_ids[k] for k in links], []
    for o, area in graph.areas.items():
        if area.floor == floor:
            P = area.polygon
            start.append(P)
            end.append(np.roll(P, -1, axis=0))
            owner += [o] * len(P)
            areas.append((o, P.min(axis=0), P.max(axis=0), P))
    return np.concatenate(start), np.concatenate(end), owner, areas


def _best(xy_m: ArrayLike, w: ArrayLike, score: Callable[[Array], Array]) -> int:
    x, w = np.asarray(xy_m, dtype=np.float64), _weights(w)
    if len(x) > MOST_PAIRS:
        descendants = systematic(w / w.sum(), 0.5)[:: -(-len(x) // MOST_PAIRS)]
        index, share = np.unique(descendants, return_counts=True)
        return int(index[_best(x[index], share, score)])
    total = np.empty(len(x))
    for k in range(0, len(x), 256):                       # blocks of rows: a few megabytes at a time
        d = x[k:k + 256, None, :] - x
        total[k:k + 256] = score((d * d).sum(axis=-1)) @ w
    return int(total.argmax())


def _weights(w: ArrayLike, N: int | None = None) -> Array:
    w = finite("w", w, N)
    if w.ndim != 1 or not w.size or w.min() < 0.0 or not w.sum() > 0.0:
        raise ValueError(f"w: expected weights (N,) >= 0 with a positive sum, got {w}")
    return w
