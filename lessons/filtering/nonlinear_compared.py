"""EKF, UKF and grid on identical measurements: one update, then a whole track.

MAT 3.3, (3.15), Algorithm 4, exercise 3.14, with the grid of 3.5 as the exact answer.  The notes' data for the
exercise are no longer published, so tracks are drawn here, or taken from the scenario of Example 22.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import extended, grid, kalman, metrics, unscented
from core.gaussian import sample
from core.motion import LinearMotion, constant_position, constant_velocity
from core.sensors import Range
from core.types import Array, Gaussian
from lessons.filtering._compared_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

STEPS = 20
RUNS = 200                               # draws behind the mean NEES; the first one is shown
START_22 = Gaussian(np.array([-150.0, -30.0, 3.0, 3.0]), np.diag([20.0, 20.0, 5.0, 5.0])**2)
STATIONS_22 = np.array([[-250.0, 0.0], [250.0, 0.0]])
SIGMA_22 = 10.0                          # m, of a range
COUNTS_22 = (16, 48, 12, 16)             # most cells across the line of the stations, where two peaks come
GIVEN = (118.0, 390.0)                   # m, the first ranges of the worked update
KAPPAS = np.linspace(-1.8, 8.0, 50)
FINE = 160                               # cells per axis of the exact first update


@dataclass(frozen=True, slots=True)
class Params:
    """Geometry and noise, known to every filter; Example 22 brings its own."""

    world: str = choice("walk", ("walk", "example_22"), group="world")
    stations: int = slider(2, low=1, high=3, group="world")
    start_sigma_m: float = slider(35.0, low=5.0, high=60.0, step=1.0, unit="m", group="world")
    sigma_m: float = slider(5.0, low=3.0, high=30.0, step=0.5, unit="m", group="world")
    kappa: float = slider(1.0, low=-1.9, high=8.0, step=0.1, group="world")
    seed: int = seed(40, group="world")
    start: Point = draggable((20.0, 45.0), low=-300.0, high=300.0, role="prior", group="more")
    station_1: Point = draggable((0.0, 0.0), low=-400.0, high=400.0, role="station", group="more")
    station_2: Point = draggable((120.0, 0.0), low=-400.0, high=400.0, role="station", group="more")
    station_3: Point = draggable((60.0, 130.0), low=-400.0, high=400.0, role="station", group="more")
    sigma_walk: float = slider(5.0, low=0.5, high=20.0, step=0.5, unit="m/√s", group="more")
    truth: str = choice("straight", ("straight", "drawn"), group="more")
    first: str = choice("drawn", ("drawn", "given"), group="more")
    zoom: str = choice("track", ("track", "stations"), group="view")


class Exact(NamedTuple):
    """The grid filter along the track, its positions only; time runs over 0..STEPS, the start included."""

    law: Gaussian                # (STEPS + 1, 2), (STEPS + 1, 2, 2) mean and covariance of the position
    axes: tuple[tuple[Array, Array], ...]
    prior: tuple[Array, ...]     # (n_x, n_y) probabilities of the cells before the measurement
    posterior: tuple[Array, ...]
    lost: float                  # probability cut off at the edges, all steps
    cell_m: float                # the cells' size across a range where it mattered most, step 1


class First(NamedTuple):
    """The update of step 1, where all filters have the same prior."""

    exact: Gaussian              # moments of the position
    sweep: Array                 # (k, 2) |mean - exact| in m and sd ratio of the UKF at KAPPAS
    ekf: Array                   # (2,) the same of the EKF
    mean_nees: Array             # (3,) EKF, UKF, grid: mean over RUNS draws, 2 degrees of freedom


class Result(NamedTuple):
    """Three filters on the same draw, and how honest they are over many."""

    stations: Array              # (s, 2)
    sigma_m: float               # of a range
    truth: Array                 # (STEPS + 1, n)
    y: Array                     # (STEPS, s)
    initial: Gaussian
    ekf: kalman.Update           # every field (STEPS, ...)
    ukf: unscented.UnscentedUpdate
    exact: Exact
    first: First
    errors: Array                # (3, STEPS) position errors of EKF, UKF, grid mean
    nees: Array                  # (3, STEPS) of the position, 2 degrees of freedom
    mean_nees: Array             # (2, STEPS) EKF, UKF: mean over RUNS draws
    band: tuple[float, float]    # where 95 % of such means lie for an honest filter


def compute(p: Params, progress: Progress) -> Result:
    """Draws RUNS tracks and measurements, filters all of them, and the first also on a grid."""
    begin, move, measure = np.random.default_rng(p.seed).spawn(3)
    initial, motion, sensor = model(p)
    truth = np.empty((STEPS + 1, RUNS, len(initial.mean)))
    truth[0] = sample(initial, RUNS, begin)
    for k in range(STEPS):
        truth[k + 1] = motion.sample(truth[k], move)
    if p.world == "example_22" and p.truth == "straight":
        truth[:, 0] = initial.mean
        truth[:, 0, :2] += np.arange(STEPS + 1)[:, None] * initial.mean[2:]
    # Three columns always, so that another station changes neither the track nor the other ranges' errors.
    noise = measure.standard_normal((STEPS, RUNS, 3))[..., :len(sensor.R)]
    y = sensor.h(truth[1:]) + np.sqrt(np.diagonal(sensor.R)) * noise
    if p.world == "example_22" and p.first == "given":
        y[0, 0] = GIVEN

    every = [extended.run(initial, y, motion, sensor).posterior,
             unscented.run(initial, y, motion, sensor, p.kappa).posterior]
    ekf = extended.run(initial, y[:, 0], motion, sensor)
    ukf = unscented.run(initial, y[:, 0], motion, sensor, p.kappa)
    progress(0.1)
    exact = on_grid(p, initial, y[:, 0], motion, sensor, lambda done: progress(0.1 + 0.7 * done))
    laws = [position(ekf.posterior), position(ukf.posterior),
            Gaussian(exact.law.mean[1:], exact.law.cov[1:])]
    first = first_update(ekf.prior, every, y[0], truth[1], sensor, progress)
    return Result(
        sensor.stations_m, float(np.sqrt(sensor.R[0, 0])), truth[:, 0], y[:, 0], initial, ekf, ukf, exact, first,
        np.array([np.sqrt(np.square(g.mean - truth[1:, 0, :2]).sum(axis=-1)) for g in laws]),
        np.array([metrics.nees(g, truth[1:, 0, :2]) for g in laws]),
        np.array([metrics.nees(position(g), truth[1:, :, :2]).mean(axis=1) for g in every]),
        metrics.consistency_band(0.95, 2, RUNS))


def model(p: Params) -> tuple[Gaussian, LinearMotion, Range]:
    """What is known at t = 0 s without any measurement, how the state moves in 1 s, and the sensor."""
    if p.world == "example_22":
        return START_22, constant_velocity(1.0, 1.0, 2), Range(STATIONS_22, SIGMA_22)
    stations = np.array([p.station_1, p.station_2, p.station_3])[:p.stations]
    start = Gaussian(np.array(p.start), p.start_sigma_m**2 * np.eye(2))
    return start, constant_position(1.0, p.sigma_walk, 2), Range(stations, p.sigma_m)


def position(g: Gaussian) -> Gaussian:
    """The marginal law of the first two components."""
    return Gaussian(g.mean[..., :2], g.cov[..., :2, :2])


def counts(p: Params) -> tuple[int, ...]:
    """Cells per axis: where the grid is widest, a cell is still smaller than a standard deviation of the ranges."""
    if p.world == "example_22":
        return COUNTS_22
    n = int(np.clip(16.0 * p.start_sigma_m / p.sigma_m, 60, 200))
    return n, n


def on_grid(p: Params, initial: Gaussian, y: Array, motion: LinearMotion, sensor: Range, progress: Progress) -> Exact:
    """The point-mass filter on a grid that follows the density."""
    shape, width = counts(p), 5.0 if len(initial.mean) == 2 else 4.0
    density = grid.from_gaussian(initial, grid.gaussian_axes(initial, shape, width))
    start = grid.marginal(density, (0, 1))
    axes, before, after, laws = [start.axes], [start.weights], [start.weights], [position(initial)]
    lost, cell = 0.0, 0.0
    for k in range(STEPS):
        # One step at a time: a four-dimensional density is large, and only its positions are drawn.
        step = grid.run(density, y[k:k + 1], motion, sensor, width=width, components=(0, 1))
        update = step.updates[0]
        density = update.posterior
        here = grid.marginal(density, (0, 1))
        axes.append(here.axes)
        before.append(grid.marginal(update.prior, (0, 1)).weights)
        after.append(here.weights)
        laws.append(Gaussian(step.means[0, :2], step.covs[0, :2, :2]))
        lost += float(step.lost[0])
        cell = max(cell, float(here.spacing.min()))
        progress((k + 1) / STEPS)
    law = Gaussian(np.array([g.mean for g in laws]), np.array([g.cov for g in laws]))
    return Exact(law, tuple(axes), tuple(before), tuple(after), lost, cell)


def first_update(
    prior: Gaussian, every: list[Gaussian], y: Array, truth: Array, sensor: Range, progress: Progress
) -> First:
    """Step 1 on a fine grid of positions, which is exact: the ranges do not depend on the velocity.

    prior (STEPS, ...) of the shown run; every: posteriors (STEPS, RUNS, ...) of EKF and UKF; y (RUNS, s).
    """
    here = Gaussian(prior.mean[0], prior.cov[0])
    flat = grid.from_gaussian(position(here), grid.gaussian_axes(position(here), FINE, 6.0))
    exact = grid.moments(grid.update(flat, y[0], sensor).posterior)
    coarse = grid.from_gaussian(position(here), grid.gaussian_axes(position(here), FINE // 2, 5.0))
    laws = [grid.moments(grid.update(coarse, one, sensor).posterior) for one in y]
    progress(0.95)
    grids = Gaussian(np.array([g.mean for g in laws]), np.array([g.cov for g in laws]))
    firsts = [Gaussian(g.mean[0, :, :2], g.cov[0, :, :2, :2]) for g in every] + [grids]
    nees = np.array([metrics.nees(g, truth[:, :2]).mean() for g in firsts])
    sweep = np.array([_distance(unscented.update(here, y[0], sensor, kappa).posterior, exact) for kappa in KAPPAS])
    return First(exact, sweep, _distance(extended.update(here, y[0], sensor).posterior, exact), nees)


def _distance(g: Gaussian, exact: Gaussian) -> Array:
    """|mean - exact mean| in m, and the claimed size sqrt(tr P) over the exact one, of the position."""
    return np.array([np.linalg.norm(g.mean[:2] - exact.mean), np.sqrt(np.trace(g.cov[:2, :2]) / np.trace(exact.cov))])


def unused(p: Params) -> tuple[str, ...]:
    """What the other world needs, and stations that are not there."""
    if p.world == "example_22":
        return ("stations", "start_sigma_m", "sigma_m", "start", "station_1", "station_2", "station_3", "sigma_walk")
    return ("truth", "first", *(f"station_{i}" for i in range(p.stations + 1, 4)))


def timeline(p: Params) -> Timeline:
    """Step 1, where all three start from the same prior, is shown first."""
    return Timeline(STEPS, ("predict", "measure", "linearise", "update"), start=1, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=3.0,
    refs=("MAT 3.3", "MAT (3.15)", "MAT Algorithm 4", "MAT exercise 3.14", "MAT Example 22", "MAT 3.5"),
    presets={
        "two stations, one update": {},
        "the whole track": {"step": STEPS},
        "one station": {"stations": 1},
        "three stations": {"stations": 3, "step": STEPS},
        "far away": {"start": (90.0, 260.0), "start_sigma_m": 20.0, "sigma_m": 10.0},
        "Example 22, y₁ = [118, 390]": {"world": "example_22", "kappa": -1.0, "first": "given"},
        "Example 22, the track": {"world": "example_22", "kappa": -1.0, "seed": 2681, "step": STEPS},
    },
)
