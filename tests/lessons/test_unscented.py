"""Unscented transform: the numbers of MAT 3.3.2 and exercise 3.8, and what each preset claims."""

import itertools
from typing import Any

import numpy as np
import pytest

from core.gaussian import chi_square_level, mahalanobis_squared, sample
from core.types import Gaussian
from lessons.filtering import unscented as lesson
from lessons.filtering._unscented_figures import BEST, KAPPAS
from lessons.filtering._unscented_maps import map_of, reference
from lessons.filtering.unscented import Params, Result, errors_by_degree
from lessons.kit.lesson import Moment, View, no_progress
from lessons.kit.params import parameters
from tests.lessons.support import Desk, everything, names
from tests.oracle import entry

DESK = Desk(lesson)
LAST = 3


def result(**changes: Any) -> tuple[Params, Result]:
    p = DESK.params(**changes)
    return p, DESK.result(p)


def preset(name: str) -> tuple[Params, Result]:
    return result(**lesson.LESSON.presets[name])


def at(p: Params, stage: int = LAST) -> View:
    return DESK.view(p, 0, stage)


def share_inside(r: Result, law: Gaussian, probability: float = 0.68) -> float:
    """Which share of the mapped points lies in the ellipse that the approximation draws."""
    return float(np.mean(mahalanobis_squared(law, r.cloud_images) <= chi_square_level(probability, 2)))


def test_default_is_the_polar_example_of_the_oracle() -> None:
    expected = entry("C3-14")["expected"]
    _, r = result()
    np.testing.assert_allclose(r.linear.mean, expected["lin_mean"], atol=1e-6)
    np.testing.assert_allclose(r.linear.cov, expected["lin_cov"], atol=1e-6)
    np.testing.assert_allclose(r.ut.mean, expected["ut_mean"], atol=1e-6)
    np.testing.assert_allclose(r.ut_cov, expected["ut_cov"], atol=1e-6)
    np.testing.assert_allclose(r.truth.mean, expected["exact_mean"], atol=1e-6)
    np.testing.assert_allclose(r.truth.cov, expected["exact_cov"], atol=1e-6)
    np.testing.assert_allclose(r.ut.points[0], [100.0, 90.0])


def test_default_shows_the_tangent_wrong_and_the_sigma_points_right() -> None:
    p, r = result()
    assert r.linear_errors.mean_m > 3.0 and r.ut_errors.mean_m < 0.001
    assert r.linear_errors.cov_percent > 20 * r.ut_errors.cov_percent
    assert r.ut_errors.mean_m < r.sampled_errors.mean_m / 100        # five points beat twenty thousand
    by_samples = share_inside(r, r.sampled)                           # the image is not normal: this is not 0.68
    assert abs(share_inside(r, Gaussian(r.ut.mean, r.ut_cov)) - by_samples) < 0.03
    assert share_inside(r, r.linear) < by_samples - 0.2
    assert {"linear", "ut", "sampled"} <= names(at(p)) and "ut_modified" not in names(at(p))


def test_stages_accumulate() -> None:
    p, _ = result()
    views = [at(p, stage) for stage in range(4)]
    for earlier, later in itertools.pairwise(views):
        assert names(earlier) < names(later)
        assert len(earlier.equations) < len(later.equations)
        assert earlier.camera == later.camera
    assert [{e.name for e in v.equations if e.current} for v in views] == [
        {"prior"}, {"root", "points", "weights"}, {"images"}, {"ut_mean", "ut_cov", "linear", "truth"}]


def test_the_usual_kappa_is_where_the_errors_dip() -> None:
    p, r = preset("κ = 3 − n")
    assert p.kappa == BEST == KAPPAS[np.argmin(np.abs(KAPPAS - 1.0))]
    for column, linear in ((0, r.linear_errors.mean_m), (1, r.linear_errors.cov_percent)):
        assert abs(KAPPAS[r.sweep[:, column].argmin()] - BEST) <= 0.3
        assert r.sweep[:, column].min() < linear / 10
    assert (r.sweep[:, 0] < r.linear_errors.mean_m).all()           # the mean: better than the tangent for every kappa,
    assert (r.sweep[:, 1] < r.linear_errors.cov_percent).mean() < 0.9                           # the covariance: not
    np.testing.assert_allclose(r.sweep[p.kappa == KAPPAS][0], r.ut_errors, rtol=1e-9)
    for key in ("mean_error", "cov_error", "weights"):
        lines = {s.name: s.x0 for s in at(p).figures[key].layout.shapes}
        assert lines == {"mark": BEST, "cursor": p.kappa}


def test_negative_weight_takes_the_covariance_away() -> None:
    p, r = preset("κ below zero: a negative weight")
    view = at(p)
    np.testing.assert_allclose(r.ut.weights, [-3, 1, 1, 1, 1])
    assert np.linalg.eigvalsh(r.ut_cov)[0] < -1.0
    assert "ut_modified" in names(view) and "ut" not in names(view)
    assert "not positive semidefinite" in view.note and "negative weight" in at(p, 1).note
    role = {item.name: getattr(item, "role", None) for item in view.scene}
    assert role["sigma_centre"] == "warning" and role["sigma_others"] == "sigma"
    assert {i.role for i in at(result()[0]).scene if i.name == "sigma_centre"} == {"sigma"}


def test_near_the_baseline_the_tangent_believes_in_impossible_ranges() -> None:
    p, r = preset("two ranges near the baseline")
    d = float(np.hypot(*np.subtract(p.station_1, p.station_2)))

    def possible(y: np.ndarray) -> float:
        return float(np.mean((y.sum(axis=1) >= d) & (np.abs(y[:, 0] - y[:, 1]) <= d)))

    assert possible(r.cloud_images) == 1.0
    assert possible(sample(r.linear, 4000, np.random.default_rng(3))) < 0.7
    assert r.ut_errors.mean_m < r.linear_errors.mean_m / 20
    assert r.ut_errors.cov_percent < r.linear_errors.cov_percent / 2
    assert "border" in names(at(p))


def test_far_from_the_stations_all_agree() -> None:
    _, r = preset("two ranges, gently curved")
    spread = np.sqrt(np.trace(r.truth.cov))
    assert max(r.linear_errors.mean_m, r.ut_errors.mean_m) < 0.05 * spread
    assert max(r.linear_errors.cov_percent, r.ut_errors.cov_percent) < 2.0


def test_exercise_3_8() -> None:
    expected = entry("C3-15")["expected"]
    exact = reference(lambda x: x**np.arange(1, 5), Gaussian(np.array([1.0]), np.array([[4.0]]))).mean
    np.testing.assert_allclose(exact, expected["moments"], rtol=1e-12)
    for kappa_1d, fourth in zip(entry("C3-15")["inputs"]["kappa"], expected["ut4"], strict=True):
        here, best, linear = errors_by_degree(kappa_1d - 1.0)       # one more dimension, the same n + kappa
        np.testing.assert_allclose(here[:3], 0.0, atol=1e-10)
        np.testing.assert_allclose(here[3], 100.0 * abs(fourth - exact[3]) / exact[3], atol=1e-9)
        np.testing.assert_allclose(best[:4], 0.0, atol=1e-10)
        assert here[5] > 1.0 and best[5] > 1.0
        np.testing.assert_allclose(linear[:4], 100.0 * np.abs(1.0 - exact) / exact, atol=1e-10)
    _, r = preset("exercise 3.8: degree 4")
    assert r.ut_errors.mean_m < 1e-9 * r.truth.mean[0]
    np.testing.assert_allclose(r.truth.mean, [7300.0, 7300.0], rtol=1e-12)     # 73 L
    assert r.linear_errors.mean_m > 7000.0
    lost = DESK.result(DESK.preset("exercise 3.8: degree 4", kappa=0.0))
    assert lost.ut_errors.mean_m > 1000.0


@pytest.mark.parametrize("kappa", [-1.9, 0.0, 1.0, 8.0])
def test_third_degree_is_exact_for_every_kappa_and_root(kappa: float) -> None:
    for root in ("cholesky", "symmetric"):
        _, r = result(map="polynomial", degree=3, mean=(80.0, -50.0), sigma_1=60.0, sigma_2=40.0, correlation=0.6,
                      kappa=kappa, root=root)
        np.testing.assert_allclose(r.ut.mean, r.truth.mean, rtol=1e-9)
        assert r.linear_errors.mean_m > 10.0


def test_squares_at_zero_find_the_variances_and_a_correlation_that_is_not_there() -> None:
    _, r = preset("squares at zero")
    np.testing.assert_array_equal(r.linear.cov, 0.0)
    np.testing.assert_allclose(np.diag(r.ut_cov), np.diag(r.truth.cov), rtol=1e-12)
    np.testing.assert_allclose(r.truth.cov[0, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(r.ut_cov[0, 1] / r.ut_cov[0, 0], -0.5, rtol=1e-12)


def test_roots_differ_only_with_correlation() -> None:
    points = {(root, rho): result(root=root, correlation=rho)[1].ut.points
              for root in ("cholesky", "symmetric") for rho in (0.0, 0.7)}
    np.testing.assert_allclose(points["cholesky", 0.0], points["symmetric", 0.0], atol=1e-12)
    assert np.abs(points["cholesky", 0.7] - points["symmetric", 0.7]).max() > 0.5


def test_jacobians_are_the_slopes_of_the_maps() -> None:
    x, step = np.array([70.0, 40.0]), 1e-4
    for name in ("polar", "two_ranges", "polynomial"):
        m = map_of(Params(map=name, degree=3))
        slopes = np.column_stack([(m.f(x + e) - m.f(x - e)) / (2 * step) for e in step * np.eye(2)])
        np.testing.assert_allclose(m.jacobian(x), slopes, rtol=1e-6, atol=1e-8)


def test_handles_and_data_stand_at_the_same_place() -> None:
    p = DESK.default
    image = DESK.items(p)["sigma_images_centre"]
    np.testing.assert_allclose(image.positions[0], p.mean, atol=1e-9)          # polar: the image is the plane
    p = DESK.preset("two ranges near the baseline")
    source = DESK.items(p)["sigma_centre"]
    np.testing.assert_allclose(source.positions[0], p.mean, atol=1e-9)


def ends() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = [{"map": "two_ranges", "mean": (0.0, 0.0)}, {"mean": (0.0, 0.0)},
                                   {"map": "two_ranges", "station_2": (0.0, 0.0)}]
    every = parameters(Params)["map"].options
    return found + DESK.ends() + [{"map": m, name: v} for m in every for name, v in (
        ("sigma_1", 300.0), ("sigma_2", 300.0), ("kappa", -1.9), ("degree", 6), ("mean", (-1000.0, 1000.0)))]


@pytest.mark.parametrize("changes", ends(), ids=str)
def test_finite_and_reproducible_at_the_ends(changes: dict[str, Any]) -> None:
    p = DESK.params(**changes)
    views = [lesson.LESSON.view(p, lesson.compute(p, no_progress), Moment(0, LAST)) for _ in range(2)]
    first, second = (everything(v) for v in views)
    assert first == second
    assert np.isfinite(np.frombuffer(first)).all()
    assert all(isinstance(x.value, (int, float)) for x in views[0].readouts)
