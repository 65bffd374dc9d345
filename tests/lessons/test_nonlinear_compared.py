"""What the lesson claims: two Kalman filters that choose a line, an exact grid, and which of them is honest."""


import numpy as np
import pytest

from core import metrics
from lessons.filtering import nonlinear_compared as lesson
from lessons.kit.lesson import no_progress
from lessons.kit.params import parameters
from tests.lessons.support import Desk, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
EKF, UKF, GRID = range(3)


def area(cov):
    return float(np.sqrt(np.linalg.det(cov[:2, :2])))


def test_at_the_default_the_ekf_is_small_and_wrong_the_ukf_wide_and_the_grid_right():
    r = result(DEFAULT)
    np.testing.assert_array_equal(r.ekf.prior.mean[0], r.ukf.prior.mean[0])         # one identical draw and prior
    assert r.errors[EKF, 0] == pytest.approx(38.1, abs=0.5)                         # the words quote these
    assert r.errors[UKF, 0] == pytest.approx(25.8, abs=0.5)
    assert r.errors[GRID, 0] < 5.0
    assert r.nees[EKF, 0] > 50.0
    assert r.nees[UKF, 0] < 5.99 and r.nees[GRID, 0] < 5.99
    assert area(r.ekf.posterior.cov[0]) < 0.3 * area(r.ukf.posterior.cov[0])
    rmse = np.sqrt(np.square(r.errors).mean(axis=1))
    assert rmse[GRID] < rmse[UKF] < rmse[EKF]


def test_over_many_draws_only_the_grid_is_honest_at_the_first_update():
    ekf, ukf, exact = result(DEFAULT).first.mean_nees
    low, high = result(DEFAULT).band
    assert ekf > 5 * high
    assert high < ukf < 0.2 * ekf
    # The law is not normal, so the band for normal laws is widened a little.
    assert low - 0.3 < exact < high + 0.3


def test_a_ukf_that_starts_well_is_dishonest_later():
    r = result(DEFAULT)
    assert (r.mean_nees[UKF, 5:] > 3 * r.band[1]).all()


def test_the_first_update_of_example_22_has_the_oracle_s_numbers():
    expected = entry("C3-17")["expected"]
    r = result(preset("Example 22, y₁ = [118, 390]"))
    np.testing.assert_allclose(r.y[0], [118.0, 390.0])
    np.testing.assert_allclose(r.ekf.y_hat[0], expected["h_pred"], atol=1e-6)
    for found, name in ((r.ekf, "ekf"), (r.ukf, "ukf_redraw")):
        np.testing.assert_allclose(found.posterior.mean[0], expected[name]["x"], atol=1e-6)
        np.testing.assert_allclose(found.posterior.cov[0], expected[name]["P"], atol=1e-6)
    np.testing.assert_allclose(r.ukf.y_hat[0], expected["ukf_redraw"]["ybar"], atol=1e-6)
    exact = expected["exact"]
    np.testing.assert_allclose(r.first.exact.mean, exact["mean"][:2], atol=1e-3)
    np.testing.assert_allclose(np.diagonal(r.first.exact.cov), exact["var"][:2], atol=1e-2)
    # The coarse four-dimensional grid of the track agrees within a hundredth of a standard deviation.
    np.testing.assert_allclose(r.exact.law.mean[1], exact["mean"][:2], atol=0.05)
    np.testing.assert_allclose(np.diagonal(r.exact.law.cov[1]), exact["var"][:2], rtol=0.01)
    assert r.exact.lost < 0.02


def test_the_grid_of_the_track_is_the_exact_update_of_the_first_step():
    r = result(DEFAULT)
    np.testing.assert_allclose(r.exact.law.mean[1], r.first.exact.mean, atol=0.01)
    np.testing.assert_allclose(r.exact.law.cov[1], r.first.exact.cov, rtol=0.01, atol=0.05)
    k = 7
    (x, y), w = r.exact.axes[k], r.exact.posterior[k]
    np.testing.assert_allclose([w.sum(axis=1) @ x, w.sum(axis=0) @ y], r.exact.law.mean[k], atol=1e-6)


def test_far_away_nothing_is_nonlinear():
    r = result(preset("far away"))
    assert r.first.mean_nees == pytest.approx(2.0, abs=0.3)
    assert r.first.ekf[0] < 0.1 * result(DEFAULT).first.ekf[0]


def test_three_stations_end_in_agreement():
    r = result(preset("three stations"))
    assert np.ptp(r.errors[:, -1]) < 0.5
    assert (r.mean_nees[:, -5:] < 3.0).all()


def test_one_station_leaves_a_ring_that_the_ekf_s_ellipse_denies():
    r = result(preset("one station"))
    assert r.first.mean_nees[EKF] > 5 * r.first.mean_nees[UKF]
    assert r.nees[EKF, 0] > 5.99 * 5


def test_kappa_moves_the_ukf_and_nothing_else():
    a, b = result(DEFAULT), result(DESK.params(kappa=4.0))
    np.testing.assert_array_equal(a.ekf.posterior.mean, b.ekf.posterior.mean)
    np.testing.assert_array_equal(a.exact.law.mean, b.exact.law.mean)
    np.testing.assert_array_equal(a.first.sweep, b.first.sweep)
    assert not np.allclose(a.ukf.posterior.mean[0], b.ukf.posterior.mean[0])
    at = np.interp(4.0, lesson.KAPPAS, a.first.sweep[:, 0])
    found = np.linalg.norm(b.ukf.posterior.mean[0] - b.first.exact.mean)
    assert found == pytest.approx(at, rel=0.02)


def test_another_station_changes_neither_track_nor_the_other_errors():
    two, three = result(DEFAULT), result(preset("three stations"))
    np.testing.assert_array_equal(two.truth, three.truth)
    np.testing.assert_array_equal(two.y, three.y[:, :2])


def test_the_lines_are_what_the_filters_update_with():
    """The EKF's mean for R -> 0 is where its lines cross."""
    from lessons.filtering._compared_view import _lines

    r = result(DEFAULT)
    ekf, ukf = _lines(r, 0)
    for pairs, A, nu, mean in (
        (ekf, r.ekf.jacobian[0], r.ekf.innovation[0], r.ekf.prior.mean[0]),
        (ukf, np.linalg.solve(r.ukf.prior.cov[0], r.ukf.cross[0]).T, r.ukf.innovation[0], r.ukf.prior.mean[0]),
    ):
        for row, offset, ends in zip(A, nu, pairs, strict=True):
            np.testing.assert_allclose((ends - mean) @ row, offset, atol=1e-9)
    np.testing.assert_allclose(r.ekf.gain[0] @ r.ekf.innovation[0], r.ekf.posterior.mean[0] - r.ekf.prior.mean[0])


def test_stages_accumulate_and_carry_the_numbers():
    views = [DESK.view(DEFAULT, 1, stage) for stage in range(4)]
    assert all(v.camera == views[0].camera for v in views)
    for stage, v in enumerate(views):
        known = [len(e.pieces) > 1 for e in v.equations]
        assert known == sorted(known, reverse=True)
        assert sum(known) == (2, 3, 7, 10)[stage]
        assert any(e.current for e in v.equations)
    shown = [names(v) for v in views]
    assert {"range_1", "range_2"} <= shown[1] and {"ekf_lines", "ukf_lines", "sigma"} <= shown[2]
    assert {"ekf_now", "ukf_now", "grid_now"} <= shown[3]


NUMBERS = {n for n, p in parameters(lesson.Params).items() if p.kind in ("float", "int")}


@pytest.mark.parametrize("changes", [e for e in DESK.ends() if NUMBERS.issuperset(e)], ids=str)
def test_both_ends_of_every_number_are_finite(changes):
    r = lesson.compute(DESK.params(**changes), no_progress)
    for numbers in (r.errors, r.nees, r.mean_nees, r.first.sweep, r.first.mean_nees, r.exact.law.cov):
        assert np.isfinite(numbers).all()


def test_same_parameters_same_bytes():
    again = lesson.compute(DEFAULT, no_progress)
    assert again.exact.law.mean.tobytes() == result(DEFAULT).exact.law.mean.tobytes()
    assert again.mean_nees.tobytes() == result(DEFAULT).mean_nees.tobytes()
    assert metrics.consistency_band(0.95, 2, lesson.RUNS) == again.band
