"""Garbage detection: distribution of the tests, locating the garbage, robust weights."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.gauss_newton import gauss_newton, gauss_newton_batch
from core.linalg import least_squares
from core.residual_test import Rows, exclude, leave_one_out, residual_test, smallest_detectable
from core.robust import huber
from core.sensors import Bearing, Linear, Pseudorange, Range, Stack
from tests.oracle import entry

properties = settings(deadline=None, max_examples=30)
STATIONS = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [50.0, 120.0], [-40.0, 60.0]])
TRUTH = np.array([40.0, 35.0])
SENSOR = Range(STATIONS, [1.0, 2.0, 1.0, 3.0, 1.0, 2.0])


def test_normal_errors_fail_as_often_as_stated():
    """4000 experiments at 5 %: 4.5 standard errors, false alarm rate 7e-6 for each of the three checks."""
    rng = np.random.default_rng(1)
    n, rate = 4000, 0.05
    y = SENSOR.h(TRUTH) + rng.standard_normal((n, 6)) * np.sqrt(np.diag(SENSOR.R))
    x = gauss_newton_batch(SENSOR, y, TRUTH).x
    test = residual_test(SENSOR, y, x, false_alarm=rate)
    band = 4.5 * np.sqrt(rate * (1 - rate) / n)
    assert test.freedom == 4 and test.statistic.shape == (n,) and test.normalised.shape == (n, 6)
    assert np.mean(~test.passed) == pytest.approx(rate, abs=band)
    assert np.mean(np.abs(test.normalised).max(axis=1) > test.each_level) <= rate + band
    np.testing.assert_allclose(np.mean(np.square(test.normalised), axis=0), 1.0, atol=4.5 * np.sqrt(2 / n) + 0.02)
    np.testing.assert_array_equal(test.passed, test.p_value >= rate)
    np.testing.assert_allclose(test.redundancy.sum(axis=-1), 4.0, rtol=1e-9)
    assert test.statistic.mean() == pytest.approx(4.0, abs=4.5 * np.sqrt(8 / n))


def test_one_garbage_measurement_is_found_by_every_test():
    y = SENSOR.h(TRUTH) + np.array([0.3, -0.8, 0.5, 1.0, -0.6, 0.4])
    y[3] += 40.0                                           # a reflected signal
    before = y.copy()
    fix = gauss_newton(SENSOR, y, [50.0, 50.0])
    test = residual_test(SENSOR, y, fix.x)
    assert not test.passed and test.p_value < 1e-6 and int(test.suspect) == 3
    assert np.abs(test.normalised[3]) > test.each_level
    assert test.statistic == pytest.approx(fix.costs[-1])
    without = leave_one_out(SENSOR, y, [50.0, 50.0])
    assert without.statistics.argmin() == 3 and without.statistics[3] < test.level < without.statistics.max()
    assert without.converged.all() and without.x.shape == (6, 2)
    cleaned = exclude(SENSOR, y, [50.0, 50.0])
    assert cleaned.excluded == (3,) and cleaned.passed and cleaned.kept.sum() == 5
    np.testing.assert_allclose(cleaned.x, without.x[3], atol=1e-6)
    robust = huber(SENSOR, y, [50.0, 50.0])
    assert robust.converged and robust.weights.argmin() == 3 and robust.weights[3] < 0.2
    error = np.linalg.norm(np.stack([fix.x, robust.x, cleaned.x]) - TRUTH, axis=1)
    assert error[0] > 3.0 and error[1] < 1.5 and error[2] < 1.5
    np.testing.assert_array_equal(y, before)


def test_two_garbage_measurements_are_taken_out_one_by_one():
    y = SENSOR.h(TRUTH) + np.array([0.2, -0.5, 0.1, 0.6, -0.2, 0.7])
    y[1] += 60.0
    y[5] -= 35.0
    cleaned = exclude(SENSOR, y, [50.0, 50.0])
    assert set(cleaned.excluded) == {1, 5} and cleaned.passed and len(cleaned.tests) == 3
    assert [t.freedom for t in cleaned.tests] == [4, 3, 2]
    np.testing.assert_allclose(cleaned.x, TRUTH, atol=1.5)
    hopeless = exclude(SENSOR, np.array([10.0, 300.0, 20.0, 200.0, 5.0, 400.0]), [50.0, 50.0], damping=1.0)
    assert not hopeless.passed and hopeless.kept.sum() == 3 and hopeless.tests[-1].freedom == 1


def test_oracle_C2_14_is_free_of_garbage():
    e = entry("C2-14")
    sensor = Range(e["inputs"]["stations"], e["inputs"]["sigma"])
    test = residual_test(sensor, e["inputs"]["y"], e["expected"]["x"])
    np.testing.assert_allclose(test.residuals, e["expected"]["residual"], atol=1e-6)
    J = np.array(e["expected"]["J"])
    np.testing.assert_allclose(test.cov, 25.0 * np.eye(3) - J @ np.array(e["expected"]["cov"]) @ J.T, atol=1e-5)
    assert test.passed and test.freedom == 1
    np.testing.assert_allclose(np.abs(test.normalised), np.sqrt(test.statistic), rtol=1e-4)    # one degree of freedom


@properties
@given(st.integers(0, 10_000), st.booleans())
def test_identities_of_a_linear_sensor(seed, correlated):
    """V p as stated; leaving row i out lowers the statistic by w_i^2; batch equals loop."""
    rng = np.random.default_rng(seed)
    m, n = 6, 2
    B = rng.normal(size=(m, m))
    R = B @ B.T + np.eye(m) if correlated else np.diag(rng.uniform(0.5, 4, size=m))
    H, y = rng.normal(size=(m, n)), rng.normal(size=(3, m)) * 3
    sensor, W = Linear(H, R), np.linalg.inv(R)
    x = least_squares(H, y, W)
    test = residual_test(sensor, y, x)
    P = np.eye(m) - H @ np.linalg.solve(H.T @ W @ H, H.T @ W)
    np.testing.assert_allclose(test.cov, np.broadcast_to(P @ R @ P.T, (3, m, m)), atol=1e-8)
    np.testing.assert_allclose(np.trace(test.cov[0] @ W), m - n, rtol=1e-9)
    for k in range(3):
        one = residual_test(sensor, y[k], x[k])
        np.testing.assert_allclose(one.normalised, test.normalised[k], rtol=1e-9)
        assert float(one.statistic) == pytest.approx(float(test.statistic[k]))
        assert int(one.suspect) == int(test.suspect[k])
    without = leave_one_out(sensor, y[0], np.zeros(n), tolerance=1e-10)
    np.testing.assert_allclose(test.statistic[0] - without.statistics, np.square(test.normalised[0]), atol=1e-7)


def test_smallest_detectable_error():
    """An error of exactly this size is missed in 20 % of 2000 experiments; 4.5 standard errors, 7e-6."""
    rng, n = np.random.default_rng(5), 2000
    size = smallest_detectable(SENSOR, TRUTH, false_alarm=0.01, missed=0.2)
    from scipy.special import ndtri
    y = SENSOR.h(TRUTH) + rng.standard_normal((n, 6)) * np.sqrt(np.diag(SENSOR.R))
    y[:, 4] += size[4]
    x = gauss_newton_batch(SENSOR, y, TRUTH, tolerance=1e-6).x
    w = residual_test(SENSOR, y, x).normalised[:, 4]
    assert np.mean(np.abs(w) <= ndtri(0.995)) == pytest.approx(0.2, abs=4.5 * 0.4 / np.sqrt(n) + 0.01)
    assert np.all(size > np.sqrt(np.diag(SENSOR.R)) * (ndtri(0.995) + ndtri(0.8)))


def test_a_measurement_that_nothing_checks():
    """The only pseudorange that knows the second coordinate: its residual is always zero."""
    sensor = Linear([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 1.0)
    y = np.array([0.1, -0.2, 0.1, 77.0])
    test = residual_test(sensor, y, least_squares(sensor.H, y))
    assert test.redundancy[3] == pytest.approx(0.0, abs=1e-12) and test.normalised[3] == 0.0
    assert np.isinf(smallest_detectable(sensor, np.zeros(2))[3]) and int(test.suspect) != 3


def test_huber_between_mean_and_median():
    y = np.array([0.0, 1.0, 2.0, 3.0, 1000.0])
    sensor = Linear(np.ones((5, 1)), 1.0)
    for c, expected in ((1e6, y.mean()), (1e-3, np.median(y))):
        assert float(huber(sensor, y, [1.0], threshold=c, tolerance=1e-9, max_iterations=5000).x[0]) == pytest.approx(
            expected, abs=2e-3)
    fix = huber(sensor, y, [500.0], tolerance=1e-10)
    psi = np.clip(-fix.residuals, -1.345, 1.345)
    assert psi.sum() == pytest.approx(0.0, abs=1e-8)       # the estimating equation
    np.testing.assert_allclose(fix.weights, np.minimum(1.0, 1.345 / np.abs(fix.residuals)))
    clean = huber(SENSOR, SENSOR.h(TRUTH), [50.0, 50.0], tolerance=1e-8)
    np.testing.assert_allclose(clean.x, TRUTH, atol=1e-6)
    assert clean.weights.min() == 1.0 and clean.iterates.shape[1] == 2
    assert not huber(sensor, y, [500.0], max_iterations=1).converged


def test_rows_of_a_stack_with_angles():
    sensor = Stack([Bearing([[0.0, 0.0]], 0.1), Range(STATIONS[:2], [1.0, 2.0])])
    part = Rows(sensor, [True, False, True])
    x = np.array([[-1.0, -20.0], [3.0, 4.0]])
    y = np.array([np.pi - 0.01, 60.0])
    np.testing.assert_array_equal(part.h(x), sensor.h(x)[:, [0, 2]])
    np.testing.assert_array_equal(part.jacobian(x), sensor.jacobian(x)[:, [0, 2]])
    assert abs(part.innovation(y, part.h(x))[0, 0]) < 0.1              # wrapped
    nu = part.innovation(y, part.h(x))
    expected = -0.5 * (nu[:, 0] / 0.1) ** 2 - 0.5 * (nu[:, 1] / 2.0) ** 2 - np.log(2 * np.pi * 0.2)
    np.testing.assert_allclose(part.log_likelihood(y, x), expected, rtol=1e-12)


LINE = Linear(np.ones((3, 1)), 1.0)


@pytest.mark.parametrize(("call", "message"), [
    (lambda: residual_test(Range(STATIONS[:2], 1.0), [1.0, 2.0], TRUTH), "more measurements"),
    (lambda: residual_test(SENSOR, np.ones(5), TRUTH), "shape"),
    (lambda: residual_test(SENSOR, np.full(6, np.nan), TRUTH), "finite"),
    (lambda: residual_test(SENSOR, np.ones(6), TRUTH, false_alarm=0.0), "between 0 and 1"),
    (lambda: residual_test(Range(STATIONS, 1.0), np.ones(6), [1.0, 2.0, 3.0]), "every component"),
    (lambda: leave_one_out(Range(STATIONS[:2], 1.0), [1.0, 2.0], TRUTH), "more measurements"),
    (lambda: exclude(Pseudorange(STATIONS[:3], 1.0), np.ones(3), np.zeros(3)), "more measurements|singular"),
    (lambda: smallest_detectable(LINE, [0.0], missed=1.0), "between 0 and 1"),
    (lambda: Rows(LINE, [False] * 3), "truth values"),
    (lambda: Rows(LINE, [1, 1, 0]), "truth values"),
    (lambda: huber(LINE, np.ones(3), [0.0], threshold=0.0), "threshold"),
    (lambda: huber(LINE, np.ones(2), [0.0]), "shape"),
    (lambda: huber(Linear(np.ones((2, 1)), [[1.0, 0.5], [0.5, 1.0]]), np.ones(2), [0.0]), "diagonal"),
    (lambda: huber(Range([[100.0, 0.0], [0.0, 50.0]], 1.0), [108.0, 46.0], [50.0, 25.0]), "singular"),
    (lambda: huber(Range([[100.0, 0.0]], 1.0), [108.0], [50.0, 25.0]), "m >= n"),
])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
