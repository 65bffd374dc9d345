"""Signal strengths, radio maps and learning: oracle G-10."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm, t

from core.indoor import (
    AccessPoints,
    coverage_area,
    fit_path_loss,
    locate_access_point,
    office_building,
    radio_map,
)
from core.sensors import SignalStrength
from tests.core.indoor.maps import M0
from tests.oracle import entry

XY = np.array([[0.0, 0.0], [10.0, 5.0], [-20.0, 30.0]])
POINTS = AccessPoints(XY, floor=[0, 1, 0], power_dbm=[-40, -35, -45], exponent=[2.5, 2.0, 3.0], sigma_db=[6, 4, 8.0])


def places(N=40, seed=1):
    rng = np.random.default_rng(seed)
    floor = rng.integers(0, 3, N)
    return np.column_stack([rng.uniform(-30, 30, (N, 2)), 4.0 * floor]), floor


def test_path_loss():                                                                    # oracle G-10
    e = entry("G-10")
    i, want = e["inputs"], e["expected"]
    one = AccessPoints([[0, 0]], power_dbm=i["A"], exponent=i["n"], sigma_db=i["sigma"])
    x = np.array([[d, 0.0, 0.0] for d in i["d"]])
    assert one.expected(x, 0)[:, 0] == pytest.approx(want["mu"], rel=1e-9)
    at_ten = one.log_likelihood([i["y"]], np.array([[10.0, 0.0, 0.0]]), np.array([0]))
    assert at_ten == pytest.approx([want["logpdf"]], rel=1e-9)
    assert np.exp(at_ten) == pytest.approx([want["pdf"]], rel=1e-9)
    d = np.linspace(10, 30, 200_001)
    ll = one.log_likelihood([i["y"]], np.column_stack([d, 0 * d, 0 * d]), np.zeros(len(d)))
    assert d[ll.argmax()] == pytest.approx(want["d_ml"], abs=1e-3)
    assert one.expected([[0.2, 0.1, 0.0], [1.0, 0.0, 0.0]], 0)[:, 0].tolist() == [-40.0, -40.0]


def test_floors_count_as_height_and_as_walls():
    x = np.array([[6.0, 8.0, 0.0], [6.0, 8.0, 4.0], [6.0, 8.0, 8.0]])
    mu = AccessPoints([[0, 0]]).expected(x, np.array([0, 1, 2]))[:, 0]
    assert mu == pytest.approx([-40 - 12.5 * np.log10(100 + 16 * f * f) - 12 * f for f in range(3)])
    assert AccessPoints([[0, 0]], floor=-1).expected([6.0, 8.0, 0.0], 0) == pytest.approx(
        [-40 - 12.5 * np.log10(116) - 12])


def test_on_one_floor_it_is_the_sensor_of_core():
    sensor = SignalStrength(XY, [-40, -35, -45], [2.5, 2.0, 3.0], [6, 4, 8.0])
    flat = AccessPoints(XY, power_dbm=[-40, -35, -45], exponent=[2.5, 2.0, 3.0], sigma_db=[6, 4, 8.0])
    x, y = places()[0][:, :2], np.array([-70.0, -60.0, -80.0])
    at = np.column_stack([x, np.zeros(len(x))])
    np.testing.assert_allclose(flat.expected(at, np.zeros(len(x))), sensor.h(x), rtol=1e-12)
    np.testing.assert_allclose(flat.log_likelihood(y, at, np.zeros(len(x))), sensor.log_likelihood(y, x), rtol=1e-12)
    y[1] = np.nan
    np.testing.assert_allclose(flat.log_likelihood(y, at, np.zeros(len(x))), sensor.log_likelihood(y, x), rtol=1e-12)


def test_each_access_point_has_its_own_law():
    x, floor = places()
    y = np.array([-70.0, -55.0, -80.0])
    mu = POINTS.expected(x, floor)
    assert mu.shape == (40, 3)
    np.testing.assert_allclose(POINTS.log_likelihood(y, x, floor), norm.logpdf(y, mu, POINTS.sigma_db).sum(axis=1))
    part = norm.logpdf(y, mu, POINTS.sigma_db)[:, [0, 2]].sum(axis=1)
    np.testing.assert_allclose(POINTS.log_likelihood([-70, np.nan, -80], x, floor), part)
    assert (POINTS.log_likelihood([np.nan] * 3, x, floor) == 0.0).all()


def test_batches_and_layouts():
    x, floor = places(12)
    y = [-70.0, np.nan, -80.0]
    flat = POINTS.log_likelihood(y, x, floor)
    shaped = POINTS.log_likelihood(y, x.reshape(3, 4, 3), floor.reshape(3, 4))
    assert (shaped == flat.reshape(3, 4)).all()
    assert (POINTS.log_likelihood(y, np.asfortranarray(x), floor) == flat).all()
    assert POINTS.expected(x.reshape(3, 4, 3), floor.reshape(3, 4)).shape == (3, 4, 3)
    one = POINTS.log_likelihood(y, x[0], floor[0])
    assert one.shape == () and one == flat[0]


def test_silence_censored():
    censored = dataclasses.replace(POINTS, unheard="censored", threshold_dbm=-75.0)
    x, floor = places()
    mu = POINTS.expected(x, floor)
    want = norm.logpdf(-70, mu[:, 0], 6) + norm.logcdf(-75, mu[:, 1], 4) + norm.logpdf(-80, mu[:, 2], 8)
    np.testing.assert_allclose(censored.log_likelihood([-70, np.nan, -80], x, floor), want)
    silent = censored.log_likelihood([np.nan] * 3, x, floor)
    np.testing.assert_allclose(silent, norm.logcdf(-75, mu, POINTS.sigma_db).sum(axis=1))


def test_heavy_tails_and_tempering():
    x, floor = places()
    y = np.array([-70.0, -55.0, -80.0])
    mu = POINTS.expected(x, floor)
    heavy = AccessPoints(XY, [0, 1, 0], [-40, -35, -45], [2.5, 2.0, 3.0], [6, 4, 8.0], freedom=5.0)
    np.testing.assert_allclose(heavy.log_likelihood(y, x, floor), t.logpdf(y, 5, mu, POINTS.sigma_db).sum(axis=1))
    tempered = AccessPoints(XY, [0, 1, 0], [-40, -35, -45], [2.5, 2.0, 3.0], [6, 4, 8.0], most_independent=2.0)
    np.testing.assert_allclose(tempered.log_likelihood(y, x, floor), POINTS.log_likelihood(y, x, floor) * 2 / 3)
    assert (tempered.log_likelihood([-70, np.nan, -80], x, floor)
            == POINTS.log_likelihood([-70, np.nan, -80], x, floor)).all()


@pytest.mark.parametrize("freedom", [None, 5.0])
def test_the_typical_log_likelihood_is_the_mean_at_the_truth(freedom):
    points = AccessPoints(XY, sigma_db=[6, 4, 8.0], freedom=freedom)
    rng = np.random.default_rng(3)
    z = rng.standard_normal((4000, 3)) if freedom is None else rng.standard_t(freedom, (4000, 3))
    x = np.array([3.0, 4.0, 0.0])
    ys = points.expected(x, 0) + z * points.sigma_db
    ll = np.array([points.log_likelihood(y, x, np.array(0)) for y in ys])
    # sd of the mean about 0.02; 4.5 sd: false alarm 7e-6
    assert ll.mean() == pytest.approx(points.typical_log_likelihood(ys[0]), abs=4.5 * ll.std() / np.sqrt(4000))


def test_extreme_scans_do_not_underflow():
    x, floor = places()
    ll = POINTS.log_likelihood([-1e5, 1e5, 0.0], x, floor)
    assert np.isfinite(ll).all() and ll.max() < -1e6


def test_radio_map():
    rm = radio_map(M0, POINTS, cell_m=2.5, margin_m=5.0)
    assert rm.rss_dbm.shape == (3, len(rm.y_m), len(rm.x_m))
    assert rm.x_m[0] == -5.0 and rm.x_m[-1] == 50.0 and rm.y_m[0] == -5.0 and rm.y_m[-1] == 15.0
    j, k = 3, 7
    np.testing.assert_allclose(rm.rss_dbm[:, j, k], POINTS.expected([rm.x_m[k], rm.y_m[j], 0.0], 0))
    above = radio_map(office_building(), POINTS, 1)
    np.testing.assert_allclose(above.rss_dbm[:, 0, 0], POINTS.expected([above.x_m[0], above.y_m[0], 4.0], 1))
    assert np.unravel_index(rm.rss_dbm[1].argmax(), rm.rss_dbm[1].shape) == (4, 6)      # above the access point
    for bad in (dict(floor=3), dict(cell_m=0.0), dict(margin_m=-1.0), dict(cell_m=np.nan)):
        with pytest.raises(ValueError, match="expected"):
            radio_map(M0, POINTS, **bad)


def learning_data(K=200, seed=2, sigma=4.0):
    rng = np.random.default_rng(seed)
    x = rng.uniform([0, 0], [60, 30], (K, 2))
    truth = AccessPoints([[22.0, 11.0]], power_dbm=-38.0, exponent=2.2, sigma_db=sigma)
    mu = truth.expected(np.column_stack([x, np.zeros(K)]), 0)[:, 0]
    return x, mu, rng


def test_path_loss_parameters_are_learned():
    x, mu, rng = learning_data()
    exact = fit_path_loss(x, mu, [22.0, 11.0])
    assert (exact.power_dbm, exact.exponent, exact.sigma_db) == pytest.approx((-38.0, 2.2, 0.0), abs=1e-9)
    y = mu + 4.0 * rng.standard_normal(200)
    y[::7] = np.nan
    fit = fit_path_loss(x, y, [22.0, 11.0])
    assert len(fit.residual) == np.isfinite(y).sum() and fit.residual.sum() == pytest.approx(0.0, abs=1e-8)
    # sd of the exponent about 0.12, of A 1.6, of sigma 0.22 (seen over seeds); 5 sd each: false alarm 1e-6
    assert fit.exponent == pytest.approx(2.2, abs=0.6) and fit.power_dbm == pytest.approx(-38, abs=8.0)
    assert fit.sigma_db == pytest.approx(4.0, abs=1.1)


def test_the_access_point_is_found():
    x, mu, rng = learning_data()
    exact = locate_access_point(x, mu)
    assert exact.xy_m == pytest.approx([22.0, 11.0], abs=0.01) and exact.exponent == pytest.approx(2.2, abs=0.01)
    noisy = locate_access_point(x, mu + 2.0 * rng.standard_normal(200))
    assert noisy.xy_m == pytest.approx([22.0, 11.0], abs=3.0)


def test_coverage_area():
    x, mu, _ = learning_data()
    y = np.where(np.hypot(*(x - [22, 11]).T) < 15, mu, np.nan)
    heard = x[~np.isnan(y)]
    area = coverage_area(x, y)
    np.testing.assert_allclose(area.mean, heard.mean(axis=0))
    np.testing.assert_allclose(area.cov, np.cov(heard.T))


@pytest.mark.parametrize("bad", [
    dict(xy_m=[1, 2]), dict(xy_m=np.zeros((0, 2))), dict(xy_m=[[1, 2, 3]]), dict(xy_m=[[np.nan, 0]]),
    dict(power_dbm=[1, 2]), dict(exponent=0), dict(sigma_db=-1), dict(floor=0.5), dict(floor=[0, 1]),
    dict(floor_loss_db=-1), dict(floor_height_m=np.nan), dict(unheard="x"), dict(freedom=0), dict(most_independent=-1),
    dict(threshold_dbm=np.nan),
])
def test_bad_access_points(bad):
    with pytest.raises(ValueError, match="expected"):
        AccessPoints(**{"xy_m": [[0, 0]], **bad})


def test_bad_scans_and_learning_data():
    x, floor = places(4)
    for y in ([-70.0, -60.0], -70.0, [-70.0, np.inf, -60.0], [[-70.0, -60, -50]]):
        with pytest.raises(ValueError, match="y: expected"):
            POINTS.log_likelihood(y, x, floor)
    for f in (fit_path_loss, lambda a, b, c: locate_access_point(a, b), lambda a, b, c: coverage_area(a, b)):
        with pytest.raises(ValueError, match="rss_dbm"):
            f([[0, 0], [1, 1], [5, 5]], [-40.0, -50.0], [0, 0])
        with pytest.raises(ValueError, match="rss_dbm"):
            f([[0, 0], [1, 1], [5, 5]], [-40.0, np.nan, -50.0], [0, 0])
    with pytest.raises(ValueError, match="distances"):
        fit_path_loss([[5, 0], [0, 5], [-5, 0]], [-40.0, -50.0, -60.0], [0, 0])


def test_nothing_is_changed():
    x, floor = places()
    y = np.array([-70.0, np.nan, -80.0])
    copies = x.copy(), floor.copy(), y.copy()
    POINTS.log_likelihood(y, x, floor), POINTS.expected(x, floor)
    assert (x == copies[0]).all() and (floor == copies[1]).all() and np.array_equal(y, copies[2], equal_nan=True)
    with pytest.raises(ValueError, match="read-only"):
        POINTS.xy_m[0] = 0.0
