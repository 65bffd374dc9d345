"""1000 runs of 60 steps through the batched filters against FilterPy's loop, and one step against one step.

FilterPy's loop is timed on a few runs and scaled to the same number.
"""

import numpy as np
import pytest

from core import extended, kalman, unscented
from core.motion import constant_velocity
from core.sensors import Position, Range
from core.types import Gaussian
from tests.bench import at_most, faster, medians

pytestmark = pytest.mark.bench

STATIONS = np.array([[-250.0, 0.0], [250.0, 0.0]])
INITIAL = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))
MOTION = constant_velocity(1.0, 1.0, 2)
FIX, PAIR = Position(2, [30.0, 50.0]), Range(STATIONS, 10.0)
RUNS, STEPS, TIMED = 1000, 60, 10


@pytest.fixture(scope="module")
def measurements():
    """ys (T, runs, 2) of both sensors."""
    rng = np.random.default_rng(0)
    x = INITIAL.mean + np.sqrt(np.diag(INITIAL.cov)) * rng.standard_normal((RUNS, 4))
    fixes, ranges = np.empty((2, STEPS, RUNS, 2))
    for k in range(STEPS):
        x = MOTION.sample(x, rng)
        fixes[k] = FIX.h(x) + np.array([30.0, 50.0]) * rng.standard_normal((RUNS, 2))
        ranges[k] = PAIR.h(x) + 10.0 * rng.standard_normal((RUNS, 2))
    return fixes, ranges


def h(x):
    return np.sqrt(((x[:2] - STATIONS) ** 2).sum(axis=1))


def jacobian(x):
    J = np.zeros((2, 4))
    J[:, :2] = (x[:2] - STATIONS) / h(x)[:, None]
    return J


def theirs(name):
    """FilterPy's filter with our models, and its update for y."""
    filterpy = pytest.importorskip("filterpy.kalman")
    Phi = np.array(MOTION.Phi)
    if name == "KF":
        f = filterpy.KalmanFilter(4, 2)
        f.F, f.H, f.R = Phi, np.eye(2, 4), np.array(FIX.R)
        update = f.update
    elif name == "EKF":
        f = filterpy.ExtendedKalmanFilter(4, 2)
        f.F, f.R = Phi, np.array(PAIR.R)

        def update(y):
            f.update(y, jacobian, h)
    else:
        points = filterpy.JulierSigmaPoints(4, kappa=1.0)
        f = filterpy.UnscentedKalmanFilter(4, 2, 1.0, h, lambda x, dt: Phi @ x, points)
        f.R = np.array(PAIR.R)
        update = f.update
    f.x, f.P, f.Q = INITIAL.mean.copy(), INITIAL.cov.copy(), np.array(MOTION.Q)
    return f, update


def their_runs(name, ys):
    f, update = theirs(name)

    def loop():
        for r in range(TIMED):
            f.x, f.P = INITIAL.mean.copy(), INITIAL.cov.copy()
            for y in ys[:, r]:
                f.predict()
                update(y)
        return f.x

    return loop


@pytest.mark.parametrize(("name", "target"), [("KF", 30), ("EKF", 30), ("UKF", 100)])
def test_batch_against_filterpy(name, target, measurements):
    ys = measurements[0 if name == "KF" else 1]
    call = {
        "KF": lambda: kalman.run(INITIAL, ys, MOTION, FIX),
        "EKF": lambda: extended.run(INITIAL, ys, MOTION, PAIR),
        "UKF": lambda: unscented.run(INITIAL, ys, MOTION, PAIR, 1.0),
    }[name]
    loop = their_runs(name, ys)
    np.testing.assert_allclose(call().posterior.mean[-1, TIMED - 1], loop(), atol=1e-5)      # the same problem
    t = medians(5, batch=2, ours=call, reference=loop)
    faster(f"{name}, 1000 runs x 60 steps / FilterPy's loop", t["ours"], t["reference"] * RUNS / TIMED, target)


def test_batch_with_a_covariance_of_its_own_for_each_run_against_filterpy(measurements):
    """The covariances of a linear filter are equal in all runs and computed once; here they are not."""
    ys = measurements[0]
    each = Gaussian(INITIAL.mean, INITIAL.cov * np.linspace(1.0, 2.0, RUNS)[:, None, None])
    t = medians(5, batch=2, ours=lambda: kalman.run(each, ys, MOTION, FIX), reference=their_runs("KF", ys))
    faster("KF, 1000 different covariances x 60 steps / FilterPy's loop", t["ours"],
           t["reference"] * RUNS / TIMED, 30)


def test_one_step_against_filterpy(measurements):
    """predict and update through the public functions, 60 in a row from a fresh Gaussian, and from one each time."""
    ys = np.ascontiguousarray(measurements[0][:, 0])

    def ours():
        g = Gaussian(INITIAL.mean, INITIAL.cov)
        for y in ys:
            g = kalman.update(kalman.predict(g, MOTION), y, FIX).posterior
        return g

    def fresh():
        for y in ys:
            kalman.update(kalman.predict(Gaussian(INITIAL.mean, INITIAL.cov), MOTION), y, FIX)

    f, update = theirs("KF")

    def reference():
        f.x, f.P = INITIAL.mean.copy(), INITIAL.cov.copy()
        for y in ys:
            f.predict()
            update(y)

    t = medians(5, batch=40, ours=ours, fresh=fresh, reference=reference)
    at_most("KF step / FilterPy's predict and update", t["ours"] / STEPS, t["reference"] / STEPS, 1.0)
    at_most("KF step from an unchecked Gaussian / FilterPy's", t["fresh"] / STEPS, t["reference"] / STEPS, 1.0)
