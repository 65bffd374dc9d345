"""Confidence sets: the source's numbers, laws that fool the normal set, and a bound that none can break."""

import numpy as np
import pytest

from lessons.static import confidence as lesson
from lessons.static._confidence_model import density, draw, error_law, exact_radius, inside
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
DRAW, SETS, CHECK = range(3)


def plane(**changes):
    return DESK.params(space="plane", **changes)


def test_at_the_default_the_normal_interval_holds_75_percent_instead_of_95():
    r = DESK.result(DESK.default)
    assert r.normal.holds == pytest.approx(0.75) and r.chebyshev.holds == pytest.approx(1.0)
    assert r.normal.radius == pytest.approx(1.96, abs=0.001) and r.chebyshev.radius == pytest.approx(np.sqrt(20.0))
    shown = DESK.readouts()
    assert shown["count_normal"] == "72 of 100" and shown["count_chebyshev"] == "100 of 100"
    items = DESK.items()
    assert len(items["normal_rows_miss"].pairs) == 28 and len(items["normal_rows"].pairs) == 72
    assert "chebyshev_rows_miss" not in items


def test_the_bound_is_attained():
    r = DESK.result(DESK.params(percent=75.0))
    assert r.chebyshev.holds == pytest.approx(0.75)
    r = DESK.result(plane(percent=75.0))
    assert r.chebyshev.holds == pytest.approx(0.75)
    at = int(np.argmin(np.abs(lesson.LAMBDAS - 2.0)))
    assert lesson.LAMBDAS[at] == pytest.approx(2.0) and r.tail[at] == pytest.approx(0.25)


@pytest.mark.parametrize("space", ["line", "plane"])
@pytest.mark.parametrize("law", lesson.LAWS)
def test_no_law_breaks_the_bounds(law, space):
    r = DESK.result(DESK.params(law=law, space=space, nu=2.1))
    bound = 1.0 / np.maximum(lesson.LAMBDAS, 1.0)**2
    assert (r.tail <= bound + 1e-9).all() and (r.circle_tail <= bound + 1e-9).all()
    assert (r.radii[:, 2] <= r.radii[:, 1] + 1e-6).all()                # exact sets are within Chebyshev's
    assert min(r.chebyshev.holds, r.circle.holds) >= 0.95


def test_the_normal_set_errs_to_both_sides():
    def held(law, percent):
        return DESK.result(DESK.params(law=law, percent=percent)).normal.holds

    assert held("normal", 67.0) == pytest.approx(0.67) and held("normal", 99.0) == pytest.approx(0.99)
    assert held("laplace", 67.0) > 0.7 and held("laplace", 99.0) < 0.98
    assert held("uniform", 67.0) < 0.6 and held("uniform", 99.0) == pytest.approx(1.0)
    assert held("student", 67.0) > 0.8 and held("student", 99.0) < 0.985


def test_oracle_C2_38_the_circle():
    p = DESK.preset("circle or ellipse, λ = 2")
    r, e = DESK.result(p), entry("C2-38")["expected"]
    np.testing.assert_allclose(r.cov, [[16.0, 24.0], [24.0, 52.0]])
    assert r.circle.radius == pytest.approx(2.0 * np.sqrt(68.0))
    assert 1.0 - r.circle.holds == pytest.approx(e["norm2d_exact"], abs=2e-5)
    assert r.circle.holds < r.chebyshev.holds
    assert DESK.readouts(p)["area"] == pytest.approx(68.0 / 32.0)
    line = DESK.result(DESK.params(law="normal"))
    np.testing.assert_allclose(np.interp([2.0, 3.0], lesson.LAMBDAS, line.tail), e["normal"][1:3], atol=1e-6)


def test_oracle_C2_39_the_95_percent_ellipse():
    p = DESK.preset("E 95 %: n/0.05 = 40")
    r, e = DESK.result(p), entry("C2-39")["expected"]
    assert r.chebyshev.radius**2 == pytest.approx(e["bound"][1]) and r.normal.radius**2 == pytest.approx(e["normal"][1])
    assert DESK.readouts(p)["ratio"] == pytest.approx(e["axis_ratio_n2"])
    assert 1.0 - r.chebyshev.holds == pytest.approx(np.exp(-20.0), rel=0.8)     # 2e-9, to the accuracy of the slices
    assert r.normal.holds == pytest.approx(0.95, abs=2e-5)
    numbers = {q.name: q.pieces for q in DESK.view(p).equations}
    assert numbers["chebyshev"][2] == pytest.approx(e["lam"])


def test_exercise_2_15_a():
    r = DESK.result(DESK.preset("exercise 2.15 a"))
    sd = np.sqrt(2.0)
    assert sd * r.exact_radius == pytest.approx(-np.log(0.33)) == pytest.approx(1.1087, abs=1e-4)
    assert sd * r.chebyshev.radius == pytest.approx(sd / np.sqrt(0.33)) == pytest.approx(2.4618, abs=1e-4)
    assert sd * r.normal.radius == pytest.approx(1.378, abs=1e-3) and r.normal.holds == pytest.approx(0.748, abs=1e-3)


def test_exercise_2_15_b_and_the_oracle_s_law():
    p = DESK.preset("exercise 2.15 b")
    r = DESK.result(p)
    assert float(inside(r.e, np.ones(1), np.zeros(1), np.array(1.0))) == 0.0    # P(|x - x_hat| < sigma) = 0
    assert r.normal.holds == 0.0 and DESK.readouts(p)["count_normal"] == "0 of 100"
    np.testing.assert_array_equal(np.abs(r.draws), 1.0)
    e = entry("C2-41")
    law = error_law("extremal", 1, e["inputs"]["lam"], 3.0)
    np.testing.assert_array_equal(law.points[:, 0], e["expected"]["points"])
    np.testing.assert_array_equal(law.masses, e["expected"]["masses"])


def test_eight_ninths_within_three_sigma():
    p = DESK.preset("8/9 within 3σ")
    r = DESK.result(p)
    assert r.chebyshev.radius == pytest.approx(3.0)
    assert r.chebyshev.holds == pytest.approx(8.0 / 9.0) == pytest.approx(r.normal.holds)
    assert r.exact_radius == 0.0 and "single point" in DESK.view(p).note


def test_what_the_other_presets_say():
    assert DESK.readouts(DESK.preset("100 normal intervals"))["count_normal"] == "96 of 100"
    r = DESK.result(DESK.preset("a law that fools the ellipse"))
    assert r.normal.holds == pytest.approx(0.75)
    off = np.unique(np.round(r.far, 9))
    np.testing.assert_allclose(off, [0.0, np.sqrt(8.0)])
    p = DESK.preset("biased: nothing is promised")
    assert DESK.result(p).chebyshev.holds == pytest.approx(0.0115, abs=1e-4) and "M10" in DESK.view(p).note


@pytest.mark.parametrize("law", lesson.LAWS)
@pytest.mark.parametrize("n", [1, 2])
def test_probabilities_agree_with_many_draws(law, n):
    e = error_law(law, n, 1.7, 3.0)
    z = draw(e, 40_000, np.random.default_rng(2))
    if law != "student":                                  # whose fourth moment is infinite
        np.testing.assert_allclose(np.cov(z.T), np.eye(n)[:n, :n] if n > 1 else 1.0, atol=0.06)
    a, q = np.array([2.0, 0.7])[:n], np.array([0.5, -0.4])[:n]
    for r in (1.1, 2.3):
        found = (np.square(a * (z - q)).sum(axis=1) < r * r).mean()
        assert float(inside(e, a, q, np.array(r))) == pytest.approx(found, abs=0.0125)          # 5 standard errors
    if law != "extremal":
        radius = exact_radius(e, q, np.array([0.6, 0.9]))
        np.testing.assert_allclose(inside(e, np.ones(n), q, radius), [0.6, 0.9], atol=1e-6)


def test_densities_have_area_one():
    z = np.linspace(-60.0, 60.0, 48_001)
    for law in lesson.LAWS[:-1]:
        assert np.trapezoid(density(error_law(law, 1, 2.0, 3.0).law, z), z) == pytest.approx(1.0, abs=1e-3)


def test_both_readings_give_the_same_probability():
    for space in ("line", "plane"):
        laws = {"law": "laplace", "space": space}
        repeated, bayes = (DESK.result(DESK.params(reading=reading, **laws)) for reading in ("repeated", "bayes"))
        assert repeated.normal == bayes.normal and repeated.chebyshev == bayes.chebyshev
    # One moves the sets, the other the truth.
    def sets(p, step):
        return DESK.items(p, step)["normal"].points.mean(axis=0)

    assert np.abs(sets(plane(law="laplace"), 3) - sets(plane(law="laplace"), 4)).max() > 0.1
    bayes = plane(law="laplace", reading="bayes", estimate=(2.0, 1.0))
    np.testing.assert_allclose(sets(bayes, 3), (2.0, 1.0), atol=1e-9)
    np.testing.assert_array_equal(sets(bayes, 3), sets(bayes, 4))


def test_a_set_holds_the_truth_where_the_distance_says_so():
    p = plane(law="normal")
    r, shown = DESK.result(p), DESK.items(p)
    outside = shown["outside"].positions
    assert len(outside) == int((r.far >= r.normal.radius).sum()) == 4
    d = np.sqrt(np.einsum("ki,ij,kj->k", r.draws - r.q, np.linalg.inv(r.cov), r.draws - r.q))
    np.testing.assert_allclose(d, r.far)
    np.testing.assert_allclose(DESK.view(p).equations[4].pieces[-1], d[-1]**2)


def test_stages_accumulate():
    p = plane(law="normal")
    before, draws, sets, check = (set(DESK.items(p, *at)) for at in ((4, CHECK), (5, DRAW), (5, SETS), (5, CHECK)))
    assert "normal" not in draws and {"normal", "chebyshev", "circle", "exact"} <= sets <= check | before
    numbers = [{e.name: len(e.pieces) for e in DESK.view(p, 5, stage).equations} for stage in range(3)]
    assert all(a[name] <= b[name] for a, b in ((numbers[0], numbers[1]), (numbers[1], numbers[2])) for name in a)
    for stage in range(3):
        assert sum(e.current for e in DESK.view(p, 5, stage).equations) == (1, 3, 2)[stage]


def test_draws_outside_the_picture_are_counted():
    p = DESK.params(law="student", nu=2.1, percent=50.0, seed=8)
    items, r = DESK.items(p), DESK.result(p)
    hidden = len(r.far) - len(items["estimates"].positions)
    assert hidden > 0 and DESK.view(p).note.startswith(f"{hidden} of the 100 draws")
    assert DESK.view(DESK.default).note == ""


def test_only_what_matters_is_shown():
    assert lesson.LESSON.unused_at(DESK.default) == {"sigma_y_m", "correlation", "truth", "estimate", "nu"}
    assert lesson.LESSON.unused_at(plane(reading="bayes", law="student")) == {"off_m", "truth", "lam"}


@pytest.mark.parametrize(
    "base", [{}, {"space": "plane", "law": "laplace"}, {"space": "plane", "reading": "bayes"}], ids=str)
def test_finite_at_all_ends(base):
    for changes in [*DESK.ends(), {"lam": 1.0, "percent": 50.0}, {"truth": (50.0, 50.0), "sigma_x_m": 0.5}]:
        p = DESK.params(**{**base, **changes})
        r = DESK.result(p)
        assert all(np.isfinite(a).all() for a in (r.draws, r.far, r.tail, r.circle_tail, r.radii))
        for held in (r.normal, r.chebyshev, r.circle):
            assert 0.0 <= held.holds <= 1.0 and held.radius > 0.0
        camera = DESK.view(p).camera
        assert camera.x[1] > camera.x[0] and camera.y[1] > camera.y[0]
