"""The smoother is one big least-squares problem, solved backwards."""

import numpy as np
import pytest

from core import extended, kalman
from core.metrics import consistency_band, nees
from core.motion import LinearMotion, constant_velocity
from core.sensors import Position, Range
from core.smoother import smooth
from core.types import Gaussian

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
FIX = Position(2, [30.0, 50.0])
START = Gaussian(np.array([0.0, 0.0, 5.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))
YS = np.random.default_rng(2).normal(size=(7, 2)) * 40


def whole_trajectory(ys, motions):
    """x_0, ..., x_T and their covariances from one weighted least-squares solve."""
    T, n, A, b = len(ys), 4, [], []

    def add(blocks, value, cov):
        W = np.linalg.inv(np.linalg.cholesky(cov))
        row = np.zeros((len(value), (T + 1) * n))
        for k, M in blocks:
            row[:, k * n:(k + 1) * n] = M
        A.append(W @ row)
        b.append(W @ value)

    add([(0, np.eye(n))], START.mean, START.cov)
    for k in range(T):
        add([(k, -motions[k].Phi), (k + 1, np.eye(n))], np.zeros(n), motions[k].Q)
        if not np.isnan(ys[k]).any():
            add([(k + 1, np.eye(2, n))], ys[k], FIX.R)
    A, b = np.vstack(A), np.concatenate(b)
    P = np.linalg.inv(A.T @ A)
    x = (P @ (A.T @ b)).reshape(T + 1, n)
    return x, np.stack([P[k * n:(k + 1) * n, k * n:(k + 1) * n] for k in range(T + 1)])


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("changing", [False, True])
def test_equals_one_big_least_squares(missing, changing):
    ys = YS.copy()
    if missing:
        ys[2:4] = np.nan
    motions = [constant_velocity(0.5 + 0.3 * k, 1.0, 2) for k in range(7)] if changing else [CV] * 7
    steps = kalman.run(START, ys, motions if changing else CV, FIX)
    result = smooth(steps, motions if changing else CV, START)
    x, P = whole_trajectory(ys, motions)
    np.testing.assert_allclose(result.posterior.mean, x, atol=1e-7)
    np.testing.assert_allclose(result.posterior.cov, P, atol=1e-7)
    assert result.gain.shape == (7, 4, 4)
    later = smooth(steps, motions if changing else CV)
    np.testing.assert_array_equal(later.posterior.mean, result.posterior.mean[1:])
    np.testing.assert_array_equal(later.gain, result.gain[1:])


def test_the_last_step_is_the_filter_and_no_step_is_less_certain():
    steps = kalman.run(START, YS, CV, FIX)
    result = smooth(steps, CV)
    np.testing.assert_array_equal(result.posterior.mean[-1], steps.posterior.mean[-1])
    gain = steps.posterior.cov - result.posterior.cov
    assert np.linalg.eigvalsh(gain).min() > -1e-9
    np.testing.assert_array_equal(result.posterior.cov, result.posterior.cov.mT)


@pytest.mark.parametrize("runs", [(3,), (40,)])
def test_batch_equals_loop(runs):
    rng = np.random.default_rng(0)
    sensor = Range([[-250.0, 0.0], [250.0, 0.0]], 10.0)
    mean = np.array([-150.0, -30.0, 3.0, 3.0]) + rng.normal(size=(*runs, 4))
    g = Gaussian(mean, np.broadcast_to(np.diag([400.0, 400.0, 25.0, 25.0]), (*runs, 4, 4)))
    ys = np.array([118.0, 390.0]) + rng.normal(size=(5, *runs, 2)) * 10
    result = smooth(extended.run(g, ys, CV, sensor), CV, g)
    assert result.posterior.mean.shape == (6, *runs, 4)
    for i in (0, runs[0] - 1):
        alone = Gaussian(g.mean[i], g.cov[i])
        one = smooth(extended.run(alone, ys[:, i], CV, sensor), CV, alone)
        np.testing.assert_allclose(result.posterior.mean[:, i], one.posterior.mean, rtol=1e-9)
        np.testing.assert_allclose(result.posterior.cov[:, i], one.posterior.cov, rtol=1e-8, atol=1e-8)


def test_smoothed_errors_are_what_they_claim():
    """NEES of 300 smoothed tracks at three times; each band 99.9 %, false alarm 0.3 %."""
    rng = np.random.default_rng(8)
    N, T = 300, 12
    x = START.mean + rng.normal(size=(N, 4)) * np.sqrt(START.cov.diagonal())
    truth, ys = np.empty((T, N, 4)), np.empty((T, N, 2))
    for k in range(T):
        x = CV.sample(x, rng)
        truth[k] = x
        ys[k] = FIX.h(x) + rng.normal(size=(N, 2)) * [30, 50]
    g = smooth(kalman.run(START, ys, CV, FIX), CV).posterior
    values = nees(g, truth)
    low, high = consistency_band(0.999, 4, N)
    for k in (0, 5, T - 1):
        assert low < values[k].mean() < high


def test_one_step_alone():
    steps = kalman.run(START, YS[:1], CV, FIX)
    assert smooth(steps, CV).posterior.mean.shape == (1, 4) and smooth(steps, CV).gain.shape == (0, 4, 4)


def test_refusals():
    still = LinearMotion(np.eye(4), np.zeros((4, 4)))
    known = Gaussian(START.mean, np.diag([1.0, 0.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="positive definite predicted"):
        smooth(kalman.run(known, YS, still, FIX), still)
    with pytest.raises(ValueError, match="motion: expected"):
        smooth(kalman.run(START, YS, CV, FIX), [CV] * 3)
    with pytest.raises(ValueError, match="motion: expected a model of 4"):
        smooth(kalman.run(START, YS, CV, FIX), constant_velocity(1.0, 1.0, 1))
