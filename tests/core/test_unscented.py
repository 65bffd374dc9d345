"""Unscented transform and filter: oracle numbers, exactness, definiteness, angles, and the printed variant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core import kalman, unscented
from core.linalg import sqrt_psd
from core.motion import constant_velocity
from core.sensors import Bearing, Linear, Position, Range, Stack
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
FIX = Position(2, [30.0, 50.0])
PAIR = Range([[-250.0, 0.0], [250.0, 0.0]], 10.0)


def random_law(seed, n, runs=()):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(*runs, n, n))
    return Gaussian(rng.normal(size=(*runs, n)), A @ A.mT + 0.2 * np.eye(n))


# --- numbers -----------------------------------------------------------------------------------------------------


def test_c3_12_sigma_points_with_both_roots():
    e = entry("C3-12")
    g = Gaussian(np.array(e["inputs"]["x"], dtype=float), np.array(e["inputs"]["P"]))
    for root, key in (("cholesky", "points_chol"), ("symmetric", "points_sqrtm")):
        points, weights = unscented.sigma_points(g, e["inputs"]["kappa"], root=root)
        np.testing.assert_allclose(points, e["expected"][key], atol=1e-10)
        np.testing.assert_allclose(weights, e["expected"]["weights"], atol=1e-10)
        d = points - g.mean
        np.testing.assert_allclose(weights @ points, g.mean, atol=1e-12)
        np.testing.assert_allclose((d * weights[:, None]).T @ d, g.cov, atol=1e-11)


def test_c3_14_polar_to_cartesian():
    e = entry("C3-14")
    g = Gaussian(np.array(e["inputs"]["mean"]), np.array(e["inputs"]["P"]))
    t = unscented.transform(lambda x: x[..., :1] * np.stack([np.cos(x[..., 1]), np.sin(x[..., 1])], axis=-1), g,
                            e["inputs"]["kappa"])
    np.testing.assert_allclose(t.mean, e["expected"]["ut_mean"], atol=1e-6)
    np.testing.assert_allclose(t.cov, e["expected"]["ut_cov"], atol=1e-6)
    assert t.definite
    d, dx = t.images - t.mean, t.points - g.mean                               # the sums of (3.16) as they stand
    np.testing.assert_allclose((d * t.weights[:, None]).T @ d, t.cov, atol=1e-9)
    np.testing.assert_allclose((dx * t.weights[:, None]).T @ d, t.cross, atol=1e-9)


def test_c3_15_one_dimension():
    e = entry("C3-15")
    i, want = e["inputs"], e["expected"]
    g = Gaussian(np.array([float(i["mu"])]), np.array([[float(i["sigma"]) ** 2]]))
    for kappa, fourth in zip(i["kappa"], want["ut4"], strict=True):
        moments = [unscented.transform(lambda x, p=p: x**p, g, kappa).mean[0] for p in (1, 2, 3, 4)]
        np.testing.assert_allclose(moments, [*want["moments"][:3], fourth], atol=1e-9)
    sixth = unscented.transform(lambda x: (x - i["mu"]) ** 6, g, 2).mean[0]
    assert sixth == pytest.approx(want["central6_kappa2"][0], abs=1e-9)


def test_c3_15_cross_moments_in_two_dimensions_are_missed():
    g = Gaussian(np.zeros(2), np.diag([4.0, 9.0]))
    t = unscented.transform(lambda x: np.stack([x[..., 0] ** 4, x[..., 0] ** 2 * x[..., 1] ** 2], axis=-1), g, 1.0)
    np.testing.assert_allclose(t.mean, [3 * 16, 0.0], atol=1e-9)


def test_c3_17_first_step_of_example_22():
    e = entry("C3-17")
    i, want = e["inputs"], e["expected"]["ukf_redraw"]
    prior = unscented.predict(Gaussian(np.array(i["x0"]), np.array(i["P0"])), CV, kappa=i["kappa"])
    np.testing.assert_allclose(prior.mean, [-147, -27, 3, 3], atol=1e-10)
    step = unscented.update(prior, i["y"], PAIR, kappa=i["kappa"])
    for got, key in ((step.posterior.mean, "x"), (step.posterior.cov, "P"), (step.y_hat, "ybar"),
                     (step.innovation_cov, "S")):
        np.testing.assert_allclose(got, want[key], atol=1e-6)
    np.testing.assert_allclose(step.weights, [-1 / 3, *[1 / 6] * 8])
    assert step.definite                                                        # erratum M17: it could have been lost


def test_c3_19_redraw_is_the_kalman_filter_and_reuse_is_not():
    e = entry("C3-19")
    i, want = e["inputs"], e["expected"]
    start = Gaussian(np.array(i["x0"]), np.array(i["P0"]))
    redraw = unscented.run(start, [i["y"]], CV, FIX, i["kappa"])
    reuse = unscented.run(start, [i["y"]], CV, FIX, i["kappa"], redraw=False)
    np.testing.assert_allclose(redraw.posterior.mean[0], want["ukf_redraw"], atol=1e-8)
    np.testing.assert_allclose(redraw.posterior.cov[0].diagonal(), want["P_kf_diag"], atol=1e-8)
    np.testing.assert_allclose(reuse.posterior.mean[0], want["ukf_reuse"], atol=1e-8)
    np.testing.assert_allclose(reuse.posterior.cov[0].diagonal(), want["P_reuse_diag"], atol=1e-8)
    images = unscented.transform(CV.f, start, i["kappa"]).images
    by_hand = unscented.update(unscented.predict(start, CV, i["kappa"]), i["y"], FIX, i["kappa"], points=images)
    np.testing.assert_allclose(by_hand.posterior.mean, want["ukf_reuse"], atol=1e-8)


# --- exactness ---------------------------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.integers(1, 5), st.floats(-0.9, 6.0), st.sampled_from(["cholesky", "symmetric"]))
def test_points_have_the_moments(seed, n, kappa, root):
    g = random_law(seed, n)
    points, w = unscented.sigma_points(g, kappa, root=root)
    d = points - g.mean
    assert points.shape == (2 * n + 1, n) and w.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(w @ d, 0.0, atol=1e-9)
    np.testing.assert_allclose((d * w[:, None]).T @ d, g.cov, atol=1e-9 * np.abs(g.cov).max())


@given(st.integers(0, 10_000), st.integers(1, 4), st.floats(-0.5, 5.0))
def test_means_of_cubics_are_exact(seed, n, kappa):
    """E x_i x_j x_k = m_i m_j m_k + m_i P_jk + m_j P_ik + m_k P_ij for a normal law."""
    g = random_law(seed, n)
    rng = np.random.default_rng(seed + 1)
    c1, c2, c3 = rng.normal(size=n), rng.normal(size=(n, n)), rng.normal(size=(n, n, n))

    def f(x):
        cubic = np.einsum("ijk,...i,...j,...k->...", c3, x, x, x)
        return (1.0 + x @ c1 + np.einsum("ij,...i,...j->...", c2, x, x) + cubic)[..., None]

    m, P = g
    third = (np.einsum("i,j,k->ijk", m, m, m) + np.einsum("i,jk->ijk", m, P) + np.einsum("j,ik->ijk", m, P)
             + np.einsum("k,ij->ijk", m, P))
    want = 1.0 + m @ c1 + np.sum(c2 * (np.outer(m, m) + P)) + np.sum(c3 * third)
    assert unscented.transform(f, g, kappa).mean[0] == pytest.approx(want, rel=1e-8, abs=1e-7)


@given(st.integers(0, 10_000), st.integers(1, 5), st.floats(-0.9, 4.0))
def test_linear_maps_are_exact(seed, n, kappa):
    g = random_law(seed, n)
    A = np.random.default_rng(seed).normal(size=(2, n))
    t = unscented.transform(lambda x: x @ A.T + 3.0, g, kappa)
    scale = np.abs(g.cov).max() * np.abs(A).max() ** 2 * n * n
    np.testing.assert_allclose(t.mean, A @ g.mean + 3.0, atol=1e-9 * scale)
    np.testing.assert_allclose(t.cov, A @ g.cov @ A.T, atol=1e-9 * scale)
    np.testing.assert_allclose(t.cross, g.cov @ A.T, atol=1e-9 * scale)


@pytest.mark.parametrize("kappa", [-1.0, 0.0, 2.5])
@pytest.mark.parametrize("root", ["cholesky", "symmetric"])
def test_the_filter_is_the_kalman_filter_on_linear_models(kappa, root):
    ys = np.random.default_rng(0).normal(size=(8, 2)) * 30
    ys[3, 0] = np.nan
    ys[5] = np.nan
    start = Gaussian(np.array([0.0, 0.0, 5.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))
    a, b = kalman.run(start, ys, CV, FIX), unscented.run(start, ys, CV, FIX, kappa, root=root)
    for x, y in ((a.posterior.mean, b.posterior.mean), (a.posterior.cov, b.posterior.cov), (a.gain, b.gain),
                 (a.y_hat, b.y_hat), (a.innovation_cov, b.innovation_cov), (a.innovation, b.innovation)):
        np.testing.assert_allclose(x, y, atol=1e-9)


# --- definiteness (erratum M17) ----------------------------------------------------------------------------------


def bowl(x):
    return np.square(x).sum(axis=-1, keepdims=True)


def test_a_covariance_that_would_be_negative_is_flagged_and_repaired():
    """f = |x|^2 on N(0, I), n = 6, kappa = -3: (3.16) gives a variance of n kappa = -18, the exact one is 2 n."""
    n, kappa = 6, -3.0
    g = Gaussian(np.zeros(n), np.eye(n))
    points, w = unscented.sigma_points(g, kappa)
    d = bowl(points) - w @ bowl(points)
    assert (w * d[:, 0] ** 2).sum() == pytest.approx(n * kappa)
    t = unscented.transform(bowl, g, kappa)
    assert not t.definite and t.mean[0] == pytest.approx(n)
    modified = (w * bowl(points)[:, 0] ** 2).sum()                              # deviations from f(0) = 0
    assert t.cov[0, 0] == pytest.approx(modified) and modified > 0


def test_only_the_elements_that_need_it_are_repaired():
    n, kappa = 6, -3.0
    x = np.zeros((40, n))
    x[1::2] = 50.0                                                              # there the bowl is nearly a plane
    t = unscented.transform(bowl, Gaussian(x, np.broadcast_to(np.eye(n), (40, n, n))), kappa)
    np.testing.assert_array_equal(t.definite, np.arange(40) % 2 == 1)
    assert (t.cov > 0).all()
    one = unscented.transform(bowl, Gaussian(x[1], np.eye(n)), kappa)
    np.testing.assert_allclose(t.cov[1], one.cov)


@pytest.mark.parametrize("noise", [1e-4, 1.0, 100.0])
def test_posteriors_stay_definite_with_a_negative_centre_weight(noise):
    """A sensor as curved as can be: the posterior of the plain form has negative eigenvalues here."""

    class Bowl:
        R = np.array([[noise]])

        h = staticmethod(bowl)

        def innovation(self, y, y_hat):
            return y - y_hat

    n = 6
    step = unscented.update(Gaussian(np.full(n, 0.1), np.eye(n)), [7.0], Bowl(), -3.0)
    assert np.linalg.eigvalsh(step.posterior.cov).min() > 0
    assert step.innovation_cov[0, 0] > 0
    assert bool(step.definite) == (noise == 100.0)


def test_the_posterior_is_p_minus_ksk():
    prior = random_law(3, 4)
    prior = Gaussian(prior.mean * 100, prior.cov * 100)
    step = unscented.update(prior, [118.0, 390.0], PAIR, 1.0)
    short = prior.cov - step.gain @ step.innovation_cov @ step.gain.T
    np.testing.assert_allclose(step.posterior.cov, short, atol=1e-8)
    np.testing.assert_allclose(step.gain @ step.innovation_cov, step.cross, atol=1e-8)


def test_a_singular_prior_is_a_law_too():
    prior = Gaussian(np.array([30.0, 40.0, 1.0]), np.diag([4.0, 0.0, 9.0]))
    step = unscented.update(prior, [52.0], Range([[0.0, 0.0]], 1.0), 0.0)
    assert step.posterior.mean[1] == pytest.approx(40.0) and abs(step.posterior.cov[1]).max() < 1e-12


# --- angles ------------------------------------------------------------------------------------------------------


def test_bearings_across_south():
    """Sigma points on both sides of +-180 degrees: the plain mean would point north."""
    sensor = Bearing([[0.0, 0.0]], 0.05)
    prior = Gaussian(np.array([0.0, -10.0]), np.diag([4.0, 1.0]))
    step = unscented.update(prior, [np.pi - 0.01], sensor, 1.0)
    assert abs(sensor.innovation(step.y_hat, np.array([np.pi]))[0]) < 1e-9
    assert step.innovation[0] == pytest.approx(-0.01, abs=1e-9)
    assert 0.03 < step.innovation_cov[0, 0] < 0.06                              # about (2/10)^2 + 0.05^2
    turned = unscented.update(Gaussian(-prior.mean, prior.cov), [-0.01], sensor, 1.0)
    np.testing.assert_allclose(step.posterior.mean, -turned.posterior.mean, atol=1e-9)
    np.testing.assert_allclose(step.posterior.cov, turned.posterior.cov, atol=1e-9)


def test_angles_in_the_reused_points_and_in_stacks():
    sensor = Stack([Bearing([[0.0, 0.0]], 0.05), Range([[0.0, 0.0]], 1.0)])
    model = constant_velocity(1.0, 0.1, 2)
    start = Gaussian(np.array([0.0, -10.0, 0.1, 0.0]), np.diag([4.0, 1.0, 0.1, 0.1]))
    ys = [[np.pi - 0.01, 10.0], [-np.pi + 0.02, 10.0]]
    for redraw in (True, False):
        steps = unscented.run(start, ys, model, sensor, 0.5, redraw=redraw)
        assert np.abs(steps.innovation[:, 0]).max() < 0.2
        assert np.abs(steps.posterior.mean[:, 0]).max() < 1.0


def test_transform_of_an_angle_with_its_own_difference():
    sensor = Bearing([[0.0, 0.0]], 0.05)
    g = Gaussian(np.array([0.0, -10.0]), np.diag([4.0, 1.0]))
    plain = unscented.transform(sensor.h, g, 1.0)
    wrapped = unscented.transform(sensor.h, g, 1.0, difference=sensor.innovation)
    assert plain.cov[0, 0] > 1.0 > 0.06 > wrapped.cov[0, 0]


# --- batches, missing measurements, refusals ---------------------------------------------------------------------


@pytest.mark.parametrize("runs", [(3,), (40,), (2, 20)])
@pytest.mark.parametrize("kappa", [-1.0, 1.0])
@pytest.mark.parametrize("redraw", [True, False])
def test_batch_equals_loop(runs, kappa, redraw):
    rng = np.random.default_rng(0)
    g = random_law(1, 4, runs)
    g = Gaussian(g.mean * 20 + [-147.0, -27.0, 3.0, 3.0], g.cov * 50)
    ys = np.array([118.0, 390.0]) + rng.normal(size=(4, *runs, 2)) * 10
    ys[(1, *(0,) * len(runs), 1)] = np.nan
    ys[2] = np.nan
    before = g.mean.copy(), g.cov.copy(), ys.copy()
    steps = unscented.run(g, ys, CV, PAIR, kappa, redraw=redraw)
    assert steps.points.shape == (4, *runs, 9, 4) and steps.images.shape == (4, *runs, 9, 2)
    assert steps.definite.shape == (4, *runs) and steps.weights.shape == (4, *runs, 9)
    for i in list(np.ndindex(*runs))[:4]:
        one = unscented.run(Gaussian(g.mean[i], g.cov[i]), ys[(slice(None), *i)], CV, PAIR, kappa, redraw=redraw)
        at = (slice(None), *i)
        for name in ("points", "images", "y_hat", "cross", "innovation", "innovation_cov", "gain", "definite"):
            np.testing.assert_allclose(getattr(steps, name)[at], getattr(one, name), rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(steps.posterior.mean[at], one.posterior.mean, rtol=1e-8)
        np.testing.assert_allclose(steps.posterior.cov[at], one.posterior.cov, rtol=1e-7, atol=1e-7)
    for now, then in zip((g.mean, g.cov, ys), before, strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("runs", [(), (5,), (64,)])
@pytest.mark.parametrize("root", ["cholesky", "symmetric"])
def test_batches_of_points(runs, root):
    g = random_law(0, 3, runs)
    points, w = unscented.sigma_points(g, 0.5, root=root)
    assert points.shape == (*runs, 7, 3) and w.shape == (7,)
    i = (0,) * len(runs)
    L = np.linalg.cholesky(g.cov[i]) if root == "cholesky" else sqrt_psd(g.cov[i])
    want = np.vstack([g.mean[i], g.mean[i] + np.sqrt(3.5) * L.T, g.mean[i] - np.sqrt(3.5) * L.T])
    np.testing.assert_allclose(points[i], want, atol=1e-10)


def test_a_function_written_for_rows_works_on_large_stacks():
    """User functions see (..., 2n + 1, n) and may return any memory layout."""
    g = random_law(0, 3, (50,))
    A = np.random.default_rng(0).normal(size=(2, 3))
    t = unscented.transform(lambda x: np.ascontiguousarray(np.sin(x) @ A.T), g, 0.0)
    one = unscented.transform(lambda x: np.sin(x) @ A.T, Gaussian(g.mean[9], g.cov[9]), 0.0)
    np.testing.assert_allclose(t.mean[9], one.mean, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(t.cov[9], one.cov, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(t.cross[9], one.cross, rtol=1e-10, atol=1e-11)


LAW = random_law(0, 3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: unscented.sigma_points(LAW, -3.0), "kappa: expected a number > -n = -3"),
        (lambda: unscented.sigma_points(LAW, np.nan), "kappa: expected"),
        (lambda: unscented.sigma_points(LAW, np.inf), "kappa: expected"),
        (lambda: unscented.sigma_points(LAW, "1"), "kappa: expected"),
        (lambda: unscented.sigma_points(LAW, 1.0, root="qr"), "root: expected 'cholesky' or 'symmetric'"),
        (lambda: unscented.sigma_points(Gaussian(np.zeros(2), [[1.0, 2.0], [2.0, 1.0]]), 1.0), "semidefinite"),
        (lambda: unscented.transform(lambda x: x[0], LAW, 1.0), "f: expected images"),
        (lambda: unscented.transform(lambda x: x * np.nan, LAW, 1.0), "f: expected finite images"),
        (lambda: unscented.predict(LAW, CV, 1.0), "motion: expected a model of 3 states"),
        (lambda: unscented.predict(random_law(0, 4), CV, -4.0), "kappa: expected"),
        (lambda: unscented.update(LAW, [np.nan, 1.0], PAIR, 1.0), "y: expected finite"),
        (lambda: unscented.update(LAW, [1.0], PAIR, 1.0), "y: expected shape"),
        (lambda: unscented.update(LAW, [1.0, 1.0], PAIR, 1.0, points=np.zeros((5, 3))), "points: expected"),
        (lambda: unscented.run(LAW, [[1.0, 1.0]], CV, PAIR, 1.0), "motion: expected a model of 3 states"),
        (lambda: unscented.run(random_law(0, 4), [[1.0, 1.0]], CV, PAIR, -5.0), "kappa: expected"),
    ],
)
def test_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_reuse_with_a_negative_centre_weight_may_fail_in_words():
    n = 6
    g = Gaussian(np.zeros(n), np.eye(n))
    points = unscented.sigma_points(g, -3.0).points

    class Bowl:
        R = np.array([[1e-3]])

        h = staticmethod(bowl)

        def innovation(self, y, y_hat):
            return y - y_hat

    with pytest.raises(ValueError, match="definite"):
        unscented.update(g, [7.0], Bowl(), -3.0, points=points)


def test_linear_sensor_helper_is_consistent():
    """A sensor given as a matrix and as a position fix gives the same update."""
    prior = random_law(2, 4)
    a = unscented.update(prior, [1.0, 2.0], FIX, 1.0)
    b = unscented.update(prior, [1.0, 2.0], Linear(np.eye(2, 4), FIX.R), 1.0)
    np.testing.assert_allclose(a.posterior.mean, b.posterior.mean, rtol=1e-12)
