"""Error metrics, honesty of covariances, and bounds."""

import numpy as np
import pytest

from core import kalman
from core.metrics import (
    consistency_band,
    coverage,
    cramer_rao,
    error_summary,
    nees,
    nis,
    posterior_cramer_rao,
    rmse,
)
from core.motion import constant_velocity
from core.sensors import Bearing, Linear, Position, Range, Stack
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
FIX = Position(2, [30.0, 50.0])
START = Gaussian(np.array([0.0, 0.0, 5.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))


def test_g_21_error_metrics():
    e = entry("G-21")
    errors = e["inputs"]["err"]
    got = error_summary(errors)._asdict()
    for key in ("mean", "median", "p95", "rmse", "max"):
        assert got[key] == pytest.approx(e["expected"][key], abs=1e-10)
    along = np.column_stack([errors, np.zeros(10)])
    assert rmse(along, [0.0, 0.0]) == pytest.approx(e["expected"]["rmse"])
    assert np.mean(e["inputs"]["floor_ok"]) == e["expected"]["floor_rate"]


def test_rmse_axes():
    a, b = np.random.default_rng(0).normal(size=(2, 5, 7, 3))
    squares = np.square(a - b).sum(axis=-1)
    assert rmse(a, b).shape == () and rmse(a, b) == pytest.approx(np.sqrt(squares.mean()))
    np.testing.assert_allclose(rmse(a, b, axis=0), np.sqrt(squares.mean(axis=0)))
    np.testing.assert_allclose(rmse(a, b, axis=(0, 1)), rmse(a, b))


@pytest.mark.parametrize("shared", [True, False])
def test_nees_is_the_mahalanobis_distance(shared):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(3, 3) if shared else (6, 3, 3))
    g = Gaussian(rng.normal(size=(6, 3)), A @ A.mT + np.eye(3))
    truth = rng.normal(size=(6, 3))
    got = nees(g, truth)
    for k in range(6):
        e, P = truth[k] - g.mean[k], g.cov if shared else g.cov[k]
        assert got[k] == pytest.approx(e @ np.linalg.inv(P) @ e)


def test_nees_and_nis_of_one_step_are_chi_square():
    """10,000 draws from the filter's own laws: mean within the 99.9 % band, each with false alarm 0.1 %."""
    rng = np.random.default_rng(0)
    N = 10_000
    x = START.mean + rng.normal(size=(N, 4)) * np.sqrt(START.cov.diagonal())
    x = CV.sample(x, rng)
    y = FIX.h(x) + rng.normal(size=(N, 2)) * [30, 50]
    step = kalman.run(START, y[None], CV, FIX)
    for values, n in ((nees(step.posterior, x), 4), (nis(step), 2)):
        low, high = consistency_band(0.999, n, N)
        assert low < values.mean() < high
        assert values.var() == pytest.approx(2 * n, rel=0.15)
    for p in (0.5, 0.9):                                                        # 4 standard errors: 0.006 %
        assert abs(coverage(step.posterior, x, p) - p) < 4 * np.sqrt(p * (1 - p) / N)


def test_coverage_shapes_and_levels():
    g = Gaussian(np.zeros((4, 5, 2)), np.eye(2))
    truth = np.random.default_rng(0).normal(size=(4, 5, 2))
    assert coverage(g, truth, 0.5).shape == () and coverage(g, truth, [0.1, 0.5, 0.9]).shape == (3,)
    assert coverage(g, truth, 0.5, axis=1).shape == (4,) and coverage(g, truth, [0.1, 0.9], axis=-1).shape == (4, 2)
    by_hand = (np.square(truth).sum(axis=-1) <= -2 * np.log(0.5)).mean(axis=0)  # n = 2: level -2 ln(1 - p)
    np.testing.assert_allclose(coverage(g, truth, 0.5, axis=0), by_hand)
    assert coverage(g, truth, 0.0) == 0.0 and coverage(g, truth, 1 - 1e-12) == 1.0


def test_consistency_band():
    from scipy.stats import chi2

    low, high = consistency_band(0.95, 4, 50)
    assert chi2.cdf(low * 50, 200) == pytest.approx(0.025) and chi2.cdf(high * 50, 200) == pytest.approx(0.975)


def test_cramer_rao_of_ranges_is_the_dop_covariance():
    sensor = Range([[100.0, 0.0], [0.0, 50.0]], 10.0)
    x = np.zeros(2)
    J = sensor.jacobian(x)
    np.testing.assert_allclose(cramer_rao(sensor, x), 100 * np.linalg.inv(J.T @ J), rtol=1e-12)
    grid = np.random.default_rng(0).uniform(-40, 40, (6, 7, 2))
    many = cramer_rao(sensor, grid)
    assert many.shape == (6, 7, 2, 2)
    np.testing.assert_allclose(many[2, 3], cramer_rao(sensor, grid[2, 3]), rtol=1e-9)


def test_cramer_rao_with_a_prior_is_the_kalman_covariance():
    sensor = Stack([Range([[0.0, 0.0]], 3.0), Bearing([[0.0, 0.0]], 0.1)])
    x, P = np.array([30.0, 40.0, 1.0, 2.0]), np.diag([100.0, 50.0, 9.0, 0.0])
    step = kalman.update(Gaussian(x, P), sensor.h(x), sensor)
    np.testing.assert_allclose(cramer_rao(sensor, x, P), step.posterior.cov, atol=1e-9)


def test_no_unbiased_estimator_beats_the_bound():
    """Weighted least squares attains it: 5,000 linear estimates, entries within 4 standard errors (0.03 %)."""
    rng = np.random.default_rng(1)
    H, R = rng.normal(size=(5, 2)), np.diag(rng.uniform(0.5, 4, 5))
    bound = cramer_rao(Linear(H, R), np.zeros(2))
    y = rng.normal(size=(5000, 5)) * np.sqrt(R.diagonal())
    W = np.linalg.solve(H.T @ np.linalg.solve(R, H), H.T / R.diagonal())
    C = np.cov((y @ W.T).T)
    spread = np.sqrt((np.outer(bound.diagonal(), bound.diagonal()) + bound**2) / 5000)
    assert np.abs((C - bound) / spread).max() < 4


def test_posterior_bound_is_the_kalman_covariance_for_linear_models():
    truths = np.random.default_rng(0).normal(size=(8, 5, 4))
    bound = posterior_cramer_rao(START.cov, truths, CV, FIX)
    steps = kalman.run(START, np.zeros((8, 2)), CV, FIX)
    np.testing.assert_allclose(bound, steps.posterior.cov, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(posterior_cramer_rao(START.cov, truths[:, 0], CV, FIX), bound, rtol=1e-12)


def test_posterior_bound_averages_the_information_of_the_tracks():
    sensor = Range([[0.0, 0.0], [50.0, 0.0]], 2.0)
    truths = np.random.default_rng(0).uniform(10, 60, size=(1, 400, 4))
    bound = posterior_cramer_rao(START.cov, truths, CV, sensor)[0]
    H = sensor.jacobian(truths[0])
    prior = CV.Phi @ START.cov @ CV.Phi.T + CV.Q
    np.testing.assert_allclose(bound, np.linalg.inv(np.linalg.inv(prior) + (H.mT @ H / 4).mean(axis=0)), rtol=1e-8)
    still = constant_velocity(1.0, [0.0, 0.0], 2)
    known = np.diag([4.0, 4.0, 0.0, 0.0])                                       # singular prediction
    assert not posterior_cramer_rao(known, truths, still, sensor)[0][2:].any()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: rmse([[1.0, 2.0]], [1.0, 2.0, 3.0]), "same dimension"),
        (lambda: rmse([[np.nan]], [[0.0]]), "finite"),
        (lambda: nees(Gaussian(np.zeros(2), np.diag([1.0, 0.0])), [1.0, 1.0]), "positive definite"),
        (lambda: nees(Gaussian(np.zeros(2), [[1.0, 2.0], [2.0, 1.0]]), [1.0, 1.0]), "semidefinite"),
        (lambda: coverage(START, START.mean, 1.5), "probability"),
        (lambda: consistency_band(1.0, 2, 10), "probability in"),
        (lambda: consistency_band(0.9, 2, 0), "count >= 1"),
        (lambda: cramer_rao(Range([[0.0, 0.0]], 1.0), np.array([3.0, 4.0])), "determine every component"),
        (lambda: cramer_rao(FIX, np.zeros(4)), "determine every component"),
        (lambda: cramer_rao(FIX, np.full(2, np.nan)), "x: expected finite"),
        (lambda: posterior_cramer_rao(START.cov, np.zeros(4), CV, FIX), "truths: expected shape"),
        (lambda: posterior_cramer_rao(np.eye(3), np.zeros((2, 4)), CV, FIX), "initial_cov: expected shape"),
        (lambda: error_summary([]), "at least one"),
    ],
)
def test_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call()
