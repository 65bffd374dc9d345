import tracemalloc
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import resampling
from core.importance import importance_weights
from core.motion import LinearMotion, constant_velocity
from core.particle import AllWeightsZero, run, step
from core.sensors import Bearing, Linear, Position, Range
from core.types import Gaussian
from tests.oracle import entry

WALK = LinearMotion([[1.0]], [[0.5]])
SCALAR = Linear([[1.0]], [[1.0]])
YS = np.array([[1.2], [0.4], [2.1], [1.7], [3.0]])
START = Gaussian(np.zeros(1), np.array([[2.0]]))
STATIONS = [[-250.0, 0.0], [250.0, 0.0]]
EXAMPLE_22 = Gaussian(np.array([-150.0, -30, 3, 3]), np.diag([400.0, 400, 25, 25]))
CV = constant_velocity(1.0, 1.0, 2)
RANGES = Range(STATIONS, 10.0)
PROPOSALS = ["prior", "ekf", "ukf", "optimal"]


def kalman(initial, ys, motion, H, R):
    """The five lines of MAT Algorithm 3, and log p(y_k | y_{1:k-1})."""
    x, P = initial
    rows = []
    for y in ys:
        x, P = motion.Phi @ x, motion.Phi @ P @ motion.Phi.T + motion.Q
        S = H @ P @ H.T + R
        K = np.linalg.solve(S, H @ P).T
        nu = y - H @ x
        log_evidence = -0.5 * (nu @ np.linalg.solve(S, nu) + np.linalg.slogdet(2 * np.pi * S)[1])
        x, P = x + K @ nu, P - K @ S @ K.T
        rows.append((x, P, log_evidence))
    return [np.array(column) for column in zip(*rows, strict=True)]


def cloud(N, seed=0, g=EXAMPLE_22):
    return np.random.default_rng(seed).multivariate_normal(g.mean, g.cov, N)


def same(a, b):
    return all(np.array_equal(p, q) for p, q in zip(a, b, strict=True))


def test_one_weight_update_c3_34():
    e = entry("C3-34")
    x_prev, drawn, y = (np.array(e["inputs"][k], dtype=float) for k in ("x_prev", "x", "y"))
    motion = LinearMotion([[1.0]], [[1.0]])

    def towards_y(x, y, motion, sensor, rng):
        """g = N(x + (y - x) / 2, 0.8^2), with the draws of the example."""
        log_p = -0.5 * (drawn[:, None] - motion.f(x))[:, 0] ** 2 / motion.Q[0, 0] - 0.5 * np.log(2 * np.pi)
        log_g = -0.5 * ((drawn - x[:, 0] - 0.5 * (y - x[:, 0])) / 0.8) ** 2 - np.log(0.8 * np.sqrt(2 * np.pi))
        return drawn[:, None], sensor.log_likelihood(y, drawn[:, None]) + log_p - log_g

    s = step(x_prev[:, None], np.full(3, 1 / 3), [y], motion, Linear([[1.0]], [[0.25]]), np.random.default_rng(0),
             proposal=towards_y)
    np.testing.assert_allclose(s.weights_before, e["expected"]["w"], rtol=1e-9)
    assert s.mean[0] == pytest.approx(e["expected"]["mean"], rel=1e-9)
    assert (s.predicted[:, 0] == drawn).all()


def test_sir_against_the_kalman_filter_c3_35():
    e = entry("C3-35")
    inputs, expected = e["inputs"], e["expected"]
    assert np.array_equal(YS[:, 0], inputs["y"])
    x, P, _ = kalman(START, YS, WALK, np.eye(1), np.eye(1))
    np.testing.assert_allclose(np.column_stack([x[:, 0], P[:, 0, 0]]), expected["kf"], rtol=1e-9)
    runs = [run(START, YS, WALK, SCALAR, inputs["N"], np.random.default_rng(seed)) for seed in range(100)]
    mean, var = (np.array([getattr(r, k)[-1].item() for r in runs]) for k in ("mean", "cov"))
    # One run may be off by 4 sd (false alarm of 200 numbers: 1 %), the mean over 100 seeds by 0.01 (4 sd).
    assert (np.abs(mean - x[-1, 0]) < 4 * expected["pf_mean_sd_over_seeds"]).all()
    assert (np.abs(var - P[-1, 0, 0]) < 4 * expected["pf_var_sd_over_seeds"]).all()
    assert abs(mean.mean() - x[-1, 0]) < 0.01 and abs(var.mean() - P[-1, 0, 0]) < 0.01


def test_bimodal_posterior_of_example_22_c3_36():
    e = entry("C3-36")["expected"]
    truth = np.column_stack([-150 + 3.0 * np.arange(1, 41), -30 + 3.0 * np.arange(1, 41)])
    distances = np.linalg.norm(truth[:, None] - np.array(STATIONS), axis=-1)
    correct = []
    for seed in range(50):
        ys = distances + 10 * np.random.default_rng(seed).standard_normal((40, 2))
        r = run(EXAMPLE_22, ys, CV, RANGES, 5000, np.random.default_rng(1000 + seed), subsample=1)
        correct.append(r.last.weights_before[r.last.predicted[:, 1] > 0].sum())
    # 5000 particles instead of 20,000 move a run's mass by about 0.02; the band is +-4 standard errors of 50 seeds.
    assert np.mean(correct) == pytest.approx(e["pf_correct_mass_mean"], abs=0.05)
    assert np.std(correct) < 2 * e["pf_correct_mass_sd"]
    assert min(correct) > 0.1 and max(correct) < 0.95


@pytest.mark.parametrize("proposal", PROPOSALS)
def test_converges_to_the_kalman_filter_at_the_monte_carlo_rate(proposal):
    H, R = np.eye(2, 4), np.diag([9.0, 4.0])
    ys = np.array([[1.0, 0.5], [2.5, -1.0], [6.0, 0.0]])
    initial = Gaussian(np.array([0.0, 0, 1, 0]), np.diag([4.0, 4, 1, 1]))
    x, P, log_evidence = kalman(initial, ys, CV, H, R)
    error = {}
    for N in (200, 3200):
        runs = [run(initial, ys, CV, Linear(H, R), N, np.random.default_rng(s), proposal=proposal) for s in range(40)]
        error[N] = np.sqrt(np.mean([np.square(r.mean[-1] - x[-1]).mean() for r in runs]))
        total = np.array([r.log_evidence.sum() for r in runs])
    # 16 times the particles: a quarter of the error; the ratio of two rms over 160 numbers has sd 8 %, band 4 sd.
    assert 2.7 < error[200] / error[3200] < 5.5
    assert total.mean() == pytest.approx(log_evidence.sum(), abs=0.05)
    assert np.mean([r.cov[-1] for r in runs], axis=0) == pytest.approx(P[-1], abs=0.1)


def test_on_a_linear_measurement_the_gaussian_proposals_are_the_optimal_one():
    x, w = cloud(500), np.full(500, 1 / 500)
    args = (x, w, [-148.0, -26.0], CV, Position(2, 3.0))
    ekf, ukf, optimal = (step(*args, np.random.default_rng(1), proposal=p) for p in ("ekf", "ukf", "optimal"))
    np.testing.assert_allclose(ekf.predicted, optimal.predicted, rtol=1e-10)
    np.testing.assert_allclose(ukf.predicted, optimal.predicted, rtol=1e-10)
    # Its weight is p(y | x_{k-1}), whatever was drawn.
    np.testing.assert_allclose(ekf.weights_before, optimal.weights_before, rtol=1e-8)
    np.testing.assert_allclose(ukf.weights_before, optimal.weights_before, rtol=1e-8)
    H = np.eye(2, 4)
    S = H @ CV.Q @ H.T + 9 * np.eye(2)
    nu = args[2] - CV.f(x)[:, :2]
    direct = importance_weights(w, -0.5 * np.vecdot(nu, np.linalg.solve(S, nu.T).T))
    np.testing.assert_allclose(optimal.weights_before, direct, rtol=1e-8)


def test_a_peaked_likelihood_wastes_the_particles_of_the_prior_proposal():
    x = np.tile(EXAMPLE_22.mean, (2000, 1))
    y = RANGES.h(CV.f(x[0]) + np.array([0.3, 0.4, 0.0, 0.0]))
    sharp = Range(STATIONS, 0.05)
    n_eff = {p: step(x, np.full(2000, 1 / 2000), y, CV, sharp, np.random.default_rng(1), proposal=p).n_eff
             for p in ("prior", "ekf", "ukf")}
    assert n_eff["prior"] < 100 < 1500 < min(n_eff["ekf"], n_eff["ukf"])
    kinds = [step(x, np.full(2000, 1 / 2000), y, CV, RANGES, np.random.default_rng(1), proposal=p).mean
             for p in ("prior", "ekf", "ukf")]
    assert np.ptp(kinds, axis=0).max() < 0.2                  # the same posterior: sd of a mean below 0.025


def test_singular_process_noise_and_angles():
    Q = np.zeros((3, 3))
    Q[1:, 1:] = [[0.04, 0.02], [0.02, 0.01]]                  # rank 1
    motion, compass = LinearMotion(np.eye(3), Q), Bearing([[0.0, 0.0]], 0.05)
    x = np.column_stack([np.linspace(-0.5, 0.5, 400), np.full(400, -10.0), np.zeros(400)])     # south: +-180 degrees
    y = [np.pi - 0.01]
    results = [step(x, np.full(400, 1 / 400), y, motion, compass, np.random.default_rng(2), proposal=p)
               for p in ("prior", "ekf", "ukf")]
    at_minus_10 = importance_weights(np.full(400, 1 / 400), compass.log_likelihood(np.array(y), x))
    assert at_minus_10[0] > 0.3 / 400                         # not cut off where the angle jumps
    for s in results:
        assert (s.predicted[:, 0] == x[:, 0]).all()           # no noise there
        np.testing.assert_allclose(s.predicted[:, 1] + 10.0, 2 * s.predicted[:, 2], atol=1e-6)
        assert s.n_eff > 300 and abs(s.mean[0] - at_minus_10 @ x[:, 0]) < 0.01
        assert s.log_evidence == pytest.approx(results[0].log_evidence, abs=0.1)


def test_likelihoods_of_exp_minus_100000_are_no_problem():
    x, w = cloud(1000), np.full(1000, 1e-3)
    far = RANGES.h(x[0]) + 4500.0
    for proposal in ("prior", "ekf", "ukf"):
        s = step(x, w, far, CV, RANGES, np.random.default_rng(0), proposal=proposal)
        assert -3e5 < s.log_evidence < -1e5
        assert s.weights_before.sum() == pytest.approx(1.0) and np.isfinite(s.mean).all() and np.isfinite(s.cov).all()


def test_sis_carries_logarithms_of_weights():
    ys = RANGES.h(EXAMPLE_22.mean) + np.zeros((60, 2))
    r = run(EXAMPLE_22, ys, CV, RANGES, 300, np.random.default_rng(4), threshold=0.0)
    assert not r.resampled.any() and (r.ancestors == np.arange(300)).all()
    assert r.n_eff[-1] < 3 < r.n_eff[0]                       # the weights collapse
    last = r.last
    assert np.isfinite(last.log_weights).all() and last.log_weights.min() < -800      # exp would be 0
    assert np.exp(last.log_weights).sum() == pytest.approx(1.0)
    assert last.particles is last.predicted and last.weights is last.weights_before


def test_moments_and_size_are_those_of_the_weighted_cloud():
    x = cloud(700)
    w = np.random.default_rng(1).dirichlet(np.ones(700))
    s = step(x, w, [105.0, 405.0], CV, RANGES, np.random.default_rng(2), threshold=0.3)
    np.testing.assert_allclose(s.mean, s.weights_before @ s.predicted, rtol=1e-12)
    d = s.predicted - s.mean
    np.testing.assert_allclose(s.cov, (d * s.weights_before[:, None]).T @ d, rtol=1e-10)
    assert s.n_eff == pytest.approx(float(resampling.effective_sample_size(s.weights_before)))
    direct = importance_weights(w, RANGES.log_likelihood(np.array([105.0, 405.0]), s.predicted))
    np.testing.assert_allclose(s.weights_before, direct, rtol=1e-9)
    evidence = np.log(w @ np.exp(RANGES.log_likelihood(np.array([105.0, 405.0]), s.predicted)))
    assert s.log_evidence == pytest.approx(evidence)


def test_moments_do_not_cancel_far_from_the_origin():
    x = 6.4e6 + 0.1 * np.random.default_rng(3).standard_normal((5000, 1))
    still = LinearMotion([[1.0]], [[0.0]])
    s = step(x, np.full(5000, 1 / 5000), [6.4e6], still, Linear([[1.0]], [[1.0]]), np.random.default_rng(0))
    assert s.cov[0, 0] == pytest.approx(np.cov(x[:, 0], aweights=s.weights_before, ddof=0), rel=1e-6)


@pytest.mark.parametrize("name", sorted(resampling.RESAMPLERS))
def test_resampling_step(name):
    x, w = cloud(400), np.full(400, 1 / 400)
    s = step(x, w, [105.0, 405.0], CV, RANGES, np.random.default_rng(2), resampler=name)
    assert s.resampled and (s.particles == s.predicted[s.ancestors]).all()
    assert (s.weights == 1 / 400).all() and (s.log_weights == -np.log(400)).all()
    assert len(np.unique(s.ancestors)) < 400
    copies = np.bincount(s.ancestors, minlength=400)
    assert np.abs(copies - 400 * s.weights_before).max() < {"systematic": 1, "stratified": 2}.get(name, 9)


def test_threshold_is_a_fraction_of_N():
    x, w = cloud(300), np.full(300, 1 / 300)
    y = [105.0, 405.0]
    n_eff = step(x, w, y, CV, RANGES, np.random.default_rng(5), threshold=0.0).n_eff
    fraction = n_eff / 300
    assert 0.05 < fraction < 0.95
    for threshold, expected in ((0.0, False), (fraction - 1e-6, False), (fraction + 1e-6, True), (1.0, True)):
        assert step(x, w, y, CV, RANGES, np.random.default_rng(5), threshold=threshold).resampled is expected
    certain = step(np.zeros((4, 1)), np.full(4, 0.25), [0.0], LinearMotion([[1.0]], [[0.0]]), SCALAR,
                   np.random.default_rng(0))
    assert certain.resampled and certain.n_eff == pytest.approx(4)       # SIR resamples equal weights too


def test_result_depends_on_the_seed_and_not_on_threads_or_layout():
    x, w = cloud(150_000), np.full(150_000, 1 / 150_000)
    w[::3] *= 0.5
    args = ([105.0, 405.0], CV, RANGES)
    a, b = (step(x, w, *args, np.random.default_rng(9), threads=t) for t in (1, 2))
    assert same(a, b)
    assert same(a, step(np.asfortranarray(x), w, *args, np.random.default_rng(9), threads=2))
    assert (step(x, w, *args, np.random.default_rng(10)).predicted != a.predicted).any()
    a, b = (step(x, w, *args, np.random.default_rng(9), threads=t, threshold=0.01, resampler="residual")
            for t in (1, 2))
    assert not a.resampled and same(a, b)
    assert (a.ancestors == resampling.draw("residual", w, np.random.default_rng(0))).mean() < 0.9


def test_extra_memory_is_at_most_four_times_the_particles():
    N = 400_000
    x, w = np.asfortranarray(cloud(N)), np.full(N, 1 / N)
    step(x, w, [105.0, 405.0], CV, RANGES, np.random.default_rng(9))
    tracemalloc.start()
    try:
        s = step(x, w, [105.0, 405.0], CV, RANGES, np.random.default_rng(9))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert s.particles.T.flags.c_contiguous and s.predicted.T.flags.c_contiguous
    assert peak < 4 * x.nbytes


@settings(max_examples=25)
@given(st.integers(1, 40), st.integers(1, 3), st.integers(1, 2), st.sampled_from(PROPOSALS), st.floats(0, 1))
def test_shapes(N, n, m, proposal, threshold):
    rng = np.random.default_rng(N)
    motion = LinearMotion(np.eye(n), np.diag(np.arange(n, dtype=float)))
    sensor = Linear(rng.normal(size=(m, n)), np.eye(m))
    s = step(rng.normal(size=(N, n)), rng.random(N) + 0.1, np.zeros(m), motion, sensor, rng, proposal=proposal,
             threshold=threshold)
    assert s.particles.shape == s.predicted.shape == (N, n)
    assert s.weights.shape == s.weights_before.shape == s.ancestors.shape == s.log_weights.shape == (N,)
    assert s.mean.shape == (n,) and s.cov.shape == (n, n) and (s.cov == s.cov.T).all()
    assert 1 - 1e-9 <= s.n_eff <= N + 1e-9 and s.weights.sum() == pytest.approx(1)
    np.testing.assert_allclose(np.exp(s.log_weights), s.weights, rtol=1e-9, atol=1e-300)


@dataclass(frozen=True)
class Jumps:
    """A motion model with nothing but the protocol, and noise that is not normal."""

    Q = np.eye(1)

    def f(self, x):
        return x

    def jacobian(self, x):
        return np.ones((*x.shape, 1))

    def sample(self, x, rng):
        return x + rng.choice([-1.0, 1.0], size=x.shape)


def test_any_motion_model_with_the_protocol():
    s = step(np.zeros((1000, 1)), np.full(1000, 1e-3), [1.0], Jumps(), SCALAR, np.random.default_rng(0))
    assert set(np.unique(s.predicted)) == {-1.0, 1.0}
    assert s.mean[0] == pytest.approx(np.tanh(1.0), abs=0.1)  # p(y | 1) : p(y | -1) = e^2 : 1; sd 0.02


def test_run_is_a_loop_of_steps_with_thinned_clouds():
    x0 = np.asfortranarray(cloud(900))
    ys = np.array([[105.0, 405.0], [108.0, 401.0], [112.0, 399.0]])
    seen = []
    r = run(x0, ys, CV, RANGES, None, np.random.default_rng(6), subsample=90, threshold=0.6, progress=seen.append,
            keep=lambda k, s: (k, s.predicted[:, 1].max()))
    assert seen == pytest.approx([1 / 3, 2 / 3, 1.0])
    rng, x, w = np.random.default_rng(6), x0, np.full(900, 1 / 900)
    assert len(r.index) == 90 and (np.diff(r.index) == 10).all()
    for k, y in enumerate(ys):
        s = step(x, w, y, CV, RANGES, rng, threshold=0.6)
        x, w = s.particles, s.weights
        np.testing.assert_allclose(r.mean[k], s.mean, rtol=1e-9)
        np.testing.assert_allclose(r.n_eff[k], s.n_eff, rtol=1e-9)
        np.testing.assert_allclose(r.predicted[k], s.predicted[r.index])
        np.testing.assert_allclose(r.particles[k], s.particles[r.index])
        before = s.weights_before[r.index]
        np.testing.assert_allclose(r.weights_before[k], before / before.sum(), rtol=1e-9)
        assert r.resampled[k] == s.resampled and (r.ancestors[k] == s.ancestors[r.index]).all()
        assert r.kept[k] == (k, s.predicted[:, 1].max())
    np.testing.assert_allclose(r.last.cov, s.cov, rtol=1e-9)
    full = run(x0, ys, CV, RANGES, 900, np.random.default_rng(6), threshold=0.6)
    assert full.predicted.shape == (3, 900, 4) and (full.index == np.arange(900)).all()
    assert (full.initial == x0).all() and (full.mean == r.mean).all()


def test_run_draws_the_initial_cloud_from_a_gaussian():
    r = run(EXAMPLE_22, [[105.0, 405.0]], CV, RANGES, 100_000, np.random.default_rng(6))
    assert r.initial.shape == (2000, 4)
    sd = np.sqrt(np.diag(EXAMPLE_22.cov))
    assert (np.abs(r.initial.mean(axis=0) - EXAMPLE_22.mean) < 5 * sd / np.sqrt(2000)).all()   # 5 sd
    assert np.cov((r.initial / sd).T) == pytest.approx(np.eye(4), abs=0.16)                   # 5 sd
    certain = run(Gaussian(np.ones(1), np.zeros((1, 1))), [[1.0]], WALK, SCALAR, 5, np.random.default_rng(0))
    assert (certain.initial == 1.0).all()


def test_progress_cancels():
    def cancel(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(EXAMPLE_22, [[105.0, 405.0]], CV, RANGES, 100, np.random.default_rng(6), progress=cancel)


@dataclass(frozen=True)
class Window:
    """y = x + v, v uniform on (-1, 1): the likelihood is exactly zero outside."""

    R = np.eye(1) / 3

    def h(self, x):
        return x

    def jacobian(self, x):
        return np.ones((*x.shape, 1))

    def innovation(self, y, y_hat):
        return y - y_hat

    def log_likelihood(self, y, x):
        with np.errstate(divide="ignore"):
            return np.log(0.5 * (np.abs(y - x)[..., 0] < 1))


def test_weights_that_are_exactly_zero():
    x, w = np.linspace(-5, 5, 101)[:, None], np.full(101, 1 / 101)
    still = LinearMotion([[1.0]], [[0.0]])
    s = step(x, w, [2.0], still, Window(), np.random.default_rng(0))
    assert (np.abs(s.particles - 2) < 1).all() and s.mean[0] == pytest.approx(2)
    with pytest.raises(AllWeightsZero, match="impossible for all"):
        step(x, w, [20.0], still, Window(), np.random.default_rng(0))
    with pytest.raises(ValueError):
        run(x, [[2.0], [20.0]], still, Window(), None, np.random.default_rng(0))
    w = np.zeros(101)
    w[50] = 1.0                                               # one particle left, and it is not explained by y = 2
    assert step(x, w, [0.0], still, Window(), np.random.default_rng(0)).ancestors.tolist() == [50] * 101
    with pytest.raises(AllWeightsZero):
        step(x, w, [2.0], still, Window(), np.random.default_rng(0))


def test_inputs_are_not_modified():
    x, w, y = cloud(50), np.full(50, 0.02), np.array([105.0, 405.0])
    for a in (x, w, y):
        a.setflags(write=False)
    for proposal in ("prior", "ekf", "ukf"):
        for threshold in (0.0, 1.0):
            s = step(x, w, y, CV, RANGES, np.random.default_rng(0), proposal=proposal, threshold=threshold)
            step(s.particles, s.weights, y, CV, RANGES, np.random.default_rng(0))
    run(x, [y, y], CV, RANGES, None, np.random.default_rng(0))


@pytest.mark.parametrize("change, message", [
    (dict(particles=np.zeros(4)), r"shape \(N, n\)"),
    (dict(particles=np.zeros((0, 4)), weights=np.zeros(0)), r"shape \(N, n\)"),
    (dict(particles=np.full((5, 4), np.nan)), "finite"),
    (dict(particles=np.array([[1.0, 2, 3, np.inf]] * 5)), "finite"),
    (dict(weights=np.full(4, 0.25)), r"weights: expected shape \(5,\)"),
    (dict(weights=np.array([0.5, 0.5, 0.5, 0.5, -1.0])), "weights"),
    (dict(weights=np.array([0.5, 0.5, np.nan, 0.5, 1.0])), "weights"),
    (dict(weights=np.full(5, np.inf)), "weights"),
    (dict(weights=np.zeros(5)), "weight"),
    (dict(y=[1.0]), "y: expected shape"), (dict(y=[1.0, np.nan]), "y: expected finite"),
    (dict(y=np.ones((1, 2))), "y: expected one"),
    (dict(resampler="best"), "resampler: expected one of systematic"),
    (dict(proposal="best"), "proposal: expected prior, ekf, ukf, optimal"),
    (dict(proposal="optimal"), "linear in the state"),
    (dict(threshold=1.5), "threshold"), (dict(threshold=np.nan), "threshold"), (dict(threads=0), "threads"),
])
def test_bad_input(change, message):
    args = dict(particles=cloud(5), weights=np.full(5, 0.2), y=[105.0, 405.0], motion=CV, sensor=RANGES,
                rng=np.random.default_rng(0)) | change
    with pytest.raises(ValueError, match=message):
        step(**args)


@pytest.mark.parametrize("change, message", [
    (dict(ys=np.zeros((0, 2))), "ys"), (dict(ys=[105.0, 405.0]), "ys"), (dict(ys=[[105.0, np.nan]]), "finite"),
    (dict(n_particles=None), "n_particles"), (dict(n_particles=0), "n_particles"),
    (dict(initial=cloud(3), n_particles=4), "n_particles"), (dict(subsample=0), "subsample"),
    (dict(initial=Gaussian(np.zeros(4), -np.eye(4))), "initial.cov"),
    (dict(initial=Gaussian(np.zeros(3), np.eye(4))), "initial.mean"),
])
def test_bad_runs(change, message):
    args = dict(initial=EXAMPLE_22, ys=[[105.0, 405.0]], motion=CV, sensor=RANGES, n_particles=10,
                rng=np.random.default_rng(0)) | change
    with pytest.raises(ValueError, match=message):
        run(**args)
