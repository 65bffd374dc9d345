"""Interacting multiple models: one filter for each way of moving, and the probability of each.  MAT 3.1.

All models have the same state.  The bank is a `core.mixture.Mixture` with one component for each model.
Blom and Bar-Shalom 1988.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from core import checks
from core.mixture import MixtureUpdate, Rule, advance, check_rule, update
from core.mixture_law import Components, Mixture, checked, combine, log_sum
from core.recursion import check_sizes, plan
from core.stacks import Law, batch_last, empty_stack, law
from core.types import Array, Gaussian, Motion, Sensor

_LARGE = 32                                               # stacks of this size are faster batch last


class ImmStep(NamedTuple):
    """One step of r models, with everything on the way.  From `run`: with a leading time axis.

    before: the bank after the last measurement.  mixing (..., r, r): [i, j] is the probability that model i ruled
    before, given that j rules now.  mixed: where filter j starts, with the predicted probability of j.  update: the
    models' predictions (update.prior), Kalman updates, evidences and posteriors.  posterior: the bank after the
    measurement, update.posterior.  estimate: its mean (..., n) and covariance (..., n, n).
    """

    before: Mixture
    mixing: Array
    mixed: Mixture
    update: MixtureUpdate
    posterior: Mixture
    estimate: Gaussian

    @property
    def probabilities(self) -> Array:
        """P(model j | y_1, ..., y_k), shape (..., r)."""
        return self.posterior.weights


def bank(initial: Gaussian, probabilities: Array) -> Mixture:
    """r filters that start from the same law, with the probabilities (r,) or (..., r) of their models.

    >>> bank(Gaussian(np.zeros(1), np.eye(1)), [0.25, 0.75]).weights
    array([0.25, 0.75])
    """
    x, P = law("initial", initial)
    p = checks.finite("probabilities", probabilities, None)
    if (p < 0).any() or (np.abs(p.sum(axis=-1) - 1.0) > 1e-9).any():
        raise ValueError(f"probabilities: expected numbers >= 0 with sum 1, got {p}")
    batch = np.broadcast_shapes(x.shape[:-1], P.shape[:-2], p.shape[:-1])
    shape, n = (*batch, p.shape[-1]), x.shape[-1]
    with np.errstate(divide="ignore"):
        return Components(np.log(np.broadcast_to(p, shape)), np.broadcast_to(x[..., None, :], (*shape, n)),
                          np.broadcast_to(P[..., None, :, :], (*shape, n, n)))


def mix(before: Mixture, transition: Array) -> tuple[Array, Mixture]:
    """c_j = sum_i mu_i Pi_ij,  mu_{i|j} = mu_i Pi_ij / c_j;  filter j starts from the moments of sum_i mu_{i|j} N_i.

    before: r models; transition (r, r), Pi_ij = P(j now | i before), rows with sum 1 -> mixing (..., r, r) and the
    mixed bank.  A model that cannot rule now (c_j = 0) starts from the moments of the whole bank.
    """
    before = checked("before", before)
    r, n = before.means.shape[-2:]
    log_joint = before.log_weights[..., :, None] + _log_transition(transition, r)
    log_c = log_sum(log_joint, axis=-2)
    possible = log_c > -np.inf
    given = np.exp(log_joint - np.where(possible, log_c, 0.0)[..., None, :])
    mixing = np.where(possible[..., None, :], given, before.weights[..., :, None])
    x, P = empty_stack(before.means.shape[:-1], n), empty_stack(before.means.shape[:-1], n, n)
    for j in range(r):
        x[..., j, :], P[..., j, :, :] = combine(mixing[..., j], before.means, before.covs)
    return mixing, Components(log_c - log_sum(log_c)[..., None], x, P)


def step(
    before: Mixture,
    y: Array,
    motions: Sequence[Motion],
    transition: Array,
    sensor: Sensor,
    *,
    rule: Rule = "ekf",
    kappa: float = 1.0,
    missing: Array | None = None,
) -> ImmStep:
    """mix;  predict each filter by its own model;  update each;  mu_j ~ c_j N(nu_j; 0, S_j).

    before: the bank (..., r) of r filters (see `bank`); y (..., m); motions: r models of the same state; transition
    (r, r), rows with sum 1; rule "ekf" (for linear models the Kalman filter) or "ukf" with kappa; missing (m,) or
    (..., m): entries of y that were not measured.  Probabilities are carried as logarithms.  ValueError for a wrong
    shape, NaN, an indefinite covariance or probabilities that do not sum to 1.
    """
    before = checked("before", before)
    *batch, r, n = before.means.shape
    if len(motions) != r:
        raise ValueError(f"motions: expected {r} models, one for each component of the bank, got {len(motions)}")
    check_rule(rule, n, kappa)
    mixing, mixed = mix(before, transition)
    x, P = empty_stack((*batch, r), n), empty_stack((*batch, r), n, n)
    for j, motion in enumerate(motions):
        check_sizes(n, motion, 0, None)
        start = Law(mixed.means[..., j, :], mixed.covs[..., j, :, :])
        if before.log_weights.size >= _LARGE:
            start = Law(batch_last(start.mean, 1), batch_last(start.cov, 2)) if batch else start
        x[..., j, :], P[..., j, :, :] = advance(start, motion, rule, kappa)
    updated = update(Components(mixed.log_weights, x, P), y, sensor, rule=rule, kappa=kappa, missing=missing)
    posterior = updated.posterior
    return ImmStep(before, mixing, mixed, updated, posterior, combine(posterior.weights, *posterior[1:]))


def run(
    initial: Gaussian | Mixture,
    ys: Array,
    motions: Sequence[Motion],
    transition: Array,
    sensor: Sensor | Sequence[Sensor],
    *,
    probabilities: Array | None = None,
    rule: Rule = "ekf",
    kappa: float = 1.0,
    progress: Callable[[float], object] | None = None,
) -> ImmStep:
    """`step` for y_1, ..., y_T, starting one step before y_1.

    initial: a Gaussian, with the probabilities (r,) of the models at time 0 (None: all equal), or a bank; with or
    without batch axes.  ys (T, ..., m), NaN where nothing was measured; sensor: one, or one per step.  All arrays of
    the result are (T, ..., .).  progress(fraction) is called after each step and may raise to cancel.
    """
    r = len(motions)
    if isinstance(initial, Mixture):
        start = checked("initial", initial)
    else:
        start = bank(initial, np.full(r, 1.0 / r) if probabilities is None else probabilities)
    ys = np.asarray(ys, dtype=np.float64)
    job = plan(combine(start.weights, *start[1:]), ys, motions[0], sensor)
    shape, n = (*job.batch, start.log_weights.shape[-1]), start.means.shape[-1]
    last = Components(np.broadcast_to(start.log_weights, shape), np.broadcast_to(start.means, (*shape, n)),
                      np.broadcast_to(start.covs, (*shape, n, n)))
    steps = []
    for k, epoch in enumerate(job.epochs):
        steps.append(step(last, epoch.y, motions, transition, epoch.sensor, rule=rule, kappa=kappa,
                          missing=epoch.missing))
        last = steps[-1].posterior
        if progress:
            progress((k + 1) / len(job.epochs))
    return _stack(steps)


def sojourn_transition(mean_steps: Array) -> Array:
    """Pi_jj = 1 - 1 / tau_j,  the rest of the row shared equally: model j rules for tau_j steps on average.

    mean_steps (r,) > 1, in steps of the filter -> (r, r).  With one model: [[1]].

    >>> sojourn_transition([20.0, 10.0])
    array([[0.95, 0.05],
           [0.1 , 0.9 ]])
    """
    tau = checks.finite("mean_steps", mean_steps, None)
    if tau.ndim != 1 or (tau <= 1).any():
        raise ValueError(f"mean_steps: expected numbers above 1, got {tau}")
    r = len(tau)
    if r == 1:
        return np.ones((1, 1))
    Pi = np.repeat((1 / tau / (r - 1))[:, None], r, axis=1)
    np.fill_diagonal(Pi, 1 - 1 / tau)
    return Pi


def _log_transition(transition: Array, r: int) -> Array:
    Pi = checks.finite("transition", transition, r, r)
    if Pi.ndim != 2 or (Pi < 0).any() or (np.abs(Pi.sum(axis=1) - 1.0) > 1e-9).any():
        raise ValueError(f"transition: expected a matrix ({r}, {r}) of numbers >= 0 with row sums 1, got {Pi.tolist()}")
    with np.errstate(divide="ignore"):
        return np.log(Pi)


def _stack(records: Sequence[Any]) -> Any:
    """One record of T records: every array with a leading time axis."""
    if not isinstance(records[0], tuple):
        return np.stack(records)
    return type(records[0])(*(_stack(parts) for parts in zip(*records, strict=True)))
