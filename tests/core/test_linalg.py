"""Roots, subspaces and least squares: the numbers of MAT 1.1-1.2 and the identities behind them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import linalg as la
from tests.oracle import entry

seeds = st.integers(0, 10_000)
properties = settings(deadline=None, max_examples=60)


def random_psd(rng, n, rank, batch=()):
    B = rng.normal(size=(*batch, n, rank))
    return B @ B.mT


def test_oracle_C1_01_projection_is_idempotent():
    e = entry("C1-01")
    P = la.projection(e["inputs"]["A"])
    np.testing.assert_allclose(P @ P, P, rtol=0, atol=1e-12)
    np.testing.assert_allclose(P, P.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(la.schur(0.5 * (P + P.T)).values, e["expected"]["eigenvalues_desc"], rtol=0, atol=1e-12)
    assert np.trace(P) == pytest.approx(e["expected"]["trace"], abs=1e-12)
    np.testing.assert_allclose(np.diag(P), e["expected"]["leverages"], rtol=0, atol=1e-12)
    assert la.subspaces(P).rank == 2


def test_oracle_C1_02_schur_decomposition():
    e = entry("C1-02")
    Sigma = np.array(e["inputs"]["Sigma"])
    values, Q = la.schur(Sigma)
    np.testing.assert_allclose(values, e["expected"]["eigenvalues"], rtol=0, atol=1e-10)
    for i, name in enumerate(("q1", "q2")):
        assert abs(Q[:, i] @ e["expected"][name]) == pytest.approx(1.0, abs=1e-10)
    np.testing.assert_allclose(Q @ np.diag(values) @ Q.T, Sigma, rtol=0, atol=1e-12)
    angle = np.degrees(np.arctan2(*Q[::-1, 0])) % 180.0
    assert angle == pytest.approx(e["expected"]["major_axis_deg"], abs=1e-10)


def test_oracle_C1_03_two_square_roots():
    e = entry("C1-03")
    Sigma = np.array(e["inputs"]["Sigma"])
    S, L = la.sqrt_psd(Sigma), la.cholesky_psd(Sigma)
    np.testing.assert_allclose(S, e["expected"]["sqrtm"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(L, e["expected"]["chol_lower"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(S @ S, Sigma, rtol=0, atol=1e-12)
    np.testing.assert_allclose(L @ L.T, Sigma, rtol=0, atol=1e-12)
    np.testing.assert_allclose(L @ L, [[16, 0], [48, 16]], rtol=0, atol=1e-12)


def test_oracle_C1_04_exercise_1_5():
    e = entry("C1-04")
    A = np.array(e["inputs"]["A"])
    np.testing.assert_allclose(la.sqrt_psd(A), e["expected"]["sqrtm"], rtol=0, atol=1e-10)
    for B in [np.array(e["expected"]["sqrtm"]), *np.array(e["expected"]["other_roots"])]:
        for root in (B, -B):
            np.testing.assert_array_equal(root @ root, A)
    # all four come from the choice of signs of sqrt(lambda)
    values, Q = la.schur(A)
    roots = [Q @ np.diag(np.array(signs) * np.sqrt(values)) @ Q.T for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    semidefinite = [np.linalg.eigvalsh(B).min() >= 0 for B in roots]
    assert semidefinite == [True, False, False, False]


def test_oracle_C1_06_involutions():
    e = entry("C1-06")
    for B, symmetric, definite in zip(np.array(e["inputs"]["B"], dtype=float), e["expected"]["symmetric"],
                                      e["expected"]["positive_definite"], strict=True):
        np.testing.assert_allclose(B @ B, np.eye(2), rtol=0, atol=1e-12)
        assert B[0, 0] ** 2 + B[0, 1] * B[1, 0] == pytest.approx(1.0, abs=1e-12) and B[1, 1] == -B[0, 0]
        assert np.array_equal(B, B.T) is symmetric
        assert definite is False
        with pytest.raises(ValueError, match="expected a"):
            la.cholesky_positive("B", B)


def test_oracle_C1_07_regularised_least_squares():
    e = entry("C1-07")
    H, y, x0 = (np.array(e["inputs"][k]) for k in ("H", "y", "x0"))
    x = la.regularized_least_squares(H, y, x0)
    np.testing.assert_allclose(x, e["expected"]["x"], rtol=1e-9)
    cost = np.sum((y - H @ x) ** 2) + np.sum((x0 - x) ** 2)
    assert cost == pytest.approx(e["expected"]["cost"], rel=1e-9)
    np.testing.assert_allclose(x, np.linalg.solve(H.T @ H + np.eye(2), H.T @ y + x0), rtol=1e-12)


def test_oracle_C1_08_road_line():
    e = entry("C1-08")
    points = np.array(e["inputs"]["points"], dtype=float)
    A, y = np.column_stack([points[:, 0], np.ones(5)]), points[:, 1]
    fit = la.least_squares_fit(A, y)
    np.testing.assert_allclose(la.least_squares(A, y), [e["expected"]["a"], e["expected"]["b"]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(fit.residual, e["expected"]["residuals"], rtol=0, atol=1e-12)
    assert float(fit.cost) == pytest.approx(e["expected"]["rss"], abs=1e-12)
    np.testing.assert_allclose(fit.information, [[6, 2], [2, 5]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(A.T @ fit.residual, 0.0, atol=1e-14)


def test_oracle_C1_10_pythagoras():
    e = entry("C1-10")
    A, y, x = (np.array(e["inputs"][k]) for k in ("A", "y", "x"))
    fit = la.least_squares_fit(A, y)
    assert np.sum((y - A @ x) ** 2) == pytest.approx(e["expected"]["total"], rel=1e-9)
    assert np.sum((A @ (fit.x - x)) ** 2) == pytest.approx(e["expected"]["explained"], rel=1e-9)
    assert float(fit.cost) == pytest.approx(e["expected"]["residual"], rel=1e-9)


def test_oracle_C1_26_distribution_of_the_estimator():
    e = entry("C1-26")
    H, sigma = np.array(e["inputs"]["H"]), e["inputs"]["sigma"]
    fit = la.least_squares_fit(H, H @ [1.0, -2.0], np.full(4, sigma**-2.0))
    np.testing.assert_allclose(np.linalg.solve(fit.information, np.eye(2)), e["expected"]["cov_lsq"], rtol=1e-9)
    # 4000 repetitions at once; each entry of the sample covariance is asked to lie within 5 of its own standard
    # deviations: false alarm below 1e-5
    N = 4000
    noise = sigma * np.random.default_rng(26).standard_normal((N, 4))
    x = la.least_squares(H, H @ np.array([1.0, -2.0]) + noise)
    V = np.array(e["expected"]["cov_lsq"])
    sd = np.sqrt((V**2 + np.outer(np.diag(V), np.diag(V))) / N)
    assert np.all(np.abs(np.cov(x.T) - V) < 5 * sd)
    assert np.all(np.abs(x.mean(axis=0) - [1.0, -2.0]) < 5 * np.sqrt(np.diag(V) / N))


@properties
@given(seeds, st.integers(1, 5), st.integers(0, 6))
def test_oracle_C1_46_definiteness(seed, n, extra):
    """MAT exercises 1.1, 1.2, 1.4 on random matrices; the entry's example below."""
    rng = np.random.default_rng(seed)
    A, B = random_psd(rng, n, n + extra) + 1e-3 * np.eye(n), random_psd(rng, n, n + extra) + 1e-3 * np.eye(n)
    assert la.schur(A).values.min() > 0 and np.linalg.det(A) > 0
    la.cholesky_positive("A", A)
    A_inverse = np.linalg.solve(A, np.eye(n))
    la.cholesky_positive("inverse of A", 0.5 * (A_inverse + A_inverse.T))
    la.cholesky_positive("A + B", A + B)
    low = rng.normal(size=(n, 1)) * rng.normal(size=(1, n))
    low = low + low.T
    B = B + np.trace(B) / n * np.eye(n)                      # well conditioned: a rank is a question of rounding
    assert la.subspaces(B @ low @ B).rank == la.subspaces(low).rank


def test_oracle_C1_46_example_and_counter_example():
    e = entry("C1-46")
    A, B = np.array(e["inputs"]["A"], dtype=float), np.array(e["inputs"]["B"], dtype=float)
    assert la.subspaces(B @ A @ B).rank == la.subspaces(A).rank == e["expected"]["rank_BAB"]
    assert np.linalg.det(-np.eye(2)) == 1.0
    with pytest.raises(ValueError, match="smallest eigenvalue -1"):
        la.cholesky_positive("-I", -np.eye(2))


def test_exercise_1_7_inconsistent_wall_distances():
    """Distances l, 2l, 3l to the sides of an equilateral triangle of side 6l sum to 6l, not to its height 3 sqrt(3) l;
    least squares spreads the difference equally over the three walls."""
    angles = np.radians([90.0, 210.0, 330.0])
    normals, inradius = np.column_stack([np.cos(angles), np.sin(angles)]), np.sqrt(3.0)
    distances = np.array([1.0, 2.0, 3.0])
    fit = la.least_squares_fit(-normals, distances - inradius)
    np.testing.assert_allclose(fit.residual, (6 - 3 * np.sqrt(3)) / 3, rtol=0, atol=1e-12)


@properties
@given(seeds, st.integers(1, 5), st.integers(0, 5), st.sampled_from([(), (3,), (2, 1)]))
def test_roots_of_any_rank_and_batch(seed, n, rank, batch):
    P = random_psd(np.random.default_rng(seed), n, rank, batch)
    before = P.copy()
    S, L = la.sqrt_psd(P), la.cholesky_psd(P)
    scale = max(np.abs(P).max(), 1e-300)
    np.testing.assert_allclose(S @ S, P, rtol=0, atol=1e-13 * scale)
    np.testing.assert_array_equal(S, S.mT)
    np.testing.assert_allclose(L @ L.mT, P, rtol=0, atol=1e-13 * scale)
    np.testing.assert_array_equal(L, np.tril(L))
    assert np.all(np.diagonal(L, axis1=-2, axis2=-1) >= 0)
    for i in np.ndindex(batch):
        np.testing.assert_array_equal(la.cholesky_psd(P[i]), L[i])
        np.testing.assert_allclose(la.sqrt_psd(P[i]), S[i], rtol=0, atol=1e-12 * scale)
    np.testing.assert_array_equal(P, before)


def test_singular_factor_does_not_depend_on_units():
    P = np.array([[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    units = np.diag([1e6, 1e-6, 1.0])
    L = la.cholesky_psd(P)
    np.testing.assert_allclose(L, [[2, 0, 0], [1, 0, 0], [0, 0, 0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(la.cholesky_psd(units @ P @ units), units @ L, rtol=1e-12, atol=1e-20)


@properties
@given(seeds, st.integers(1, 4), st.integers(0, 4), st.sampled_from([(), (3,), (2, 2)]))
def test_least_squares_is_the_minimum_in_the_weighted_norm(seed, n, extra, batch):
    rng = np.random.default_rng(seed)
    m = n + extra
    A, y, W = rng.normal(size=(*batch, m, n)), rng.normal(size=(*batch, m)), random_psd(rng, m, m + 2)
    fit = la.least_squares_fit(A, y, W)
    assert fit.x.shape == (*batch, n) and fit.cost.shape == batch
    scale = np.abs(W).max() * np.abs(A).max() * np.linalg.cond(A).max()
    np.testing.assert_allclose(np.vecmat(np.matvec(W, fit.residual), A), 0.0, atol=1e-11 * scale)    # orthogonality
    np.testing.assert_allclose(fit.cost, np.vecdot(fit.residual, np.matvec(W, fit.residual)), rtol=1e-7, atol=1e-9)
    w = rng.uniform(0.5, 2.0, m)
    np.testing.assert_allclose(la.least_squares(A, y, w), la.least_squares(A, y, np.diag(w)), rtol=1e-7, atol=1e-9)
    for i in np.ndindex(batch):
        np.testing.assert_allclose(la.least_squares(A[i], y[i]), np.linalg.lstsq(A[i], y[i])[0], rtol=1e-7, atol=1e-9)


def test_regularised_path_runs_from_least_squares_to_the_guess():
    rng = np.random.default_rng(5)
    H, y, x0 = rng.normal(size=(6, 3)), rng.normal(size=(4, 6)), rng.normal(size=3)
    near = la.regularized_least_squares(H, y, x0, weight=1e-12)
    far = la.regularized_least_squares(H, y, x0, weight=1e12)
    np.testing.assert_allclose(near, la.least_squares(H, y), rtol=0, atol=1e-10)
    np.testing.assert_allclose(far, np.tile(x0, (4, 1)), rtol=0, atol=1e-10)
    fewer_rows = la.regularized_least_squares(H[:1], y[:, :1], x0)
    assert fewer_rows.shape == (4, 3)


def test_subspaces_complete_each_other():
    A = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])
    rank, column_space, null_space = la.subspaces(A)
    assert rank == 1 and column_space.shape == (2, 1) and null_space.shape == (3, 2)
    np.testing.assert_allclose(A @ null_space, 0.0, atol=1e-14)
    np.testing.assert_allclose(la.projection(column_space) @ A, A, rtol=0, atol=1e-14)
    assert la.subspaces(np.zeros((2, 3))).null_space.shape == (3, 3)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: la.sqrt_psd([[1.0, 0.5], [0.0, 1.0]]), "expected a symmetric matrix, got an asymmetry of 0.5"),
    (lambda: la.sqrt_psd(np.diag([1.0, -1.0])), "expected a positive semidefinite matrix, got the eigenvalue -1"),
    (lambda: la.cholesky_psd(np.diag([1.0, -1.0])), "expected a positive semidefinite matrix"),
    (lambda: la.cholesky_psd([[1e12, 0, 0], [0, 0, 1.0], [0, 1.0, 0]]), "expected a positive semidefinite matrix"),
    (lambda: la.cholesky_psd(np.stack([1e12 * np.eye(2), np.diag([1.0, -1.0])])), "positive semidefinite"),
    (lambda: la.cholesky_psd([[np.nan]]), "expected finite"),
    (lambda: la.cholesky_positive("P", np.ones((2, 2))), "P: expected a positive definite matrix"),
    (lambda: la.cholesky_positive("P", 0.1 * np.ones((3, 3))), "P: expected a positive definite matrix"),
    (lambda: la.schur(np.ones((2, 3))), "expected a square matrix, got shape (2, 3)"),
    (lambda: la.least_squares(np.ones((2, 3)), [1, 2]), "at least as many rows as columns, got shape (2, 3)"),
    (lambda: la.least_squares(np.ones((3, 2)), [1, 2, 3]), "linearly independent columns"),
    (lambda: la.least_squares(np.zeros((3, 1)), [1, 2, 3]), "linearly independent columns"),
    (lambda: la.least_squares([[0.1, 0.3], [0.2, 0.6], [0.7, 2.1]], [1, 2, 3]), "linearly independent columns"),
    (lambda: la.least_squares(np.ones((3, 1)), [1, 2]), "y: expected shape (..., 3), got (2,)"),
    (lambda: la.least_squares(np.ones((3, 1)), [1, 2, 3], [1, -1, 1]), "W: expected weights >= 0, got -1"),
    (lambda: la.least_squares(np.ones((3, 1)), [1, 2, 3], np.diag([1.0, -1, 1])), "W: expected a positive semi"),
    (lambda: la.regularized_least_squares(np.eye(2), [1, 2], [0]), "x0: expected shape (..., 2), got (1,)"),
    (lambda: la.regularized_least_squares(np.eye(1), [1], [0], weight=0.0), "weight: expected a positive number"),
    (lambda: la.subspaces(np.ones((2, 2, 2))), "A: expected one matrix (m, n)"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
