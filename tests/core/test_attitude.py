"""Integration of angular rates: exact, Bortz, naive, on a fixed axis and on coning motion."""

import numpy as np
import pytest

from core import attitude as att
from core import rotation as rot
from tests.oracle import entry


def test_oracle_C1_43_coning_solves_bortz():
    e = entry("C1-43")
    alpha, Omega, t, expected = *(e["inputs"][k] for k in ("alpha", "Omega", "t")), e["expected"]
    cone = att.coning(alpha, Omega, t)
    np.testing.assert_allclose(cone.p, expected["p"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(cone.w, expected["w"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(cone.p_rate, expected["pdot"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(rot.rotation_vector_rate(cone.p, cone.w), expected["pdot"], rtol=0, atol=1e-10)


def test_oracle_C1_43_naive_integration_drifts_and_bortz_closes_at_fourth_order():
    e = entry("C1-43")
    alpha, Omega = e["inputs"]["alpha"], e["inputs"]["Omega"]
    start = att.coning(alpha, Omega, 0.0).p
    errors = []
    for steps in (50, 100):
        run = att.integrate_bortz(start, lambda t: att.coning(alpha, Omega, t).w, 1.0 / steps, steps)
        np.testing.assert_allclose(run.naive[-1], e["expected"]["naive_drift_per_turn"], rtol=0, atol=1e-10)
        truth = att.coning(alpha, Omega, run.t_s).p
        assert run.p.shape == truth.shape == (steps + 1, 3)
        errors.append(np.abs(run.p[-1] - start).max())
        assert np.linalg.norm(run.p - truth, axis=-1).max() < 1e-6
        assert not run.switched.any()
    assert errors[0] < 1e-7 and 12 < errors[0] / errors[1] < 20


def test_bortz_crosses_pi_on_the_shadow_vector():
    def w(t):
        return np.array([0.4 * np.cos(t), -0.3, 1.5 + 0.2 * np.sin(2 * t)])

    run = att.integrate_bortz(np.zeros(3), w, 0.01, 600)
    fine = np.arange(0.0005, 6.0, 0.001)
    exact = att.integrate_rates(np.eye(3), np.array([w(t) for t in fine]), 0.001)[-1]
    assert run.switched.sum() >= 1
    assert rot.rotation_angle(run.p).max() <= np.pi + 1e-15
    # the reference holds w for a millisecond: its own error is of the order 1e-7
    np.testing.assert_allclose(rot.dcm_from_rotation_vector(run.p[-1]), exact, rtol=0, atol=1e-6)


def test_bortz_accepts_batches():
    starts = np.array([[0.1, 0, 0], [0, 0.2, -0.3]])
    batch = att.integrate_bortz(starts, lambda t: [0.1, t, 0.3], 0.1, 20)
    for i, p in enumerate(starts):
        one = att.integrate_bortz(p, lambda t: [0.1, t, 0.3], 0.1, 20)
        np.testing.assert_array_equal(batch.p[:, i], one.p)
    rates = np.array([[0.1, 0, 0.2], [0.2, 0.1, 0]])
    spread = att.integrate_bortz(np.zeros(3), lambda t: rates, 0.1, 5)
    assert spread.p.shape == (6, 2, 3)
    np.testing.assert_allclose(spread.p[-1], 0.5 * rates, rtol=0, atol=1e-15)


def test_constant_rate_is_exact_for_any_step():
    w = np.array([0.7, -1.1, 0.4])
    C0 = rot.dcm_from_rotation_vector([0.2, 0.1, -0.5])
    once = att.rotate(C0, w, 6.0)
    many = att.integrate_rates(C0, np.tile(w, (60, 1)), 0.1)
    np.testing.assert_array_equal(many[0], C0)
    np.testing.assert_allclose(many[-1], once, rtol=0, atol=1e-13)
    np.testing.assert_allclose(att.rotate(C0, w, [0.1, 6.0]), many[[1, 60]], rtol=0, atol=1e-13)
    # the initial attitude multiplies from the left, in the matrix and in its rate (MAT 1.5)
    np.testing.assert_allclose(once, C0 @ att.rotate(np.eye(3), w, 6.0), rtol=0, atol=1e-14)
    np.testing.assert_allclose(rot.dcm_rate(once, w), C0 @ rot.dcm_rate(att.rotate(np.eye(3), w, 6.0), w), atol=1e-14)


def test_integrate_rates_batches_and_leaves_its_input():
    w = np.random.default_rng(3).normal(size=(7, 2, 3))
    before = w.copy()
    out = att.integrate_rates(np.eye(3), w, 0.2)
    assert out.shape == (8, 2, 3, 3)
    np.testing.assert_allclose(out[:, 1], att.integrate_rates(np.eye(3), w[:, 1], 0.2), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(w, before)


def test_coning_batches():
    cone = att.coning(0.3, [1.0, 2.0], 0.4)
    assert cone.p.shape == cone.w.shape == cone.p_rate.shape == (2, 3)
    np.testing.assert_array_equal(cone.w[1], att.coning(0.3, 2.0, 0.4).w)
    np.testing.assert_allclose(rot.rotation_vector_rate(cone.p, cone.w), cone.p_rate, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: att.rotate(np.eye(3), [0, 0], 1.0), "w: expected shape (..., 3), got (2,)"),
    (lambda: att.integrate_rates(np.eye(3), [0, 0, 1], 1.0), "w: expected shape (steps, ..., 3), got (3,)"),
    (lambda: att.integrate_rates(np.eye(3), [[0, 0, 1]], -1.0), "dt_s: expected a positive step, got -1.0"),
    (lambda: att.integrate_bortz([0, 0, 0], lambda t: [0, 0, np.nan], 0.1, 2), "w(t): expected finite"),
    (lambda: att.integrate_bortz([0, 0, 0], lambda t: [0, 0, 1], 0.1, 0), "steps: expected at least 1, got 0"),
    (lambda: att.coning(np.inf, 1.0, 0.0), "half_angle_rad: expected finite"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
