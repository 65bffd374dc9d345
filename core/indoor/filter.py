"""The graph-based particle filter: walk on the map, weigh by signal strength, estimate, resample.  GBPF 5.4.

The proposal is the motion model itself, so w_t ~ w_{t-1} p(y_t | x_t).  Weights are carried as logarithms.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.cloud import AllWeightsZero
from core.indoor.cloud import Cloud, Numbers, gather, put, scatter
from core.indoor.graph import FloorGraph
from core.indoor.motion import Choices, advance
from core.indoor.point_estimates import Projection, project
from core.indoor.signal import AccessPoints
from core.indoor.walk import Walk
from core.resampling import draw
from core.types import Array


class Belief(NamedTuple):
    """What the filter knows between two steps: N particles and their log weights (N,), sum exp = 1.

    bad_scans: how many scans in a row no particle could explain.
    """

    cloud: Cloud
    log_weights: Array
    bad_scans: int = 0


class Recovery(NamedTuple):
    """When to look elsewhere: the best log-likelihood falls short of the typical one by more than `shortfall` nats, in
    `scans` scans in a row.  Then the share `share` of the particles is scattered over the map.  The numbers are ours.
    """

    shortfall: float = 25.0
    scans: int = 2
    share: float = 0.3


class Step(NamedTuple):
    """Everything one step computes, for N particles.

    before: the belief before the step; predicted: the cloud after the walk (and a recovery); choices: the decisions at
    nodes on the way; log_likelihood (N,) of the scan, zero without one; weights_before (N,): normalised weights of
    `predicted` after the scan, n_eff = 1 / sum w^2; ancestors (N,) into `predicted`, 0..N-1 if not `resampled`;
    particles, weights (N,): the cloud afterwards; after: the same as a belief, for the next step.

    floor: the most likely one; mean (2,) and cov (2, 2) of the predicted cloud on it, in metres; projection: the mean
    forced to the map.  log_evidence = log p(y_t | y_{1:t-1}).  recovered: numbers of the particles that were scattered.
    """

    before: Belief
    predicted: Cloud
    choices: Choices
    log_likelihood: Array
    weights_before: Array
    n_eff: float
    ancestors: Numbers
    resampled: bool
    particles: Cloud
    weights: Array
    after: Belief
    floor: int
    mean: Array
    cov: Array
    projection: Projection
    log_evidence: float
    recovered: Numbers


def start(graph: FloorGraph, N: int, rng: "np.random.Generator", walk: Walk | None = None) -> Belief:
    """N equally weighted particles, uniform over the total length of the map: nothing is known.  GBPF 5.4, step 1."""
    return Belief(scatter(graph, N, rng, walk), np.full(N, -math.log(N)))


def step(
    graph: FloorGraph,
    belief: Belief,
    y: ArrayLike | None,
    points: AccessPoints,
    rng: "np.random.Generator",
    *,
    dt_s: float = 1.0,
    walk: Walk | None = None,
    threshold: float = 0.5,
    resampler: str = "systematic",
    recovery: Recovery | None = Recovery(),  # noqa: B008
) -> Step:
    """x_t ~ P_x(x_t | x_{t-1}),  w_t ~ w_{t-1} p(y_t | x_t),  resampling if N_eff < threshold N.

    y (m,) in dBm, NaN for access points that were not heard; None or all NaN: no scan, nothing is weighed or resampled.
    dt_s: seconds since the belief, 0 for a first scan; about a second, see `advance`.  walk: parameters of the motion;
    Walk(rule="equal") is the comparison filter with equal choice.  recovery None: never.

    ValueError for arguments that do not fit; AllWeightsZero if the belief and the scan exclude each other.
    GBPF 4.3-4.4, 5.4; the composition is ours.
    """
    walk = walk or Walk()
    _check(graph, belief, points, threshold)
    y = np.full(len(points), np.nan) if y is None else points.scan(y)
    if y.ndim != 1:
        raise ValueError(f"y: expected one scan ({len(points)},), got shape {y.shape}")
    cloud, log_w, N = belief.cloud, belief.log_weights, len(belief.log_weights)
    heard = bool((~np.isnan(y)).any())
    predicted, choices = advance(graph, cloud, dt_s, walk, rng)
    recovered, bad_scans = np.empty(0, np.intp), belief.bad_scans
    log_likelihood = points.log_likelihood(y, predicted.position_m, predicted.floor) if heard else np.zeros(N)
    if heard and recovery is not None:
        bad = log_likelihood.max() < points.typical_log_likelihood(y) - recovery.shortfall
        bad_scans = bad_scans + 1 if bad else 0
        if bad_scans >= recovery.scans:
            predicted, log_w, recovered = _scatter_some(graph, predicted, log_w, recovery.share, walk, rng)
            log_likelihood = points.log_likelihood(y, predicted.position_m, predicted.floor)
            bad_scans = 0
    log_w = log_w + log_likelihood
    w, log_evidence = _normalised(log_w)
    n_eff = float(1.0 / np.einsum("i,i", w, w))
    floor, mean, cov = _moments(predicted, w)
    resampled = heard and (threshold == 1.0 or n_eff < threshold * N)
    if resampled:
        ancestors = draw(resampler, w, rng)
        particles, weights, log_after = gather(predicted, ancestors), np.full(N, 1.0 / N), np.full(N, -math.log(N))
    else:
        ancestors, particles, weights, log_after = np.arange(N), predicted, w, log_w - log_evidence
    return Step(belief, predicted, choices, log_likelihood, w, n_eff, ancestors, resampled, particles, weights,
                Belief(particles, log_after, bad_scans), floor, mean, cov, project(graph, mean, floor), log_evidence,
                recovered)


def _check(graph: FloorGraph, belief: Belief, points: AccessPoints, threshold: float) -> None:
    N = len(belief.cloud.object)
    log_w = np.asarray(belief.log_weights)
    if log_w.shape != (N,) or not N:
        raise ValueError(f"belief: expected {N} > 0 particles and as many log weights, got shape {log_w.shape}")
    if np.isnan(log_w).any() or not log_w.max() < np.inf:
        raise ValueError("belief: expected log weights that are numbers or -inf, got NaN or +inf")
    finite("threshold", threshold)
    if not 0.0 <= threshold <= 1.0:
        raise ValueError(f"threshold: expected a fraction of N in [0, 1], got {threshold}")
    if len(graph.floors) > 1 and graph.floor_height_m != points.floor_height_m:
        raise ValueError(f"points: expected the floor height of the graph, {graph.floor_height_m:g} m, got "
                         f"{points.floor_height_m:g} m")


def _scatter_some(
    graph: FloorGraph, cloud: Cloud, log_w: Array, share: float, walk: Walk, rng: "np.random.Generator"
) -> tuple[Cloud, Array, Numbers]:
    """(1 - share) p + share u: a resampled cloud of which some particles are scattered over the map."""
    N = len(log_w)
    if log_w.min() < log_w.max():
        cloud = gather(cloud, draw("systematic", _normalised(log_w)[0], rng))
    some = np.sort(rng.permutation(N)[: int(np.ceil(share * N))])
    if some.size:
        cloud = put(cloud, some, scatter(graph, some.size, rng, walk))
    return cloud, np.full(N, -math.log(N)), some


def _normalised(log_w: Array) -> tuple[Array, float]:
    """w = exp(log w) / sum exp(log w), and log sum exp(log w)."""
    top = float(log_w.max())
    if not np.isfinite(top):
        raise AllWeightsZero("every particle has weight zero: the belief and the scan exclude each other")
    w = np.exp(log_w - top)
    total = float(w.sum())
    w *= 1.0 / total
    return w, top + math.log(total)


def _moments(cloud: Cloud, w: Array) -> tuple[int, Array, Array]:
    """The most likely floor, and mean and covariance of the particles on it."""
    low = int(cloud.floor.min())
    by_floor = np.bincount(cloud.floor - low, w)
    best = int(by_floor.argmax())
    v = w if len(by_floor) == 1 else np.where(cloud.floor == low + best, w, 0.0)
    v = v * (1.0 / by_floor[best])
    x, y = cloud.position_m[:, 0], cloud.position_m[:, 1]
    mean = np.array([np.einsum("i,i", v, x), np.einsum("i,i", v, y)])
    dx, dy = x - mean[0], y - mean[1]
    vx = v * dx
    xx, xy, yy = np.einsum("i,i", vx, dx), np.einsum("i,i", vx, dy), np.einsum("i,i,i", v, dy, dy)
    return low + best, mean, np.array([[xx, xy], [xy, yy]])
