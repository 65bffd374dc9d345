"""The graph-based particle filter over a whole walk.  GBPF 5.4."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.cloud import thinned
from core.indoor.cloud import Cloud, Numbers, gather
from core.indoor.filter import Belief, Recovery, Step, start, step
from core.indoor.graph import FloorGraph, Id
from core.indoor.signal import AccessPoints
from core.indoor.walk import Walk
from core.types import Array


class Run(NamedTuple):
    """Summaries of T epochs, as in `Step`; and the steps, thinned to the M particles with the numbers index (M,).

    time_s, n_eff, log_evidence, floor, resampled, scanned (T,); mean, projected (T, 2), cov (T, 2, 2); object_ids: the
    objects of `projected`.  steps: T records whose clouds hold M particles; their weights are scaled to sum 1 over
    these (all zero if the weight is elsewhere); ancestors and choices name particles of the full cloud.  last: the
    belief after the last epoch, in full.  kept: what `keep` returned, one for each epoch.
    """

    time_s: Array
    mean: Array
    cov: Array
    projected: Array
    object_ids: tuple[Id, ...]
    floor: Numbers
    n_eff: Array
    log_evidence: Array
    resampled: NDArray[np.bool_]
    scanned: NDArray[np.bool_]
    index: Numbers
    steps: tuple[Step, ...]
    last: Belief
    kept: tuple[object, ...]


def run(
    graph: FloorGraph,
    scans: ArrayLike,
    points: AccessPoints,
    rng: "np.random.Generator",
    *,
    n_particles: int = 500,
    belief: Belief | None = None,
    dt_s: float = 1.0,
    walk: Walk | None = None,
    threshold: float = 0.5,
    resampler: str = "systematic",
    recovery: Recovery | None = Recovery(),  # noqa: B008
    subsample: int = 2000,
    keep: Callable[[int, Step], object] | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """`step` for each epoch t = 0, dt, ..., (T - 1) dt; the first without motion.

    scans (T, m) in dBm, NaN for access points that were not heard, a row of NaN for an epoch without a scan.  belief:
    where to start, else n_particles uniform over the map.  Only a systematic subsample of at most `subsample` particles
    of each step is kept; keep(k, step) may take more.  progress(fraction) is called after each epoch and may raise to
    cancel.  Other arguments and errors as in `step`.  GBPF 5.4.
    """
    scans = points.scan(scans)
    if scans.ndim != 2 or not len(scans):
        raise ValueError(f"scans: expected shape (T, {len(points)}), T >= 1, got {scans.shape}")
    if subsample < 1:
        raise ValueError(f"subsample: expected a positive number, got {subsample}")
    if not dt_s > 0.0:
        raise ValueError(f"dt_s: expected a positive number of seconds, got {dt_s}")
    belief = start(graph, n_particles, rng, walk) if belief is None else belief
    N, T = len(belief.log_weights), len(scans)
    index = thinned(N, subsample)
    steps, kept = [], []
    thin_before = _thin_belief(belief, index)
    for k, y in enumerate(scans):
        s = step(graph, belief, y, points, rng, dt_s=dt_s if k else 0.0, walk=walk, threshold=threshold,
                 resampler=resampler, recovery=recovery)
        belief = s.after
        steps.append(_thin(s, thin_before, index))
        thin_before = steps[-1].after
        if keep:
            kept.append(keep(k, s))
        if progress:
            progress((k + 1) / T)
    columns = {name: np.array([getattr(s, name) for s in steps]) for name in
               ("mean", "cov", "floor", "n_eff", "log_evidence", "resampled")}
    return Run(time_s=dt_s * np.arange(T), projected=np.array([s.projection.xy_m for s in steps]),
               object_ids=tuple(s.projection.object_id for s in steps), scanned=~np.isnan(scans).all(axis=1),
               index=index, steps=tuple(steps), last=belief, kept=tuple(kept), **columns)


def _thin(s: Step, before: Belief, index: Numbers) -> Step:
    """A step with the particles `index` only."""
    if len(index) == len(s.ancestors):
        return s
    predicted = gather(s.predicted, index)
    after = _thin_belief(s.after, index) if s.resampled else Belief(predicted, *_thin_belief_weights(s.after, index))
    return s._replace(before=before, predicted=predicted, log_likelihood=s.log_likelihood[index],
                      weights_before=_scaled(s.weights_before[index]), ancestors=s.ancestors[index],
                      particles=after.cloud, weights=_scaled(s.weights[index]), after=after)


def _thin_belief(b: Belief, index: Numbers) -> Belief:
    if len(index) == len(b.log_weights):
        return b
    cloud: Cloud = gather(b.cloud, index)
    return Belief(cloud, *_thin_belief_weights(b, index))


def _thin_belief_weights(b: Belief, index: Numbers) -> tuple[Array, int]:
    with np.errstate(divide="ignore"):
        return np.log(_scaled(np.exp(b.log_weights[index]))), b.bad_scans


def _scaled(w: Array) -> Array:
    total = w.sum()
    return w / total if total > 0.0 else w
