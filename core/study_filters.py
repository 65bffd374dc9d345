"""Filters in one form for a study: from a start, measurements and models to means and covariances of many runs.

A filter is any callable of a `Job` that returns a Gaussian with mean (runs, T, n) and cov (runs, T, n, n); a run in
which it failed is NaN from there on.  The makers here wrap the filters of core.  Kalman-type filters take all runs at
once, in blocks that fit the cache; a particle cloud is a long axis itself, so clouds (and grids) go run by run.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from core import extended, grid, imm, kalman, mixture, particle, unscented
from core.gauss_newton import gauss_newton_batch
from core.grid_density import from_gaussian, gaussian_axes
from core.recursion import plan
from core.stacks import Law, apply
from core.types import Array, Gaussian, Motion, Sensor

BLOCK = 250                                               # runs at a time: enough for speed, few for the cache


class Job(NamedTuple):
    """initial: the law of the state one step before the first measurement, mean (n,), cov (n, n); ys (runs, T, m);
    motion, sensor: one model or one per step; rng; progress(fraction), which may raise to cancel.
    """

    initial: Gaussian
    ys: Array
    motion: Motion | Sequence[Motion]
    sensor: Sensor | Sequence[Sensor]
    rng: "np.random.Generator"
    progress: Callable[[float], object]


Filter: TypeAlias = Callable[[Job], Gaussian]


def kalman_filter() -> Filter:
    """The Kalman filter of `core.kalman` (with a nonlinear model the extended one)."""
    return extended_filter(1)


def extended_filter(iterations: int = 1) -> Filter:
    """The extended Kalman filter of `core.extended`, iterated or not."""

    def run(job: Job) -> Gaussian:
        return _in_blocks(job, lambda ys: extended.run(job.initial, ys, job.motion, job.sensor, iterations).posterior)

    return run


def unscented_filter(kappa: float = 1.0) -> Filter:
    """The unscented Kalman filter of `core.unscented`."""

    def run(job: Job) -> Gaussian:
        return _in_blocks(job, lambda ys: unscented.run(job.initial, ys, job.motion, job.sensor, kappa).posterior)

    return run


def position_filter(dim: int, *, max_iterations: int = 20) -> Filter:
    """z_k = argmin |y_k - h(x)|^2 / R, a static fix;  then the Kalman filter with z_k = x_{1:dim} + v as measurement.

    V(v) = (J'R^-1 J)^-1 of each fix, whose Gauss-Newton iteration starts at the predicted position.  A fix that does
    not converge, or whose stations do not determine it, is left out.  dim: the number of components that the sensor
    determines, the first of the state.  MAT 2.3 and Algorithm 3.
    """

    def run(job: Job) -> Gaussian:
        return _in_blocks(job, lambda ys: _filter_fixes(job, ys, dim, max_iterations))

    return run


def particle_filter(n_particles: int = 1000, **options: object) -> Filter:
    """The particle filter of `core.particle`, run by run; options: resampler, threshold, proposal, threads."""

    def one(job: Job, ys: Array, progress: Callable[[float], object]) -> Gaussian:
        cloud = particle.run(job.initial, ys, *_models(job), n_particles, job.rng, subsample=1,
                             progress=progress, **options)
        return Gaussian(cloud.mean, cloud.cov)

    return _run_by_run(one)


def mixture_filter(upkeep: mixture.Upkeep = mixture.DEFAULT, *, rule: mixture.Rule = "ekf",
                   kappa: float = 1.0) -> Filter:
    """The Gaussian mixture filter of `core.mixture`."""

    def run(job: Job) -> Gaussian:
        def block(ys: Array, progress: Callable[[float], object]) -> Gaussian:
            steps = mixture.run(job.initial, ys, job.motion, job.sensor, upkeep, rule=rule, kappa=kappa,
                                keep_steps=False, progress=progress)
            return Gaussian(steps.means, steps.covs)

        return _in_blocks(job, block, with_progress=True)

    return run


def imm_filter(motions: Sequence[Motion], transition: Array, *, probabilities: Array | None = None,
               rule: mixture.Rule = "ekf", kappa: float = 1.0) -> Filter:
    """Interacting multiple models of `core.imm`, with these models in place of the study's motion."""

    def run(job: Job) -> Gaussian:
        def block(ys: Array, progress: Callable[[float], object]) -> Gaussian:
            return imm.run(job.initial, ys, motions, transition, job.sensor, probabilities=probabilities, rule=rule,
                           kappa=kappa, progress=progress).estimate

        return _in_blocks(job, block, with_progress=True)

    return run


def grid_filter(counts: int | Sequence[int], *, width: float = 5.0, components: Sequence[int] | None = None) -> Filter:
    """The point-mass filter of `core.grid` on a grid that follows, run by run.

    counts: cells per component; width in standard deviations; components: those of the state that the sensor sees.
    """

    def one(job: Job, ys: Array, progress: Callable[[float], object]) -> Gaussian:
        start = from_gaussian(job.initial, gaussian_axes(job.initial, counts, width))
        steps = grid.run(start, ys, *_models(job), width=width, components=components)
        progress(1.0)
        return Gaussian(steps.means, steps.covs)

    return _run_by_run(one)


FILTERS: dict[str, Callable[[], Filter]] = {
    "kf": kalman_filter, "ekf": extended_filter, "ukf": unscented_filter, "pf": particle_filter,
    "mixture": mixture_filter,
}  # fmt: skip


def _in_blocks(job: Job, work: Callable[..., Gaussian], *, with_progress: bool = False) -> Gaussian:
    """work for blocks of runs: it takes ys (T, block, m) and gives laws with leading axes (T, block)."""
    runs = len(job.ys)
    means, covs = [], []
    for start in range(0, runs, BLOCK):
        ys = np.moveaxis(job.ys[start:start + BLOCK], 0, 1)
        share, done = ys.shape[1] / runs, start / runs
        if with_progress:
            g = work(ys, lambda part, share=share, done=done: job.progress(done + share * part))
        else:
            g = work(ys)
            job.progress(done + share)
        means.append(np.moveaxis(g.mean, 0, 1))
        covs.append(np.moveaxis(g.cov, 0, 1))
    return Gaussian(np.concatenate(means), np.concatenate(covs))


def _run_by_run(one: Callable[[Job, Array, Callable[[float], object]], Gaussian]) -> Filter:
    """A filter of one run as a filter of many; a run that loses all its weight is NaN."""

    def run(job: Job) -> Gaussian:
        runs, T = job.ys.shape[:2]
        n = len(job.initial.mean)
        means, covs = np.full((runs, T, n), np.nan), np.full((runs, T, n, n), np.nan)
        for r, ys in enumerate(job.ys):
            try:
                means[r], covs[r] = one(job, ys, lambda part, r=r: job.progress((r + part) / runs))
            except particle.AllWeightsZero:
                job.progress((r + 1) / runs)
        return Gaussian(means, covs)

    return run


def _models(job: Job) -> tuple[Motion, Sensor]:
    """The job's models, if they are the same for all steps."""
    if not hasattr(job.motion, "f") or not hasattr(job.sensor, "h"):
        raise ValueError("motion, sensor: expected one model for all steps in a particle or grid filter, got several")
    return job.motion, job.sensor


def _filter_fixes(job: Job, ys: Array, dim: int, max_iterations: int) -> Gaussian:
    """`position_filter` for ys (T, block, m)."""
    steps = plan(job.initial, ys, job.motion, job.sensor)
    posterior = Law(*(np.broadcast_to(a, (*steps.batch, *a.shape[-k:])) for a, k in zip(steps.initial, (1, 2),
                                                                                      strict=True)))
    H = np.eye(dim, posterior.mean.shape[-1])
    means, covs = [], []
    for epoch in steps.epochs:
        prior = kalman.advance(posterior, epoch.motion)
        seen = apply(H, prior.mean)
        fix = gauss_newton_batch(epoch.sensor, epoch.y, seen, max_iterations=max_iterations)
        good = fix.converged & np.isfinite(fix.cov).all(axis=(-2, -1))
        R = np.where(good[:, None, None], fix.cov, np.eye(dim))
        nu = np.where(good[:, None], fix.x - seen, 0.0)
        missing = np.broadcast_to(~good[:, None], nu.shape)
        posterior = kalman.correct(prior, seen, H, nu, R, missing if missing.any() else None).posterior
        means.append(posterior.mean)
        covs.append(posterior.cov)
    return Gaussian(np.stack(means), np.stack(covs))
