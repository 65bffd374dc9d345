"""The filter that learns its measurement noise."""

import numpy as np
import pytest

from core import adaptive, extended, kalman
from core.motion import constant_velocity
from core.sensors import Position, Range
from core.types import Gaussian

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
START = Gaussian(np.zeros(4), np.diag([100.0, 100.0, 9.0, 9.0]))


def track(T, sd, seed, runs=()):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(*runs, 4)) * np.sqrt(START.cov.diagonal())
    truth, ys = np.empty((T, *runs, 4)), np.empty((T, *runs, 2))
    for k in range(T):
        x = CV.sample(x, rng)
        truth[k] = x
        ys[k] = x[..., :2] + rng.normal(size=(*runs, 2)) * sd
    return truth, ys


@pytest.mark.parametrize("assumed", [2.0, 50.0])
def test_finds_the_noise_from_either_side(assumed):
    """40 tracks, the last R averaged: its standard deviation over seeds is 3 % and 2 %; 15 % is 5 of them."""
    _, ys = track(400, [10.0, 20.0], 1, (40,))
    R = adaptive.run(START, ys, CV, Position(2, assumed), memory=0.98).R[-1].mean(axis=0)
    np.testing.assert_allclose(R.diagonal(), [100.0, 400.0], rtol=0.15)
    assert abs(R[0, 1]) < 0.15 * 200


def test_better_than_the_filter_with_the_wrong_noise():
    truth, ys = track(300, 20.0, 2, (20,))
    sensor = Position(2, 2.0)
    errors = [np.square(s.posterior.mean - truth)[100:, ..., :2].mean()
              for s in (adaptive.run(START, ys, CV, sensor).step, kalman.run(START, ys, CV, sensor))]
    assert errors[0] < 0.8 * errors[1]


def test_full_memory_is_the_plain_filter():
    _, ys = track(20, 10.0, 0)
    ys[4, 0] = np.nan
    sensor = Position(2, 10.0)
    a, b = adaptive.run(START, ys, CV, sensor, memory=1.0), extended.run(START, ys, CV, sensor)
    np.testing.assert_allclose(a.step.posterior.mean, b.posterior.mean, atol=1e-9)
    np.testing.assert_allclose(a.R, np.broadcast_to(sensor.R, (20, 2, 2)))


def test_noise_stays_positive_definite_and_missing_rows_teach_nothing():
    _, ys = track(60, 10.0, 0)
    ys[10] = np.nan
    ys[20, 1] = np.nan
    run = adaptive.run(START, ys, CV, Position(2, 10.0), memory=0.5)
    assert np.linalg.eigvalsh(run.R).min() > 0
    np.testing.assert_array_equal(run.R, run.R.mT)
    np.testing.assert_array_equal(run.R[10], run.R[9])
    np.testing.assert_array_equal(run.R[20], run.R[19])


@pytest.mark.parametrize("runs", [(3,), (40,)])
def test_batch_equals_loop(runs):
    sensor = Range([[-250.0, 0.0], [250.0, 0.0]], 5.0)
    ys = np.array([250.0, 255.0]) + np.random.default_rng(0).normal(size=(6, *runs, 2)) * 10
    ys[2, 1] = np.nan
    start = Gaussian(np.array([3.0, 60.0, 0.0, 0.0]), START.cov)
    run, one = adaptive.run(start, ys, CV, sensor, 0.8), adaptive.run(start, ys[:, 1], CV, sensor, 0.8)
    assert run.R.shape == (6, *runs, 2, 2)
    np.testing.assert_allclose(run.R[:, 1], one.R, rtol=1e-9)
    np.testing.assert_allclose(run.step.posterior.mean[:, 1], one.step.posterior.mean, rtol=1e-9)


@pytest.mark.parametrize("memory", [-0.1, 1.1, np.nan])
def test_bad_memory(memory):
    with pytest.raises(ValueError, match="memory: expected a number from 0 to 1"):
        adaptive.run(START, np.zeros((3, 2)), CV, Position(2, 1.0), memory=memory)
