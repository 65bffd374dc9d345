"""Densities on grids: static Bayes, optimal estimates, and the point-mass filter against the Kalman filter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import grid, kalman
from core.gaussian import log_density
from core.grid import GridDensity, cells, moments
from core.motion import LinearMotion, constant_position, constant_velocity, discretise
from core.sensors import Linear, Position, Range, UniformNoise
from core.types import Gaussian
from tests.oracle import entry

properties = settings(deadline=None, max_examples=30)


def test_oracle_C2_31_product_of_two_normals():
    e = entry("C2-31")
    i, expected = e["inputs"], e["expected"]
    prior = grid.from_gaussian(Gaussian(np.array([i["mu"]]), np.array([[i["s0"] ** 2]])), [cells(-20.0, 20.0, 4000)])
    step = grid.update(prior, [i["y"]], Position(1, i["s"]))
    g = moments(step.posterior)
    assert float(g.mean[0]) == pytest.approx(expected["mean"], rel=1e-9)
    assert float(g.cov[0, 0]) == pytest.approx(expected["var"], rel=1e-9)
    assert step.evidence == pytest.approx(expected["evidence"], rel=1e-9)
    assert float(grid.mode(step.posterior)[0]) == pytest.approx(expected["mean"], rel=1e-9)


def test_oracle_C2_33_wedge():
    e = entry("C2-33")
    y, expected = e["inputs"]["y"], e["expected"]
    prior = grid.uniform([cells(-1.0, 1.0, 40_000)])
    assert float(moments(prior).mean[0]) == pytest.approx(expected["prior_mean"], abs=1e-12)
    assert float(moments(prior).cov[0, 0]) == pytest.approx(expected["prior_var"], rel=1e-8)
    x = prior.axes[0]
    step = grid.multiply(prior, np.log(np.where(x >= 0, (1 + y) / 2, (1 - y) / 2)))
    g = moments(step.posterior)
    assert float(g.mean[0]) == pytest.approx(expected["mean"], rel=1e-9)
    assert float(g.cov[0, 0]) == pytest.approx(expected["var"], rel=1e-8)
    assert step.posterior.weights[x >= 0].sum() == pytest.approx(expected["P_nonneg"], rel=1e-9)
    assert step.evidence == pytest.approx(expected["evidence"], rel=1e-9)
    np.testing.assert_allclose(step.posterior.density[x >= 0], (1 + y) / 2, rtol=1e-9)


def test_oracle_C2_35_blockage_in_a_pipe():
    e = entry("C2-35")
    i, expected = e["inputs"], e["expected"]
    step = grid.update(grid.uniform([cells(*i["prior"], 20_000)]), [i["y"]], Position(1, i["sd"]))
    g, p = moments(step.posterior), step.posterior
    assert float(g.mean[0]) == pytest.approx(expected["mean"], rel=1e-7)
    assert float(g.cov[0, 0]) == pytest.approx(expected["var"], rel=1e-7)
    assert float(np.sqrt(g.cov[0, 0])) == pytest.approx(expected["sd"], rel=1e-7)
    assert float(grid.mode(p)[0]) == pytest.approx(expected["map"], rel=1e-7)
    assert p.weights[p.axes[0] > 8].sum() == pytest.approx(expected["P_gt_8"], rel=1e-7)
    x = p.axes[0]
    np.testing.assert_allclose(p.density / np.exp(-(x - 8) ** 2 / 18), expected["c"], rtol=1e-7)
    assert float(grid.quantile(p, 1 - expected["P_gt_8"])) == pytest.approx(8.0, rel=1e-7)


def test_oracle_C2_37_exact_posterior():
    e = entry("C2-37")
    i, expected = e["inputs"], e["expected"]
    sensor = Range(i["stations"], i["sigma"])
    y = sensor.h(np.array(i["x_true"])) + i["dy"]
    step = grid.update(grid.uniform([cells(20.0, 85.0, 325), cells(-5.0, 65.0, 350)]), y, sensor)
    g = moments(step.posterior)
    np.testing.assert_allclose(g.mean, expected["grid_mean"], atol=1e-2)
    np.testing.assert_allclose(g.cov, expected["grid_cov"], atol=1e-2)


def test_oracle_C3_20_posterior_with_two_parts():
    e = entry("C3-20")
    y, expected = e["inputs"]["y"], e["expected"]

    class Sine:
        R = np.array([[1.0]])

        def h(self, x):
            return np.sin(x)

        def innovation(self, y, y_hat):
            return y - y_hat

    step = grid.update(grid.uniform([cells(0.0, 3 * np.pi, 90_000)]), [y], UniformNoise(Sine(), 0.5))
    p = step.posterior
    inside = p.weights > 0
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    h = p.spacing[0]
    got = [[p.axes[0][0] - h / 2, p.axes[0][edges[0]] + h / 2], [p.axes[0][edges[1]] + h / 2, p.axes[0][-1] + h / 2]]
    np.testing.assert_allclose(got, expected["intervals"], atol=1e-8)
    np.testing.assert_allclose(p.density[inside], expected["density"], atol=1e-8)
    g = moments(p)
    assert float(g.mean[0]) == pytest.approx(expected["mean"], abs=1e-8)
    assert float(g.cov[0, 0]) == pytest.approx(expected["var"], abs=1e-8)
    assert step.evidence == pytest.approx(expected["evidence"], abs=1e-8)
    at_mean = np.searchsorted(p.axes[0], float(g.mean[0]))
    assert p.weights[at_mean] == 0.0                       # the best mean-square estimate is impossible


def bimodal(count=40_001):
    """C3-23, half the cells below and above 0, so that a cell's centre is near each mode but on none."""
    i = entry("C3-23")["inputs"]

    def log_p(x):
        parts = [np.log(w) + log_density(Gaussian(np.array([m]), np.array([[s * s]])), x)
                 for w, m, s in zip(i["weights"], i["means"], i["sds"], strict=True)]
        return np.logaddexp(*parts)

    return grid.from_log_density([cells(-8.0, 12.0, count)], log_p)


def test_oracle_C3_23_mean_median_and_mode_differ():
    expected, p = entry("C3-23")["expected"], bimodal()
    g = moments(p)
    assert float(g.mean[0]) == pytest.approx(expected["mean"], abs=1e-6)
    assert float(g.cov[0, 0]) == pytest.approx(expected["var"], abs=1e-6)
    assert float(grid.median(p)[0]) == pytest.approx(expected["median"], abs=1e-6)
    map_ = grid.mode(p)
    assert float(map_[0]) == pytest.approx(expected["map"], abs=1e-6)
    assert p.density.max() == pytest.approx(expected["pdf_map"], abs=1e-6)
    assert float(grid.mean_square_error(p, map_)[0, 0]) == pytest.approx(expected["mse_at_map"], abs=1e-4)
    assert float(grid.mean_square_error(p, [4.9999965062041])[0, 0]) == pytest.approx(expected["mse_at_map"], abs=1e-6)
    assert float(grid.mean_square_error(g, [2.0])[0, 0]) == pytest.approx(expected["var"], abs=1e-6)


def test_each_estimate_minimises_its_loss():
    p = bimodal(2001)
    tries = np.linspace(-3.0, 7.0, 401)[:, None]
    squared = grid.expected_loss(p, tries, lambda e: e[..., 0] ** 2)
    absolute = grid.expected_loss(p, tries, lambda e: np.abs(e[..., 0]))
    assert float(tries[squared.argmin(), 0]) == pytest.approx(float(moments(p).mean[0]), abs=0.02)
    assert float(tries[absolute.argmin(), 0]) == pytest.approx(float(grid.median(p)[0]), abs=0.02)
    np.testing.assert_allclose(squared, np.ravel(grid.mean_square_error(p, tries)), rtol=1e-9)
    for delta, near in ((0.05, 5.0), (0.4, 5.0), (6.0, 2.0)):          # narrow: the sharp mode; wide: the bulk
        best = grid.hit_or_miss(p, delta)
        misses = grid.expected_loss(p, tries, lambda e, d=delta: (np.abs(e[..., 0]) > d).astype(float))
        assert best.probability >= 1.0 - misses.min() - 1e-12
        assert float(best.x[0]) == pytest.approx(near, abs=2 * delta)
    wide = grid.hit_or_miss(p, 2.0)
    assert float(wide.x[0]) == pytest.approx(0.0, abs=0.1)              # 0.95 * 0.6 beats 0.4: the other mode
    assert wide.probability == pytest.approx(0.5727, abs=2e-3)


def test_hit_or_miss_in_the_plane_is_a_disc():
    p = GridDensity([np.arange(7.0), np.arange(5.0)], np.random.default_rng(2).random((7, 5)))
    best = grid.hit_or_miss(p, 1.5)
    d = p.points.reshape(-1, 2)
    near = np.linalg.norm(d[:, None] - d, axis=-1) <= 1.5
    hits = (near @ p.weights.ravel()).reshape(7, 5)
    np.testing.assert_allclose(best.hits, hits, atol=1e-12)
    assert best.probability == pytest.approx(hits.max())
    np.testing.assert_array_equal(best.x, d[hits.argmax()])


@pytest.mark.parametrize(("dim", "counts", "steps", "worst"), [
    (1, (20, 40), 12, (1e-2, 2e-4)), (2, (24, 40), 12, (1e-3, 2e-4)), (4, (16, 22), 4, (0.1, 3e-3)),
])
def test_converges_to_the_kalman_filter(dim, counts, steps, worst):
    """Mean, covariance and evidence; what remains on a fine grid is the mass beyond 5 standard deviations."""
    rng = np.random.default_rng(dim)
    axes = max(1, dim // 2)
    if dim == 1:
        motion, initial = constant_position(1.0, 2.0, 1), Gaussian(np.zeros(1), np.array([[25.0]]))
    else:
        motion = constant_velocity(1.0, 1.0, axes)
        initial = Gaussian(np.array([0.0] * axes + [5.0] * axes), np.diag([100.0] * axes + [9.0] * axes))
    sensor = Position(axes, [3.0] if dim == 1 else [30.0, 50.0][:axes])
    ys = rng.normal(size=(steps, axes)) * np.sqrt(np.diag(sensor.R)) + (dim > 1) * 4.0 * np.arange(steps)[:, None]
    exact = kalman.run(initial, ys, motion, sensor)
    sd = np.sqrt(np.diagonal(exact.posterior.cov, axis1=-2, axis2=-1))
    evidence = [log_density(Gaussian(np.zeros(axes), S), nu)
                for S, nu in zip(exact.innovation_cov, exact.innovation, strict=True)]
    for count, bound in zip(counts, worst, strict=True):
        start = grid.from_gaussian(initial, grid.gaussian_axes(initial, count))
        found = grid.run(start, ys, motion, sensor, components=range(axes))
        assert np.abs((found.means - exact.posterior.mean) / sd).max() < bound
        assert np.abs((found.covs - exact.posterior.cov) / (sd[:, :, None] * sd[:, None])).max() < bound
        assert np.abs(found.log_evidences - evidence).max() < bound
        assert found.lost.max() < 1e-3
        assert found.updates[-1].posterior.weights.shape == (count,) * dim


def law_of(p, motion):
    return kalman.predict(moments(p), motion)


@pytest.mark.parametrize("motion", [
    LinearMotion([[0.8, -0.6], [0.6, 0.8]], np.diag([0.5, 0.1])),                      # a rotation: three shears
    LinearMotion([[0.0, 1.0], [-1.0, 0.0]], np.zeros((2, 2))),                         # a quarter turn: axes swap
    LinearMotion([[-0.5, 0.0], [0.3, 2.0]], [[0.3, 0.2], [0.2, 0.4]]),
    discretise([[0.0, 1.0], [-0.4, -0.7]], [[0.0], [1.0]], [[0.3]], 0.8),              # a damped spring
    constant_velocity(2.0, 0.5, 1),
    constant_position(1.0, 0.0, 2),
])
def test_any_linear_motion_moves_both_moments_exactly(motion):
    g = Gaussian(np.array([3.0, -2.0]), np.array([[4.0, 1.2], [1.2, 1.0]]))
    p = grid.from_gaussian(g, grid.gaussian_axes(g, (70, 60), 7.0))
    step = grid.prediction(p, motion, moving=True, width=7.0)
    truth = kalman.predict(g, motion)
    for found in (step.blurred, step.prior):
        np.testing.assert_allclose(moments(found).mean, truth.mean, atol=1e-5)
        np.testing.assert_allclose(moments(found).cov, truth.cov, atol=1e-4)
    exact = log_density(truth, step.prior.points)
    np.testing.assert_allclose(step.prior.density, np.exp(exact), atol=1e-5 * np.exp(exact).max())
    assert step.lost < 1e-6 and step.prior.weights.min() >= 0.0


def test_correlated_noise_and_clusters_of_components():
    Q = np.zeros((3, 3))
    Q[np.ix_([0, 2], [0, 2])] = [[2.0, 0.9], [0.9, 1.0]]
    g = Gaussian(np.zeros(3), np.diag([3.0, 1.0, 2.0]))
    p = grid.from_gaussian(g, grid.gaussian_axes(g, (30, 14, 31), 6.0))
    blurred = grid.blur(p, Q)
    assert len(blurred.axes[1]) == 14                      # no noise, no margin
    np.testing.assert_allclose(moments(blurred).cov, moments(p).cov + Q, atol=1e-6)


def test_the_same_axes_by_default_and_lost_mass():
    p = GridDensity(cells(0.0, 10.0, 100), np.eye(100)[97])
    step = grid.prediction(p, constant_position(1.0, 0.5, 1))
    np.testing.assert_array_equal(step.prior.axes[0], p.axes[0])
    assert step.lost == pytest.approx(0.309, abs=0.06)     # P(z > 0.25 / 0.5), up to the cell's own width
    x, t = p.axes[0], step.blurred
    np.testing.assert_allclose(t.density, np.exp(-2 * np.square(t.axes[0] - x[97])) / np.sqrt(np.pi / 2), atol=1e-9)


def test_nonlinear_motion_shares_each_cell():
    class Swing:
        Q = np.diag([0.04, 0.04])

        def f(self, x):
            return np.stack([x[..., 0] + np.sin(x[..., 1]), 0.9 * x[..., 1] - 0.2 * np.sin(x[..., 0])], axis=-1)

    g = Gaussian(np.array([0.5, 0.3]), np.diag([0.2, 0.3]))
    p = grid.from_gaussian(g, grid.gaussian_axes(g, 60))
    x, w = Swing().f(p.points).reshape(-1, 2), p.weights.ravel()
    mean = w @ x
    cov = (w[:, None] * (x - mean)).T @ (x - mean)
    moved = grid.deposit(p, Swing())
    np.testing.assert_allclose(moments(moved).mean, mean, atol=1e-9)
    excess = np.diag(moments(moved).cov - cov)
    assert np.all(excess > 0.0) and np.all(excess <= 0.25 * p.spacing**2)
    step = grid.prediction(p, Swing(), moving=True, width=6.0)
    np.testing.assert_allclose(moments(step.prior).mean, mean, atol=1e-4)
    np.testing.assert_allclose(moments(step.prior).cov, cov + Swing.Q, atol=0.3 * p.spacing.max() ** 2 + 1e-4)


def test_nothing_underflows():
    """Four readings 50 standard deviations away: the weights vanish, their logarithms do not."""
    prior = grid.uniform([cells(0.0, 100.0, 1000)])
    first = grid.update(prior, [2.0], Position(1, 1.0))
    assert first.posterior.weights[-1] == 0.0
    p = first
    for _ in range(4):
        p = grid.update(p.posterior, [98.0], Position(1, 1.0))
    assert float(moments(p.posterior).mean[0]) == pytest.approx((2.0 + 4 * 98.0) / 5, abs=1e-6)
    assert p.log_evidence < -100.0 and first.evidence == pytest.approx(0.01 * 0.9772, abs=1e-4)


def test_components_give_the_same_posterior():
    g = Gaussian(np.array([1.0, 2.0, 0.0]), np.diag([4.0, 9.0, 1.0]))
    prior = grid.from_gaussian(g, grid.gaussian_axes(g, (11, 12, 13)))
    sensor = Range([[5.0, 0.0], [0.0, 9.0]], 1.0)
    full, part = grid.update(prior, [4.0, 7.0], sensor), grid.update(prior, [4.0, 7.0], sensor, components=[0, 1])
    np.testing.assert_allclose(part.posterior.weights, full.posterior.weights, rtol=1e-12)
    assert part.log_likelihood.shape == (11, 12, 1)
    last = grid.update(prior, [0.3], Linear([[0.0, 0.0, 1.0]], 0.5), components=[2])
    np.testing.assert_allclose(grid.marginal(last.posterior, [0, 1]).weights, grid.marginal(prior, [0, 1]).weights,
                               atol=1e-12)


@properties
@given(st.integers(0, 10_000), st.integers(1, 3))
def test_sums_match_a_loop_over_cells_and_inputs_stay(seed, d):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(2, 6, size=d))
    axes = [rng.normal() + rng.uniform(0.1, 2) * np.arange(n) for n in shape]
    w, ll = rng.random(shape), rng.normal(size=shape)
    before = [a.copy() for a in axes], w.copy(), ll.copy()
    p = GridDensity(axes, w)
    step = grid.multiply(p, ll)
    total = sum(w[i] / w.sum() * np.exp(ll[i]) for i in np.ndindex(shape))
    assert step.evidence == pytest.approx(total)
    mean = sum(p.weights[i] * np.array([a[k] for a, k in zip(axes, i, strict=True)]) for i in np.ndindex(shape))
    np.testing.assert_allclose(moments(p).mean, mean, rtol=1e-9, atol=1e-12)
    for i in np.ndindex(shape):
        assert step.posterior.weights[i] == pytest.approx(p.weights[i] * np.exp(ll[i]) / total)
        np.testing.assert_array_equal(p.points[i], [a[k] for a, k in zip(axes, i, strict=True)])
    assert p.density.sum() * p.cell_volume == pytest.approx(1.0)       # erratum M19
    grid.predict(p, LinearMotion(np.eye(d), 0.1 * np.eye(d)))
    for kept, now in zip((*before[0], *before[1:]), (*axes, w, ll), strict=True):
        np.testing.assert_array_equal(kept, now)
    with pytest.raises(ValueError, match="read-only"):
        p.weights[(0,) * d] = 1.0


@pytest.mark.parametrize("d", [1, 2, 3])
def test_mode_of_a_normal_law_is_exact(d):
    rng = np.random.default_rng(d)
    B = rng.normal(size=(d, d))
    g = Gaussian(rng.normal(size=d), B @ B.T + 0.3 * np.eye(d))
    p = grid.from_gaussian(g, grid.gaussian_axes(Gaussian(g.mean + 0.1, g.cov), 21))
    np.testing.assert_allclose(grid.mode(p), g.mean, atol=1e-9)
    edge = GridDensity(cells(0.0, 1.0, 4), [4.0, 3.0, 2.0, 1.0])
    assert float(grid.mode(edge)[0]) == 0.125


def test_quantiles_and_marginals():
    p = GridDensity([cells(0.0, 4.0, 4), cells(0.0, 2.0, 2)], [[1, 1], [0, 0], [0, 0], [1, 1]])
    np.testing.assert_allclose(grid.quantile(p, [0.0, 0.25, 0.5, 0.75, 1.0]), [0.0, 0.5, 1.0, 3.5, 4.0])
    np.testing.assert_allclose(grid.quantile(p, 0.5, component=1), 1.0)
    np.testing.assert_allclose(grid.median(p), [1.0, 1.0])
    np.testing.assert_allclose(grid.marginal(p, [1]).weights, [0.5, 0.5])
    np.testing.assert_allclose(grid.mode(p), [0.5, 0.5])                # the first of equal tops


AXIS = cells(0.0, 1.0, 4)


@pytest.mark.parametrize(("call", "message"), [
    (lambda: cells(1.0, 1.0, 5), "low < high"),
    (lambda: cells(0.0, np.nan, 5), "low < high"),
    (lambda: cells(0.0, 1.0, 1), "2 cells"),
    (lambda: GridDensity([], 1.0), "at least one axis"),
    (lambda: GridDensity([1.0], [1.0]), "rising"),
    (lambda: GridDensity([3.0, 2.0, 1.0], np.ones(3)), "rising"),
    (lambda: GridDensity([1.0, 2.0, 4.0], np.ones(3)), "equal spacing"),
    (lambda: GridDensity([1.0, np.nan], np.ones(2)), "finite"),
    (lambda: GridDensity(AXIS, np.ones(3)), "shape"),
    (lambda: GridDensity(AXIS, [1.0, -0.1, 1.0, 1.0]), ">= 0"),
    (lambda: GridDensity(AXIS, np.zeros(4)), "vanish"),
    (lambda: GridDensity(AXIS, [1.0, np.nan, 1.0, 1.0]), "finite"),
    (lambda: GridDensity.from_log_weights([AXIS], np.full(4, -np.inf)), "positive probability"),
    (lambda: GridDensity.from_log_weights([AXIS], [0.0, np.nan, 0.0, 0.0]), "numbers or -inf"),
    (lambda: grid.gaussian_axes(Gaussian(np.zeros(1), np.zeros((1, 1))), 10), "positive variances"),
    (lambda: grid.multiply(grid.uniform([AXIS]), np.full(4, -np.inf)), "possible somewhere"),
    (lambda: grid.multiply(grid.uniform([AXIS]), np.zeros(3)), "broadcasts"),
    (lambda: grid.multiply(grid.uniform([AXIS]), [0.0, 0.0, 0.0, np.nan]), "NaN"),
    (lambda: grid.update(grid.uniform([AXIS]), [0.1, 0.2], Position(1, 1.0)), "shape"),
    (lambda: grid.update(grid.uniform([AXIS]), [0.1], Position(1, 1.0), components=[1]), "components"),
    (lambda: grid.predict(grid.uniform([AXIS]), constant_velocity(1.0, 1.0, 1)), "components"),
    (lambda: grid.transport(grid.uniform([AXIS, AXIS]), [[1.0, 1.0], [1.0, 1.0]]), "invertible"),
    (lambda: grid.blur(grid.uniform([AXIS]), [[-1.0]]), "semidefinite"),
    (lambda: grid.follow(grid.uniform([AXIS]), width=0.0), "width"),
    (lambda: grid.regrid(grid.uniform([AXIS]), [AXIS + 50.0]), "density is positive"),
    (lambda: grid.regrid(grid.uniform([AXIS]), [AXIS, AXIS]), "expected 1"),
    (lambda: grid.marginal(grid.uniform([AXIS]), [1]), "rising indices"),
    (lambda: grid.quantile(grid.uniform([AXIS]), 1.5), "from 0 to 1"),
    (lambda: grid.hit_or_miss(grid.uniform([AXIS]), 0.0), "delta"),
    (lambda: grid.run(grid.uniform([AXIS]), [1.0, 2.0], constant_position(1.0, 1.0, 1), Position(1, 1.0)), "shape"),
])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
