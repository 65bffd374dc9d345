"""What the lesson on independence claims: uncorrelated is less, except for normal laws."""

import itertools

import numpy as np
import pytest

from lessons.background import independence as lesson
from lessons.background._independence_model import (
    STEPS,
    coefficient,
    disc,
    facts,
    law_of,
    normal,
    square,
    total_variation,
)
from lessons.kit.scene import HeatMap
from tests.lessons.finite import assert_finite
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

desk = Desk(lesson)


def test_the_disc_has_the_numbers_of_the_oracle():
    given, want = entry("C1-12")["inputs"], entry("C1-12")["expected"]
    law = law_of(desk.default)
    np.testing.assert_allclose(law.marginal(0, np.array(given["t"])), want["f_marginal"], rtol=1e-9)
    found = desk.readouts(desk.preset("Example 5: at the centre"))
    assert found["joint_here"] == pytest.approx(want["f_joint"], rel=1e-9)
    assert found["product_here"] == pytest.approx(want["product_at_origin"], rel=1e-9)
    assert desk.result(desk.default).facts.sd**2 == pytest.approx(want["var"], rel=1e-4)


def test_the_default_is_uncorrelated_and_dependent():
    found = desk.readouts()
    assert found["correlation"] == 0.0
    assert found["squares"] == pytest.approx(-1.0 / 3.0, abs=1e-4)
    assert found["apart"] == pytest.approx(0.151, abs=0.002)
    assert found["sd_given"] == pytest.approx(0.6 / np.sqrt(3.0))
    assert "0.00 ± 0.35; alone ± 0.50" in desk.view().caption
    near = desk.items()["near"].positions
    assert (np.abs(near[:, 0]) <= np.sqrt(1.0 - near[:, 1] ** 2)).all() and len(near) > 20
    np.testing.assert_allclose(desk.items()["spread"].pairs[0, :, 0], 0.6 / np.sqrt(3.0) * np.array([-1.0, 1.0]))


@pytest.mark.parametrize("law", [disc(), square(0.0), square(0.5), square(np.pi / 4), square(np.pi / 2),
                                 law_of(desk.preset("normal, ρ = 0.83"))],
                         ids=["disc", "square 0", "square 0.5", "square 45°", "square 90°", "normal"])
def test_the_facts_agree_with_a_large_sample(law):
    """Within 4.5 standard errors of 40,000 draws: at most 0.025 for a correlation."""
    x = law.draw(40_000, np.random.default_rng(3))
    known = facts(law)
    assert np.corrcoef(x.T)[0, 1] == pytest.approx(known.correlation, abs=0.025)
    assert np.corrcoef(np.square(x).T)[0, 1] == pytest.approx(known.squares, abs=0.03)
    assert x[:, 0].std() == pytest.approx(known.sd, rel=0.02)
    strip = x[np.abs(x[:, 1] - 0.4) < 0.1 * law.half / 1.2]
    mean, sd = law.given(np.array(0.4))
    assert strip[:, 0].mean() == pytest.approx(float(mean), abs=5.0 * float(sd) / np.sqrt(len(strip)))


def test_turning_a_square_makes_it_dependent_but_never_correlated():
    sweep = desk.result(desk.preset("the same square, turned")).sweep
    assert np.abs(sweep.correlation).max() < 1e-3
    assert sweep.second[[0, -1]] == pytest.approx(0.0, abs=1e-12) and sweep.second[40] > 0.25
    assert desk.readouts(desk.preset("independent: an upright square"))["apart"] == 0.0


def test_for_a_normal_law_uncorrelated_is_independent():
    p = desk.preset("normal and uncorrelated")
    assert desk.readouts(p)["apart"] == 0.0
    assert not [i for i in desk.view(p, 0).scene if isinstance(i, HeatMap)]              # the map is empty
    correlated = desk.preset("normal, ρ = 0.83")
    assert {"more", "less"} <= set(desk.items(correlated, 0))
    sweep = desk.result(correlated).sweep
    assert ((np.abs(sweep.correlation) < 1e-9) == (sweep.second < 1e-9)).all()
    assert np.argmin(sweep.second) == 40
    assert "−5.54 ± 2.22 m; alone ± 4.00 m" in desk.view(correlated).caption


def test_example_9_decorrelates_and_leaves_the_least_variance():
    want = entry("C1-18")["expected"]
    p = desk.preset("Example 9: k = 6/13")
    found = desk.readouts(p)
    assert found["K"] == pytest.approx(want["coef"], rel=1e-9)
    assert found["correlation"] == pytest.approx(want["cov_zy"], abs=1e-9)
    assert found["var_z"] == pytest.approx(want["var_z"], rel=1e-9)
    assert found["apart"] == pytest.approx(0.0, abs=1e-9)
    r = desk.result(p)
    assert r.sweep.at[np.argmin(r.sweep.second)] == pytest.approx(want["coef"], abs=0.02)
    for step in (0, STEPS // 2):                           # on the way there z still knows something of y
        assert desk.readouts(p, step)["correlation"] > 0.4
        assert desk.readouts(p, step)["var_z"] > found["var_z"]
    assert desk.readouts(p, 0)["correlation"] == pytest.approx(lesson.RHO)


def test_what_is_left_has_the_law_that_the_curves_show():
    p = desk.preset("Example 9: k = 6/13")
    z = desk.result(p).cloud @ np.array([[1.0, 0.0], [-coefficient(p, STEPS), 1.0]])
    assert np.var(z[:, 0]) == pytest.approx(64.0 / 13.0, rel=0.15)


@pytest.mark.parametrize(("name", "cross"), [
    ("Theorem 5: orthogonal is not enough", 24.0), ("Theorem 5: AΣBᵀ = 0", 0.0),
    ("Theorem 5: the axes of the ellipse", 0.0)])
def test_theorem_5(name, cross):
    p = desk.preset(name)
    found, items = desk.readouts(p), desk.items(p)
    assert found["cross"] == pytest.approx(cross, abs=1e-9)
    assert abs(found["sampled"] - found["correlation"]) < 0.1
    assert ("independent" in desk.view(p).note) == (cross == 0.0)
    r = desk.result(p)
    tip = np.asarray(items["conjugate"].points)[1]
    assert abs(r.a @ tip) == pytest.approx(0.0, abs=1e-9) or cross       # the mean moves where A does not look
    assert np.cross([*tip, 0.0], [*(r.P @ r.b), 0.0])[2] == pytest.approx(0.0, abs=1e-6)
    free = desk.view(p).figures["by_angle"].layout.shapes[0].x0
    assert np.interp(free, r.sweep.at, r.sweep.correlation) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("picture", lesson.PICTURES)
def test_stages_accumulate_and_formulas_typeset(picture):
    p = desk.params(picture=picture)
    stages = len(desk.lesson.timeline_of(p).stages)
    shown = [desk.view(p, step=STEPS, stage=k) for k in range(stages)]
    for earlier, later in itertools.pairwise(shown):
        assert {i.name for i in earlier.scene} <= {i.name for i in later.scene} and earlier.camera == later.camera
    for k, v in enumerate(shown):
        assert any(e.current for e in v.equations)
        for e in v.equations:
            for piece in e.pieces:
                if isinstance(piece, str):
                    typeset(piece)
        numbers = sum(any(not isinstance(x, str) for x in e.pieces) for e in v.equations)
        assert numbers == len(v.equations) if k == stages - 1 else numbers < len(v.equations)


@pytest.mark.parametrize("changes", [
    {"probe": (1.5, 1.5)}, {"picture": "square", "turn_deg": 45.0, "probe": (0.0, 1.42)},
    {"picture": "normal", "correlation": 0.99}, {"picture": "normal", "correlation": -0.99},
    {"picture": "remainder", "k": -1.0, "correlation": -0.99}, {"picture": "directions", "a": (0.0, 0.0)},
    {"picture": "directions", "a": (5.0, 5.0), "b": (-5.0, -5.0)}, {"picture": "directions", "correlation": 0.99}],
    ids=str)
def test_extremes_stay_finite(changes):
    p = desk.params(**changes)
    v = desk.view(p)
    assert_finite(v)
    if changes.get("probe", (0, 0))[1] > 1.4:
        assert "misses" in v.note
    if "b" in changes:
        assert "parallel" in v.note


def test_the_distance_does_not_depend_on_units():
    a, b = (total_variation(normal(lesson.covariance(r))) for r in (0.5, -0.5))
    assert a == pytest.approx(b, rel=1e-9)
    assert a == pytest.approx(total_variation(normal(np.array([[1.0, 0.5], [0.5, 1.0]]))), rel=1e-9)
