"""E |sum_i w_i phi(x_i) - E phi|^2 <= c / N: how fast the particles get it right, what c depends on.  GBPF 4.4.3."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.indoor import (
    AccessPoints,
    Cloud,
    FloorGraph,
    Replicas,
    Walk,
    replicate,
    room_corridor,
    simulate_scans,
    walk_route,
)
from core.types import Array
from lessons.indoor._convergence_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider

LENGTH_M, SECONDS = 50.0, 24
NUMBERS = (20, 50, 100, 200, 500, 1000)          # particles on the axis of the plot
REFERENCE = 20_000                               # particles of what counts as exact
BINS = np.linspace(-1.0, LENGTH_M + 1.0, 27)     # along the corridor, 2 m each
SPACINGS_M = (2.5, 5.0, 10.0, 25.0)
STATIONS = ((5.0, 6.0), (25.0, -6.0), (45.0, 6.0))
SHOWN = 8                                        # filters whose densities are drawn


@dataclass(frozen=True, slots=True)
class Params:
    """The corridor, the scans and the filter; how many filters are compared."""

    particles: int = slider(100, low=20, high=2000, log=True)
    runs: int = slider(20, low=8, high=60)
    threshold: float = slider(0.5, low=0.05, high=0.95, step=0.05)
    interval_s: int = slider(2, low=1, high=10, unit="s", group="walk")
    spacing_m: float = slider(5.0, low=2.5, high=25.0, step=2.5, unit="m", group="walk")
    sigma_db: float = slider(6.0, low=2.0, high=12.0, step=0.5, unit="dB", group="walk")
    rule: str = choice("tll", ("tll", "equal"), group="walk")
    seed: int = seed(1)


class Result(NamedTuple):
    """Errors against a reference with REFERENCE particles, root mean square over the runs, in metres.

    truth (T,) and reference (T,): coordinate along the corridor; density (T, bins) of the reference; shown (T, SHOWN,
    bins) and means (T, SHOWN) of filters with `particles`.  errors: "never", "threshold", "always" -> (NUMBERS, T);
    n_eff: the same -> (T,) mean share of N, for the largest N.  by_crossings (SPACINGS_M, 2): decisions at nodes per
    particle and second, and N times the mean square error at the end.
    """

    graph: FloorGraph
    truth: Array
    scanned: Array
    reference: Array
    density: Array
    shown: Array
    means: Array
    errors: Mapping[str, Array]
    n_eff: Mapping[str, Array]
    by_crossings: Array


def phi(cloud: Cloud) -> Array:
    """The coordinate along the corridor, and which bin it lies in: (M, 1 + bins)."""
    x = cloud.position_m[:, 0]
    found = np.zeros((len(x), len(BINS)))
    found[:, 0] = x
    found[np.arange(len(x)), np.clip(np.searchsorted(BINS, x, side="right"), 1, len(BINS) - 1)] = 1.0
    return found


def compute(p: Params, progress: Progress) -> Result:
    """Many filters on one walk and its scans, for several N and three ways to resample."""
    points = AccessPoints(STATIONS, sigma_db=p.sigma_db)
    walk = Walk(rule=p.rule, l_max_m=None)

    def filters(graph: FloorGraph, scans: Array, n: int, runs: int, threshold: float, key: int) -> Replicas:
        return replicate(graph, scans, points, phi, n, runs, np.random.default_rng([p.seed, key, n, runs]), walk=walk,
                         threshold=threshold)

    graph, truth, scans = _walk(p, p.spacing_m, points)
    exact = filters(graph, scans, REFERENCE, 1, 0.5, 0).values[0]
    progress(0.2)
    errors, n_eff = {}, {}
    for k, (name, threshold) in enumerate((("never", 0.0), ("threshold", p.threshold), ("always", 1.0))):
        rows = []
        for n in NUMBERS:
            made = filters(graph, scans, n, p.runs, threshold, k + 1)
            rows.append(np.sqrt(np.square(made.values[..., 0] - exact[:, 0]).mean(axis=0)))
        errors[name], n_eff[name] = np.array(rows), made.n_eff.mean(axis=0) / NUMBERS[-1]
        progress(0.2 + 0.15 * (k + 1))
    some = filters(graph, scans, p.particles, SHOWN, p.threshold, 9).values.swapaxes(0, 1)
    by_crossings = []
    for k, spacing in enumerate(SPACINGS_M):
        other, _, other_scans = _walk(p, spacing, points)
        truth_there = filters(other, other_scans, REFERENCE // 3, 1, 0.5, 20 + k).values[0, -1, 0]
        made = filters(other, other_scans, NUMBERS[3], p.runs, p.threshold, 30 + k)
        by_crossings.append((made.crossings[1:].mean(),
                             NUMBERS[3] * np.square(made.values[:, -1, 0] - truth_there).mean()))
        progress(0.65 + 0.35 * (k + 1) / len(SPACINGS_M))
    return Result(graph, truth, ~np.isnan(scans).all(axis=1), exact[:, 0], exact[:, 1:], some[..., 1:], some[..., 0],
                  errors, n_eff, np.array(by_crossings))


def _walk(p: Params, spacing_m: float, points: AccessPoints) -> tuple[FloorGraph, Array, Array]:
    """The corridor, the true coordinate over time, and scans; the noise does not depend on the doors."""
    graph = room_corridor(LENGTH_M, spacing_m)
    ends = [n for n in graph.nodes if str(n).startswith("c")]
    truth = walk_route(graph, [ends[0], ends[-1]], speed_mps=1.2, epochs=SECONDS + 1)
    scans = simulate_scans(truth, points, np.random.default_rng([p.seed, 99]), interval_s=float(p.interval_s))
    return graph, truth.position_m[:, 0], scans


def timeline(p: Params) -> Timeline:
    """Seconds of the walk."""
    return Timeline(SECONDS, start=SECONDS, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline, budget_s=4.0,
    refs=("GBPF 4.3.4", "GBPF 4.4.3", "GBPF (4.12)"),
    presets={
        "one over the root of N": {},
        "20 particles": {"particles": 20},
        "2000 particles": {"particles": 2000},
        "a scan every second": {"interval_s": 1, "sigma_db": 4.0},
        "rare scans": {"interval_s": 10},
        "doors every 2.5 m, equal choice": {"spacing_m": 2.5, "rule": "equal"},
    },
)
