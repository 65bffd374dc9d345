"""What the lesson on the Bayesian solution claims: Examples 18 and 19, exercises 2.13 and 2.14, and MSE parabolas."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from core import grid
from core.grid import mean_square_error
from core.sensors import Range
from lessons.static import bayes as lesson
from lessons.static._bayes_line import SPREADS_M
from lessons.static._bayes_plane import SCALES, posterior
from tests.lessons.finite import assert_finite
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

desk = Desk(lesson)


def test_the_pipe_has_the_numbers_of_the_oracle():
    want, found = entry("C2-35")["expected"], desk.readouts()
    assert found["mean"] == pytest.approx(want["mean"], rel=1e-5)
    assert found["sd"] == pytest.approx(want["sd"], rel=1e-5)
    assert found["mode"] == pytest.approx(want["map"], abs=1e-6)
    c = {e.name: e.pieces for e in desk.view().equations}["posterior"][-1]
    assert c == pytest.approx(want["c"], rel=1e-5)
    post = desk.result(desk.default).steps[1].posterior
    assert post.weights[post.axes[0] > 8.0].sum() == pytest.approx(want["P_gt_8"], rel=1e-3)
    assert desk.readouts(step=0)["mean"] == pytest.approx(5.0) and "6.76 ± 2.12 m" in desk.view().caption
    assert found["evidence"] == pytest.approx(0.1 * (ndtr(2 / 3) - ndtr(-8 / 3)), rel=1e-5)


def test_the_mean_has_the_least_mean_square_error():
    """4.51 at the mean, 6.06 at the peak, 7.60 at the prior's 5 m; a parabola of curvature 2."""
    found = desk.readouts()
    assert (found["var"], found["mse_mode"], found["mse_mine"]) == pytest.approx((4.5107, 6.0549, 7.5988), abs=1e-3)
    trace = desk.view().figures["mse"].data[0]
    assert np.argmin(trace.y) == pytest.approx(len(trace.y) // 2, abs=1)
    np.testing.assert_allclose(np.diff(trace.y, 2), 2.0 * (trace.x[1] - trace.x[0]) ** 2, rtol=1e-6)
    p = desk.result(desk.default).steps[1].posterior
    assert float(mean_square_error(p, [5.0])[0, 0]) == pytest.approx(found["mse_mine"])


def test_the_posterior_is_the_next_prior():
    """Two measurements in turn are one with both, in any order."""
    p = desk.preset("a second measurement")
    r = desk.result(p)
    np.testing.assert_array_equal(r.steps[2].prior.weights, r.steps[1].posterior.weights)
    swapped = desk.result(replace(p, y1=p.y2, y2=p.y1))
    np.testing.assert_allclose(swapped.steps[2].posterior.weights, r.steps[2].posterior.weights, atol=1e-15)
    both = grid.multiply(r.steps[0].posterior, r.steps[1].log_likelihood + r.steps[2].log_likelihood)
    np.testing.assert_allclose(both.posterior.weights, r.steps[2].posterior.weights, atol=1e-15)
    assert both.log_evidence == pytest.approx(np.log(r.steps[1].evidence) + np.log(r.steps[2].evidence))
    assert (desk.readouts(p, 2)["mean"], desk.readouts(p, 2)["sd"]) == pytest.approx((6.280, 1.897), abs=1e-3)
    a, b = desk.items(p, 1)["posterior"].points, desk.items(p, 2)["prior"].points
    heights = [(y - y.min()) / np.ptp(y) for y in (np.asarray(a)[:, 1], np.asarray(b)[:, 1])]
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-9)          # the same curve, in another panel


def test_exercise_2_13():
    want = entry("C2-31")["expected"]
    p = desk.preset("exercise 2.13")
    found, numbers = desk.readouts(p), {e.name: e.pieces for e in desk.view(p).equations}
    assert (found["mean"], found["var"], found["evidence"]) == pytest.approx(
        (want["mean"], want["var"], want["evidence"]), rel=1e-6)
    assert numbers["normal_mean"][-1] == pytest.approx(want["mean"])
    assert numbers["normal_var"][-1] == pytest.approx(want["var"])
    assert found["mode"] == pytest.approx(want["mean"], abs=1e-6)          # mean and peak of a normal law agree


def test_a_flat_prior_is_the_limit_of_wide_ones():
    p = desk.preset("a flat prior")
    found, v = desk.readouts(p), desk.view(p)
    assert (found["mean"], found["sd"]) == pytest.approx((8.0, 3.0), rel=1e-6)
    assert found["evidence"] is None and "infinite" in v.note
    wide = desk.result(desk.default).wide
    for curve in (wide.uniform, wide.normal):
        assert curve[0, -1] == pytest.approx(8.0, abs=0.01) and curve[1, -1] == pytest.approx(3.0, abs=0.01)
        assert curve[0, 0] == pytest.approx(5.0, abs=0.05) and (np.diff(curve[1]) > -1e-9).all()
    at = np.interp(wide.spread_m, SPREADS_M, wide.uniform[0])
    assert at == pytest.approx(6.757, abs=0.01)                            # Example 18 lies on the curve
    assert desk.readouts(desk.preset("exercise 2.13, a vague prior"))["mean"] == pytest.approx(2000.0 / 401.0, rel=1e-5)


def test_exercise_2_14():
    want = entry("C2-33")["expected"]
    p = desk.preset("exercise 2.14")
    found = desk.readouts(p)
    assert (found["mean"], found["var"], found["positive"], found["evidence"]) == pytest.approx(
        (want["mean"], want["var"], want["P_nonneg"], want["evidence"]), rel=1e-4)
    assert desk.readouts(p, 0)["var"] == pytest.approx(want["prior_var"], rel=1e-4)
    three = desk.preset("exercise 2.14, three signs")
    odds = 1.5 / 0.5 * (1.5 / 0.5) * (0.8 / 1.2)
    assert desk.readouts(three, 3)["positive"] == pytest.approx(odds / (1.0 + odds), rel=1e-6)
    contradiction = desk.params(problem="sign", s1=1.0, s2=-1.0)
    assert "excludes" in desk.view(contradiction, 2).note
    assert desk.readouts(contradiction, 2)["mean"] == pytest.approx(0.5, rel=1e-3)


def test_example_19_has_the_numbers_of_the_oracle():
    want = entry("C2-37")["expected"]
    step = desk.result(desk.preset("Example 19")).steps[-1]
    np.testing.assert_allclose(step.linear.mean, want["lin_mean"], rtol=1e-8)
    np.testing.assert_allclose(step.linear.cov, want["lin_cov"], rtol=1e-8)
    np.testing.assert_allclose(step.law.mean, want["grid_mean"], atol=1e-2)
    np.testing.assert_allclose(step.law.cov, want["grid_cov"], atol=1e-2)
    assert step.inside == pytest.approx(0.672, abs=0.003)


def test_the_linearised_covariance_does_not_know_the_errors():
    """The exact one does: larger for errors that lengthen the ranges."""
    near = desk.preset("Example 19, near a station")
    a, b = (desk.result(replace(near, dy1_m=d, dy2_m=d, dy3_m=d)).steps[-1] for d in (10.0, -10.0))
    np.testing.assert_allclose(a.linear.cov, b.linear.cov)
    assert np.trace(a.law.cov) > 1.5 * np.trace(b.law.cov)
    assert a.inside < 0.3 and "28 %" in desk.view(near).note
    r = desk.result(near)
    assert r.rms[np.searchsorted(SCALES, 1.0)] == pytest.approx(np.sqrt(np.trace(a.law.cov)), rel=0.01)
    mild = desk.result(desk.preset("Example 19"))
    assert np.ptp(mild.rms) < 0.05 * mild.rms.mean()


def test_range_by_range():
    """One range: a ring, and no linearised law.  Two: mirror images in the line through both stations."""
    p = desk.preset("Example 19, range by range")
    steps = desk.result(p).steps
    assert steps[0].linear is None and "singular" in desk.view(p, 1).note
    far = np.sqrt(np.square(steps[0].exact.points - p.station_1).sum(axis=-1))
    assert float((steps[0].exact.weights * far).sum()) == pytest.approx(steps[0].y[0], abs=1.0)
    a, b = np.array(p.station_1), np.array(p.station_2)
    e = (b - a) / np.linalg.norm(b - a)
    across = (steps[1].exact.points - a) @ np.array([-e[1], e[0]])
    assert float(steps[1].exact.weights[across > 0.0].sum()) == pytest.approx(0.5, abs=0.02)
    assert steps[1].inside < 0.4 and np.trace(steps[2].law.cov) < 0.1 * np.trace(steps[1].law.cov)


def test_a_thin_ring_is_not_lost():
    """Whatever the size: a range of 300 m with sigma = 2 m."""
    p = posterior(Range([[0.0, 0.0]], 2.0), np.array([300.0]), 180)
    far = np.sqrt(np.square(p.points).sum(axis=-1))
    assert float((p.weights * far).sum()) == pytest.approx(300.0, abs=1.0)
    law = grid.moments(p)
    np.testing.assert_allclose(law.mean, 0.0, atol=2.0)
    assert law.cov[0, 0] == pytest.approx(300.0**2 / 2.0, rel=0.02)


def test_clicks_set_the_measurement_and_the_estimate():
    found = {}
    for target in desk.view(step=2).targets:
        (name, value), = target.changes.items()
        found.setdefault(name, []).append((target.position[0], value))
    assert set(found) == {"y2", "estimate_m"}
    for pairs in found.values():
        x, values = np.array(pairs).T
        shown = desk.result(desk.default).shown
        np.testing.assert_allclose(x, 12.0 * (values - shown[0]) / (shown[1] - shown[0]), atol=1e-9)


@pytest.mark.parametrize("name", ["Example 18: the pipe", "exercise 2.14", "Example 19"])
def test_stages_accumulate_and_formulas_typeset(name):
    p = desk.preset(name)
    step = desk.lesson.timeline_of(p).start
    shown = [desk.view(p, step, k) for k in range(4)]
    for earlier, later in itertools.pairwise(shown):
        gone = {i.name for i in earlier.scene} - {i.name for i in later.scene}
        assert gone <= ({"prior", "likelihood"} if name == "Example 19" else set())       # the posterior replaces them
        assert earlier.camera == later.camera
    for k, v in enumerate(shown):
        assert any(e.current for e in v.equations)
        for e in v.equations:
            for piece in e.pieces:
                if isinstance(piece, str):
                    typeset(piece)
        assert {r.name for r in v.readouts} == {r.name for r in shown[0].readouts}
        assert k < 3 or {"mean", "mine", "posterior"} <= {i.name for i in v.scene}


@pytest.mark.parametrize("changes", [
    {"y1": 20.0, "length_m": 2.0, "sigma_m": 0.3}, {"prior": "normal", "prior_sigma_m": 50.0, "sigma_m": 0.3},
    {"prior": "rough", "mean_m": -10.0, "prior_sigma_m": 0.3}, {"problem": "sign", "s1": -1.0, "s2": 1.0},
    {"prior": "flat", "sigma_m": 0.3, "y1": -10.0, "y2": 20.0},
    {"problem": "plane", "truth": (10.0, 5.0)}, {"problem": "plane", "dy1_m": -60.0, "dy2_m": -60.0, "dy3_m": -60.0},
    {"problem": "plane", "station_2": (10.0, 5.0), "station_3": (10.0, 5.0)},
    {"problem": "plane", "truth": (200.0, 200.0), "sigma_range_m": 2.0, "zoom": "all"},
    {"problem": "plane", "sigma_range_m": 40.0, "guess": (-200.0, -200.0)}], ids=str)
def test_extremes_stay_finite(changes):
    p = desk.params(**changes)
    for step in range(4):
        assert_finite(desk.view(p, step))
