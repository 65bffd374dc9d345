"""Chi-square and Chebyshev levels, ellipses and ellipsoids."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import gaussian as ga
from core.types import Gaussian
from tests.oracle import entry

properties = settings(deadline=None, max_examples=60)
SIGMA = np.array([[16.0, 24.0], [24.0, 52.0]])


def test_oracle_C1_15_the_68_percent_ellipse():
    e = entry("C1-15")
    g, expected = Gaussian(np.zeros(2), np.array(e["inputs"]["Sigma"])), e["expected"]
    c = ga.chi_square_level(e["inputs"]["p"], 2)
    assert float(c) == pytest.approx(expected["c"], rel=1e-9)
    np.testing.assert_allclose(ga.ellipsoid(g, c).semi_axes, expected["semi_axes"], rtol=1e-9)
    line = ga.ellipse(g, c, points=100_001)
    np.testing.assert_allclose(ga.mahalanobis_squared(g, line), expected["c"], rtol=1e-9)
    np.testing.assert_allclose(13 * line[:, 0] ** 2 - 12 * line[:, 0] * line[:, 1] + 4 * line[:, 1] ** 2,
                               64 * expected["c"], rtol=1e-9)                       # exercise 1.10
    np.testing.assert_allclose(np.abs(line).max(axis=0), expected["bbox"], rtol=1e-8)
    x, y = line[:-1].T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert area == pytest.approx(expected["area"], rel=1e-8)
    assert float(ga.chi_square_probability(1.0, 2)) == pytest.approx(expected["p_1sigma"], rel=1e-9)
    np.testing.assert_allclose(np.exp(ga.log_density(g, line[::1000])), 0.32 * expected["pdf0"], rtol=1e-9)


def test_oracle_C1_19_quantiles_and_densities():
    e = entry("C1-19")["expected"]
    for key, values in e["quantiles"].items():
        n = int(key.removeprefix("n="))
        p = np.array([float(k) for k in values])
        c = ga.chi_square_level(p, n)
        np.testing.assert_allclose(c, list(values.values()), rtol=1e-8)
        np.testing.assert_allclose(ga.chi_square_probability(c, n), p, rtol=1e-12)
    assert float(ga.chi_square_density(1.0, 3)) == pytest.approx(e["pdf_n3_at_1"], rel=1e-8)
    assert float(ga.chi_square_density(3.0, 5)) == pytest.approx(e["pdf_n5_at_3"], rel=1e-8)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 30, 500])
@pytest.mark.parametrize("noncentrality", [0.0, 1e-300, 1e-8, 9 / 116, 1.0, 10.0, 100.0, 1e4])
def test_noncentral_law_matches_scipy(n, noncentrality):
    from scipy import stats
    law = stats.ncx2(n, noncentrality) if noncentrality else stats.chi2(n)
    x = np.array([1e-10, 0.01, 0.5, 1.0, 3.0, 10.0, 50.0, n + noncentrality])
    expected = law.pdf(x)
    told = expected > 1e-280                               # scipy gives 0 for some densities as large as 1e-20
    np.testing.assert_allclose(ga.chi_square_density(x, n, noncentrality)[told], expected[told], rtol=1e-9)
    p = np.array([1e-6, 0.1, 0.5, 0.68, 0.95, 0.999])
    c = ga.chi_square_level(p, n, noncentrality)
    np.testing.assert_allclose(c, law.ppf(p), rtol=1e-8)
    np.testing.assert_allclose(ga.chi_square_probability(c, n, noncentrality), p, rtol=1e-8)
    assert float(ga.chi_square_level(0.0, n, noncentrality)) == 0.0


@pytest.mark.parametrize(("n", "noncentrality"), [(2, 0.0), (3, 2.5), (5, 40.0)])
def test_exercise_1_12_mean_and_variance(n, noncentrality):
    x = np.linspace(0.0, 400.0, 400_001)
    f = ga.chi_square_density(x, n, noncentrality)
    mass, mean, square = (np.trapezoid(f * x**k, x) for k in (0, 1, 2))
    assert mass == pytest.approx(1.0, abs=1e-6)
    assert mean == pytest.approx(n + noncentrality, rel=1e-6)
    assert square - mean**2 == pytest.approx(2 * (n + 2 * noncentrality), rel=1e-5)


def test_density_at_and_below_zero():
    np.testing.assert_array_equal(ga.chi_square_density([-1.0, 0.0], 1), [0.0, np.inf])
    np.testing.assert_allclose(ga.chi_square_density([-1.0, 0.0], 2, 3.0), [0.0, 0.5 * np.exp(-1.5)], rtol=1e-14)
    np.testing.assert_array_equal(ga.chi_square_density(0.0, 3, [0.0, 1e4]), [0.0, 0.0])


@properties
@given(st.integers(1, 6), st.floats(0.0, 50.0), st.floats(1e-3, 0.99))
def test_levels_broadcast_and_invert(n, noncentrality, p):
    both = ga.chi_square_level([[p], [0.5]], n, [0.0, noncentrality, 1.0])
    assert both.shape == (2, 3)
    np.testing.assert_allclose(ga.chi_square_probability(both, n, [0.0, noncentrality, 1.0]),
                               np.tile([[p], [0.5]], 3), rtol=1e-8)
    assert float(both[0, 0]) == pytest.approx(float(ga.chi_square_level(p, n)), rel=1e-12)
    assert ga.chebyshev_level(p, n) > ga.chi_square_level(p, n)


def test_chebyshev_holds_with_equality_for_points_on_the_level():
    """For n = 1 and p = 8/9: mass 1/18 on each of +-3 sigma and the rest in the middle reaches the bound."""
    assert float(ga.chebyshev_level(8 / 9, 1)) == pytest.approx(9.0, rel=1e-14)
    spread = ga.mixture_moments([1 / 18, 8 / 9, 1 / 18], [[-3.0], [0.0], [3.0]], np.zeros((3, 1, 1)))
    assert float(spread.cov[0, 0]) == pytest.approx(1.0, rel=1e-14)


@properties
@given(st.integers(0, 9999), st.sampled_from([(), (3,), (2, 2)]), st.integers(0, 2), st.integers(4, 40))
def test_ellipse_is_a_closed_line_on_its_level_for_any_rank(seed, batch, rank, points):
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(*batch, 2, rank)) * rng.uniform(0.1, 10.0)
    g, c = Gaussian(rng.normal(size=(*batch, 2)), B @ B.mT), rng.uniform(0.1, 9.0, size=batch)
    line = ga.ellipse(g, c, points)
    assert line.shape == (*batch, points, 2)
    np.testing.assert_array_equal(line[..., 0, :], line[..., -1, :])
    # every direction: no farther than sqrt(c a'Pa), and along the columns of B itself exactly there
    for a in ([1.0, 0.0], [0.6, 0.8]):
        reach = np.abs((line - g.mean[..., None, :]) @ np.array(a)).max(axis=-1)
        bound = np.sqrt(c * np.vecdot(np.array(a), np.matvec(g.cov, a)))
        assert np.all(reach <= bound + 1e-6 * (1 + bound))
    if rank == 2 and np.all(np.linalg.cond(g.cov) < 1e6):
        np.testing.assert_allclose(ga.mahalanobis_squared(Gaussian(g.mean[..., None, :], g.cov[..., None, :, :]), line),
                                   np.broadcast_to(np.asarray(c)[..., None], (*batch, points)), rtol=1e-6)
    if rank == 0:
        np.testing.assert_allclose(line, np.broadcast_to(g.mean[..., None, :], line.shape), rtol=0, atol=1e-14)


def test_singular_ellipse_is_the_segment_between_the_ends_of_its_axis():
    line = ga.ellipse(Gaussian(np.zeros(2), np.array([[1.0, 2.0], [2.0, 4.0]])), 4.0, points=721)
    np.testing.assert_allclose(line[:, 1], 2 * line[:, 0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(np.abs(line).max(axis=0), [2.0, 4.0], rtol=1e-4)


@properties
@given(st.integers(0, 9999), st.integers(1, 4), st.sampled_from([(), (3,), (2, 2)]))
def test_ellipsoid_axes_rebuild_the_covariance(seed, n, batch):
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(*batch, n, n))
    g = Gaussian(rng.normal(size=n), B @ B.mT)
    center, lengths, Q = ga.ellipsoid(g, 2.0)
    assert center.shape == lengths.shape == (*batch, n)
    np.testing.assert_allclose(np.linalg.det(Q), 1.0, rtol=1e-12)
    np.testing.assert_allclose((Q * np.square(lengths)[..., None, :]) @ Q.mT, 2.0 * g.cov, rtol=0, atol=1e-11)
    assert np.all(np.diff(lengths) <= 0)


def test_ellipse_tips_lie_on_the_axes():
    g = Gaussian(np.array([5.0, -1.0]), SIGMA)
    axes = ga.ellipsoid(g, 4.0)
    tips = axes.center[:, None] + axes.directions * axes.semi_axes
    np.testing.assert_allclose(ga.mahalanobis_squared(g, tips.T), 4.0, rtol=1e-12)
    before = SIGMA.copy()
    ga.ellipse(g, 1.0)
    np.testing.assert_array_equal(SIGMA, before)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: ga.chi_square_level(1.0, 2), "probability: expected at least 0 and below 1, got 1"),
    (lambda: ga.chi_square_level(-0.1, 2), "probability: expected at least 0 and below 1, got -0.1"),
    (lambda: ga.chi_square_level(np.nan, 2), "probability: expected finite"),
    (lambda: ga.chi_square_level(0.5, 0), "n: expected a whole number of at least 1, got 0"),
    (lambda: ga.chi_square_level(0.5, 1.5), "n: expected a whole number of at least 1, got 1.5"),
    (lambda: ga.chi_square_level(0.5, 2, -1.0), "noncentrality: expected at least 0, got -1"),
    (lambda: ga.chebyshev_level(1.0, 1), "probability: expected"),
    (lambda: ga.ellipse(Gaussian(np.zeros(3), np.eye(3)), 1.0), "mean: expected shape (..., 2), got (3,)"),
    (lambda: ga.ellipse(Gaussian(np.zeros(2), np.diag([1.0, -1.0])), 1.0), "cov: expected a positive semidefinite"),
    (lambda: ga.ellipse(Gaussian(np.zeros(2), np.eye(2)), -1.0), "level: expected a squared radius of at least 0"),
    (lambda: ga.ellipse(Gaussian(np.zeros(2), np.eye(2)), 1.0, points=3), "points: expected at least 4, got 3"),
    (lambda: ga.ellipsoid(Gaussian(np.zeros(2), np.eye(3)), 1.0), "cov: expected shape (..., 2, 2), got (3, 3)"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
