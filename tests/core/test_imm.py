"""Interacting multiple models: what they reduce to, and that they follow a track that stops, drives and turns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import extended, imm, kalman, unscented
from core.imm import bank, mix, sojourn_transition
from core.mixture import Mixture, log_evidence, mixture, moments
from core.motion import constant_position, constant_velocity
from core.sensors import Linear, Position, Range
from core.turn import CoordinatedTurn, known_turn, standing
from core.types import Gaussian

pytestmark = pytest.mark.filterwarnings("error")

CV = constant_velocity(1.0, 1.0, 2)
FIX = Position(2, [30.0, 50.0])
PAIR = Range([[-250.0, 0.0], [250.0, 0.0]], 10.0)
START = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))
LEFT = known_turn(1.0, 0.5, 0.2)
MODELS = [CV, LEFT, standing(1.0, 0.1, 2.0)]
PI = sojourn_transition([10.0, 5.0, 8.0])


def measured(sensor, T=8, runs=(), seed=0):
    track = START.mean + 3 * np.arange(1, T + 1)[:, None] * [1, 1, 0, 0]
    y = sensor.h(track).reshape(T, *(1,) * len(runs), -1)
    return y + np.sqrt(sensor.R.diagonal()) * np.random.default_rng(seed).normal(size=(T, *runs, y.shape[-1]))


def single(rule, ys, motion, sensor):
    run = {"ekf": extended.run, "ukf": lambda *a: unscented.run(*a, 1.0)}[rule]
    return run(START, ys, motion, sensor).posterior


@pytest.mark.parametrize("rule", ["ekf", "ukf"])
@pytest.mark.parametrize("sensor", [FIX, PAIR])
@pytest.mark.parametrize("runs", [(), (3,), (40,)])
def test_one_model_is_the_single_filter(rule, sensor, runs):
    ys = measured(sensor, runs=runs)
    if runs:
        ys[2, 1], ys[4, ..., 0] = np.nan, np.nan
    got, expected = imm.run(START, ys, [CV], [[1.0]], sensor, rule=rule), single(rule, ys, CV, sensor)
    np.testing.assert_allclose(got.estimate.mean, expected.mean, atol=1e-9)
    np.testing.assert_allclose(got.estimate.cov, expected.cov, atol=1e-8)
    assert (got.probabilities == 1.0).all()


@pytest.mark.parametrize("rule", ["ekf", "ukf"])
def test_equal_models_are_the_single_filter(rule):
    ys, models = measured(PAIR, runs=(3,)), [CV, constant_velocity(1.0, 1.0, 2)]
    got = imm.run(START, ys, models, [[0.7, 0.3], [0.1, 0.9]], PAIR, probabilities=[0.6, 0.4], rule=rule)
    expected = single(rule, ys, CV, PAIR)
    np.testing.assert_allclose(got.estimate.mean, expected.mean, atol=1e-9)
    np.testing.assert_allclose(got.estimate.cov, expected.cov, atol=1e-8)
    p = np.array([0.6, 0.4])
    for k in range(len(ys)):                               # evidence says nothing: only the chain moves
        p = p @ [[0.7, 0.3], [0.1, 0.9]]
        np.testing.assert_allclose(got.probabilities[k], [p] * 3, atol=1e-12)


def test_models_that_never_change_are_weighed_by_their_evidence():
    """Identity transition: independent Kalman filters, and exact Bayes for which of them is right."""
    ys = measured(FIX)
    got = imm.run(START, ys, MODELS, np.eye(3), FIX, probabilities=[0.2, 0.5, 0.3])
    alone = [kalman.run(START, ys, m, FIX) for m in MODELS]
    total = np.log([0.2, 0.5, 0.3]) + np.array([
        log_evidence(a.innovation, a.innovation_cov).sum() for a in alone])
    expected = np.exp(total - total.max())
    np.testing.assert_allclose(got.probabilities[-1], expected / expected.sum(), rtol=1e-9)
    for j, a in enumerate(alone):
        np.testing.assert_allclose(got.posterior.means[:, j], a.posterior.mean, atol=1e-9)
        np.testing.assert_allclose(got.posterior.covs[:, j], a.posterior.cov, atol=1e-8)
    assert got.update.log_evidence.sum() == pytest.approx(np.log(np.exp(total - total.max()).sum()) + total.max())


def test_one_step_by_hand():
    """Two models of one component, the numbers of each stage computed directly."""
    before = mixture([0.8, 0.2], [[0.0], [10.0]], [[[1.0]], [[4.0]]])
    models, R = [constant_position(1.0, 1.0, 1), constant_position(1.0, 3.0, 1)], 2.0
    Pi = np.array([[0.9, 0.1], [0.3, 0.7]])
    s = imm.step(before, [3.0], models, Pi, Linear([[1.0]], [[R]]))
    c = np.array([0.8, 0.2]) @ Pi
    mixing = np.array([[0.8 * 0.9, 0.8 * 0.1], [0.2 * 0.3, 0.2 * 0.7]]) / c
    np.testing.assert_allclose(s.mixing, mixing)
    start = mixing.T @ [0.0, 10.0]
    var = mixing.T @ [1.0, 4.0] + mixing[0] * start**2 + mixing[1] * (10 - start) ** 2
    np.testing.assert_allclose(s.mixed.means[:, 0], start)
    np.testing.assert_allclose(s.mixed.covs[:, 0, 0], var)
    prior = var + np.array([1.0, 9.0])
    density = np.exp(-0.5 * (3 - start) ** 2 / (prior + R)) / np.sqrt(2 * np.pi * (prior + R))
    np.testing.assert_allclose(s.probabilities, c * density / (c @ density))
    post = start + prior / (prior + R) * (3 - start)
    np.testing.assert_allclose(s.posterior.means[:, 0], post)
    assert s.estimate.mean[0] == pytest.approx(s.probabilities @ post)
    assert np.exp(s.update.log_evidence) == pytest.approx(c @ density)


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 3))
@settings(max_examples=40, deadline=None)
def test_mixing_keeps_the_moments_of_the_whole(seed, r, n):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(2, r, n, n))
    m = mixture(rng.dirichlet(np.ones(r), 2), rng.normal(size=(2, r, n)), A @ A.mT)
    Pi = rng.dirichlet(np.ones(r), r)
    mixing, mixed = mix(m, Pi)
    np.testing.assert_allclose(mixing.sum(axis=-2), 1.0)
    np.testing.assert_allclose(mixed.weights, m.weights @ Pi, atol=1e-12)
    for a, b in zip(moments(mixed), moments(m), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_a_model_that_cannot_rule():
    """Model 1 may only be left, model 2 only be stayed in: no division by its probability 0."""
    ys = measured(FIX)
    got = imm.run(START, ys, MODELS, [[0, 0, 1], [0, 0, 1], [0, 0, 1]], FIX, probabilities=[1.0, 0.0, 0.0])
    np.testing.assert_array_equal(got.probabilities, [[0, 0, 1]] * len(ys))
    alone = kalman.run(START, ys, MODELS[2], FIX).posterior
    np.testing.assert_allclose(got.estimate.mean, alone.mean, atol=1e-9)
    assert all(np.isfinite(a).all() for a in (got.mixing, got.posterior.means, got.posterior.covs))


def test_probabilities_do_not_underflow():
    """A model that was wrong for 2000 nats becomes the right one: its logarithm was kept."""
    models = [constant_position(1.0, 1e-3, 1), constant_position(1.0, 10.0, 1)]
    ys = np.concatenate([np.zeros(300), 50 * np.arange(1, 4)])[:, None]
    got = imm.run(Gaussian(np.zeros(1), 1e-6 * np.eye(1)), ys, models, np.eye(2), Linear([[1.0]], [[1e-4]]))
    assert got.posterior.log_weights[299, 1] < -700 and got.probabilities[-1, 1] > 0.999


@pytest.mark.parametrize("runs", [3, 40])
def test_batch_equals_loop(runs):
    ys = measured(PAIR, runs=(runs,))
    ys[3, 1] = np.nan
    both = imm.run(START, ys, MODELS, PI, PAIR)
    for k in (0, 1, runs - 1):
        alone = imm.run(START, ys[:, k], MODELS, PI, PAIR)
        np.testing.assert_allclose(both.probabilities[:, k], alone.probabilities, atol=1e-9)
        np.testing.assert_allclose(both.estimate.mean[:, k], alone.estimate.mean, atol=1e-8)
        np.testing.assert_allclose(both.estimate.cov[:, k], alone.estimate.cov, atol=1e-7)
        np.testing.assert_allclose(both.mixing[:, k], alone.mixing, atol=1e-9)


def test_against_filterpy():
    filterpy = pytest.importorskip("filterpy.kalman")
    ys, models, Pi = measured(FIX, T=20), [CV, LEFT], np.array([[0.95, 0.05], [0.1, 0.9]])
    filters = []
    for m in models:
        f = filterpy.KalmanFilter(4, 2)
        f.x, f.P, f.F, f.Q = START.mean.copy(), START.cov.copy(), np.array(m.Phi), np.array(m.Q)
        f.H, f.R = np.eye(2, 4), np.array(FIX.R)
        filters.append(f)
    theirs = filterpy.IMMEstimator(filters, np.array([0.7, 0.3]), Pi)
    got = imm.run(START, ys, models, Pi, FIX, probabilities=[0.7, 0.3])
    for k, y in enumerate(ys):
        theirs.predict()
        theirs.update(y)
        np.testing.assert_allclose(got.probabilities[k], theirs.mu, atol=1e-9)
        np.testing.assert_allclose(got.estimate.mean[k], theirs.x, atol=1e-7)
        np.testing.assert_allclose(got.estimate.cov[k], theirs.P, atol=1e-6)


def stop_drive_turn():
    """Stands 20 s, starts with 3 m/s^2 to 12 m/s, drives, turns left and right, brakes and stands again."""
    drive, left, right = (known_turn(1.0, 0.0, np.radians(w)) for w in (0.0, 9.0, -9.0))
    x, track = np.zeros(4), []
    for what, count in (("stand", 20), (3.0, 4), (drive, 25), (left, 20), (drive, 20), (right, 15), (-3.0, 4),
                        ("stand", 20)):
        for _ in range(count):
            if isinstance(what, float):
                v = x[2:]
                speed = np.linalg.norm(v)
                new = (speed + what) * (v / speed if speed > 1e-9 else np.array([1.0, 0.0]))
                x = np.concatenate([x[:2] + (v + new) / 2, new])
            elif what != "stand":
                x = what.f(x)
            track.append(x)
    return np.array(track)


def test_stop_drive_turn_is_followed_better_than_by_each_model():
    """100 runs with a fixed seed, compared run by run on the same noise: with each of its own models, and with
    constant velocity at the noise that is best in hindsight.  The mean advantage has to exceed 5 standard errors
    (without any, less than one seed in 10^6 would pass; it is 28 or more)."""
    track = stop_drive_turn()
    T, runs, sigma = len(track), 100, 10.0
    ys = track[:, None, :2] + sigma * np.random.default_rng(3).normal(size=(T, runs, 2))
    start, fix = Gaussian(np.zeros(4), np.diag([64.0, 64.0, 1.0, 1.0])), Position(2, sigma)
    w = np.radians(9.0)
    models = [standing(1.0, 0.05, 3.0), constant_velocity(1.0, 0.7, 2), *(known_turn(1.0, 0.3, s) for s in (w, -w))]
    got = imm.run(start, ys, models, sojourn_transition([20.0, 25.0, 20.0, 20.0]), fix)

    def errors(means):
        return np.sqrt(np.square(means[..., :2] - track[:, None, :2]).sum(axis=-1).mean(axis=0))

    ours = errors(got.estimate.mean)
    others = [errors(kalman.run(start, ys, m, fix).posterior.mean) for m in models]
    others += [errors(kalman.run(start, ys, constant_velocity(1.0, s, 2), fix).posterior.mean) for s in (1.0, 2.0, 4.0)]
    for other in others:
        gain = other - ours
        assert gain.mean() > 5 * gain.std() / np.sqrt(runs)
    assert ours.mean() < 0.9 * min(other.mean() for other in others)
    p = got.probabilities.mean(axis=1)                     # and it knows what is going on
    legs = {0: (10, 20), 1: (35, 48), 2: (54, 68), 3: (96, 107)}
    assert all(p[a:b].mean(axis=0).argmax() == j for j, (a, b) in legs.items())


def test_turn_rate_in_the_state():
    """The extended filter with an unknown turn rate finds it."""
    model, truth = CoordinatedTurn(1.0, 0.1, 0.01), np.array([0.0, 0.0, 10.0, 0.0, 0.15])
    states = []
    for _ in range(80):
        truth = model.f(truth)
        states.append(truth)
    ys = np.array(states)[:, :2] + np.random.default_rng(4).normal(size=(80, 2))
    got = imm.run(Gaussian(np.array([0, 0, 10.0, 0, 0]), np.diag([1.0, 1, 1, 1, 0.04])), ys, [model], [[1.0]],
                  Position(2, 1.0)).estimate
    sd = np.sqrt(got.cov[-1, 4, 4])
    assert abs(got.mean[-1, 4] - 0.15) < 4 * sd and sd < 0.03


def test_a_bank_can_start_a_run():
    ys = measured(FIX)
    whole = imm.run(START, ys, MODELS, PI, FIX)
    first = imm.run(START, ys[:3], MODELS, PI, FIX)
    rest = imm.run(Mixture(*(a[-1] for a in first.posterior)), ys[3:], MODELS, PI, FIX)
    np.testing.assert_allclose(rest.estimate.mean, whole.estimate.mean[3:], atol=1e-9)
    np.testing.assert_allclose(rest.probabilities, whole.probabilities[3:], atol=1e-12)
    assert bank(START, [0.5, 0.5]).means.shape == (2, 4)


def test_record_and_progress():
    seen = []
    got = imm.run(START, measured(FIX, T=4, runs=(3,)), MODELS, PI, FIX, progress=seen.append)
    assert seen == [0.25, 0.5, 0.75, 1.0]
    assert got.mixing.shape == (4, 3, 3, 3) and got.update.step.gain.shape == (4, 3, 3, 4, 2)
    assert got.estimate.cov.shape == (4, 3, 4, 4) and got.probabilities.shape == (4, 3, 3)

    def stop(_):
        raise InterruptedError

    with pytest.raises(InterruptedError):
        imm.run(START, measured(FIX), MODELS, PI, FIX, progress=stop)


def test_inputs_stay_as_they_are():
    ys, Pi = measured(FIX, runs=(40,)), PI.copy()
    copies = ys.copy(), START.cov.copy()
    ys.setflags(write=False)
    Pi.setflags(write=False)
    imm.run(START, ys, MODELS, Pi, FIX)
    np.testing.assert_array_equal(ys, copies[0])
    np.testing.assert_array_equal(START.cov, copies[1])


@pytest.mark.parametrize(("call", "words"), [
    (lambda: imm.run(START, measured(FIX), MODELS, np.eye(2), FIX), "transition"),
    (lambda: imm.run(START, measured(FIX), MODELS, 0.5 * np.eye(3), FIX), "row sums 1"),
    (lambda: imm.run(START, measured(FIX), MODELS[:2], [[1.5, -0.5], [0, 1]], FIX), ">= 0"),
    (lambda: imm.run(START, measured(FIX), MODELS, PI, FIX, probabilities=[0.5, 0.5]), "motions"),
    (lambda: imm.run(START, measured(FIX), MODELS, PI, FIX, probabilities=[0.5, 0.5, 0.5]), "sum 1"),
    (lambda: imm.run(START, measured(FIX), [CV, constant_position(1.0, 1.0, 2)], np.eye(2), FIX), "4 states"),
    (lambda: imm.run(START, measured(FIX), MODELS, PI, FIX, rule="kf"), "'ekf' or 'ukf'"),
    (lambda: imm.run(START, measured(FIX)[:, :1], MODELS, PI, FIX), r"\(..., 2\)"),
    (lambda: imm.run(START._replace(cov=-START.cov), measured(FIX), MODELS, PI, FIX), "positive semidefinite"),
    (lambda: imm.step(bank(START, [1.0]), [np.nan, 1.0], [CV], [[1.0]], FIX), "finite"),
    (lambda: sojourn_transition([1.0, 5.0]), "above 1"),
])  # fmt: skip
def test_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_sojourn_of_one_model():
    assert sojourn_transition([5.0]).tolist() == [[1.0]]
