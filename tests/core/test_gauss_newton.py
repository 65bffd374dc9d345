"""Gauss-Newton and Levenberg-Marquardt: the notes' iterates, basins, covariance of repeated experiments."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.closed_form import multilaterate
from core.gauss_newton import basins, gauss_newton, gauss_newton_batch
from core.linalg import least_squares
from core.orthogonal import back_substitute, factorise, inverse_gram
from core.sensors import Bearing, Linear, Position, Pseudorange, Range, Stack
from tests.oracle import entry

properties = settings(deadline=None, max_examples=40)
TWO = Range([[100.0, 0.0], [0.0, 50.0]], 10.0)
THREE = [[10.0, 5.0], [120.0, 0.0], [40.0, 90.0]]


def test_oracle_C2_07_from_the_centre_of_the_earth():
    e = entry("C2-07")
    given_, expected = e["inputs"], e["expected"]
    fix = gauss_newton(Pseudorange(given_["satellites"], 1.0), given_["pseudoranges"], given_["x0"],
                       tolerance=given_["delta"])
    assert len(fix.steps) == expected["iterations"] and fix.converged
    np.testing.assert_allclose(fix.iterates[1], expected["step1"], rtol=1e-9)
    truth = entry("C2-05")["expected"]["root1"]
    errors = np.linalg.norm(fix.iterates[:, :3] - truth["x"], axis=1)
    np.testing.assert_allclose(errors[:4], expected["error_m"], rtol=1e-4)
    np.testing.assert_allclose(fix.x, [*truth["x"], truth["b"]], rtol=0, atol=1e-2)


@pytest.mark.parametrize("weighted", [True, False])
def test_oracle_C2_10_all_iterates(weighted):
    e = entry("C2-10")
    fix = gauss_newton(TWO, e["inputs"]["y"], e["inputs"]["x0"], tolerance=e["inputs"]["delta"], weighted=weighted)
    np.testing.assert_allclose(fix.iterates, e["expected"]["iterates"], rtol=0, atol=1e-7)
    assert len(fix.steps) == e["expected"]["steps"] and fix.converged
    np.testing.assert_allclose(fix.x, e["expected"]["solution"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(fix.residuals[0], [-8.0, 4.0], atol=1e-12)              # h(x) - y
    np.testing.assert_allclose(fix.jacobians[0], -np.eye(2), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(fix.steps, axis=1)[:3], [8.944, 0.6907, 2.20e-3], rtol=2e-3)
    assert np.linalg.norm(fix.steps[-1]) < 1e-3 <= np.linalg.norm(fix.steps[-2])       # tested after the update
    np.testing.assert_allclose(fix.residual_norms, np.linalg.norm(fix.residuals, axis=1))
    np.testing.assert_allclose(fix.costs, fix.residual_norms**2 / (100.0 if weighted else 1.0))


def test_oracle_C2_14_three_ranges():
    e = entry("C2-14")
    fix = gauss_newton(Range(e["inputs"]["stations"], e["inputs"]["sigma"]), e["inputs"]["y"], e["inputs"]["x0"],
                       weighted=False, tolerance=1e-10)
    np.testing.assert_allclose(fix.x, e["expected"]["x"], atol=1e-8)
    np.testing.assert_allclose(fix.residuals[-1], e["expected"]["residual"], atol=1e-6)
    np.testing.assert_allclose(fix.jacobians[-1], e["expected"]["J"], atol=1e-6)
    np.testing.assert_allclose(fix.cov, e["expected"]["cov"], atol=1e-6)
    assert np.sqrt(np.trace(fix.cov)) / 5 == pytest.approx(e["expected"]["DOP"], abs=1e-7)
    np.testing.assert_allclose(fix.residuals[-1] @ fix.jacobians[-1], 0.0, atol=1e-6)  # residual at right angles
    with np.errstate(all="raise"):
        damped = gauss_newton(Range(e["inputs"]["stations"], 5.0), e["inputs"]["y"], [400.0, 700.0], damping=1.0,
                              tolerance=1e-10)
    np.testing.assert_allclose(damped.x, e["expected"]["x"], atol=1e-7)
    assert np.all(np.diff(damped.costs) <= 0.0) and damped.dampings[0] > damped.dampings[-1]


def test_oracle_C2_17_basins_of_attraction():
    """From [150, -50] each step flings the iterate 3 times farther, until rounding makes J singular (step 54)."""
    e = entry("C2-17")
    rows = [e["expected"][f"x2={v}"] for v in (150, 100, 50, 0, -50)]
    starts = np.array([[[a, b] for a in e["inputs"]["x1"]] for b in (150, 100, 50, 0, -50)], dtype=float)
    A, B = multilaterate(e["inputs"]["stations"], e["inputs"]["y"]).roots
    runs = gauss_newton_batch(TWO, e["inputs"]["y"], starts, max_iterations=200)
    where = basins(runs, [A, B])
    for (i, j), text in np.ndenumerate(np.array(rows)):
        if text == "singular":
            assert runs.singular[i, j] and not runs.converged[i, j] and runs.steps[i, j] == 0 and where[i, j] == -1
            with pytest.raises(ValueError, match="damping"):
                gauss_newton(TWO, e["inputs"]["y"], starts[i, j])
            continue
        assert where[i, j] == "AB".index(text[0]), starts[i, j]
        one = gauss_newton(TWO, e["inputs"]["y"], starts[i, j], max_iterations=200)
        np.testing.assert_allclose(one.x, [A, B]["AB".index(text[0])], atol=1e-6)
        if text[1:] and starts[i, j].tolist() not in ([150.0, 0.0], [150.0, -50.0]):
            assert runs.steps[i, j] == len(one.steps) == int(text[1:]), starts[i, j]
            assert (one.ranks == 2).all()
    norms = gauss_newton_batch(TWO, e["inputs"]["y"], [[0, 0], [50, 25], [150, 150]], max_iterations=1)
    assert norms.singular.tolist() == [False, True, False]             # [50, 25] is on the baseline
    for point, value in e["expected"]["residual_norm"].items():
        at = gauss_newton(TWO, e["inputs"]["y"], np.fromstring(point.strip("[]"), sep=","), damping=1e9,
                          max_iterations=1)
        assert at.residual_norms[0] == pytest.approx(value, rel=1e-9)


def test_damping_enlarges_the_basins():
    """With Levenberg-Marquardt every start of C2-17 converges, the stations and the far corner too, and quickly."""
    starts = np.array([[a, b] for a in (-50, 0, 50, 100, 150) for b in (150, 100, 50, 0, -50)], dtype=float)
    runs = gauss_newton_batch(TWO, [108.0, 46.0], starts, damping=1e-3)
    assert runs.converged.all() and runs.steps.max() <= 10
    assert (basins(runs, multilaterate(TWO.stations_m, [108.0, 46.0]).roots) >= 0).all()


def gauss_legendre(n, low, high):
    t, w = np.polynomial.legendre.leggauss(n)
    half = 0.5 * (high - low)
    return half[..., None] * t + 0.5 * (high + low)[..., None], half[..., None] * w


def exact_moments(sigma):
    """P(no solution), mean and covariance of the root on the origin's side, by quadrature over y."""
    n, reach = 160, 8.0 * sigma
    y1, w1 = gauss_legendre(n, np.array(100.0 - reach), np.array(100.0 + reach))
    # y2 = c + t^2 from where the circles touch: the root has a square root there
    touch = np.maximum(np.hypot(100.0, 50.0) - y1, 50.0 - reach)
    t, w2 = gauss_legendre(n, np.zeros(n), np.sqrt(np.maximum(50.0 + reach - touch, 0.0)))
    y2, w2 = touch[:, None] + t**2, 2.0 * t * w2
    y = np.stack([np.broadcast_to(y1[:, None], y2.shape), y2], axis=-1)
    density = np.exp(-0.5 * np.square((y - [100.0, 50.0]) / sigma).sum(axis=-1)) / (2 * np.pi * sigma**2)
    weights = w1[:, None] * w2 * density
    roots = multilaterate(TWO.stations_m, y).roots
    exists = np.isfinite(roots).all(axis=(-2, -1))
    side = roots[..., 0] + 2.0 * roots[..., 1]                                         # the baseline is at 100
    x = np.where((side[..., 0] < side[..., 1])[..., None], roots[..., 0, :], roots[..., 1, :])
    w, x = np.where(exists, weights, 0.0), np.where(exists[..., None], x, 0.0)
    total = w.sum()
    mean = (w[..., None] * x).sum(axis=(0, 1)) / total
    d = x - mean
    return 1.0 - total, mean, np.einsum("ij,ijk,ijl->kl", w, d, d) / total


@pytest.mark.parametrize("sigma", [1, 10])
def test_oracle_C2_23_exact_moments(sigma):
    expected = entry("C2-23")["expected"][f"sigma{sigma}"]
    none, mean, cov = exact_moments(float(sigma))
    np.testing.assert_allclose(mean, expected["mean"], atol=1e-4)
    np.testing.assert_allclose(cov, expected["cov"], atol=1e-4 * sigma**2)
    assert none == pytest.approx(expected.get("P_no_solution", 0.0), abs=1e-6)


@pytest.mark.parametrize("sigma", [1, 10])
def test_oracle_C2_23_a_thousand_experiments(sigma):
    """Bands of 3.4 standard deviations for 2 variances and 3 for 2 means: false alarm rate about 0.7 % each seed."""
    e = entry("C2-23")
    expected, n = e["expected"][f"sigma{sigma}"], e["inputs"]["n"]
    y = np.array([100.0, 50.0]) + sigma * np.random.default_rng(23).standard_normal((n, 2))
    sensor = Range(e["inputs"]["stations"], float(sigma))
    runs = gauss_newton_batch(sensor, y, e["inputs"]["x_true"])
    exists = np.isfinite(multilaterate(sensor.stations_m, y).roots).all(axis=(-2, -1))
    np.testing.assert_array_equal(runs.converged, exists)              # erratum M12: count them and leave them out
    assert np.sum(~exists) <= (12 if sigma == 10 else 0)               # Poisson(3.46): P(more than 12) = 6e-5
    good = runs.converged & (runs.x @ [1.0, 2.0] < 100.0)
    assert good.sum() >= exists.sum() - 1
    sample = runs.x[good]
    variance = np.diag(np.array(expected["cov"]))
    np.testing.assert_allclose(np.diag(np.cov(sample.T)), variance, rtol=0.15)
    assert np.all(np.abs(sample.mean(axis=0) - expected["mean"]) < 3.0 * np.sqrt(variance / n))
    linear = gauss_newton(sensor, [100.0, 50.0], [0.0, 0.0]).cov
    np.testing.assert_allclose(linear, sigma**2 * np.eye(2), atol=1e-12)
    assert np.isnan(runs.cov[~runs.converged]).all() and np.isfinite(runs.cov[runs.converged]).all()


def test_runs_without_a_solution_do_not_converge_and_damped_ones_end_between_the_circles():
    y = [[50.0, 40.0], [100.0, 50.0]]
    runs = gauss_newton_batch(TWO, y, [0.0, 0.0])
    assert runs.converged.tolist() == [False, True]
    single = gauss_newton(TWO, y[0], [0.0, 0.0])
    assert not single.converged and len(single.steps) == 50 and single.iterates.shape == (51, 2)
    damped = gauss_newton(TWO, y[0], [0.0, 0.0], damping=1e-3, tolerance=1e-4)
    assert damped.converged and damped.residuals[-1] == pytest.approx([10.9, 10.9], abs=0.1)
    np.testing.assert_allclose(damped.x @ [1.0, 2.0], 100.0, atol=1e-2)                # on the baseline


def test_weights_matter_and_correlated_errors_too():
    rng = np.random.default_rng(5)
    B = rng.normal(size=(4, 4))
    R, H, y = B @ B.T + np.eye(4), rng.normal(size=(4, 2)), rng.normal(size=4)
    fix = gauss_newton(Linear(H, R), y, [3.0, -4.0], tolerance=1e-9)
    np.testing.assert_allclose(fix.x, least_squares(H, y, np.linalg.inv(R)), rtol=1e-9)
    np.testing.assert_allclose(fix.cov, np.linalg.inv(H.T @ np.linalg.inv(R) @ H), rtol=1e-9)
    assert len(fix.steps) == 2                             # a linear sensor: one step, and one to see that it was it
    plain = gauss_newton(Linear(H, R), y, [3.0, -4.0], weighted=False, tolerance=1e-9)
    np.testing.assert_allclose(plain.x, least_squares(H, y), rtol=1e-9)
    K = np.linalg.pinv(H)
    np.testing.assert_allclose(plain.cov, K @ R @ K.T, rtol=1e-9)                      # (2.6)


def test_angles_are_wrapped():
    sensor = Stack([Bearing([[0.0, 0.0]], 0.01), Range([[0.0, 0.0]], 1.0)])
    fix = gauss_newton(sensor, [np.pi - 0.01, 50.0], [-0.5, -50.0])
    assert fix.converged and np.abs(fix.residuals[0, 0]) < 0.1
    np.testing.assert_allclose(fix.x, 50.0 * np.array([np.sin(np.pi - 0.01), np.cos(np.pi - 0.01)]), atol=1e-3)


@properties
@given(st.integers(0, 10_000), st.sampled_from([None, 1e-2]), st.booleans())
def test_batch_equals_loop_and_inputs_stay(seed, damping, weighted):
    rng = np.random.default_rng(seed)
    sensor = Range(rng.normal(size=(4, 2)) * 60, rng.uniform(1, 5, size=4))
    y, x0 = sensor.h(rng.normal(size=(3, 1, 2)) * 20) + rng.normal(size=(3, 1, 4)), rng.normal(size=(2, 2)) * 20
    before = y.copy(), x0.copy()
    runs = gauss_newton_batch(sensor, y, x0, damping=damping, weighted=weighted)
    assert runs.x.shape == (3, 2, 2) and runs.cov.shape == (3, 2, 2, 2) and runs.steps.shape == (3, 2)
    for i in range(3):
        for j in range(2):
            one = gauss_newton(sensor, y[i, 0], x0[j], damping=damping, weighted=weighted)
            assert one.converged == runs.converged[i, j] and len(one.steps) == runs.steps[i, j]
            np.testing.assert_allclose(runs.x[i, j], one.x, rtol=1e-9, atol=1e-9)
            assert runs.residual_norms[i, j] == pytest.approx(one.residual_norms[-1], rel=1e-9)
            assert runs.costs[i, j] == pytest.approx(one.costs[-1], rel=1e-9)
            if one.converged:
                np.testing.assert_allclose(runs.cov[i, j], one.cov, rtol=1e-8)
    np.testing.assert_array_equal(y, before[0])
    np.testing.assert_array_equal(x0, before[1])


@properties
@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(0, 4))
def test_column_wise_factors_match_numpy(seed, n, extra):
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(3, n + extra, n)), rng.normal(size=(3, n + extra))
    A[..., -1] *= 1e6
    kept = A.copy(), b.copy()
    f = factorise(A, b)
    np.testing.assert_allclose(back_substitute(f), [np.linalg.lstsq(a, c)[0] for a, c in zip(A, b, strict=True)],
                               rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(f.R.mT @ f.R, A.mT @ A, rtol=1e-9, atol=1e-9 * np.abs(A.mT @ A).max())
    np.testing.assert_allclose(inverse_gram(f) @ (A.mT @ A), np.broadcast_to(np.eye(n), (3, n, n)), atol=1e-3)
    A[0, :, -1] = A[0, :, 0]
    assert factorise(A, b).singular.tolist() == [n > 1, False, False]
    np.testing.assert_array_equal(A[1:], kept[0][1:])
    np.testing.assert_array_equal(b, kept[1])


@pytest.mark.parametrize(("sensor", "y", "x0", "options", "message"), [
    (Range([[100.0, 0.0]], 1.0), [108.0], [0.0, 0.0], {}, "measure more"),
    (TWO, [108.0, 46.0], [50.0, 25.0], {}, "singular"),
    (Range(THREE, 1.0), [50.0, 70.0, 60.0], [50.0, 30.0, 0.0], {}, r"components \[2\]"),
    (TWO, [108.0, np.nan], [0.0, 0.0], {}, "finite"),
    (TWO, [108.0, 46.0, 1.0], [0.0, 0.0], {}, "shape"),
    (TWO, [[108.0, 46.0]], [0.0, 0.0], {}, "gauss_newton_batch"),
    (TWO, [108.0, 46.0], [0.0, 0.0], {"tolerance": 0.0}, "tolerance"),
    (TWO, [108.0, 46.0], [0.0, 0.0], {"max_iterations": 0}, "max_iterations"),
    (TWO, [108.0, 46.0], [0.0, 0.0], {"damping": -1.0}, "damping"),
    (Linear(np.eye(2), np.diag([1.0, 0.0])), [0.0, 0.0], [0.0, 0.0], {}, "positive definite"),
])
def test_bad_input(sensor, y, x0, options, message):
    with pytest.raises(ValueError, match=message):
        gauss_newton(sensor, y, x0, **options)


def test_bad_batches():
    with pytest.raises(ValueError, match="batch axes"):
        gauss_newton_batch(TWO, np.ones((3, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match="shape"):
        basins(gauss_newton_batch(TWO, [108.0, 46.0], [0.0, 0.0]), [[1.0, 2.0, 3.0]])
    # a prior as one more sensor is how too few measurements become enough
    fix = gauss_newton(Stack([Range([[100.0, 0.0]], 1.0), Position(2, 50.0)]), [108.0, 0.0, 0.0], [1.0, 1.0])
    assert fix.converged
