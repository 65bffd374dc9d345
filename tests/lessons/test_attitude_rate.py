"""From gyros to an attitude: the oracle's coning drift, the orders of the methods, and (1.21) by differences."""

import numpy as np
import pytest

from core.rotation import dcm_from_rotation_vector, rotation_vector_rate
from lessons.background import attitude_rate as lesson
from lessons.background._attitude_rate_figures import measured_order
from lessons.background._attitude_rate_model import METHODS, largest_errors, motion_of, track
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

DESK = Desk(lesson)


def pieces(p, name, step=None):
    return next(e for e in DESK.view(p, step).equations if e.name == name).pieces


def test_the_default_is_the_coning_motion_of_the_oracle():
    case = entry("C1-43")
    p = DESK.default
    assert np.radians(p.half_angle_deg) == pytest.approx(case["inputs"]["alpha"], abs=1e-15)
    assert 2.0 * np.pi * p.rate_hz == pytest.approx(case["inputs"]["Omega"])
    step = round(case["inputs"]["t"] * 40)                                        # frames of 1/40 s
    np.testing.assert_allclose(pieces(p, "gyros", step)[1], case["expected"]["w"], atol=1e-10)
    np.testing.assert_allclose(pieces(p, "p", step)[1], case["expected"]["p"], atol=1e-10)
    np.testing.assert_allclose(pieces(p, "terms", step)[-2], case["expected"]["pdot"], atol=1e-10)


def test_summed_gyros_drift_by_the_solid_angle_of_the_cone():
    case = entry("C1-43")["expected"]["naive_drift_per_turn"]
    p, r = DESK.default, DESK.result(DESK.default)
    ends = r.track.naive[:: p.samples]
    np.testing.assert_allclose(np.diff(ends, axis=0), np.tile(case, (p.turns, 1)), atol=1e-9)
    assert DESK.readouts()["drift"] == pytest.approx(-np.degrees(case[2])) == pytest.approx(7.176032, abs=1e-6)
    shown = DESK.readouts()
    assert shown["error_naive"] == pytest.approx(35.82, abs=0.01)                 # nearly five times 7.18
    assert shown["error_bortz"] == pytest.approx(7.1e-4, abs=1e-5)
    assert shown["error_start"] == pytest.approx(shown["error_middle"]) == pytest.approx(0.2926, abs=1e-4)
    assert r.largest_deg["naive"] == pytest.approx(np.full(5, 7.164), abs=1e-3)   # no step is short enough


def test_bortz_closes_as_the_oracle_says():
    """RK4 over one turn with 50 and 100 steps: 6.4e-8 and 4.0e-9 rad."""
    motion = motion_of(DESK.default)
    errors = [np.abs(track(motion, 1.0 / n, n).bortz[-1] - motion.p(0.0)).max() for n in (50, 100)]
    assert errors == pytest.approx([6.4e-8, 4.0e-9], rel=0.02)


@pytest.mark.parametrize("changes", [{}, {"half_angle_deg": 45.0}, {"half_angle_deg": 1.0, "rate_hz": 10.0}], ids=str)
def test_orders_of_the_methods(changes):
    r = DESK.result(DESK.params(**changes))
    for name, order in (("naive", 0.0), ("start", 1.0), ("middle", 2.0), ("bortz", 4.0)):
        assert measured_order(r, name) == pytest.approx(order, abs=0.01)


def test_late_rates_are_a_whole_step_late():
    """The chain with rates of the start runs half a step behind in phase, and meets the other after whole turns."""
    p = DESK.default
    e = DESK.result(p).track.error_deg
    np.testing.assert_allclose(e["start"][:: p.samples], e["middle"][:: p.samples], atol=1e-9)
    assert e["start"][p.samples // 2] > 10.0 * e["middle"][p.samples // 2]


def test_about_a_fixed_axis_every_method_is_right():
    for axis in ((0.4, 0.8, 0.8), (1.0, -0.3, 0.2)):
        p = DESK.preset("a fixed axis: all are right", axis=axis)
        assert all(e.max() < 1e-9 for e in DESK.result(p).track.error_deg.values())
        shown = DESK.readouts(p)
        assert shown["drift"] == 0.0 and all(shown[f"order_{m}"] is None for m in METHODS[1:])
    motion = motion_of(p)
    t = np.linspace(0.0, 3.0, 7)
    np.testing.assert_allclose(rotation_vector_rate(motion.p(t), motion.w(t)), motion.w(t), atol=1e-12)


def test_rate_of_the_matrix_is_the_oracle_s():
    case = entry("C1-38")
    p = DESK.preset("a fixed axis: all are right")
    given = case["inputs"]
    assert p.spin_rad_s == given["omega"] and DESK.result(p).check_s == given["t"]
    np.testing.assert_allclose(np.array(p.axis) / np.linalg.norm(p.axis), given["u"], atol=1e-12)
    np.testing.assert_allclose(DESK.result(p).check_rate, case["expected"]["Cdot"], atol=1e-12)


@pytest.mark.parametrize("motion", ["coning", "fixed"])
def test_difference_quotients_approach_the_formula(motion):
    r = DESK.result(DESK.params(motion=motion))
    forward, central = r.quotient_errors
    large = slice(20, 29)                                                         # where rounding does not matter
    slopes = [np.polyfit(np.log(r.h_s[large]), np.log(np.maximum(e[large], 1e-300)), 1)[0] for e in (forward, central)]
    assert slopes == pytest.approx([1.0, 2.0], abs=0.05)
    assert 10.0 * central.min() < central[0]                                      # the smallest h is not the best
    step = 7
    for name in ("dcm_rate", "quotient"):
        assert pieces(DESK.params(motion=motion), name, step)[1].shape == (3, 3)
    p = DESK.params(motion=motion)
    np.testing.assert_allclose(pieces(p, "dcm_rate", step)[1], pieces(p, "quotient", step)[1], atol=1e-6)


def test_what_is_drawn():
    p = DESK.default
    items = DESK.items()
    np.testing.assert_allclose(items["truth"].dcm, dcm_from_rotation_vector([0.2, 0.0, 0.0]), atol=1e-12)
    z = np.asarray(items["z_circle"].points)
    np.testing.assert_allclose(z[:, 2], np.cos(0.2))                              # the z axis runs round a cone
    x = items["computed"].dcm[:, 0]
    assert np.degrees(np.arccos(x @ items["truth"].dcm[:, 0])) > 30.0
    assert "true_x_name" in items and "true_x_name" not in DESK.items(DESK.preset("the Bortz equation"))
    for step in (0, 13, 200):
        view = DESK.view(p, step)
        sample = min(step * p.samples // 40, len(DESK.result(p).track.t_s) - 1)
        now = next(i for i in view.scene if i.name == "computed").dcm
        np.testing.assert_array_equal(now, DESK.result(p).track.C["naive"][sample])
        assert view.camera == DESK.view(p).camera
    for e in DESK.view(p).equations:
        for piece in e.pieces:
            if isinstance(piece, str):
                typeset(piece)


def test_presets_do_what_they_say():
    assert DESK.readouts(DESK.preset("a wide cone"))["drift"] == pytest.approx(105.4, abs=0.1)
    vibration = DESK.preset("vibration: 1°, 10 times a second")
    assert DESK.readouts(vibration)["drift"] * vibration.rate_hz == pytest.approx(0.55, abs=0.002)
    assert DESK.readouts(DESK.preset("few samples"))["error_bortz"] == pytest.approx(1.0, abs=0.05)
    assert DESK.preset("small rotations, one after the other").method == "middle"
    assert largest_errors(motion_of(DESK.default), 12)["start"] > 5.0
    assert DESK.lesson.unused_at(DESK.default) == {"axis", "spin_rad_s"}


@pytest.mark.parametrize("changes", [
    *DESK.ends(), {"motion": "fixed", "axis": (0.0, 0.0, 0.0)}, {"half_angle_deg": 60.0, "samples": 4, "turns": 8},
    {"motion": "fixed", "samples": 4, "turns": 8, "spin_rad_s": 5.0}], ids=str)
def test_finite_everywhere(changes):
    p = DESK.params(**changes)
    last = DESK.lesson.timeline_of(p).steps
    for step in (0, 1, last):
        view = DESK.view(p, step)
        for item in view.scene:
            for name in ("points", "positions", "position", "end", "dcm"):
                value = getattr(item, name, None)
                assert value is None or np.isfinite(np.asarray(value, dtype=float)).all()
        for figure in view.figures.values():
            assert all(np.isfinite(t.y).all() for t in figure.data)
    if changes.get("axis") == (0.0, 0.0, 0.0):
        assert "no direction" in view.note
