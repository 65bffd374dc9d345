"""The unscented Kalman filter: predict, update, run.  MAT 3.3.2, Algorithm 4.  Its points are made in `core.sigma`."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core.kalman import without
from core.recursion import Recorder, check_sizes, plan
from core.sigma import (
    Root,
    SigmaPoints,
    Transform,
    images_of,
    is_definite,
    root_of,
    safe,
    sigma_points,
    sigma_weights,
    split,
    transform,
)
from core.stacks import Law, apply, is_finite, law, solve_spd, symmetric, times, vector
from core.types import Array, Gaussian, Motion, Sensor

__all__ = ["SigmaPoints", "Transform", "UnscentedUpdate", "predict", "run", "sigma_points", "transform", "update"]


class UnscentedUpdate(NamedTuple):
    """One measurement update, with everything on the way.

    prior; points (..., 2n + 1, n), images h(points) (..., 2n + 1, m), weights (2n + 1,); y_hat (..., m);
    cross P_xy (..., n, m); innovation y - y_hat (..., m); innovation_cov P_yy (..., m, m); gain P_xy P_yy^-1
    (..., n, m); posterior; definite (...) as in `Transform`.  From `run`: with a leading time axis.
    """

    prior: Gaussian
    points: Array
    images: Array
    weights: Array
    y_hat: Array
    cross: Array
    innovation: Array
    innovation_cov: Array
    gain: Array
    posterior: Gaussian
    definite: Array


def predict(posterior: Gaussian, motion: Motion, kappa: float, root: Root = "cholesky") -> Gaussian:
    """x- = sum w_i f(chi_i),  P- = sum w_i (f(chi_i) - x-)(f(chi_i) - x-)' + Q.

    posterior: mean (..., n), cov (n, n) or (..., n, n).  `transform(motion.f, posterior, kappa)` shows the points.
    ValueError as in `sigma_points`.  MAT 3.3.2.
    """
    posterior = law("posterior", posterior)
    check_sizes(posterior.mean.shape[-1], motion, 0, None)
    sigma_weights(posterior.mean.shape[-1], kappa)
    return advance(posterior, motion, kappa, root)[0]


def update(
    prior: Gaussian,
    y: Array,
    sensor: Sensor,
    kappa: float,
    *,
    points: Array | None = None,
    root: Root = "cholesky",
) -> UnscentedUpdate:
    """x+ = x- + K (y - y_hat),  P+ = P- - K P_yy K',  K = P_xy P_yy^-1.

    prior: mean (..., n), cov (n, n) or (..., n, n); y (..., m).  Sigma points are drawn from the prior; `points`
    (..., 2n + 1, n) reuses the images of the prediction instead, as MAT prints it.  Those lack Q, so that the filter
    is not the Kalman filter for linear models (erratum M16).  ValueError for a wrong shape, NaN, an indefinite
    covariance or kappa <= -n.  MAT (3.15), 3.3.2.
    """
    prior = law("prior", prior)
    y = vector("y", y, len(sensor.R))
    sigma_weights(prior.mean.shape[-1], kappa)
    if points is not None:
        n = prior.mean.shape[-1]
        points = np.asarray(points, dtype=np.float64)
        if points.shape[-2:] != (2 * n + 1, n) or not is_finite(points):
            raise ValueError(f"points: expected finite numbers of shape (..., {2 * n + 1}, {n}), got {points.shape}")
        return _reuse(prior, y, sensor, kappa, points, None)
    return measure(prior, y, sensor, kappa, root, None)


def run(
    initial: Gaussian,
    ys: Array,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    kappa: float,
    *,
    redraw: bool = True,
    root: Root = "cholesky",
) -> UnscentedUpdate:
    """predict and update for y_1, ..., y_T, starting one step before y_1.

    As `core.kalman.run`: ys (T, ..., m), NaN where nothing was measured; every array of the result is (T, ..., .).
    redraw=False reuses the predicted points in the update (erratum M16: not the Kalman filter for linear models).
    MAT Algorithm 4, 3.3.2.
    """
    job = plan(initial, ys, motion, sensor)
    sigma_weights(job.initial.mean.shape[-1], kappa)
    posterior, record = job.initial, Recorder(len(job.epochs), job.batch)
    for epoch in job.epochs:
        prior, images = advance(posterior, epoch.motion, kappa, root)
        if redraw:
            step = measure(prior, epoch.y, epoch.sensor, kappa, root, epoch.missing)
        else:
            step = _reuse(prior, epoch.y, epoch.sensor, kappa, images, epoch.missing)
        record.add(step)
        posterior = step.posterior
    return record.result()


def advance(posterior: Gaussian, motion: Motion, kappa: float, root: Root) -> tuple[Gaussian, Array]:
    """`predict` of a law that has been checked, and the images of its sigma points."""
    x, P = posterior
    parts = split(motion.f, x, root_of(P, root), kappa, np.subtract)
    P_prior, _ = safe(symmetric(times(parts.G, parts.G.mT) + parts.M) + motion.Q, parts.b, kappa)
    return Law(parts.mean, P_prior), parts.images


def measure(
    prior: Gaussian, y: Array, sensor: Sensor, kappa: float, root: Root, missing: Array | None
) -> UnscentedUpdate:
    """`update` of a law that has been checked, without the entries of y that are `missing` (m,) or (..., m)."""
    x, P = prior
    parts = split(sensor.h, x, root_of(P, root), kappa, sensor.innovation)
    L, G = parts.L, parts.G
    noise, definite = safe(parts.M + sensor.R, parts.b, kappa)         # what the linear part L, G leaves over
    cross = times(L, G.mT)
    S = symmetric(times(G, G.mT)) + noise
    y_hat = parts.mean
    nu = sensor.innovation(y if missing is None else np.where(missing, y_hat, y), y_hat)
    K = solve_spd(S, cross.mT).mT if missing is None else solve_spd(*without(missing, S, cross.mT)).mT
    A = L - times(K, G)                                   # (I - K H) L for the H that the points see
    P_post = symmetric(times(A, A.mT) + times(times(K, noise), K.mT))       # P - K S K', as a sum of squares
    posterior = Law(x + apply(K, nu), P_post)
    if missing is not None:
        nu = np.where(missing, np.nan, nu)
    weights = sigma_weights(x.shape[-1], kappa)
    return UnscentedUpdate(prior, parts.points, parts.images, weights, y_hat, cross, nu, S, K, posterior, definite)


def _reuse(
    prior: Gaussian, y: Array, sensor: Sensor, kappa: float, points: Array, missing: Array | None
) -> UnscentedUpdate:
    x, P = prior
    weights = sigma_weights(x.shape[-1], kappa)
    images = images_of(sensor.h, points)
    centre = images[..., :1, :]
    y_hat = images[..., 0, :] + weights @ sensor.innovation(images, centre)
    dy = sensor.innovation(images, y_hat[..., None, :])
    dx = points - x[..., None, :]
    cross = times((dx * weights[:, None]).mT, dy)
    S = symmetric(times((dy * weights[:, None]).mT, dy)) + sensor.R
    nu = sensor.innovation(y if missing is None else np.where(missing, y_hat, y), y_hat)
    used, C = (S, cross.mT) if missing is None else without(missing, S, cross.mT)
    K = solve_spd(used, C).mT
    P_post = symmetric(P - times(times(K, used), K.mT))
    definite = is_definite(P_post)
    if not definite.all():
        raise ValueError(f"kappa = {kappa}: expected a positive semidefinite posterior, got an indefinite one; reused "
                         f"points cannot repair it, redraw them or take kappa >= 0")
    posterior = Law(x + apply(K, nu), P_post)
    if missing is not None:
        nu = np.where(missing, np.nan, nu)
    return UnscentedUpdate(prior, points, images, weights, y_hat, cross, nu, S, K, posterior, definite)
