"""The order of rotations: exercise 1.20, six orders, own axes against the desk's, and a phone that looks like one."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from app.draw.triangulate import triangulate
from core.rotation import dcm_from_rotation_vector, rotation_vector_from_dcm
from lessons.background import _phone as phone
from lessons.background import rotation_order as lesson
from lessons.background._rotation_order_figures import ORDERS
from lessons.background._rotation_order_view import PARTS
from lessons.kit.scene import Polygon
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

DESK = Desk(lesson)
END = 3 * PARTS


def ends(p):
    return dict(zip(ORDERS, DESK.result(p).ends, strict=True))


def test_exercise_1_20_is_the_oracle_s():
    case = entry("C1-41")
    p = DESK.preset("exercise 1.20")
    assert [[getattr(p, f"axis_{k}"), getattr(p, f"angle_{k}_deg")] for k in (1, 2, 3)] == case["inputs"]["sequence"]
    C = DESK.result(p).C[-1]
    np.testing.assert_allclose(C, case["expected"]["C_B_L"], atol=1e-12)
    np.testing.assert_allclose(rotation_vector_from_dcm(C), case["expected"]["rotvec"], atol=1e-12)
    shown = DESK.readouts(p)
    assert (shown["top"], shown["screen"], shown["axis"]) == ("+y", "+z", "+z")
    assert shown["angle"] == pytest.approx(90.0) and shown["distinct"] == "3 of 6"


def test_what_the_presets_say():
    e = ends(DESK.preset("exercise 1.20"))
    swapped = e["132"]
    np.testing.assert_allclose(swapped @ [0, 1, 0], [0, 0, 1], atol=1e-12)          # the left edge is up
    assert sum(np.allclose(C, swapped) for C in e.values()) == 4
    assert DESK.readouts(DESK.preset("1.20, backwards"))["top"] == "−y"
    assert DESK.readouts(DESK.preset("1.20, axes of the desk"))["top"] == "−y"
    assert DESK.readouts(DESK.preset("six orders, six attitudes"))["distinct"] == "6 of 6"
    small = DESK.result(DESK.preset("small turns hardly care"))
    assert small.distinct == 6 and small.apart_deg.max() == pytest.approx(3.0, abs=0.02)
    halved = DESK.result(DESK.preset("small turns hardly care", angle_1_deg=5.0, angle_2_deg=5.0, angle_3_deg=5.0))
    assert small.apart_deg.max() / halved.apart_deg.max() == pytest.approx(4.0, rel=0.02)
    one = DESK.preset("one axis: the order is free")
    assert DESK.readouts(one)["distinct"] == "1 of 6" and "same attitude" in DESK.view(one).note
    assert DESK.view().note == ""


@pytest.mark.parametrize("order", ORDERS)
def test_axes_of_the_desk_are_own_axes_backwards(order):
    for name in ("exercise 1.20", "six orders, six attitudes"):
        own, desk = (ends(DESK.preset(name, about=about)) for about in ("own", "desk"))
        np.testing.assert_allclose(own[order], desk[order[::-1]], atol=1e-12)


def test_exercise_1_20_is_one_turn_about_where_the_first_carried_the_x_axis():
    R = {k: dcm_from_rotation_vector(np.radians(a) * np.eye(3)[i]) for k, (i, a) in enumerate(
        ((1, -90.0), (0, 90.0), (1, 90.0)))}
    axis = R[0] @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(R[0] @ R[1] @ R[2], dcm_from_rotation_vector(0.5 * np.pi * axis), atol=1e-12)


def test_the_chain_grows_turn_by_turn_with_its_numbers():
    p = DESK.default
    for step in (0, 4, PARTS, PARTS + 1, 2 * PARTS + 3, END):
        view = DESK.view(p, step)
        found = {e.name: e for e in view.equations}
        for k in (1, 2, 3):
            begun = step > (k - 1) * PARTS
            assert any(not isinstance(x, str) for x in found[f"chain_{k}"].pieces) == begun
            current = begun and step <= k * PARTS
            assert found[f"chain_{k}"].current == found[f"turn_{k}"].current == current
            if current:
                np.testing.assert_allclose(found[f"chain_{k}"].pieces[-1], DESK.items(p, step)["body"].dcm, atol=1e-9)
        for e in view.equations:
            for piece in e.pieces:
                if isinstance(piece, str):
                    typeset(piece)
    product = np.eye(3)
    found = {e.name: e.pieces for e in DESK.view(p).equations}
    for k in (1, 2, 3):
        product = product @ found[f"turn_{k}"][-1]
    np.testing.assert_allclose(product, found["chain_3"][-1], atol=1e-12)


@pytest.mark.parametrize("about", ["own", "desk"])
def test_every_step_turns_about_the_drawn_axis(about):
    """From one step to the next the phone turns about the dashed axis, by a PARTS-th of the angle."""
    p = DESK.params(about=about, order="231")
    C = DESK.result(p).C
    for step, (before, after) in enumerate(pairwise(C), 1):
        if step % 4 == 1 and step < END:
            axis = np.diff(DESK.items(p, step)["axis"].points, axis=0)[0]
            turned = rotation_vector_from_dcm(after @ before.T)                    # in the coordinates of the desk
            np.testing.assert_allclose(np.cross(turned, axis), 0.0, atol=1e-9)
            assert np.linalg.norm(turned) == pytest.approx(np.radians(90.0) / PARTS)
    assert {"total", "total_angle"} <= set(DESK.items(p)) and "axis" not in DESK.items(p)


def test_a_click_on_a_small_phone_chooses_its_order():
    view = DESK.view()
    assert [t.changes["order"] for t in view.targets] == list(ORDERS)
    faces = {i.name: i for i in view.scene if isinstance(i, Polygon)}
    for target in view.targets:
        middle = np.mean(faces[f"end_{target.changes['order']}_face0"].vertices, axis=0)
        assert np.linalg.norm(middle - target.position) < 0.1


def test_the_keys_lie_where_the_exercise_says():
    """9-6-3 runs along +x and 9-8-7 along +y, on the side of +z."""
    keys = phone.KEYS.reshape(12, 4, 2, 3).mean(axis=(1, 2))
    at = dict(zip(phone.STROKES, keys, strict=True))
    for line, axis in (("963", 0), ("987", 1)):
        for a, b in pairwise(line):
            step = at[b] - at[a]
            assert step[axis] > 0.2 and np.abs(np.delete(step, axis)).max() < 1e-12
    assert (keys[:, 2] > phone.DEPTH).all()


@pytest.mark.parametrize("p", [(0, 0, 0), (np.pi / 2, 0, 0), (0, -np.pi / 2, 0), (0, 0, 2), (1.0, -0.4, 0.3)])
def test_faces_can_be_filled_in_every_attitude(p):
    """Also where they stand upright: two triangles that cover the face."""
    C = dcm_from_rotation_vector(p)
    for quad in phone.FACES:
        at = np.asarray(phone.face("f", quad, C, np.zeros(3), 1.0, "muted").vertices)
        np.testing.assert_allclose(at, phone.place(quad, C, np.zeros(3), 1.0), atol=2e-3)
        corners = at[triangulate(at)]
        areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert areas.sum() == pytest.approx(np.linalg.norm(quad[1] - quad[0]) * np.linalg.norm(quad[3] - quad[0]),
                                            rel=1e-2)


@pytest.mark.parametrize("changes", [*DESK.ends(), {"angle_1_deg": 0.0, "angle_2_deg": 0.0, "angle_3_deg": 0.0},
                                     {"axis_2": "y"}], ids=str)
def test_finite_everywhere(changes):
    p = DESK.params(**changes)
    assert all(np.isfinite(a).all() for a in DESK.result(p) if isinstance(a, np.ndarray))
    for step in (0, 1, PARTS, END):
        for item in DESK.view(p, step).scene:
            for field in dataclasses.fields(item):
                value = getattr(item, field.name)
                assert not isinstance(value, np.ndarray) or np.isfinite(value).all()
