"""A walk through the building and four filters on the same scans, thinned to what can be drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from core.cloud import thinned
from core.indoor import (
    AccessPoints,
    FloorGraph,
    Truth,
    Walk,
    cpkf,
    cvkf,
    random_stops,
    run,
    simulate_scans,
    walk_route,
)
from core.indoor.comparison import anywhere, candidates, fix_law
from core.indoor.filter import Step
from core.indoor.point_estimates import density_mode, medoid, nearest_particle
from core.types import Array
from lessons.indoor._building import building
from lessons.kit.lesson import Progress

DRAWN, JUDGED = 800, 300        # particles that are drawn, and that the slower point estimates look at
ESTIMATES = ("projected", "mean", "nearest", "medoid", "mode")
MOST_EPOCHS = 900


class GraphTrack(NamedTuple):
    """One graph filter over T epochs.

    predicted, after (T, M, 3) drawn particles before and after the resampling; weights (T, M) of the predicted ones, of
    sum 1; n_eff, floor, resampled (T,); xy_m (T, 2) the point estimate; spread (T,) of the cloud in metres (1 sigma).
    """

    predicted: Array
    weights: Array
    after: Array
    n_eff: Array
    resampled: Array
    floor: Array
    xy_m: Array
    spread: Array


class KalmanTrack(NamedTuple):
    """xy_m (T, 2), floor (T,), and the position part of the covariance (T, 2, 2)."""

    xy_m: Array
    floor: Array
    cov: Array


def route_of(graph: FloorGraph, routes: Mapping[str, Sequence[str]], walk: str, own: Sequence[str],
             seed: int) -> tuple[list[str], str]:
    """The nodes to walk through, and a note where they are not those asked for."""
    if walk == "own":
        known = [n for n in own if n in graph.nodes]
        if len(known) >= 2:
            return known, "" if len(known) == len(own) else "Nodes that this map does not have were left out."
        first = next(iter(graph.nodes))
        start = known[0] if known else first
        goal = next(n for n in graph.nodes if n != start)
        return [start, goal], "Click nodes to draw a route: at least two."
    if walk in routes:
        return list(routes[walk]), ""
    nodes = random_stops(graph, 4, np.random.default_rng(seed))
    return nodes, f"This map has no route {walk!r}; the walk goes through random rooms."


def walked(graph: FloorGraph, nodes: Sequence[str], speed_mps: float, pause_s: float) -> Truth:
    """The truth; a walk of more than MOST_EPOCHS seconds is cut."""
    truth = walk_route(graph, nodes, speed_mps=speed_mps, pause_s=pause_s)
    if len(truth.time_s) > MOST_EPOCHS:
        truth = walk_route(graph, nodes, speed_mps=speed_mps, pause_s=pause_s, epochs=MOST_EPOCHS)
    return truth


def scanned(truth: Truth, points: AccessPoints, interval_s: float, seed: int) -> Array:
    """Scans (T, m) along the walk; the same seed gives the same noise."""
    return simulate_scans(truth, points, np.random.default_rng([seed, 1]), interval_s=interval_s)


def graph_filter(graph: FloorGraph, scans: Array, points: AccessPoints, walk: Walk, n: int, threshold: float,
                 estimate: str, seed: int, progress: Progress) -> GraphTrack:
    """The graph-based particle filter with everything that is drawn of it."""
    index, judged = thinned(n, DRAWN), thinned(n, JUDGED)

    def keep(k: int, s: Step) -> tuple[Array, ...]:
        w = s.weights_before[index]
        total = float(w.sum())
        weights = w / total if total > 0.0 else np.full(len(w), 1.0 / len(w))
        return (s.predicted.position_m[index].astype(np.float32), weights.astype(np.float32),
                s.particles.position_m[index].astype(np.float32), _point(s, estimate, judged))

    r = run(graph, scans, points, np.random.default_rng([seed, 2]), n_particles=n, walk=walk, threshold=threshold,
            subsample=1, keep=keep, progress=progress)
    predicted, weights, after, xy = (np.array(column) for column in zip(*r.kept, strict=True))
    return GraphTrack(predicted, weights, after, r.n_eff, r.resampled, r.floor, xy,
                      np.sqrt(np.trace(r.cov, axis1=1, axis2=2)))


def _point(s: Step, estimate: str, judged: Array) -> Array:
    """The point estimate of a step; the slow ones look at some of the particles on the likeliest floor."""
    if estimate in ("projected", "mean"):
        return s.projection.xy_m if estimate == "projected" else s.mean
    here = judged[(s.predicted.floor[judged] == s.floor) & (s.weights_before[judged] > 0.0)]
    if not here.size:
        return s.mean
    xy, w = s.predicted.position_m[here, :2], s.weights_before[here]
    choose = {"nearest": nearest_particle, "medoid": medoid, "mode": density_mode}[estimate]
    return xy[choose(xy, w)]


@lru_cache(maxsize=16)
def fix_error(map_key: str, technology: str, sigma_db: float) -> Array:
    """R of `fix_law` (2, 2); kept, as it costs as much as a fifth of the lesson and depends on these alone."""
    b = building(map_key)
    return fix_law(b.graph, replace(b.transmitters[technology], sigma_db=sigma_db), candidates(b.graph)).R


def kalman_tracks(graph: FloorGraph, scans: Array, points: AccessPoints, R: Array, q_cv: float,
                  q_cp: float) -> dict[str, KalmanTrack]:
    """CVKF and CPKF on position fixes of the same scans; they do not know the map."""
    grid = candidates(graph)
    start = anywhere(grid)
    if np.isnan(scans).all():
        still = KalmanTrack(np.tile(start.mean, (len(scans), 1)), np.full(len(scans), graph.floors[0]),
                            np.tile(start.cov, (len(scans), 1, 1)))
        return {"cvkf": still, "cpkf": still}
    found = {}
    for name, track in (("cvkf", cvkf(scans, points, grid, start, q=q_cv, R=R)),
                        ("cpkf", cpkf(scans, points, grid, start, q=q_cp, R=R))):
        found[name] = KalmanTrack(track.xy_m, track.floor, track.record.posterior.cov[:, :2, :2])
    return found
