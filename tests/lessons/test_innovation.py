"""What the lesson on the innovation claims: the oracle's gate, garbage kept out, four wrong noises told apart."""

import itertools

import numpy as np
import pytest

from lessons.filtering import innovation as lesson
from lessons.kit.lesson import Moment, no_progress
from tests.lessons.support import Desk, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
PREDICT, INNOVATION, TEST, UPDATE = range(4)


def rmse(r, f):
    return float(np.sqrt(np.square(f.step.posterior.mean[:, :2] - r.truth[1:, :2]).sum(axis=1).mean()))


def test_the_first_step_is_the_oracle_s():
    asked, expected = entry("C3-10")["inputs"], entry("C3-10")["expected"]
    p = preset("145 m off at the first step", garbage=tuple(float(v) for v in asked["y"]))
    r = result(p)
    np.testing.assert_allclose(r.initial.mean, asked["x0"])
    np.testing.assert_allclose(r.initial.cov, asked["P0"])
    np.testing.assert_allclose(r.used.step.innovation[0], expected["innovation"], rtol=1e-9)
    np.testing.assert_allclose(r.used.step.innovation_cov[0], np.diag(expected["S"]), rtol=1e-9, atol=1e-9)
    assert r.used.nis[0] == pytest.approx(expected["NIS"], rel=1e-9)
    assert r.used.accepted[0]

    outlier = result(preset("145 m off at the first step"))
    assert outlier.used.nis[0] == pytest.approx(expected["NIS_outlier"], rel=1e-9)
    assert outlier.level == pytest.approx(9.210340, abs=1e-6)
    assert not outlier.used.accepted[0] and outlier.plain.accepted[0]
    np.testing.assert_array_equal(outlier.used.step.posterior.mean[0], [5.0, 0.0, 5.0, 0.0])


def test_the_gate_keeps_garbage_out_and_halves_the_error():
    r = result(DEFAULT)
    assert r.garbage.sum() >= 6 and r.garbage[DEFAULT.garbage_step - 1]
    assert (~r.used.accepted[r.garbage]).sum() >= 6
    assert (~r.used.accepted[~r.garbage]).sum() <= 1
    assert not r.used.accepted[DEFAULT.garbage_step - 1]               # the user's own, at the step shown first
    assert lesson.timeline(DEFAULT).start == DEFAULT.garbage_step
    assert rmse(r, r.plain) > 1.8 * rmse(r, r.used)
    assert {"plain", "rejected", "garbage", "gate"} <= names(DESK.view(DEFAULT, 38))


def test_without_a_gate_the_filter_is_the_plain_one():
    r, gated = result(preset("no gate")), result(DEFAULT)
    assert r.used.accepted.all()
    np.testing.assert_array_equal(r.used.step.posterior.mean, gated.plain.step.posterior.mean)
    scene = names(DESK.view(preset("no gate"), 50))
    assert "rejected" not in scene and "plain" not in scene
    assert r.many_nis > 4.0                                            # garbage shows in the mean


@pytest.mark.parametrize(("name", "high", "positive"), [
    ("R too small", True, False), ("R too large", False, True), ("Q too small", True, True),
    ("Q too large", False, False)])
def test_nis_and_correlation_together_tell_which_noise_is_wrong(name, high, positive):
    r = result(preset(name))
    for nis in (r.many_nis, float(r.used.nis.mean())):                 # of many tracks, and of the one that is drawn
        assert nis > 2.5 if high else nis < 1.6
    for first in (float(r.many_correlation[0]), float(r.correlation[0])):
        assert first > 0.15 if positive else first < -0.08
    right = result(preset(name, r_ratio=1.0, q_ratio=1.0))
    assert right.many_nis == pytest.approx(2.0, abs=0.1)
    # 100 tracks of 60 two-dimensional innovations: a standard deviation of 0.009
    assert np.abs(right.many_correlation).max() < 0.035


def test_the_adaptive_filter_finds_the_noise():
    p = preset("R learnt from the residuals")
    r = result(p)
    sigma = np.sqrt(r.used.R[:, [0, 1], [0, 1]])
    assert (sigma[0] < [12.0, 20.0]).all()
    np.testing.assert_allclose(sigma[-20:].mean(axis=0), [30.0, 50.0], rtol=0.25)
    assert rmse(r, r.used) < 0.8 * rmse(r, r.plain)
    assert "noise" in DESK.view(p, 60).figures
    forgets_nothing = result(preset("R learnt from the residuals", memory=0.99))
    assert np.sqrt(forgets_nothing.used.R[-1, 0, 0]) < sigma[-1, 0]


def test_a_tight_gate_with_a_small_q_locks_the_truth_out():
    r = result(preset("a gate that shuts out the truth"))
    assert not r.garbage.any()
    assert (~r.used.accepted).sum() > 25
    assert not r.used.accepted[-10:].any()                             # it does not come back
    assert rmse(r, r.used) > 3 * rmse(r, r.plain)


def test_more_garbage_leaves_the_rest_alone():
    few, many = result(DESK.params(share_percent=5.0)), result(DESK.params(share_percent=30.0))
    assert few.garbage.sum() < many.garbage.sum() and many.garbage[few.garbage].all()
    np.testing.assert_array_equal(few.truth, many.truth)
    np.testing.assert_array_equal(few.y[~many.garbage], many.y[~many.garbage])
    clean = DESK.params(share_percent=0.0, garbage_step=0)
    assert not result(clean).garbage.any()
    assert "rejected" not in names(DESK.view(clean, 3))


def test_beliefs_change_nothing_in_the_world():
    r, other = result(DEFAULT), result(DESK.params(r_ratio=3.0, q_ratio=0.2, treatment="adaptive"))
    np.testing.assert_array_equal(r.truth, other.truth)
    np.testing.assert_array_equal(r.y, other.y)


def test_stages_accumulate_and_carry_the_numbers():
    views = [DESK.view(DEFAULT, 38, stage) for stage in range(4)]
    for earlier, later in itertools.pairwise(views):
        assert names(earlier) < names(later)
        assert earlier.camera == later.camera
    running = {"expected": 0, "innovation_cov": 0, "innovation": 1, "nis": 2, "update": 3}
    for stage, v in enumerate(views):
        for e in v.equations:
            assert e.current == (running[e.name] == stage)
            assert (len(e.pieces) > 1) == (running[e.name] <= stage)
    assert "rejected" not in views[INNOVATION].caption and "rejected" in views[TEST].caption
    numbers = {e.name: e.pieces for e in views[UPDATE].equations}
    nu, S = numbers["innovation"][-1], numbers["innovation_cov"][-1]
    assert numbers["nis"][2] == pytest.approx(nu @ np.linalg.solve(S, nu))
    np.testing.assert_allclose(numbers["update"][-1][:2], numbers["expected"][-1])     # rejected: nothing moves
    arrow = {i.name: i for i in views[TEST].scene}["innovation"]
    assert arrow.role == "warning"
    np.testing.assert_allclose(arrow.end, DEFAULT.garbage)


def test_controls_without_effect_are_hidden():
    assert lesson.unused(DEFAULT) == {"memory"}
    assert lesson.unused(preset("R learnt from the residuals")) == {"garbage", "garbage_m"}


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.y.tobytes() == b.y.tobytes() and a.many_correlation.tobytes() == b.many_correlation.tobytes()
    assert result(DESK.params(seed=7)).y.tobytes() != a.y.tobytes()


@pytest.mark.parametrize("treatment", ["plain", "gate", "adaptive"])
def test_the_corners_of_the_filter_s_beliefs_are_finite(treatment):
    for r_ratio, q_ratio in itertools.product((0.05, 20.0), (0.01, 100.0)):
        p = DESK.params(treatment=treatment, r_ratio=r_ratio, q_ratio=q_ratio, sigma_c=0.01, sigma_x_m=1.0,
                    gate_percent=50.0, memory=0.5, garbage=(-2000.0, 2000.0))
        r = result(p)
        assert np.isfinite(r.many_nis) and np.isfinite(r.many_correlation).all() and np.isfinite(r.correlation).all()
        for step in (0, 1, 60):
            v = lesson.view(p, r, Moment(step, UPDATE))
            assert np.isfinite([*v.camera.x, *v.camera.y]).all()
            assert all(x.value is None or isinstance(x.value, str) or np.isfinite(x.value) for x in v.readouts)
            check_plots(v)
