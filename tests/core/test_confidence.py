"""Confidence sets: Chebyshev's bounds against exact laws, repeated experiments, sets of cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import confidence as co
from core.gaussian import sample
from core.grid import GridDensity, cells, from_gaussian, from_log_density, gaussian_axes
from core.levels import chebyshev_level, chi_square_level, chi_square_probability
from core.types import Gaussian
from tests.oracle import entry

properties = settings(deadline=None, max_examples=40)
SIGMA = np.array([[16.0, 24.0], [24.0, 52.0]])


def test_oracle_C2_38_chebyshev_and_normal():
    e = entry("C2-38")
    lam, expected = np.array(e["inputs"]["lam"], dtype=float), e["expected"]
    np.testing.assert_allclose(co.chebyshev_tail(lam), expected["bound"], rtol=1e-6)
    np.testing.assert_allclose(co.normal().tail(lam), expected["normal"], rtol=1e-6)
    radius = co.chebyshev_radius(SIGMA, 1 - co.chebyshev_tail(2.0))
    assert float(radius) == pytest.approx(2 * np.sqrt(68.0))
    assert float(co.normal_radius_tail(SIGMA, radius)) == pytest.approx(expected["norm2d_exact"], rel=1e-6)


def test_oracle_C2_39_ellipsoids_for_any_law():
    e = entry("C2-39")
    p, expected = e["inputs"]["p"], e["expected"]
    for n, bound, exact in zip(e["inputs"]["n"], expected["bound"], expected["normal"], strict=True):
        g = Gaussian(np.zeros(n), np.eye(n))
        assert float(chebyshev_level(p, n)) == pytest.approx(bound, rel=1e-8)
        assert float(chi_square_level(p, n)) == pytest.approx(exact, rel=1e-8)
        np.testing.assert_allclose(co.confidence_ellipsoid(g, p, any_law=True).semi_axes, np.sqrt(bound), rtol=1e-8)
        np.testing.assert_allclose(co.confidence_ellipsoid(g, p).semi_axes, np.sqrt(exact), rtol=1e-8)
        assert np.sqrt(bound / n) == pytest.approx(expected["lam"], rel=1e-8)
        assert float(co.chebyshev_tail(np.sqrt(bound / n))) == pytest.approx(1 - p)
    g = Gaussian(np.ones(2), SIGMA)
    wide, narrow = co.confidence_ellipsoid(g, p, any_law=True), co.confidence_ellipsoid(g, p)
    np.testing.assert_allclose(wide.semi_axes / narrow.semi_axes, expected["axis_ratio_n2"], rtol=1e-8)
    assert float(chi_square_probability(40.0, 2)) == pytest.approx(1 - np.exp(-20.0), rel=1e-12)


def test_oracle_C2_41_equality():
    e = entry("C2-41")
    lam, expected = float(e["inputs"]["lam"]), e["expected"]
    points, masses = co.extremal_masses(lam)
    np.testing.assert_array_equal(points, expected["points"])
    np.testing.assert_array_equal(masses, expected["masses"])
    assert masses @ points**2 == expected["variance"] and masses @ points == 0.0
    law = co.extremal(lam)
    assert float(law.tail(lam)) == float(co.chebyshev_tail(lam))        # the bound is attained
    assert float(law.tail(lam + 1e-9)) == 0.0
    z = law.sample(np.random.default_rng(1), 20_000)
    assert np.mean(np.abs(z) >= lam) == pytest.approx(0.25, abs=0.0138)  # 4.5 standard errors: 7e-6
    assert float(co.extremal(1.0).tail(1.0)) == 1.0         # exercise 2.15(b): P(|x - mu| >= sd) = 1
    np.testing.assert_allclose([float(law.level(q)) for q in (0.5, 0.75, 0.76)], [0.0, 0.0, 2.0])


def test_exercise_2_15_laplace():
    """f(x) = exp(-|x|) / 2 with sd sqrt 2: the exact 67 % interval is -+ ln 3.03, Chebyshev's is twice as wide."""
    exact = co.interval(0.0, np.sqrt(2.0), 0.67, co.laplace())
    np.testing.assert_allclose(exact, [np.log(0.33), -np.log(0.33)], rtol=1e-12)
    np.testing.assert_allclose(co.chebyshev_interval(0.0, np.sqrt(2.0), 0.67), np.sqrt(2 / 0.33) * np.array([-1, 1]))


@pytest.mark.parametrize("name", [*co.LAWS, "extremal"])
def test_laws_are_consistent_and_below_the_bound(name):
    """20,000 samples; tails within 5 standard errors at 6 points: false alarm rate below 1e-5."""
    law = co.extremal(1.5) if name == "extremal" else co.LAWS[name]()
    z = law.sample(np.random.default_rng(7), (200, 100)).ravel()
    lam = np.array([0.3, 0.8, 1.2, 1.6, 2.5, 4.0])
    tail = law.tail(lam)
    assert np.all(tail <= co.chebyshev_tail(lam) + 1e-15)
    share = np.mean(np.abs(z)[:, None] >= lam, axis=0)
    assert np.all(np.abs(share - tail) <= 5 * np.sqrt(tail * (1 - tail) / z.size) + 1e-12)
    if name != "student":                                  # whose fourth moment is infinite
        assert np.mean(z**2) == pytest.approx(1.0, abs=0.06)
    p = np.array([0.1, 0.5, 0.9, 0.99])
    if name != "extremal":
        np.testing.assert_allclose(law.tail(law.level(p)), 1 - p, rtol=1e-9)
    assert np.all(1 - law.tail(law.level(p) * (1 + 1e-9) + 1e-12) >= p - 1e-7)


@pytest.mark.parametrize("name", [*co.LAWS, "extremal"])
def test_repeated_intervals_cover_the_truth(name):
    """4000 experiments, one measurement each; 4.5 standard errors: false alarm rate 7e-6 for each law."""
    law = co.extremal(2.0) if name == "extremal" else co.LAWS[name]()
    truth, sd = 3.0, 2.0
    x = truth + sd * law.sample(np.random.default_rng(11), 4000)
    bound = co.chebyshev_interval(x, sd, 0.75)
    sure = co.repeated(bound[:, 0] - 1e-9, bound[:, 1] + 1e-9, truth)
    assert sure.inside.shape == (4000,)
    assert sure.rate >= 0.75 - 4.5 * np.sqrt(0.75 * 0.25 / 4000)
    if name != "extremal":
        exact = co.interval(x, sd, 0.75, law)
        got = co.repeated(*exact.T, truth)
        assert got.rate == pytest.approx(0.75, abs=4.5 * np.sqrt(0.75 * 0.25 / 4000))
        assert got.standard_error == pytest.approx(np.sqrt(0.75 * 0.25 / 4000), rel=0.1)


@properties
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.01, 1.0, 5.0, 40.0]))
def test_circle_probability(seed, radius):
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(2, 2)) * [[3.0], [1.0]]
    P = B @ B.T + 0.3 * np.eye(2)
    tail = float(co.normal_radius_tail(P, radius))
    assert 0.0 <= tail <= 1.0 + 1e-12
    if radius:
        assert tail <= min(1.0, np.trace(P) / radius**2) + 1e-12       # Chebyshev in the plane
    assert float(co.normal_radius_tail(P, 0.0)) == pytest.approx(1.0, rel=1e-9)
    C = np.array([[0.6, -0.8], [0.8, 0.6]])
    assert float(co.normal_radius_tail(C @ P @ C.T, radius)) == pytest.approx(tail, rel=1e-6, abs=1e-15)


def test_circle_probability_by_sampling():
    """20,000 samples, 4.5 standard errors: false alarm rate 7e-6."""
    x = sample(Gaussian(np.zeros(2), SIGMA), 20_000, np.random.default_rng(3))
    p = float(co.normal_radius_tail(SIGMA, 10.0))
    assert np.mean(np.linalg.norm(x, axis=1) >= 10.0) == pytest.approx(p, abs=4.5 * np.sqrt(p * (1 - p) / 20_000))


def test_highest_density_of_a_normal_law_is_its_ellipse():
    g = Gaussian(np.array([1.0, -2.0]), SIGMA)
    p = from_gaussian(g, gaussian_axes(g, 300))
    found = co.highest_density(p, 0.68)
    c = float(chi_square_level(0.68, 2))
    assert found.probability == pytest.approx(0.68, abs=1e-3) and found.probability >= 0.68
    assert found.volume == pytest.approx(np.pi * c * np.sqrt(np.linalg.det(SIGMA)), rel=5e-3)
    assert found.threshold == pytest.approx(0.32 * p.density.max(), rel=5e-3)
    d = p.points - g.mean
    inside = np.einsum("...i,...i->...", d, np.linalg.solve(SIGMA, d[..., None])[..., 0]) <= c
    assert np.mean(inside != found.inside) < 2e-3


def test_sets_of_a_law_with_two_peaks():
    p = from_log_density([cells(-10.0, 10.0, 2000)],
                         lambda x: np.logaddexp(-2 * (x[..., 0] + 5) ** 2, -2 * (x[..., 0] - 5) ** 2))
    low, high = co.grid_interval(p, 0.9)
    found = co.highest_density(p, 0.9)
    assert found.inside.astype(int)[1:] @ (1 - found.inside.astype(int)[:-1]) == 2       # two parts
    assert found.volume < 0.35 * (high - low)
    assert p.weights[(p.axes[0] >= low) & (p.axes[0] <= high)].sum() == pytest.approx(0.9, abs=2e-3)
    flat = co.highest_density(GridDensity(np.arange(4.0), np.ones(4)), 0.6)
    assert flat.inside.all() and flat.probability == pytest.approx(1.0)                 # equal cells stay together
    assert co.highest_density(p, 0.0).inside.sum() == 4    # the tops of both peaks, each between two cells


def test_batches_and_inputs_stay():
    mean, sd = np.array([[0.0], [1.0]]), np.array([1.0, 2.0, 3.0])
    before = mean.copy(), sd.copy()
    many = co.interval(mean, sd, 0.9)
    assert many.shape == (2, 3, 2)
    np.testing.assert_allclose(many[1, 2], co.interval(1.0, 3.0, 0.9))
    np.testing.assert_allclose(co.chebyshev_interval(mean, sd, 0.9)[1, 2], co.chebyshev_interval(1.0, 3.0, 0.9))
    np.testing.assert_array_equal(mean, before[0])
    np.testing.assert_array_equal(sd, before[1])
    stack = np.stack([SIGMA, np.eye(2)])
    np.testing.assert_allclose(co.chebyshev_radius(stack, 0.75), [np.sqrt(272.0), np.sqrt(8.0)])


FLAT = GridDensity(np.arange(4.0), np.ones(4))


@pytest.mark.parametrize(("call", "message"), [
    (lambda: co.interval(0.0, -1.0, 0.9), "sd"),
    (lambda: co.interval(0.0, 1.0, 1.0), "probability"),
    (lambda: co.chebyshev_interval(0.0, 1.0, -0.1), "probability"),
    (lambda: co.chebyshev_interval(np.nan, 1.0, 0.5), "finite"),
    (lambda: co.chebyshev_tail(0.0), "lam"),
    (lambda: co.extremal(0.9), "lam"),
    (lambda: co.student(2.0), "degrees of freedom"),
    (lambda: co.chebyshev_radius(-np.eye(2), 0.5), "semidefinite"),
    (lambda: co.normal_radius_tail(np.eye(3), 1.0), "shape"),
    (lambda: co.normal_radius_tail(np.diag([1.0, 0.0]), 1.0), "positive definite"),
    (lambda: co.normal_radius_tail(np.eye(2), -1.0), "radii"),
    (lambda: co.highest_density(FLAT, 1.0), "probability"),
    (lambda: co.grid_interval(FLAT, 0.5, component=1), "component"),
    (lambda: co.repeated(0.0, np.nan, 1.0), "finite"),
])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
