"""The root of a matrix: the oracle's roots, the three factors, one ellipse for all roots, and involutions."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lessons.background import matrix_root as lesson
from lessons.background._matrix_root_view import _dots
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
LAST = 3 * lesson.PER_STAGE


def test_exercise_1_5():
    given, r = entry("C1-04"), DESK.result(DESK.default)
    np.testing.assert_allclose(r.A, given["inputs"]["A"])
    np.testing.assert_allclose(r.symmetric, given["expected"]["sqrtm"], atol=1e-12)
    signs = DESK.result(DESK.preset("another sign"))
    np.testing.assert_allclose(np.abs(signs.other), np.abs(given["expected"]["other_roots"][0]), atol=1e-12)
    np.testing.assert_allclose(signs.other @ signs.other, signs.A, atol=1e-12)
    assert np.linalg.eigvalsh(signs.other).min() < 0.0 < np.linalg.eigvalsh(r.symmetric).min()


def test_example_7():
    r = DESK.result(DESK.preset("Example 7: two roots"))
    schur, roots = entry("C1-02")["expected"], entry("C1-03")["expected"]
    np.testing.assert_allclose(r.values, schur["eigenvalues"])
    np.testing.assert_allclose(r.Q[:, 0], schur["q1"], atol=1e-12)
    np.testing.assert_allclose(r.symmetric, roots["sqrtm"], atol=1e-12)
    np.testing.assert_allclose(r.other, roots["chol_lower"], atol=1e-12)
    assert DESK.readouts(DESK.preset("Example 7: two roots"))["angle"] == pytest.approx(schur["major_axis_deg"])


@pytest.mark.parametrize("of_root", ["matrix", "root"])
def test_the_three_factors_make_the_matrix_and_the_last_picture_shows_it(of_root):
    p = DESK.params(of_root=of_root)
    r = DESK.result(p)
    whole = r.factors[2] @ r.factors[1] @ r.factors[0]
    np.testing.assert_allclose(whole, r.A if of_root == "matrix" else r.symmetric, atol=1e-12)
    np.testing.assert_allclose(DESK.items(p, LAST)["dots"].positions, _dots() @ whole.T, atol=1e-9)
    np.testing.assert_allclose(DESK.items(p, 0)["dots"].positions, _dots())
    turned = DESK.items(p, lesson.PER_STAGE)
    np.testing.assert_allclose(np.abs(turned["first_axis"].end), [1.0, 0.0], atol=1e-12)      # on the axes
    assert np.linalg.norm(turned["dots"].positions, axis=1) == pytest.approx(1.0)


def test_the_pictures_go_on_smoothly():
    at = [DESK.items(step=k)["dots"].positions for k in range(LAST + 1)]
    assert max(np.abs(b - a).max() for a, b in itertools.pairwise(at)) < 9.0 / lesson.PER_STAGE + 0.2


@pytest.mark.parametrize("other", ["cholesky", "turned"])
def test_every_root_gives_the_same_ellipse(other):
    p = DESK.params(picture="roots", other=other, turn_deg=70.0)
    r = DESK.result(p)
    np.testing.assert_allclose(r.product, r.A, atol=1e-12)
    points = DESK.items(p)["other_dots"].positions
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", points, np.linalg.inv(r.A), points), 1.0)
    assert np.abs(points - DESK.items(p)["dots"].positions).max() > 0.1


def test_an_eigenvector_keeps_its_direction():
    r = DESK.result(DESK.default)
    angle = float(np.rad2deg(np.arctan2(r.Q[1, 0], r.Q[0, 0])) % 360.0)
    items = DESK.items(replace(DESK.default, arrow_deg=angle), LAST)
    x, image = (np.array(items[name].end) for name in ("x", "Ax"))
    np.testing.assert_allclose(image, 9.0 * x, atol=1e-9)


def test_an_indefinite_matrix_is_cut_and_a_singular_one_is_a_segment():
    p = DESK.params(a_12=50.0)
    assert DESK.result(p).cut and DESK.result(p).A[0, 1] == 5.0 and "cut" in DESK.view(p).note
    flat = DESK.items(DESK.preset("a singular matrix"), LAST)["dots"].positions
    assert np.linalg.matrix_rank(flat, tol=1e-9) == 1
    assert DESK.result(DESK.params(a_11=0.0, a_22=0.0)).values.tolist() == [0.0, 0.0]


def test_involutions():
    given = entry("C1-06")["inputs"]["B"]
    np.testing.assert_allclose(DESK.result(DESK.preset("exercise 1.6: a reflection")).B, given[0], atol=1e-12)
    np.testing.assert_allclose(lesson.involution(2.0, 3.0), given[1])
    for a, b in ((0.6, 0.8), (2.0, 2.0), (-1.0, 0.1), (1.5, -2.0), (1.0, 0.0)):
        B = lesson.involution(a, b)
        np.testing.assert_allclose(B @ B, np.eye(2), atol=1e-9)
        assert np.linalg.det(B) == pytest.approx(-1.0)
    items = DESK.items(DESK.preset("a slanting reflection"))
    B = DESK.result(DESK.preset("a slanting reflection")).B
    for name, sign in (("kept_line", 1.0), ("flipped_line", -1.0)):
        q = items[name].pairs[0, 1]
        np.testing.assert_allclose(B @ q, sign * q, atol=1e-9)


def test_stages_of_the_formulas():
    current = [[e.name for e in DESK.view(step=k).equations if e.current] for k in (0, 3, 12, 20, LAST)]
    assert current == [[], ["turn"], ["scale"], ["back"], ["back"]]
