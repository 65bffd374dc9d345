"""The same problems through FilterPy's Kalman, extended and unscented filters and its smoother."""

import numpy as np
import pytest

filterpy = pytest.importorskip("filterpy.kalman")

from core import extended, innovation, kalman, unscented  # noqa: E402
from core.motion import LinearMotion, constant_velocity  # noqa: E402
from core.sensors import Linear, Range  # noqa: E402
from core.smoother import smooth  # noqa: E402
from core.types import Gaussian  # noqa: E402

CV = constant_velocity(1.0, 1.0, 2)
STATIONS = np.array([[-250.0, 0.0], [250.0, 0.0]])
PAIR = Range(STATIONS, 10.0)
START = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))
RANGES = PAIR.h(START.mean + 3 * np.arange(1, 13)[:, None] * [1, 1, 0, 0]) + np.random.default_rng(0).normal(
    size=(12, 2)) * 10


def h(x):
    return np.sqrt(((x[:2] - STATIONS) ** 2).sum(axis=1))


def jacobian(x):
    J = np.zeros((2, 4))
    J[:, :2] = (x[:2] - STATIONS) / h(x)[:, None]
    return J


def set_up(f, sensor, motion, g):
    f.x, f.P, f.Q, f.R = g.mean.copy(), g.cov.copy(), np.array(motion.Q), np.array(sensor.R)
    return f


def random_linear(n, m, seed):
    rng = np.random.default_rng(seed)
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, n)), rng.normal(size=(m, m))
    g = Gaussian(rng.normal(size=n), A @ A.T + np.eye(n))
    return g, LinearMotion(0.5 * rng.normal(size=(n, n)), B @ B.T), Linear(rng.normal(size=(m, n)), C @ C.T + np.eye(m))


@pytest.mark.parametrize(("n", "m"), [(1, 1), (4, 2), (6, 3)])
def test_kalman_filter_and_smoother(n, m):
    g, motion, sensor = random_linear(n, m, n)
    ys = np.random.default_rng(1).normal(size=(10, m))
    f = set_up(filterpy.KalmanFilter(n, m), sensor, motion, g)
    f.F, f.H = np.array(motion.Phi), np.array(sensor.H)
    steps = kalman.run(g, ys, motion, sensor)
    for k, y in enumerate(ys):
        f.predict()
        np.testing.assert_allclose(steps.prior.mean[k], f.x, atol=1e-9)
        np.testing.assert_allclose(steps.prior.cov[k], f.P, atol=1e-9)
        f.update(y)
        for ours, theirs in ((steps.posterior.mean, f.x), (steps.posterior.cov, f.P), (steps.gain, f.K),
                             (steps.innovation, f.y), (steps.innovation_cov, f.S)):
            np.testing.assert_allclose(ours[k], theirs, atol=1e-9)
        assert innovation.nis(steps)[k] == pytest.approx(f.mahalanobis**2, rel=1e-8)
    xs, Ps, _, _ = f.rts_smoother(steps.posterior.mean, steps.posterior.cov)
    smoothed = smooth(steps, motion)
    np.testing.assert_allclose(smoothed.posterior.mean, xs, atol=1e-8)
    np.testing.assert_allclose(smoothed.posterior.cov, Ps, atol=1e-8)


def test_extended_filter():
    f = set_up(filterpy.ExtendedKalmanFilter(4, 2), PAIR, CV, START)
    f.F = np.array(CV.Phi)
    steps = extended.run(START, RANGES, CV, PAIR)
    for k, y in enumerate(RANGES):
        f.predict()
        f.update(y, jacobian, h)
        np.testing.assert_allclose(steps.posterior.mean[k], f.x, atol=1e-8)
        np.testing.assert_allclose(steps.posterior.cov[k], f.P, atol=1e-8)


@pytest.mark.parametrize("kappa", [0.0, 1.0, 3.0])
def test_unscented_filter(kappa):
    """FilterPy draws its points again from the prediction, like our default, and has the same Julier points."""
    points = filterpy.JulierSigmaPoints(4, kappa=kappa)
    f = filterpy.UnscentedKalmanFilter(4, 2, 1.0, h, lambda x, dt: CV.Phi @ x, points)
    set_up(f, PAIR, CV, START)
    np.testing.assert_allclose(points.sigma_points(START.mean, START.cov),
                               unscented.sigma_points(START, kappa).points, atol=1e-10)
    steps = unscented.run(START, RANGES, CV, PAIR, kappa)
    for k, y in enumerate(RANGES):
        f.predict()
        np.testing.assert_allclose(steps.prior.mean[k], f.x, atol=1e-7)
        np.testing.assert_allclose(steps.prior.cov[k], f.P, atol=1e-7)
        f.update(y)
        np.testing.assert_allclose(steps.posterior.mean[k], f.x, atol=1e-7)
        np.testing.assert_allclose(steps.posterior.cov[k], f.P, atol=1e-6)
        np.testing.assert_allclose(steps.innovation_cov[k], f.S, atol=1e-6)
