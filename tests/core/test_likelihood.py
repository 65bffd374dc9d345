"""Likelihood maps, maximum likelihood, the linearised posterior."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.gauss_newton import gauss_newton
from core.grid import cells, moments
from core.likelihood import (
    likelihood_map,
    linearised_posterior,
    residual_norm,
    states_on_grid,
    weighted_cost,
)
from core.sensors import Bearing, Linear, Position, Pseudorange, Quantised, Range, Stack
from tests.oracle import entry

properties = settings(deadline=None, max_examples=30)
THREE = [[10.0, 5.0], [120.0, 0.0], [40.0, 90.0]]


def test_oracle_C2_30_maximum_likelihood_is_weighted_least_squares():
    e, data = entry("C2-30"), entry("C2-14")["inputs"]
    sensor, x = Range(data["stations"], [1.0, 5.0, 10.0]), np.array([50.0, 30.0])
    assert float(weighted_cost(sensor, data["y"], x)) == pytest.approx(e["expected"]["wls_cost"], rel=1e-9)
    picture = likelihood_map(sensor, data["y"], [cells(30.0, 70.0, 200), cells(10.0, 60.0, 250)])
    cost = weighted_cost(sensor, data["y"], picture.points)
    np.testing.assert_allclose(picture.log_likelihood + 0.5 * cost, picture.log_likelihood[0, 0] + 0.5 * cost[0, 0],
                               rtol=1e-9)
    best = gauss_newton(sensor, data["y"], x, tolerance=1e-9)
    np.testing.assert_allclose(picture.peak, best.x, atol=0.05)


def test_oracle_C2_30_ring_wedge_and_bump():
    e = entry("C2-30")
    i, expected = e["inputs"], e["expected"]
    sensor = Stack([Range([i["station"]], i["sd_range"]),
                    Bearing([i["station"]], np.radians(i["sd_bearing_deg"]))])
    y = [i["range"], np.radians(i["bearing_deg"])]
    axes = [cells(-80.0, 80.0, 1600), cells(-80.0, 80.0, 1600)]
    picture = likelihood_map(sensor, y, axes)
    ring, wedge = np.exp(picture.parts - picture.parts.max(axis=(1, 2), keepdims=True))
    np.testing.assert_allclose(picture.peak, expected["peak"], atol=0.05)
    np.testing.assert_allclose(picture.relative, ring * wedge / (ring * wedge).max(), atol=1e-12)
    a, b = (np.searchsorted(axis, v) for axis, v in zip(axes, i["x"], strict=True))
    assert ring[a, b] == pytest.approx(expected["range_lik"], abs=1e-3)
    assert wedge[a, b] == pytest.approx(expected["bearing_lik"], abs=5e-3)
    exact = likelihood_map(sensor, y, [np.array([i["x"][0], 43.301270189222]), np.array([25.0, i["x"][1]])])
    ratio = np.exp(exact.parts[:, 0, 1] - exact.parts[:, 1, 0])         # at x, relative to the peak
    np.testing.assert_allclose(ratio, [expected["range_lik"], expected["bearing_lik"]], rtol=1e-9)


def test_exercise_2_11_five_quantised_readings():
    """y = floor(x + v): the maximum of a product of five bumps, not the mean of the readings."""
    y = np.array([[0.0], [-2.0], [-1.0], [0.0], [-1.0]])
    picture = likelihood_map(Quantised(0.5), y, [cells(-4.0, 4.0, 8000)])
    from scipy.optimize import minimize_scalar
    from scipy.special import ndtr
    k = y[:, 0]
    found = minimize_scalar(lambda x: -np.log(ndtr(2 * (k + 1 - x)) - ndtr(2 * (k - x))).sum(),
                            bounds=(-3, 2), method="bounded", options={"xatol": 1e-10})
    assert float(picture.peak[0]) == pytest.approx(found.x, abs=1e-6)
    assert abs(found.x - k.mean()) > 0.3                   # the bump of reading k stands at k + 1/2
    one_by_one = sum(likelihood_map(Quantised(0.5), one, picture.axes).log_likelihood for one in y)
    np.testing.assert_allclose(picture.log_likelihood, one_by_one, rtol=1e-12)


def test_oracle_C2_37_linearised_posterior():
    e = entry("C2-37")
    i, expected = e["inputs"], e["expected"]
    sensor, x = Range(i["stations"], i["sigma"]), np.array(i["x_true"])
    g = linearised_posterior(sensor, sensor.h(x) + i["dy"], x)
    np.testing.assert_allclose(g.mean, expected["lin_mean"], atol=1e-8)
    np.testing.assert_allclose(g.cov, expected["lin_cov"], atol=1e-8)
    quiet = linearised_posterior(sensor, sensor.h(x), x)   # only the mean depends on dy
    np.testing.assert_allclose(quiet.cov, g.cov, rtol=1e-12)
    np.testing.assert_allclose(quiet.mean, x, atol=1e-12)
    exact = moments(likelihood_map(sensor, sensor.h(x) + i["dy"], [cells(20, 85, 260), cells(-5, 65, 280)]).posterior)
    assert np.abs(exact.cov - g.cov).max() > 1.0           # what the linearisation does not see


def test_oracle_C2_17_surface_of_the_residual_norm():
    e = entry("C2-17")
    sensor = Range(e["inputs"]["stations"], 1.0)
    for point, value in e["expected"]["residual_norm"].items():
        x = [float(v) for v in point.strip("[]").split(",")]
        assert float(residual_norm(sensor, e["inputs"]["y"], x)) == pytest.approx(value, rel=1e-9)


@properties
@given(st.integers(0, 10_000))
def test_map_equals_loop_and_inputs_stay(seed):
    rng = np.random.default_rng(seed)
    sats = rng.normal(size=(5, 2)) * 50
    sensor = Stack([Pseudorange(sats[:3], 2.0), Range(sats[3:], [1.0, 3.0])])
    axes, base = [np.linspace(-9, 9, 4), np.linspace(0, 5, 3)], np.array([7.0, 8.0, 2.5])
    y = rng.uniform(10, 80, size=(2, 5))
    before = y.copy(), base.copy()
    picture = likelihood_map(sensor, y, axes, base=base)
    assert picture.parts.shape == (2, 4, 3) and picture.points.shape == (4, 3, 3)
    for i in np.ndindex(4, 3):
        x = np.array([axes[0][i[0]], axes[1][i[1]], 2.5])
        np.testing.assert_array_equal(picture.points[i], x)
        assert picture.log_likelihood[i] == pytest.approx(sum(sensor.log_likelihood(one, x) for one in y))
    np.testing.assert_array_equal(y, before[0])
    np.testing.assert_array_equal(base, before[1])
    many = linearised_posterior(sensor, y[0], picture.points)
    one = linearised_posterior(sensor, y[0], picture.points[1, 2])
    np.testing.assert_allclose(many.mean[1, 2], one.mean, rtol=1e-9)
    np.testing.assert_allclose(many.cov[1, 2], one.cov, rtol=1e-9)


def test_states_on_grid_can_fill_any_components():
    x = states_on_grid([[1.0, 2.0], [3.0, 4.0, 5.0]], base=[9.0, 8.0, 7.0], components=[2, 0])
    assert x.shape == (2, 3, 3)
    np.testing.assert_array_equal(x[1, 2], [5.0, 8.0, 2.0])
    assert x[..., 0].flags.c_contiguous                    # a plain array for the sensors


@pytest.mark.parametrize(("call", "message"), [
    (lambda: states_on_grid([[1.0, 2.0]], base=[0.0, 1.0], components=[2]), "components"),
    (lambda: states_on_grid([[1.0, 2.0], [1.0, 2.0]], base=[0.0, 1.0], components=[0]), "components"),
    (lambda: likelihood_map(Position(1, 1.0), [1.0, 2.0], [[0.0, 1.0]]), "shape"),
    (lambda: likelihood_map(Position(1, 1.0), np.zeros((2, 2, 1)), [[0.0, 1.0]]), "shape"),
    (lambda: likelihood_map(Position(1, 1.0), [np.nan], [[0.0, 1.0]]), "finite"),
    (lambda: likelihood_map(Position(2, 1.0), [1.0, 2.0], [[0.0, 1.0]]), "shape"),
    (lambda: weighted_cost(Linear([[1.0]], 0.0), [1.0], [0.0]), "positive definite"),
    (lambda: linearised_posterior(Range(THREE, 1.0), [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), "every component"),
    (lambda: residual_norm(Range(THREE, 1.0), [1.0, 2.0], [1.0, 2.0]), "shape"),
])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
