"""What the lesson on the stiff and the flexible filter claims: the thesis's numbers, its errata, who wins where."""


import numpy as np
import pytest

from core.random_walk import FLEXIBLE, STIFF
from lessons.bayes_kalman import random_walk as lesson
from lessons.kit.lesson import no_progress
from lessons.kit.scene import LevelEllipse, Points, Polyline
from tests.lessons.support import Desk, check_formulas, check_plots
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result


def corrected():
    return result(preset("Table 4.2 as corrected"))


def rms(values):
    return float(np.sqrt(np.square(values).sum(axis=-1).mean()))


def test_the_default_is_the_table_as_printed():
    r = result(DEFAULT)
    assert (r.stiff.setting, r.flexible.setting) == (STIFF, FLEXIBLE)
    assert (DEFAULT.noise_x_m, DEFAULT.noise_y_m) == STIFF.noise_sd_m


def test_gains_and_deviations_are_those_of_the_oracle():
    stiff, flexible = entry("T-08")["expected"], entry("T-09")["expected"]
    r = result(DEFAULT)
    for t, table in ((r.stiff, stiff["table"]), (r.flexible, flexible["table"])):
        for axis, name in enumerate("xy"):
            for k, want in table[name].items():
                assert t.steps.gain[int(k) - 1, axis, axis] == pytest.approx(want["K"], rel=1e-7)
                sd = np.sqrt(t.steps.posterior.cov[int(k) - 1, axis, axis])
                assert sd == pytest.approx(want["sd_pos"], rel=1e-7)
    for axis, name in enumerate("xy"):
        assert r.stiff.steady_gain[axis] == pytest.approx(stiff["steady"][name]["K"], rel=1e-7)
        assert r.stiff.steady_sd_m[axis] == pytest.approx(stiff["steady"][name]["sd_pos"], rel=1e-7)


def test_unobserved_z_grows_as_the_text_asks():
    r = result(DEFAULT)
    for k, want in zip(entry("T-11")["inputs"]["k"], entry("T-11")["expected"]["sd_z"], strict=True):
        assert np.sqrt(r.stiff.steps.posterior.cov[k - 1, 2, 2]) == pytest.approx(want, rel=1e-9)


def test_the_stiff_filter_is_calm_and_then_leaves_the_turn():
    """Figure 4.2: better on the straight part, worse after the turn at about step 70; the flexible one is even."""
    r = result(DEFAULT)
    assert rms(r.stiff.errors[20:68]) < 0.7 * rms(r.flexible.errors[20:68])
    assert rms(r.stiff.errors[72:]) > 2.0 * rms(r.flexible.errors[72:])
    assert lesson.turn_deg(r.truth[:, None])[72 - 2 * lesson.WINDOW:].max() > 15.0
    shown = lesson.timeline(DEFAULT).start
    assert np.linalg.norm(r.stiff.errors[shown - 1]) > 2.5 * np.linalg.norm(r.flexible.errors[shown - 1])
    # and it does not know: the turn is no part of its covariance
    assert np.abs(r.stiff.errors[shown - 1, 1]) > 2.5 * np.sqrt(r.stiff.steps.posterior.cov[shown - 1, 1, 1])


def test_the_stiff_filter_wins_along_and_loses_across_the_walk():
    want = entry("T-17")["expected"]
    r = result(DEFAULT)
    for t, name in ((r.stiff, "stiff as printed (0.01; v0=(3,4); R=diag(1,16); noise sd 1,1)"),
                    (r.flexible, "flexible as printed (0.1; v0=(15,25))")):
        e = want[name]
        assert abs(t.mean_rmse[0] - e["rmse_mean"]) < 3.0 * e["rmse_sd"] / np.sqrt(lesson.RUNS)   # as the oracle asks
    assert r.stiff.mean_rmse[1] < 0.85 * r.flexible.mean_rmse[1]
    assert r.stiff.mean_rmse[2] > 1.6 * r.flexible.mean_rmse[2]
    assert r.stiff.mean_rmse[2] > r.raw_rmse[2]          # with the wrong R it is worse than no filter at all, in y


def test_rmse_against_sigma_is_a_valley_between_the_two_models():
    for name in ("Table 4.2 as printed", "Table 4.2 as corrected", "K9: the noise is as assumed (4 m in y)"):
        curve = result(preset(name)).curve[:, 0]
        best = int(curve.argmin())
        assert (np.diff(curve[:best + 1]) < 0).all() and (np.diff(curve[best:]) > 0).all()
        assert 0.01 < lesson.SIGMAS[best] < 0.2


def test_a_walk_from_the_model_is_filtered_best_with_its_own_sigma():
    r = result(preset("K11: a walk from the filters' model"))
    assert r.world_sigma == pytest.approx(0.050383, abs=1e-6)
    assert lesson.SIGMAS[r.curve[:, 0].argmin()] == pytest.approx(r.world_sigma, rel=0.4)


def test_corrected_stiff_wins_on_straights_and_loses_in_turns():
    r = corrected()
    known = np.isfinite(r.stiff.by_turn)
    assert known.sum() >= 7
    difference = (r.stiff.by_turn - r.flexible.by_turn)[known]
    assert difference[0] < -0.05 and (difference[3:] > 0.1).all()
    assert r.stiff.by_turn[known][-1] > 2.0 * r.flexible.by_turn[known][-1]
    assert np.ptp(r.flexible.by_turn[known]) < 0.15      # the flexible one does not care


def test_a_straight_walk_belongs_to_the_stiff_filter():
    r = result(preset("a straight walk"))
    assert (r.stiff.mean_rmse < 0.8 * r.flexible.mean_rmse).all()


def test_k8_the_start_velocity_matters_for_a_few_steps_only():
    printed, swapped = result(DEFAULT), result(preset("K8: start velocities swapped"))
    assert abs(swapped.stiff.errors[0, 1]) > 2.55 > 1.0 > abs(printed.stiff.errors[0, 1])    # beyond Figure 4.2's axis
    np.testing.assert_allclose(swapped.stiff.errors[20:], printed.stiff.errors[20:], atol=0.05)
    assert swapped.stiff.mean_rmse[0] == pytest.approx(printed.stiff.mean_rmse[0], rel=0.06)


def test_k9_a_right_R_helps_the_stiff_filter_by_a_third():
    printed, right = result(DEFAULT), result(preset("K9: the filters know the noise (R = I)"))
    np.testing.assert_array_equal(printed.y, right.y)
    assert right.stiff.mean_rmse[0] < 0.67 * printed.stiff.mean_rmse[0]


def test_k10_one_sample_once():
    p = preset("K10: the first sample only once")
    r = result(p)
    assert lesson.timeline(p).steps == 99 == len(r.stiff.errors)
    assert lesson.timeline(DEFAULT).steps == 100
    np.testing.assert_allclose(r.stiff.steps.y_hat[0] + r.stiff.steps.innovation[0], r.y[1])
    np.testing.assert_allclose(r.stiff.errors, r.stiff.steps.posterior.mean[:, :2] - r.truth[1:])


def test_the_note_says_what_does_not_fit():
    def note(p):
        return DESK.view(p, 5).note

    assert "K9" in note(DEFAULT) and "K10" in note(DEFAULT)
    assert note(preset("Table 4.2 as corrected")) == ""


def test_both_filters_get_the_same_walk_and_the_belief_does_not_change_it():
    r, other = result(DEFAULT), result(DESK.params(R_x_m=5.0, sigma_stiff=0.5, v0_flexible="true"))
    np.testing.assert_array_equal(r.y, other.y)
    np.testing.assert_array_equal(r.truth, other.truth)


def test_stages_show_the_numbers_one_after_the_other():
    k = 30
    views = [DESK.view(DEFAULT, k, stage) for stage in range(3)]
    for stage, v in enumerate(views):
        assert v.camera == views[0].camera
        running = {"predict": 0, "gain": 1, "update": 2}
        for e in v.equations:
            number = running[e.name.partition("_")[0]]
            assert e.current == (number == stage) and (len(e.pieces) > 1) == (number <= stage)
    found = {i.name: i for i in views[2].scene}
    assert isinstance(found["stiff"], Polyline) and len(found["stiff"].points) == k + 1
    assert len(next(i for i in views[0].scene if i.name == "stiff").points) == k
    assert isinstance(found["measurements"], Points) and len(found["measurements"].positions) == k


def check_finite(p):
    for k in (0, 1, len(result(p).stiff.errors)):
        v = DESK.view(p, k)
        for item in v.scene:
            if isinstance(item, Polyline):
                assert np.isfinite(item.points).all()
            elif isinstance(item, LevelEllipse):
                assert np.isfinite(item.gaussian.mean).all() and np.isfinite(item.gaussian.cov).all()
        check_formulas(v)
        check_plots(v)


@pytest.mark.parametrize("changes", [e for e in DESK.ends() if "seed" not in e], ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    check_finite(DESK.params(**changes))


def test_no_turns_and_no_noise_is_finite():
    p = DESK.params(spread_deg=0.0, noise_x_m=0.0, noise_y_m=0.0, world="model", sigma_stiff=0.001)
    check_finite(p)


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.curve.tobytes() == b.curve.tobytes() and a.y.tobytes() == b.y.tobytes()
    assert a.stiff.steps.posterior.mean.tobytes() == b.stiff.steps.posterior.mean.tobytes()
    assert lesson.compute(DESK.params(seed=5), no_progress).y.tobytes() != a.y.tobytes()


def test_progress_reaches_the_end_and_can_cancel():
    seen = []
    lesson.compute(DEFAULT, seen.append)
    assert len(seen) > 5 and seen == sorted(seen) and seen[0] > 0.0 and seen[-1] <= 1.0
