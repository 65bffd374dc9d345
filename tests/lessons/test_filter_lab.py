"""What the laboratory shows: who loses the track of Example 22, who is the same filter as whom, who is honest."""


import numpy as np
import pytest

from lessons.filtering import filter_lab as lesson
from lessons.kit.lesson import Cancelled, Moment, no_progress
from lessons.kit.params import parameters
from tests.lessons.support import Desk, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result


def final(r, name):
    return r.tracks[name].error[-1], r.tracks[name].nees[-1]


def test_at_the_default_the_ekf_is_lost_and_sure_and_the_others_know_that_they_do_not_know():
    r = result(DEFAULT)
    error, nees = final(r, "ekf")
    assert error == pytest.approx(175.0, abs=1.0)                  # quoted in the words
    assert nees > 100.0
    for name in ("ukf", "pf", "mixture"):
        assert final(r, name)[1] < 5.99
    # Particles and components lie on both sides of the line of the stations.
    side = r.clouds[-1, :, 1] > 0.0
    assert 0.05 < r.weights[-1] @ side < 0.95
    means, weights = r.parts[-1]
    assert 0.05 < weights[means[:, 1] > 0.0].sum() < 0.95


def test_a_quarter_of_the_runs_of_example_22_are_lost_by_the_ekf_and_none_by_the_particles():
    expected = entry("C3-36")["expected"]
    many = result(preset("Example 22, 200 runs")).many
    assert many["ekf"].lost == pytest.approx(expected["ekf_wrong_fraction"], abs=0.09)     # 3 sd of 200 runs
    assert many["pf"].lost <= 0.02
    assert many["ukf"].lost <= 0.05
    assert many["pf"].total_rmse < 0.9 * many["ekf"].total_rmse
    # Its coverage hides it: about right at 68 %, far too little at 95 %.
    assert many["ekf"].coverage[0] > 0.6
    assert many["ekf"].coverage[1] < 0.9


def test_in_example_20_the_kalman_filters_are_one_filter():
    r = result(preset("Example 20"))
    for name in ("ekf", "ukf", "mixture"):
        np.testing.assert_allclose(r.tracks[name].law.mean, r.tracks["kf"].law.mean, atol=1e-6)
        np.testing.assert_allclose(r.tracks[name].law.cov, r.tracks["kf"].law.cov, atol=1e-5)
    assert not np.allclose(r.tracks["pf"].law.mean, r.tracks["kf"].law.mean, atol=0.1)
    np.testing.assert_allclose(r.tracks["pf"].law.mean[:, :2], r.tracks["kf"].law.mean[:, :2], atol=15.0)


def test_with_honest_assumptions_nees_and_coverage_are_right():
    p = preset("Example 20", runs=200, pf=False, mixture=False, ukf=False)
    r = result(p)
    m = r.many["ekf"]
    assert m.coverage == pytest.approx([0.68, 0.95], abs=0.025)
    low, high = r.band
    assert ((m.mean_nees < low) | (m.mean_nees > high)).sum() <= 8
    assert m.lost == 0.0


def test_a_third_station_reconciles_everybody():
    r = result(preset("three stations"))
    ends = np.array([t.law.mean[-1, :2] for t in r.tracks.values()])
    assert np.ptp(ends, axis=0).max() < 1.5


def test_fixes_from_bearings_throw_something_away():
    many = result(preset("bearings only", pf=False)).many
    assert many["kf"].total_rmse > 1.3 * many["ekf"].total_rmse
    assert many["kf"].coverage[1] < many["ekf"].coverage[1] - 0.1


def test_gnss_is_linear_at_its_distance_and_hard_for_particles():
    p = preset("GNSS with clock", runs=20, n_particles=1000)
    r = result(p)
    np.testing.assert_allclose(r.tracks["ukf"].law.mean, r.tracks["ekf"].law.mean, atol=0.01)
    assert r.many["pf"].total_rmse > 1.2 * r.many["ekf"].total_rmse
    assert "grid" not in result(preset("GNSS with clock", grid=True, pf=False)).tracks


def test_the_grid_and_the_particles_agree_in_example_22():
    """The grid is the reference: a large cloud has its mean and spread."""
    r = result(DESK.params(grid=True, n_particles=8000, mixture=False))
    g, c = r.tracks["grid"].law, r.tracks["pf"].law
    sd = np.sqrt(np.diagonal(g.cov[10:, :2, :2], axis1=1, axis2=2))
    assert (np.abs(g.mean[10:, :2] - c.mean[10:, :2]) < 0.5 * sd).all()
    assert final(r, "grid")[1] < 5.99


def test_one_component_is_an_ekf():
    r = result(DESK.params(components=1, scenario="example_20", pf=False))
    np.testing.assert_allclose(r.tracks["mixture"].law.mean, r.tracks["ekf"].law.mean, atol=1e-6)


def test_filters_do_not_change_each_other_nor_the_world():
    base, alone = result(DEFAULT), result(DESK.params(ekf=False, pf=False, kf=True))
    np.testing.assert_array_equal(base.truth, alone.truth)
    np.testing.assert_array_equal(base.y, alone.y)
    np.testing.assert_array_equal(base.tracks["mixture"].law.mean, alone.tracks["mixture"].law.mean)
    many = result(DESK.params(runs=10, mixture=False))
    np.testing.assert_array_equal(base.tracks["pf"].law.mean, many.tracks["pf"].law.mean)


def test_many_runs_report_their_progress_and_can_be_cancelled():
    seen = []
    lesson.compute(DESK.params(runs=20, n_particles=100, mixture=False), seen.append)
    assert seen == sorted(seen) and len(seen) > 20 and seen[-1] == pytest.approx(1.0)

    def cancel(fraction):
        if fraction > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        lesson.compute(DESK.params(runs=20, n_particles=100, mixture=False), cancel)


def test_no_filter_at_all_is_a_picture_too():
    p = DESK.params(ekf=False, ukf=False, pf=False, mixture=False, runs=10)
    assert {"truth", "truth_now"} <= names(DESK.view(p, 40, 0))


@pytest.mark.parametrize("scenario", lesson.NAMES)
@pytest.mark.parametrize("truth", ["straight", "drawn"])
def test_every_scenario_is_finite_at_the_ends_of_its_settings(scenario, truth):
    specs = parameters(lesson.Params)
    for value, runs in (("low", 10), ("high", 0)):
        settings = {name: specs[name].validate(getattr(specs[name], value)) for name in ("kappa", "components")}
        p = DESK.params(scenario=scenario, truth=truth, kf=True, n_particles=100, runs=runs, **settings)
        r = result(p)
        for t in r.tracks.values():
            assert np.isfinite(t.error).all() and np.isfinite(t.nees).all()
        for m in r.many.values():
            assert np.isfinite(m.rmse).all() and np.isfinite(m.mean_nees).all()


def test_same_parameters_same_bytes():
    p = DESK.params(runs=10, n_particles=200, components=4)
    a, b = (lesson.compute(p, no_progress) for _ in range(2))
    assert a.y.tobytes() == b.y.tobytes() and a.clouds.tobytes() == b.clouds.tobytes()
    shown = [[(x.name, x.value) for x in lesson.view(p, r, Moment(40, 0)).readouts] for r in (a, b)]
    assert shown[0] == shown[1]
