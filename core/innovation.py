"""Tests of the innovation: how surprising is a measurement, and what to do with one that is.  MAT 3.2, exercise 3.1."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core.extended import measure_iterated
from core.gaussian import chi_square_level
from core.kalman import Update, advance, without
from core.recursion import Recorder, plan
from core.stacks import Law, solve_spd
from core.types import Array, Gaussian, Motion, Sensor


class Gated(NamedTuple):
    """An update and its test: nis (...), level (...) that it may reach, accepted (...).

    Where a measurement is not accepted, step.gain is 0 and step.posterior is step.prior.
    """

    step: Update
    nis: Array
    level: Array
    accepted: Array


def nis(step: Update) -> Array:
    """nu' S^-1 nu, shape (...): chi-square with m degrees of freedom if the model is right.

    step: any record with innovation (..., m) and innovation_cov (..., m, m).  Entries NaN (not measured) are left
    out; NaN if nothing was measured.  MAT 3.2.
    """
    nu, S = np.asarray(step.innovation), np.asarray(step.innovation_cov)
    missing = np.isnan(nu)
    column = np.where(missing, 0.0, nu)[..., None]
    if missing.any():
        S, column = without(missing, S, column)
    value = (column * solve_spd(S, column)).sum(axis=(-2, -1))
    return np.where(missing.all(axis=-1), np.nan, value)[()]


def gate(step: Update, probability: float) -> Gated:
    """accepted = (nu' S^-1 nu <= chi2_m(probability)).

    step: the record of a Kalman, extended or unscented update.  A right model's measurement is accepted with this
    probability; m counts the entries that were measured, and a measurement without any is accepted.  The record comes
    back with posterior = prior where it is not.  ValueError for a probability outside [0, 1).  MAT 3.2.
    """
    value = nis(step)
    measured = np.isfinite(step.innovation).sum(axis=-1)
    levels = np.array([0.0, *(chi_square_level(probability, k) for k in range(1, step.innovation.shape[-1] + 1))])
    level = levels[measured]
    accepted = ~(value > level)                           # NaN: nothing to object to
    if not np.all(accepted):
        x = np.where(accepted[..., None], step.posterior.mean, step.prior.mean)
        P = np.where(accepted[..., None, None], step.posterior.cov, step.prior.cov)
        K = np.where(accepted[..., None, None], step.gain, 0.0)
        step = step._replace(gain=K, posterior=Law(x, P))
    return Gated(step, value, level, accepted)


def run(
    initial: Gaussian,
    ys: Array,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    probability: float = 0.99,
    iterations: int = 1,
) -> Gated:
    """The extended (for linear models: the plain) Kalman filter that ignores measurements outside the gate.

    As `core.extended.run`: ys (T, ..., m), NaN where nothing was measured; every array of the result is (T, ..., .).
    probability: of a right model's measurement to pass.  MAT 3.2, robust filter.
    """
    job = plan(initial, ys, motion, sensor)
    posterior, record = job.initial, Recorder(len(job.epochs), job.batch)
    for epoch in job.epochs:
        prior = advance(posterior, epoch.motion)
        tested = gate(measure_iterated(prior, epoch.y, epoch.sensor, iterations, epoch.missing)[-1], probability)
        record.add(tested)
        posterior = tested.step.posterior
    return record.result()
