import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core import blocks
from core.blocks import for_each, spans
from core.noise import box_muller, linear_sampler, standard_normal, stream, stream_key


@pytest.fixture(scope="module")
def z():
    return standard_normal(np.random.default_rng(11), 200_000, 4)


def test_shape_and_layout(z):
    assert z.shape == (200_000, 4) and z.dtype == np.float32
    assert z[:, 0].flags.c_contiguous
    assert np.isfinite(z).all() and np.abs(z).max() < 6.8
    assert standard_normal(np.random.default_rng(1), 0, 3).shape == (0, 3)
    assert standard_normal(np.random.default_rng(1), 3, 1).shape == (3, 1)       # an odd number of numbers


def test_moments(z):
    n = z.size
    x = z.astype(np.float64)
    # 5 standard errors of the sample moments of N(0, 1), 4 of them: false alarm below 3e-6.
    assert abs(x.mean()) < 5 / np.sqrt(n)
    assert abs((x**2).mean() - 1) < 5 * np.sqrt(2 / n)
    assert abs((x**3).mean()) < 5 * np.sqrt(15 / n)
    assert abs((x**4).mean() - 3) < 5 * np.sqrt(96 / n)


def test_distribution_in_cells(z):
    from scipy.special import ndtri

    edges = ndtri(np.arange(1, 100) / 100)
    counts = np.bincount(np.searchsorted(edges, z.ravel()), minlength=100)
    expected = z.size / 100
    chi2 = np.square(counts - expected).sum() / expected
    assert 50 < chi2 < 170                                    # chi2 with 99 degrees of freedom: false alarm about 1e-5
    tail = (np.abs(z) > 4).sum()                              # expected 50.7 of 800,000, Poisson: 6 sd
    assert 10 < tail < 95


def test_components_are_independent(z):
    x = z.astype(np.float64)
    n = len(x)
    # The pairs of Box-Muller are components 0, 2 and 1, 3.  5 standard errors, 12 numbers: false alarm below 1e-5.
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        assert abs((x[:, a] * x[:, b]).mean()) < 5 / np.sqrt(n)
        assert abs(((x[:, a] ** 2 - 1) * (x[:, b] ** 2 - 1)).mean()) < 5 * 2 / np.sqrt(n)
    assert abs((x[1:] * x[:-1]).mean()) < 5 / np.sqrt(4 * n)


def test_depends_on_the_state_of_rng_and_not_on_threads():
    draws = [standard_normal(np.random.default_rng(3), 150_000, 3, threads=t) for t in (1, 2, 3)]
    assert all((d == draws[0]).all() for d in draws)
    rng = np.random.default_rng(3)
    state = rng.bit_generator.state
    first, second = standard_normal(rng, 10, 2), standard_normal(rng, 10, 2)
    assert (first != second).any()
    rng.bit_generator.state = state                           # a restored state replays the noise
    assert (standard_normal(rng, 10, 2) == first).all()
    assert (standard_normal(np.random.Generator(np.random.MT19937(1)), 5, 1).shape) == (5, 1)


def test_streams_differ():
    key = stream_key(np.random.default_rng(0))
    a, b = (box_muller(stream(key, k), 2, 50_000).astype(float) for k in (0, 1))
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 5 / np.sqrt(1e5)


@given(st.integers(1, 5), st.data())
def test_linear_sampler_is_phi_x_plus_L_z(n, data):
    r = data.draw(st.integers(1, n))
    entries = st.sampled_from([0.0, 0.0, 1.0, -0.5, 2.25])   # exact in float32
    Phi = np.array(data.draw(st.lists(entries, min_size=n * n, max_size=n * n))).reshape(n, n)
    L = np.array(data.draw(st.lists(entries, min_size=n * r, max_size=n * r))).reshape(n, r)
    if data.draw(st.booleans()):
        np.fill_diagonal(Phi, 1.0)
    rng = np.random.default_rng(n)
    x, z = rng.normal(size=(7, n)), rng.normal(size=(r, 7)).astype(np.float32)
    for start in (x, np.asfortranarray(x)):
        out = np.full((n, 7), np.nan).T
        before = start.copy(), z.copy()
        linear_sampler(Phi, L)(start, z, out)
        np.testing.assert_allclose(out, x @ Phi.T + (L @ z).T, atol=1e-5)
        assert (start == before[0]).all() and (z == before[1]).all()


def test_bad_input():
    for Phi, L in (([[1.0, 0.0]], [[1.0]]), (np.eye(2), [[1.0]]), (np.eye(2) * np.nan, np.eye(2))):
        with pytest.raises(ValueError):
            linear_sampler(Phi, L)
    with pytest.raises(ValueError, match="N, n >= 0"):
        standard_normal(np.random.default_rng(0), -1, 2)


@given(st.integers(0, 500_000), st.sampled_from([64, 1024, 65_536]))
def test_spans_cover_everything_once(N, size):
    parts = spans(N, size)
    assert [p.start for p in parts] == [0, *(p.stop for p in parts)][: len(parts)]
    assert (parts[-1].stop if parts else 0) == N
    assert all(0 < p.stop - p.start <= size for p in parts)


def test_for_each_keeps_order_and_passes_errors_on():
    assert for_each(lambda i: i * i, range(50), threads=3) == [i * i for i in range(50)]
    assert for_each(abs, []) == []
    done = []

    def work(i):
        if i == 3:
            raise KeyError(i)
        done.append(i)

    for threads in (1, 2, 4):
        with pytest.raises(KeyError):
            for_each(work, range(1000), threads)
    with pytest.raises(ValueError, match="threads"):
        for_each(abs, [1], 0)
    assert blocks._cores() >= 1


def test_for_each_may_be_nested():
    inner = lambda i: sum(for_each(lambda j: i * j, range(20), threads=2))  # noqa: E731
    assert for_each(inner, range(20), threads=2) == [190 * i for i in range(20)]
