import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import resampling
from core.resampling import RESAMPLERS, draw, effective_sample_size, multinomial, residual, stratified, systematic
from tests.oracle import entry

NAMES = sorted(RESAMPLERS)
weights = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40).filter(lambda w: sum(w) > 1e-3)
unit = st.floats(0.0, 1.0, exclude_min=True)


def by_definition(w, z):
    """The rule c_{j-1} < z <= c_j read literally, c_N = 1."""
    w = np.asarray(w) / np.sum(w)
    c = [math.fsum(w[: j + 1]) for j in range(len(w))]
    c[np.flatnonzero(w)[-1]:] = [1.0] * (len(w) - np.flatnonzero(w)[-1])
    return [next(j for j in range(len(c)) if z_i <= c[j]) for z_i in z], np.array(c)


@pytest.mark.parametrize("k", range(4))
def test_effective_sample_size_c3_28(k):
    e = entry("C3-28")
    n_eff = effective_sample_size(e["inputs"]["w"][k])
    assert n_eff == pytest.approx(e["expected"]["neff"][k], rel=1e-10)


def test_systematic_c3_30():
    e = entry("C3-30")
    w = e["inputs"]["w"]
    for z1, parents in zip(e["inputs"]["z1"], e["expected"]["parents"], strict=True):
        assert (systematic(w, z1 * len(w)) + 1).tolist() == parents


def test_stratified_copy_guarantee_fails_c3_32():
    e = entry("C3-32")
    w, z = np.array(e["inputs"]["w"]), np.array(e["inputs"]["z"])
    assert (stratified(w, 3 * z - np.arange(3)) + 1).tolist() == e["expected"]["parents"]
    # Particle 2 is left out when the first point takes particle 1 and the second takes particle 3.
    first_leaves = _switch(lambda u: stratified(w, [u, 0.5, 0.5])[0] > 0)
    second_leaves = _switch(lambda u: stratified(w, [0.5, u, 0.5])[1] > 1)
    probability = first_leaves * (1.0 - second_leaves)
    assert probability == pytest.approx(e["expected"]["prob_zero_copies"], abs=1e-12)
    assert w[1] >= 1 / 3 and all(1 in systematic(w, u) for u in np.linspace(0.001, 1.0, 500))


def _switch(happens, low=0.0, high=1.0):
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if happens(middle) else (middle, high)
    return high


@given(weights, unit)
def test_systematic_follows_the_definition_and_keeps_within_one_copy(w, u):
    N = len(w)
    ancestors = systematic(w, u)
    share = N * np.array(w) / np.sum(w)
    copies = np.bincount(ancestors, minlength=N)
    assert copies.sum() == N and (np.diff(ancestors) >= 0).all()
    assert (np.abs(copies - share) < 1 + 1e-9).all()
    assert (copies[np.array(w) == 0.0] == 0).all()
    z = (np.arange(N) + u) / N
    expected, c = by_definition(w, np.minimum(z, 1.0))
    clear = np.abs(z[:, None] - c).min(axis=1) > 1e-12       # round-off decides only when a point lies on a boundary
    assert (ancestors[clear] == np.array(expected)[clear]).all()


@given(weights, st.data())
def test_the_others_follow_the_definition(w, data):
    N = len(w)
    u = np.array(data.draw(st.lists(unit, min_size=N, max_size=N)))
    for points, ancestors in ((u, multinomial(w, u)), ((np.arange(N) + u) / N, stratified(w, u))):
        expected, c = by_definition(w, np.minimum(points, 1.0))
        clear = np.abs(points[:, None] - c).min(axis=1) > 1e-12
        assert (ancestors[clear] == np.array(expected)[clear]).all()
    copies = np.bincount(residual(w, u), minlength=N)
    assert copies.sum() == N
    assert (copies >= np.floor(N * np.array(w) / np.sum(w) - 1e-9)).all()


@pytest.mark.parametrize("name", NAMES)
def test_expected_copies_are_N_w(name):
    rng = np.random.default_rng(7)
    w = np.array([0.02, 0.3, 0.0, 0.11, 0.25, 0.07, 0.25])
    runs = 4000
    copies = np.array([np.bincount(draw(name, w, rng), minlength=7) for _ in range(runs)])
    # Each count has variance at most N w; 5 standard errors on 7 counts: false alarm below 1e-5.
    assert (np.abs(copies.mean(axis=0) - 7 * w) <= 5 * np.sqrt(7 * w / runs)).all()


def test_systematic_expectation_is_exact():
    w = np.array([0.13, 0.29, 0.08, 0.5])
    u = (np.arange(1000) + 0.5) / 1000                       # every count is one step in u: error below 1/1000
    mean = np.mean([np.bincount(systematic(w, v), minlength=4) for v in u], axis=0)
    assert np.abs(mean - 4 * w).max() < 1e-3


def test_copy_variance_falls_from_multinomial_to_residual_to_systematic():
    rng = np.random.default_rng(3)
    w = rng.dirichlet(np.ones(30))
    spread = {n: np.var([np.bincount(draw(n, w, rng), minlength=30) for _ in range(600)], axis=0).sum() for n in NAMES}
    assert spread["multinomial"] > 1.2 * spread["residual"] > 1.2 * spread["stratified"]
    assert spread["stratified"] > 1.2 * spread["systematic"]
    assert spread["multinomial"] == pytest.approx((30 * w * (1 - w)).sum(), rel=0.1)


@pytest.mark.parametrize("N", [1, 2, 3, 10, 49, 1000])
def test_equal_weights_give_everyone_one_copy(N):
    w = np.full(N, 1.0 / N)                                  # N w_j misses 1 by one bit for N = 49
    everyone = np.arange(N)
    for u in (1.0, 0.5, 1e-9):
        assert (systematic(w, u) == everyone).all()
    assert (stratified(w, np.full(N, 1.0)) == everyone).all()
    assert (residual(w, []) == everyone).all()


def test_points_on_a_boundary_belong_to_the_left_particle():
    w = [0.25, 0.0, 0.25, 0.5, 0.0]
    assert multinomial(w, [0.25, 0.5, 1.0, 0.26, 1e-300]).tolist() == [0, 2, 3, 2, 0]
    assert systematic([0.5, 0.5], 1.0).tolist() == [0, 1]


def test_large_cloud_is_exact_and_independent_of_threads():
    rng = np.random.default_rng(5)
    N = 600_000
    w = rng.exponential(size=N) ** 4
    w[rng.random(N) < 0.3] = 0.0
    w /= w.sum()
    one, two = systematic(w, 0.3, threads=1), systematic(w, 0.3, threads=2)
    assert (one == two).all()
    copies = np.bincount(one, minlength=N)
    assert copies.sum() == N and np.abs(copies - N * w).max() < 1 + 1e-6
    c = np.cumsum(w.astype(np.longdouble))
    z = (np.arange(N) + np.longdouble(0.3)) / N
    assert (np.searchsorted(c, z) != one).mean() < 1e-5      # only points within round-off of a boundary


@pytest.mark.parametrize("alone", [0, 123_456, 299_999])
def test_all_weight_on_one_particle(alone):
    w = np.zeros(300_000)
    w[alone] = 1.0
    assert (systematic(w, 0.7, threads=2) == alone).all()
    assert effective_sample_size(w) == 1.0


def test_sum_other_than_one_is_divided_out():
    w = np.array([0.1, 0.05, 0.3, 0.2, 0.35])
    for scale in (1e-300, 1e-6, 1.0 + 1e-12, 7.0, 1e300):
        assert (systematic(scale * w, 0.6) == systematic(w, 0.6)).all()
        assert effective_sample_size(scale * w) == pytest.approx(float(effective_sample_size(w)))


def test_residual_uses_the_remainder_only():
    w = np.array([0.5, 0.3, 0.2])                            # N w = 1.5, 0.9, 0.6: one outright copy, remainder of 2
    assert residual(w, [0.25, 1.0]).tolist() == [0, 0, 2]
    assert residual(w, [0.26, 0.70]).tolist() == [0, 1, 1]
    assert residual(w, [0.25, 1.0, 0.5]).tolist() == [0, 0, 2]


def test_effective_sample_size_batches():
    rng = np.random.default_rng(2)
    w = rng.dirichlet(np.ones(6), size=(2, 3))
    batch = effective_sample_size(w)
    assert batch.shape == (2, 3)
    assert batch[1, 2] == pytest.approx(1 / np.square(w[1, 2]).sum())
    assert ((batch >= 1) & (batch <= 6)).all()


@pytest.mark.parametrize("name", NAMES)
def test_draw_depends_on_the_seed_only(name):
    w = np.random.default_rng(0).dirichlet(np.ones(50))
    a, b, c = (draw(name, w, np.random.default_rng(s)) for s in (1, 1, 2))
    assert (a == b).all() and (a != c).any()
    assert a.dtype == np.intp and len(a) == 50


@pytest.mark.parametrize("bad, message", [
    ([0.5, -0.1], "weights >= 0"), ([0.5, np.nan], "finite"), ([0.5, np.inf], "finite"), ([0.0, 0.0], "positive"),
    ([], "N >= 1"), ([[0.5, 0.5]], r"shape \(N,\)"), ("abc", "numbers"),
])
def test_bad_weights(bad, message):
    for resample in (lambda w: systematic(w, 0.5), lambda w: stratified(w, [0.5, 0.5]),
                     lambda w: multinomial(w, [0.5, 0.5]), lambda w: residual(w, [0.5, 0.5])):
        with pytest.raises(ValueError, match=message):
            resample(bad)
    if message != r"shape \(N,\)":
        with pytest.raises(ValueError):
            effective_sample_size(bad)


def test_bad_points_and_names():
    w = [0.5, 0.5]
    for u in (0.0, -0.1, 1.1, np.nan, [0.5]):
        with pytest.raises(ValueError, match="u: expected"):
            systematic(w, u)
    for method in (stratified, multinomial):
        for u in ([0.5], [0.5, 0.0], [0.5, 1.5], 0.5, [[0.5, 0.5]]):
            with pytest.raises(ValueError, match="u: expected"):
                method(w, u)
    with pytest.raises(ValueError, match="at least 2"):
        residual([0.5, 0.3, 0.2], [0.5])
    with pytest.raises(ValueError, match="systematic, stratified, multinomial, residual"):
        draw("best", w, np.random.default_rng(0))


@settings(max_examples=20)
@given(weights)
def test_inputs_are_not_modified(w):
    w = np.array(w)
    u = np.full(len(w), 0.5)
    w.setflags(write=False)
    u.setflags(write=False)
    systematic(w, 0.5)
    for method in (stratified, multinomial, residual):
        method(w, u)
    effective_sample_size(w)


def test_comb_calls_back_with_every_row_once():
    w = np.random.default_rng(1).dirichlet(np.full(1000, 0.05))
    seen = np.full(1000, -1)

    def then(rows, ancestors):
        assert (seen[rows] == -1).all()
        seen[rows] = ancestors

    assert (resampling.comb(w, 0.4, 1, then) == seen).all()
