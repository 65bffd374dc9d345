"""Gaussian mixtures and their filter: exact on linear models, two peaks kept where an extended filter follows one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import extended, kalman, unscented
from core import mixture as gm
from core.gaussian import log_density as normal_log_density
from core.mixture import DEFAULT, Mixture, Upkeep, mixture, one
from core.motion import LinearMotion, constant_velocity
from core.sensors import Bearing, Linear, Range
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
PAIR = Range([[-250.0, 0.0], [250.0, 0.0]], 10.0)                                        # Example 22
START = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))
UNTOUCHED = Upkeep(prune_below=0.0, merge_below=0.0, max_components=1000)
SPLITTING = Upkeep(split_beyond=15.0, entries=(0, 1))


def covariances(rng, *shape):
    A = rng.normal(size=(*shape, shape[-1]))
    return A @ A.mT + 0.1 * np.eye(shape[-1])


def random_mixture(seed, c=4, n=2, batch=()):
    rng = np.random.default_rng(seed)
    w = rng.dirichlet(np.ones(c), size=batch or None)
    return mixture(w, 3 * rng.normal(size=(*batch, c, n)), covariances(rng, *batch, c, n))


def element(m, k):
    """Number k of a batch, without its components of weight 0."""
    alive = m.log_weights[k] > -np.inf
    return Mixture(m.log_weights[k][alive], m.means[k][alive], m.covs[k][alive])


def assert_same(a, b, atol=1e-9):
    assert a.means.shape == b.means.shape
    for one_array, other in zip(a, b, strict=True):
        np.testing.assert_allclose(one_array, other, atol=atol)


# The law itself


def test_exercise_3_11_c3_22():
    e = entry("C3-22")
    i, expected = e["inputs"], e["expected"]
    m = mixture([i["alpha"], 1 - i["alpha"]], [i["mu1"], i["mu2"]], np.broadcast_to(np.eye(2), (2, 2, 2)))
    y = gm.predict(m, LinearMotion(i["F"], i["Q"]))
    np.testing.assert_allclose(gm.moments(y).mean, expected["mean"], rtol=1e-9)
    np.testing.assert_allclose(y.covs, [expected["comp_cov"]] * 2, rtol=1e-9)
    np.testing.assert_allclose(gm.moments(y).cov, expected["total_cov"], rtol=1e-9)
    assert np.exp(gm.log_density(y, i["y"])) == pytest.approx(expected["pdf"], rel=1e-9)


def test_lemma_of_exercise_3_11():
    """N(x; mu, S1) N(y; H x, S2) = N(x; mu_bar, S3) N(y; H mu, S4): the last factor holds H mu (erratum M25)."""
    expected = entry("C3-22")["expected"]["lemma"]
    mu, S1, H, S2, x, y = 1.0, 4.0, 2.0, 3.0, 0.5, 4.0

    def density(value, mean, variance):
        return np.exp(normal_log_density(Gaussian(np.array([mean]), np.array([[variance]])), [value]))

    u = gm.update(one(Gaussian(np.array([mu]), np.array([[S1]]))), [y], Linear([[H]], [[S2]]))
    given_y = np.exp(gm.log_density(u.posterior, [x]))
    assert density(x, mu, S1) * density(y, H * x, S2) == pytest.approx(expected["lhs"], rel=1e-9)
    assert given_y * np.exp(u.log_evidence) == pytest.approx(expected["rhs_correct"], rel=1e-9)
    printed = density(y, H * u.posterior.means[0, 0], u.step.innovation_cov[0, 0, 0])
    assert given_y * printed == pytest.approx(expected["rhs_printed"], rel=1e-9)


def test_mean_and_highest_point_c3_23():
    e = entry("C3-23")
    i, expected = e["inputs"], e["expected"]
    m = mixture(i["weights"], np.array(i["means"], float)[:, None], np.square(i["sds"])[:, None, None])
    mean, cov = gm.moments(m)
    assert mean[0] == pytest.approx(expected["mean"], abs=1e-6)
    assert cov[0, 0] == pytest.approx(expected["var"], abs=1e-6)
    top = gm.mode(m)
    assert top[0] == pytest.approx(expected["map"], abs=1e-6)
    assert np.exp(gm.log_density(m, top)) == pytest.approx(expected["pdf_map"], abs=1e-6)
    assert cov[0, 0] + (top[0] - mean[0]) ** 2 == pytest.approx(expected["mse_at_map"], abs=1e-6)
    assert gm.heaviest(m).mean[0] == 0.0                                       # the heavier one, not the higher


def test_peaks_are_stationary_and_mode_is_the_highest():
    m = random_mixture(1, c=5, n=2)
    step = 1e-5 * np.eye(2)
    x = gm.peaks(m)
    slope = (gm.log_density(m, x[:, None] + step) - gm.log_density(m, x[:, None] - step)) / 2e-5
    np.testing.assert_allclose(slope, 0.0, atol=1e-6)
    grid = np.stack(np.meshgrid(*[np.linspace(-12, 12, 241)] * 2, indexing="ij"), axis=-1)
    assert gm.log_density(m, gm.mode(m)) >= gm.log_density(m, grid).max() - 1e-9


def test_density_integrates_to_one_and_gives_the_moments():
    m = mixture([0.2, 0.5, 0.3], [[-4.0], [0.0], [2.0]], [[[1.0]], [[0.3]], [[4.0]]])
    x = np.linspace(-20, 20, 4001)
    p = np.exp(gm.log_density(m, x[:, None])) * (x[1] - x[0])
    assert p.sum() == pytest.approx(1.0, abs=1e-9)
    assert p @ x == pytest.approx(gm.moments(m).mean[0], abs=1e-9)
    assert p @ x**2 - (p @ x) ** 2 == pytest.approx(gm.moments(m).cov[0, 0], abs=1e-8)
    np.testing.assert_allclose(gm.responsibilities(m, x[:, None]).sum(axis=-1), 1.0)


# Exactness on linear models


def test_update_of_a_linear_model_is_bayes_rule():
    m, sensor, y = random_mixture(2, n=3), Linear(np.random.default_rng(1).normal(size=(2, 3)), [4.0, 1.0]), [1.0, -2.0]
    x = np.random.default_rng(3).normal(size=(50, 3))
    u = gm.update(m, y, sensor)
    expected = gm.log_density(m, x) + sensor.log_likelihood(y, x) - u.log_evidence
    np.testing.assert_allclose(gm.log_density(u.posterior, x), expected, atol=1e-9)


def test_evidence_is_the_density_of_the_measurement():
    m, H, R = random_mixture(4), np.array([[1.0, 2.0]]), np.array([[3.0]])
    u = gm.update(m, [0.7], Linear(H, R))
    laws = [(w, (H @ mean)[0], (H @ P @ H.T + R)[0, 0]) for w, mean, P in zip(m.weights, m.means, m.covs, strict=True)]
    parts = [w * np.exp(-0.5 * (0.7 - h) ** 2 / S) / np.sqrt(2 * np.pi * S) for w, h, S in laws]
    assert np.exp(u.log_evidence) == pytest.approx(sum(parts), rel=1e-10)
    np.testing.assert_allclose(u.posterior.weights, np.array(parts) / sum(parts), rtol=1e-9)


def test_mixture_noise_is_a_convolution():
    """x = 2 x_before + w with two-peaked w: the density by components against a numerical convolution."""
    before = mixture([0.4, 0.6], [[-1.0], [2.0]], [[[0.5]], [[1.0]]])
    noise = mixture([0.7, 0.3], [[0.0], [6.0]], [[[0.2]], [[2.0]]])
    after = gm.predict(before, LinearMotion([[2.0]], [[9.0]]), noise=noise)
    np.testing.assert_allclose(after.means.ravel(), [-2.0, 4.0, 4.0, 10.0])
    np.testing.assert_allclose(after.weights, [0.28, 0.12, 0.42, 0.18])
    x = np.linspace(-20, 30, 5001)
    dx = x[1] - x[0]
    scaled = np.exp(gm.log_density(before, x[:, None] / 2)) / 2
    at = np.array([-3.0, 0.0, 4.0, 9.5])
    expected = [(scaled * np.exp(gm.log_density(noise, (a - x)[:, None]))).sum() * dx for a in at]
    np.testing.assert_allclose(np.exp(gm.log_density(after, at[:, None])), expected, rtol=1e-8)


@pytest.mark.parametrize("rule", ["ekf", "ukf"])
def test_one_component_is_the_single_filter(rule):
    rng = np.random.default_rng(5)
    ys = PAIR.h(START.mean + 3 * np.arange(1, 9)[:, None] * [1, 1, 0, 0])[:, None] + 10 * rng.normal(size=(8, 3, 2))
    ys[2, 1], ys[4, :, 0] = np.nan, np.nan
    ours = gm.run(START, ys, CV, PAIR, rule=rule, kappa=1.0)
    theirs = extended.run(START, ys, CV, PAIR) if rule == "ekf" else unscented.run(START, ys, CV, PAIR, 1.0)
    np.testing.assert_allclose(ours.means, theirs.posterior.mean, atol=1e-8)
    np.testing.assert_allclose(ours.covs, theirs.posterior.cov, atol=1e-7)
    assert (ours.counts == 1).all()
    assert ours.log_evidences[2, 1] == 0.0                                     # nothing measured, nothing learnt


def test_components_are_independent_kalman_filters():
    m, sensor = random_mixture(6, n=4), Linear(np.eye(2, 4), [4.0, 9.0])
    ys = np.random.default_rng(7).normal(size=(5, 2))
    last = gm.run(m, ys, CV, sensor, UNTOUCHED).steps[-1].posterior
    for i in range(4):
        alone = kalman.run(Gaussian(m.means[i], m.covs[i]), ys, CV, sensor).posterior
        np.testing.assert_allclose(last.means[i], alone.mean[-1], atol=1e-9)
        np.testing.assert_allclose(last.covs[i], alone.cov[-1], atol=1e-9)


def test_hopeless_component_can_come_back():
    """A weight of exp(-5000) is 0 as a number, but not as a logarithm."""
    m = mixture([0.5, 0.5], [[0.0], [1000.0]], np.full((2, 1, 1), 1e-6))
    sensor = Linear([[1.0]], [[100.0]])
    u = gm.update(m, [0.0], sensor)
    assert u.posterior.weights.tolist() == [1.0, 0.0] and u.posterior.log_weights[1] == pytest.approx(-5000, rel=1e-3)
    for _ in range(2):
        u = gm.update(u.posterior, [1000.0], sensor)
    np.testing.assert_allclose(u.posterior.weights, [0.0, 1.0], atol=1e-12)


def test_angles_are_wrapped():
    m = mixture([0.5, 0.5], [[-1.0, -50.0], [1.0, -50.0]], np.broadcast_to(np.eye(2), (2, 2, 2)))
    u = gm.update(m, [np.pi], Bearing([[0.0, 0.0]], 0.05))
    np.testing.assert_allclose(u.posterior.weights, 0.5)
    assert np.abs(u.step.innovation).max() < 0.1


# Reduction


@given(st.integers(0, 10_000), st.integers(2, 6), st.integers(1, 3), st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_merging_keeps_the_moments(seed, c, n, left):
    m = random_mixture(seed, c, n)
    r = gm.merge(m, 0.0, left)
    assert r.after.means.shape[0] == min(c, left)
    for a, b in zip(gm.moments(r.after), gm.moments(m), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-8)
    for j in range(r.after.means.shape[0]):                                    # each by its own members
        mine = r.owner == j
        assert r.after.weights[j] == pytest.approx(m.weights[mine].sum())
        part = gm.moments(mixture(m.weights[mine] / m.weights[mine].sum(), m.means[mine], m.covs[mine]))
        np.testing.assert_allclose(r.after.means[j], part.mean, atol=1e-8)
        np.testing.assert_allclose(r.after.covs[j], part.cov, atol=1e-8)
    assert r.lost >= 0


def test_merging_takes_the_nearest_and_bounds_the_loss():
    """The stated cost is at least the Kullback-Leibler divergence of the mixture from its merged form."""
    m = mixture([0.3, 0.3, 0.4], [[0.0], [1.0], [9.0]], np.ones((3, 1, 1)))
    r = gm.merge(m, 0.0, 2)
    assert r.owner.tolist() == [0, 0, 1]
    x = np.linspace(-10, 20, 3001)[:, None]
    p, q = gm.log_density(m, x), gm.log_density(r.after, x)
    loss = (np.exp(p) * (p - q)).sum() * 0.01
    assert 0 < loss < r.lost == pytest.approx(0.5 * 0.6 * np.log(1.25))
    assert gm.merge(m, 0.99 * r.lost).after.means.shape == (3, 1)
    assert gm.merge(m, 1.01 * r.lost).after.means.shape == (2, 1)
    wide_and_narrow = mixture([0.5, 0.5], [[0.0], [0.0]], [[[1.0]], [[100.0]]])
    assert gm.merge(wide_and_narrow, 0.5).after.means.shape == (2, 1)          # one place, but not the same law


def test_equal_components_merge_for_nothing():
    g = random_mixture(8, c=1)
    m = mixture([0.2, 0.3, 0.5], np.repeat(g.means, 3, axis=0), np.repeat(g.covs, 3, axis=0))
    r = gm.merge(m, 1e-12)
    assert_same(r.after, g)
    assert r.lost == pytest.approx(0.0, abs=1e-12)


def test_pruning():
    m = mixture([0.02, 0.6, 0.0, 0.08, 0.3], np.arange(5.0)[:, None], np.ones((5, 1, 1)))
    r = gm.prune(m, 0.05)
    assert r.owner.tolist() == [-1, 0, -1, 1, 2] and r.lost == pytest.approx(0.02)
    np.testing.assert_allclose(r.after.weights, np.array([0.6, 0.08, 0.3]) / 0.98)
    assert gm.prune(m, 0.0, 2).owner.tolist() == [-1, 0, -1, -1, 1]
    assert gm.prune(m, 5.0).after.means.tolist() == [[1.0]]                    # the heaviest stays


def moment(m, k):
    """E x^k of a one-dimensional mixture, from E (mu + s z)^k."""
    from math import comb

    normal = [0 if j % 2 else int(np.prod(np.arange(j - 1, 0, -2))) if j else 1 for j in range(k + 1)]
    mu, s = m.means[:, 0], np.sqrt(m.covs[:, 0, 0])
    return sum(comb(k, j) * (m.weights * mu ** (k - j) * s**j).sum() * normal[j] for j in range(k + 1))


@pytest.mark.parametrize("parts", [2, 3, 5])
@pytest.mark.parametrize("ratio", [0.2, 0.6, 0.9])
def test_splitting_keeps_all_moments_to_degree_2_parts_minus_1(parts, ratio):
    whole = one(Gaussian(np.array([1.5]), np.array([[4.0]])))
    d = gm.split(whole, parts=parts, ratio=ratio)
    assert d.after.means.shape == (parts, 1) and d.parent.tolist() == [0] * parts
    np.testing.assert_allclose(d.after.covs, 4.0 * ratio**2)
    for k in range(2 * parts):
        assert moment(d.after, k) == pytest.approx(moment(whole, k), rel=1e-9)
    assert moment(d.after, 2 * parts) < moment(whole, 2 * parts) * (1 - 1e-6)  # and there it ends


@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(2, 4), st.floats(0.1, 0.9))
@settings(max_examples=30, deadline=None)
def test_splitting_keeps_mean_and_covariance(seed, c, n, ratio):
    m = random_mixture(seed, c, n)
    for entries in (None, (0, 1)):
        d = gm.split(m, ratio=ratio, entries=entries)
        for a, b in zip(gm.moments(d.after), gm.moments(m), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-8)
        assert (np.linalg.eigvalsh(d.after.covs) > 0).all()


def test_splitting_goes_along_the_longest_axis_of_the_chosen_entries():
    P = np.diag([4.0, 400.0, 1e6, 1.0])
    P[1, 2] = P[2, 1] = 1e4                                                    # the third moves with the second
    m = mixture([0.5, 0.5], [[0.0] * 4, [1.0] * 4], np.stack([P, np.eye(4)]))
    d = gm.split(m, gm.longest_axis(m, (0, 1)) > 5.0, entries=(0, 1), ratio=0.5)
    assert d.parent.tolist() == [0, 0, 0, 1]
    np.testing.assert_allclose(gm.longest_axis(d.after, (0, 1)), [10, 10, 10, 1])
    np.testing.assert_allclose(d.after.means[:3, [0, 3]], 0.0, atol=1e-9)
    np.testing.assert_allclose(d.after.means[:3, 2], 25 * d.after.means[:3, 1])
    np.testing.assert_allclose(np.abs(d.after.means[[0, 2], 1]), 20 * np.sqrt(0.75 * 3))
    assert_same(gm.split(m, np.zeros(2, bool)).after, m)


def test_a_component_without_extent_is_not_split():
    d = gm.split(one(Gaussian(np.zeros(2), np.diag([1.0, 0.0]))), entries=(1,))
    assert d.after.means.shape == (1, 2)


# Batches


@pytest.mark.parametrize("runs", [3, 40])
def test_batch_equals_loop(runs):
    """Small batches and those that are kept batch last; every element has its own number of components."""
    rng = np.random.default_rng(9)
    ys = PAIR.h(START.mean + 3 * np.arange(1, 7)[:, None] * [1, 1, 0, 0])[:, None] + 10 * rng.normal(size=(6, runs, 2))
    ys[3, 1] = np.nan
    upkeep = Upkeep(split_beyond=8.0, entries=(0, 1), prune_below=0.02, merge_below=0.05, max_components=6)
    both = gm.run(START, ys, CV, PAIR, upkeep)
    assert len(np.unique(both.counts)) > 1
    for k in range(0, runs, max(1, runs // 4)):
        alone = gm.run(START, ys[:, k], CV, PAIR, upkeep)
        np.testing.assert_allclose(both.means[:, k], alone.means, atol=1e-7)
        np.testing.assert_allclose(both.covs[:, k], alone.covs, atol=1e-6)
        np.testing.assert_allclose(both.log_evidences[:, k], alone.log_evidences, atol=1e-8)
        np.testing.assert_array_equal(both.counts[:, k], alone.counts)
        assert_same(element(both.steps[-1].posterior, k), alone.steps[-1].posterior, 1e-6)


def test_batch_of_reductions():
    m = random_mixture(10, c=5, batch=(2, 3))
    wide = gm.longest_axis(m) > 1.5
    for f in (lambda m, _: gm.prune(m, 0.1).after, lambda m, _: gm.merge(m, 0.1, 3).after,
              lambda m, w: gm.split(m, w, parts=2).after):
        got = f(m, wide)
        assert got.means.shape[:2] == (2, 3)
        for k in np.ndindex(2, 3):
            assert_same(element(got, k), f(Mixture(*(a[k] for a in m)), wide[k]))
    for a, b in ((gm.moments(m).mean, lambda e: gm.moments(e).mean), (gm.mode(m), gm.mode),
                 (gm.heaviest(m).cov, lambda e: gm.heaviest(e).cov)):
        for k in np.ndindex(2, 3):
            np.testing.assert_allclose(a[k], b(Mixture(*(x[k] for x in m))), atol=1e-8)
    x = np.ones(2)
    assert gm.log_density(m, x).shape == (2, 3)
    assert gm.log_density(m, x)[1, 2] == pytest.approx(gm.log_density(Mixture(*(a[1, 2] for a in m)), x))


def test_batch_of_measurements_spreads_one_prior():
    m, ys = random_mixture(11), np.array([[0.0], [3.0]])
    both = gm.update(m, ys, Linear([[1.0, 1.0]], [[1.0]]))
    assert both.posterior.means.shape == (2, 4, 2) and both.log_evidence.shape == (2,)
    for k in range(2):
        alone = gm.update(m, ys[k], Linear([[1.0, 1.0]], [[1.0]]))
        assert_same(Mixture(*(a[k] for a in both.posterior)), alone.posterior)


# Example 22


def mass_above(m):
    """P(x_2 > 0)."""
    from scipy.special import ndtr

    return (m.weights * ndtr(m.means[..., 1] / np.sqrt(m.covs[..., 1, 1]))).sum(axis=-1)


def test_c3_36_two_peaks_are_kept_where_the_ekf_follows_one():
    """Fixed seeds; the extended filter's share and the mean mass lie within 4 deviations of the oracle (1e-4)."""
    e = entry("C3-36")["expected"]
    t = np.arange(1, 41)
    truth = np.column_stack([-150 + 3 * t, -30 + 3 * t])
    ys = PAIR.h(truth)[:, None] + 10 * np.random.default_rng(22).normal(size=(40, 40, 2))
    single = extended.run(START, ys, CV, PAIR).posterior
    wrong = single.mean[-1, :, 1] < 0
    assert abs(wrong.mean() - e["ekf_wrong_fraction"]) < 4 * np.sqrt(0.24 * 0.76 / 40)
    assert wrong.any() and np.sqrt(single.cov[-1, wrong, 1, 1]).max() < 20      # and it is sure of it
    bank = gm.run(START, ys, CV, PAIR, SPLITTING)
    mass = mass_above(bank.steps[-1].posterior)
    assert ((mass > 0.1) & (mass < 0.9)).all()                                  # both peaks live in every run
    assert abs(mass.mean() - e["pf_correct_mass_mean"]) < 0.08
    assert (bank.counts <= SPLITTING.max_components).all()
    # The two peaks are mirror images, and one of them is where the user is.
    for k in range(0, 40, 8):
        p = element(bank.steps[-1].posterior, k)
        up = p.means[:, 1] > 0
        sides = [np.average(p.means[s], weights=p.weights[s], axis=0)[:2] for s in (up, ~up)]
        assert np.linalg.norm(sides[0] - truth[-1]) < 60 and sides[1][1] < -40


def test_one_component_split_across_the_baseline_sees_both_sides():
    """One step with a wide prior on the baseline and ranges that only tell the distance from it, against a grid."""
    prior = one(Gaussian(np.array([0.0, 30.0]), np.diag([25.0, 60.0**2])))
    y = PAIR.h(np.array([0.0, 80.0]))
    axes = np.linspace(-30, 30, 121), np.linspace(-240, 240, 961)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    log_p = gm.log_density(prior, points) + PAIR.log_likelihood(y, points)
    exact = np.exp(log_p - log_p.max())
    exact /= exact.sum()
    above = exact[:, 481:].sum()

    def distance(m):
        """Total variation on the grid."""
        q = np.exp(gm.log_density(m, points))
        return 0.5 * np.abs(q / q.sum() - exact).sum()

    unsplit = gm.update(prior, y, PAIR).posterior
    assert mass_above(unsplit) > 0.95 and above < 0.73 and distance(unsplit) > 0.25      # no idea of the other peak
    priors = [Upkeep(split_beyond=s, parts=5).divide(prior).after for s in (50.0, 30.0)]
    assert [p.means.shape[0] for p in priors] == [5, 25]
    posteriors = [gm.update(p, y, PAIR).posterior for p in priors]
    assert distance(posteriors[0]) < 0.08 and distance(posteriors[1]) < 0.045
    for m in posteriors:
        assert mass_above(m) == pytest.approx(above, abs=0.02)
        peak = gm.peaks(m)
        for side in (72.5, -72.5):
            assert np.abs(peak[:, 1] - side).min() < 15


def test_everything_is_recorded():
    steps = gm.run(START, PAIR.h(START.mean)[None], CV, PAIR, SPLITTING).steps
    s = steps[0]
    assert_same(s.division.before, s.predicted)
    assert_same(s.update.prior, s.division.after)
    assert s.division.parent.shape == s.division.after.log_weights.shape
    assert_same(s.pruned.before, s.update.posterior)
    assert_same(s.merged.before, s.pruned.after)
    assert_same(s.posterior, s.merged.after)
    assert s.update.step.gain.shape == (*s.update.prior.log_weights.shape, 4, 2)
    assert gm.run(START, PAIR.h(START.mean)[None], CV, PAIR, keep_steps=False).steps == ()


def test_progress_may_cancel():
    seen = []
    gm.run(START, np.tile(PAIR.h(START.mean), (4, 1)), CV, PAIR, progress=seen.append)
    assert seen == [0.25, 0.5, 0.75, 1.0]

    def stop(fraction):
        if fraction > 0.4:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        gm.run(START, np.tile(PAIR.h(START.mean), (4, 1)), CV, PAIR, progress=stop)


def test_inputs_stay_as_they_are():
    m = random_mixture(12, n=4)
    copy = Mixture(*(a.copy() for a in m))
    ys = PAIR.h(START.mean) + np.zeros((3, 2))
    ys_copy = ys.copy()
    frozen = Mixture(*(a.copy() for a in m))
    for a in (*frozen, ys):
        a.setflags(write=False)
    gm.run(frozen, ys, CV, PAIR, SPLITTING)
    gm.prune(frozen, 0.1), gm.merge(frozen, 1.0), gm.split(frozen), gm.mode(frozen)
    assert_same(frozen, copy, 0)
    np.testing.assert_array_equal(ys, ys_copy)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: mixture([0.5, 0.6], np.zeros((2, 1)), np.ones((2, 1, 1))), "sum 1"),
    (lambda: mixture([1.5, -0.5], np.zeros((2, 1)), np.ones((2, 1, 1))), ">= 0"),
    (lambda: mixture([0.5, 0.5], np.zeros((2, 1)), -np.ones((2, 1, 1))), "positive semidefinite"),
    (lambda: mixture([0.5, 0.5], np.zeros((3, 1)), np.ones((3, 1, 1))), "expected 3"),
    (lambda: gm.moments(Mixture(np.zeros(2), np.zeros((2, 1)), np.ones((2, 1, 1)))), "sum 1"),
    (lambda: gm.moments(Mixture(np.zeros(1), np.full((1, 1), np.nan), np.ones((1, 1, 1)))), "finite"),
    (lambda: gm.moments("no"), "expected a mixture"),
    (lambda: gm.mode(one(Gaussian(np.zeros(1), np.zeros((1, 1))))), "positive definite"),
    (lambda: gm.log_density(random_mixture(0), np.zeros(3)), r"\(..., 2\)"),
    (lambda: gm.predict(random_mixture(0), CV), "2 states"),
    (lambda: gm.predict(random_mixture(0, n=4), CV, noise=random_mixture(0)), "noise"),
    (lambda: gm.update(random_mixture(0, n=4), [1.0], PAIR), r"\(..., 2\)"),
    (lambda: gm.update(random_mixture(0, n=4), [1.0, np.nan], PAIR), "finite"),
    (lambda: gm.update(random_mixture(0, n=4), [1.0, 2.0], PAIR, rule="pf"), "'ekf' or 'ukf'"),
    (lambda: gm.update(random_mixture(0, n=4), [1.0, 2.0], PAIR, rule="ukf", kappa=-4.0), "kappa"),
    (lambda: gm.prune(random_mixture(0), -1.0), "below"),
    (lambda: gm.merge(random_mixture(0), 0.1, 0), "max_components"),
    (lambda: gm.merge(mixture([0.5, 0.5], np.eye(2), np.zeros((2, 2, 2))), 1.0), "positive definite"),
    (lambda: gm.split(random_mixture(0), parts=1), "2 parts"),
    (lambda: gm.split(random_mixture(0), ratio=1.0), "ratio"),
    (lambda: gm.split(random_mixture(0), entries=(0, 0)), "entries"),
    (lambda: Upkeep(split_beyond=0.0), "split_beyond"),
    (lambda: Upkeep(prune_below=np.nan), "prune_below"),
    (lambda: Upkeep(max_components=0), "max_components"),
])  # fmt: skip
def test_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_default_parts_leave_no_gaps():
    """A split normal law still has one peak, and nearly its old density."""
    whole = one(Gaussian(np.zeros(1), np.eye(1)))
    x = np.linspace(-4, 4, 401)[:, None]
    p = np.exp(gm.log_density(whole, x))
    for parts in (2, 3, 5, 9):
        q = np.exp(gm.log_density(gm.split(whole, parts=parts).after, x))
        assert (np.diff(np.sign(np.diff(q))) != 0).sum() <= 1 and np.abs(q - p).sum() * 0.02 < 0.12
    assert gm.longest_axis(gm.split(whole).after) == pytest.approx(np.sqrt(3 / 7))


def test_defaults_do_not_split():
    assert Upkeep() == DEFAULT and DEFAULT.split_beyond is None


def test_singular_covariances_are_no_obstacle_to_one_component():
    """Erratum K7: a state that is known exactly and has no noise."""
    start, motion = Gaussian(np.zeros(2), np.zeros((2, 2))), LinearMotion(np.eye(2), np.diag([1.0, 0.0]))
    sensor, ys = Linear([[1.0, 1.0]], [[1.0]]), [[1.0], [2.0]]
    got, expected = gm.run(start, ys, motion, sensor), kalman.run(start, ys, motion, sensor)
    np.testing.assert_allclose(got.means, expected.posterior.mean, atol=1e-12)
    np.testing.assert_allclose(got.covs, expected.posterior.cov, atol=1e-12)
