"""What the lesson on the particle filter claims: EKF and UKF follow the wrong peak, the cloud keeps both."""

import time

import numpy as np
import pytest

from lessons.filtering import particle_vs_ekf as lesson
from lessons.filtering._histogram import weighted_density
from lessons.kit.lesson import Cancelled, Moment, no_progress
from lessons.kit.params import parameters
from tests.lessons.support import Desk, check_formulas, check_plots, names

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
shown, readouts = DESK.view, DESK.readouts
LAST = 3


def test_at_the_default_ekf_and_ukf_follow_the_wrong_peak_with_confidence():
    r = result(DEFAULT)
    for g in (r.ekf, r.ukf):
        assert g.mean[40, 1] < -60                                        # the truth is at +90
        assert np.sqrt(g.cov[40, 1, 1]) < 15
        assert r.side.probability(g)[40] < 1e-6
    numbers = readouts(DEFAULT)
    assert numbers["ekf_error"] > 150 > 10 * numbers["ekf_sigma"]
    # The wrong answer is the mirror image of a good one.
    mirrored = r.ekf.mean[40, :2] * [1, -1]
    assert np.linalg.norm(mirrored - r.truth[40]) < 20


@pytest.mark.parametrize("n_particles", [20_000, 50_000])
def test_the_cloud_keeps_both_modes_and_the_truth_lies_in_one(n_particles):
    r = result(DESK.params(n_particles=n_particles))
    assert 0.1 < r.share[40] < 0.9
    assert (r.share[15:] > 0.1).all() and (r.share[15:] < 0.9).all()
    centres = (r.edges[1:] + r.edges[:-1]) / 2
    density = r.density[40]
    upper, lower = density[centres > 30].max(), density[centres < -30].max()
    valley = density[np.abs(centres) < 20].max()
    assert min(upper, lower) > 5 * valley
    assert abs(centres[np.argmax(np.where(centres > 0, density, 0))] - 90) < 30
    width = r.edges[1] - r.edges[0]
    assert density.sum() * width == pytest.approx(1.0, abs=0.01)
    assert (density * (centres > 0)).sum() * width == pytest.approx(r.share[40], abs=0.02)
    # The mean lies between the modes.
    assert abs(r.pf.mean[40, 1]) < 70


def test_with_a_third_station_all_filters_agree():
    numbers = readouts(preset("third base station"))
    assert max(numbers["ekf_error"], numbers["ukf_error"], numbers["pf_error"]) < 12
    assert numbers["share"] > 99
    np.testing.assert_array_equal(result(preset("third base station")).y[:, :2], result(DEFAULT).y)


def test_without_resampling_the_weights_collapse():
    r = result(preset("SIS: no resampling"))
    assert r.run.n_eff[-1] < 10
    assert not r.run.resampled.any()
    assert result(DEFAULT).run.n_eff.min() > 1000
    # The particles that carry the weight are drawn although the subsample misses them.
    cloud = DESK.items(preset("SIS: no resampling"))["cloud"]
    assert cloud.weights.sum() > 0.9
    assert cloud.weights.max() > 0.3
    assert "more that each carry over" in shown(preset("SIS: no resampling")).note


def test_few_particles_lose_a_mode():
    share = result(preset("few particles")).share[40]
    assert share < 0.02 or share > 0.98


def test_adaptive_resampling_happens_only_below_the_threshold():
    p = DESK.params(sampling="adaptive", threshold=0.3)
    r = result(p)
    np.testing.assert_array_equal(r.run.resampled, r.run.n_eff < 0.3 * p.n_particles)
    assert 0 < r.run.resampled.sum() < 40
    assert 0.1 < r.share[40] < 0.9


@pytest.mark.parametrize("change", [{"resampler": "stratified"}, {"resampler": "multinomial"},
                                    {"resampler": "residual"}, {"proposal": "ekf", "n_particles": 1500},
                                    {"proposal": "ukf", "n_particles": 1500}])
def test_every_scheme_and_proposal_keeps_both_modes(change):
    assert 0.1 < result(DESK.params(**change)).share[40] < 0.9


def test_the_drawn_particles_are_those_that_the_core_keeps():
    for N in (100, 1999, 2000, 2001, 20_000):
        np.testing.assert_array_equal(lesson.drawn_index(N), result(DESK.params(n_particles=N)).run.index)
    r = result(DESK.params(n_particles=100))
    assert (r.children.sum(axis=1) == 100).all()
    for k in (0, 20, 39):
        np.testing.assert_array_equal(np.bincount(r.run.ancestors[k], minlength=100), r.children[k])


def test_the_histogram_is_numpy_s():
    rng = np.random.default_rng(0)
    d, w, edges = rng.normal(0, 80, 5000), rng.random(5000), np.linspace(-150, 150, lesson.BINS + 1)
    w /= w.sum()
    expected = np.histogram(d, edges, weights=w)[0] / (edges[1] - edges[0])
    np.testing.assert_allclose(weighted_density(d, w, edges), expected, atol=1e-12)


def test_stages_show_weights_and_ancestors():
    r, k = result(DEFAULT), 20
    predict, weigh, estimate, resample = (DESK.items(DEFAULT, k, s) for s in range(4))
    assert "paths" in predict and "range_1" not in predict
    assert {"range_1", "range_2"} <= set(weigh)
    drawn = weigh["cloud"].weights
    np.testing.assert_allclose(drawn / drawn.sum(), r.run.weights_before[k - 1])
    assert "pf_mean" not in weigh and "pf_mean" in estimate
    assert len(resample["lost"].positions) + len(resample["cloud"].positions) == 2000
    assert (resample["cloud"].weights >= 1).all()
    assert len({shown(DEFAULT, s, t).camera for s in (0, 7, 40) for t in range(4)}) == 1
    view = shown(DEFAULT, 40)
    assert view.note == "2,000 of 20,000 particles are drawn."
    assert {"ekf_0", "ekf_10", "ekf_20", "ekf_30", "ekf_now"} <= names(view)
    assert len(view.scene) <= 30


def test_the_equations_hold_the_step_s_numbers():
    r, k = result(DEFAULT), 20
    numbers = {e.name: e.pieces for e in shown(DEFAULT, k).equations}
    x = numbers["predict"][-1]
    y, expected, rest = numbers["compare"][2], numbers["compare"][4], numbers["compare"][6]
    np.testing.assert_allclose(expected, np.linalg.norm(x[:2] - r.stations, axis=1))
    np.testing.assert_allclose(y - expected, rest)
    assert numbers["n_eff"][2] == pytest.approx(r.run.n_eff[k - 1])
    assert 1.0 < numbers["weigh"][-1] < 20_000
    waiting = shown(DEFAULT, k, 0).equations
    assert [len(e.pieces) > 1 for e in waiting] == [True] + [False] * (len(waiting) - 1)


AT_THE_ORIGIN = [{name: (0.0, 0.0)} for name, q in parameters(lesson.Params).items() if q.kind == "point"]


@pytest.mark.parametrize("changes", [e for e in DESK.ends() + AT_THE_ORIGIN if "n_particles" not in e], ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    p = DESK.params(n_particles=300, **changes)
    r = lesson.compute(p, no_progress)
    for step in (0, 1, 40):
        v = lesson.view(p, r, Moment(step, LAST))
        assert all(np.isfinite(x.value) for x in v.readouts)
        check_plots(v)
        check_formulas(v)


def test_stations_in_one_place_still_have_a_side():
    r = lesson.compute(DESK.params(n_particles=300, station_2=DEFAULT.station_1), no_progress)
    assert np.isfinite(r.density).all() and np.isfinite(r.share).all()


def test_same_parameters_same_bytes():
    p = DESK.params(n_particles=3000)
    a, b = (lesson.compute(p, no_progress) for _ in range(2))
    assert a.run.particles.tobytes() == b.run.particles.tobytes()
    assert a.density.tobytes() == b.density.tobytes()
    assert lesson.compute(DESK.params(n_particles=3000, seed=3), no_progress).y.tobytes() != a.y.tobytes()


def test_a_million_particles_report_each_step_stop_at_once_and_are_fast():
    times = []

    def stop_after_six(fraction):
        times.append(time.perf_counter())
        if len(times) == 7:
            raise Cancelled

    rng = np.random.default_rng(0)
    begin = time.perf_counter()
    rng.standard_normal((1_000_000, 4))
    draw = time.perf_counter() - begin
    with pytest.raises(Cancelled):
        lesson.compute(preset("a million particles"), stop_after_six)
    assert np.median(np.diff(times)[1:]) < 20 * draw
