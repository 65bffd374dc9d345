"""Rotation vector: MAT Example 12, exercises 1.17 and 1.18, and what full turns do to matrix and quaternion."""

from typing import Any

import numpy as np
import pytest

from lessons.background import rotation_vector as lesson
from lessons.background.rotation_vector import Params, Result
from lessons.kit.lesson import Moment, View, no_progress
from lessons.kit.scene import Arrow, Frame, RotationVector
from tests.lessons.support import Desk, everything
from tests.oracle import entry

DESK = Desk(lesson)
END = 60


def shown(step: int = END, **changes: Any) -> tuple[Params, Result, View]:
    p = DESK.params(**changes)
    return p, DESK.result(p), DESK.view(p, step)


def preset(name: str, step: int = END) -> tuple[Params, Result, View]:
    return shown(step, **lesson.LESSON.presets[name])


def numbers(view: View, name: str) -> list[np.ndarray]:
    """The numbers in one formula."""
    found = next(e for e in view.equations if e.name == name)
    return [np.asarray(piece) for piece in found.pieces if not isinstance(piece, str)]


def readout(view: View, name: str) -> Any:
    return next(r.value for r in view.readouts if r.name == name)


def item(view: View, name: str) -> Any:
    return next(i for i in view.scene if i.name == name)


def test_example_12() -> None:
    expected = entry("C1-32")["expected"]
    _, _, view = preset("Example 12, θ = 30°")
    np.testing.assert_allclose(numbers(view, "dcm_back")[0], expected["C_A1_A2"], atol=1e-12)
    np.testing.assert_allclose(numbers(view, "a")[-1], expected["a_A2"], atol=1e-12)


def test_exercise_1_18_the_opposite_turn_is_the_transpose() -> None:
    forth, back = (numbers(preset(name)[2], "dcm")[0]
                   for name in ("Example 12, θ = 30°", "exercise 1.18, θ = −30°"))
    np.testing.assert_allclose(forth, back.T, atol=1e-15)
    assert np.abs(forth - back).max() > 0.9


def test_rotation_vector_of_the_oracle() -> None:
    case = entry("C1-33")
    _, _, view = preset("p = [0.3, −0.2, 0.5]")
    p, length = numbers(view, "p")
    np.testing.assert_allclose(p, case["inputs"]["p"], atol=1e-12)
    np.testing.assert_allclose(length, case["expected"]["norm"], atol=1e-12)
    np.testing.assert_allclose(numbers(view, "dcm")[0], case["expected"]["C"], atol=1e-12)
    np.testing.assert_allclose(numbers(view, "quaternion")[0], case["expected"]["q"], atol=1e-12)
    np.testing.assert_allclose(readout(view, "trace"), case["expected"]["trace"], atol=1e-11)
    np.testing.assert_allclose(numbers(view, "invariant")[0], entry("C1-45")["expected"]["Cp"], atol=1e-12)


@pytest.mark.parametrize("step", [0, 17, END])
def test_exercise_1_17_only_the_axis_looks_the_same_from_both_frames(step: int) -> None:
    assert readout(preset("exercise 1.17: a along the axis", step)[2], "a_difference") == 0
    for changes in ({}, {"angle_deg": 400.0}, {"angle_deg": -250.0}):
        _, _, view = shown(step, **changes)
        assert readout(view, "p_difference") == 0
        assert step == 0 or readout(view, "a_difference") > 0.1


def test_default_turns_the_frame_and_leaves_the_vector() -> None:
    _, _, start = shown(0)
    p, _, end = shown()
    np.testing.assert_array_equal(item(start, "A2").dcm, np.eye(3))
    assert np.abs(item(end, "A2").dcm - np.eye(3)).max() > 0.5
    for view in (start, end):
        np.testing.assert_array_equal(item(view, "a").end, p.a)
        np.testing.assert_array_equal(item(view, "A1").dcm, np.eye(3))
    assert isinstance(item(end, "p"), RotationVector)
    assert np.linalg.norm(item(end, "p").p) == pytest.approx(np.radians(p.angle_deg))
    assert not any(i.name == "p" for i in start.scene)


def test_components_add_up_to_the_vector_in_both_frames() -> None:
    p, _, view = shown()
    for frame in ("A1", "A2"):
        feet = np.asarray(item(view, f"feet_{frame}").positions)
        np.testing.assert_allclose(feet.sum(axis=0), p.a, atol=1e-12)
        axes: Frame = item(view, frame)
        np.testing.assert_allclose(np.diag(axes.dcm.T @ feet.T), axes.dcm.T @ p.a, atol=1e-12)


def test_a_full_turn_changes_the_quaternion_and_not_the_matrix() -> None:
    _, _, long = preset("400°: beyond a full turn")
    _, _, short = shown(angle_deg=40.0)
    np.testing.assert_allclose(numbers(long, "dcm")[0], numbers(short, "dcm")[0], atol=1e-14)
    np.testing.assert_allclose(numbers(long, "quaternion")[0], -numbers(short, "quaternion")[0], atol=1e-14)
    assert readout(long, "sign") == "−q" and readout(short, "sign") == "+q"
    assert readout(long, "shortest_deg") == pytest.approx(40.0)
    assert "opposite sign" in long.note and short.note == ""
    twice = shown(angle_deg=700.0)[2]
    assert readout(twice, "sign") == "+q" and "same quaternion" in twice.note


def test_periods_in_the_plots() -> None:
    _, r, view = shown()
    turn = int(np.flatnonzero(np.isclose(r.grid_deg, r.grid_deg[0] + 360.0))[0])
    np.testing.assert_allclose(r.a_A2[turn:], r.a_A2[:-turn], atol=1e-12)
    np.testing.assert_allclose(r.q[turn:], -r.q[:-turn], atol=1e-12)
    np.testing.assert_allclose(r.q[2 * turn:], r.q[:-2 * turn], atol=1e-12)
    assert np.abs(r.shorter_deg).max() <= 180.0 + 1e-9
    short = np.abs(r.grid_deg) < 179.0
    np.testing.assert_allclose(r.shorter_deg[short], r.grid_deg[short], atol=1e-9)
    for figure in view.figures.values():
        assert any(s.name == "cursor" and s.x0 == pytest.approx(65.0) for s in figure.layout.shapes)


def test_half_turn_is_its_own_inverse() -> None:
    _, _, view = preset("a half turn")
    C = numbers(view, "dcm")[0]
    np.testing.assert_allclose(C, C.T, atol=1e-12)
    assert "half turn" in view.note


def test_carried_vector_keeps_its_coordinates_in_the_turned_frame() -> None:
    p, _, view = preset("turn a with the frame", step=25)
    carried: Arrow = item(view, "carried")
    np.testing.assert_allclose(item(view, "A2").dcm.T @ np.asarray(carried.end), p.a, atol=1e-12)
    path = np.asarray(item(view, "carried_path").points)
    np.testing.assert_allclose(path[[0, -1]], [p.a, carried.end], atol=1e-12)


@pytest.mark.parametrize("changes", [{"axis": (0.0, 0.0, 0.0)}, {"angle_deg": 0.0}, *DESK.ends()], ids=str)
def test_finite_and_reproducible_at_the_ends(changes: dict[str, Any]) -> None:
    p = DESK.params(**changes)
    for step in (0, 31, END):
        first, second = (everything(lesson.LESSON.view(p, lesson.compute(p, no_progress), Moment(step)))
                         for _ in range(2))
        assert first == second
        assert np.isfinite(np.frombuffer(first)).all()


def test_axis_without_direction_says_what_it_does() -> None:
    _, r, view = shown(axis=(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(r.u, [0, 0, 1])
    assert "z axis" in view.note
