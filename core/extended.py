"""The extended Kalman filter, iterated or not.  MAT 3.3.1, Algorithm 4."""

from collections.abc import Sequence

import numpy as np

from core.kalman import Update, advance, correct, linearise, predict
from core.recursion import Recorder, plan
from core.stacks import apply, law, vector
from core.types import Array, Gaussian, Motion, Sensor

__all__ = ["Update", "iterate", "predict", "run", "update"]


def update(prior: Gaussian, y: Array, sensor: Sensor, iterations: int = 1) -> Update:
    """x+ = x + K (y - h(x)),  K = P H' (H P H' + R)^-1,  H = h'(x);  P+ in Joseph form.

    prior: mean (..., n), cov (n, n) or (..., n, n); y (..., m).  With `iterations` > 1 the sensor is linearised again
    at the latest estimate, always from the same prior: Gauss-Newton on |y - h(x)|^2 / R + |x - x-|^2 / P-.  The record
    is the last linearisation: y_hat = h(x_i) + H (x- - x_i), so that posterior.mean = x- + K nu.  ValueError as in
    `core.kalman.update`, or for iterations < 1.  MAT 3.3.1.
    """
    return iterate(prior, y, sensor, iterations)[-1]


def iterate(prior: Gaussian, y: Array, sensor: Sensor, iterations: int) -> tuple[Update, ...]:
    """x_{i+1} = x- + K_i (y - h(x_i) - H_i (x- - x_i)),  x_0 = x-: every linearisation, first to last.

    The first record is the extended filter's update, the last that of `update`.
    """
    prior = law("prior", prior)
    return measure_iterated(prior, vector("y", y, len(sensor.R)), sensor, iterations, None)


def run(
    initial: Gaussian,
    ys: Array,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    iterations: int = 1,
) -> Update:
    """predict and update for y_1, ..., y_T, starting one step before y_1.

    As `core.kalman.run`: ys (T, ..., m), NaN where nothing was measured; every array of the result is (T, ..., .).
    MAT Algorithm 4.
    """
    job = plan(initial, ys, motion, sensor)
    posterior, record = job.initial, Recorder(len(job.epochs), job.batch)
    for epoch in job.epochs:
        prior = advance(posterior, epoch.motion)
        step = measure_iterated(prior, epoch.y, epoch.sensor, iterations, epoch.missing)[-1]
        record.add(step)
        posterior = step.posterior
    return record.result()


def measure_iterated(
    prior: Gaussian, y: Array, sensor: Sensor, iterations: int, missing: Array | None
) -> tuple[Update, ...]:
    """`iterate` for a law that has been checked, without the entries of y that are `missing`."""
    if iterations != int(iterations) or iterations < 1:
        raise ValueError(f"iterations: expected a whole number >= 1, got {iterations}")
    x, records = prior.mean, []
    for i in range(int(iterations)):
        y_hat, H = linearise(sensor, x)
        z = y if missing is None else np.where(missing, y_hat, y)
        nu = sensor.innovation(z, y_hat)
        if i:                                             # the prior counts once, the measurement counts once
            shift = apply(H, prior.mean - x)
            y_hat, nu = y_hat + shift, nu - shift if missing is None else np.where(missing, 0.0, nu - shift)
        records.append(correct(prior, y_hat, H, nu, sensor.R, missing))
        x = records[-1].posterior.mean
    return tuple(records)
