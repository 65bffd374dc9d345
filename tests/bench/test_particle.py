"""The SIR step of MAT Example 22 against drawing its noise, the package `particles`, and FilterPy's way."""

import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from core import particle
from core.motion import constant_velocity
from core.noise import standard_normal
from core.sensors import Range
from core.types import Gaussian
from tests.bench import at_most, faster, medians

pytestmark = pytest.mark.bench

STATIONS = np.array([[-250.0, 0.0], [250.0, 0.0]])
INITIAL = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([400.0, 400.0, 25.0, 25.0]))
MOTION = constant_velocity(1.0, 1.0, 2)
SENSOR = Range(STATIONS, 10.0)
Y = np.linalg.norm(np.array([-147.0, -27.0]) - STATIONS, axis=1)
LARGE, SMALL = 1_000_000, 10_000


def cloud(N):
    z = standard_normal(np.random.default_rng(1), N, 4)
    return np.asfortranarray(INITIAL.mean + np.sqrt(np.diag(INITIAL.cov)) * z), np.full(N, 1.0 / N)


def ours(N):
    x, w = cloud(N)
    rng = np.random.default_rng(2)
    return lambda: particle.step(x, w, Y, MOTION, SENSOR, rng)


def the_package_particles(N):
    """Its bootstrap filter with mean and variance collected at every step, which `step` computes as well."""
    smc = pytest.importorskip("particles")
    from particles import collectors, distributions, state_space_models

    Phi, Q = np.array(MOTION.Phi), np.array(MOTION.Q)

    class Example22(state_space_models.StateSpaceModel):
        def PX0(self):
            return distributions.MvNormal(loc=INITIAL.mean, cov=INITIAL.cov)

        def PX(self, t, xp):
            return distributions.MvNormal(loc=xp @ Phi.T, cov=Q)

        def PY(self, t, xp, x):
            r = [np.sqrt((x[:, 0] - a) ** 2 + (x[:, 1] - b) ** 2) for a, b in STATIONS]
            return distributions.IndepProd(*[distributions.Normal(loc=d, scale=10.0) for d in r])

    def fresh():
        model = state_space_models.Bootstrap(ssm=Example22(), data=[Y[None]] * 1000)
        algorithm = smc.SMC(fk=model, N=N, resampling="systematic", ESSrmin=1.0, collect=[collectors.Moments()])
        next(algorithm)
        next(algorithm)                                       # the first step draws the prior, without a resampling
        return algorithm

    algorithm = fresh()
    return lambda: next(algorithm)


def filterpy_style(N):
    """Predict, weigh, estimate, resample as FilterPy's documentation does, with its systematic_resample."""
    monte_carlo = pytest.importorskip("filterpy.monte_carlo")
    from scipy.stats import norm

    start, _ = cloud(N)
    particles, weights = np.ascontiguousarray(start), np.full(N, 1.0 / N)
    Q = np.array(MOTION.Q)

    def step():
        particles[:, :2] += particles[:, 2:]
        particles[:] += np.random.multivariate_normal(np.zeros(4), Q, N)
        for station, y in zip(STATIONS, Y, strict=True):
            weights[:] *= norm(np.linalg.norm(particles[:, :2] - station, axis=1), 10.0).pdf(y)
        weights[:] += 1e-300
        weights[:] /= weights.sum()
        mean = np.average(particles, weights=weights, axis=0)
        np.average((particles - mean) ** 2, weights=weights, axis=0)
        particles[:] = particles[monte_carlo.systematic_resample(weights)]
        weights.fill(1.0 / N)

    return step


def test_step_against_drawing_its_noise():
    streams = [np.random.Generator(np.random.PCG64(k)) for k in range(2)]
    pool = ThreadPoolExecutor(2)

    def draw():
        return list(pool.map(lambda g: g.standard_normal(2 * LARGE), streams))

    draw()
    t = medians(5, batch=7, ours=ours(LARGE), reference=draw)
    at_most("SIR step, N = 1e6 / 4N normals of PCG64, 2 threads", t["ours"], t["reference"], 1.3)


@pytest.mark.parametrize("N, target, batch", [(LARGE, 5, 4), (SMALL, 3, 50)])
def test_step_against_particles(N, target, batch):
    t = medians(4, batch=batch, ours=ours(N), reference=the_package_particles(N))
    faster(f"SIR step, N = {N:,} / particles 0.4", t["ours"], t["reference"], target)


@pytest.mark.parametrize("N, target, batch", [(LARGE, 15, 2), (SMALL, 10, 25)])
def test_step_against_filterpy(N, target, batch):
    t = medians(3, batch=batch, ours=ours(N), reference=filterpy_style(N))
    faster(f"SIR step, N = {N:,} / FilterPy style", t["ours"], t["reference"], target)


def test_run_of_41_steps_against_noise_per_step():
    rng = np.random.default_rng(0)
    truth = np.array([-150.0, -30.0]) + 3.0 * np.arange(41)[:, None]
    ys = np.linalg.norm(truth[:, None] - STATIONS, axis=-1) + 10.0 * rng.standard_normal((41, 2))
    t = medians(
        1,
        ours=lambda: particle.run(INITIAL, ys, MOTION, SENSOR, LARGE, np.random.default_rng(1)),
        reference=lambda: [rng.standard_normal((LARGE, 4)) for _ in range(41)],
    )
    at_most("SIR run of 41 steps, N = 1e6 / its normals, 1 thread", t["ours"], t["reference"], 20)


def test_extra_memory():
    x, w = cloud(LARGE)
    particle.step(x, w, Y, MOTION, SENSOR, np.random.default_rng(2))
    tracemalloc.start()
    try:
        particle.step(x, w, Y, MOTION, SENSOR, np.random.default_rng(2))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= 4 * x.nbytes, f"{peak / x.nbytes:.2f} times the particle array"
