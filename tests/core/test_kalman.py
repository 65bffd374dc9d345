"""The Kalman filter: oracle numbers, identities, batches, missing measurements, and consistency."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import extended, kalman
from core.metrics import consistency_band, nees, nis
from core.motion import LinearMotion, constant_position, constant_velocity
from core.sensors import Linear, Position, Range, Stack
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
FIX = Position(2, [30.0, 50.0])
START = Gaussian(np.array([0.0, 0.0, 5.0, 0.0]), np.diag([100.0, 100.0, 9.0, 9.0]))


def random_problem(seed, n=4, m=2):
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(n, n)), rng.normal(size=(m, m))
    P, R = A @ A.T + 0.1 * np.eye(n), B @ B.T + 0.1 * np.eye(m)
    return Gaussian(rng.normal(size=n), P), rng.normal(size=m), Linear(rng.normal(size=(m, n)), R)


# --- numbers -----------------------------------------------------------------------------------------------------


def test_c3_03_scalar_update():
    e = entry("C3-03")
    i, want = e["inputs"], e["expected"]
    prior = Gaussian(np.array([i["mean"]], dtype=float), np.array([[i["P"]]], dtype=float))
    step = kalman.update(prior, [i["y"]], Linear([[i["H"]]], [[i["R"]]]))
    got = [step.posterior.mean[0], step.posterior.cov[0, 0], step.gain[0, 0], step.innovation_cov[0, 0]]
    np.testing.assert_allclose(got, [want["mean"], want["var"], want["K"], want["S"]], atol=1e-12)


def test_c3_05_joseph_form_for_any_gain():
    e = entry("C3-05")
    P, H, R, K = (np.array(e["inputs"][k]) for k in ("P", "H", "R", "K"))
    want = e["expected"]
    step = kalman.update(Gaussian(np.zeros(2), P), [0.0], Linear(H, R))
    np.testing.assert_allclose(step.posterior.cov, want["P_post"], rtol=1e-10)
    assert np.trace(step.posterior.cov) == pytest.approx(want["trace_opt"], rel=1e-10)
    # The rearranged Joseph form that `correct` uses is quadratic in the gain's error, as the oracle's is.
    B = P - K @ (H @ P)
    rearranged = B + (K @ R - B @ H.T) @ K.T
    np.testing.assert_allclose(rearranged, want["joseph_K"], rtol=1e-10)
    assert np.trace(rearranged) == pytest.approx(want["trace_K"], rel=1e-10)


def test_c3_06_monotone_in_the_prior():
    e = entry("C3-06")
    P1, P2, H, R = (np.array(e["inputs"][k]) for k in ("P1", "P2", "H", "R"))
    post = [kalman.update(Gaussian(np.zeros(2), P), [0.0], Linear(H, R)).posterior.cov for P in (P1, P2)]
    np.testing.assert_allclose(post[0], e["expected"]["P1_post"], rtol=1e-9)
    np.testing.assert_allclose(post[1], e["expected"]["P2_post"], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.eigvalsh(post[1] - post[0]), e["expected"]["eig_diff"], rtol=1e-9)


def test_c3_07_covariance_sequence_and_steady_state():
    e = entry("C3-07")
    i = e["inputs"]
    np.testing.assert_allclose(CV.Phi, i["Phi"])
    np.testing.assert_allclose(CV.Q, i["Q"], rtol=1e-12)
    start = Gaussian(np.array(i["x0"]), np.array(i["P0"]))
    steps = kalman.run(start, np.zeros((400, 2)), CV, FIX)
    P, K = steps.posterior.cov, steps.gain
    for want in e["expected"]["x_axis"]:
        k = want["k"] - 1
        got = [P[k, 0, 0], P[k, 0, 2], P[k, 2, 2], K[k, 0, 0], K[k, 2, 0]]
        names = ("P_pos", "P_posvel", "P_vel", "K_pos", "K_vel")
        np.testing.assert_allclose(got, [want[name] for name in names], rtol=1e-8)
    steady = e["expected"]["steady"]
    np.testing.assert_allclose(P[-1][np.ix_([0, 2], [0, 2])], steady["P"], rtol=1e-8)
    np.testing.assert_allclose(K[-1][[0, 2], 0], steady["K"], rtol=1e-8)
    assert P[0, 0, 0] < 100 < P[-1, 0, 0]                                       # P0 is optimistic: falls, then rises


def test_c3_09_five_measurements():
    e = entry("C3-09")
    i = e["inputs"]
    steps = kalman.run(Gaussian(np.array(i["x0"]), np.array(i["P0"])), i["Y"], CV, FIX)
    np.testing.assert_allclose(steps.posterior.mean, e["expected"]["x"], atol=1e-8)


def test_c3_11_joint_law_and_conditioning():
    e = entry("C3-11")
    Phi, P, Q, H, R, x = (np.array(e["inputs"][k], dtype=float) for k in ("Phi", "P", "Q", "H", "R", "x"))
    prior = kalman.predict(Gaussian(x, P), LinearMotion(Phi, Q))
    step = kalman.update(prior, [e["inputs"]["y"]], Linear(H, R))
    C = prior.cov @ H.T
    joint = np.block([[prior.cov, C], [C.T, step.innovation_cov]])
    np.testing.assert_allclose(joint, e["expected"]["joint_cov"], rtol=1e-10)
    np.testing.assert_allclose(step.posterior.mean, e["expected"]["post_mean"], rtol=1e-10)
    np.testing.assert_allclose(step.posterior.cov, e["expected"]["post_cov"], rtol=1e-10)


def test_c3_35_one_dimensional_random_walk():
    e = entry("C3-35")
    i = e["inputs"]
    steps = kalman.run(Gaussian(np.array([float(i["m0"])]), np.array([[float(i["p0"])]])), np.array(i["y"])[:, None],
                       constant_position(1.0, np.sqrt(i["q"]), 1), Position(1, np.sqrt(i["r"])))
    got = np.column_stack([steps.posterior.mean[:, 0], steps.posterior.cov[:, 0, 0]])
    np.testing.assert_allclose(got, e["expected"]["kf"], rtol=1e-9)


def test_t_04_map_estimate_and_t_05_trace():
    e, trace = entry("T-04"), entry("T-05")["expected"]
    P, x, H, R, y = (np.array(e["inputs"][k]) for k in ("P", "x", "H", "R", "y"))
    want = e["expected"]
    step = kalman.update(Gaussian(x, P), y, Linear(H, R))
    np.testing.assert_allclose(step.posterior.mean, want["x_map"], rtol=1e-10)
    np.testing.assert_allclose(step.gain, want["K"], rtol=1e-10)
    np.testing.assert_allclose(step.posterior.cov, want["P_post"], rtol=1e-10)
    np.testing.assert_allclose(2 * np.linalg.inv(step.posterior.cov), want["hessian"], rtol=1e-10)
    r, d = y - H @ step.posterior.mean, step.posterior.mean - x
    assert r @ np.linalg.solve(R, r) + d @ np.linalg.solve(P, d) == pytest.approx(want["cost"], rel=1e-10)
    for factor, key in ((1.0, "trace_opt"), (0.0, "trace_zero"), (1.2, "trace_1p2"), (0.8, "trace_0p8")):
        K = factor * step.gain
        A = np.eye(2) - K @ H
        assert np.trace(A @ P @ A.T + K @ R @ K.T) == pytest.approx(trace[key], rel=1e-9)


@pytest.mark.parametrize("name", ["T-08", "T-09"])
def test_t_08_t_09_gains_of_the_stiff_and_the_flexible_model(name):
    e = entry(name)
    sigma = e["inputs"]["sigma_xy"]
    start = Gaussian(np.zeros(6), np.diag([9.0] * 3 + [100.0] * 3))
    model = constant_velocity(1.0, [sigma, sigma, 0.0], 3)
    steps = kalman.run(start, np.zeros((100, 2)), model, Position(2, [1.0, 4.0]))
    for axis, name in enumerate("xy"):
        for k, want in e["expected"]["table"][name].items():
            P, K = steps.posterior.cov[int(k) - 1], steps.gain[int(k) - 1]
            got = [K[axis, axis], np.sqrt(P[axis, axis]), K[3 + axis, axis], np.sqrt(P[3 + axis, 3 + axis])]
            np.testing.assert_allclose(got, [want[w] for w in ("K", "sd_pos", "K_vel", "sd_vel")], rtol=1e-7)


def test_t_11_the_unobserved_axis():
    e = entry("T-11")
    start = Gaussian(np.zeros(6), np.diag([9.0] * 3 + [100.0] * 3))
    steps = kalman.run(start, np.zeros((100, 2)), constant_velocity(1.0, [0.01, 0.01, 0.0], 3), Position(2, [1, 4]))
    got = np.sqrt(steps.posterior.cov[np.array(e["inputs"]["k"]) - 1, 2, 2])
    np.testing.assert_allclose(got, e["expected"]["sd_z"], rtol=1e-10)


def test_g_19_steady_gains_of_cpkf_and_cvkf():
    e = entry("G-19")
    i = e["inputs"]
    for dt in i["dt"]:
        want = e["expected"][f"dt={dt:.1f}"]
        sensor = Position(1, np.sqrt(i["r"]))
        cp = kalman.run(Gaussian(np.zeros(1), np.eye(1)), np.zeros((300, 1)),
                        constant_position(dt, np.sqrt(i["q_cp"]), 1), sensor)
        cv = kalman.run(Gaussian(np.zeros(2), np.eye(2)), np.zeros((300, 1)),
                        constant_velocity(dt, np.sqrt(i["q_cv"]), 1), sensor)
        got = [cp.gain[-1, 0, 0], cp.posterior.cov[-1, 0, 0], *cv.gain[-1, :, 0], cv.posterior.cov[-1, 0, 0]]
        want = [want["cpkf"]["K"], want["cpkf"]["P"], *want["cvkf"]["K"], want["cvkf"]["P_pos"]]
        np.testing.assert_allclose(got, want, rtol=1e-7)


# --- identities --------------------------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(1, 5))
def test_information_and_covariance_forms_agree(seed, n, m):
    prior, y, sensor = random_problem(seed, n, m)
    step = kalman.update(prior, y, sensor)
    H, R = sensor.H, sensor.R
    information = np.linalg.inv(prior.cov) + H.T @ np.linalg.solve(R, H)
    P = np.linalg.inv(information)
    x = P @ (np.linalg.solve(prior.cov, prior.mean) + H.T @ np.linalg.solve(R, y))
    scale = np.abs(prior.cov).max()
    np.testing.assert_allclose(step.posterior.cov, P, atol=1e-7 * scale)
    np.testing.assert_allclose(step.posterior.mean, x, atol=1e-6 * scale)


@given(st.integers(0, 10_000))
def test_two_sensors_at_once_or_one_after_the_other(seed):
    prior, y, sensor = random_problem(seed)
    other = Position(3, 0.7)
    both = kalman.update(prior, [*y, 1.0, 2.0, 3.0], Stack([sensor, other])).posterior
    one = kalman.update(kalman.update(prior, y, sensor).posterior, [1.0, 2.0, 3.0], other).posterior
    np.testing.assert_allclose(both.mean, one.mean, atol=1e-9)
    np.testing.assert_allclose(both.cov, one.cov, atol=1e-9)


def test_posterior_is_the_whole_trajectory_solved_at_once():
    """The last filtered state is the last block of one big least-squares problem."""
    rng = np.random.default_rng(2)
    ys = rng.normal(size=(6, 2)) * 30
    steps = kalman.run(START, ys, CV, FIX)
    T, n = len(ys), 4
    rows, right = [], []

    def add(blocks, value, cov):
        W = np.linalg.inv(np.linalg.cholesky(cov))
        line = np.zeros((len(value), (T + 1) * n))
        for k, A in blocks:
            line[:, k * n:(k + 1) * n] = A
        rows.append(W @ line)
        right.append(W @ value)

    add([(0, np.eye(n))], START.mean, START.cov)
    for k in range(T):
        add([(k, -CV.Phi), (k + 1, np.eye(n))], np.zeros(n), CV.Q)
        add([(k + 1, np.eye(2, n))], ys[k], FIX.R)
    A = np.vstack(rows)
    x = np.linalg.lstsq(A, np.concatenate(right), rcond=None)[0]
    np.testing.assert_allclose(steps.posterior.mean[-1], x[-n:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(steps.posterior.cov[-1], np.linalg.inv(A.T @ A)[-n:, -n:], rtol=1e-7, atol=1e-9)


def test_covariances_stay_symmetric_and_definite_when_everything_is_badly_scaled():
    prior = Gaussian(np.zeros(3), np.diag([1e12, 1.0, 1e-9]))
    sensor = Linear([[1.0, 1.0, 0.0], [1.0, 0.0, 1e3]], np.diag([1e-4, 1e-2]))
    for _ in range(50):
        step = kalman.update(prior, [1.0, 2.0], sensor)
        P = step.posterior.cov
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P).min() > -1e-16 * np.trace(P)
        prior = kalman.predict(step.posterior, LinearMotion(np.eye(3), np.zeros((3, 3))))


def test_a_very_wide_prior_ends_at_the_measurement_noise():
    """P = 1e16, R = 1: the short form (I - K H) P returns 0 or 2 here."""
    step = kalman.update(Gaussian(np.zeros(1), np.array([[1e16]])), [3.0], Linear([[1.0]], [[1.0]]))
    assert step.posterior.cov[0, 0] == pytest.approx(1.0) and step.posterior.mean[0] == pytest.approx(3.0)


def test_a_perfect_measurement_is_believed():
    step = kalman.update(START, [7.0, 8.0], Linear(np.eye(2, 4), np.zeros((2, 2))))
    np.testing.assert_allclose(step.posterior.mean[:2], [7.0, 8.0])
    np.testing.assert_allclose(step.posterior.cov[:2], 0.0, atol=1e-12)


def test_extended_is_the_same_filter_on_linear_models():
    ys = np.random.default_rng(0).normal(size=(9, 2)) * 30
    a, b = kalman.run(START, ys, CV, FIX), extended.run(START, ys, CV, FIX, iterations=3)
    for x, y in zip(a, b, strict=True):
        for u, v in zip(x if isinstance(x, tuple) else (x,), y if isinstance(y, tuple) else (y,), strict=True):
            np.testing.assert_allclose(u, v, atol=1e-11)


def test_run_is_predict_and_update():
    ys = np.random.default_rng(0).normal(size=(5, 2)) * 30
    steps, g = kalman.run(START, ys, CV, FIX), START
    for k, y in enumerate(ys):
        step = kalman.update(kalman.predict(g, CV), y, FIX)
        g = step.posterior
        np.testing.assert_array_equal(steps.prior.mean[k], step.prior.mean)
        np.testing.assert_array_equal(steps.prior.cov[k], step.prior.cov)
        np.testing.assert_array_equal(steps.posterior.cov[k], g.cov)
        np.testing.assert_array_equal(steps.gain[k], step.gain)
        np.testing.assert_array_equal(steps.jacobian[k], step.jacobian)


# --- batches -----------------------------------------------------------------------------------------------------


def starts(runs, seed=0, same_cov=False):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4)) if same_cov else rng.normal(size=(*runs, 4, 4))
    return Gaussian(rng.normal(size=(*runs, 4)), A @ A.mT + np.eye(4))


@pytest.mark.parametrize("same_cov", [True, False])
@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("runs", [(3,), (40,), (2, 25)])
def test_batch_equals_loop(runs, missing, same_cov):
    """Small and large stacks take different ways through memory; both must give the loop's answer."""
    g = starts(runs, same_cov=same_cov)
    rng = np.random.default_rng(1)
    ys = rng.normal(size=(6, *runs, 2))
    if missing:
        ys[rng.uniform(size=ys.shape) < 0.3] = np.nan
        ys[2] = np.nan
    before = [g.mean.copy(), g.cov.copy(), ys.copy()]
    steps = kalman.run(g, ys, CV, FIX)
    assert steps.posterior.mean.shape == (6, *runs, 4) and steps.posterior.cov.shape == (6, *runs, 4, 4)
    assert steps.gain.shape == (6, *runs, 4, 2) and steps.jacobian.shape == (6, *runs, 2, 4)
    assert steps.y_hat.shape == steps.innovation.shape == (6, *runs, 2)
    for i in list(np.ndindex(*runs))[:8]:
        cov = g.cov if same_cov else g.cov[i]
        one = kalman.run(Gaussian(g.mean[i], cov), ys[(slice(None), *i)], CV, FIX)
        at = (slice(None), *i)
        for a, b in ((steps.posterior.mean, one.posterior.mean), (steps.posterior.cov, one.posterior.cov),
                     (steps.prior.mean, one.prior.mean), (steps.prior.cov, one.prior.cov), (steps.gain, one.gain),
                     (steps.innovation, one.innovation), (steps.innovation_cov, one.innovation_cov),
                     (steps.y_hat, one.y_hat), (steps.jacobian, one.jacobian)):
            np.testing.assert_allclose(a[at], b, rtol=1e-9, atol=1e-10)
    for now, then in zip([g.mean, g.cov, ys], before, strict=True):
        np.testing.assert_array_equal(now, then)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 70), st.integers(1, 4), st.integers(1, 4))
def test_single_steps_on_stacks_of_any_size(N, n, m):
    rng = np.random.default_rng(N)
    A = rng.normal(size=(N, n, n))
    g = Gaussian(rng.normal(size=(N, n)), A @ A.mT + np.eye(n))
    sensor = Linear(rng.normal(size=(m, n)), np.eye(m))
    model = LinearMotion(rng.normal(size=(n, n)), np.eye(n))
    y = rng.normal(size=(N, m))
    step = kalman.update(kalman.predict(g, model), y, sensor)
    one = kalman.update(kalman.predict(Gaussian(g.mean[-1], g.cov[-1]), model), y[-1], sensor)
    np.testing.assert_allclose(step.posterior.mean[-1], one.posterior.mean, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(step.posterior.cov[-1], one.posterior.cov, rtol=1e-8, atol=1e-8)
    assert step.gain.shape == (N, n, m) and step.jacobian.shape == (N, m, n)


def test_many_runs_from_one_start_and_one_run_from_many_measurements():
    ys = np.random.default_rng(0).normal(size=(4, 50, 2))
    steps = kalman.run(START, ys, CV, FIX)
    assert steps.posterior.mean.shape == (4, 50, 4) and steps.posterior.cov.shape == (4, 50, 4, 4)
    np.testing.assert_allclose(steps.posterior.mean[:, 7], kalman.run(START, ys[:, 7], CV, FIX).posterior.mean)
    many = kalman.run(starts((50,)), ys[:, 0], CV, FIX)
    assert many.posterior.cov.shape == (4, 50, 4, 4)


# --- missing measurements, changing models -----------------------------------------------------------------------


def test_a_missing_row_leaves_the_prior():
    ys = np.array([[1.0, 2.0], [np.nan, np.nan], [3.0, 4.0]])
    steps = kalman.run(START, ys, CV, FIX)
    np.testing.assert_array_equal(steps.posterior.mean[1], steps.prior.mean[1])
    np.testing.assert_array_equal(steps.posterior.cov[1], steps.prior.cov[1])
    assert np.isnan(steps.innovation[1]).all() and not steps.gain[1].any()
    assert np.isfinite(steps.innovation_cov[1]).all() and np.isfinite(steps.y_hat[1]).all()
    onwards = kalman.predict(Gaussian(steps.posterior.mean[1], steps.posterior.cov[1]), CV)
    np.testing.assert_array_equal(steps.prior.mean[2], onwards.mean)


def test_a_missing_entry_is_the_update_without_it_even_if_noise_is_correlated():
    R = np.array([[4.0, 1.5, 0.3], [1.5, 9.0, -2.0], [0.3, -2.0, 5.0]])
    H = np.random.default_rng(0).normal(size=(3, 4))
    steps = kalman.run(START, [[1.0, np.nan, 2.0]], CV, Linear(H, R))
    keep = [0, 2]
    want = kalman.update(kalman.predict(START, CV), [1.0, 2.0], Linear(H[keep], R[np.ix_(keep, keep)]))
    np.testing.assert_allclose(steps.posterior.mean[0], want.posterior.mean, rtol=1e-12)
    np.testing.assert_allclose(steps.posterior.cov[0], want.posterior.cov, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(steps.gain[0][:, keep], want.gain, rtol=1e-12)
    assert not steps.gain[0][:, 1].any()


def test_one_model_per_step():
    motions = [constant_velocity(dt, 1.0, 2) for dt in (0.5, 1.0, 2.0)]
    sensors = [Position(2, 3.0), Range([[0.0, 9.0], [50.0, 0.0]], 2.0), Linear(np.eye(2, 4), np.eye(2))]
    ys = [[1.0, 2.0], [10.0, 45.0], [3.0, 3.0]]
    steps, g = kalman.run(START, ys, motions, sensors), START
    for y, m, s in zip(ys, motions, sensors, strict=True):
        g = kalman.update(kalman.predict(g, m), y, s).posterior
    np.testing.assert_array_equal(steps.posterior.mean[-1], g.mean)


# --- consistency -------------------------------------------------------------------------------------------------


def test_nees_and_nis_lie_in_their_bands():
    """200 runs of 30 steps with a fixed seed.  Each band is 99.9 %: false alarm 4 * 0.1 % = 0.4 %."""
    rng = np.random.default_rng(11)
    N, T = 200, 30
    x = START.mean + rng.normal(size=(N, 4)) * np.sqrt(np.diag(START.cov))
    truth, ys = np.empty((T, N, 4)), np.empty((T, N, 2))
    for k in range(T):
        x = CV.sample(x, rng)
        truth[k] = x
        ys[k] = FIX.h(x) + rng.normal(size=(N, 2)) * np.sqrt(FIX.R.diagonal())
    steps = kalman.run(START, ys, CV, FIX)
    errors, surprise = nees(steps.posterior, truth), nis(steps)
    for k in (0, T - 1):                                                        # independent over runs
        low, high = consistency_band(0.999, 4, N)
        assert low < errors[k].mean() < high
    for k in (0, T - 1):
        low, high = consistency_band(0.999, 2, N)
        assert low < surprise[k].mean() < high


def test_innovations_are_white():
    """Correlation of nu_k and nu_{k+1} over 400 runs: 4 entries below 4 standard errors, false alarm 0.03 %."""
    rng = np.random.default_rng(3)
    N, T = 400, 12
    x = START.mean + rng.normal(size=(N, 4)) * np.sqrt(np.diag(START.cov))
    ys = np.empty((T, N, 2))
    for k in range(T):
        x = CV.sample(x, rng)
        ys[k] = FIX.h(x) + rng.normal(size=(N, 2)) * np.sqrt(FIX.R.diagonal())
    steps = kalman.run(START, ys, CV, FIX)
    z = steps.innovation[-2:] / np.sqrt(np.diagonal(steps.innovation_cov[-2:], axis1=-2, axis2=-1))
    assert np.abs(z[0].T @ z[1] / N).max() < 4 / np.sqrt(N)


# --- refusals ----------------------------------------------------------------------------------------------------


def wrong(cov, mean=(0.0, 0.0, 0.0, 0.0)):
    return Gaussian(np.array(mean), np.array(cov, dtype=float))


SPOILT = np.eye(4)
SPOILT[0, 1] = SPOILT[1, 0] = 2.0
LOPSIDED = np.eye(4)
LOPSIDED[0, 1] = 0.5
INFINITE = np.diag([1.0, np.inf, 1.0, 1.0])


@pytest.mark.parametrize("batch", [(), (3,), (40,)])
@pytest.mark.parametrize(
    ("g", "words"),
    [
        (wrong(SPOILT), "positive semidefinite"),
        (wrong(LOPSIDED), "symmetric"),
        (wrong(INFINITE), "finite"),
        (wrong(np.full((4, 4), np.nan)), "finite"),
        (wrong(np.eye(4), (np.nan, 0, 0, 0)), "finite"),
        (wrong(np.eye(3)), "expected shape"),
        (wrong(np.ones((4, 3))), "square"),
    ],
)
def test_bad_laws(g, words, batch):
    g = Gaussian(np.broadcast_to(g.mean, (*batch, *g.mean.shape)), np.broadcast_to(g.cov, (*batch, *g.cov.shape)))
    with pytest.raises(ValueError, match=words):
        kalman.predict(g, CV)
    with pytest.raises(ValueError, match=words):
        kalman.update(g, [1.0, 2.0], FIX)
    with pytest.raises(ValueError, match=words):
        kalman.run(g, np.ones((3, 2)), CV, FIX)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: kalman.update(START, [1.0, np.nan], FIX), "y: expected finite"),
        (lambda: kalman.update(START, [1.0, 2.0, 3.0], FIX), r"y: expected shape \(..., 2\)"),
        (lambda: kalman.update(START, 1.0, FIX), "y: expected shape"),
        (lambda: kalman.update(wrong(np.ones(4)), [1.0, 2.0], FIX), "covariance: expected shape"),
        (lambda: kalman.update((1.0, 2.0, 3.0), [1.0, 2.0], FIX), "expected a Gaussian"),
        (lambda: kalman.update(START, [1.0], Linear([[1.0, 0.0]], [[1.0]])), "x: expected shape"),
        (lambda: kalman.predict(START, constant_velocity(1.0, 1.0, 3)), "motion: expected a model of 4 states"),
        (lambda: kalman.run(START, [[1.0, np.inf]], CV, FIX), "infinite"),
        (lambda: kalman.run(START, [1.0, 2.0], CV, FIX), "ys: expected shape"),
        (lambda: kalman.run(START, np.empty((0, 2)), CV, FIX), "ys: expected shape"),
        (lambda: kalman.run(START, np.ones((3, 3)), CV, FIX), "y: expected shape"),
        (lambda: kalman.run(START, np.ones((3, 2)), [CV, CV], FIX), "motion: expected one model or 3"),
        (lambda: kalman.run(START, np.ones((3, 2)), CV, 5), "sensor: expected a model"),
        (lambda: kalman.run(starts((3,)), np.ones((3, 4, 2)), CV, FIX), "batch axes"),
        (lambda: kalman.update(Gaussian(START.mean, np.zeros((4, 4))), [0.0, 0.0],
                               Linear(np.eye(2, 4), np.zeros((2, 2)))), "positive definite"),
    ],
)
def test_bad_calls(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_singular_covariances_are_laws_too():
    g = Gaussian(np.ones(4), np.diag([1.0, 0.0, 2.0, 0.0]))
    step = kalman.update(kalman.predict(g, LinearMotion(np.eye(4), np.zeros((4, 4)))), [0.0, 0.0], FIX)
    assert step.posterior.cov[1, 1] == 0.0 and step.posterior.mean[1] == 1.0


def test_nothing_that_goes_in_is_changed():
    x, P, y = START.mean.copy(), START.cov.copy(), np.array([1.0, 2.0])
    g = Gaussian(x, P)
    kalman.update(kalman.predict(g, CV), y, FIX)
    np.testing.assert_array_equal(x, START.mean)
    np.testing.assert_array_equal(P, START.cov)
    np.testing.assert_array_equal(y, [1.0, 2.0])
