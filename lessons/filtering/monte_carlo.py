"""Integrals as averages over random points, and how sure one may be of them.

MAT 3.5.1, (3.21)-(3.23), Theorem 7, Example 21, Figure 3.2, exercise 3.13.  The variance printed in Example 21 is 2.04
times too small, because samples with h = 0 were left out of the sum (erratum M20).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import importance
from core.types import Array
from lessons.filtering import _monte_carlo_problems as problems
from lessons.filtering._monte_carlo_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

STEPS = 16
AT_ONCE = 500_000                        # samples that are in memory together


@dataclass(frozen=True, slots=True)
class Params:
    """Which integral, where its samples come from, and how many of them."""

    problem: str = choice("parabola", ("parabola", "square"))
    proposal: str = choice("normal", ("normal", "uniform", "target"))
    width: float = slider(1.0, low=0.3, high=5.0, step=0.05)
    centre: float = slider(0.0, low=-2.0, high=2.0, step=0.05)
    n: int = slider(10_000, low=100, high=100_000, log=True)
    corner_1: Point = draggable((0.0, 0.0), low=-3.0, high=3.0, unit="", role="handle", group="square")
    corner_2: Point = draggable((2.0, 2.0), low=-3.0, high=3.0, unit="", role="handle", group="square")
    repetitions: int = slider(1000, low=100, high=2000, group="more")
    seed: int = seed(175, group="more")


class Result(NamedTuple):
    """One run in full, and many others by their answers.  d is 1 (parabola) or 2 (square)."""

    exact: Array                 # (d,)
    z: Array                     # (n, d) samples of f
    h: Array                     # (n,) g/f at the samples
    counts: Array                # (STEPS + 1,) the numbers of samples at which we look
    running: Array               # (STEPS + 1, d) estimate from the first so many samples; NaN if none has counted
    running_sd: Array            # (STEPS + 1, d) its standard deviation as (3.23) estimates it
    left_out_sd: float           # the same at n if samples with h = 0 are left out of the sum (erratum M20)
    answers: Array               # (repetitions,) first component of the estimate from n samples, NaN if none
    rms: Array                   # (STEPS + 1,) root mean square error over the repetitions
    term_variance: float         # n V(estimate) by quadrature
    left_out_variance: float     # what (3.23) tends to, times n, without the zeros
    sweep: Array                 # (60,) term_variance at problems.WIDTHS


def compute(p: Params, progress: Progress) -> Result:
    """One run from seed's first stream, the repetitions from its second."""
    shown, others = np.random.default_rng(p.seed).spawn(2)
    exact = problems.exact(p)
    counts = np.rint(np.geomspace(10, p.n, STEPS + 1)).astype(int)
    z = problems.sample(p, (p.n,), shown)
    h = problems.target(p, z) / problems.density(p, z)                       # (3.21)
    running, sd = _run(p, z, h, counts)
    left_out = np.sqrt(np.square(h[h > 0.0] - running[-1, 0]).sum()) / p.n if p.problem == "parabola" else 0.0
    progress(0.1)

    answers, squares = np.empty(p.repetitions), np.zeros(STEPS + 1)
    rows = max(1, AT_ONCE // p.n)
    for start in range(0, p.repetitions, rows):
        many = slice(start, min(start + rows, p.repetitions))
        estimates = _estimates(p, many.stop - many.start, counts, others)
        answers[many] = estimates[:, -1]
        squares += np.nansum(np.square(estimates - exact[0]), axis=0)
        progress(0.1 + 0.9 * many.stop / p.repetitions)
    term = problems.term_variance(p)
    sweep = np.array([problems.term_variance(p, float(w)) for w in problems.WIDTHS])
    return Result(exact, z, h, counts, running, sd, float(left_out), answers, np.sqrt(squares / p.repetitions), term,
                  _left_out_variance(p, term), sweep)


def _run(p: Params, z: Array, h: Array, counts: Array) -> tuple[Array, Array]:
    """The estimate and its standard deviation from the first counts[k] samples."""
    if p.problem == "parabola":
        found = importance.running(h)
        return found.mean[counts - 1, None], np.sqrt(found.variance[counts - 1, None])
    mean, sd = np.full((len(counts), 2), np.nan), np.full((len(counts), 2), np.nan)
    with np.errstate(divide="ignore"):
        log_h = np.log(h)
    for k, n in enumerate(counts):
        if (h[:n] > 0.0).any():                                              # nothing can be said before
            one = importance.self_normalised(z[:n].T, log_h[:n])
            mean[k], sd[k] = one.mean, np.sqrt(one.variance)
    return mean, sd


def _estimates(p: Params, rows: int, counts: Array, rng: np.random.Generator) -> Array:
    """First component of the estimate in `rows` repetitions at each of the counts: (rows, STEPS + 1)."""
    z = problems.sample(p, (rows, p.n), rng)
    h = problems.target(p, z) / problems.density(p, z)
    starts = np.concatenate([[0], counts[:-1]])

    def sums(terms: Array) -> Array:
        return np.cumsum(np.add.reduceat(terms, starts, axis=-1), axis=-1)

    if p.problem == "parabola":
        return sums(h) / counts
    with np.errstate(invalid="ignore"):
        return sums(h * z[..., 0]) / sums(h)


def _left_out_variance(p: Params, term: float) -> float:
    """int g^2/f - 2 + P(|z| <= 1) for the normal proposal of Example 21 and others like it."""
    if p.problem != "parabola":
        return term
    low, high = (float(v) for v in problems.box(p)[0])
    z = 0.5 * (high - low) * problems.NODES
    inside = float(0.5 * (high - low) * problems.NODE_WEIGHTS @ problems.axis_density(p, 0, z))
    return max(term - (1.0 - min(inside, 1.0)), 0.0)


def timeline(p: Params) -> Timeline:
    """More and more samples; the last step has all of them."""
    return Timeline(STEPS, ("draw", "evaluate", "average"), start=STEPS)


def unused(p: Params) -> set[str]:
    """The rectangle belongs to the square; only some proposals have a width and a centre."""
    found = {"corner_1", "corner_2"} if p.problem == "parabola" else set()
    if p.proposal == "target" or (p.proposal == "uniform" and p.problem == "square"):
        found |= {"width", "centre"}
    return found


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=2.0,
    refs=("MAT 3.5.1", "MAT (3.21)-(3.23)", "MAT Theorem 7", "MAT Example 21", "MAT Figure 3.2", "MAT exercise 3.13"),
    presets={
        "Example 21": {},
        "a better normal": {"width": 0.55},
        "off to one side: fooled": {"width": 0.3, "centre": 0.55, "n": 2000},
        "uniform on [−1, 1]": {"proposal": "uniform"},
        "uniform, too short": {"proposal": "uniform", "width": 0.6},
        "f = g": {"proposal": "target"},
        "exercise 3.13": {"problem": "square"},
        "exercise 3.13, uniform": {"problem": "square", "proposal": "uniform"},
        "a far corner": {"problem": "square", "corner_1": (1.8, 1.8), "corner_2": (3.0, 3.0)},
    },
)
