"""One update of the extended filter: the oracle's numbers, where the tangent fails, and when iterating helps."""

import itertools

import numpy as np
import pytest

from core.types import Gaussian
from lessons.filtering import extended as lesson
from lessons.filtering._extended_model import exact_posterior, sensor_of, share_inside
from lessons.kit.curves import clipped, level_line, tangent_line
from lessons.kit.lesson import Moment, no_progress
from tests.lessons.support import Desk, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
PRIOR, LIKELIHOOD, POSTERIOR, TANGENT, UPDATE = range(5)
SENSORS = ("range", "bearing", "difference", "two_ranges")


def test_example_22_is_the_oracle_s():
    given, expected = entry("C3-17")["inputs"], entry("C3-17")["expected"]
    r = result(preset("Example 22, first step"))
    np.testing.assert_allclose(r.y, given["y"], atol=1e-9)
    np.testing.assert_allclose(r.sensor.R, given["R"])
    u, ekf = r.updates[0], expected["ekf"]
    np.testing.assert_allclose(u.y_hat, expected["h_pred"], atol=1e-6)
    np.testing.assert_allclose(u.posterior.mean, ekf["x"][:2], atol=1e-6)
    np.testing.assert_allclose(u.posterior.cov, np.array(ekf["P"])[:2, :2], atol=1e-6)
    np.testing.assert_allclose(u.gain, np.array(ekf["K"])[:2], atol=1e-6)
    np.testing.assert_allclose(u.innovation_cov, ekf["S"], atol=1e-6)
    exact = expected["exact"]
    np.testing.assert_allclose(r.moments.mean, exact["mean"][:2], atol=2e-3)
    np.testing.assert_allclose(np.diagonal(r.moments.cov), exact["var"][:2], rtol=1e-3)
    assert r.moments.cov[0, 1] == pytest.approx(exact["cov_xy"], abs=0.05)
    assert r.off[0] == pytest.approx(3.0, abs=0.05)                     # as the preset says
    assert r.updates[0].posterior.cov[1, 1] < r.moments.cov[1, 1]


@pytest.mark.parametrize("name", ["a range from close by", "a bearing", "a range difference"])
def test_the_ekf_misses_the_posterior_and_iterating_finds_it(name):
    r = result(preset(name))
    assert r.bend > 2.5
    assert r.inside[0] < 0.08
    assert 0.63 < r.inside[-1] < 0.73
    assert r.off[0] > 10.0 and r.off[-1] < 0.5 * r.off[0]
    np.testing.assert_allclose(r.points[-1], r.mode, atol=0.5)          # iterating finds the peak
    assert r.cost[1] > r.cost_at_mode + 5.0 and r.cost[-1] == pytest.approx(r.cost_at_mode, abs=0.01)


def test_the_numbers_of_the_default_s_description():
    r = result(DEFAULT)
    assert 0.04 < r.inside[0] < 0.06 and 0.64 < r.inside[1] < 0.66


def test_far_away_the_tangent_is_good_enough():
    r = result(preset("the same from far away"))
    assert r.bend < 0.5
    assert r.inside[0] == pytest.approx(0.68, abs=0.03)
    assert r.off[0] < 0.1 * np.sqrt(np.trace(r.moments.cov))


def test_the_share_falls_as_the_prior_widens():
    shares = result(DEFAULT).shares
    assert shares[0] == pytest.approx([0.68, 0.68], abs=0.02)
    assert shares[-1, 0] < 0.05 < 0.5 < shares[-1, 1]
    for name in SENSORS:
        r = result(DESK.params(sensor=name))
        assert r.shares[0, 0] == pytest.approx(0.68, abs=0.04)         # a narrow prior sees a straight line


def test_two_peaks_cannot_be_one_ellipse():
    r = result(preset("two peaks"))
    left = r.exact.weights[r.exact.axes[0] < 0].sum()
    assert 0.25 < left < 0.5
    assert (r.inside < 0.4).all()
    assert np.linalg.norm(r.points[-1] - r.mode) < 1.0                  # the iterated filter chose the larger one


def test_iterations_may_not_settle():
    p = preset("iterations that do not settle")
    r = result(p)
    moves = np.linalg.norm(np.diff(r.points, axis=0), axis=1)
    assert (moves[-3:] > 20.0).all()
    assert r.inside[0] > 0.6 > 0.4 > r.inside[-1]
    assert "do not settle" in DESK.view(p, 9).note
    assert DESK.view(p, 0).note == ""


def test_a_round_prior_and_one_range_need_no_iterations():
    r = result(DESK.params(sigma_x_m=20.0, sigma_y_m=20.0, correlation=0.0))
    np.testing.assert_allclose(r.points[2:], np.tile(r.points[1], (lesson.ITERATIONS - 1, 1)), atol=1e-9)


def test_bend_of_a_range_is_what_the_text_says():
    r = result(DESK.params(mean=(0.0, 400.0), sigma_x_m=20.0, sigma_y_m=20.0, correlation=0.0))
    assert r.bend == pytest.approx(np.sqrt(3) * 20.0**2 / (2 * 400.0 * DEFAULT.sigma_m), rel=0.03)


@pytest.mark.parametrize("name", SENSORS)
def test_the_grid_agrees_with_a_finer_one(name):
    p = DESK.params(sensor=name)
    r = result(p)
    fine = exact_posterior(r.prior, r.y, r.sensor, 400, 160)
    for law in (r.moments, r.updates[0].posterior):
        assert share_inside(law, r.exact) == pytest.approx(share_inside(law, fine), abs=0.01)


@pytest.mark.parametrize("name", SENSORS)
def test_level_lines_and_tangents_are_where_they_should_be(name):
    p = DESK.params(sensor=name)
    sensor, x = sensor_of(p), np.array(p.mean)
    y = sensor.h(np.array([-30.0, 50.0]))
    for k, value in enumerate(y):
        line = level_line(sensor, k, float(value), 300.0)[1:]
        values = sensor.h(line)
        assert np.abs(sensor.innovation(values, np.broadcast_to(y, values.shape))[:, k]).max() < 1e-9
        slope = sensor.jacobian(x)[k]
        ends = tangent_line(x, 0.25, slope, 100.0)
        np.testing.assert_allclose((ends - x) @ slope, 0.25, atol=1e-9)
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(200.0)


def test_no_line_where_nothing_can_be():
    difference = sensor_of(DESK.params(sensor="difference"))
    assert len(level_line(difference, 0, 70.0, 100.0)) == 0             # longer than the baseline of 60 m
    assert len(level_line(sensor_of(DEFAULT), 0, -1.0, 100.0)) == 0
    assert len(tangent_line(np.zeros(2), 1.0, np.zeros(2), 100.0)) == 0


def test_clipping_keeps_what_lies_in_the_box():
    box = np.array([[0.0, 0.0], [10.0, 10.0]])
    pieces = clipped(np.array([[-5.0, 5.0], [15.0, 5.0], [15.0, 20.0], [5.0, 20.0], [5.0, -20.0]]), box)
    np.testing.assert_allclose(pieces, [[[0, 5], [10, 5]], [[5, 10], [5, 0]]])
    assert len(clipped(np.array([[20.0, 0.0], [20.0, 10.0]]), box)) == 0


def test_stages_accumulate_and_carry_the_numbers():
    r = result(DEFAULT)
    views = [DESK.view(DEFAULT, 0, stage) for stage in range(5)]
    for earlier, later in itertools.pairwise(views):
        assert names(earlier) - {"likelihood"} < names(later)           # the posterior takes the likelihood's place
        assert earlier.camera == later.camera
    assert "likelihood" in names(views[LIKELIHOOD]) and "exact" in names(views[POSTERIOR])
    running = {"prior": 0, "y": 1, "exact": 2, "expected": 3, "jacobian": 3, "innovation": 4, "gain": 4, "mean": 4,
               "cov": 4}
    for stage, v in enumerate(views):
        for e in v.equations:
            assert e.current == (running[e.name] == stage)
            assert any(not isinstance(x, str) for x in e.pieces) == (running[e.name] <= stage)
    second = {e.name: e.pieces for e in DESK.view(DEFAULT, 1).equations}
    np.testing.assert_allclose(second["mean"][-1], r.prior.mean + second["gain"][-1] @ second["innovation"][-1])
    np.testing.assert_allclose(second["innovation"][-1], second["innovation"][2] - second["innovation"][4])
    assert {"ekf", "iterated", "iterates"} <= names(DESK.view(DEFAULT, 1))


def test_bearings_are_shown_in_degrees():
    p = preset("a bearing")
    r = result(p)
    v = DESK.view(p, 0)
    shown = {x.name: x for x in v.readouts}["y"]
    assert shown.unit == "°" and shown.value == pytest.approx(np.degrees(np.arctan2(10.0, 60.0)))
    numbers = {e.name: e.pieces for e in v.equations}
    np.testing.assert_allclose(numbers["y"][-1], [[9.0]])               # (3 degrees)^2
    np.testing.assert_allclose(numbers["mean"][-1], r.prior.mean + numbers["gain"][-1] @ numbers["innovation"][-1])


def test_only_what_matters_is_shown():
    assert lesson.LESSON.unused_at(DEFAULT) == {"sigma_deg", "station_2"}
    assert lesson.LESSON.unused_at(preset("a bearing")) == {"sigma_m", "station_2"}


def ends():
    here = [{"mean": (0.0, 0.0)}, {"sensor": "difference", "station_2": (0.0, 0.0)}, {"truth": (0.0, 0.0)}]
    extreme = ({"mean": (0.0, 0.0)}, {"sigma_x_m": 60.0, "sigma_y_m": 60.0}, {"truth": (1000.0, -1000.0)},
               {"station_1": (-1000.0, 1000.0)})
    return here + DESK.ends() + [{"sensor": s, **e} for s in SENSORS for e in extreme]


@pytest.mark.parametrize("changes", ends(), ids=str)
def test_finite_everywhere(changes):
    p = DESK.params(**changes)
    r = result(p)
    assert all(np.isfinite(a).all() for a in (r.points, r.cost, r.inside, r.off, r.bent, r.box, r.likelihood, r.shares))
    for i in (0, lesson.ITERATIONS - 1):
        v = lesson.view(p, r, Moment(i, UPDATE))
        assert v.camera.x[1] > v.camera.x[0] and v.camera.y[1] > v.camera.y[0]
        for item in v.scene:
            for field in ("pairs", "positions", "points"):
                assert np.isfinite(np.asarray(getattr(item, field, 0.0), dtype=float)).all()
            law = getattr(item, "gaussian", None)
            assert not isinstance(law, Gaussian) or np.isfinite(law.cov).all()
    check_plots(v)


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.exact.weights.tobytes() == b.exact.weights.tobytes() and a.points.tobytes() == b.points.tobytes()
    assert a.shares.tobytes() == b.shares.tobytes()
