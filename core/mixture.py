"""The Gaussian mixture filter: a bank of Kalman, extended or unscented filters weighted by their evidence.

MAT 3.5, exercise 3.11.  The record and its density are in `core.mixture_law`, splitting in `core.mixture_split`,
pruning and merging in `core.mixture_reduction`, when to do which in `core.mixture_upkeep`; their names can be imported
from here.
"""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from core import kalman, unscented
from core.mixture_law import (
    Components,
    Mixture,
    checked,
    combine,
    heaviest,
    log_density,
    log_evidence,
    log_sum,
    mixture,
    mode,
    moments,
    one,
    peaks,
    responsibilities,
)
from core.mixture_reduction import Reduction, merge, prune
from core.mixture_split import Division, longest_axis, split
from core.mixture_upkeep import DEFAULT, Upkeep
from core.recursion import check_sizes, plan
from core.sigma import sigma_weights
from core.stacks import Law, batch_last
from core.types import Array, Gaussian, Motion, Sensor

__all__ = [
    "Division", "Mixture", "MixtureRun", "MixtureStep", "MixtureUpdate", "Reduction", "Upkeep", "heaviest",
    "log_density", "log_evidence", "longest_axis", "merge", "mixture", "mode", "moments", "one", "peaks", "predict",
    "prune", "responsibilities", "run", "split", "step", "update",
]  # fmt: skip

Rule = Literal["ekf", "ukf"]
_LARGE = 32                                               # stacks of this size are faster batch last


class MixtureUpdate(NamedTuple):
    """One measurement update of c components, with everything on the way.

    prior; step: the record of all components' Kalman (extended, unscented) updates, arrays (..., c, .);
    log_evidences (..., c) = log N(nu_i; 0, S_i); log_evidence (...) = log p(y) = log sum w_i N(nu_i; 0, S_i);
    posterior.
    """

    prior: Mixture
    step: kalman.Update | unscented.UnscentedUpdate
    log_evidences: Array
    log_evidence: Array
    posterior: Mixture


class MixtureStep(NamedTuple):
    """predicted; division: what was too wide was split; update; pruned; merged; posterior: the mixture that goes on.

    estimate: mean (..., n) and cov (..., n, n) of update.posterior.
    """

    predicted: Mixture
    division: Division
    update: MixtureUpdate
    pruned: Reduction
    merged: Reduction
    posterior: Mixture
    estimate: Gaussian


class MixtureRun(NamedTuple):
    """means (T, ..., n), covs (T, ..., n, n) of the posteriors; log_evidences, counts of components (T, ...); steps.

    initial: the mixture at time 0.  steps: one record for each measurement, or none if they were not kept.
    """

    initial: Mixture
    means: Array
    covs: Array
    log_evidences: Array
    counts: Array
    steps: tuple[MixtureStep, ...]


def predict(
    posterior: Mixture, motion: Motion, *, rule: Rule = "ekf", kappa: float = 1.0, noise: Mixture | None = None
) -> Mixture:
    """p(x-) = sum_i w_i N(x-; f(mu_i), F_i P_i F_i' + Q),  F_i = f'(mu_i).

    rule: "ekf" (for linear models the Kalman filter) or "ukf" with kappa.  noise: x- = f(x) + w with w from this
    mixture of d components (not from N(0, Q)); each component splits, and number i d + j is i moved by noise j.
    ValueError for a wrong shape, NaN or an indefinite covariance.  MAT 3.5, exercise 3.11.

    >>> from core.motion import LinearMotion
    >>> p = predict(mixture([0.3, 0.7], [[0.0], [4.0]], np.ones((2, 1, 1))), LinearMotion([[2.0]], [[0.5]]))
    >>> p.means.ravel(), p.covs.ravel()
    (array([0., 8.]), array([4.5, 4.5]))
    """
    posterior = checked("posterior", posterior)
    n = posterior.means.shape[-1]
    check_sizes(n, motion, 0, None)
    check_rule(rule, n, kappa)
    if noise is None:
        g = advance(_law(posterior), motion, rule, kappa)
        return Components(posterior.log_weights, *_spread(g, posterior.log_weights.shape))
    noise = checked("noise", noise)
    if noise.means.ndim != 2 or noise.means.shape[-1] != n:
        raise ValueError(f"noise: expected one mixture of {n} components of the state, got {noise.means.shape}")
    laws = [advance(_law(posterior), _Noisy(motion, b, Q), rule, kappa) for b, Q in zip(*noise[1:], strict=True)]
    parts = [_spread(g, posterior.log_weights.shape) for g in laws]
    *batch, c = posterior.log_weights.shape
    cd = c * len(laws)
    return Components((posterior.log_weights[..., None] + noise.log_weights).reshape(*batch, cd),
                      np.stack([x for x, _ in parts], axis=-2).reshape(*batch, cd, n),
                      np.stack([P for _, P in parts], axis=-3).reshape(*batch, cd, n, n))


def update(
    prior: Mixture, y: Array, sensor: Sensor, *, rule: Rule = "ekf", kappa: float = 1.0, missing: Array | None = None
) -> MixtureUpdate:
    """w_i+ ~ w_i N(nu_i; 0, S_i),  (mu_i, P_i)+ by the Kalman update of component i.

    y (..., m) in the sensor's units.  rule: "ekf" (for linear models the Kalman filter) or "ukf" with kappa.
    missing (m,) or (..., m): entries of y that were not measured.  Weights are carried as logarithms.  ValueError for
    a wrong shape, NaN, an indefinite covariance or a singular innovation covariance.  MAT 3.5; lemma of exercise 3.11
    with the last factor N(y; H mu, S) (erratum M25).
    """
    prior = checked("prior", prior)
    n = prior.means.shape[-1]
    y = np.asarray(y, dtype=np.float64)
    check_sizes(n, None, y.shape[-1] if y.ndim else 0, sensor)
    check_rule(rule, n, kappa)
    if missing is not None:
        missing = np.asarray(missing, dtype=bool)[..., None, :] if np.ndim(missing) > 1 else np.asarray(missing, bool)
    if not np.isfinite(y if missing is None else np.where(missing, 0.0, y[..., None, :])).all():
        raise ValueError("y: expected finite numbers, got NaN or infinity")
    batch = np.broadcast_shapes(y.shape[:-1], prior.log_weights.shape[:-1])
    shape = (*batch, prior.log_weights.shape[-1])
    if batch != prior.log_weights.shape[:-1]:
        prior = Components(np.broadcast_to(prior.log_weights, shape), *_spread(prior[1:], shape))
    if rule == "ekf":
        step = kalman.measure(_law(prior), y[..., None, :], sensor, missing)
    else:
        step = unscented.measure(_law(prior), y[..., None, :], sensor, kappa, "cholesky", missing)
    log_evidences = np.broadcast_to(log_evidence(step.innovation, step.innovation_cov), shape)
    joint = prior.log_weights + log_evidences
    total = log_sum(joint)
    posterior = Components(joint - total[..., None], *_spread(step.posterior, shape))
    return MixtureUpdate(prior, step, log_evidences, total, posterior)


def step(
    posterior: Mixture,
    y: Array,
    motion: Motion,
    sensor: Sensor,
    upkeep: Upkeep = DEFAULT,
    *,
    rule: Rule = "ekf",
    kappa: float = 1.0,
    noise: Mixture | None = None,
    missing: Array | None = None,
) -> MixtureStep:
    """predict; split what is too wide; update; prune; merge.  Arguments as in those functions and `Upkeep`."""
    predicted = predict(posterior, motion, rule=rule, kappa=kappa, noise=noise)
    division = upkeep.divide(predicted)
    updated = update(division.after, y, sensor, rule=rule, kappa=kappa, missing=missing)
    pruned, merged = upkeep.reduce(updated.posterior)
    estimate = combine(updated.posterior.weights, *updated.posterior[1:])
    return MixtureStep(predicted, division, updated, pruned, merged, merged.after, estimate)


def run(
    initial: Gaussian | Mixture,
    ys: Array,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    upkeep: Upkeep = DEFAULT,
    *,
    rule: Rule = "ekf",
    kappa: float = 1.0,
    noise: Mixture | None = None,
    keep_steps: bool = True,
    progress: Callable[[float], object] | None = None,
) -> MixtureRun:
    """`step` for y_1, ..., y_T, starting one step before y_1.

    initial: a Gaussian (n) or a mixture, with or without batch axes; ys (T, ..., m), NaN where nothing was measured;
    motion and sensor: one model, or one per step.  keep_steps=False keeps the estimates only.  progress(fraction) is
    called after each step and may raise to cancel.  MAT 3.5.
    """
    start = checked("initial", initial) if isinstance(initial, Mixture) else one(initial)
    job = plan(moments(start), ys, motion, sensor)
    shape = (*job.batch, start.log_weights.shape[-1])
    start = Components(np.broadcast_to(start.log_weights, shape), *_spread(start[1:], shape))
    posterior, laws, log_evidences, counts, steps = start, [], [], [], []
    for k, epoch in enumerate(job.epochs):
        last = step(posterior, epoch.y, epoch.motion, epoch.sensor, upkeep, rule=rule, kappa=kappa, noise=noise,
                    missing=epoch.missing)
        posterior = last.posterior
        laws.append(last.estimate)
        log_evidences.append(last.update.log_evidence)
        counts.append(posterior.alive.sum(axis=-1))
        if keep_steps:
            steps.append(last)
        if progress:
            progress((k + 1) / len(job.epochs))
    return MixtureRun(start, np.stack([g.mean for g in laws]), np.stack([g.cov for g in laws]),
                      np.stack(log_evidences), np.stack(counts), tuple(steps))


def advance(g: Law, motion: Motion, rule: Rule, kappa: float) -> Gaussian:
    """The prediction of a stack of checked laws by the rule's filter."""
    return kalman.advance(g, motion) if rule == "ekf" else unscented.advance(g, motion, kappa, "cholesky")[0]


class _Noisy(NamedTuple):
    """x = f(x) + b + w,  V(w) = Q:  a motion with one component of a mixture of noises."""

    motion: Motion
    b: Array
    Q: Array

    def f(self, x: Array) -> Array:
        return self.motion.f(x) + self.b

    def jacobian(self, x: Array) -> Array:
        return self.motion.jacobian(x)


def _law(m: Mixture) -> Law:
    """The components as one stack of laws."""
    if m.log_weights.size < _LARGE:
        return Law(m.means, m.covs)
    return Law(batch_last(m.means, 1), batch_last(m.covs, 2))


def _spread(g: tuple[Array, Array], shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Mean and covariance of a stack with all its batch axes spelled out."""
    x, P = g
    return np.broadcast_to(x, (*shape, x.shape[-1])), np.broadcast_to(P, (*shape, *P.shape[-2:]))


def check_rule(rule: str, n: int, kappa: float) -> None:
    """ValueError unless the rule is known, and kappa fits n states if it uses sigma points."""
    if rule not in ("ekf", "ukf"):
        raise ValueError(f"rule: expected 'ekf' or 'ukf', got {rule!r}")
    if rule == "ukf":
        sigma_weights(n, kappa)
