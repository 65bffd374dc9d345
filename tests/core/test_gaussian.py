"""The algebra of normal laws: MAT 1.3 numbers, and identities that hold for any law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import gaussian as ga
from core.linalg import cholesky_psd, sqrt_psd
from core.types import Gaussian
from tests.oracle import entry

seeds = st.integers(0, 10_000)
properties = settings(deadline=None, max_examples=60)


def random_gaussian(rng, n, batch=(), rank=None):
    B = rng.normal(size=(*batch, n, n + 2 if rank is None else rank))
    return Gaussian(rng.normal(size=(*batch, n)), B @ B.mT)


def test_oracle_C1_12_uncorrelated_but_dependent():
    """The uniform disc, by the points of a sunflower; no normal law could do this (Theorem 5)."""
    e = entry("C1-12")["expected"]
    k = np.arange(40_000) + 0.5
    r, angle = np.sqrt(k / 40_000), np.pi * (1 + np.sqrt(5)) * k        # equal areas: r = sqrt(u)
    x = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)
    disc = ga.mixture_moments(np.full(len(x), 1 / len(x)), x, np.zeros((len(x), 2, 2)))
    np.testing.assert_allclose(disc.mean, 0.0, atol=1e-4)
    np.testing.assert_allclose(disc.cov, e["var"] * np.eye(2), rtol=0, atol=1e-4)
    f = 2 / np.pi * np.sqrt(1 - np.square(entry("C1-12")["inputs"]["t"]))
    np.testing.assert_allclose(f, e["f_marginal"], rtol=1e-9)
    in_strip = np.mean(np.abs(x[:, 0]) < 0.05) / 0.1       # the marginal near 0, from the same points
    assert in_strip == pytest.approx(e["f_marginal"][0], rel=5e-3)
    assert f[0] ** 2 == pytest.approx(e["product_at_origin"], rel=1e-9)
    assert e["product_at_origin"] != pytest.approx(e["f_joint"], rel=0.1)
    square = np.linspace(-1, 1, 2001)[:-1] + 0.0005
    accepted = np.mean(square[:, None] ** 2 + square**2 < 1)
    assert accepted == pytest.approx(e["acceptance"], abs=1e-4)


def test_oracle_C1_14_covariance_of_the_mean():
    e = entry("C1-14")
    Sigma, n = np.array(e["inputs"]["Sigma"]), e["inputs"]["n"]
    everyone = Gaussian(np.zeros(2 * n), np.kron(np.eye(n), Sigma))
    mean = ga.affine(everyone, np.kron(np.full((1, n), 1 / n), np.eye(2)))
    np.testing.assert_allclose(mean.cov, e["expected"]["cov_mean"], rtol=1e-9)


def test_oracle_C1_15_density():
    e = entry("C1-15")
    g = Gaussian(np.zeros(2), np.array(e["inputs"]["Sigma"]))
    assert float(np.exp(ga.log_density(g, [0.0, 0.0]))) == pytest.approx(e["expected"]["pdf0"], rel=1e-9)
    for point in e["expected"]["pdf_at"]:
        assert float(np.exp(ga.log_density(g, point["x"]))) == pytest.approx(point["f"], rel=1e-9)


class Ones:
    """A generator whose normal numbers are all 1: what a root does to a known u."""

    def standard_normal(self, size):
        return np.ones(size)


def test_oracle_C1_17_two_roots_turn_the_same_u_into_different_samples():
    from scipy.stats import multivariate_normal
    e = entry("C1-17")
    g = Gaussian(np.zeros(2), np.array(e["inputs"]["Sigma"]))
    by_sqrt, by_chol = ga.sample(g, 1, Ones(), root=sqrt_psd)[0], ga.sample(g, 1, Ones(), root=cholesky_psd)[0]
    np.testing.assert_allclose(by_sqrt, e["expected"]["x_sqrtm"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(by_chol, e["expected"]["x_chol"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ga.mahalanobis_squared(g, [by_sqrt, by_chol]), e["expected"]["mahalanobis2"], rtol=1e-12)
    P = multivariate_normal(cov=g.cov).cdf([12, 12], lower_limit=[-12, -12])
    assert pytest.approx(e["expected"]["P_in_square"], abs=1e-5) == P
    x = ga.sample(g, 20_000, np.random.default_rng(17))
    inside = np.mean(np.all(np.abs(x) <= 12, axis=-1))      # 4.5 standard deviations: false alarm 7e-6
    assert abs(inside - e["expected"]["P_in_square"]) < 4.5 * np.sqrt(P * (1 - P) / 20_000)


def test_oracle_C1_18_decorrelation():
    e = entry("C1-18")
    Sxx, Sxy, Syy = (e["inputs"][k] for k in ("Sxx", "Sxy", "Syy"))
    g = Gaussian(np.zeros(2), np.array([[Sxx, Sxy], [Sxy, Syy]], dtype=float))
    K = ga.regression_gain(g, 1)
    assert float(K[0, 0]) == pytest.approx(e["expected"]["coef"], rel=1e-9)
    zy = ga.affine(g, [[1.0, -float(K[0, 0])], [0.0, 1.0]])
    assert float(zy.cov[0, 1]) == pytest.approx(e["expected"]["cov_zy"], abs=1e-12)
    assert float(zy.cov[0, 0]) == pytest.approx(e["expected"]["var_z"], rel=1e-9)


def test_oracle_C1_24_condition():
    from core.forms import half_space_probability
    e = entry("C1-24")
    P, H, R, y = (e["inputs"][k] for k in ("P", "H", "R", "y"))
    joint = ga.affine(Gaussian(np.zeros(2), np.diag([P, R]).astype(float)), [[1.0, 0.0], [H, 1.0]])
    np.testing.assert_allclose(joint.cov, [[16, 24], [24, 52]], rtol=1e-12)
    posterior, expected = ga.condition(joint, [y], 1), e["expected"]
    assert float(posterior.mean[0]) == pytest.approx(expected["mean"], rel=1e-9)
    assert float(posterior.cov[0, 0]) == pytest.approx(expected["var"], rel=1e-9)
    assert float(np.sqrt(posterior.cov[0, 0])) == pytest.approx(expected["sd"], rel=1e-9)
    assert float(np.exp(ga.log_density(posterior, posterior.mean))) == pytest.approx(expected["peak"], rel=1e-9)
    log_y = ga.log_density(ga.marginal(joint, [1]), [y])
    assert float(np.exp(log_y)) == pytest.approx(expected["f_y"], rel=1e-9)
    below = half_space_probability(posterior, [1.0], -4.0)
    assert float(below) == pytest.approx(expected["P_below_minus4"], rel=1e-9)
    x = np.linspace(-15, 5, 41)                             # Definition 7: joint over marginal
    ratio = ga.log_density(joint, np.stack([x, np.full(41, y)], axis=-1)) - log_y
    np.testing.assert_allclose(ratio, ga.log_density(posterior, x[:, None]), rtol=1e-12)


def test_oracle_C1_26_linear_transform():
    e = entry("C1-26")
    g = Gaussian(np.zeros(2), np.array(e["inputs"]["Sigma"]))
    moved = ga.affine(g, e["inputs"]["A"], [5.0, -5.0])
    np.testing.assert_allclose(moved.cov, e["expected"]["V"], rtol=1e-9)
    np.testing.assert_array_equal(moved.mean, [5.0, -5.0])


@properties
@given(seeds, st.integers(1, 3), st.integers(1, 3), st.sampled_from([(), (4,), (2, 3)]))
def test_conditioning_is_the_decorrelated_part_moved_by_y(seed, n_x, n_y, batch):
    rng = np.random.default_rng(seed)
    g, y = random_gaussian(rng, n_x + n_y, batch), rng.normal(size=(*batch, n_y))
    mean, cov = g.mean.copy(), g.cov.copy()
    posterior = ga.condition(g, y, n_x)
    assert posterior.mean.shape == (*batch, n_x) and posterior.cov.shape == (*batch, n_x, n_x)
    K = ga.regression_gain(g, n_x)
    A = np.concatenate([np.broadcast_to(np.eye(n_x), (*batch, n_x, n_x)), -K], axis=-1)
    z = ga.affine(g, A)
    np.testing.assert_allclose(posterior.mean, z.mean + np.matvec(K, y), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(posterior.cov, z.cov, rtol=1e-6, atol=1e-8)
    for i in np.ndindex(batch):
        one = ga.condition(Gaussian(g.mean[i], g.cov[i]), y[i], n_x)
        np.testing.assert_allclose(posterior.mean[i], one.mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(posterior.cov[i], one.cov, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(g.mean, mean)
    np.testing.assert_array_equal(g.cov, cov)


@properties
@given(seeds, st.integers(1, 4))
def test_density_of_the_joint_is_conditional_times_marginal(seed, n_y):
    rng = np.random.default_rng(seed)
    joint = random_gaussian(rng, 2 + n_y)
    x, y = rng.normal(size=(7, 2)), rng.normal(size=n_y)
    posterior = ga.condition(joint, y, 2)
    left = ga.log_density(joint, np.concatenate([x, np.tile(y, (7, 1))], axis=-1))
    right = ga.log_density(posterior, x) + ga.log_density(ga.marginal(joint, range(2, 2 + n_y)), y)
    np.testing.assert_allclose(left, right, rtol=1e-6, atol=1e-6)


@properties
@given(seeds, st.integers(1, 3), st.sampled_from([(), (3,)]))
def test_product_is_the_pointwise_product(seed, n, batch):
    rng = np.random.default_rng(seed)
    g1, g2 = random_gaussian(rng, n, batch), random_gaussian(rng, n)
    g, log_scale = ga.product(g1, g2)
    x = rng.normal(size=n)
    left = ga.log_density(g1, x) + ga.log_density(g2, x)
    np.testing.assert_allclose(left, ga.log_density(g, x) + log_scale, rtol=1e-6, atol=1e-6)
    swapped, same_scale = ga.product(g2, g1)
    np.testing.assert_allclose(swapped.mean, g.mean, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(same_scale, log_scale, rtol=1e-9)


def test_product_with_an_exactly_known_component():
    known = Gaussian(np.array([1.0, 0.0]), np.diag([0.0, 4.0]))
    g = ga.product(Gaussian(np.array([3.0, 2.0]), np.diag([1.0, 4.0])), known).gaussian
    np.testing.assert_allclose(g.mean, [1.0, 1.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(g.cov, np.diag([0.0, 2.0]), rtol=0, atol=1e-14)


@properties
@given(seeds, st.integers(1, 4), st.integers(1, 3), st.sampled_from([(), (2, 3)]))
def test_mixture_moments_are_those_of_pooled_samples(seed, k, n, batch):
    rng = np.random.default_rng(seed)
    w, parts = rng.dirichlet(np.ones(k), size=batch), random_gaussian(rng, n, (*batch, k))
    got = ga.mixture_moments(w, parts.mean, parts.cov)
    second = np.einsum("...k,...kij->...ij", w, parts.cov + parts.mean[..., :, None] * parts.mean[..., None, :])
    mean = np.einsum("...k,...ki->...i", w, parts.mean)
    np.testing.assert_allclose(got.mean, mean, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.cov, second - mean[..., :, None] * mean[..., None, :], rtol=0, atol=1e-10)
    assert got.mean.shape == (*batch, n)


def test_sample_has_the_moments_of_the_law():
    # 20000 draws; every mean and covariance entry within 5 of its standard deviations: false alarm below 1e-5
    N, g = 20_000, Gaussian(np.array([1.0, -2.0]), np.array([[16.0, 24.0], [24.0, 52.0]]))
    for root in (cholesky_psd, sqrt_psd):
        x = ga.sample(g, N, np.random.default_rng(8), root=root)
        sd = np.sqrt((g.cov**2 + np.outer(np.diag(g.cov), np.diag(g.cov))) / N)
        assert np.all(np.abs(x.mean(axis=0) - g.mean) < 5 * np.sqrt(np.diag(g.cov) / N))
        assert np.all(np.abs(np.cov(x.T) - g.cov) < 5 * sd)


def test_sample_shapes_seeds_and_singular_laws():
    rng = np.random.default_rng(2)
    batch = random_gaussian(rng, 3, (4,), rank=1)
    x = ga.sample(batch, (5, 2), np.random.default_rng(1))
    assert x.shape == (5, 2, 4, 3)
    np.testing.assert_array_equal(x, ga.sample(batch, (5, 2), np.random.default_rng(1)))
    assert ga.sample(batch, (), np.random.default_rng(1)).shape == (4, 3)
    spread = np.linalg.svd(x[..., 1, :].reshape(-1, 3) - batch.mean[1], compute_uv=False)
    assert spread[1] < 1e-7 * spread[0]                    # rank one: the cloud is a line
    still = ga.sample(Gaussian(np.array([1.0, 2.0]), np.zeros((2, 2))), 3, rng)     # w ~ N(0, 0): standing still
    np.testing.assert_array_equal(still, np.tile([1.0, 2.0], (3, 1)))


def test_log_density_broadcasts_and_matches_scipy():
    from scipy.stats import multivariate_normal
    rng = np.random.default_rng(4)
    g, x = random_gaussian(rng, 3), rng.normal(size=(5, 6, 3))
    expected = multivariate_normal(g.mean, g.cov).logpdf(x)
    np.testing.assert_allclose(ga.log_density(g, x), expected, rtol=1e-9)
    many = random_gaussian(rng, 3, (6,))
    got = ga.log_density(many, x)
    assert got.shape == (5, 6)
    np.testing.assert_allclose(got[2, 3], ga.log_density(Gaussian(many.mean[3], many.cov[3]), x[2, 3]), rtol=1e-12)


def test_marginal_keeps_the_order_asked_for():
    g = random_gaussian(np.random.default_rng(3), 4, (2,))
    m = ga.marginal(g, [3, 1])
    np.testing.assert_array_equal(m.mean, g.mean[:, [3, 1]])
    np.testing.assert_array_equal(m.cov[:, 0, 1], g.cov[:, 3, 1])
    picked = ga.affine(g, np.eye(4)[[3, 1]])
    np.testing.assert_allclose(m.cov, picked.cov, rtol=0, atol=1e-14)


G2 = Gaussian(np.zeros(2), np.eye(2))


@pytest.mark.parametrize(("call", "words"), [
    (lambda: ga.sample(Gaussian(np.zeros(2), np.eye(3)), 1, None), "cov: expected shape (..., 2, 2), got (3, 3)"),
    (lambda: ga.sample(Gaussian(np.zeros(2), np.diag([1.0, -1.0])), 1, None), "cov: expected a positive semidefinite"),
    (lambda: ga.sample(Gaussian(np.zeros(2), np.array([[1.0, 0.2], [0, 1]])), 1, None), "expected a symmetric matrix"),
    (lambda: ga.log_density(Gaussian(np.zeros(2), np.ones((2, 2))), [0, 0]), "cov: expected a positive definite"),
    (lambda: ga.log_density(G2, [0, 0, 0]), "x: expected shape (..., 2), got (3,)"),
    (lambda: ga.log_density(G2, [0, np.nan]), "x: expected finite"),
    (lambda: ga.affine(G2, np.eye(3)), "A: expected shape (..., n, 2), got (3, 3)"),
    (lambda: ga.affine(G2, np.eye(2), [1, 2, 3]), "b: expected shape (..., 2), got (3,)"),
    (lambda: ga.marginal(G2, [0, 0]), "expected different indices from 0 to 1, got [0, 0]"),
    (lambda: ga.marginal(G2, [2]), "expected different indices from 0 to 1, got [2]"),
    (lambda: ga.condition(G2, [1.0], 2), "n_x: expected from 1 to 1"),
    (lambda: ga.condition(G2, [1.0, 2.0], 1), "y: expected shape (..., 1), got (2,)"),
    (lambda: ga.condition(Gaussian(np.zeros(2), np.diag([1.0, 0.0])), [1.0], 1), "covariance of y: expected a"),
    (lambda: ga.regression_gain(G2, 0), "n_x: expected from 1 to 1"),
    (lambda: ga.product(G2, Gaussian(np.zeros(1), np.eye(1))), "g2: expected 2 components as in g1, got 1"),
    (lambda: ga.product(*[Gaussian(np.zeros(1), np.zeros((1, 1)))] * 2), "cov: expected a positive definite"),
    (lambda: ga.mixture_moments([0.5, 0.6], np.zeros((2, 1)), np.zeros((2, 1, 1))), "with sum 1"),
    (lambda: ga.mixture_moments([1.5, -0.5], np.zeros((2, 1)), np.zeros((2, 1, 1))), "expected numbers >= 0"),
    (lambda: ga.mixture_moments([1.0], np.zeros((2, 1)), np.zeros((2, 1, 1))), "weights: expected shape (..., 2)"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
