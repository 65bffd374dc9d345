"""The Kalman filter: predict, update, run.  MAT 3.2, Algorithm 3; KF thesis 2.5, Algorithm 1.

With a nonlinear model the same steps, linearised at the estimate, are the extended filter of MAT 3.3.1;
`core.extended` adds its iterations.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core.motion import LinearMotion
from core.recursion import Recorder, check_sizes, plan
from core.sensors_linear import Linear, Position
from core.stacks import Law, apply, congruence, is_finite, law, shared, solve_spd, symmetric, times, vector
from core.types import Array, Gaussian, Motion, Sensor

_LINEAR = (Linear, Position)                              # H at hand: no need to ask for h and its derivative


class Update(NamedTuple):
    """One measurement update, with everything on the way.

    prior; y_hat = h(x-) (..., m); jacobian H (..., m, n); innovation nu = y - y_hat (..., m); innovation_cov
    S = H P- H' + R (..., m, m); gain K = P- H' S^-1 (..., n, m); posterior.  From `run`: with a leading time axis.
    """

    prior: Gaussian
    y_hat: Array
    jacobian: Array
    innovation: Array
    innovation_cov: Array
    gain: Array
    posterior: Gaussian


def predict(posterior: Gaussian, motion: Motion) -> Gaussian:
    """x- = f(x),  P- = F P F' + Q,  F = f'(x).

    posterior: mean (..., n), cov (n, n) or (..., n, n).  ValueError for a wrong shape, NaN or an indefinite
    covariance.  MAT 3.2; Algorithm 3; KF thesis Algorithm 1 with the indices of erratum K2.
    """
    posterior = law("posterior", posterior)
    check_sizes(posterior.mean.shape[-1], motion, 0, None)
    return advance(posterior, motion)


def update(prior: Gaussian, y: Array, sensor: Sensor) -> Update:
    """x+ = x + K nu,  P+ = (I - K H) P (I - K H)' + K R K'.

    prior: mean (..., n), cov (n, n) or (..., n, n); y (..., m) in the sensor's units.  ValueError for a wrong shape,
    NaN, an indefinite covariance or a singular innovation covariance.  MAT (3.10)-(3.13).

    >>> from core.sensors import Linear, Position
    >>> step = update(Gaussian(np.array([6.0]), np.array([[8.0]])), [14.0], Linear([[2.0]], [[16.0]]))
    >>> step.posterior.mean.round(4), step.posterior.cov.round(4)
    (array([6.6667]), array([[2.6667]]))
    """
    prior = law("prior", prior)
    return measure(prior, vector("y", y, len(sensor.R)), sensor)


def run(
    initial: Gaussian, ys: Array, motion: Motion | Sequence[Motion], sensor: Sensor | Sequence[Sensor]
) -> Update:
    """predict and update for y_1, ..., y_T, starting one step before y_1.

    initial: mean (..., n), cov (n, n) or (..., n, n); ys (T, ..., m).  motion and sensor: one model, or one per step.
    An entry NaN in ys was not measured: its innovation is NaN and its column of the gain 0; if a whole row is NaN the
    posterior is the prior.  All arrays of the result are (T, ..., .); runs that share their covariances share memory.
    MAT Algorithm 3.
    """
    job = plan(initial, ys, motion, sensor)
    posterior, record = job.initial, Recorder(len(job.epochs), job.batch)
    for epoch in job.epochs:
        step = measure(advance(posterior, epoch.motion), epoch.y, epoch.sensor, epoch.missing)
        record.add(step)
        posterior = step.posterior
    return record.result()


def advance(posterior: Gaussian, motion: Motion) -> Gaussian:
    """`predict` of a law that has been checked."""
    x, P = posterior
    if type(motion) is LinearMotion:                      # its checks of x would repeat ours
        return Law(apply(motion.Phi, x), congruence(motion.Phi, P) + motion.Q)
    x_prior, F = motion.f(x), shared(motion.jacobian(x))
    if not is_finite(x_prior):
        raise ValueError("motion: expected a finite next state, got NaN or infinity")
    return Law(x_prior, congruence(F, P) + motion.Q)


def measure(prior: Gaussian, y: Array, sensor: Sensor, missing: Array | None = None) -> Update:
    """`update` of a law that has been checked, without the entries of y (..., m) that are `missing` (m,) or (..., m).
    """
    y_hat, H = linearise(sensor, prior.mean)
    if missing is not None:
        y = np.where(missing, y_hat, y)
    nu = y - y_hat if type(sensor) in _LINEAR else sensor.innovation(y, y_hat)
    return correct(prior, y_hat, H, nu, sensor.R, missing)


def linearise(sensor: Sensor, x: Array) -> tuple[Array, Array]:
    """h(x) and h'(x) at x (..., n) that has been checked."""
    if type(sensor) in _LINEAR:
        H = sensor.matrix(x.shape[-1])
        return apply(H, x), H if x.ndim == 1 else np.broadcast_to(H, x.shape[:-1] + H.shape)
    y_hat, H = sensor.h(x), sensor.jacobian(x)
    if not is_finite(y_hat) or not is_finite(H):
        raise ValueError("sensor: expected a finite measurement and derivative at the estimate, got NaN or infinity")
    return y_hat, H


def correct(
    prior: Gaussian, y_hat: Array, H: Array, nu: Array, R: Array, missing: Array | None = None
) -> Update:
    """The update for a given innovation nu (..., m) and linearisation H (..., m, n), R (..., m, m)."""
    x, P = prior
    C = shared(H)
    HP = times(C, P)
    S = times(HP, C.mT) + R                               # MAT exercise 3.1
    K = solve_spd(*((S, HP) if missing is None else without(missing, S, HP))).mT       # (3.12)
    dot = np.ndarray.dot if K.ndim == 2 else times
    B = P - dot(K, HP)                                    # (I - K H) P
    # B + (K R - B H') K' is (3.10), (I - K H) P (I - K H)' + K R K' for any K, with two products less.
    P_post = symmetric(B + dot(dot(K, R) - dot(B, C.mT), K.mT))
    posterior = Law(x + apply(K, nu), P_post)             # (3.13)
    if missing is not None:
        nu = np.where(missing, np.nan, nu)
    return Update(prior, y_hat, H, nu, S, K, posterior)


def without(missing: Array, S: Array, HP: Array) -> tuple[Array, Array]:
    """S and H P with the missing entries cut off from everything else, so that their gain is zero."""
    apart = missing[..., :, None] | missing[..., None, :]
    return np.where(apart, S * np.eye(S.shape[-1]), S), np.where(missing[..., :, None], 0.0, HP)
