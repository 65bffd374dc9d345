"""Rotating frames: Example 13 and exercise 1.19 with the oracle's numbers, and velocities that are derivatives."""

import dataclasses

import numpy as np
import pytest

from core.moving_frames import EARTH_RATE
from core.rotation import skew
from lessons.background import rotating_frames as lesson
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

DESK = Desk(lesson)
EARTH, TRAIN = DESK.params(scene="earth"), DESK.params(scene="train")


def test_example_13_at_two_seconds():
    case = entry("C1-36")
    p = DESK.preset("Example 13: a fixed object, ω = 0.5")
    assert p.start == p.goal == tuple(case["inputs"]["a_A1"]) and p.spin_rad_s == case["inputs"]["omega"]
    step = lesson.LESSON.presets["Example 13: a fixed object, ω = 0.5"]["step"]
    r = DESK.result(p)
    assert r.t_s[step] == case["inputs"]["t"]
    np.testing.assert_allclose(r.v_A2[step], case["expected"]["da_A2"], atol=1e-10)
    assert DESK.readouts(p, step)["speed_A2"] == pytest.approx(case["expected"]["speed"], abs=1e-10)
    assert DESK.readouts(p, step)["speed_A1"] == 0.0
    np.testing.assert_allclose(np.linalg.norm(r.a_A2[:, :2], axis=1), np.sqrt(2.0))
    assert np.all(np.cross(r.a_A2[:-1], r.a_A2[1:])[:, 2] < 0.0)                    # clockwise


def test_velocity_and_acceleration_are_the_derivatives_of_what_the_rider_sees():
    for p in (DESK.default, DESK.preset("straight across the platform"), DESK.params(spin_rad_s=-1.5)):
        r = DESK.result(p)
        dt = r.t_s[1]
        v = (r.a_A2[2:] - r.a_A2[:-2]) / (2.0 * dt)
        a = (r.a_A2[2:] - 2.0 * r.a_A2[1:-1] + r.a_A2[:-2]) / dt**2
        np.testing.assert_allclose(v, r.v_A2[1:-1], atol=0.02)
        np.testing.assert_allclose(a, (r.coriolis + r.centrifugal)[1:-1], atol=0.03)
        np.testing.assert_allclose(r.C @ r.v_A1 + r.carried, r.v_A2, atol=1e-12)


def test_the_default_is_a_line_for_the_ground_and_a_spiral_for_the_platform():
    r = DESK.result(DESK.default)
    bends = np.cross(np.diff(r.a_A1, axis=0)[:-1], np.diff(r.a_A1, axis=0)[1:])
    assert np.abs(bends).max() < 1e-12
    angle = np.unwrap(np.arctan2(r.a_A2[1:, 1], r.a_A2[1:, 0]))
    distance = np.linalg.norm(r.a_A2, axis=1)
    np.testing.assert_allclose(np.diff(angle), -0.7 * r.t_s[1], atol=1e-9)          # evenly round ...
    np.testing.assert_allclose(np.diff(distance), distance[1])                      # ... and evenly outwards
    assert np.ptp(angle) > 2.0 * np.pi
    still = DESK.result(DESK.preset("no spin, no Coriolis"))
    np.testing.assert_allclose(still.a_A1, still.a_A2)
    assert not still.coriolis.any() and "Without spin" in DESK.view(DESK.preset("no spin, no Coriolis")).note


def test_arrows_of_the_velocity_close_the_triangle():
    for step in (10, 80):
        items = DESK.items(step=step)
        np.testing.assert_allclose(items["v_turned"].end, items["carried"].start)
        np.testing.assert_allclose(items["carried"].end, items["v_A2"].end, atol=1e-12)
    names = DESK.items(DESK.preset("straight across the platform"), 40)
    assert {"coriolis", "centrifugal"} <= set(names) and "v_A2" not in names


def test_exercise_1_19_is_the_oracle_s():
    case = entry("C1-39")
    given, want = case["inputs"], case["expected"]
    p = DESK.preset("exercise 1.19: Helsinki to Rovaniemi")
    assert (p.mass_t * 1e3, p.speed_kmh, p.to_deg) == (given["M"], given["v_kmh"], given["lat1"])
    assert p.from_deg == pytest.approx(given["lat0"], abs=1e-11)
    start, end = DESK.readouts(p, 0), DESK.readouts(p, 40)
    assert start["force"] == pytest.approx(want["F_Helsinki"], rel=1e-8)
    assert end["force"] == pytest.approx(want["F_Rovaniemi"], rel=1e-8)
    assert start["push"] == pytest.approx(want["accel_Helsinki"], rel=1e-8)
    assert start["travel"] * 60.0 == pytest.approx(want["travel_time"], rel=1e-8)
    assert (start["axis_angle"], end["axis_angle"]) == pytest.approx([a["deg"] for a in want["angle_deg_at"]])
    assert start["side"] == end["side"] == "west"
    timeline = DESK.lesson.timeline_of(p)
    assert timeline.steps * timeline.scale == pytest.approx(start["travel"])


def test_the_push_changes_its_side_at_the_equator_and_grows_with_mass_and_speed():
    across = DESK.preset("across the equator")
    assert [DESK.readouts(across, k)["side"] for k in (0, 20, 40)] == ["east", "none", "west"]
    south = DESK.preset("1.19 in the southern hemisphere")
    north = DESK.readouts(DESK.preset("exercise 1.19: Helsinki to Rovaniemi"), 0)
    assert DESK.readouts(south, 0)["force"] == pytest.approx(north["force"])
    items = DESK.items(south, 0)
    v, drift = (np.asarray(items[n].end) - items[n].start for n in ("velocity", "deflection"))
    assert np.cross(v, drift) @ items["velocity"].start > 0.0                       # to the left, seen from above
    items = DESK.items(TRAIN, 0)
    v, drift, push = (np.asarray(items[n].end) - items[n].start for n in ("velocity", "deflection", "push"))
    assert np.cross(v, drift) @ items["velocity"].start < 0.0                       # to the right in the north
    np.testing.assert_allclose(push, -drift)
    for change in ({"mass_t": 200.0}, {"speed_kmh": 600.0}):
        assert DESK.readouts(dataclasses.replace(TRAIN, **change), 0)["force"] == pytest.approx(2 * north["force"])


def test_the_train_s_arrow_makes_the_printed_angle_with_the_axis():
    for p in (TRAIN, DESK.preset("1.19 in the southern hemisphere"), DESK.params(scene="train", to_deg=-20.0)):
        items = DESK.items(p, 13)
        v = np.asarray(items["velocity"].end) - items["velocity"].start
        angle = np.degrees(np.arccos(v[2] / np.linalg.norm(v)))
        assert angle == pytest.approx(DESK.readouts(p, 13)["axis_angle"])
        arc = np.asarray(items["angle"].points) - items["velocity"].start
        np.testing.assert_allclose(np.cross(arc[-1], v), 0.0, atol=1e-9)


def test_gyros_on_a_table_feel_the_turning_earth():
    shown = DESK.readouts(EARTH)
    assert shown["gyro"] == pytest.approx(np.degrees(EARTH_RATE) * 3600.0)
    assert (shown["rate_east"], shown["rate_up"]) == pytest.approx((0.0, shown["gyro"] * np.sin(np.radians(60.0))))
    for heading in (0.0, 130.0):
        turned = DESK.readouts(dataclasses.replace(EARTH, heading_deg=heading, pitch_deg=-20.0))
        assert turned["gyro"] == pytest.approx(shown["gyro"])
    flying = DESK.preset("a plane flying east")
    assert DESK.readouts(flying)["gyro"] > 1.8 * shown["gyro"]
    west = DESK.readouts(dataclasses.replace(flying, course_deg=270.0, lat_deg=60.0, ground_speed_kmh=840.0))
    assert west["gyro"] < 0.3 * shown["gyro"]                                       # nearly keeps up with the sun


def test_the_local_frame_turns_at_the_rate_that_is_shown():
    """dC_L^I/dt = C_L^I (w_IL^L x), MAT (1.21), for a place that only the Earth carries."""
    r = DESK.result(EARTH)
    C = r.C_IE.mT @ r.C_EL.T
    middle = C[10]
    rate = (C[11] - C[9]) / (2.0 * r.t_s[1])
    np.testing.assert_allclose(rate, middle @ skew(r.rates.total), atol=2e-3 * EARTH_RATE)


@pytest.mark.parametrize("seen_from", ["stars", "earth"])
def test_frames_of_the_earth_fit_together(seen_from):
    p = dataclasses.replace(EARTH, seen_from=seen_from)
    for step in (0, 30, 96):
        items = DESK.items(p, step)
        I, E, L, B = (items[n].dcm for n in "IELB")
        np.testing.assert_allclose((I if seen_from == "stars" else E), np.eye(3))
        found = {e.name: e.pieces[-1] for e in DESK.view(p, step).equations}
        for name, product in (("C_IE", E.T @ I), ("C_EL", L.T @ E), ("C_LB", B.T @ L), ("C_IB", B.T @ I)):
            np.testing.assert_allclose(found[name], product, atol=1e-9)
        np.testing.assert_allclose(items["place"].positions[0], L[:, 2])


def test_only_what_matters_is_shown_and_formulas_typeset():
    names = set(lesson.Params.__dataclass_fields__)
    for scene, own in lesson.GROUPS.items():
        p = DESK.params(scene=scene)
        assert names - set(DESK.lesson.unused_at(p)) == own | {"scene"}
        for e in DESK.view(p).equations:
            for piece in e.pieces:
                if isinstance(piece, str):
                    typeset(piece)


def ends():
    for scene in lesson.SCENES:
        for changes in DESK.ends():
            if next(iter(changes)) in lesson.GROUPS[scene]:
                yield {"scene": scene, **changes}


@pytest.mark.parametrize("changes", [*ends(), {"goal": (0.0, 0.0, 0.0)}, {"scene": "train", "to_deg": 60.1},
                                     {"scene": "train", "from_deg": 66.5}], ids=str)
def test_finite_everywhere(changes):
    p = DESK.params(**changes)
    last = DESK.lesson.timeline_of(p).steps
    for step in (0, 1, last):
        view = DESK.view(p, step)
        for item in view.scene:
            for name in ("points", "positions", "pairs", "position", "origin", "start", "end"):
                value = getattr(item, name, None)
                assert value is None or np.isfinite(np.asarray(value, dtype=float)).all()
        for figure in view.figures.values():
            assert all(np.isfinite(t.y).all() for t in figure.data)
