"""Closed forms: the oracle's roots, which test rejects what, complex roots, and noise against Gauss-Newton."""

import itertools

import numpy as np
import pytest

from lessons.static import closed_form as lesson
from lessons.static._closed_form_numbers import lambdas, reasons
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
MEASURE, SQUARE, LINE, ROOTS, TESTS = range(5)


def result(name):
    return DESK.result(DESK.preset(name))


def numbers(p, step=0, stage=-1):
    return {e.name: e.pieces[-1] for e in DESK.view(p, step, stage).equations}


def test_oracle_C2_04_both_roots_and_why_the_second_is_rejected():
    e = entry("C2-04")
    r = DESK.result(DESK.default)
    np.testing.assert_allclose(r.problem.stations_m, e["inputs"]["satellites"], atol=1e-6)
    np.testing.assert_allclose(r.y[0], e["inputs"]["pseudoranges"], atol=1e-3)
    one, two = e["expected"]["root1"], e["expected"]["root2"]
    np.testing.assert_allclose(r.fix.lambdas[0], e["expected"]["lambda_roots"], rtol=1e-7)
    np.testing.assert_allclose(r.fix.roots[0, 0], [*one["x"], one["b"]], atol=1e-2)
    np.testing.assert_allclose(r.fix.roots[0, 1], [*two["x"], two["b"]], rtol=1e-6)
    # Erratum M29: not in outer space, and rejected by the sign alone.
    shown = numbers(DESK.default)
    np.testing.assert_allclose(shown["sign_2"] * 1e6, e["expected"]["y_minus_b_root2"], rtol=1e-6)
    assert shown["radius_2"] == pytest.approx(9.8905, abs=1e-3)
    assert reasons(r, 0, 0) == "admissible" and reasons(r, 0, 1) == "rejected: yᵢ − b < 0"
    assert DESK.readouts()["closed"] < 1e-2


def test_the_numbers_in_the_formulas_belong_together():
    shown = {e.name: e.pieces for e in DESK.view().equations}
    A, rest, p, q = (shown[name][-1] for name in ("matrix", "right", "p", "q"))
    np.testing.assert_allclose(A @ p, np.ones(4), rtol=1e-9)
    np.testing.assert_allclose(A @ q, rest, rtol=1e-9)
    a, b, c = (shown[name][-1] for name in ("alpha", "beta", "gamma"))
    D = np.diag([1.0, 1.0, 1.0, -1.0])
    np.testing.assert_allclose([a, b, c], [p @ D @ p, 2 * p @ D @ q - 1, q @ D @ q], rtol=1e-6)
    for i, value in enumerate(shown["lambdas"][2:5:2]):
        root = shown[f"root_{i + 1}"][-1]
        np.testing.assert_allclose(root, p * value + q, rtol=1e-6)
        assert root @ D @ root == pytest.approx(value, rel=1e-6)
    assert shown["discriminant"][-1] == pytest.approx(b * b - 4 * a * c)


def test_oracle_C2_05_five_satellites():
    e = entry("C2-05")["expected"]
    r = result("five satellites")
    np.testing.assert_allclose(r.fix.roots[0, 0], [*e["root1"]["x"], e["root1"]["b"]], atol=1e-2)
    np.testing.assert_allclose(r.fix.lambdas[0], e["lambda_roots"], rtol=1e-7)
    assert r.fix.residual_norms[0, 1] > 1e8


def test_oracle_C2_07_gauss_newton_needs_five_steps_for_the_same():
    e = entry("C2-07")["expected"]
    r = result("five satellites")
    assert len(r.approach) == 1 + e["iterations"]
    np.testing.assert_allclose(r.approach[:4], e["error_m"], rtol=1e-4)
    assert r.approach[-1] < 1e-2
    assert np.linalg.norm(r.chosen[0] - r.problem.truth[:3]) < 1e-2


def test_a_root_in_outer_space_is_rejected_by_its_radius_only():
    r = result("the second root in outer space")
    assert reasons(r, 0, 1) == "rejected: too far out" and r.fix.residual_norms[0, 1] < 1e-3
    assert np.linalg.norm(r.fix.roots[0, 1, :3]) == pytest.approx(124.4e6, rel=1e-3)
    off = np.linalg.norm(r.gauss_newton[0] - r.fix.roots[0, 1, :3])
    assert off < 1.0                                                    # where Gauss-Newton from the centre ends


def test_the_rocket_is_thought_to_be_elsewhere():
    r = result("a rocket beyond the satellites")
    assert np.linalg.norm(r.problem.truth[:3]) == pytest.approx(55e6, rel=1e-3)
    truth = int(np.linalg.norm(r.fix.roots[0, :, :3] - r.problem.truth[:3], axis=1).argmin())
    assert reasons(r, 0, truth) == "rejected: too far out" and reasons(r, 0, 1 - truth) == "admissible"
    assert (r.fix.residual_norms[0] < 1e-3).all()                       # both explain the measurements
    assert np.linalg.norm(r.chosen[0] - r.problem.truth[:3]) > 1e7


def test_oracle_C2_12_exercise_2_8():
    e = entry("C2-12")["expected"]
    p = DESK.preset("exercise 2.8: two ranges")
    r = DESK.result(p)
    np.testing.assert_allclose(r.y[0], [108.0, 46.0])
    np.testing.assert_allclose(lambdas(r, 0), e["lam"], rtol=1e-9)
    np.testing.assert_allclose(r.fix.roots[0], [e["A"], e["B"]], atol=1e-8)
    assert r.fix.admissible[0].all()
    items = DESK.items(p)
    for i, value in enumerate(e["lam"]):
        circle = items[f"definition_{i + 1}"].pairs
        np.testing.assert_allclose(np.square(circle).sum(axis=-1), value, rtol=1e-3)
    ends = items["line"].pairs[0]
    for root in r.fix.roots[0]:                                         # both roots lie on the line
        across = (ends[1] - ends[0])[::-1] * [1.0, -1.0]
        assert abs((root - ends[0]) @ across) < 1e-6


def test_circles_that_do_not_meet_have_complex_roots():
    p = DESK.preset("circles that do not meet")
    r = DESK.result(p)
    np.testing.assert_allclose(r.y[0], [70.0, 30.0])
    assert np.isnan(r.fix.roots[0]).all() and numbers(p)["discriminant"] < 0.0
    view = DESK.view(p)
    assert "complex" in view.note and {x.name: x.value for x in view.readouts}["closed"] is None
    assert "middle" in DESK.items(p) and "root_1" not in DESK.items(p)


def test_noise_until_the_roots_turn_complex():
    p = DESK.preset("two ranges, noise")
    shown = DESK.readouts(p, lesson.EXPERIMENTS)
    assert shown["without"] == "23 of 50"
    assert shown["rms_closed"] == pytest.approx(shown["rms_iterated"], rel=1e-6)
    share = DESK.result(p).spread.without
    assert share[0] == 0.0 and share[-1] > 0.6 and (np.diff(share) > -0.02).all()


def test_with_as_many_ranges_as_unknowns_both_methods_agree():
    for name in ("Example 15: four satellites", "exercise 2.8: two ranges"):
        r = result(name)
        np.testing.assert_allclose(r.chosen, r.gauss_newton, atol=1e-2)


def test_six_satellites_nearly_the_same_but_not_quite():
    r = result("noise: against Gauss-Newton")
    apart = np.linalg.norm(r.chosen[1:] - r.gauss_newton[1:], axis=1)
    assert 0.1 < apart.max() < 5.0
    ratio = r.spread.closed_m / r.spread.gauss_newton_m
    assert 1.0 < ratio[0] < 1.01 and 0.95 < (r.spread.closed_m / r.spread.linear_m)[0] < 1.05
    shown = DESK.readouts(DESK.preset("noise: against Gauss-Newton"), lesson.EXPERIMENTS)
    assert shown["rms_closed"] == pytest.approx(shown["rms_iterated"], rel=0.02)


def test_three_ranges_the_closed_form_is_worse():
    r = result("three ranges: not the same estimate")
    ratio = r.spread.closed_m / r.spread.gauss_newton_m
    assert 1.2 < ratio[0] < 1.4 and (ratio > 1.0).all()
    shown = DESK.readouts(DESK.preset("three ranges: not the same estimate"), lesson.EXPERIMENTS)
    assert shown["rms_closed"] > 1.2 * shown["rms_iterated"]


def test_the_drawn_circles_fit_their_pseudoranges():
    items = DESK.items(DESK.params(clock_km=0.0), 0, MEASURE)
    user = np.array(DESK.default.user)
    for i in range(4):
        circle = items[f"sphere_{i + 1}"].points / 1.006
        assert np.linalg.norm(circle - user, axis=1).min() < 0.2        # passes through the user
        s = items["satellites"].positions[i]
        np.testing.assert_allclose(np.linalg.norm(circle - s, axis=1), np.linalg.norm(user - s), rtol=1e-6)


@pytest.mark.parametrize("name", ["Example 15: four satellites", "exercise 2.8: two ranges"])
def test_stages_accumulate(name):
    p = DESK.preset(name)
    for earlier, later in itertools.pairwise([DESK.view(p, 0, stage) for stage in range(5)]):
        assert {i.name for i in earlier.scene} <= {i.name for i in later.scene}
        assert sum(len(e.pieces) for e in earlier.equations) < sum(len(e.pieces) for e in later.equations)
        assert any(e.current for e in later.equations)
        assert earlier.camera == later.camera


def test_only_what_matters_is_shown():
    assert {"place", "station_1", "sat_5", "sat_6"} < lesson.LESSON.unused_at(DESK.default)
    assert {"user", "sat_1", "station_3"} < lesson.LESSON.unused_at(DESK.params(mode="plane"))


@pytest.mark.parametrize("changes", [
    {"sat_2": (1.561016, 8.022563, 25.271235)}, {"count": 6, "sigma_m": 1e5}, {"user": (0.0, 0.0, 0.0)},
    {"sat_1": (0.0, 0.0, 0.0)}, {"mode": "plane", "station_2": (100.0, 0.0)},
    {"mode": "plane", "station_1": (50.0, 50.0), "station_2": (-50.0, -50.0)},
    {"mode": "plane", "sigma_m": 1e5, "stations": 3}, {"mode": "plane", "place": (100.0, 0.0)},
    {"sat_1": (30.0, 0.0, 0.0), "sat_2": (0.0, 30.0, 0.0), "sat_3": (-30.0, 0.0, 0.0), "sat_4": (0.0, -30.0, 0.0)},
], ids=str)
def test_degenerate_geometry_says_so_and_stays_finite(changes):
    p = DESK.params(**changes)
    for step, stage in ((0, MEASURE), (0, TESTS), (lesson.EXPERIMENTS, TESTS)):
        view = DESK.view(p, step, stage)
        for x in view.readouts:
            assert x.value is None or isinstance(x.value, str) or np.isfinite(x.value)
        for item in view.scene:
            for field in ("pairs", "positions", "points", "position"):
                assert np.isfinite(np.asarray(getattr(item, field, 0.0), dtype=float)).all()
    if "station_2" in changes and changes["station_2"] == (100.0, 0.0):
        assert "coincide" in DESK.view(p).note
