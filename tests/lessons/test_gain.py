"""What the lesson on the gain claims: the bowl, its bottom, its price for other gains, and which formula lies."""


import numpy as np
import pytest

from core.linear_update import joseph_form
from lessons.bayes_kalman import gain as lesson
from lessons.kit.lesson import no_progress
from lessons.kit.scene import Orbit, Plane
from tests.lessons.support import Desk, check_formulas, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
shown = DESK.readouts


def test_the_default_has_the_numbers_of_the_oracle():
    r = result(DEFAULT)
    want = entry("T-04")["expected"]
    np.testing.assert_allclose(r.step.gain, want["K"], rtol=1e-10)
    np.testing.assert_allclose(r.step.posterior.mean, want["x_map"], rtol=1e-10)
    np.testing.assert_allclose(r.step.posterior.cov, want["P_post"], rtol=1e-10)
    want = entry("T-05")["expected"]
    trace = np.trace(r.sweep.joseph, axis1=1, axis2=2)
    for name, c in (("trace_opt", 1.0), ("trace_zero", 0.0), ("trace_1p2", 1.2), ("trace_0p8", 0.8)):
        assert trace[np.argmin(np.abs(r.sweep.scale - c))] == pytest.approx(want[name], rel=1e-9)


@pytest.mark.parametrize("name", list(lesson.LESSON.presets))
def test_the_best_gain_is_the_bottom_and_the_slope_is_zero_there(name):
    r = result(preset(name))
    trace = np.trace(r.sweep.joseph, axis1=1, axis2=2)
    assert trace.argmin() == lesson.PER_UNIT
    np.testing.assert_allclose(r.sweep.gradient[lesson.PER_UNIT], 0.0, atol=1e-9)
    np.testing.assert_allclose(r.sweep.joseph[lesson.PER_UNIT], r.sweep.short[lesson.PER_UNIT], atol=1e-9)
    np.testing.assert_allclose(trace, trace[::-1], rtol=1e-9)             # too much is as bad as too little


def test_every_other_gain_costs_d_s_d():
    r = result(DEFAULT)
    o = r.perturbed
    np.testing.assert_allclose(o.joseph - np.trace(r.step.posterior.cov), o.price, rtol=1e-9)
    assert (o.price > 0).all() and o.price.max() > 1.0


def test_the_short_form_lies_and_joseph_does_not():
    """The experiment's mean square has a relative standard error of sqrt(2 / 4000) = 2.2 %; all gains share its draws.
    """
    r = result(DEFAULT)
    np.testing.assert_allclose(r.perturbed.real, r.perturbed.joseph, rtol=0.09)
    np.testing.assert_allclose(r.sweep.real.sum(axis=1), np.trace(r.sweep.joseph, axis1=1, axis2=2), rtol=0.09)
    least = np.trace(r.step.posterior.cov)
    assert (r.perturbed.short < 0.99 * least).mean() > 0.2                # promises what no gain can keep
    at = shown(DEFAULT, lesson.timeline(DEFAULT).start)
    assert at["joseph"] > 1.3 * at["least"] and at["short"] < 0.1 * at["least"]
    assert at["real"] == pytest.approx(at["joseph"], rel=0.09)
    assert shown(DEFAULT, 40)["short"] < 0 < shown(DEFAULT, 40)["real"]


def test_between_zero_and_the_best_gain_the_short_form_is_too_large():
    r = result(DEFAULT)
    short, joseph = (np.trace(P, axis1=1, axis2=2) for P in (r.sweep.short, r.sweep.joseph))
    inside = slice(1, lesson.PER_UNIT)
    assert (short[inside] > joseph[inside]).all() and (short[lesson.PER_UNIT + 1:] < joseph[lesson.PER_UNIT + 1:]).all()


@pytest.mark.parametrize("P, R", [(4.0, 2.0), (2.0, 2.0), (0.1, 40.0), (40.0, 0.05)])
def test_the_scalar_gain_is_trust_between_0_and_1(P, R):
    r = result(DESK.params(model="one", P_m2=P, R_m2=R))
    K = float(r.step.gain[0, 0])
    assert pytest.approx(P / (P + R)) == K and 0 < K < 1
    assert r.step.posterior.cov[0, 0] == pytest.approx(K * R) and min(P, R) > K * R


def test_gain_one_leaves_the_measurement_alone():
    p = preset("one coordinate, gain 1: only the measurement")
    at = shown(p, lesson.LESSON.presets["one coordinate, gain 1: only the measurement"]["step"])
    assert at["joseph"] == pytest.approx(p.R_m2) and at["short"] == pytest.approx(0.0, abs=1e-12)


def test_the_eigenvalues_of_kh_are_trust_too():
    for p in (DEFAULT, DESK.params(P_m2=40.0, R_m2=0.05), DESK.params(P_m2=0.1, R_m2=40.0)):
        r = result(p)
        assert (r.trust > 0).all() and (r.trust < 1).all()
        assert (np.diff(r.trust, axis=0) < 0).all()                       # more noise, less trust
    assert result(DEFAULT).step.gain.min() < 0                            # though an entry may be negative


def test_the_bowl_of_a_row_is_the_variance_of_its_coordinate():
    for row in ("1", "2"):
        p = DESK.params(row=row)
        items = DESK.items(p, 27)
        bowl, best = items["joseph"], result(p).step.gain[int(row) - 1]
        assert (bowl.x[bowl.z.argmin() % len(bowl.x)], bowl.y[bowl.z.argmin() // len(bowl.x)]) == pytest.approx(best)
        other = result(p).step.gain.copy()
        other[int(row) - 1] += [0.1, -0.2]
        other[2 - int(row)] += [0.3, 0.1]                                 # the other row must not matter
        i = int(row) - 1
        P = joseph_form(result(p).step.prior.cov, lesson.PAIR_H, result(p).R, other)[i, i]
        S = result(p).step.innovation_cov
        d = np.array([0.1, -0.2])
        assert pytest.approx(result(p).step.posterior.cov[i, i] + d @ S @ d) == P
        arrow = np.subtract(items["slope"].end, items["slope"].start)[:2]
        assert arrow @ (best - 1.35 * best) > 0                           # downhill leads towards the best gain


def test_stages_show_one_thing_after_the_other():
    for model, kind in (("pair", Orbit), ("one", Plane)):
        p = DESK.params(model=model)
        views = [DESK.view(p, 24, stage) for stage in range(4)]
        found = [names(v) for v in views]
        assert found[0] < found[1] < found[2] <= found[3]
        for v in views:
            assert isinstance(v.camera, kind) and v.camera == views[0].camera
            assert any(e.current for e in v.equations)
            assert [len(e.pieces) > 1 for e in v.equations] == sorted((len(e.pieces) > 1 for e in v.equations),
                                                                      reverse=True)


@pytest.mark.parametrize("changes", [e for e in DESK.ends() if "seed" not in e], ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    for model in ("pair", "one"):
        p = DESK.params(**{"model": model, **changes})
        for step in (0, 20, 40):
            v = DESK.view(p, step)
            check_plots(v)
            check_formulas(v)


def test_a_variance_that_cannot_be_drawn_is_said():
    p = preset("one coordinate")
    assert "no law has such a variance" in DESK.view(p, 40).note
    assert DESK.view(p, 20).note == ""


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.perturbed.real.tobytes() == b.perturbed.real.tobytes() and a.trust.tobytes() == b.trust.tobytes()
    assert lesson.compute(DESK.params(seed=2), no_progress).sweep.real.tobytes() != a.sweep.real.tobytes()
