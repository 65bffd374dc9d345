"""Bancroft and multilateration: the notes' numbers, both rejecting tests, complex and degenerate quadratics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.closed_form import bancroft, multilaterate
from core.frames import dcm_enu_from_ecef, ecef_from_geodetic
from core.sensors import Pseudorange, Range
from tests.oracle import entry

properties = settings(deadline=None, max_examples=40)
TAMPERE = np.radians(61.4498), np.radians(23.856)


def satellites_seen(azimuth_deg, elevation_deg, radius_m=26_560e3):
    """Satellites on a sphere around the Earth in these directions from Tampere, and the user."""
    user, C = ecef_from_geodetic(*TAMPERE, 150.0), dcm_enu_from_ecef(*TAMPERE)
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    d = np.stack([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)], axis=-1) @ C
    b = d @ user
    return user + (np.sqrt(b * b - user @ user + radius_m**2) - b)[:, None] * d, user


def test_oracle_C2_04_both_roots_and_the_sign_test():
    e = entry("C2-04")
    fix = bancroft(e["inputs"]["satellites"], e["inputs"]["pseudoranges"])
    one, two = e["expected"]["root1"], e["expected"]["root2"]
    np.testing.assert_allclose(fix.lambdas, e["expected"]["lambda_roots"], rtol=1e-9)
    np.testing.assert_allclose(fix.roots[0], [*one["x"], one["b"]], rtol=0, atol=1e-2)
    np.testing.assert_allclose(fix.roots[1], [*two["x"], two["b"]], rtol=1e-7)
    y = np.array(e["inputs"]["pseudoranges"])
    np.testing.assert_allclose(y - fix.roots[1, 3], e["expected"]["y_minus_b_root2"], rtol=1e-7)
    np.testing.assert_allclose(fix.residuals[1], e["expected"]["residuals_root2"], rtol=1e-7)
    assert fix.residual_norms[0] < 1e-3 < fix.residual_norms[1]
    assert fix.admissible.tolist() == [True, False]
    # Erratum M29: the second root is below the satellites, at 9890 km, and only the sign test rejects it.
    assert fix.sign_ok.tolist() == [True, False] and fix.radius_ok.tolist() == [True, True]
    assert np.linalg.norm(fix.roots[1, :3]) == pytest.approx(9890.5e3, rel=1e-4)
    np.testing.assert_array_equal(fix.best, fix.roots[0])


def test_oracle_C2_05_five_satellites():
    e = entry("C2-05")
    fix = bancroft(e["inputs"]["satellites"], e["inputs"]["pseudoranges"])
    one = e["expected"]["root1"]
    np.testing.assert_allclose(fix.roots[0], [*one["x"], one["b"]], rtol=0, atol=1e-2)
    np.testing.assert_allclose(fix.lambdas, e["expected"]["lambda_roots"], rtol=1e-9)
    assert fix.admissible.tolist() == [True, False]
    a, b, c = fix.quadratic
    np.testing.assert_allclose(a * fix.lambdas**2 + b * fix.lambdas + c, 0.0, atol=1e-9 * abs(c))
    np.testing.assert_allclose(fix.roots, fix.lambdas[:, None] * fix.p + fix.q, rtol=1e-9)


def test_oracle_C2_12_two_ranges():
    e = entry("C2-12")
    fix = multilaterate(e["inputs"]["stations"], e["inputs"]["y"])
    np.testing.assert_allclose(fix.lambdas, e["expected"]["lam"], rtol=1e-10)
    np.testing.assert_allclose(fix.roots, [e["expected"]["A"], e["expected"]["B"]], rtol=0, atol=1e-8)
    np.testing.assert_allclose(fix.residual_norms, 0.0, atol=1e-9)
    assert fix.admissible.all()                            # mirror images: the measurements cannot tell them apart
    np.testing.assert_allclose(np.square(fix.roots).sum(axis=-1), fix.lambdas, rtol=1e-10)


def test_a_root_in_outer_space_passes_the_sign_test_and_fails_the_radius_test():
    s, user = satellites_seen([69.0, 236.0, 43.0, 108.0], [46.0, 56.0, 60.0, 26.0])
    y = Pseudorange(s, 1.0).h(np.append(user, 85_347.0))
    fix = bancroft(s, y)
    assert fix.sign_ok.all() and fix.residual_norms.max() < 1e-3       # both solve the unsquared equations
    assert fix.radius_ok.tolist() == fix.admissible.tolist() == [True, False]
    np.testing.assert_allclose(fix.best[:3], user, atol=1e-2)
    assert bancroft(s, y, max_radius_m=1e9).admissible.all()
    assert not bancroft(s, y, max_radius_m=6e6).admissible.any()
    assert np.isnan(bancroft(s, y, max_radius_m=6e6).best).all()
    local = bancroft(s / 1e5, y / 1e5)                     # nothing says that this is the Earth: no limit
    assert local.radius_ok.all()


def test_complex_roots_are_not_admissible_and_leave_a_start():
    fix = multilaterate([[0.0, 10.0], [100.0, 10.0]], [50.0, 40.0])
    assert np.isnan(fix.roots).all() and np.isnan(fix.residual_norms).all()
    assert not fix.admissible.any() and np.isnan(fix.best).all()
    np.testing.assert_allclose(fix.middle, [54.5, 10.0], atol=1e-9)    # the radical axis on the line of the stations
    touching = multilaterate([[0.0, 10.0], [100.0, 10.0]], [60.0, 40.0])
    np.testing.assert_allclose(touching.roots, [[60.0, 10.0]] * 2, atol=1e-4)


def test_degenerate_quadratic_has_one_root():
    """Pseudoranges of a source infinitely far away: lambda^2 drops out, and one root is at infinity."""
    s = np.array([[3.0, 1.0], [-2.0, 5.0], [4.0, -6.0]])
    u = np.array([0.6, 0.8])
    fix = bancroft(s, 20.0 - s @ u)
    assert np.isfinite(fix.roots[0]).all() and np.isnan(fix.roots[1]).all() and not fix.admissible[1]
    square = np.square(fix.roots[0, :2] - s).sum(axis=1)
    np.testing.assert_allclose(square, np.square(20.0 - s @ u - fix.roots[0, 2]), rtol=1e-9)
    symmetric = multilaterate([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]], np.sqrt([2.0, 2.0, 1.0, 5.0]))
    np.testing.assert_allclose(symmetric.roots[0], [0.0, 1.0], atol=1e-12)             # p = 0: linear in lambda
    assert symmetric.admissible.tolist() == [True, False]


@pytest.mark.parametrize("n", [2, 3])
def test_stations_in_a_plane_through_the_origin(n):
    """The notes' matrix is singular there, the geometry is not: the roots are mirror images."""
    rng = np.random.default_rng(n)
    s = rng.normal(size=(n, n)) * 50
    s[:, -1] = 0.0
    x = rng.normal(size=n) * 30
    fix = multilaterate(s, np.linalg.norm(s - x, axis=1))
    mirror = x * np.append(np.ones(n - 1), -1.0)
    order = np.argsort(fix.roots[:, -1])
    np.testing.assert_allclose(fix.roots[order], np.stack(sorted([x, mirror], key=lambda v: v[-1])), atol=1e-6)
    np.testing.assert_allclose(fix.roots, fix.origin + fix.lambdas[:, None] * fix.p + fix.q, atol=1e-9)
    s = np.append(s, [[30.0, *np.zeros(n - 1)]], axis=0)
    y = np.linalg.norm(s - x, axis=1) + 7.0
    both = bancroft(s, y)
    assert both.admissible.any() and both.residual_norms.min() < 1e-8
    assert np.abs(both.roots - np.append(x, 7.0)).max(axis=-1).min() < 1e-6


@properties
@given(st.integers(0, 10_000), st.integers(2, 3), st.integers(0, 2))
def test_noise_free_measurements_give_the_truth_back_anywhere(seed, n, extra):
    rng = np.random.default_rng(seed)
    shift = rng.normal(size=n) * 200
    s, x, b = rng.normal(size=(n + 1 + extra, n)) * 100, rng.normal(size=n) * 30, rng.normal() * 10
    for move in (0.0, shift):
        y = Pseudorange(s + move, 1.0).h(np.append(x + move, b))
        fix = bancroft(s + move, y)
        assert np.abs(fix.roots - np.append(x + move, b)).max(axis=-1).min() < 1e-5
        ranges = multilaterate(s + move, Range(s, 1.0).h(x))
        np.testing.assert_allclose(ranges.roots[np.nanargmin(ranges.residual_norms)], x + move, atol=1e-5)
        np.testing.assert_array_equal(ranges.best, ranges.roots[np.nanargmin(ranges.residual_norms)])


@properties
@given(st.integers(0, 10_000), st.sampled_from([(3,), (2, 2), (1,)]))
def test_batch_equals_loop_and_inputs_stay(seed, batch):
    rng = np.random.default_rng(seed)
    s, y = rng.normal(size=(*batch, 5, 3)) * 100, rng.uniform(10, 200, size=(*batch, 5))
    flat = s[(0,) * len(batch)]
    before = s.copy(), y.copy()
    for solve in (bancroft, multilaterate):
        many, shared = solve(s, y), solve(flat, y)
        for index in np.ndindex(batch):
            one = solve(s[index], y[index])
            for field in one._fields:
                np.testing.assert_allclose(getattr(many, field)[index], getattr(one, field), rtol=1e-7, atol=1e-6)
            one = solve(flat, y[index])
            np.testing.assert_allclose(shared.roots[index], one.roots, rtol=1e-7, atol=1e-6)
            np.testing.assert_allclose(shared.best[index], one.best, rtol=1e-7, atol=1e-6)
    np.testing.assert_array_equal(s, before[0])
    np.testing.assert_array_equal(y, before[1])


@pytest.mark.parametrize("solve", [bancroft, multilaterate])
@pytest.mark.parametrize(("stations", "y", "message"), [
    (np.eye(3)[:2], [1.0, 1.0], "at least"),
    (np.ones((5, 3)), np.ones(5), "one point"),
    (np.arange(5.0)[:, None] * [1.0, 2.0, 3.0], np.arange(5.0), "one line"),
    (np.eye(3)[[0, 1, 2, 0]], [1.0, np.nan, 1.0, 1.0], "finite"),
    (np.eye(3)[[0, 1, 2, 0]], [1.0, 1.0, 1.0], "shape"),
    (np.zeros(3), [1.0], "shape"),
    (np.ones((2, 5, 3)), np.ones((3, 5)), "batch axes"),
])
def test_bad_input(solve, stations, y, message):
    with pytest.raises(ValueError, match=message):
        solve(stations, y)


def test_bad_radius():
    with pytest.raises(ValueError, match="max_radius_m"):
        multilaterate([[100.0, 0.0], [0.0, 50.0]], [108.0, 46.0], max_radius_m=0.0)
