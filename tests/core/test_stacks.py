"""Products and solves are the same for one matrix, a small stack, and a large stack kept batch last."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core import stacks
from core.types import Gaussian

pytestmark = pytest.mark.filterwarnings("error")


def stack(seed, runs, *core):
    return np.random.default_rng(seed).normal(size=(*runs, *core))


RUNS = st.sampled_from([(), (1,), (3,), (33,), (2, 20)])
SIZES = st.integers(1, 9)


@given(RUNS, SIZES, SIZES, SIZES, st.booleans(), st.booleans())
def test_times(runs, i, j, k, a_last, b_last):
    A, B = stack(0, runs, i, j), stack(1, runs, j, k)
    want = np.einsum("...ij,...jk->...ik", A, B)
    A, B = stacks.batch_last(A, 2) if a_last else A, stacks.batch_last(B, 2) if b_last else B
    np.testing.assert_allclose(stacks.times(A, B), want, atol=1e-12)
    np.testing.assert_allclose(stacks.times(B.mT, A.mT), want.mT, atol=1e-12)
    one = stack(2, (), k, k)
    np.testing.assert_allclose(stacks.times(B, one), np.einsum("...jk,kl->...jl", B, one), atol=1e-12)
    np.testing.assert_allclose(stacks.times(one, B.mT), np.einsum("kl,...jl->...kj", one, B), atol=1e-12)


@given(RUNS, SIZES, SIZES, st.booleans(), st.booleans())
def test_apply_and_congruence(runs, m, n, a_last, x_last):
    A, x, P = stack(0, runs, m, n), stack(1, runs, n), stack(2, runs, n, n)
    P = P + P.mT
    want, wide = np.einsum("...ij,...j->...i", A, x), np.einsum("...ij,...jk,...lk->...il", A, P, A)
    if a_last:
        A, P = stacks.batch_last(A, 2), stacks.batch_last(P, 2)
    if x_last:
        x = stacks.batch_last(x, 1)
    np.testing.assert_allclose(stacks.apply(A, x), want, atol=1e-12)
    np.testing.assert_allclose(stacks.congruence(A, P), wide, atol=1e-11)
    one = stack(3, (), 2, n)
    np.testing.assert_allclose(stacks.apply(one, x), np.einsum("ij,...j->...i", one, x), atol=1e-12)
    np.testing.assert_allclose(stacks.symmetric(P + 1.0), P + 1.0)


@given(RUNS, SIZES, SIZES, st.booleans())
def test_cholesky_and_solve(runs, m, n, last):
    A, B = stack(0, runs, m, m), stack(1, runs, m, n)
    S = A @ A.mT + np.eye(m)
    want = np.linalg.solve(S, B)
    if last:
        S, B = stacks.batch_last(S, 2), stacks.batch_last(B, 2)
    np.testing.assert_allclose(stacks.cholesky(S), np.linalg.cholesky(S), atol=1e-10)
    np.testing.assert_allclose(stacks.solve_spd(S, B), want, atol=1e-9)
    singular = S.copy(order="K")
    singular[..., :, 0] = singular[..., 0, :] = 0.0
    assert stacks.cholesky(singular) is None
    L = stacks.lower_root(singular)
    np.testing.assert_allclose(L @ L.mT, singular, atol=1e-9)
    with pytest.raises(ValueError, match="positive definite"):
        stacks.solve_spd(singular, B)


@pytest.mark.parametrize("shape", [(3,), (200,), (40, 3), (2, 2)])
def test_is_finite(shape):
    x = np.full(shape, 1e308)                                                   # its sum overflows, it is finite
    assert stacks.is_finite(x)
    for bad in (np.nan, np.inf, -np.inf):
        y = x.copy()
        y.flat[-1] = bad
        assert not stacks.is_finite(y)
    both = np.zeros(shape)
    both.flat[0], both.flat[-1] = np.inf, -np.inf
    assert not stacks.is_finite(both)


def test_memory_of_large_stacks_is_batch_last():
    g = stacks.law("g", Gaussian(np.zeros((40, 3)), np.tile(np.eye(3), (40, 1, 1))))
    assert stacks.is_batch_last(g.cov) and g.mean[:, 1].flags.c_contiguous
    assert stacks.law("g", g) is g
    small = stacks.law("g", Gaussian(np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1))))
    assert not stacks.is_batch_last(small.cov)
    assert stacks.shared(np.broadcast_to(np.eye(2), (5, 2, 2))).shape == (2, 2)


def test_infinite_variance_is_refused_quietly():
    for P in (np.diag([1.0, np.inf]), np.array([[1.0, np.inf], [np.inf, 1.0]]), np.diag([np.nan, 1.0])):
        with pytest.raises(ValueError, match="finite"):
            stacks.law("g", Gaussian(np.zeros(2), P))
