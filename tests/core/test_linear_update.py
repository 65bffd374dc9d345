"""MAP cost, information form and gains of one's own: the numbers of the oracle and identities.  KF thesis chapter 3."""

import numpy as np
import pytest

from core.gaussian import sample
from core.kalman import update
from core.linear_update import information_update, joseph_form, map_cost, short_form, trace_gradient
from core.sensors import Linear
from core.types import Gaussian
from tests.oracle import entry

CASE = {k: np.array(v) for k, v in entry("T-04")["inputs"].items()}
PRIOR, SENSOR = Gaussian(CASE["x"], CASE["P"]), Linear(CASE["H"], CASE["R"])
BEST = np.array(entry("T-04")["expected"]["K"])


def trace(P):
    return np.trace(P, axis1=-2, axis2=-1)


def test_t_04_information_form_equals_gain_form():
    want = entry("T-04")["expected"]
    found = information_update(PRIOR, CASE["y"], SENSOR)
    np.testing.assert_allclose(found.posterior.mean, want["x_map"], rtol=1e-10)
    np.testing.assert_allclose(found.posterior.cov, want["P_post"], rtol=1e-10)
    np.testing.assert_allclose(found.hessian, want["hessian"], rtol=1e-10)
    measured, known = map_cost(PRIOR, CASE["y"], SENSOR, found.posterior.mean)
    assert measured + known == pytest.approx(want["cost"], rel=1e-10)
    gain_form = update(PRIOR, CASE["y"], SENSOR)
    np.testing.assert_allclose(gain_form.gain, want["K"], rtol=1e-10)
    np.testing.assert_allclose(gain_form.posterior.mean, found.posterior.mean, rtol=1e-12)


def test_the_cost_has_that_hessian_and_minimum():
    found = information_update(PRIOR, CASE["y"], SENSOR)
    d = np.random.default_rng(1).standard_normal((50, 2))
    raised = sum(map_cost(PRIOR, CASE["y"], SENSOR, found.posterior.mean + d))
    least = sum(map_cost(PRIOR, CASE["y"], SENSOR, found.posterior.mean))
    np.testing.assert_allclose(raised - least, 0.5 * np.einsum("ki,ij,kj->k", d, found.hessian, d), rtol=1e-10)


def test_fewer_measurements_than_states():
    sensor = Linear([[1.0, 0.0]], [[2.0]])
    found = information_update(PRIOR, [3.0], sensor)
    assert np.linalg.matrix_rank(found.measured) == 1                     # erratum K5
    assert (np.linalg.eigvalsh(found.hessian) > 0).all()
    np.testing.assert_allclose(found.posterior.cov, update(PRIOR, [3.0], sensor).posterior.cov, rtol=1e-12)


def test_t_05_trace_over_the_gain():
    want = entry("T-05")["expected"]
    scales = {"trace_opt": 1.0, "trace_zero": 0.0, "trace_1p2": 1.2, "trace_0p8": 0.8}
    for name, c in scales.items():
        assert trace(joseph_form(CASE["P"], CASE["H"], CASE["R"], c * BEST)) == pytest.approx(want[name], rel=1e-9)


def test_any_gain_costs_d_s_d():
    D = np.random.default_rng(2).standard_normal((20, 2, 2))
    S = CASE["H"] @ CASE["P"] @ CASE["H"].T + CASE["R"]
    raised = trace(joseph_form(CASE["P"], CASE["H"], CASE["R"], BEST + D))
    np.testing.assert_allclose(raised - entry("T-05")["expected"]["trace_opt"], trace(D @ S @ D.mT), rtol=1e-9)
    np.testing.assert_allclose(trace_gradient(CASE["P"], CASE["H"], CASE["R"], BEST + D), 2 * D @ S, atol=1e-9)
    np.testing.assert_allclose(trace_gradient(CASE["P"], CASE["H"], CASE["R"], BEST), 0.0, atol=1e-9)


def test_joseph_is_the_law_of_the_errors_and_the_short_form_is_not():
    rng, K = np.random.default_rng(3), 1.5 * BEST
    e, v = (sample(Gaussian(np.zeros(2), CASE[name]), 200_000, rng) for name in "PR")
    errors = e - (e @ CASE["H"].T + v) @ K.T
    real, claimed = np.cov(errors.T), short_form(CASE["P"], CASE["H"], K)
    np.testing.assert_allclose(real, joseph_form(CASE["P"], CASE["H"], CASE["R"], K), rtol=0.03, atol=0.03)
    assert np.trace(claimed) < 0 < np.trace(real)
    np.testing.assert_allclose(short_form(CASE["P"], CASE["H"], BEST), entry("T-04")["expected"]["P_post"], rtol=1e-9)


def test_wrong_input_is_named():
    with pytest.raises(ValueError, match="K: expected shape"):
        joseph_form(CASE["P"], CASE["H"], CASE["R"], np.ones((3, 2)))
    with pytest.raises(ValueError, match=r"P: .*eigenvalue"):
        short_form(-CASE["P"], CASE["H"], BEST)
    with pytest.raises(ValueError, match=r"prior\.cov"):
        information_update(Gaussian(CASE["x"], np.zeros((2, 2))), CASE["y"], SENSOR)
