"""The extended Kalman filter: oracle numbers, iterations, and its well-known failure."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core import extended, kalman
from core.metrics import consistency_band, nees
from core.motion import constant_velocity, constant_velocity_with_clock
from core.sensors import Bearing, Linear, Pseudorange, Range, Stack
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
PAIR = Range([[-250.0, 0.0], [250.0, 0.0]], 10.0)
START = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))


class Turn:
    """A nonlinear motion: x = [east, north, heading], one unit along the heading."""

    Q = np.diag([0.01, 0.02, 0.1])

    def f(self, x):
        step = np.stack([np.sin(x[..., 2]), np.cos(x[..., 2]), np.zeros(x.shape[:-1])], axis=-1)
        return x + step

    def jacobian(self, x):
        F = np.zeros((*x.shape[:-1], 3, 3))
        F[..., range(3), range(3)] = 1.0
        F[..., 0, 2], F[..., 1, 2] = np.cos(x[..., 2]), -np.sin(x[..., 2])
        return F


def test_c3_14_linearised_polar_to_cartesian():
    """The prediction of the extended filter with f(r, theta) = r [cos theta, sin theta] and no noise."""
    e = entry("C3-14")

    class Polar:
        Q = np.zeros((2, 2))

        def f(self, x):
            return x[0] * np.array([np.cos(x[1]), np.sin(x[1])])

        def jacobian(self, x):
            return np.array([[np.cos(x[1]), -x[0] * np.sin(x[1])], [np.sin(x[1]), x[0] * np.cos(x[1])]])

    g = extended.predict(Gaussian(np.array(e["inputs"]["mean"]), np.array(e["inputs"]["P"])), Polar())
    np.testing.assert_allclose(g.mean, e["expected"]["lin_mean"], atol=1e-6)
    np.testing.assert_allclose(g.cov, e["expected"]["lin_cov"], atol=1e-6)


def test_c3_17_first_step_of_example_22():
    e = entry("C3-17")
    i, want = e["inputs"], e["expected"]["ekf"]
    np.testing.assert_allclose(START.mean, i["x0"])
    step = extended.update(extended.predict(START, CV), i["y"], PAIR)
    np.testing.assert_allclose(step.y_hat, e["expected"]["h_pred"], atol=1e-6)
    for got, key in ((step.posterior.mean, "x"), (step.posterior.cov, "P"), (step.gain, "K"),
                     (step.innovation_cov, "S")):
        np.testing.assert_allclose(got, want[key], atol=1e-6)


def test_c3_36_the_filter_that_follows_the_wrong_mode():
    """2000 seeds; the fraction 0.237 has a standard error of 0.0095: 4 of them, false alarm 0.006 %."""
    e = entry("C3-36")
    rng = np.random.default_rng(4)
    T, N = e["inputs"]["n"], 2000
    t = np.arange(1, T + 1)[:, None]
    truth = np.hstack([-150 + 3 * t, -30 + 3 * t, 0 * t + 3, 0 * t + 3]).astype(float)
    ys = PAIR.h(truth)[:, None] + rng.normal(size=(T, N, 2)) * e["inputs"]["noise_sd"]
    steps = extended.run(START, ys, CV, PAIR)
    wrong = (steps.posterior.mean[-1, :, 1] < 0).mean()
    assert abs(wrong - e["expected"]["ekf_wrong_fraction"]) < 0.038
    assert np.sqrt(steps.posterior.cov[-1, :, 1, 1]).mean() == pytest.approx(11.4, abs=0.5)


@given(st.integers(0, 10_000), st.integers(2, 6))
def test_a_linear_sensor_does_not_see_the_iterations(seed, iterations):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4))
    prior = Gaussian(rng.normal(size=4), A @ A.T + np.eye(4))
    sensor, y = Linear(rng.normal(size=(2, 4)), np.eye(2)), rng.normal(size=2)
    one, many = (extended.update(prior, y, sensor, iterations=k) for k in (1, iterations))
    np.testing.assert_allclose(many.posterior.mean, one.posterior.mean, atol=1e-9)
    np.testing.assert_allclose(many.posterior.cov, one.posterior.cov, atol=1e-12)
    np.testing.assert_allclose(many.innovation, one.innovation, atol=1e-9)


def test_one_iteration_is_the_plain_extended_update():
    y = [118.0, 390.0]
    a, b = extended.update(START, y, PAIR), kalman.update(START, y, PAIR)
    np.testing.assert_array_equal(a.posterior.mean, b.posterior.mean)
    np.testing.assert_array_equal(a.posterior.cov, b.posterior.cov)


def test_iterations_end_at_the_posterior_mode():
    """The measurement is counted once: at the limit the gradient of prior plus misfit vanishes."""
    prior = Gaussian(np.array([30.0, 4.0]), np.diag([100.0, 400.0]))
    sensor, y = Stack([Range([[0.0, 0.0]], 1.0), Bearing([[0.0, 0.0]], 0.05)]), np.array([35.0, 0.9])
    records = extended.iterate(prior, y, sensor, 30)
    assert len(records) == 30
    x = records[-1].posterior.mean
    np.testing.assert_allclose(x, records[-2].posterior.mean, atol=1e-10)
    H, r = sensor.jacobian(x), sensor.innovation(y, sensor.h(x))
    gradient = H.T @ np.linalg.solve(sensor.R, r) - np.linalg.solve(prior.cov, x - prior.mean)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-8)
    information = np.linalg.inv(prior.cov) + H.T @ np.linalg.solve(sensor.R, H)
    np.testing.assert_allclose(records[-1].posterior.cov, np.linalg.inv(information), rtol=1e-8)
    assert np.linalg.norm(records[0].posterior.mean - x) > 0.1                  # one step is not enough here


def test_every_record_says_x_plus_k_nu():
    for step in extended.iterate(START, [118.0, 390.0], PAIR, 4):
        np.testing.assert_allclose(step.posterior.mean, step.prior.mean + step.gain @ step.innovation, rtol=1e-12)
        np.testing.assert_allclose(step.y_hat + step.innovation, [118.0, 390.0], rtol=1e-12)
        np.testing.assert_array_equal(step.prior.mean, START.mean)


def test_bearings_across_south_pull_the_short_way():
    prior = Gaussian(np.array([0.5, -10.0]), np.eye(2))
    step = extended.update(prior, [np.radians(-178.0)], Bearing([[0.0, 0.0]], 0.05), iterations=3)
    assert abs(np.degrees(step.innovation[0])) < 10
    assert -0.5 < step.posterior.mean[0] < 0.5 and abs(step.posterior.mean[1] + 10) < 0.5


@pytest.mark.parametrize("runs", [(3,), (45,)])
@pytest.mark.parametrize("iterations", [1, 3])
def test_batch_equals_loop(runs, iterations):
    rng = np.random.default_rng(0)
    g = Gaussian(START.mean + rng.normal(size=(*runs, 4)) * 10, np.broadcast_to(START.cov, (*runs, 4, 4)))
    ys = np.array([118.0, 390.0]) + rng.normal(size=(4, *runs, 2)) * 10
    ys[1, 0, 1] = np.nan
    ys[2] = np.nan
    steps = extended.run(g, ys, CV, PAIR, iterations)
    for i in range(3):
        one = extended.run(Gaussian(g.mean[i], g.cov[i]), ys[:, i], CV, PAIR, iterations)
        np.testing.assert_allclose(steps.posterior.mean[:, i], one.posterior.mean, rtol=1e-10)
        np.testing.assert_allclose(steps.posterior.cov[:, i], one.posterior.cov, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(steps.innovation[:, i], one.innovation, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("runs", [(), (3,), (45,)])
def test_nonlinear_motion_written_without_any_help(runs):
    model = Turn()
    x = np.random.default_rng(0).normal(size=(*runs, 3))
    P = np.diag([0.2, 0.3, 0.05]) + 0.01
    g = extended.predict(Gaussian(x, np.broadcast_to(P, (*runs, 3, 3))), model)
    F = model.jacobian(x)
    np.testing.assert_allclose(g.mean, model.f(x), rtol=1e-13)
    np.testing.assert_allclose(g.cov, F @ P @ F.mT + model.Q, rtol=1e-12, atol=1e-15)


def test_pseudoranges_with_a_clock_in_the_state():
    """200 receivers, 20 epochs, satellites far enough to be nearly linear: final NEES in its 99.9 % band."""
    rng = np.random.default_rng(6)
    directions = np.array([[0, 0, 1], [1, 0, 0.5], [-0.5, 0.9, 0.4], [-0.5, -0.9, 0.6], [0.3, -0.4, 0.9]])
    satellites = 2.2e7 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    model, sensor = constant_velocity_with_clock(1.0, [1.0, 1.0, 0.2], 3, 0.5, 0.2), Pseudorange(satellites, 3.0)
    start = Gaussian(np.zeros(8), np.diag([50.0**2] * 3 + [100.0**2] + [5.0**2] * 3 + [2.0**2]))
    x = rng.normal(size=(200, 8)) * np.sqrt(start.cov.diagonal())
    ys = np.empty((20, 200, 5))
    for k in range(20):
        x = model.sample(x, rng)
        ys[k] = sensor.h(x) + 3.0 * rng.normal(size=(200, 5))
    steps = extended.run(start, ys, model, sensor)
    g = Gaussian(steps.posterior.mean[-1], steps.posterior.cov[-1])
    low, high = consistency_band(0.999, 8, 200)
    assert low < nees(g, x).mean() < high
    assert np.sqrt(g.cov[:, 3, 3]).max() < 10


def test_iterations_must_be_counted():
    for bad in (0, -1, 1.5):
        with pytest.raises(ValueError, match="iterations: expected a whole number"):
            extended.update(START, [118.0, 390.0], PAIR, iterations=bad)
        with pytest.raises(ValueError, match="iterations: expected a whole number"):
            extended.run(START, [[118.0, 390.0]], CV, PAIR, iterations=bad)


def test_models_that_return_nan_are_refused():
    class Broken(Turn):
        def f(self, x):
            return x * np.nan

    class BrokenSensor:
        R = np.eye(1)

        def h(self, x):
            return x[..., :1] * np.nan

        def jacobian(self, x):
            return np.ones((*x.shape[:-1], 1, 3))

        def innovation(self, y, y_hat):
            return y - y_hat

    g = Gaussian(np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match="motion: expected a finite"):
        extended.predict(g, Broken())
    with pytest.raises(ValueError, match="sensor: expected a finite"):
        extended.update(g, [1.0], BrokenSensor())
