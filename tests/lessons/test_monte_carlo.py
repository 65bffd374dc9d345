"""What the lesson on Monte Carlo integration claims: the right variance, the slope, what the proposal does to it."""

from dataclasses import replace

import numpy as np
import pytest

from lessons.filtering import _monte_carlo_problems as problems
from lessons.filtering import monte_carlo as lesson
from lessons.kit.lesson import no_progress
from tests.lessons.support import Desk, check_formulas, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
shown, readouts = DESK.view, DESK.readouts


def test_example_21_has_the_oracle_s_variance_and_not_the_printed_one():
    expected = entry("C3-24")["expected"]
    r = result(DEFAULT)
    assert r.term_variance == pytest.approx(expected["var_h"], rel=1e-8)
    assert r.term_variance / DEFAULT.n == pytest.approx(expected["var_mean"], rel=1e-8)
    assert r.left_out_variance / DEFAULT.n == pytest.approx(expected["value_without_zeros"], rel=1e-8)
    assert r.running_sd[-1, 0] == pytest.approx(expected["sd_mean"], rel=0.04)
    assert r.left_out_sd**2 == pytest.approx(expected["text_value"], rel=0.05)      # how the text got it
    assert r.running[-1, 0] == pytest.approx(1.005, abs=0.0005)                     # the realisation in the text


def test_a_thousand_repetitions_follow_the_right_normal_law():
    expected = entry("C3-24")["expected"]
    r = result(DEFAULT)
    assert len(r.answers) == 1000
    assert r.answers.mean() == pytest.approx(1.0, abs=0.00075)
    assert r.answers.std() == pytest.approx(expected["sd_mean"], rel=0.07)
    within = np.abs(r.answers - 1.0) < 2.0 * expected["sd_mean"]
    assert within.mean() == pytest.approx(0.954, abs=0.025)
    # The curve with the printed variance is too narrow for this histogram.
    assert (np.abs(r.answers - 1.0) < 2.0 * np.sqrt(expected["text_value"])).mean() < 0.88
    traces = [t.meta["key"] for t in shown(DEFAULT).figures["histogram"].data]
    assert traces == ["answers", "right", "left_out"]


@pytest.mark.parametrize("name", ["Example 21", "uniform on [−1, 1]", "exercise 3.13"])
def test_the_error_falls_with_slope_minus_one_half(name):
    assert readouts(preset(name))["slope"] == pytest.approx(-0.5, abs=0.05)


def test_exercise_3_13_gives_the_exact_mean():
    expected = entry("C3-26")["expected"]
    p = preset("exercise 3.13")
    r = result(p)
    np.testing.assert_allclose(r.exact, expected["I"], rtol=1e-9)
    sd = np.sqrt(expected["var"] / (p.n * expected["P_A"]))
    assert np.sqrt(r.term_variance / p.n) == pytest.approx(sd, rel=1e-8)
    assert (np.abs(r.running[-1] - r.exact) < 4 * sd).all()
    assert readouts(p)["zeros"] == pytest.approx(100 * (1 - expected["P_A"]), abs=2.0)
    assert r.answers.std() == pytest.approx(sd, rel=0.1)
    uniform = result(preset("exercise 3.13, uniform"))
    assert uniform.answers.std() < 0.6 * r.answers.std()


def test_the_proposal_decides_the_variance():
    standard, better = result(DEFAULT).term_variance, result(preset("a better normal")).term_variance
    assert 6.0 < standard / better < 8.0
    assert result(preset("f = g")).answers.std() < 1e-12
    best = problems.WIDTHS[result(DEFAULT).sweep.argmin()]
    assert 0.4 < best < 0.7


def test_a_proposal_off_to_one_side_is_wrong_and_does_not_notice():
    p = preset("off to one side: fooled")
    r, seen = result(p), readouts(p)
    assert 1.0 - seen["estimate"] > 3.0 * seen["sd"]
    assert seen["exact_sd"] > 5.0 * seen["sd"]
    assert (r.answers < 1.0).mean() > 0.7


def test_a_proposal_that_is_zero_somewhere_converges_to_something_else():
    p = preset("uniform, too short")
    r = result(p)
    assert abs(r.running[-1, 0] - 0.792) < 0.004
    assert r.rms[-1] == pytest.approx(0.208, abs=0.002)
    assert abs(readouts(p)["slope"]) < 0.02
    assert "something else" in shown(p).note


def test_hardly_any_sample_hits_a_far_corner():
    assert readouts(preset("a far corner"))["zeros"] > 99.7
    far = preset("a far corner", n=100, corner_1=(2.8, 2.8), repetitions=100)
    assert readouts(far)["estimate"] is None and "No sample" in shown(far).note


def test_stages_accumulate():
    for p in (DESK.params(n=1000, repetitions=100), preset("exercise 3.13", n=1000, repetitions=100)):
        found = [names(shown(p, 8, s)) for s in range(3)]
        assert "terms" not in found[0] and "terms" in found[1]
        assert "mean" not in found[1] and "mean" in found[2]
        assert len({shown(p, s, t).camera for s in (0, 16) for t in range(3)}) == 1
        check_formulas(shown(p, 8))


@pytest.mark.parametrize("problem", ["parabola", "square"])
@pytest.mark.parametrize("proposal", ["normal", "uniform", "target"])
def test_corners_of_the_parameters_are_finite(problem, proposal):
    for width in (0.3, 5.0):
        for centre in (-2.0, 2.0):
            p = DESK.params(problem=problem, proposal=proposal, width=width, centre=centre, n=100,
                        repetitions=100)
            v = shown(p)
            assert all(x.value is None or np.isfinite(x.value) for x in v.readouts)
            check_plots(v)


@pytest.mark.parametrize("changes", DESK.ends(), ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    p = DESK.params(**{"n": 300, "repetitions": 100, **changes})
    assert all(x is None or np.isfinite(x) for x in readouts(p).values())


def test_same_parameters_same_bytes():
    p = DESK.params(n=500, repetitions=100)
    a, b = (lesson.compute(p, no_progress) for _ in range(2))
    assert a.answers.tobytes() == b.answers.tobytes() and a.running.tobytes() == b.running.tobytes()
    assert lesson.compute(replace(p, seed=3), no_progress).answers.tobytes() != a.answers.tobytes()
