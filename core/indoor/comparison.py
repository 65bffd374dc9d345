"""The graph filters against the Kalman filters without a map, on the same walk and scans.  GBPF ch. 6 (ours)."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from core.indoor.graph import FloorGraph
from core.indoor.kalman_filters import Grid, cpkf, cvkf, position_fixes
from core.indoor.routes import Truth, random_stops, walk_route
from core.indoor.signal import AccessPoints
from core.indoor.simulate import heard, simulate_scans
from core.indoor.tracking import run
from core.indoor.walk import Walk
from core.types import Array, Gaussian

FILTERS = ("tll", "equal", "cvkf", "cpkf")
PAUSES_S = (5.0, 20.0)


class Outcome(NamedTuple):
    """What one filter made of a walk: xy_m (T, 2), horizontal errors_m (T,), right_floor (T,), time for one step."""

    xy_m: Array
    errors_m: Array
    right_floor: Array
    seconds_per_step: float


class FixLaw(NamedTuple):
    """How good position fixes are on a map: R (2, 2) their mean square error in m^2, floor_rate their right floors."""

    R: Array
    floor_rate: float


def random_walk_through(graph: FloorGraph, stops: int, rng: "np.random.Generator", speed_mps: float = 1.2) -> Truth:
    """A walk at constant speed between `stops` random rooms by the quickest ways, with rests of PAUSES_S in them."""
    nodes = random_stops(graph, stops, rng)
    return walk_route(graph, nodes, speed_mps=speed_mps, pause_s=rng.uniform(*PAUSES_S, size=stops - 1))


def candidates(graph: FloorGraph, cell_m: float = 1.0) -> Grid:
    """The places of the graph's bounding box as candidates for position fixes."""
    corners = np.concatenate([np.array([n[:2] for n in graph.nodes.values()]).reshape(-1, 2),
                              *(a.polygon for a in graph.areas.values())])
    return Grid(tuple(corners.min(axis=0).tolist()), tuple(corners.max(axis=0).tolist()), cell_m)


def fix_law(graph: FloorGraph, points: AccessPoints, grid: Grid, seed: int = 0, size: int = 400) -> FixLaw:
    """R = mean of e e' over the fixes of `size` scans at random places of the map: what the Kalman filters are told."""
    from core.indoor.cloud import scatter

    rng = np.random.default_rng([seed, size])
    cloud = scatter(graph, size, rng)
    y = heard(points, points.expected(cloud.position_m, cloud.floor), rng)
    some = ~np.isnan(y).all(axis=1)
    fixes = position_fixes(y[some], points, grid)
    e = fixes.xy_m - cloud.position_m[some, :2]
    return FixLaw(e.T @ e / len(e), float((fixes.floor == cloud.floor[some]).mean()))


def anywhere(grid: Grid) -> Gaussian:
    """What the Kalman filters believe at the start: the middle of the grid, half its width as standard deviation."""
    low, high = np.array(grid.low_m), np.array(grid.high_m)
    return Gaussian(0.5 * (low + high), np.diag(np.square(0.5 * (high - low))))


def compare(
    graph: FloorGraph,
    points: AccessPoints,
    truth: Truth,
    rng: "np.random.Generator",
    *,
    interval_s: float = 1.0,
    n_particles: int = 500,
    filters: Sequence[str] = FILTERS,
    walk: Walk | None = None,
    grid: Grid | None = None,
    R: Array | None = None,
    q_cp: float = 30.0,
    q_cv: float = 0.1,
    progress: Callable[[float], object] | None = None,
) -> dict[str, Outcome]:
    """{filter: Outcome} on one draw of the scans, for the filters "tll", "equal", "cvkf", "cpkf".

    interval_s between scans; walk: motion of the graph filters, whose rule is replaced; grid, R: `candidates` and
    `fix_law` unless given; q_cp in m^2/s, q_cv in m^2/s^3, by default near the best for a walk with rests.  Each
    graph filter draws from a stream of its own, so that leaving one out does not change another.  ValueError for
    unknown filters, and as in `run`, `cpkf` and `cvkf`.
    """
    if unknown := set(filters) - set(FILTERS):
        raise ValueError(f"filters: expected some of {', '.join(FILTERS)}, got {', '.join(sorted(unknown))}")
    scan_rng, *streams = rng.spawn(1 + len(FILTERS))
    scans = simulate_scans(truth, points, scan_rng, interval_s=interval_s)
    dt_s = float(truth.time_s[1] - truth.time_s[0]) if len(truth.time_s) > 1 else 1.0
    grid = grid or candidates(graph)
    found = {}
    for k, name in enumerate(filters):
        begun = time.perf_counter()
        if name in ("tll", "equal"):
            r = run(graph, scans, points, streams[FILTERS.index(name)], n_particles=n_particles, dt_s=dt_s,
                    walk=replace(walk or Walk(), rule=name), subsample=1)
            xy, floor = r.projected, r.floor
        else:
            R = fix_law(graph, points, grid).R if R is None else R
            track = (cpkf(scans, points, grid, anywhere(grid), dt_s=dt_s, q=q_cp, R=R) if name == "cpkf" else
                     cvkf(scans, points, grid, anywhere(grid), dt_s=dt_s, q=q_cv, R=R))
            xy, floor = track.xy_m, track.floor
        seconds = (time.perf_counter() - begun) / len(scans)
        errors = np.sqrt(np.square(xy - truth.position_m[:, :2]).sum(axis=1))
        found[name] = Outcome(xy, errors, floor == truth.floor, seconds)
        if progress:
            progress((k + 1) / len(filters))
    return found
