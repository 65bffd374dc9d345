"""Turning and standing models: the stochastic differential equation, series switches, Jacobians."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import turn
from core.motion import constant_velocity, discretise
from core.turn import CoordinatedTurn, known_turn, standing

pytestmark = pytest.mark.filterwarnings("error")

STATE = np.array([100.0, -50.0, 12.0, -5.0])


@pytest.mark.parametrize("rate", [-1.3, -0.3, -0.01, 0.0, 1e-9, 0.05, 0.2, 3.0])
@pytest.mark.parametrize("dt", [0.1, 1.0, 2.5])
def test_known_turn_solves_its_differential_equation(rate, dt):
    F = np.zeros((4, 4))
    F[:2, 2:] = np.eye(2)
    F[2:, 2:] = rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    expected = discretise(F, np.eye(4)[:, 2:], 0.7**2 * np.eye(2), dt)
    got = known_turn(dt, 0.7, rate)
    np.testing.assert_allclose(got.Phi, expected.Phi, atol=1e-12)
    np.testing.assert_allclose(got.Q, expected.Q, atol=1e-12)


def test_no_turn_is_constant_velocity():
    cv = constant_velocity(0.5, 1.2, 2)
    np.testing.assert_allclose(known_turn(0.5, 1.2, 0.0).Phi, cv.Phi, atol=1e-15)
    np.testing.assert_allclose(known_turn(0.5, 1.2, 0.0).Q, cv.Q, atol=1e-15)


def test_a_full_circle_comes_back():
    """36 steps of 10 degrees to the left: the same state, and half-way on the left at the diameter 2 v / omega."""
    model, x = known_turn(1.0, 0.0, np.radians(10)), np.array([0.0, 0.0, 10.0, 0.0])
    for k in range(36):
        x = model.f(x)
        if k == 17:
            np.testing.assert_allclose(x, [0, 20 / np.radians(10), -10, 0], atol=1e-9)
    np.testing.assert_allclose(x, [0, 0, 10, 0], atol=1e-9)


@pytest.mark.parametrize("a", [1e-12, 1e-3, 0.0999999, 0.1000001, 1.0, 3.0, -0.05, -2.0])
def test_series_on_both_sides_of_their_switch(a):
    from math import factorial

    gap = sum((-1) ** k * a ** (2 * k) / factorial(2 * k + 3) for k in range(15))
    slope = sum((-1) ** k * 2 * k * a ** (2 * k - 1) / factorial(2 * k + 1) for k in range(1, 15))
    assert float(turn._sine_gap(a)) == pytest.approx(gap, rel=3e-13)
    assert float(turn._sine_ratio_slope(a)) == pytest.approx(slope, rel=3e-12)


@given(st.floats(-2, 2), st.floats(0.1, 2.0))
@settings(max_examples=60, deadline=None)
def test_jacobian_is_the_derivative(rate, dt):
    model, x = CoordinatedTurn(dt, 1.0, 0.1), np.append(STATE, rate)
    steps = 1e-5 * np.eye(5)
    numeric = (model.f(x + steps) - model.f(x - steps)).T / 2e-5
    np.testing.assert_allclose(model.jacobian(x), numeric, atol=2e-6)
    np.testing.assert_allclose(model.f(x)[:4], known_turn(dt, 1.0, rate).f(STATE), atol=1e-9)
    np.testing.assert_allclose(model.jacobian(x)[:4, :4], known_turn(dt, 1.0, rate).Phi, atol=1e-12)


def test_batch_equals_loop():
    model, x = CoordinatedTurn(1.0, 1.0, 0.1), np.random.default_rng(0).normal(size=(2, 3, 5))
    assert model.f(x).shape == (2, 3, 5) and model.jacobian(x).shape == (2, 3, 5, 5)
    for k in np.ndindex(2, 3):
        np.testing.assert_allclose(model.f(x)[k], model.f(x[k]), atol=1e-14)
        np.testing.assert_allclose(model.jacobian(x)[k], model.jacobian(x[k]), atol=1e-14)


def test_samples_have_the_covariance_q():
    """200,000 draws: entries of the sample covariance within 6 deviations of Q (false alarms below 1e-7)."""
    model, rng = CoordinatedTurn(1.0, 1.0, 0.1), np.random.default_rng(1)
    x = np.append(STATE, 0.2)
    d = model.sample(np.broadcast_to(x, (200_000, 5)), rng) - model.f(x)
    scale = np.sqrt(np.outer(model.Q.diagonal(), model.Q.diagonal()))
    assert (np.abs(d.T @ d / len(d) - model.Q) < 6 * scale * np.sqrt(2 / len(d))).all()
    assert model.Q[4, 4] == pytest.approx(0.01)


def test_standing_forgets_the_velocity():
    model = standing(2.0, 0.5, 3.0)
    np.testing.assert_array_equal(model.f(STATE), [100, -50, 0, 0])
    np.testing.assert_allclose(model.Q, np.diag([0.5, 0.5, 9.0, 9.0]))


def test_inputs_stay_as_they_are():
    x = np.append(STATE, 0.2)
    x.setflags(write=False)
    model = CoordinatedTurn(1.0, 1.0, 0.1)
    model.f(x), model.jacobian(x), model.sample(x, np.random.default_rng(0))
    with pytest.raises(ValueError, match="read-only"):
        model.Q[0, 0] = 1.0


@pytest.mark.parametrize(("call", "words"), [
    (lambda: known_turn(0.0, 1.0, 0.1), "dt_s"),
    (lambda: known_turn(1.0, -1.0, 0.1), "sigma"),
    (lambda: known_turn(1.0, 1.0, np.inf), "rate_rad_s"),
    (lambda: standing(1.0, 1.0, -1.0), "velocity_sigma_mps"),
    (lambda: CoordinatedTurn(1.0, 1.0, -0.1), "turn_sigma"),
    (lambda: CoordinatedTurn(-1.0, 1.0, 0.1), "dt_s"),
    (lambda: CoordinatedTurn(1.0, 1.0, 0.1).f(STATE), r"\(..., 5\)"),
    (lambda: CoordinatedTurn(1.0, 1.0, 0.1).jacobian(np.full(5, np.nan)), "finite"),
])  # fmt: skip
def test_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call()
