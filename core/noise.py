"""Fast standard normal noise for large clouds: float32 Box-Muller on one SFC64 stream per block of particles.

A float64 ziggurat costs about 9 ns a number; this costs about 2, because numpy computes float32 log, sin and cos many
numbers at a time.  float32 noise is added to float64 states: 7 digits of *noise* are plenty, the state keeps its 16.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.blocks import for_each, spans
from core.checks import finite
from core.types import Array

Noise = NDArray[np.float32]
Sampler = Callable[[Array, Noise, Array], None]


def stream_key(rng: "np.random.Generator") -> tuple[int, ...]:
    """128 bits from rng, the common entropy of the streams of one draw.

    Unlike `rng.spawn` this depends on rng's state alone, so a restored state replays the same noise.
    """
    return tuple(int(word) for word in rng.integers(0, 2**32, 4, dtype=np.uint32))


def stream(key: tuple[int, ...], block: int) -> "np.random.Generator":
    """Generator(SFC64(key, block)): independent for different blocks.

    key from `stream_key`, block the index of a block of particles.
    """
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(key, spawn_key=(block,))))


def box_muller(rng: "np.random.Generator", n: int, count: int) -> Noise:
    """z_1 = r cos(a), z_2 = r sin(a)  with r = sqrt(-2 ln u), u ~ U(0, 1], a ~ U[-pi, pi).

    -> (n, count) float32, independent standard normal to |z| = 6.7, where the 32 bits of u end.
    """
    half = (n * count + 1) // 2
    bits = rng.integers(0, 2**64 - 1, half, dtype=np.uint64, endpoint=True).view(np.uint32).reshape(2, half)
    r = np.add(bits[0], np.float32(0.5), dtype=np.float32, casting="unsafe")          # never 0: the log is finite
    r *= np.float32(2.0**-32)
    np.log(r, out=r)
    r *= np.float32(-2.0)
    np.sqrt(r, out=r)
    angle = np.multiply(bits[1].view(np.int32), np.float32(math.pi * 2.0**-31), dtype=np.float32, casting="unsafe")
    z = np.empty((2, half), np.float32)
    np.cos(angle, out=z[0])
    np.sin(angle, out=z[1])
    z *= r
    return z.reshape(-1)[: n * count].reshape(n, count)


def standard_normal(rng: "np.random.Generator", N: int, n: int, *, threads: int | None = None) -> Noise:
    """z_i ~ N(0, I), i = 1..N.

    -> (N, n) float32, each component contiguous.  Depends on rng's state, not on `threads`.  ValueError for a
    negative size.

    >>> standard_normal(np.random.default_rng(1), 3, 2).shape
    (3, 2)
    """
    if N < 0 or n < 0:
        raise ValueError(f"size: expected N, n >= 0, got {N}, {n}")
    key, blocks = stream_key(rng), spans(N)
    z = np.empty((n, N), np.float32)

    def fill(k: int) -> None:
        z[:, blocks[k]] = box_muller(stream(key, k), n, blocks[k].stop - blocks[k].start)

    for_each(fill, range(len(blocks)), threads)
    return z.T


def linear_sampler(Phi: ArrayLike, L: ArrayLike) -> Sampler:
    """(x, z, out): out = Phi x + L z, for whole blocks.

    Phi (n, n), L (n, r) finite -> a function of x (B, n), z (r, B) float32 and out (B, n), which it fills; x and out
    with contiguous columns are fastest.  A motion model's optional method `sampler()` returns such a function, and the
    particle filter then draws z with `box_muller` instead of calling `sample`.  ValueError for other shapes.

    >>> out = np.empty((1, 2))
    >>> linear_sampler([[1, 2], [0, 1]], np.eye(2))(np.array([[1.0, 3.0]]), np.zeros((2, 1), np.float32), out)
    >>> out
    array([[7., 3.]])
    """
    Phi, L = np.asarray(Phi, dtype=np.float64), np.asarray(L, dtype=np.float64)
    if Phi.ndim != 2 or Phi.shape[0] != Phi.shape[1] or L.ndim != 2 or L.shape[0] != Phi.shape[0]:
        raise ValueError(f"Phi, L: expected shapes (n, n) and (n, r), got {Phi.shape} and {L.shape}")
    return _sampler(Phi.tobytes(), L.tobytes(), len(Phi))


@lru_cache(maxsize=64)
def _sampler(Phi_bytes: bytes, L_bytes: bytes, n: int) -> Sampler:
    """`linear_sampler`, prepared once for a model and not again at every step."""
    Phi, L = (finite(name, np.frombuffer(data).reshape(n, -1)) for name, data in (("Phi", Phi_bytes), ("L", L_bytes)))
    stay = (np.diagonal(Phi) == 1.0).all()                 # usual: then x + noise is one pass
    move, shake = _diagonals(Phi - np.eye(n) if stay else Phi), _diagonals(L.astype(np.float32))

    def sample(x: Array, z: Noise, out: Array) -> None:
        noise = np.empty((n, z.shape[1]), np.float32)
        _set_product(shake, z, noise)
        if stay:
            np.add(x.T, noise, out=out.T)
            _add_product(move, x.T, out.T)
        else:
            _set_product(move, x.T, out.T)
            out += noise.T

    return sample


Diagonals = list[tuple[slice, slice, NDArray]]


def _diagonals(A: NDArray) -> Diagonals:
    """A as its nonzero diagonals (rows, columns, coefficients): A x costs one product of vectors for each of them."""
    found = []
    for k in sorted(range(1 - A.shape[0], A.shape[1]), key=abs):
        d = np.diagonal(A, k)
        used = np.flatnonzero(d)
        if len(used):
            i, j, count = used[0] + max(0, -k), used[0] + max(0, k), used[-1] - used[0] + 1
            found.append((slice(i, i + count), slice(j, j + count), d[used[0]:used[-1] + 1, None].copy()))
    return found


def _set_product(diagonals: Diagonals, x: NDArray, out: NDArray) -> None:
    """out = A x in rows: x (r, B), out (n, B)."""
    whole = slice(0, len(out))
    if diagonals and diagonals[0][:2] == (whole, whole):
        np.multiply(x, diagonals[0][2], out=out)
        diagonals = diagonals[1:]
    else:
        out.fill(0)
    _add_product(diagonals, x, out)


def _add_product(diagonals: Diagonals, x: NDArray, out: NDArray) -> None:
    """out += A x in rows: x (r, B), out (n, B)."""
    for rows, columns, d in diagonals:
        out[rows] += d * x[columns]
