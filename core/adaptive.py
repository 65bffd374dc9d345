"""A Kalman filter that learns the measurement noise from its own residuals.  MAT 3.2, adaptive filter."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core.kalman import Update, advance, correct, linearise
from core.recursion import Recorder, plan
from core.stacks import congruence, shared, symmetric
from core.types import Array, Gaussian, Motion, Sensor


class AdaptiveUpdate(NamedTuple):
    """An update made with the noise known before it, and R (..., m, m), the noise known after it."""

    step: Update
    R: Array


def run(
    initial: Gaussian,
    ys: Array,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    memory: float = 0.95,
) -> AdaptiveUpdate:
    """R_k = memory R_{k-1} + (1 - memory) (e e' + H P+ H'),  e = y - h(x+).

    The sensor's own R starts the recursion.  V(e) = R - H P+ H' when the filter is right, so the mean of the second
    term is R, and it is positive semidefinite always.  memory in [0, 1]: about 1 / (1 - memory) residuals count; 1 is
    the plain filter.  A step in which an entry is NaN leaves R as it is.  Otherwise as `core.extended.run`; the arrays
    of the result are (T, ..., .).
    """
    if not 0.0 <= memory <= 1.0:
        raise ValueError(f"memory: expected a number from 0 to 1, got {memory}")
    job = plan(initial, ys, motion, sensor)
    posterior, record = job.initial, Recorder(len(job.epochs), job.batch)
    R = job.epochs[0].sensor.R
    for epoch in job.epochs:
        prior = advance(posterior, epoch.motion)
        y_hat, H = linearise(epoch.sensor, prior.mean)
        y = epoch.y if epoch.missing is None else np.where(epoch.missing, y_hat, epoch.y)
        step = correct(prior, y_hat, H, epoch.sensor.innovation(y, y_hat), R, epoch.missing)
        posterior = step.posterior
        e = epoch.sensor.innovation(y, epoch.sensor.h(posterior.mean))
        seen = e[..., :, None] * e[..., None, :] + congruence(shared(H), posterior.cov)
        learnt = symmetric(memory * R + (1 - memory) * seen)
        if epoch.missing is not None:
            learnt = np.where(epoch.missing.any(axis=-1)[..., None, None], R, learnt)
        R = learnt
        record.add(AdaptiveUpdate(step, R))
    return record.result()
