"""What the lesson on the Kalman filter claims: the source's numbers, consistency, and what wrong assumptions do."""

import numpy as np
import pytest

from lessons.filtering import kalman as lesson
from lessons.kit.lesson import Moment, no_progress
from tests.lessons.support import Desk, check_formulas, everything, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
LAST = 3


def readouts(p):
    return DESK.readouts(p, 30)


def errors(r, axis=0):
    return r.updates.posterior.mean[:, axis] - r.truth[1:, axis]


def outside(values, variance):
    """Share beyond two standard deviations."""
    return float((np.abs(values) > 2 * np.sqrt(variance)).mean())


@pytest.mark.parametrize("name", ["Example 20", "optimistic P0"])
def test_the_variance_follows_the_oracle_and_ends_in_the_steady_state(name):
    expected = entry("C3-07")["expected"]
    r = result(preset(name))                       # both presets let the filter assume the numbers of Example 20
    for row in expected["x_axis"]:
        i = row["k"] - 1
        P, K = r.updates.posterior.cov[i], r.updates.gain[i]
        np.testing.assert_allclose([P[0, 0], P[0, 2], P[2, 2], K[0, 0], K[2, 0]],
                                   [row[k] for k in ("P_pos", "P_posvel", "P_vel", "K_pos", "K_vel")], rtol=1e-8)
    np.testing.assert_allclose(r.steady.posterior.cov[np.ix_([0, 2], [0, 2])], expected["steady"]["P"], rtol=1e-8)
    np.testing.assert_allclose(r.steady.gain[[0, 2], 0], expected["steady"]["K"], rtol=1e-8)
    np.testing.assert_allclose(r.updates.gain[-1], r.steady.gain, atol=1e-4)


def test_the_position_variance_falls_first_and_then_rises():
    r = result(preset("optimistic P0"))
    variance = np.append(r.initial.cov[0, 0], r.updates.posterior.cov[:, 0, 0])
    assert variance[0] == pytest.approx(100.0)
    assert variance[1] < 97.5 < 109 < variance[2] < variance[3] < variance[4]
    assert variance[-1] == pytest.approx(204.8, abs=0.1)


def test_example_20_helps_and_is_consistent():
    r, shown = result(DEFAULT), readouts(DEFAULT)
    assert shown["rmse_filter"] < 0.45 * shown["rmse_raw"]
    low, high = r.nees_band
    assert (low, high) == pytest.approx((3.46, 4.57), abs=0.01)
    # 95 % of the means lie in the band; neighbours are correlated, so allow 12 of 60 outside.
    assert ((r.mean_nees < low) | (r.mean_nees > high)).sum() <= 12
    assert outside(r.updates.innovation[:, 0], r.updates.innovation_cov[:, 0, 0]) < 0.15
    assert r.nis.mean() == pytest.approx(2.0, abs=0.8)


def test_trusting_the_measurements_too_much():
    good, bad = result(DEFAULT), result(preset("trusts the measurements too much"))
    assert bad.updates.gain[-1, 0, 0] > 1.8 * good.updates.gain[-1, 0, 0]
    assert outside(bad.updates.innovation[:, 0], bad.updates.innovation_cov[:, 0, 0]) > 0.3
    assert (bad.mean_nees[5:] > 5 * bad.nees_band[1]).all()
    assert readouts(preset("trusts the measurements too much"))["rmse_filter"] > 1.2 * readouts(DEFAULT)["rmse_filter"]


def test_trusting_the_model_too_much():
    good, bad = result(DEFAULT), result(preset("trusts the model too much"))
    assert bad.updates.gain[-1, 0, 0] < 0.35 * good.updates.gain[-1, 0, 0]
    assert preset("trusts the model too much").axis == "y"             # the plots show where it is worst
    assert outside(errors(bad, 1)[10:], bad.updates.posterior.cov[10:, 1, 1]) > 0.4
    assert (bad.mean_nees[10:] > 3 * bad.nees_band[1]).all()
    assert readouts(preset("trusts the model too much"))["rmse_filter"] > 1.2 * readouts(DEFAULT)["rmse_filter"]


def test_an_optimistic_start_leaves_its_band_and_recovers():
    r = result(preset("optimistic P0"))
    assert (r.mean_nees[:3] > 5 * r.nees_band[1]).all()
    assert r.mean_nees[-20:].mean() == pytest.approx(4.0, abs=0.6)
    for axis, steps in ((0, 8), (1, 4)):
        variance = r.updates.posterior.cov[:, axis, axis]
        assert outside(errors(r, axis)[:steps], variance[:steps]) == 1.0
        assert outside(errors(r, axis)[12:], variance[12:]) < 0.15


def test_the_ratios_change_the_belief_and_not_the_world():
    r, other = result(DEFAULT), result(DESK.params(r_ratio=3.0, q_ratio=0.2, p0_ratio=5.0))
    np.testing.assert_array_equal(r.truth, other.truth)
    np.testing.assert_array_equal(r.y, other.y)


def test_stages_accumulate_and_carry_the_numbers():
    r, k = result(DEFAULT), 30
    views = [DESK.view(DEFAULT, k, stage) for stage in range(4)]
    lasting = [names(v) - {"previous", "motion"} for v in views]
    assert lasting[0] < lasting[1] < lasting[2] < lasting[3]
    for stage, v in enumerate(views):
        assert v.camera == views[0].camera
        assert [e.name for e in v.equations] == [e.name for e in views[0].equations]
        running = {"predict_mean": 0, "predict_cov": 0, "innovation": 1, "innovation_cov": 1, "gain": 2,
                   "update_mean": 3, "update_cov": 3}
        for e in v.equations:
            assert e.current == (running[e.name] == stage)
            assert (len(e.pieces) > 1) == (running[e.name] <= stage)
    numbers = {e.name: e.pieces[-1] for e in views[3].equations}
    u = r.updates
    np.testing.assert_allclose(numbers["update_mean"],
                               numbers["predict_mean"] + numbers["gain"] @ numbers["innovation"], rtol=1e-9)
    np.testing.assert_allclose(numbers["innovation_cov"], numbers["predict_cov"] + np.diag([900.0, 2500.0]))
    arrow = next(i for i in views[3].scene if i.name == "innovation")
    np.testing.assert_allclose(np.subtract(arrow.end, arrow.start), u.innovation[k - 1])


def test_timeline():
    t = lesson.timeline(DESK.params(dt_s=0.5))
    assert (t.steps, t.stages, t.scale, t.unit) == (60, ("predict", "innovation", "gain", "update"), 0.5, "s")
    assert 10 < t.start < 50


@pytest.mark.parametrize("changes", DESK.ends(), ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    p = DESK.params(**changes)
    for step in (0, 1, 60):
        assert np.isfinite(np.frombuffer(everything(lesson.view(p, result(p), Moment(step, LAST))))).all()


def test_the_corners_of_the_filter_s_beliefs_are_finite():
    for r_ratio in (0.05, 20.0):
        for q_ratio in (0.01, 100.0):
            r = result(DESK.params(r_ratio=r_ratio, q_ratio=q_ratio, sigma_c=0.01, sigma_x_m=200.0, p0_ratio=20.0))
            assert np.isfinite(r.steady.gain).all()
            assert (r.steady.posterior.cov[[0, 1], [0, 1]] > 0).all()
            assert np.isfinite(r.mean_nees).all()


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.truth.tobytes() == b.truth.tobytes()
    assert a.updates.posterior.mean.tobytes() == b.updates.posterior.mean.tobytes()
    assert a.mean_nees.tobytes() == b.mean_nees.tobytes()
    assert result(DESK.params(seed=7)).y.tobytes() != a.y.tobytes()


def test_every_formula_can_be_typeset():
    for step in (0, 1):
        check_formulas(DESK.view(DEFAULT, step))
