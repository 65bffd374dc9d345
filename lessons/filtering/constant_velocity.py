"""The constant-velocity model: where could somebody be after a while?  MAT 3.1, (3.3), Definition 9."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import kalman
from core.gaussian import chi_square_level, sample
from core.motion import LinearMotion, constant_velocity
from core.types import Array, Gaussian
from lessons.filtering._constant_velocity_view import PROBABILITY, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider

FINE = 256                # intervals in which the paths are simulated; every number of steps below divides it
RUNS = 1000               # paths behind the shares and the sample standard deviation
PATHS = 24                # of them are drawn as lines; the first one alone stands out
CLOUD = 300               # of them are drawn as points
LEAD = {"euler": 0.0, "acceleration": 0.5}   # share of a step's velocity change that already acts on the position


@dataclass(frozen=True, slots=True)
class Params:
    """How restless the velocity is, how often we look, and what is known at the start."""

    sigma_c: float = slider(1.0, low=0.01, high=10.0, unit="m/s/√s", log=True, group="model")
    halvings: int = slider(2, low=0, high=6, group="model")
    scheme: str = choice("euler", ("euler", "acceleration"), group="model")
    horizon_s: float = slider(20.0, low=1.0, high=120.0, step=1.0, unit="s", group="more")
    speed_mps: float = slider(10.0, low=0.0, high=30.0, step=0.5, unit="m/s", group="more")
    start_sigma_m: float = slider(0.0, low=0.0, high=50.0, step=1.0, unit="m", group="more")
    start_sigma_mps: float = slider(0.0, low=0.0, high=10.0, step=0.1, unit="m/s", group="more")
    seed: int = seed(16, group="more")


class Result(NamedTuple):
    """Paths of the differential equation, and two ways to predict where they are after k steps."""

    t: Array                     # (FINE + 1,) s
    paths: Array                 # (FINE + 1, PATHS, 4)
    cloud: Array                 # (K + 1, CLOUD, 4)
    rival_path: Array            # (K + 1, 2) the first path as the other scheme steps along its Brownian motion
    motion: LinearMotion         # exact, for one step
    half: LinearMotion           # exact, for half a step
    rival: LinearMotion          # the other scheme, for one step
    laws: Gaussian               # (K + 1, 4), (K + 1, 4, 4)
    moved: Gaussian              # (K, 4), (K, 4, 4) the law of step k after Phi, without Q
    rival_laws: Gaussian         # (K + 1, 4), (K + 1, 4, 4)
    spread: Array                # (K + 1,) sample standard deviation of x over RUNS paths
    curve: Array                 # (FINE + 1,) the exact one
    inside: Array                # (K + 1,) share of the paths in the ellipse that should hold PROBABILITY of them
    rival_inside: Array          # (K + 1,) the same for the other scheme's ellipse


def compute(p: Params, progress: Progress) -> Result:
    """Simulates RUNS paths in small exact steps; predicts their law in K large ones, by both schemes."""
    K = steps(p)
    begin, move = np.random.default_rng(p.seed).spawn(2)
    start = Gaussian(np.array([0.0, 0.0, p.speed_mps, 0.0]),
                     np.diag(np.repeat([p.start_sigma_m, p.start_sigma_mps], 2)**2))
    # The fine grid does not depend on K, so the same paths are seen whatever the step length is.
    fine = constant_velocity(p.horizon_s / FINE, p.sigma_c, 2)
    x = np.empty((FINE + 1, RUNS, 4))
    x[0] = sample(start, RUNS, begin)
    for i in range(FINE):
        x[i + 1] = fine.sample(x[i], move)                                   # (3.3) between two close moments
        if i % 32 == 0:
            progress(0.9 * i / FINE)

    dt = p.horizon_s / K
    motion, rival = constant_velocity(dt, p.sigma_c, 2), approximation(dt, p.sigma_c, p.scheme)
    bare = LinearMotion(motion.Phi, np.zeros((4, 4)))
    laws, rival_laws = predictions(start, motion, K), predictions(start, rival, K)
    moved = [kalman.predict(Gaussian(laws.mean[k], laws.cov[k]), bare) for k in range(K)]
    t = np.linspace(0.0, p.horizon_s, FINE + 1)
    at = x[::FINE // K]
    v, c = at[:, 0, 2:], LEAD[p.scheme]
    rival_path = at[0, 0, :2] + np.vstack([np.zeros(2), np.cumsum(dt * ((1 - c) * v[:-1] + c * v[1:]), axis=0)])
    curve = np.sqrt(p.start_sigma_m**2 + (p.start_sigma_mps * t)**2 + p.sigma_c**2 * t**3 / 3)
    return Result(
        t, x[:, :PATHS].copy(), at[:, :CLOUD].copy(), rival_path, motion, constant_velocity(dt / 2, p.sigma_c, 2),
        rival, laws, Gaussian(np.array([g.mean for g in moved]), np.array([g.cov for g in moved])), rival_laws,
        at[..., 0].std(axis=1), curve, share_inside(laws, at), share_inside(rival_laws, at))


def steps(p: Params) -> int:
    """K = 2^halvings."""
    return 2**p.halvings


def approximation(dt: float, sigma_c: float, scheme: str) -> LinearMotion:
    """x_k = Phi x_{k-1} + W (beta_k - beta_{k-1}),  W = [c dt I; I]:  Q = dt W Qc W', of rank 2 instead of 4.

    c = 0 is Euler's method: the position moves with the old velocity.  c = 1/2: constant acceleration within a step.
    """
    W = np.kron([[LEAD[scheme] * dt], [1.0]], np.eye(2))
    return LinearMotion(constant_velocity(dt, 0.0, 2).Phi, sigma_c**2 * dt * W @ W.T)


def predictions(start: Gaussian, motion: LinearMotion, K: int) -> Gaussian:
    """The law after 0, 1, ..., K steps without a measurement: P = Phi P Phi' + Q again and again."""
    laws = [start]
    for _ in range(K):
        laws.append(kalman.predict(laws[-1], motion))
    return Gaussian(np.array([g.mean for g in laws]), np.array([g.cov for g in laws]))


def share_inside(laws: Gaussian, x: Array) -> Array:
    """Share of the positions (K + 1, n, 4) within the ellipse of PROBABILITY; both axes have the same variance here.

    A variance of 0 holds nobody who has moved.
    """
    d = x[..., :2] - laws.mean[:, None, :2]
    return (np.square(d).sum(axis=-1) <= chi_square_level(PROBABILITY, 2) * laws.cov[:, :1, 0]).mean(axis=1)


def timeline(p: Params) -> Timeline:
    """K steps of T / K seconds; the end, where the fan is widest, is shown first."""
    K = steps(p)
    return Timeline(K, ("move", "noise"), start=K, scale=p.horizon_s / K, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline, refs=("MAT 3.1", "MAT (3.3)", "MAT Definition 9"),
    presets={
        "four steps of 5 s": {},
        "one step of 20 s": {"halvings": 0, "step": 1},
        "64 steps": {"halvings": 6, "step": 64},
        "constant acceleration": {"scheme": "acceleration", "halvings": 0, "step": 1},
        "Example 20 before any measurement": {"horizon_s": 16.0, "halvings": 4, "start_sigma_m": 10.0,
                                              "start_sigma_mps": 3.0, "speed_mps": 5.0, "step": 16},
        "a calm velocity": {"sigma_c": 0.1, "horizon_s": 60.0},
    },
)
