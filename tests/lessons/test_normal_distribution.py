"""The normal law: Example 7's numbers, shares inside the ellipse, linear forms, and the singular limit."""

from dataclasses import replace

import numpy as np
import pytest

from lessons.background import normal_distribution as lesson
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
MANY = DESK.params(samples=5000)


def test_example_7():
    r, given = DESK.result(DESK.default), entry("C1-15")["expected"]
    found = DESK.readouts()
    assert [found["long"], found["short"]] == pytest.approx(given["semi_axes"], abs=1e-3)
    assert r.level == pytest.approx(given["c"], abs=1e-9)
    np.testing.assert_allclose(r.law.cov, [[16.0, 24.0], [24.0, 52.0]], atol=2e-3)
    np.testing.assert_allclose(np.sqrt(r.values), [8.0, 2.0], atol=1e-3)
    assert r.level == pytest.approx(2.2789, abs=1e-4) and not r.singular


@pytest.mark.parametrize("probability", [0.39, 0.68, 0.95])
def test_the_ellipse_holds_what_it_claims(probability):
    """5000 samples: within 4.5 standard deviations (false alarm 1e-5)."""
    found = DESK.readouts(replace(MANY, probability=probability))
    noise = np.sqrt(probability * (1 - probability) / 5000)
    assert found["inside"] / 100 == pytest.approx(probability, abs=4.5 * noise)
    assert found["long"] == pytest.approx(8.0 * np.sqrt(-2 * np.log(1 - probability)), rel=1e-3)


def test_both_roots_give_other_points_on_the_same_ellipse():
    r = DESK.result(DESK.preset("Example 8: two roots"))
    white = [np.linalg.solve(np.linalg.cholesky(r.law.cov), (x - r.law.mean).T) for x in (r.x, r.other)]
    np.testing.assert_allclose(*(np.square(w).sum(axis=0) for w in white))
    assert np.abs(r.x - r.other).max() > 1.0
    items = DESK.items(DESK.preset("Example 8: two roots"))
    assert {"other", "pairs"} <= set(items) and "other" not in DESK.items()


@pytest.mark.parametrize("direction", [0.0, 63.0, 120.0])
def test_every_linear_form_is_normal(direction):
    """Skewness and excess of 5000 samples: 4.5 standard deviations of sqrt(6/N) and sqrt(24/N)."""
    p = replace(MANY, show="form", direction_deg=direction)
    r = DESK.result(p)
    z = (r.x @ r.a - r.form_mean) / r.form_sd
    assert abs((z**3).mean()) < 4.5 * np.sqrt(6 / 5000) and abs((z**4).mean() - 3.0) < 4.5 * np.sqrt(24 / 5000)
    assert z.std() == pytest.approx(1.0, abs=4.5 / np.sqrt(10_000))
    assert r.form_sd == pytest.approx(np.sqrt(r.a @ r.law.cov @ r.a))


def test_exercise_1_11():
    p = DESK.preset("exercise 1.11")
    r = DESK.result(p)
    np.testing.assert_allclose(r.law.cov, [[5.0, -4.0], [-4.0, 5.0]], atol=1e-3)
    assert r.form_probability == pytest.approx(0.5, abs=1e-9)
    assert DESK.readouts(p)["share"] == pytest.approx(50.0, abs=8.0)
    moved = DESK.result(replace(p, limit=1.0))
    assert moved.form_probability == pytest.approx(0.8413, abs=1e-3)     # a unit vector: sigma of a'x is 1


def test_the_singular_limit_has_no_density_but_linear_forms():
    p = DESK.preset("the singular limit")
    view, r = DESK.view(p), DESK.result(p)
    assert r.singular and "Singular" in view.note and "level" not in {i.name for i in view.scene}
    across = np.array([-r.vectors[1, 0], r.vectors[0, 0]])
    assert np.abs((r.x - r.law.mean) @ across).max() < 1e-6
    along = DESK.result(replace(p, show="form", direction_deg=63.43))
    assert along.form_sd == pytest.approx(8.0, abs=0.01)
    share, noise = DESK.readouts(replace(p, samples=5000))["inside"], 100 * np.sqrt(0.68 * 0.32 / 5000)
    assert share == pytest.approx(68.0, abs=4.5 * noise)                # of the part of the line, chi-square n = 1
    assert DESK.readouts(p)["long"] == pytest.approx(8.0 * 0.99446, rel=1e-3)
    point = DESK.result(DESK.params(axis=(0.0, 0.0)))
    assert point.singular and point.form_sd == 0.0 and point.form_probability == 1.0


def test_a_constant_form_is_certain_in_spite_of_rounding():
    p = DESK.params(show="form", axis=(8.0, 0.0), ratio=0.0, direction_deg=90.0)
    r = DESK.result(p)
    assert (r.form_sd, r.form_probability, r.form_share) == (0.0, 1.0, 1.0)
    assert DESK.result(replace(p, limit=-0.5)).form_probability == 0.0


def test_the_surface_and_its_ring():
    items = DESK.items(DESK.preset("Figure 1.1 as a surface"))
    surface, ring = items["density"], items["level"].points
    assert surface.z.max() == pytest.approx(ring[0, 2] / np.exp(-0.5 * DESK.result(DESK.default).level), rel=0.02)
    assert "density" not in DESK.items(DESK.params(show="surface", ratio=0.0))


def test_lines_stay_in_the_picture():
    for direction in (0.0, 45.0, 90.0, 150.0):
        p = replace(MANY, show="form", direction_deg=direction, limit=-3.0)
        view = DESK.view(p)
        half = view.camera.x[1]
        for item in view.scene:
            if item.name in ("edge", "bell", "ruler", "below"):
                assert np.abs(item.pairs).max() <= half * 1.0001
