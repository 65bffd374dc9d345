"""What the lesson on Bayes' theorem claims: the oracle's numbers, areas that agree, priors that yield or do not."""

from dataclasses import replace

import numpy as np
import pytest

from core.kalman import update
from core.sensors import Position
from core.types import Gaussian
from lessons.bayes_kalman import bayes_theorem as lesson
from lessons.kit.lesson import no_progress
from lessons.kit.params import parameters
from lessons.kit.scene import Polygon, Polyline
from tests.lessons.support import Desk, check_formulas, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result


def area(item):
    x, y = np.asarray(item.vertices, dtype=float).T
    return 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))


def test_the_first_datum_has_the_numbers_of_the_oracle():
    e, r = entry("T-01"), result(DEFAULT)
    assert r.y[0] == 1.0                                      # at the default seed the bell rings
    np.testing.assert_allclose(r.mine[0], e["inputs"]["prior"])
    np.testing.assert_allclose(r.likelihood[0], e["inputs"]["lik"])
    assert r.evidence[0] == pytest.approx(e["expected"]["evidence"], abs=1e-12)
    np.testing.assert_allclose(r.mine[1], e["expected"]["posterior"], atol=1e-12)


def test_the_filled_areas_are_the_joint_probabilities_and_their_sum_the_evidence():
    r = result(DEFAULT)
    for k in (1, 2, 5):
        items = {i.name: i for i in DESK.view(DEFAULT, k).scene if isinstance(i, Polygon)}
        joint = np.array([area(items[f"joint_{n}"]) for n in "ABC"])
        np.testing.assert_allclose(joint, r.mine[k - 1] * r.likelihood[k - 1], atol=1e-9)
        assert joint.sum() == pytest.approx(r.evidence[k - 1], abs=1e-9)
        widths = [np.ptp(items[f"posterior_{n}"].vertices[:, 0]) for n in "ABC"]
        np.testing.assert_allclose(widths, joint / joint.sum(), atol=1e-9)


def test_one_by_one_equals_all_at_once():
    r = result(DEFAULT)
    together = r.mine[0] * r.likelihood.prod(axis=0)
    np.testing.assert_allclose(r.mine[-1], together / together.sum(), atol=1e-9)
    assert np.prod(r.evidence) == pytest.approx(together.sum(), rel=1e-9)


def test_the_truth_wins_and_both_people_agree_in_the_end():
    r = result(DEFAULT)
    assert r.mine[-1, 1] > 0.95 and r.theirs[-1, 1] > 0.95
    assert 0.5 * np.abs(r.mine[-1] - r.theirs[-1]).sum() < 0.05 < 0.5 * np.abs(r.mine[0] - r.theirs[0]).sum()


def test_a_rare_disease():
    p = preset("a rare disease")
    r = result(p)
    assert r.y[0] == r.y[1] == 1.0
    assert r.mine[1, 0] == pytest.approx(0.009 / (0.009 + 0.0495), rel=1e-12)    # 15 %
    assert r.mine[2, 0] == pytest.approx(0.77, abs=0.01)


def test_a_prior_of_zero_never_recovers():
    r = result(preset("never say never"))
    assert (r.mine[:, 1] == 0.0).all() and r.theirs[-1, 1] > 0.95
    small = result(preset("never say never", prior_b=0.01))
    assert small.mine[-1, 1] > 0.5


def test_an_impossible_datum_has_evidence_zero_and_is_said():
    p = DESK.params(prior_a=1.0, prior_b=0.0, prior_c=0.0, heard_a=0.0)
    r = result(p)
    assert r.evidence[0] == 0.0
    np.testing.assert_array_equal(r.mine[1], r.mine[0])
    assert "impossible" in DESK.view(p, 1).note


@pytest.mark.parametrize("p", [preset("two bells"), preset("a stubborn prior")])
def test_normal_beliefs_are_kalman_updates(p):
    r = result(p)
    law = Gaussian(np.array([p.mean_m]), np.array([[p.prior_sigma_m**2]]))
    for k in range(lesson.DATA):
        step = update(law, r.y[k:k + 1], Position(1, p.sigma_m))
        S = float(step.innovation_cov[0, 0])
        density = np.exp(-0.5 * step.innovation[0]**2 / S) / np.sqrt(2 * np.pi * S)
        assert r.evidence[k] == pytest.approx(density, rel=2e-3)
        law = step.posterior
        assert r.laws[k + 1, 0] == pytest.approx(law.mean[0], abs=2e-3)
        assert r.laws[k + 1, 1] == pytest.approx(np.sqrt(law.cov[0, 0]), rel=2e-3)


def test_a_stubborn_prior_yields_slowly_and_the_evidence_notices():
    name = "a stubborn prior"
    p, r, k = preset(name), result(preset(name)), lesson.LESSON.presets[name]["step"]
    way = (r.laws[k, 0] - p.mean_m) / (p.true_x_m - p.mean_m)
    assert 0.2 < way < 0.5
    assert p.true_x_m - r.laws[k, 0] > 5 * r.laws[k, 1]                  # sure, and wrong
    assert DESK.readouts(p, k)["factor"] < -1.0                     # the flat prior foresaw the data far better


def test_the_coin_is_a_beta_law():
    for name in ("an unfair coin", "sure that it is fair"):
        p, r = preset(name), result(preset(name))
        for k in (0, 10, 30):
            heads, tails = p.heads + r.y[:k].sum(), p.tails + k - r.y[:k].sum()
            assert r.laws[k, 0] == pytest.approx(heads / (heads + tails), abs=1e-4)
    quick, slow = (result(preset(n)).laws[30, 0] for n in ("an unfair coin", "sure that it is fair"))
    assert quick > 0.6 and slow < 0.57


@pytest.mark.parametrize("case", ["cells", "normal", "coin"])
def test_stages_accumulate(case):
    p = DESK.params(case=case)
    views = [DESK.view(p, 2, stage) for stage in range(4)]
    found = [names(v) for v in views]
    assert found[0] < found[1] < found[2] < found[3]
    for stage, v in enumerate(views):
        assert v.camera == views[0].camera
        assert [e.current for e in v.equations] == [i == stage for i in range(4)]


def test_only_the_parameters_of_the_case_are_shown():
    every = set().union(*lesson.USED.values())
    for case, used in lesson.USED.items():
        assert set(lesson.unused(DESK.params(case=case))) == every - set(used)
    assert set(parameters(lesson.Params)) == every | {"case", "seed"}


CASES = [(case, changes) for case, used in lesson.USED.items() for changes in DESK.ends() if set(used) >= set(changes)]


@pytest.mark.parametrize("case, changes", CASES, ids=str)
def test_both_ends_of_every_parameter_are_finite(case, changes):
    p = DESK.params(case=case, **changes)
    for k in (0, 1, 30):
        v = DESK.view(p, k)
        for i in v.scene:
            if isinstance(i, Polyline):
                assert np.isfinite(i.points).all()
        check_plots(v)
        check_formulas(v)


def test_same_parameters_same_bytes():
    for case in lesson.USED:
        p = DESK.params(case=case)
        a, b = (lesson.compute(p, no_progress) for _ in range(2))
        assert a.mine.tobytes() == b.mine.tobytes() and a.y.tobytes() == b.y.tobytes()
        assert lesson.compute(replace(p, seed=99), no_progress).y.tobytes() != a.y.tobytes()
