"""Resampling: N points on the cumulative weights choose the particles to copy.  MAT 3.5.2, Algorithm 6.

A particle with omega^j >= l/N gets at least l copies from the comb of the systematic scheme, and only l - 1 from the
stratified one (erratum M23); copied into the old places, parents are overwritten while still needed (erratum M22).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import resampling
from core.types import Array
from lessons.filtering._resampling_view import SCHEMES, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

MOST = 8


def _particle(x: float, parts: float) -> Point:
    return draggable((x, parts), low=0.0, high=10.0, unit="m, parts", role="handle", group="particles")


@dataclass(frozen=True, slots=True)
class Params:
    """The scheme and its random numbers; each particle is a handle: its place, and its weight in parts."""

    scheme: str = choice("systematic", SCHEMES)
    u: float = slider(0.6, low=0.01, high=1.0, step=0.01)
    seed: int = seed(1)
    n: int = slider(5, low=2, high=MOST)
    watched: int = slider(3, low=1, high=MOST)
    p1: Point = _particle(1.0, 1.0)
    p2: Point = _particle(3.0, 0.5)
    p3: Point = _particle(5.0, 3.0)
    p4: Point = _particle(7.0, 2.0)
    p5: Point = _particle(9.0, 3.5)
    p6: Point = _particle(2.0, 1.5)
    p7: Point = _particle(6.0, 2.5)
    p8: Point = _particle(8.0, 1.0)
    gather: str = choice("new", ("new", "in_place"), group="more")
    repetitions: int = slider(2000, low=100, high=10_000, log=True, group="more")
    shape: str = choice("staircase", ("staircase", "wheel"), group="view")


class Many(NamedTuple):
    """Copies over the repetitions, one row for each of SCHEMES."""

    mean: Array                  # (4, N)
    variance: Array              # (4, N)
    shares: Array                # (4, N + 1) how often the watched particle had 0..N copies
    below: Array                 # (4,) how often it had fewer than floor(N omega)
    mean_sd: Array               # (4,) standard deviation of 1/N sum n_j x^j about sum omega^j x^j, in metres


class Result(NamedTuple):
    """One resampling in full; particles are numbered from left to right."""

    x: Array                     # (N,) in metres
    parts: Array                 # (N,) weights as drawn
    w: Array                     # (N,) normalised
    outright: Array              # (N,) copies made before any point is drawn (residual scheme only)
    stairs: Array                # (N,) the cumulative weights that the points are compared with; last one 1
    z: Array                     # (R,) the points, in the order in which they are used
    ancestors: Array             # (N,)
    copies: Array                # (N,)
    children: Array              # (N,) places of the new particles
    n_eff: float
    watched: int                 # counted from 0
    many: Many


def compute(p: Params, progress: Progress) -> Result:
    """Resamples once with the points shown, and many times with each scheme."""
    handles = np.array([getattr(p, f"p{i + 1}") for i in range(p.n)])
    x, parts = handles[np.argsort(handles[:, 0], kind="stable")].T
    parts = parts if parts.sum() > 0.0 else np.ones(p.n)                   # no weight anywhere: all alike
    w = parts / parts.sum()
    rng = np.random.default_rng(p.seed)
    u = 1.0 - rng.random(p.n)

    outright = np.floor(p.n * w + 1e-12) if p.scheme == "residual" else np.zeros(p.n)
    rest = p.n * w - outright if p.scheme == "residual" else w
    stairs = np.cumsum(np.maximum(rest, 0.0))
    stairs = stairs / stairs[-1] if stairs[-1] > 1e-9 else stairs
    if p.scheme == "systematic":
        z, ancestors = (np.arange(p.n) + p.u) / p.n, resampling.systematic(w, p.u)
    else:
        z = (np.arange(p.n) + u) / p.n if p.scheme == "stratified" else u[:p.n - int(outright.sum())]
        ancestors = resampling.RESAMPLERS[p.scheme](w, u)
    watched = min(p.watched, p.n) - 1
    children = x[ancestors] if p.gather == "new" else in_place(x, ancestors)
    return Result(x, parts, w, outright, stairs, z, ancestors, np.bincount(ancestors, minlength=p.n), children,
                  float(resampling.effective_sample_size(w)), watched,
                  repeat(x, w, watched, p.repetitions, rng, progress))


def in_place(x: Array, ancestors: Array) -> Array:
    """x^i := x^j one after the other in the same array, as Algorithm 6 is printed (erratum M22)."""
    x = x.copy()
    for i, j in enumerate(ancestors):
        x[i] = x[j]
    return x


def repeat(x: Array, w: Array, watched: int, count: int, rng: np.random.Generator, progress: Progress) -> Many:
    """Each scheme `count` times with new random numbers."""
    N = len(w)
    copies = np.empty((len(SCHEMES), count, N))
    for s, scheme in enumerate(SCHEMES):
        for m in range(count):
            copies[s, m] = np.bincount(resampling.draw(scheme, w, rng), minlength=N)
        progress((s + 1) / len(SCHEMES))
    one = copies[:, :, watched]
    shares = (one[:, :, None] == np.arange(N + 1)).mean(axis=1)
    below = (one < np.floor(N * w[watched] + 1e-12)).mean(axis=1)
    means = copies @ x / N - w @ x
    return Many(copies.mean(axis=1), copies.var(axis=1), shares, below, np.sqrt(np.square(means).mean(axis=1)))


def timeline(p: Params) -> Timeline:
    """One point after the other; all of them are shown first."""
    return Timeline(p.n, ("point", "search", "copy"), start=p.n, unit_name="i")


def unused(p: Params) -> set[str]:
    """Particles beyond N; the comb's offset where there is no comb."""
    return {f"p{i}" for i in range(p.n + 1, MOST + 1)} | (set() if p.scheme == "systematic" else {"u"})


_C3_32 = {"n": 3, "p1": (2.0, 1.7), "p2": (5.0, 3.4), "p3": (8.0, 4.9), "watched": 2}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 3.5.2", "MAT Algorithm 6"),
    presets={
        "Algorithm 6": {},
        "comb at z₁ = 0.02": {"u": 0.1},
        "stratified: no copy for 0.34": {"scheme": "stratified", "seed": 5167, **_C3_32},
        "the same weights, systematic": {"scheme": "systematic", "u": 0.3, **_C3_32},
        "multinomial": {"scheme": "multinomial"},
        "residual": {"scheme": "residual"},
        "copied in place": {"gather": "in_place", "u": 0.5, "p1": (1.0, 3.6), "p2": (3.0, 3.0), "p3": (5.0, 1.6),
                            "p4": (7.0, 1.0), "p5": (9.0, 0.8)},
        "a wheel": {"shape": "wheel", "n": 8, "watched": 6},
    },
)
