"""Motion models: their matrices, their discretisation, and their samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.motion import (
    LinearMotion,
    constant_position,
    constant_velocity,
    constant_velocity_with_clock,
    discretise,
)
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")


def test_c3_01_constant_velocity_one_axis():
    e = entry("C3-01")
    for case, want in zip(e["inputs"]["cases"], e["expected"]["cases"], strict=True):
        model = constant_velocity(case["dt"], np.sqrt(case["sc2"]), 1)
        np.testing.assert_allclose(model.Phi, want["Phi1"], rtol=1e-12)
        np.testing.assert_allclose(model.Q, want["Q1"], rtol=1e-12)
        assert np.linalg.det(model.Q) == pytest.approx(case["sc2"] ** 2 * case["dt"] ** 4 / 12, rel=1e-9)


def test_t_07_six_states_with_a_still_axis():
    e = entry("T-07")
    for sigma, key in zip(e["inputs"]["sigma"], ("stiff", "flexible"), strict=True):
        model = constant_velocity(e["inputs"]["dt"], [sigma, sigma, 0.0], 3)
        got = [model.Q[0, 0], model.Q[0, 3], model.Q[3, 3]]
        np.testing.assert_allclose(got, e["expected"][key], rtol=1e-12)
        assert np.linalg.matrix_rank(model.Q) == e["expected"]["rank_Q"]
        np.testing.assert_array_equal(model.Phi[:3, 3:], np.eye(3))
        np.testing.assert_allclose(model.root @ model.root.T, model.Q, atol=1e-18)


def test_state_order_is_positions_then_velocities():
    x = constant_velocity(0.5, 1.0, 3).f(np.array([1.0, 2, 3, 10, 20, 30]))
    np.testing.assert_allclose(x, [6, 12, 18, 10, 20, 30])


@given(st.floats(0.01, 20), st.floats(0, 5), st.floats(0, 5), st.integers(1, 3))
def test_two_half_steps_are_one_step(dt, s1, s2, dim):
    for build in (constant_velocity, constant_position):
        sigma = np.linspace(s1, s2, dim)
        half, full = build(dt / 2, sigma, dim), build(dt, sigma, dim)
        np.testing.assert_allclose(half.Phi @ half.Phi, full.Phi, rtol=1e-12)
        np.testing.assert_allclose(half.Phi @ half.Q @ half.Phi.T + half.Q, full.Q, rtol=1e-10, atol=1e-300)


def test_van_loan_gives_the_closed_forms():
    dim, dt = 2, 0.7
    sigma = np.array([0.3, 2.0])
    F = np.block([[np.zeros((dim, dim)), np.eye(dim)], [np.zeros((dim, 2 * dim))]])
    G = np.vstack([np.zeros((dim, dim)), np.eye(dim)])
    got, want = discretise(F, G, np.diag(sigma**2), dt), constant_velocity(dt, sigma, dim)
    np.testing.assert_allclose(got.Phi, want.Phi, atol=1e-14)
    np.testing.assert_allclose(got.Q, want.Q, atol=1e-14)
    got = discretise(np.zeros((dim, dim)), np.eye(dim), np.diag(sigma**2), dt)
    np.testing.assert_allclose(got.Q, constant_position(dt, sigma, dim).Q, atol=1e-14)


def test_van_loan_of_a_stable_process():
    """dx = -a x dt + dbeta has V(x_dt | x_0) = q (1 - exp(-2 a dt)) / (2 a)."""
    a, q, dt = 0.4, 2.0, 3.0
    model = discretise([[-a]], [[1.0]], [[q]], dt)
    assert model.Phi[0, 0] == pytest.approx(np.exp(-a * dt), rel=1e-12)
    assert model.Q[0, 0] == pytest.approx(q * (1 - np.exp(-2 * a * dt)) / (2 * a), rel=1e-12)


def test_clock_is_one_more_axis_with_its_own_phase_noise():
    dt, sigma, b, r = 2.0, [0.5, 0.6, 0.1], 0.3, 0.05
    model = constant_velocity_with_clock(dt, sigma, 3, b, r)
    F = np.block([[np.zeros((4, 4)), np.eye(4)], [np.zeros((4, 8))]])
    G = np.zeros((8, 5))
    G[4:, :4], G[3, 4] = np.eye(4), 1.0
    want = discretise(F, G, np.diag(np.square([*sigma, r, b])), dt)
    np.testing.assert_allclose(model.Phi, want.Phi, atol=1e-13)
    np.testing.assert_allclose(model.Q, want.Q, atol=1e-13)


def test_sample_moments():
    # 20 moments within 4 standard errors each: false alarm below 20 * 6.4e-5 = 0.13 %.
    N = 40_000
    model = LinearMotion([[1, 0.5], [-0.2, 0.9]], [[2.0, 0.6], [0.6, 1.0]])
    x = np.asfortranarray(np.tile([3.0, -1.0], (N, 1)))
    e = model.sample(x, np.random.default_rng(5)) - model.f(x)
    assert np.abs(e.mean(axis=0) / np.sqrt(model.Q.diagonal() / N)).max() < 4
    spread = np.sqrt((np.outer(model.Q.diagonal(), model.Q.diagonal()) + model.Q**2) / N)
    assert np.abs((e.T @ e / N - model.Q) / spread).max() < 4


@pytest.mark.parametrize("shape", [(), (1,), (5,), (3, 4)])
def test_sample_ignores_the_layout_and_keeps_components_contiguous(shape):
    model = constant_velocity(1.0, [0.5, 2.0], 2)
    x = np.random.default_rng(0).normal(size=(*shape, 4))
    before = x.copy()
    a = model.sample(x, np.random.default_rng(1))
    b = model.sample(np.asfortranarray(x), np.random.default_rng(1))
    np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(x, before)
    assert a.shape == x.shape and a[..., 1].flags.c_contiguous
    assert not np.array_equal(a, model.sample(x, np.random.default_rng(2)))


def test_sample_without_noise_is_f():
    model = constant_velocity(2.0, 0.0, 2)
    x = np.arange(8.0).reshape(2, 4)
    np.testing.assert_allclose(model.sample(x, np.random.default_rng(0)), model.f(x), rtol=1e-15)


def test_sampler_is_the_same_map():
    model = LinearMotion([[1, 0.5], [-0.2, 0.9]], [[2.0, 0.6], [0.6, 1.0]])
    x = np.asfortranarray(np.random.default_rng(0).normal(size=(7, 2)))
    z = np.random.default_rng(1).normal(size=(2, 7)).astype(np.float32)
    out = np.empty_like(x)
    model.sampler()(x, z, out)
    np.testing.assert_allclose(out, x @ model.Phi.T + z.T @ model.root.T, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("layout", ["C", "F"])
def test_f_and_jacobian_on_batches(layout):
    model = constant_velocity(0.3, 1.0, 2)
    x = np.random.default_rng(0).normal(size=(3, 5, 4)).astype(np.float64, order=layout)
    y, J = model.f(x), model.jacobian(x)
    assert y.shape == (3, 5, 4) and J.shape == (3, 5, 4, 4)
    for i in np.ndindex(3, 5):
        np.testing.assert_allclose(y[i], model.Phi @ x[i], rtol=1e-14)
        np.testing.assert_array_equal(J[i], model.Phi)
    np.testing.assert_array_equal(model.jacobian(x[0, 0]), model.Phi)


def test_records_are_immutable_copies():
    Phi, Q = np.eye(2), np.eye(2)
    model = LinearMotion(Phi, Q)
    Phi[0, 0] = Q[0, 0] = 7.0
    assert model.Phi[0, 0] == model.Q[0, 0] == 1.0
    with pytest.raises(ValueError):
        model.Q[0, 0] = 2.0
    with pytest.raises(AttributeError):
        model.Q = np.eye(2)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: LinearMotion(np.ones((2, 3)), np.eye(2)), "Phi: expected a square matrix"),
        (lambda: LinearMotion(np.eye(2), np.eye(3)), "Q: expected shape"),
        (lambda: LinearMotion(np.eye(2), [[1, 2], [2, 1]]), "positive semidefinite"),
        (lambda: LinearMotion(np.eye(2), [[1, 0.5], [0, 1]]), "symmetric"),
        (lambda: LinearMotion([[np.nan]], [[1.0]]), "finite"),
        (lambda: LinearMotion(np.eye(1), np.ones((2, 1, 1))), "one matrix"),
        (lambda: constant_velocity(0.0, 1.0, 2), "dt_s: expected a positive"),
        (lambda: constant_velocity(1.0, -1.0, 2), "sigma: expected non-negative"),
        (lambda: constant_velocity(1.0, [1.0, 2.0, 3.0], 2), "sigma: expected a number or 2"),
        (lambda: constant_position(1.0, 1.0, 0), "dim: expected a positive integer"),
        (lambda: constant_position(np.inf, 1.0, 1), "dt_s: expected finite"),
        (lambda: constant_velocity_with_clock(1.0, 1.0, 3, -1.0, 1.0), "bias_sigma"),
        (lambda: discretise(np.ones((2, 3)), np.eye(2), np.eye(2), 1.0), "F: expected a square"),
        (lambda: discretise(np.eye(2), np.eye(3), np.eye(3), 1.0), "G: expected shape"),
        (lambda: constant_velocity(1.0, 1.0, 2).f(np.ones(3)), "x: expected shape"),
        (lambda: constant_velocity(1.0, 1.0, 1).f([0.0, np.nan]), "x: expected finite"),
        (lambda: constant_velocity(1.0, 1.0, 1).sample([0.0, np.inf], np.random.default_rng()), "x: expected finite"),
        (lambda: constant_velocity(1.0, 1.0, 1).jacobian(np.full((50, 2), np.nan)), "x: expected finite"),
    ],
)
def test_bad_input(build, words):
    with pytest.raises(ValueError, match=words):
        build()
