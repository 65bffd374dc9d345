"""Weighing a cloud block by block: w ~ exp(log w), its sum, its effective size and its moments, without underflow."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.types import Array


class AllWeightsZero(ValueError):
    """sum w = 0: no particle can explain the measurement."""


class Piece(NamedTuple):
    """Sums over one block, relative to its largest weight exp(peak) and to the particle c that has it.

    total = sum w, squares = sum w^2, first = sum w (x - c), second = sum w (x - c)(x - c)',  w = exp(log w - peak).
    """

    peak: float
    total: float
    squares: float
    c: Array
    first: Array
    second: Array


class Summary(NamedTuple):
    """log_sum = log sum exp(log w), n_eff = 1 / sum w^2, mean, cov of the normalised weights; scales of the blocks."""

    log_sum: float
    n_eff: float
    mean: Array
    cov: Array
    scales: list[float]


@lru_cache(maxsize=16)
def equal_weights(N: int) -> tuple[Array, Array]:
    """w = 1/N and log w, each one number seen N times (read-only, no memory)."""
    return np.broadcast_to(1.0 / N, N), np.broadcast_to(-np.log(N), N)


def thinned(N: int, most: int) -> NDArray[np.intp]:
    """floor((2 i + 1) N / (2 M)), i = 0..M-1: of N numbers at most `most`, the middle of each of M equal stretches.

    >>> thinned(10, 3).tolist(), thinned(3, 10).tolist()
    ([1, 5, 8], [0, 1, 2])
    """
    M = min(N, most)
    return ((2 * np.arange(M) + 1) * N) // (2 * M)


def log_weights(w: Array) -> tuple[Array | float, float]:
    """log w (B,), or one number if all are equal; and sum w.

    ValueError for a weight that is negative, infinite or NaN.
    """
    low, high = (float(w[0]),) * 2 if w.strides == (0,) else (float(w.min()), float(w.max()))
    if not 0.0 <= low <= high < np.inf:
        raise ValueError(f"weights: expected finite numbers >= 0, got numbers from {low} to {high}")
    if low == high:
        return (math.log(low) if low else -np.inf), low * len(w)
    with np.errstate(divide="ignore"):
        return np.log(w), float(w.sum())


def weigh(log_factor: Array, before: Array | float, x: Array, w: Array) -> Piece:
    """log w = log_factor + before, and the sums of a block.

    log_factor (B,) may hold -inf; before (B,), or one number for all; x (B, n); fills w (B,) with exp(log w - peak).
    ValueError for NaN or +inf in log w, or NaN or infinity in x.
    """
    n = x.shape[-1]
    one = isinstance(before, float)                       # then the shift cancels and only moves the peak
    log_w = log_factor if one else log_factor + before
    best = int(log_w.argmax())                            # argmax stops at a NaN
    peak = float(log_w[best])
    if peak == -np.inf:
        w.fill(0.0)
        return Piece(peak, 0.0, 0.0, np.zeros(n), np.zeros(n), np.zeros((n, n)))
    if not math.isfinite(peak):
        raise ValueError(f"log weight of a particle: expected a number or -inf, got {peak} at x = {x[best]}")
    np.subtract(log_w, peak, out=w)
    np.exp(w, out=w)
    c = x[best].copy()                                    # near the mean of the weighted cloud, so little cancels
    first, second = _moments(w, x.T - c[:, None])
    if not np.isfinite(second).all():
        raise ValueError("particles: expected finite states, got NaN or infinity after the motion model")
    squares = float(np.einsum("b,b", w, w))
    return Piece(peak + before if one else peak, float(w.sum()), squares, c, first, second)


def combine(pieces: Sequence[Piece]) -> Summary:
    """Sums over all blocks: mean = sum w x / sum w, cov = sum w (x - mean)(x - mean)' / sum w.

    AllWeightsZero if every weight is zero.  MAT Algorithm 5, step 4.
    """
    top = max(p.peak for p in pieces)
    if top == -np.inf:
        raise AllWeightsZero(
            "every particle has weight zero: the measurement is impossible for all of them; use more particles, a "
            "wider proposal, or a measurement noise with tails"
        )
    scales = [math.exp(p.peak - top) for p in pieces]
    S = math.fsum(s * p.total for s, p in zip(scales, pieces, strict=True))
    shares = [s / S for s in scales]
    mean = sum(s * (p.total * p.c + p.first) for s, p in zip(shares, pieces, strict=True))
    cov = np.zeros((len(mean), len(mean)))
    for s, p in zip(shares, pieces, strict=True):
        delta = p.c - mean                                # x - mean = (x - c) + delta
        cross = (p.first + 0.5 * p.total * delta)[:, None] * delta
        cov += s * (p.second + (cross + cross.T))
    n_eff = 1.0 / math.fsum(s * s * p.squares for s, p in zip(shares, pieces, strict=True))
    return Summary(top + math.log(S), n_eff, mean, cov, shares)


def _moments(w: Array, d: Array) -> tuple[Array, Array]:
    """sum w d (n,) and sum w d d' (n, n), for w (B,), d (n, B)."""
    first, second = np.empty(len(d)), np.empty((len(d), len(d)))
    if len(w) <= 10_000:                                  # short vectors: BLAS takes them on one thread
        e = d * w
        first[:] = np.vecdot(w, d)
        for k in range(len(d)):
            second[k, :k + 1] = second[:k + 1, k] = np.vecdot(e[k], d[:k + 1])
    else:                                                 # long ones: BLAS would start threads beside ours
        e = np.empty(len(w))
        for k in range(len(d)):
            np.multiply(d[k], w, out=e)
            first[k] = e.sum()
            second[k, :k + 1] = second[:k + 1, k] = np.einsum("b,jb->j", e, d[:k + 1])
    return first, second
