"""Many independent copies of the graph filter at once: how far they lie apart.  GBPF 4.4.3 (the comparison is ours)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.cloud import AllWeightsZero
from core.indoor.cloud import Cloud, gather, scatter
from core.indoor.graph import FloorGraph
from core.indoor.motion import advance
from core.indoor.signal import AccessPoints
from core.indoor.walk import Walk
from core.resampling import draw
from core.types import Array


class Replicas(NamedTuple):
    """R filters of N particles over T epochs.

    values (R, T, k): sum_i w_i phi(x_i) after the scan; n_eff (R, T); resampled (T,) share of the filters; crossings
    (T,): decisions at nodes in this step, per particle.
    """

    values: Array
    n_eff: Array
    resampled: Array
    crossings: Array


def replicate(
    graph: FloorGraph,
    scans: ArrayLike,
    points: AccessPoints,
    phi: Callable[[Cloud], Array],
    n_particles: int,
    runs: int,
    rng: "np.random.Generator",
    *,
    dt_s: float = 1.0,
    walk: Walk | None = None,
    threshold: float = 0.5,
    progress: Callable[[float], object] | None = None,
) -> Replicas:
    """sum_i w_t^i phi(x_t^i) of `runs` independent filters on the same scans; E|error|^2 <= c / N.

    scans (T, m) in dBm as in `run`; phi: a cloud of M particles -> (M, k).  Every filter starts uniform over the map
    and resamples systematically when N_eff < threshold N (0: never, 1: at every scan).  The filters share one big
    cloud, so that their particles move together in one call.  ValueError for arguments that do not fit; AllWeightsZero
    where a filter and a scan exclude each other.
    """
    y = points.scan(scans)
    if y.ndim != 2 or not len(y) or n_particles < 1 or runs < 1:
        raise ValueError(f"scans, n_particles, runs: expected (T, {len(points)}), >= 1, >= 1, got {y.shape}, "
                         f"{n_particles}, {runs}")
    if not 0.0 <= float(finite("threshold", threshold)) <= 1.0:
        raise ValueError(f"threshold: expected a fraction of N in [0, 1], got {threshold}")
    walk, N, T = walk or Walk(), n_particles, len(y)
    cloud = scatter(graph, N * runs, rng, walk)
    log_w = np.zeros((runs, N))
    values, n_eff, resampled, crossings = [], np.empty((runs, T)), np.zeros(T), np.zeros(T)
    for k in range(T):
        if k:
            cloud, choices = advance(graph, cloud, dt_s, walk, rng)
            crossings[k] = len(choices.particle) / (N * runs)
        heard = bool((~np.isnan(y[k])).any())
        if heard:
            log_w += points.log_likelihood(y[k], cloud.position_m, cloud.floor).reshape(runs, N)
        w = _normalised(log_w)
        values.append(np.einsum("rn,rnk->rk", w, phi(cloud).reshape(runs, N, -1)))
        n_eff[:, k] = 1.0 / np.einsum("rn,rn->r", w, w)
        again = np.flatnonzero(heard & ((n_eff[:, k] < threshold * N) | (threshold == 1.0)))
        if again.size:
            ancestors = np.arange(N * runs).reshape(runs, N)
            for r in again:
                ancestors[r] = N * r + draw("systematic", w[r], rng)
            cloud = gather(cloud, ancestors.ravel())
            log_w[again] = 0.0
            resampled[k] = again.size / runs
        if progress:
            progress((k + 1) / T)
    return Replicas(np.array(values).swapaxes(0, 1), n_eff, resampled, crossings)


def _normalised(log_w: Array) -> Array:
    top = log_w.max(axis=1, keepdims=True)
    if not np.isfinite(top).all():
        raise AllWeightsZero("every particle of a filter has weight zero: it and the scan exclude each other")
    log_w -= top
    w = np.exp(log_w)
    return w / w.sum(axis=1, keepdims=True)
