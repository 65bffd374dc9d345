"""Linear and quadratic forms of a random vector."""

import numpy as np
import pytest

from core import forms
from core.gaussian import affine, chi_square_probability, sample
from core.types import Gaussian
from tests.oracle import entry


def test_oracle_C1_14_correlation():
    e = entry("C1-14")
    R = forms.correlation(e["inputs"]["Sigma"])
    np.testing.assert_allclose(R, [[1.0, e["expected"]["rho"]], [e["expected"]["rho"], 1.0]], rtol=1e-9)


def test_oracle_C1_21_quadratic_form():
    e = entry("C1-21")
    Sigma, mu, a = (np.array(e["inputs"][k]) for k in ("Sigma", "mu", "a"))
    g, A = Gaussian(mu, Sigma), np.outer(a, a) / (a @ Sigma @ a)
    n, noncentrality = forms.quadratic_form(g, A)
    assert n == e["expected"]["df"]
    assert noncentrality == pytest.approx(e["expected"]["lam"], rel=1e-9)
    assert n + noncentrality == pytest.approx(e["expected"]["mean"], rel=1e-9)
    assert 2 * (n + 2 * noncentrality) == pytest.approx(e["expected"]["var"], rel=1e-9)
    # 40000 draws: mean within 4.5 standard deviations (false alarm 7e-6) and the distribution function within the
    # Kolmogorov bound sqrt(ln(2/1e-6) / 2N) (false alarm below 1e-6, Massart)
    N = 40_000
    x = sample(g, N, np.random.default_rng(21))
    z = np.sort(np.vecdot(x, np.matvec(A, x)))
    assert abs(z.mean() - e["expected"]["mean"]) < 4.5 * np.sqrt(e["expected"]["var"] / N)
    gap = np.abs(np.arange(1, N + 1) / N - chi_square_probability(z, n, noncentrality)).max()
    assert gap < np.sqrt(np.log(2e6) / (2 * N)) + 1 / N


def test_oracle_C1_22_half_plane():
    e = entry("C1-22")
    g, a = Gaussian(np.array(e["inputs"]["mu"], dtype=float), np.array(e["inputs"]["Sigma"])), e["inputs"]["a"]
    line = affine(g, [a])
    assert float(line.mean[0]) == pytest.approx(e["expected"]["mean"], abs=1e-12)
    assert float(line.cov[0, 0]) == pytest.approx(e["expected"]["var"], rel=1e-9)
    P = forms.half_space_probability(g, a, e["inputs"]["threshold"])
    assert float(P) == pytest.approx(e["expected"]["P"], rel=1e-9)


def test_half_plane_of_a_constant_and_of_batches():
    g = Gaussian(np.array([1.0, 2.0]), np.diag([4.0, 0.0]))
    np.testing.assert_array_equal(forms.half_space_probability(g, [0.0, 1.0], [1.9, 2.0, 2.1]), [0.0, 1.0, 1.0])
    both = forms.half_space_probability(g, [[1.0, 0.0], [-1.0, 0.0]], [3.0, -3.0])
    np.testing.assert_allclose(both, [0.841344746068543, 0.158655253931457], rtol=1e-12)


def test_theorem_5_independent_linear_forms():
    """Whitened, two orthogonal directions; the directions themselves are oblique."""
    g = Gaussian(np.zeros(2), np.array([[16.0, 24.0], [24.0, 52.0]]))
    A, B = np.array([[1.0, 0.0]]), np.array([[-1.5, 1.0]])
    np.testing.assert_allclose(forms.cross_covariance(g, A, B), [[0.0]], atol=1e-12)
    assert A[0] @ B[0] != 0.0
    np.testing.assert_allclose(forms.cross_covariance(g, A, np.eye(2)), [[16.0, 24.0]])


@pytest.mark.parametrize(("call", "words"), [
    (lambda: forms.correlation(np.diag([1.0, 0.0])), "P: expected positive variances, got 0"),
    (lambda: forms.correlation(np.diag([1.0, -1.0])), "P: expected a positive semidefinite matrix"),
    (lambda: forms.quadratic_form(Gaussian(np.zeros(2), np.eye(2)), np.diag([2.0, 1.0])), "A cov idempotent"),
    (lambda: forms.quadratic_form(Gaussian(np.zeros(2), np.eye(2)), [[1.0, 1.0], [0.0, 0.0]]), "symmetric A"),
    (lambda: forms.half_space_probability(Gaussian(np.zeros(2), np.eye(2)), [1.0], 0.0), "a: expected shape (..., 2)"),
    (lambda: forms.cross_covariance(Gaussian(np.zeros(2), np.eye(2)), [[1.0]], np.eye(2)), "A: expected shape"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
