"""Resampling: N equally weighted copies of weighted particles.  MAT 3.5.2.

Every method compares points z in (0, 1] with the cumulative weights c_j = w_1 + ... + w_j and takes the particle j with

    c_{j-1} < z <= c_j.                                                                          MAT Algorithm 6

The comparison is exact: cumulative weights and points are whole numbers of the unit 1 / (N 2^s), N 2^s <= 2^52.  Such a
unit is finer than what N w_j carries as a double, yet coarse enough to make N w_j whole where round-off missed it by
one bit; sums of whole numbers depend neither on their order nor on the number of threads.  The last cumulative weight
is 1 by definition.  A particle of weight zero is never taken.

Indices are 0-based.  Gather with them into a *new* array: the notes' x^i = x^j in place overwrites parents that are
still needed (erratum M22).
"""

import math
from collections.abc import Callable
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.blocks import LONG, for_each, spans
from core.checks import finite
from core.types import Array

Indices = NDArray[np.intp]
_BITS = 52


def systematic(w: ArrayLike, u: float, *, threads: int | None = None) -> Indices:
    """z_i = (i + u) / N, i = 0..N-1: one comb of points with equal spacing.

    w (N,) normalised weights, u in (0, 1] (the notes' z_1 is u / N) -> ancestors (N,), rising.  Particle j gets
    floor(N w_j) or ceil(N w_j) copies; their expectation over u is N w_j.  A sum other than 1 is divided out.
    ValueError for weights that are negative, not finite or all zero, and for u outside (0, 1].
    MAT Algorithm 6, p. 53.

    >>> systematic([0.1, 0.05, 0.3, 0.2, 0.35], 0.12 * 5).tolist()
    [1, 2, 3, 4, 4]
    """
    offset = _points("u", u)
    if offset.ndim:
        raise ValueError(f"u: expected one number, got shape {offset.shape}")
    return comb(_weights(w), float(offset), threads)


def comb(
    w: Array, u: float, threads: int | None = None, then: Callable[[slice, Indices], None] | None = None
) -> Indices:
    """`systematic` for weights (N,) that are known to be finite, >= 0 and of sum 1.

    then(rows, ancestors of these rows) is called as soon as they are known, by the thread that found them.

    >>> comb(np.array([0.25, 0.75]), 0.5).tolist()
    [0, 1]
    """
    N, blocks = len(w), spans(len(w), LONG)
    s, one = _unit(N)
    C = np.empty(N, np.int64)                             # sums within each block: block k has ends[k-1] before it
    ends = list(accumulate(for_each(lambda block: _sums(w[block], one, C[block]), blocks, threads)))
    first = math.ceil(u * 2**s)                           # points first + i 2^s: those <= C_j are counted, not searched
    last = ends.index(ends[-1])                           # the block where the weights end
    ancestors = np.empty(N, np.intp)

    def fill(k: int) -> None:
        before = ends[k - 1] if k else 0
        start = (before - first + (1 << s)) >> s if k else 0
        K = C[blocks[k]] + (before - first + (1 << s) - (start << s))
        K >>= s                                           # K_j = number of points z <= c_j, from `start` on
        if k == last:
            K[np.searchsorted(C[blocks[k]], C[blocks[k].stop - 1]):] = N - start       # c_N = 1
        count = min(int(K[-1]), N - start)
        if count > 0:
            rows = slice(start, start + count)
            steps = np.bincount(K, minlength=count)[:count]                  # where the ancestor moves on
            steps[0] += blocks[k].start
            np.cumsum(steps, out=ancestors[rows])
            if then:
                then(rows, ancestors[rows])

    for_each(fill, range(last + 1), threads)
    return ancestors


def stratified(w: ArrayLike, u: ArrayLike) -> Indices:
    """z_i = (i + u_i) / N, i = 0..N-1: one point in each stratum.

    w (N,) normalised weights, u (N,) in (0, 1] -> ancestors (N,), rising.  Particle j gets N w_j copies in expectation
    and at least floor(N w_j) - 1 (not floor(N w_j) as the notes say, erratum M23).  ValueError as `systematic`.
    MAT 3.5.2, p. 53.

    >>> stratified([0.17, 0.34, 0.49], [0.3, 0.8, 0.7]).tolist()
    [0, 2, 2]
    """
    w = _weights(w)
    C, s = _cumulative(w)
    u = _points("u", u, len(w))
    z = (np.arange(len(w)) << s) + np.ceil(u * 2.0**s).astype(np.int64)
    return np.searchsorted(C, z)


def multinomial(w: ArrayLike, u: ArrayLike) -> Indices:
    """z_i = u_i: N independent draws.

    w (N,) normalised weights, u (N,) in (0, 1] -> ancestors (N,) in the order of u.  Particle j gets N w_j copies in
    expectation, with variance N w_j (1 - w_j).  ValueError as `systematic`.  MAT 3.5.2, p. 53.

    >>> multinomial([0.5, 0.5], [0.9, 0.5]).tolist()
    [1, 0]
    """
    w = _weights(w)
    C, _ = _cumulative(w)
    return np.searchsorted(C, np.ceil(_points("u", u, len(w)) * float(C[-1])).astype(np.int64))


def residual(w: ArrayLike, u: ArrayLike) -> Indices:
    """floor(N w_j) copies outright; the other R = N - sum floor(N w_j) drawn with weights N w_j - floor(N w_j).

    w (N,) normalised weights; u (R,) in (0, 1], or longer: the first R are used -> ancestors (N,): the outright copies,
    rising, then the draws in the order of u.  Particle j gets N w_j copies in expectation and at least floor(N w_j).
    ValueError as `systematic`, and for fewer than R numbers u.

    >>> residual([0.1, 0.05, 0.3, 0.2, 0.35], [0.6, 1.0]).tolist()
    [2, 3, 4, 2, 4]
    """
    w = _weights(w)
    C, s = _cumulative(w)
    shares = np.diff(C, prepend=0)
    copies, rest = shares >> s, shares & ((1 << s) - 1)
    outright = np.repeat(np.arange(len(w)), copies)
    R = len(w) - len(outright)
    u = _points("u", u, None)
    if len(u) < R:
        raise ValueError(f"u: expected at least {R} numbers for the remainder, got {len(u)}")
    drawn = np.searchsorted(np.cumsum(rest), np.ceil(u[:R] * float(R << s)).astype(np.int64))
    return np.concatenate([outright, drawn])


RESAMPLERS: dict[str, Callable[..., Indices]] = {
    "systematic": systematic, "stratified": stratified, "multinomial": multinomial, "residual": residual,
}


def draw(name: str, w: ArrayLike, rng: "np.random.Generator", *, threads: int | None = None) -> Indices:
    """ancestors ~ the resampling method called `name`, its uniforms drawn from rng.

    w (N,) normalised weights -> ancestors (N,).  `systematic` takes one number from rng, the others N.  ValueError for
    an unknown name or bad weights.

    >>> draw("stratified", [0.0, 1.0], np.random.default_rng(1)).tolist()
    [1, 1]
    """
    if name not in RESAMPLERS:
        raise ValueError(f"resampler: expected one of {', '.join(RESAMPLERS)}, got {name!r}")
    if name == "systematic":
        return systematic(w, 1.0 - rng.random(), threads=threads)
    u = 1.0 - rng.random(np.shape(w))
    if name == "multinomial":
        u.sort()                                          # independent draws have no order; a rising search is faster
    return RESAMPLERS[name](w, u)


def effective_sample_size(w: ArrayLike) -> Array:
    """N_eff = 1 / sum w_j^2.

    w (..., N) weights, normalised here -> (...), between 1 and N.  ValueError for weights that are negative, not finite
    or all zero.  MAT 3.5.2, p. 52.

    >>> float(effective_sample_size([0.5, 0.5, 0.0]))
    2.0
    """
    w = finite("w", w, None)
    total = w.sum(axis=-1, keepdims=True)
    if w.shape[-1] == 0 or w.min(initial=0.0) < 0.0 or not (total > 0.0).all() or not np.isfinite(total).all():
        raise ValueError(f"w: expected weights >= 0 with a positive finite sum, got {w}")
    return 1.0 / np.square(w / total).sum(axis=-1)


def _weights(w: ArrayLike) -> Array:
    w = finite("w", w, None)
    if w.ndim != 1 or not 1 <= len(w) <= 2**40:
        raise ValueError(f"w: expected shape (N,), N >= 1, got {w.shape}")
    if w.min() < 0.0:
        raise ValueError(f"w: expected weights >= 0, got {w.min():.3g}")
    total = float(w.sum())
    if not 0.0 < total < np.inf:
        raise ValueError(f"w: expected a positive finite sum, got {total}")
    return w if abs(total - 1.0) <= 1e-9 else w / total   # round-off of the sum falls to the last particle, c_N = 1


def _points(name: str, u: ArrayLike, *shape: int | None) -> Array:
    u = finite(name, u, *shape)
    if shape and u.ndim != 1:
        raise ValueError(f"{name}: expected one axis, got shape {u.shape}")
    if u.size and not (u.min() > 0.0 and u.max() <= 1.0):
        raise ValueError(f"{name}: expected numbers in (0, 1], got {u.min() if u.min() <= 0.0 else u.max()}")
    return u


def _unit(N: int) -> tuple[int, int]:
    """s and the whole number N 2^s that stands for 1."""
    s = _BITS - (N - 1).bit_length()
    return s, N << s


def _sums(w: Array, one: int, out: NDArray[np.int64]) -> int:
    """out_j = w_1 + ... + w_j in units of 1 / one; and the last of them."""
    shares = w * float(one)
    out[:] = np.rint(shares, out=shares)
    np.cumsum(out, out=out)
    return int(out[-1])


def _cumulative(w: Array) -> tuple[NDArray[np.int64], int]:
    """C_j = c_j N 2^s as whole numbers (N,), C_N = N 2^s; and s."""
    s, one = _unit(len(w))
    C = np.empty(len(w), np.int64)
    total = _sums(w, one, C)
    C[np.searchsorted(C, min(total, one)):] = one          # from the last particle with a weight on; round-off above 1
    return C, s
