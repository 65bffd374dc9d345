"""Gauss-Newton on ranges: the oracle's iterates, two starts with two ends, and where the steps go astray."""

import itertools

import numpy as np
import pytest

from lessons.static import gauss_newton as lesson
from lessons.static._gauss_newton_model import LIMIT, residual_norms
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
LINEARISE, SOLVE, STEP, TEST = range(4)
A, B = entry("C2-12")["expected"]["A"], entry("C2-12")["expected"]["B"]


def result(name):
    return DESK.result(DESK.preset(name))


def test_exercise_2_3_the_first_step():
    p = DESK.preset("exercise 2.3: first step from [0, 0]")
    numbers = {e.name: e.pieces[-1] for e in DESK.view(p, 0).equations}
    np.testing.assert_allclose(numbers["h"], [100.0, 50.0])
    np.testing.assert_allclose(numbers["residual"], [-8.0, 4.0])
    np.testing.assert_allclose(numbers["jacobian"], -np.eye(2), atol=1e-15)
    np.testing.assert_allclose(numbers["step"], [-8.0, 4.0])
    np.testing.assert_allclose(numbers["next"], [-8.0, 4.0])
    assert DESK.readouts(p, 0)["norm"] == pytest.approx(np.linalg.norm(np.hypot([108, 8], [4, 46]) - [108, 46]))


def test_oracle_C2_10_all_iterates():
    e = entry("C2-10")["expected"]
    fix = result("exercise 2.16 a: start [0, 0]").fix
    np.testing.assert_allclose(fix.iterates, e["iterates"], rtol=0, atol=1e-7)
    assert len(fix.steps) == e["steps"]
    assert DESK.readouts(DESK.preset("exercise 2.16 a: start [0, 0]"), 3)["needed"] == "4"
    assert "stop" in DESK.view(DESK.preset("exercise 2.16 a: start [0, 0]"), 3).caption


def test_the_two_starts_of_exercise_2_16_reach_different_solutions():
    a, b = result("exercise 2.16 a: start [0, 0]"), result("exercise 2.16 b: start [100, 100]")
    np.testing.assert_allclose(a.fix.x, A, atol=1e-6)
    np.testing.assert_allclose(b.fix.x, B, atol=1e-6)
    assert len(b.fix.steps) == 5
    assert a.fix.residual_norms[-1] < 1e-6 and b.fix.residual_norms[-1] < 1e-6      # both fit exactly
    np.testing.assert_allclose(a.ends, [A, B], atol=1e-4)


def test_oracle_C2_17_the_map_of_starts():
    e = entry("C2-17")
    r = result("exercise 2.16 c: where every start leads")
    for text_row, y in zip((e["expected"][f"x2={v}"] for v in (150, 100, 50, 0, -50)), (150, 100, 50, 0, -50),
                           strict=True):
        for text, x in zip(text_row, e["inputs"]["x1"], strict=True):
            i, j = (int(np.abs(axis - v).argmin()) for axis, v in zip(r.axes[::-1], (y, x), strict=True))
            assert (r.axes[0][j], r.axes[1][i]) == (x, y)               # the map has these very points
            if text == "singular":
                assert r.starts.singular[i, j] and r.where[i, j] == -1
            elif text != "A65":                                         # more iterations than the lesson allows
                assert r.where[i, j] == "AB".index(text[0])
            if text[1:] and text not in ("singular", "A65", "B19"):
                assert r.starts.steps[i, j] == int(text[1:])


def test_the_line_through_the_stations_parts_the_starts():
    r = DESK.result(DESK.default)
    x, y = np.meshgrid(*r.axes)
    above = y - (50.0 - x / 2.0)                                        # metres north of the line
    far = np.abs(above) > 45.0
    assert (r.where[far & (above > 0) & (x > -20) & (x < 100)] == 1).all()
    assert (r.where[far & (above < 0) & (x > -20) & (x < 100)] == 0).all()
    shares = [float((r.where == i).mean()) for i in (0, 1, -1)]
    assert shares == pytest.approx([0.348, 0.602, 0.050], abs=0.002)


def test_oracle_C2_18_and_C2_14_three_ranges():
    p = DESK.preset("Example 16: three ranges")
    r, e = DESK.result(p), entry("C2-18")["expected"]
    np.testing.assert_allclose(r.fix.jacobians[0], e["J"], atol=1e-10)
    np.testing.assert_allclose(r.sensor.h(r.fix.iterates[0]), e["h"], atol=1e-10)
    e = entry("C2-14")["expected"]
    np.testing.assert_allclose(r.fix.x, e["x"], atol=1e-3)
    five = DESK.result(DESK.preset("Example 16: three ranges", tolerance_m=1e-6, sigma_1_m=5.0, sigma_2_m=5.0,
                                   sigma_3_m=5.0))
    np.testing.assert_allclose(five.fix.x, e["x"], atol=1e-6)
    np.testing.assert_allclose(five.fix.residuals[-1], e["residual"], atol=1e-6)
    np.testing.assert_allclose(five.fix.cov, e["cov"], atol=1e-5)
    assert np.linalg.norm(five.fix.residuals[-1] @ five.fix.jacobians[-1]) < 1e-6


def test_rows_of_the_jacobian_point_away_from_the_stations():
    r, items = result("Example 16: three ranges"), DESK.items(DESK.preset("Example 16: three ranges"), 0)
    x = r.fix.iterates[0]
    for i, s in enumerate(r.sensor.stations_m):
        arrow = items[f"row_{i + 1}"]
        assert (arrow.end - arrow.start) @ (x - s) == pytest.approx(22.0 * np.linalg.norm(x - s))


def test_weights_move_the_solution_to_the_good_circle_and_shrink_the_ellipse():
    p = DESK.preset("Algorithm 2: weighted")
    r = DESK.result(p)
    good, plain = np.abs(r.fix.residuals[-1]), np.abs(r.other.residuals[-1])
    assert good[0] < 0.6 < 2.0 < plain[0]
    assert np.linalg.norm(r.fix.x - r.other.x) > 2.0
    assert np.trace(r.fix.cov) < 0.6 * np.trace(r.other.cov)
    assert {"error", "other"} <= set(DESK.items(p, 40))
    numbers = {q.name: q.pieces for q in DESK.view(p, 0).equations}
    np.testing.assert_allclose(numbers["white"][2] * [[1.0], [5.0], [10.0]], numbers["jacobian"][-1])


def test_astray_and_damped():
    wild, tame = result("a start that goes astray"), result("the same start, damped")
    assert len(wild.fix.steps) == 19 and np.linalg.norm(wild.fix.steps, axis=1).max() > 600.0
    assert len(tame.fix.steps) == 7 and np.linalg.norm(tame.fix.steps, axis=1).max() < 100.0
    np.testing.assert_allclose(wild.fix.x, B, atol=1e-3)
    assert (np.diff(tame.fix.costs) <= 0.0).all() and (np.diff(wild.fix.costs) > 0.0).any()
    assert (tame.where >= 0).all() and 0.04 < (wild.where < 0).mean() < 0.06


def test_circles_that_do_not_meet_have_no_end():
    p = DESK.preset("circles that do not meet")
    r = DESK.result(p)
    assert not r.fix.converged and len(r.fix.steps) == LIMIT and len(r.ends) == 0
    assert "No convergence" in DESK.view(p, LIMIT - 1).note and DESK.readouts(p, LIMIT - 1)["end"] is None


def test_a_singular_start_is_told():
    p = DESK.params(start=(50.0, 25.0))
    view = DESK.view(p)
    assert DESK.lesson.timeline_of(p).steps == 0
    assert "singular" in view.note and not view.equations
    assert DESK.view(DESK.params(start=(50.0, 25.0), damped=True)).equations


def test_the_straight_lines_are_the_linearised_circles():
    r, items = DESK.result(DESK.default), DESK.items(step=0, stage=LINEARISE)
    x, J, residual = r.fix.iterates[0], r.fix.jacobians[0], r.fix.residuals[0]
    for i in range(2):
        np.testing.assert_allclose((items[f"line_{i + 1}"].pairs - x) @ J[i], -residual[i], atol=1e-9)
        circle = items[f"circle_{i + 1}"].pairs
        np.testing.assert_allclose(np.linalg.norm(circle - r.sensor.stations_m[i], axis=-1), r.y[i], atol=0.01)
    np.testing.assert_allclose(DESK.items(step=0)["crossing"].positions[0], r.fix.iterates[1])


def test_stages_accumulate():
    for earlier, later in itertools.pairwise([DESK.view(step=1, stage=s) for s in range(4)]):
        assert {i.name for i in earlier.scene} <= {i.name for i in later.scene}
        assert sum(len(e.pieces) for e in earlier.equations) < sum(len(e.pieces) for e in later.equations)
        assert earlier.camera == later.camera
    assert [len(DESK.items(step=1, stage=s)["iterates"].positions) for s in range(4)] == [2, 2, 3, 3]


def test_the_surface_is_the_residual_norm():
    p = DESK.preset("exercise 2.16: the residual norm as a surface")
    r, items = DESK.result(p), DESK.items(p, 0, LINEARISE)
    e = entry("C2-17")["expected"]["residual_norm"]
    for point, value in e.items():
        assert residual_norms(p, np.array(eval(point), dtype=float)) == pytest.approx(value)
    z = items["norm_surface"].z
    np.testing.assert_allclose(z / z.max(), r.norms / r.norms.max())
    model = items["model_surface"]
    i, j = np.unravel_index(model.z.argmin(), model.z.shape)
    np.testing.assert_allclose([model.x[j], model.y[i]], r.fix.iterates[1], atol=6.0)   # its lowest point is x_1


def test_only_what_matters_is_shown():
    assert lesson.LESSON.unused_at(DESK.default) == {"station_3", "y_3_m", "sigma_3_m", "damping"}
    assert lesson.LESSON.unused_at(DESK.params(count=3, damped=True)) == set()


@pytest.mark.parametrize("show", ["map", "basins", "surface"])
def test_finite_where_the_geometry_is_degenerate(show):
    extremes = [{"count": 3, "station_2": (100.0, 0.0), "station_3": (100.0, 0.0)}, {"start": (100.0, 0.0)},
                {"station_2": (100.0, 0.0), "damped": True}, {"y_1_m": 1.0, "y_2_m": 1.0, "weighted": True}]
    for changes in extremes:
        p = DESK.params(**changes, show=show)
        for step in (0, DESK.lesson.timeline_of(p).steps):
            for readout in DESK.view(p, step).readouts:
                assert readout.value is None or isinstance(readout.value, str) or np.isfinite(readout.value)
