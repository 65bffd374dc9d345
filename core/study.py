"""Many runs of several filters on the same truth and the same noise.

Batch axes first: (runs, T, .).  The filters that take part are made in `core.study_filters`, tracks and measurements
in `core.simulate`; their names can be imported from here.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from core import metrics
from core.gaussian import chi_square_level
from core.simulate import Truth, observe, simulate
from core.study_filters import (
    FILTERS,
    Filter,
    Job,
    extended_filter,
    grid_filter,
    imm_filter,
    kalman_filter,
    mixture_filter,
    particle_filter,
    position_filter,
    unscented_filter,
)
from core.types import Array, Gaussian, Motion, Sensor

__all__ = [
    "FILTERS", "Filter", "Job", "Result", "Study", "Truth", "extended_filter", "grid_filter", "imm_filter",
    "kalman_filter", "mixture_filter", "monte_carlo", "observe", "particle_filter", "position_filter", "simulate",
    "unscented_filter",
]  # fmt: skip


class Result(NamedTuple):
    """What one filter made of all runs.  "Chosen" are the entries of the state that the study looks at.

    means (runs, T, n), covs (runs, T, n, n); errors = means - truth (runs, T, n).  distances (runs, T): the length of
    the chosen errors; rmse (T,) over the runs.  nees (runs, T): e'P^-1 e of the chosen entries, infinite where P is
    singular; mean_nees (T,), and nees_band: the interval for it if the filter were honest and normal.  coverage
    (T, k): share of the truths in the ellipsoids that claim the k probabilities; coverage_band (k, 2) for it.  lost
    (runs,): the last distance is beyond the threshold, or the filter failed (NaN); lost_share.  failed (runs,): left
    out of all averages over runs.  seconds_per_step: time for one run and step.
    """

    means: Array
    covs: Array
    errors: Array
    distances: Array
    rmse: Array
    nees: Array
    mean_nees: Array
    nees_band: tuple[float, float]
    coverage: Array
    coverage_band: Array
    lost: Array
    lost_share: float
    failed: Array
    seconds_per_step: float


class Study(NamedTuple):
    """truth; results by the filters' names; entries: the chosen ones; probabilities (k,) of the ellipsoids."""

    truth: Truth
    results: dict[str, Result]
    entries: tuple[int, ...]
    probabilities: tuple[float, ...]


def monte_carlo(
    filters: Mapping[str, Filter] | Sequence[str],
    initial: Gaussian,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    *,
    truth: Truth | None = None,
    steps: int = 60,
    runs: int = 100,
    rng: "np.random.Generator",
    lost_beyond: float,
    entries: Sequence[int] | None = None,
    probabilities: Sequence[float] = (0.68, 0.95),
    band: float = 0.95,
    progress: Callable[[float], object] | None = None,
) -> Study:
    """Each filter on the same x_1, ..., x_T and y_1, ..., y_T, for all runs; then errors, NEES, coverage, lost tracks.

    filters: by name, callables as in `core.study_filters` or names from FILTERS ("kf", "ekf", "ukf", "pf",
    "mixture").  They start from `initial` (n) and use motion and sensor, one or one per step.  truth: from `simulate`,
    perhaps with other models or another start than the filters believe in (None: drawn here from initial, motion and
    sensor, `steps` and `runs` long).  lost_beyond: in the unit of the chosen `entries` of the state (None: all).
    band: probability of nees_band and coverage_band.  A filter's noise depends on rng and on its own name, not on the
    other filters.  progress(fraction) may raise to cancel.  ValueError for anything that does not fit.
    """
    chosen = _filters(filters)
    n = len(initial[0])
    entries = tuple(range(n)) if entries is None else tuple(int(e) for e in entries)
    if not entries or len(set(entries)) != len(entries) or min(entries) < 0 or max(entries) >= n:
        raise ValueError(f"entries: expected different indices from 0 to {n - 1}, got {list(entries)}")
    if not lost_beyond > 0:
        raise ValueError(f"lost_beyond: expected a positive distance, got {lost_beyond}")
    levels = chi_square_level(np.asarray(probabilities, dtype=np.float64), len(entries))
    if truth is None:
        truth = simulate(initial, motion, sensor, steps, runs, rng)
    if truth.states.ndim != 3 or truth.states.shape[-1] != n or truth.ys.shape[:2] != truth.states.shape[:2]:
        raise ValueError(f"truth: expected states (runs, T, {n}) and ys (runs, T, m), got {truth.states.shape} and "
                         f"{truth.ys.shape}")
    key = tuple(int(word) for word in rng.integers(0, 2**32, 4, dtype=np.uint32))
    results = {}
    for k, (name, run) in enumerate(chosen.items()):
        def report(part: float, k: int = k) -> None:
            if progress:
                progress((k + part) / len(chosen))

        own = np.random.default_rng(np.random.SeedSequence(key, spawn_key=tuple(name.encode())))
        report(0.0)
        begun = time.perf_counter()
        estimate = run(Job(initial, truth.ys, motion, sensor, own, report))
        spent = time.perf_counter() - begun
        results[name] = _judge(name, estimate, truth.states, entries, lost_beyond, levels, band,
                               np.asarray(probabilities, dtype=np.float64), spent / truth.ys[..., 0].size)
    if progress:
        progress(1.0)
    return Study(truth, results, entries, tuple(map(float, probabilities)))


def _judge(
    name: str, estimate: Gaussian, states: Array, entries: tuple[int, ...], lost_beyond: float, levels: Array,
    band: float, probabilities: Array, seconds: float,
) -> Result:
    means, covs = np.asarray(estimate.mean), np.asarray(estimate.cov)
    if means.shape != states.shape or covs.shape != (*states.shape, states.shape[-1]):
        raise ValueError(f"{name}: expected means {states.shape} and covs {(*states.shape, states.shape[-1])}, got "
                         f"{means.shape} and {covs.shape}")
    e = list(entries)
    failed = ~(np.isfinite(means).all(axis=(1, 2)) & np.isfinite(covs).all(axis=(1, 2, 3)))
    good = ~failed
    T, count = states.shape[1], int(good.sum())
    errors = means - states
    distances = np.sqrt(np.square(errors[..., e]).sum(axis=-1))
    nees = np.full(distances.shape, np.nan)
    rmse, mean_nees, coverage = np.full(T, np.nan), np.full(T, np.nan), np.full((T, len(levels)), np.nan)
    nees_band, coverage_band = (np.nan, np.nan), np.full((len(levels), 2), np.nan)
    if count:
        nees[good] = _nees(means[good][..., e], covs[good][..., e, :][..., e], states[good][..., e])
        rmse = metrics.rmse(means[good][..., e], states[good][..., e], axis=0)
        mean_nees = nees[good].mean(axis=0)
        coverage = (nees[good][..., None] <= levels).mean(axis=0)
        nees_band = metrics.consistency_band(band, len(e), count)
        coverage_band = np.array([_binomial_band(band, p, count) for p in probabilities])
    lost = failed | (np.where(failed, 0.0, distances[:, -1]) > lost_beyond)
    return Result(means, covs, errors, distances, rmse, nees, mean_nees, nees_band, coverage, coverage_band, lost,
                  float(lost.mean()), failed, seconds)


def _nees(x: Array, P: Array, truth: Array) -> Array:
    """NEES (...), infinite where P claims no error in some direction."""
    try:
        return metrics.nees(Gaussian(x, P), truth)
    except ValueError:
        sound = np.linalg.eigvalsh(P)
        sound = sound[..., 0] > 1e-12 * np.maximum(sound[..., -1], 1e-300)
        out = np.full(x.shape[:-1], np.inf)
        if sound.any():
            out[sound] = metrics.nees(Gaussian(x[sound], P[sound]), truth[sound])
        return out


def _binomial_band(probability: float, p: float, count: int) -> tuple[float, float]:
    """[a, b] / count with P(a <= Bin(count, p) <= b) >= probability, each tail at most half of the rest."""
    from scipy.special import bdtr

    tail = (1 - probability) / 2
    below = bdtr(np.arange(count + 1.0), count, p)       # P(X <= k)
    low = int(np.searchsorted(below, tail, side="right"))
    high = int(np.searchsorted(below, 1 - tail))
    return low / count, min(high, count) / count


def _filters(filters: Mapping[str, Filter] | Sequence[str]) -> dict[str, Filter]:
    if isinstance(filters, str) or not len(filters):
        raise ValueError(f"filters: expected a mapping of names to filters, or names, got {filters!r}")
    if isinstance(filters, Mapping):
        return dict(filters)
    unknown = [name for name in filters if name not in FILTERS]
    if unknown:
        raise ValueError(f"filters: expected names from {', '.join(FILTERS)}, got {unknown[0]!r}")
    return {name: FILTERS[name]() for name in filters}
