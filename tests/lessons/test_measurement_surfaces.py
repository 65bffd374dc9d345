"""Measurements as curves and surfaces: the oracle's values, Fig 2.1, and where they meet."""

import itertools

import numpy as np
import pytest

from lessons.static import measurement_surfaces as lesson
from lessons.static._surfaces_meeting import at_height, on_patch
from lessons.static._surfaces_numbers import jacobian
from lessons.static._surfaces_plane import picture_box
from lessons.static._surfaces_shapes import curve, grid, patch
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
TRUTH, MEASURE, SURFACE, MEET = range(4)
KINDS = ("x1", "x2", "height", "range", "pseudorange", "difference", "bearing", "radar")


def rows(p, step=0):
    return lesson.state_at(p, DESK.result(p), step)


def one(kind, **changes):
    return DESK.params(first=kind, second="none", third="none", **changes)


def test_fig_2_1_the_circles_meet_for_the_right_bias_only():
    p = DESK.default
    off = [DESK.readouts(p, step)["common"] for step in (0, 10, 19, 20, 21, 30, 80)]
    assert off == ["none", "none", "none", "1", "none", "none", "none"]
    assert DESK.readouts(p, 20)["near"] == 0.0 and "common" in DESK.items(p, 20)
    misfit = DESK.result(p).misfit_m
    assert misfit.argmin() == 20 and misfit[20] < 1e-6
    assert misfit[0] > 15.0 and (np.diff(misfit[:21]) < 0.0).all() and (np.diff(misfit[20:]) > 0.0).all()


def test_the_assumed_bias_shrinks_all_circles_alike():
    for step in (0, 7, 33):
        items = DESK.items(DESK.default, step)
        found, assumed, _ = rows(DESK.default, step)
        assert assumed == step
        for i, row in enumerate(found):
            radius = np.linalg.norm(items[f"curve_{i + 1}"].pairs - row.stations[0], axis=-1)
            np.testing.assert_allclose(radius, row.exact - step, atol=0.02)


def test_two_pseudoranges_cannot_tell_the_bias():
    p = DESK.params(third="none")
    assert DESK.readouts(p, 0)["common"] == DESK.readouts(p, 10)["common"] == DESK.readouts(p, 20)["common"] == "2"


def test_oracle_C2_01_exercise_2_1():
    e = entry("C2-01")["expected"]
    assert DESK.default.user == tuple(entry("C2-01")["inputs"]["x"])
    for name, value in (("a: a coordinate", e["a"]), ("b: a range", e["b"]), ("c: a bearing", e["c_deg"]),
                        ("d: a range difference", e["d"])):
        p = DESK.preset(f"exercise 2.1 {name}")
        assert DESK.readouts(p)["y_1"] == pytest.approx(value, rel=1e-9)
        pieces = {q.name: q.pieces for q in DESK.view(p).equations}["row_1"]
        assert pieces[2] == pytest.approx(value, rel=1e-9)


def test_oracle_C2_19_the_radar_of_exercise_2_6():
    e = entry("C2-19")
    p = DESK.preset("exercise 2.6: radar on a rotating arm")
    assert [*p.user, p.velocity_1_mps, p.velocity_2_mps] == e["inputs"]["x"]
    shown = DESK.readouts(p, 0)
    np.testing.assert_allclose([shown["y_1"], shown["y_2"]], e["expected"]["h"], atol=1e-9)
    np.testing.assert_allclose(jacobian(p, rows(p)[0]), e["expected"]["J"], atol=1e-9)
    assert shown["common"] == "2" and shown["near"] == 0.0
    r = DESK.result(p).radar
    np.testing.assert_allclose(r[0], e["expected"]["h"], atol=1e-9)
    x, v, t = np.array(p.user), np.array([1.0, -0.5]), 1e-6              # the rate is the derivative by time
    def distance(t):
        return np.linalg.norm(x + t * v - [np.cos(t), np.sin(t)])

    assert (distance(t) - distance(-t)) / (2 * t) == pytest.approx(r[0, 1], abs=1e-6)


def test_the_arm_turns_with_the_timeline():
    p = DESK.preset("exercise 2.6: radar on a rotating arm")
    assert DESK.view(p, 15).caption == "t = 1.5 s"
    antenna = DESK.items(p, 15)["stations"].positions[0]
    np.testing.assert_allclose(antenna, [np.cos(1.5), np.sin(1.5)])
    assert DESK.view(p, 0).camera == DESK.view(p, 40).camera
    np.testing.assert_allclose(DESK.result(p).radar[15], [DESK.readouts(p, 15)[k] for k in ("y_1", "y_2")])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_h_has_the_measured_value_on_every_drawn_curve_and_surface(kind, space):
    if (kind, space) == ("height", "plane"):
        assert DESK.view(one(kind)).note.startswith("A height measures nothing")
        return
    p = one(kind, space=space, user=(12.0, 35.0), arm_m=5.0)
    found, assumed, _ = rows(p, 4)
    assumed = p.bias_m
    box = picture_box(p, found)
    _, _, uu, vv = grid()
    for row in found:
        if space == "plane":
            points = np.concatenate(curve(row, row.target(assumed), box))
        else:
            points = patch(row, row.target(assumed), box)(uu, vv).reshape(-1, 3)
        away = np.ones(len(points), dtype=bool)
        if len(row.stations):
            away = np.linalg.norm((points - row.stations[0])[:, :2], axis=1) > 1e-6
        assert np.abs(row.residual(points[away], assumed)).max() < 1e-9


@pytest.mark.parametrize("second", ["x1", "range", "difference", "bearing"])
@pytest.mark.parametrize("first", ["x2", "range", "difference", "bearing"])
def test_curves_of_true_measurements_meet_at_the_user(first, second):
    p = DESK.params(first=first, second=second, third="none")
    shown = DESK.readouts(p)
    assert int(shown["common"]) in (1, 2) and shown["near"] == 0.0


def test_a_range_and_a_bearing_of_one_station_meet_once_at_a_right_angle():
    p = DESK.preset("a range and a bearing")
    assert DESK.readouts(p)["common"] == "1"
    J = jacobian(p, rows(p)[0])
    assert J[0] @ J[1] == pytest.approx(0.0, abs=1e-12)


def test_three_spheres_meet_in_two_points_and_two_in_a_circle():
    p = DESK.preset("three spheres in space")
    shown, items = DESK.readouts(p), DESK.items(p)
    assert shown["common"] == "2" and shown["near"] == 0.0
    circle = items["meet_12"].pairs
    found, *_ = rows(p)
    for row in found[:2]:
        assert np.abs(row.residual(circle, 0.0)).max() < 0.3            # straight pieces of the drawn mesh
    assert DESK.readouts(DESK.preset("sphere, half-plane and plane"))["common"] == "1"


def test_cut_at_the_users_height_the_surface_is_the_curve_in_the_plane():
    p = DESK.params(space="space", first="difference", second="none", third="none", height_m=0.0, height_2_m=0.0,
                    user=(10.0, 30.0))
    flat = one("difference", user=(10.0, 30.0))
    shape = patch(rows(p)[0][0], rows(p)[0][0].y, picture_box(p, rows(p)[0]))
    cut = at_height(shape, 0.0)
    assert len(cut) > 20 and np.abs(rows(flat)[0][0].residual(cut[..., :2], 0.0)).max() < 0.5


def test_a_bearing_is_not_continued_behind_its_station():
    p = DESK.params(space="space", first="range", second="bearing", third="none", station_2=(0.0, 0.0))
    found, *_ = rows(p)
    pairs = on_patch(patch(found[0], found[0].y, picture_box(p, found)), found[1], 0.0)
    way = np.array([30.0, 40.0]) / 50.0
    assert len(pairs) and (pairs[..., :2] @ way > -1e-9).all()


def test_errors_move_the_curves():
    p = DESK.params(first="range", second="range", third="range", noisy=True)
    assert DESK.readouts(p)["common"] == "none"
    found, *_ = rows(p)
    assert all(0.0 < abs(row.y - row.exact) < 4.0 * row.sigma for row in found)
    assert {row.y for row in rows(DESK.params(noisy=True, seed=2))[0]} != {row.y for row in rows(p)[0]}


def test_stages_accumulate():
    for p in (DESK.default, DESK.preset("three spheres in space")):
        for earlier, later in itertools.pairwise([DESK.view(p, 0, stage) for stage in range(4)]):
            assert {i.name for i in earlier.scene} <= {i.name for i in later.scene}
            assert earlier.camera == later.camera
    before, after = (DESK.view(step=0, stage=stage).equations[0].pieces for stage in (TRUTH, MEASURE))
    assert not any(isinstance(x, float) and x == pytest.approx(70.0) for x in before)
    assert any(isinstance(x, float) and x == pytest.approx(70.0) for x in after)


def test_only_what_matters_is_shown():
    assert {"velocity_1_mps", "sigma_deg", "height_m", "seed"} <= lesson.LESSON.unused_at(DESK.default)
    assert {"station_2", "station_3", "bias_m"} <= lesson.LESSON.unused_at(one("range"))
    assert "station_2" not in lesson.LESSON.unused_at(one("difference"))
    assert lesson.LESSON.timeline_of(one("range")).steps == 0


@pytest.mark.parametrize("changes", [
    {"user": (0.0, 0.0)}, {"station_2": (0.0, 0.0), "first": "difference"}, {"user": (0.0, 0.0), "first": "bearing"},
    {"user": (-50.0, 0.0), "first": "difference"},
    {"first": "radar", "arm_m": 0.0, "velocity_1_mps": 0.0, "velocity_2_mps": 0.0},
    {"first": "radar", "user": (1.0, 0.0)}, {"noisy": True, "sigma_m": 20.0, "sigma_deg": 20.0, "user": (0.0, 1.0)},
    {"first": "radar", "noisy": True, "sigma_mps": 1.0},
], ids=str)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_degenerate_geometry_stays_finite(changes, space):
    p = DESK.params(**changes, space=space)
    for step, stage in ((0, TRUTH), (0, MEET), (DESK.lesson.timeline_of(p).steps, MEET)):
        view = DESK.view(p, step, stage)
        for x in view.readouts:
            assert x.value is None or isinstance(x.value, str) or np.isfinite(x.value)
        for item in view.scene:
            for field in ("pairs", "positions", "points", "segments", "vertices"):
                assert np.isfinite(np.asarray(getattr(item, field, 0.0), dtype=float)).all()
    if "station_2" in changes and space == "plane":
        assert "no hyperbola" in DESK.view(p).note
