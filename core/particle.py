"""The particle filter: importance sampling with resampling.  MAT 3.5.2, Algorithm 5."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.blocks import LONG, for_each, spans
from core.checks import covariance, finite
from core.cloud import AllWeightsZero, Piece, combine, equal_weights, log_weights, thinned, weigh
from core.linalg import cholesky_psd
from core.noise import standard_normal, stream, stream_key
from core.proposals import Proposal, block_proposal
from core.resampling import RESAMPLERS, Indices, comb, draw
from core.stacks import vector
from core.types import Array, Gaussian, Motion, Sensor

__all__ = ["AllWeightsZero", "Proposal", "Run", "Step", "run", "step"]


class Step(NamedTuple):
    """Everything one step computes, for N particles of n components.

    predicted (N, n) and weights_before (N,): the cloud that represents p(x_k | y_{1:k}) before resampling; n_eff, mean
    (n,) and cov (n, n) are its effective size and moments.  particles (N, n), weights (N,) and log_weights (N,): the
    cloud for the next step, particles = predicted[ancestors]; `resampled` tells whether anything was drawn, otherwise
    ancestors = 0..N-1.  log_evidence = log p(y_k | y_{1:k-1}).  Equal weights are one number seen N times (read-only).
    """

    particles: Array
    weights: Array
    predicted: Array
    weights_before: Array
    ancestors: Indices
    n_eff: float
    mean: Array
    cov: Array
    log_evidence: float
    resampled: bool
    log_weights: Array


class Run(NamedTuple):
    """Summaries of T steps, and the clouds thinned to M particles, those with the numbers index (M,).

    mean (T, n), cov (T, n, n), n_eff, log_evidence, resampled (T,) belong to the full cloud, as in `Step`.
    initial (M, n); predicted, particles (T, M, n); weights_before, weights (T, M), scaled to sum 1 over the M particles
    (all zero if the weight is elsewhere); ancestors (T, M), numbers in the full cloud.  M = N: nothing is left out.
    last: the full cloud after step T.  kept: what `keep` returned, one for each step.
    """

    mean: Array
    cov: Array
    n_eff: Array
    log_evidence: Array
    resampled: NDArray[np.bool_]
    index: Indices
    initial: Array
    predicted: Array
    weights_before: Array
    particles: Array
    weights: Array
    ancestors: Indices
    last: Step
    kept: tuple[object, ...]


def step(
    particles: ArrayLike,
    weights: ArrayLike,
    y: ArrayLike,
    motion: Motion,
    sensor: Sensor,
    rng: "np.random.Generator",
    *,
    resampler: str = "systematic",
    threshold: float = 1.0,
    proposal: str | Proposal = "prior",
    threads: int | None = None,
) -> Step:
    """x^i ~ g(x | x_prev^i, y),  w^i ~ w_prev^i p(y | x^i) p(x^i | x_prev^i) / g(x^i | x_prev^i, y),  then resampling.

    particles (N, n), weights (N,) normalised (another positive sum is divided out), y (m,) in the sensor's units.
    threshold in [0, 1]: resample if N_eff < threshold N; 0 never (SIS), 1 always (SIR).  resampler and proposal:
    `core.resampling.RESAMPLERS`, `core.proposals.block_proposal`.  The result depends on rng's state, not on `threads`
    (None: all cores; clouds below 65,536 particles use one).  A motion model with a method `sampler()` (see
    `core.noise.linear_sampler`) is sampled with fast float32 noise.  Arrays whose components are contiguous, as in
    the result, are fastest.

    ValueError for bad shapes, NaN, negative weights, an unknown name or a threshold outside [0, 1]; its subclass
    AllWeightsZero if no particle can explain y.  MAT Algorithm 5, p. 52.
    """
    x = _cloud(particles)
    w = np.asarray(weights, dtype=np.float64)
    if w.shape != (len(x),):
        raise ValueError(f"weights: expected shape ({len(x)},), got {w.shape}")
    return _step(x, w, None, y, motion, sensor, rng, resampler, threshold, proposal, threads)


def run(
    initial: Gaussian | ArrayLike,
    ys: ArrayLike,
    motion: Motion,
    sensor: Sensor,
    n_particles: int | None,
    rng: "np.random.Generator",
    *,
    resampler: str = "systematic",
    threshold: float = 1.0,
    proposal: str | Proposal = "prior",
    subsample: int = 2000,
    keep: Callable[[int, Step], object] | None = None,
    progress: Callable[[float], object] | None = None,
    threads: int | None = None,
) -> Run:
    """x_0^i ~ initial,  then `step` for each y_1 .. y_T, with weights carried as logarithms.

    initial: a Gaussian to draw n_particles from, or equally weighted particles (N, n).  ys (T, m), T >= 1.  Only
    summaries and a systematic subsample of at most `subsample` particles are kept; keep(k, step), k = 0..T-1, may take
    more from each full step.  progress(fraction) is called after each step and may raise to cancel.  The other
    arguments and the errors are those of `step`.  MAT Algorithm 5, p. 52.
    """
    ys = finite("ys", ys, None, None)
    if ys.ndim != 2 or not len(ys):
        raise ValueError(f"ys: expected shape (T, m), T >= 1, got {ys.shape}")
    if subsample < 1:
        raise ValueError(f"subsample: expected a positive number, got {subsample}")
    x = _start(initial, n_particles, rng, threads)
    N, T = len(x), len(ys)
    index = thinned(N, subsample)
    w, log_w = equal_weights(N)[0], None
    summaries, clouds, kept, first, last = [], [], [], x[index], None
    for k, y in enumerate(ys):
        last = None                                        # frees a cloud before the next is made
        last = _step(x, w, log_w, y, motion, sensor, rng, resampler, threshold, proposal, threads)
        x, w, log_w = last.particles, last.weights, None if last.resampled else last.log_weights
        summaries.append((last.mean, last.cov, last.n_eff, last.log_evidence, last.resampled))
        clouds.append((last.predicted[index], _thin(last.weights_before, index), last.particles[index],
                       _thin(last.weights, index), last.ancestors[index]))
        if keep:
            kept.append(keep(k, last))
        if progress:
            progress((k + 1) / T)
    mean, cov, n_eff, log_evidence, resampled = (np.array(column) for column in zip(*summaries, strict=True))
    predicted, before, after, weights, ancestors = (np.array(column) for column in zip(*clouds, strict=True))
    return Run(mean, cov, n_eff, log_evidence, resampled, index, first, predicted, before, after, weights, ancestors,
               last, tuple(kept))


def _step(
    x: Array,
    w_prev: Array | None,
    log_w_prev: Array | None,
    y: ArrayLike,
    motion: Motion,
    sensor: Sensor,
    rng: "np.random.Generator",
    resampler: str,
    threshold: float,
    proposal: str | Proposal,
    threads: int | None,
) -> Step:
    """`step` for particles (N, n) with contiguous components, and weights or their logarithms, whichever is given."""
    if resampler not in RESAMPLERS:
        raise ValueError(f"resampler: expected one of {', '.join(RESAMPLERS)}, got {resampler!r}")
    if not 0.0 <= threshold <= 1.0:
        raise ValueError(f"threshold: expected a fraction of N in [0, 1], got {threshold}")
    y = vector("y", y, len(sensor.R))
    if y.ndim != 1:
        raise ValueError(f"y: expected one measurement ({len(sensor.R)},), got shape {y.shape}")
    N = len(x)
    blocks = spans(N)
    propose = block_proposal(proposal, y, motion, sensor)
    key = stream_key(rng) if len(blocks) > 1 else None     # one block draws from rng itself
    predicted, w = np.empty(x.shape[::-1]).T, np.empty(N)
    log_w = None if threshold == 1.0 else np.empty(N)      # needed only if the cloud may go on weighted

    def propose_and_weigh(k: int) -> tuple[Piece, float]:
        block = blocks[k]
        with np.errstate(all="ignore"):                    # what is not finite is found and named by `weigh`
            log_factor = propose(x[block], stream(key, k) if key else rng, predicted[block])
            before, total = log_weights(w_prev[block]) if log_w_prev is None else (log_w_prev[block], 0.0)
            if log_w is not None:
                np.add(log_factor, before, out=log_w[block])
            return weigh(log_factor, before, predicted[block], w[block]), total

    pieces, sums = zip(*for_each(propose_and_weigh, range(len(blocks)), threads), strict=True)
    cloud = combine(pieces)
    _scale(w, cloud.scales, threads)
    log_evidence = cloud.log_sum - (np.log(sum(sums)) if log_w_prev is None else 0.0)
    if threshold == 1.0 or cloud.n_eff < threshold * N:
        ancestors, particles = _resample(resampler, predicted, w, rng, threads)
        after, log_after = equal_weights(N)
        resampled = True
    else:
        log_w -= cloud.log_sum
        particles, after, log_after, ancestors, resampled = predicted, w, log_w, np.arange(N), False
    return Step(particles, after, predicted, w, ancestors, cloud.n_eff, cloud.mean, cloud.cov, float(log_evidence),
                resampled, log_after)


def _scale(w: Array, scales: Array, threads: int | None) -> None:
    """w *= scale of its block, in place."""
    blocks = spans(len(w))

    def scale(k: int) -> None:
        w[blocks[k]] *= scales[k]

    for_each(scale, range(len(blocks)), threads)


def _resample(
    resampler: str, x: Array, w: Array, rng: "np.random.Generator", threads: int | None
) -> tuple[Indices, Array]:
    """ancestors ~ w and x[ancestors], each component contiguous."""
    out = np.empty(x.shape[::-1])

    def take(rows: slice, ancestors: Indices) -> None:
        for column, target in zip(x.T, out, strict=True):
            column.take(ancestors, out=target[rows], mode="clip")

    if resampler == "systematic":                          # of most use for large clouds, and gathered as it is found
        ancestors = comb(w, 1.0 - rng.random(), threads, take)
    else:
        ancestors = draw(resampler, w, rng)
        for_each(lambda rows: take(rows, ancestors[rows]), spans(len(x), LONG), threads)
    return ancestors, out.T


def _thin(w: Array, index: Indices) -> Array:
    thinned = w[index]
    total = thinned.sum()
    return thinned / total if total > 0.0 else thinned


def _cloud(particles: ArrayLike) -> Array:
    x = np.asarray(particles, dtype=np.float64)
    if x.ndim != 2 or not x.size:
        raise ValueError(f"particles: expected shape (N, n) with N, n >= 1, got {x.shape}")
    return np.asfortranarray(x)                            # NaN and infinity are looked for block by block


def _start(initial: Gaussian | ArrayLike, N: int | None, rng: "np.random.Generator", threads: int | None) -> Array:
    if not isinstance(initial, Gaussian):
        x = _cloud(initial)
        if N not in (None, len(x)):
            raise ValueError(f"n_particles: expected None or {len(x)}, the number of initial particles, got {N}")
        return x
    P = covariance("initial.cov", initial.cov)
    mean = finite("initial.mean", initial.mean, P.shape[-1])
    if P.ndim != 2 or mean.ndim != 1:
        raise ValueError(f"initial: expected one Gaussian, got mean {mean.shape}, cov {P.shape}")
    if N is None or N < 1:
        raise ValueError(f"n_particles: expected a positive number, got {N}")
    return (mean[:, None] + cholesky_psd(P) @ standard_normal(rng, N, len(mean), threads=threads).T).T
