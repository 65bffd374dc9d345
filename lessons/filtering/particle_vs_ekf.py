"""Two stations cannot tell left from right: particles keep both answers, the EKF picks one.

MAT 3.5.2, Algorithms 5 and 6, Example 22, Figure 3.3.  The notes do not give the true track; it is
x(t) = [-150 + 3 t, -30 + 3 t] m here, which crosses the line through the stations at t = 10 s.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import extended, particle, unscented
from core.cloud import thinned
from core.forms import half_space_probability
from core.motion import constant_velocity
from core.sensors import Range
from core.types import Array, Gaussian
from lessons.filtering._histogram import weighted_density
from lessons.filtering._particle_view import CARRIER, view
from lessons.filtering._with_start import with_start
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider, switch

STEPS = 40
INITIAL = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([20.0, 20.0, 5.0, 5.0])**2)
TRUTH = np.column_stack([-150.0 + 3.0 * np.arange(STEPS + 1), -30.0 + 3.0 * np.arange(STEPS + 1)])
THIRD = (0.0, 200.0)
KAPPA = -1.0                              # 3 - n, as in the notes
DRAWN = 2000
BINS = 76
THRESHOLD = {"sir": 1.0, "sis": 0.0}


@dataclass(frozen=True, slots=True)
class Params:
    """The example of the notes; the particle filter's choices come first."""

    n_particles: int = slider(20_000, low=100, high=1_000_000, log=True, group="filter")
    sampling: str = choice("sir", ("sir", "adaptive", "sis"), group="filter")
    third_station: bool = switch(False, group="filter")
    resampler: str = choice("systematic", ("systematic", "stratified", "multinomial", "residual"), group="more")
    threshold: float = slider(0.5, low=0.05, high=0.95, step=0.05, group="more")
    proposal: str = choice("prior", ("prior", "ekf", "ukf"), group="more")
    sigma_m: float = slider(10.0, low=2.0, high=50.0, step=1.0, unit="m", group="world")
    sigma_c: float = slider(1.0, low=0.1, high=5.0, step=0.1, unit="m/s/√s", group="world")
    station_1: Point = draggable((-250.0, 0.0), low=-500.0, high=500.0, role="station", group="world")
    station_2: Point = draggable((250.0, 0.0), low=-500.0, high=500.0, role="station", group="world")
    seed: int = seed(2681, group="world")
    zoom: str = choice("track", ("track", "stations"), group="view")


class Side(NamedTuple):
    """d(x) = normal . x - offset: the signed distance from the line through stations 1 and 2, in metres."""

    normal: Array
    offset: float

    def distance(self, x: Array) -> Array:
        return self.normal[0] * x[..., 0] + self.normal[1] * x[..., 1] - self.offset

    def probability(self, g: Gaussian) -> Array:
        """P(d > 0) for a normal law of the state."""
        return half_space_probability(g, -np.append(self.normal, [0.0, 0.0]), -self.offset)


class Kept(NamedTuple):
    """What only the full cloud knows of one step."""

    share: float                 # posterior probability of d > 0
    density: Array               # (BINS,) posterior density of d, in 1/m
    children: Array              # (M,) copies that resampling made of each drawn particle
    heaviest: float              # weight of the drawn particle that has the largest, in the full cloud
    carriers: Array              # (c, 4) particles beyond the drawn ones that carry more than CARRIER each
    carried: Array               # (c,) their weights


class Result(NamedTuple):
    """Three filters on the same measurements; time runs over 0..STEPS where the start is included."""

    stations: Array              # (2 or 3, 2)
    y: Array                     # (STEPS, m)
    range_at_drawn: Array        # (STEPS, M, m) h(x) of the drawn particles
    side: Side
    edges: Array                 # (BINS + 1,) of the histogram of d
    ekf: Gaussian                # (STEPS + 1, 4), (STEPS + 1, 4, 4)
    ukf: Gaussian
    pf: Gaussian
    run: particle.Run
    share: Array                 # (STEPS + 1,) P(d > 0) by the particles
    density: Array               # (STEPS + 1, BINS)
    children: Array              # (STEPS, M)
    heaviest: Array              # (STEPS,)
    carriers: tuple[Array, ...]  # STEPS times (c, 4)
    carried: tuple[Array, ...]   # STEPS times (c,)
    truth: Array                 # (STEPS + 1, 2)


def compute(p: Params, progress: Progress) -> Result:
    """Measures along the true track, then runs the three filters."""
    measure, draw = np.random.default_rng(p.seed).spawn(2)
    stations = np.array([p.station_1, p.station_2, THIRD] if p.third_station else [p.station_1, p.station_2])
    motion, sensor = constant_velocity(1.0, p.sigma_c, 2), Range(stations, p.sigma_m)
    # Three columns always: the first two ranges stay what they are when the third station is switched on.
    noise = p.sigma_m * measure.standard_normal((STEPS, 3))[:, :len(stations)]
    y = sensor.h(TRUTH[1:]) + noise
    ekf = extended.run(INITIAL, y, motion, sensor).posterior
    ukf = unscented.run(INITIAL, y, motion, sensor, kappa=KAPPA).posterior
    progress(0.02)

    side = _side(stations)
    reach = np.abs(side.distance(TRUTH)).max() + 100.0
    edges = np.linspace(-reach, reach, BINS + 1)
    index = drawn_index(p.n_particles)

    def keep(k: int, step: particle.Step) -> Kept:
        d = side.distance(step.predicted)
        w = step.weights_before
        heavy = np.setdiff1d(np.flatnonzero(w > CARRIER), index)
        return Kept(float(w @ (d > 0.0)), weighted_density(d, w, edges),
                    np.bincount(step.ancestors, minlength=len(d))[index], float(w[index].max()),
                    step.predicted[heavy], w[heavy])

    run = particle.run(INITIAL, y, motion, sensor, p.n_particles, draw, resampler=p.resampler,
                       threshold=THRESHOLD.get(p.sampling, p.threshold), proposal=p.proposal, subsample=DRAWN,
                       keep=keep, progress=lambda done: progress(0.02 + 0.98 * done))
    *columns, carriers, carried = zip(*run.kept, strict=True)
    share, density, children, heaviest = map(np.array, columns)
    d0 = side.distance(run.initial)
    w0 = np.full(len(d0), 1.0 / len(d0))
    slim = run._replace(last=None, kept=())                 # the full cloud would fill the cache of results
    return Result(
        stations, y, sensor.h(run.predicted), side, edges, with_start(INITIAL, ekf), with_start(INITIAL, ukf),
        with_start(INITIAL, Gaussian(run.mean, run.cov)), slim, np.append(float(w0 @ (d0 > 0.0)), share),
        np.vstack([weighted_density(d0, w0, edges), density]), children, heaviest,
        carriers, carried, TRUTH)


def drawn_index(N: int) -> Array:
    """The numbers of the particles that `core.particle.run` keeps."""
    return thinned(N, DRAWN)


def _side(stations: Array) -> Side:
    """Normal to the line through the first two stations, turned towards +x2 (where the true track ends)."""
    along = stations[1] - stations[0]
    length = float(np.linalg.norm(along))
    normal = np.array([-along[1], along[0]]) / length if length > 0.0 else np.array([0.0, 1.0])
    normal = -normal if normal[1] < 0.0 else normal
    return Side(normal, float(normal @ stations[0]))


def timeline(p: Params) -> Timeline:
    """Forty seconds; the end, where the filters disagree, is shown first."""
    return Timeline(STEPS, ("predict", "weigh", "estimate", "resample"), start=STEPS, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("MAT 3.5.2", "MAT Algorithm 5", "MAT Algorithm 6", "MAT Example 22", "MAT Figure 3.3", "MAT 3.3.1"),
    presets={
        "Example 22": {},
        "third base station": {"third_station": True, "zoom": "stations"},
        "SIS: no resampling": {"sampling": "sis"},
        "few particles": {"n_particles": 110},
        "a million particles": {"n_particles": 1_000_000},
    },
)
