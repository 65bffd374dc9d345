"""Innovation tests: NIS, the gate, and the filter that uses it."""

import numpy as np
import pytest

from core import extended, innovation, kalman, unscented
from core.motion import constant_velocity
from core.sensors import Linear, Position, Range
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
FIX = Position(2, [30.0, 50.0])
START = Gaussian(np.array([0.0, 0.0, 5.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))


def test_c3_10_innovation_and_gate():
    e = entry("C3-10")
    want = e["expected"]
    prior = kalman.predict(Gaussian(np.array(e["inputs"]["x0"]), np.array(e["inputs"]["P0"])), CV)
    good, bad = kalman.update(prior, e["inputs"]["y"], FIX), kalman.update(prior, [150.0, 0.0], FIX)
    np.testing.assert_allclose(good.innovation, want["innovation"], rtol=1e-9)
    np.testing.assert_allclose(good.innovation_cov.diagonal(), want["S"], rtol=1e-9)
    assert innovation.nis(good) == pytest.approx(want["NIS"], rel=1e-9)
    assert innovation.nis(bad) == pytest.approx(want["NIS_outlier"], rel=1e-9)
    accepted, rejected = innovation.gate(good, 0.99), innovation.gate(bad, 0.99)
    assert accepted.accepted and not rejected.accepted
    assert accepted.level == pytest.approx(9.210340, abs=1e-6)
    assert accepted.step is good
    np.testing.assert_array_equal(rejected.step.posterior.mean, prior.mean)
    np.testing.assert_array_equal(rejected.step.posterior.cov, prior.cov)
    assert not rejected.step.gain.any() and (rejected.step.innovation == bad.innovation).all()


def test_nis_counts_only_what_was_measured():
    R = np.array([[4.0, 1.5], [1.5, 9.0]])
    H = np.eye(2, 4)
    ys = [[3.0, 4.0], [3.0, np.nan], [np.nan, np.nan]]
    values = [innovation.nis(kalman.run(START, [y], CV, Linear(H, R)))[0] for y in ys]
    prior = kalman.predict(START, CV)
    one = kalman.update(prior, [3.0], Linear(H[:1], R[:1, :1]))
    assert values[0] > values[1] == pytest.approx(innovation.nis(one))
    assert np.isnan(values[2])
    tested = innovation.gate(kalman.run(START, np.array(ys), CV, Linear(H, R)), 0.95)
    np.testing.assert_allclose(tested.level, [5.991465, 3.841459, 0.0], atol=1e-6)
    assert tested.accepted[2]


@pytest.mark.parametrize("runs", [(3,), (50,)])
def test_batches(runs):
    ys = np.random.default_rng(0).normal(size=(5, *runs, 2)) * 60
    ys[1, 0, 0] = np.nan
    steps = kalman.run(START, ys, CV, FIX)
    values = innovation.nis(steps)
    assert values.shape == (5, *runs)
    for k in range(5):
        one = kalman.run(START, ys[:, 0], CV, FIX)
        assert values[k, 0] == pytest.approx(innovation.nis(one)[k])
    tested = innovation.gate(steps, 0.5)
    np.testing.assert_array_equal(tested.accepted, values <= tested.level)
    inside = tested.accepted[..., None]
    np.testing.assert_array_equal(
        tested.step.posterior.mean, np.where(inside, steps.posterior.mean, steps.prior.mean)
    )


def test_gated_run_ignores_an_outlier_and_is_the_filter_without_it():
    rng = np.random.default_rng(1)
    x, ys = START.mean.copy(), []
    for _ in range(30):
        x = CV.sample(x, rng)
        ys.append(FIX.h(x) + rng.normal(size=2) * [30, 50] * 0.5)
    spoilt = np.array(ys)
    spoilt[12] += [1500.0, -900.0]
    without = spoilt.copy()
    without[12] = np.nan
    run = innovation.run(START, spoilt, CV, FIX, 0.9999)
    assert not run.accepted[12] and run.accepted.sum() == 29
    want = kalman.run(START, without, CV, FIX)
    np.testing.assert_allclose(run.step.posterior.mean, want.posterior.mean, atol=1e-9)
    np.testing.assert_allclose(run.step.posterior.cov, want.posterior.cov, atol=1e-9)
    plain = kalman.run(START, spoilt, CV, FIX)
    assert np.abs(plain.posterior.mean[12] - want.posterior.mean[12]).max() > 100


@pytest.mark.parametrize("runs", [(3,), (50,)])
def test_gated_run_in_batches(runs):
    sensor = Range([[-250.0, 0.0], [250.0, 0.0]], 10.0)
    start = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))
    ys = np.array([118.0, 390.0]) + np.random.default_rng(0).normal(size=(6, *runs, 2)) * 40
    ys[3, 1] = np.nan
    run = innovation.run(start, ys, CV, sensor, 0.8, iterations=2)
    assert 0.1 < run.accepted.mean() < 0.95 and run.step.gain.shape == (6, *runs, 4, 2)
    one = innovation.run(start, ys[:, 1], CV, sensor, 0.8, iterations=2)
    np.testing.assert_array_equal(run.accepted[:, 1], one.accepted)
    np.testing.assert_allclose(run.step.posterior.mean[:, 1], one.step.posterior.mean, rtol=1e-9)


def test_acceptance_rate_of_a_right_model():
    """4000 innovations from the model, 90 % gate: share within 4 standard errors, false alarm 0.006 %."""
    rng = np.random.default_rng(5)
    N = 4000
    x = START.mean + rng.normal(size=(N, 4)) * np.sqrt(START.cov.diagonal())
    y = FIX.h(CV.sample(x, rng)) + rng.normal(size=(N, 2)) * [30, 50]
    share = innovation.gate(kalman.run(START, y[None], CV, FIX), 0.9).accepted.mean()
    assert abs(share - 0.9) < 4 * np.sqrt(0.09 / N)


def test_unscented_records_can_be_tested_too():
    step = unscented.update(START, [20.0, -30.0], FIX, 1.0)
    linear = extended.update(START, [20.0, -30.0], FIX)
    assert innovation.nis(step) == pytest.approx(innovation.nis(linear))
    assert not innovation.gate(step, 0.0).accepted
    np.testing.assert_array_equal(innovation.gate(step, 0.0).step.posterior.mean, START.mean)


@pytest.mark.parametrize("probability", [-0.1, 1.0, 1.5, np.nan])
def test_bad_probability(probability):
    step = kalman.update(START, [20.0, -30.0], FIX)
    with pytest.raises(ValueError):
        innovation.gate(step, probability)
