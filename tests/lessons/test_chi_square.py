"""What the lesson on chi-square claims: squared norms and forms of samples have the law that is drawn."""

import itertools

import numpy as np
import pytest

from core.levels import chi_square_probability
from lessons.background import chi_square as lesson
from lessons.background._chi_square_view import LAW
from tests.lessons.finite import assert_finite
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

desk = Desk(lesson)
N = lesson.BATCHES * lesson.BATCH


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_quantiles_are_those_of_the_oracle(n):
    for percent, want in entry("C1-19")["expected"]["quantiles"][f"n={n}"].items():
        found = desk.readouts(desk.params(n=n, lam=0.0, percent=100.0 * float(percent)))
        assert found["level"] == pytest.approx(want, rel=1e-8)


def test_densities_are_those_of_the_oracle():
    want = entry("C1-19")["expected"]
    for n, at, value in ((3, 1.0, want["pdf_n3_at_1"]), (5, 3.0, want["pdf_n5_at_3"])):
        r = desk.result(desk.params(n=n, lam=0.0))
        assert np.interp(at, r.t, r.density) == pytest.approx(value, rel=2e-3)


@pytest.mark.parametrize("name", [n for n in desk.lesson.presets if n != "AΣ is not idempotent"])
def test_the_sample_has_the_law_that_is_drawn(name):
    """Kolmogorov's distance of 2000 draws stays below 1.95/sqrt(N) with probability 0.999; the mean within 4 errors."""
    r = desk.result(desk.preset(name))
    assert r.is_chi_square
    z = np.sort(r.z)
    claim = chi_square_probability(z, r.df, r.lam)
    gaps = np.maximum(claim - np.arange(N) / N, np.arange(1, N + 1) / N - claim)
    assert gaps.max() < 1.95 / np.sqrt(N)
    found = desk.readouts(desk.preset(name))
    assert found["mean"] == r.df + r.lam                                                  # exercise 1.12
    assert abs(found["sampled_mean"] - found["mean"]) < 4.0 * found["sd"] / np.sqrt(N)


def test_the_density_is_one_and_balances_at_its_mean():
    """Up to the three thousandths beyond the picture."""
    r = desk.result(desk.default)
    step = r.t[1] - r.t[0]
    assert r.density.sum() * step == pytest.approx(0.997, abs=2e-3)
    assert (r.density * r.t).sum() * step == pytest.approx(7.0, abs=0.12)
    assert desk.view().scene[-1].name == "quantile_name"
    foot = np.asarray(desk.items()["balance"].vertices)
    curve = np.asarray(desk.items()["density"].points)
    assert foot[-1, 0] == pytest.approx(7.0 / r.t[-1] * curve[-1, 0])


def test_theorem_6_has_the_numbers_of_the_oracle():
    want = entry("C1-21")["expected"]
    p = desk.preset("Theorem 6, rank 1")
    found, r = desk.readouts(p), desk.result(p)
    np.testing.assert_allclose(r.A, np.ones((2, 2)) / 116.0)
    assert found["df"] == want["df"] and found["lam"] == pytest.approx(want["lam"], rel=1e-7)
    assert found["mean"] == pytest.approx(want["mean"], rel=1e-9)
    assert found["sd"] ** 2 == pytest.approx(want["var"], rel=1e-9)
    edge = np.asarray(desk.items(p)["level"].pairs).reshape(-1, 2)
    np.testing.assert_allclose(np.vecdot(edge, edge @ r.A), r.level)                      # the strip z <= c


def test_the_ellipse_of_example_10_is_that_of_example_7():
    p, want = desk.preset("Example 10"), entry("C1-15")["expected"]
    assert desk.readouts(p)["level"] == pytest.approx(want["c"], rel=1e-9)
    rim = np.asarray(desk.items(p)["level"].pairs).reshape(-1, 2)
    np.testing.assert_allclose(np.abs(rim).max(axis=0), want["bbox"], rtol=2e-3)


def test_only_the_length_of_the_mean_counts():
    name = "any direction of μ: χ²(2, 5)"
    a, b = (desk.readouts(desk.preset(name, mean=m)) for m in ((1.0, 2.0), (-2.0, 1.0)))
    assert a["lam"] == b["lam"] == 5.0 and a["level"] == b["level"]


def test_without_idempotence_the_mean_is_right_and_the_law_is_not():
    p = desk.preset("AΣ is not idempotent")
    r, found = desk.result(p), desk.readouts(p)
    assert not r.is_chi_square and "not idempotent" in desk.view(p).note
    u = (np.arange(200_000) + 0.5) / 200_000 * np.pi / 2                # P by polar coordinates of the unit normal law
    weights = 64.0 / 34.0 * np.cos(u) ** 2 + 4.0 / 34.0 * np.sin(u) ** 2
    exact = float((1.0 - np.exp(-0.5 * r.level / weights)).mean())
    assert exact == pytest.approx(0.923, abs=0.001)
    assert found["inside"] == pytest.approx(100.0 * exact, abs=4.0 * 100.0 * np.sqrt(exact * (1 - exact) / N))
    assert found["sampled_mean"] == pytest.approx(2.0, abs=0.25)
    assert found["sampled_sd"] / found["sd"] == pytest.approx(4.0 / 3.0, abs=0.12)
    assert desk.items(p)["density"].role == "warning"
    assert desk.result(desk.preset("AΣ is not idempotent", spread="identity")).is_chi_square


@pytest.mark.parametrize("picture", ["norm", "form"])
def test_the_histogram_follows_the_points(picture):
    p = desk.params(picture=picture)
    r = desk.result(p)
    inside, outside = desk.items(p)["inside"].positions, desk.items(p)["outside"].positions
    assert len(inside) + len(outside) <= N and len(inside) > 0.93 * N
    if picture == "norm":
        radius = np.sqrt(np.square(r.x).sum(axis=1))
        np.testing.assert_allclose(radius**2, r.z)
    first = {i.name for i in desk.view(p, step=0).scene}
    assert "last" not in first and "histogram" not in first and "density" in first


@pytest.mark.parametrize("picture", ["norm", "form"])
def test_stages_accumulate_and_formulas_typeset(picture):
    p = desk.params(picture=picture)
    shown = [desk.view(p, 7, stage) for stage in range(LAW + 1)]
    for earlier, later in itertools.pairwise(shown):
        assert {i.name for i in earlier.scene} < {i.name for i in later.scene} and earlier.camera == later.camera
    for stage, v in enumerate(shown):
        assert {e.current for e in v.equations} == {True, False}
        for e in v.equations:
            for piece in e.pieces:
                if isinstance(piece, str):
                    typeset(piece)
        assert all(any(not isinstance(x, str) for x in e.pieces) for e in v.equations) == (stage == LAW)


@pytest.mark.parametrize("changes", [
    {"n": 12, "lam": 25.0, "percent": 99.5}, {"n": 1, "lam": 25.0, "percent": 1.0},
    {"n": 1, "lam": 0.0, "percent": 1.0},
    {"picture": "form", "a": (0.0, 0.0)}, {"picture": "form", "mean": (12.0, -12.0)},
    {"picture": "form", "mean": (12.0, -12.0), "form": "inverse"},
    {"picture": "form", "spread": "identity", "mean": (12.0, 12.0)}], ids=str)
def test_extremes_stay_finite(changes):
    assert_finite(desk.view(desk.params(**changes)))
