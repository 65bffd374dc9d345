"""What the lesson on the Bayes filter claims: exercise 3.10's posterior, and which cost each estimate minimises."""


import numpy as np
import pytest

from core import grid
from lessons.filtering import bayes_filter as lesson
from lessons.kit.lesson import no_progress
from tests.lessons.support import Desk, check_formulas, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
shown = DESK.view


def test_exercise_3_10_leaves_two_intervals_with_the_mean_between_them():
    expected = entry("C3-20")["expected"]
    step = result(DEFAULT).steps[1]
    x, post = step.update.posterior.axes[0], step.update.posterior
    inside = np.logical_or.reduce([(low < x) & (x < high) for low, high in expected["intervals"]])
    assert (post.density[~inside] == 0.0).all()
    np.testing.assert_allclose(post.density[inside], expected["density"], rtol=1e-6)
    assert step.law.mean[0] == pytest.approx(expected["mean"], abs=1e-6)
    assert step.law.cov[0, 0] == pytest.approx(expected["var"], rel=1e-4)
    assert step.update.evidence == pytest.approx(expected["evidence"], rel=1e-6)
    assert "practically 0" in shown(DEFAULT).note
    assert DESK.readouts(DEFAULT)["near_mean"] == pytest.approx(0.0, abs=1e-9)


def test_three_estimates_have_three_answers():
    expected = entry("C3-23")["expected"]
    p = preset("three estimates, three answers")
    step = result(p).steps[0]
    assert step.law.mean[0] == pytest.approx(expected["mean"], abs=1e-4)
    assert step.law.cov[0, 0] == pytest.approx(expected["var"], rel=1e-3)
    assert step.middle[0] == pytest.approx(expected["median"], abs=1e-3)
    assert step.mode[0] == pytest.approx(expected["map"], abs=1e-3)
    spacing = step.places[1] - step.places[0]
    for i, best in enumerate((expected["mean"], expected["median"])):
        assert abs(step.places[step.costs[i].argmin()] - best) <= spacing
    found = names(shown(p, 0))
    assert {"mean", "mode", "hit", "posterior"} <= found and "likelihood" not in found
    assert [e.name for e in shown(p, 0).equations] == ["predict", "mean", "mode", "hit"]


@pytest.mark.parametrize("name", ["exercise 3.10", "normal noise", "three measurements", "in the plane"])
def test_each_estimate_minimises_its_cost(name):
    for step in result(preset(name)).steps:
        squared, absolute, miss = step.costs
        spacing = step.places[1] - step.places[0]
        assert abs(step.places[squared.argmin()] - step.law.mean[0]) <= spacing
        assert squared.min() >= np.trace(step.law.cov) - 1e-9                 # and the mean reaches it
        np.testing.assert_allclose(np.diff(squared, 2), 2.0 * spacing**2, rtol=1e-6)        # a parabola, always
        assert 1.0 - step.hit.probability <= miss.min() + 1e-12
        if step.update.posterior.dim == 1:
            near = np.interp(step.middle[0], step.places, absolute)
            assert near == pytest.approx(absolute.min(), abs=0.01)


def test_hit_or_miss_goes_from_the_mode_to_the_middle():
    small, large = (result(preset(n)).steps[2] for n in ("δ small: the mode", "δ large"))
    np.testing.assert_allclose(np.sin(small.hit.x), np.sin(small.mode), atol=0.03)      # four peaks are equally high
    assert abs(large.hit.x[0] - large.law.mean[0]) < 0.1
    assert abs(small.hit.x[0] - small.law.mean[0]) > 1.5


def test_prediction_spreads_and_keeps_the_mean():
    for p in (preset("three measurements"), preset("in the plane, two ranges")):
        for step in result(p).steps[2:]:
            before, prior = grid.moments(step.before), grid.moments(step.update.prior)
            np.testing.assert_allclose(prior.mean, before.mean, atol=0.02 if p.space == "line" else 2.0)
            Q = p.sigma_w**2 if p.space == "line" else p.sigma_w_m**2
            tolerance = 0.01 if p.space == "line" else 60.0
            np.testing.assert_allclose(np.diagonal(prior.cov - before.cov), Q, atol=tolerance)
            assert step.update.prior.density.max() < step.before.density.max()


def test_two_ranges_leave_two_mirrored_peaks():
    p = preset("in the plane, two ranges")
    step = result(p).steps[2]
    density, (x, y) = step.update.posterior.density, step.update.posterior.axes
    near = np.abs(y - p.target[1]) < 12.0
    right, left = density[x > 20.0][:, near].max(), density[x < -20.0][:, near].max()
    valley = density[np.abs(x) < 8.0][:, near].max()
    assert min(right, left) > 4.0 * valley
    assert step.mode[0] < 0.0 < p.target[0]                                    # the prior decides, and it is wrong
    assert abs(step.mode[0] + p.target[0]) < 25.0
    one = result(p).steps[1].update.posterior
    assert grid.moments(one).cov.trace() > 1.1 * np.trace(step.law.cov)


def test_a_measurement_that_the_prior_excludes_is_named():
    p = DESK.params(sigma_w=0.0, y1=1.2, y2=-1.2)
    steps = result(p).steps
    assert steps[1].possible and not steps[2].possible
    np.testing.assert_array_equal(steps[2].update.posterior.weights, steps[1].update.posterior.weights)
    assert "impossible" in shown(p, 2).note


def test_stages_accumulate_and_the_camera_stands_still():
    for p in (DEFAULT, preset("in the plane")):
        cameras = {shown(p, k, s).camera for k in range(4) for s in range(4)}
        assert len(cameras) == 1
        found = [names(shown(p, 2, s)) for s in range(4)]
        assert found[0] < found[1] < found[2] < found[3]
        assert "likelihood" in found[1] and "posterior" in found[2] and "mean" in found[3]
        for k in (0, 1, 2):
            for s in range(4):
                v = shown(p, k, s)
                assert any(e.current for e in v.equations) and len(v.scene) <= 34
                check_formulas(v)


@pytest.mark.parametrize("changes", DESK.ends(), ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    space = "line" if lesson._LINE.issuperset(changes) else "plane"
    v = shown(DESK.params(**{"space": space, **changes}), 3)
    assert all(isinstance(x.value, str) or np.isfinite(x.value) for x in v.readouts)
    check_plots(v)


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    for one, two in zip(a.steps, b.steps, strict=True):
        assert one.costs.tobytes() == two.costs.tobytes()
        assert one.update.posterior.weights.tobytes() == two.update.posterior.weights.tobytes()
