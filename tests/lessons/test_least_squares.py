"""Least squares: the right angle, the oracle's road and guess, the triangle, and what cannot be determined."""

from dataclasses import replace

import numpy as np
import pytest

from lessons.background import least_squares as lesson
from lessons.background._least_squares_lines import HEIGHT
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)


@pytest.mark.parametrize("slopes", [(0.4, 0.3), (-1.0, 1.0), (0.0, 0.0)])
def test_the_rest_stands_at_a_right_angle_and_pythagoras_holds(slopes):
    r = DESK.result(DESK.params(slope_1=slopes[0], slope_2=slopes[1]))
    assert np.abs(r.A.T @ r.fit.residual).max() < 1e-12
    whole = np.square(np.array(DESK.default.y) - r.A @ r.z).sum()
    assert r.inside + r.across == pytest.approx(whole)
    rng = np.random.default_rng(1)
    others = np.square(np.array(DESK.default.y) - (r.fit.x + rng.normal(size=(200, 2))) @ r.A.T).sum(axis=1)
    assert others.min() > r.across


def test_nothing_is_left_over_in_the_column_space():
    p = DESK.preset("y in the column space")
    assert DESK.readouts(p)["cost"] < 1e-20 and "residual" not in DESK.items(p)
    assert {"right_angle", "residual", "foot", "columns"} <= set(DESK.items())


def test_example_4():
    given = entry("C1-08")["expected"]
    p = DESK.preset("Example 4: the road")
    r = DESK.result(p)
    np.testing.assert_allclose(r.coefficients, [given["a"], given["b"]], rtol=1e-12)
    np.testing.assert_allclose(r.residuals, given["residuals"])
    assert DESK.readouts(p)["cost"] == pytest.approx(given["rss"])
    np.testing.assert_allclose(r.gram, [[6.0, 2.0], [2.0, 5.0]])
    np.testing.assert_allclose(r.right, [5.0, 4.0])


def test_one_bad_fix_turns_the_road():
    a = DESK.readouts(DESK.preset("one fix far off"))["a"]
    assert a < 0.0 < DESK.readouts(DESK.preset("Example 4: the road"))["a"]


def test_a_steep_road_needs_another_measure():
    r = DESK.result(DESK.preset("a steep road"))
    assert abs(r.direction[1]) > 0.99 and abs(r.coefficients[0]) < 3.0        # nearly upright, but not by y = a x + b


@pytest.mark.parametrize("fixes", [(), ((1.0, 2.0),), ((1.0, 2.0), (1.0, -2.0))])
def test_fixes_that_determine_no_road(fixes):
    p = DESK.params(picture="road", fixes=fixes, total=True)
    assert DESK.readouts(p)["a"] is None and DESK.view(p).note


def test_example_3():
    given = entry("C1-07")["expected"]
    r = DESK.result(DESK.preset("Example 3: a guess"))
    np.testing.assert_allclose(r.x, given["x"], rtol=1e-12)
    found = DESK.readouts(DESK.preset("Example 3: a guess"))
    assert found["cost"] + found["guess_cost"] == pytest.approx(given["cost"])


def test_the_path_leads_from_the_measurements_to_the_guess():
    r = DESK.result(DESK.preset("Example 3: a guess"))
    np.testing.assert_allclose(r.path[0], r.plain, atol=2e-3)
    np.testing.assert_allclose(r.path[-1], DESK.default.x0, atol=6e-3)


def test_one_line_and_a_light_guess_give_the_nearest_point_of_the_line():
    p = replace(DESK.preset("one measurement and a guess"), mu=0.01)
    r = DESK.result(p)
    assert r.plain is None and "only the guess" in DESK.view(p).note
    np.testing.assert_allclose(r.x, [1.0, 1.0], atol=0.02)


def test_exercise_1_7():
    p = DESK.preset("exercise 1.7: the triangle")
    r = DESK.result(p)
    np.testing.assert_allclose(r.residuals, (6.0 - HEIGHT) / 3.0, rtol=1e-12)
    assert "6 l" in DESK.view(p).note and "5.2 l" in DESK.view(p).note
    agree = DESK.result(DESK.preset("distances that agree"))
    assert np.abs(agree.residuals).max() < 0.01 and DESK.view(DESK.preset("distances that agree")).note == ""


def test_only_the_controls_of_the_picture_are_shown():
    assert "mu" in DESK.lesson.unused_at(DESK.default) and "y" not in DESK.lesson.unused_at(DESK.default)
    assert {"y_2", "y_3"} <= set(DESK.lesson.unused_at(DESK.params(picture="guess", rows=1)))
