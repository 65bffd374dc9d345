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
VELOCITY = (3.0, 3.0)                    # m/s, mean of the start in the velocity model: Example 22
GIVEN = (118.0, 390.0)                   # m, the first ranges of the worked update
KAPPAS = np.linspace(-1.8, 8.0, 50)
FINE = 160                               # cells per axis of the exact first update


@dataclass(frozen=True, slots=True)
class Params:
    """Geometry and noise; every filter knows them."""

    model: str = choice("walk", ("walk", "velocity"), group="world")
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
    sigma_c: float = slider(1.0, low=0.1, high=5.0, step=0.1, unit="m/s/√s", group="more")
    start_sigma_mps: float = slider(5.0, low=1.0, high=8.0, step=0.5, unit="m/s", group="more")
    truth: str = choice("drawn", ("drawn", "straight"), group="more")
    first: str = choice("drawn", ("drawn", "given"), group="more")
    zoom: str = choice("stations", ("stations", "track"), group="view")


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
    stations = np.array([p.station_1, p.station_2, p.station_3])[:p.stations]
    motion, sensor = motion_of(p), Range(stations, p.sigma_m)
    initial = start_of(p)
    truth = np.empty((STEPS + 1, RUNS, len(initial.mean)))
    truth[0] = sample(initial, RUNS, begin)
    for k in range(STEPS):
        truth[k + 1] = motion.sample(truth[k], move)
    if straight(p):
        truth[:, 0] = initial.mean
        truth[:, 0, :2] += np.arange(STEPS + 1)[:, None] * initial.mean[2:]
    # Three columns always, so that another station changes neither the track nor the other ranges' errors.
    y = sensor.h(truth[1:]) + p.sigma_m * measure.standard_normal((STEPS, RUNS, 3))[..., :p.stations]
    if given(p):
        y[0, 0] = GIVEN

    every = [extended.run(initial, y, motion, sensor).posterior,
             unscented.run(initial, y, motion, sensor, p.kappa).posterior]
    ekf = extended.run(initial, y[:, 0], motion, sensor)
    ukf = unscented.run(initial, y[:, 0], motion, sensor, p.kappa)
    progress(0.1)
    exact = on_grid(p, initial, y[:, 0], motion, sensor, lambda done: progress(0.1 + 0.7 * done))
    laws = [position(ekf.posterior), position(ukf.posterior),
            Gaussian(exact.law.mean[1:], exact.law.cov[1:])]
    first = first_update(p, ekf.prior, every, y[0], truth[1], sensor, progress)
    return Result(
        stations, truth[:, 0], y[:, 0], initial, ekf, ukf, exact, first,
        np.array([np.sqrt(np.square(g.mean - truth[1:, 0, :2]).sum(axis=-1)) for g in laws]),
        np.array([metrics.nees(g, truth[1:, 0, :2]) for g in laws]),
        np.array([metrics.nees(position(g), truth[1:, :, :2]).mean(axis=1) for g in every]),
        metrics.consistency_band(0.95, 2, RUNS))


def motion_of(p: Params) -> LinearMotion:
    return constant_position(1.0, p.sigma_walk, 2) if p.model == "walk" else constant_velocity(1.0, p.sigma_c, 2)


def start_of(p: Params) -> Gaussian:
    """What is known at t = 0, without any measurement."""
    if p.model == "walk":
        return Gaussian(np.array(p.start), p.start_sigma_m**2 * np.eye(2))
    sigma = np.repeat([p.start_sigma_m, p.start_sigma_mps], 2)
    return Gaussian(np.array([*p.start, *VELOCITY]), np.diag(sigma**2))


def straight(p: Params) -> bool:
    """Is the shown track the mean of the start, moved on without noise?"""
    return p.model == "velocity" and p.truth == "straight"


def given(p: Params) -> bool:
    return p.first == "given" and p.stations == 2


def position(g: Gaussian) -> Gaussian:
    """The marginal law of the first two components."""
    return Gaussian(g.mean[..., :2], g.cov[..., :2, :2])


def counts(p: Params) -> tuple[int, ...]:
    """Cells per axis: a standard deviation of the ranges is at least 1.2 cells, as long as the work allows it.

    With velocities the grid has four axes.  Most cells go across the line of the stations, where there may be two
    peaks.
    """
    if p.model == "walk":
        n = int(np.clip(12.0 * p.start_sigma_m / p.sigma_m, 60, 200))
        return n, n
    least = int(np.clip(8.0 * p.start_sigma_m / p.sigma_m, 16, 28))
    along = np.abs(np.subtract(p.station_2, p.station_1))
    across = along[::-1] / max(float(np.linalg.norm(along)), 1e-9) if p.stations == 2 else np.full(2, 0.5)
    n, m = (round(least + (48 - least) * float(share)) for share in across)
    return (n, m, 12, 16) if m >= n else (n, m, 16, 12)


def on_grid(p: Params, initial: Gaussian, y: Array, motion: LinearMotion, sensor: Range, progress: Progress) -> Exact:
    """The point-mass filter on a grid that follows the density."""
    shape, width = counts(p), 5.0 if p.model == "walk" else 4.0
    density = grid.from_gaussian(initial, grid.gaussian_axes(initial, shape, width))
    start = grid.marginal(density, (0, 1))
    axes, before, after, laws, lost, cell = [start.axes], [start.weights], [start.weights], [position(initial)], 0.0, 0.0
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
    p: Params, prior: Gaussian, every: list[Gaussian], y: Array, truth: Array, sensor: Range, progress: Progress
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
    """Parameters of the other model, stations that are not there, and what needs two stations."""
    found = ["sigma_c", "start_sigma_mps", "truth"] if p.model == "walk" else ["sigma_walk"]
    found += [f"station_{i}" for i in range(p.stations + 1, 4)]
    return tuple(found + ([] if p.stations == 2 else ["first"]))


def timeline(p: Params) -> Timeline:
    """Step 1, where all three start from the same prior, is shown first."""
    return Timeline(STEPS, ("predict", "measure", "linearise", "update"), start=1, unit="s")


EXAMPLE_22 = {
    "model": "velocity", "start": (-150.0, -30.0), "station_1": (-250.0, 0.0), "station_2": (250.0, 0.0),
    "start_sigma_m": 20.0, "sigma_m": 10.0, "kappa": -1.0, "truth": "straight",
}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=3.0,
    refs=("MAT 3.3", "MAT (3.15)", "MAT Algorithm 4", "MAT exercise 3.14", "MAT Example 22", "MAT 3.5"),
    presets={
        "two stations, one update": {},
        "the whole track": {"step": STEPS},
        "one station": {"stations": 1},
        "three stations": {"stations": 3, "step": STEPS},
        "far away": {"start": (90.0, 260.0), "start_sigma_m": 20.0, "sigma_m": 10.0},
        "Example 22, y₁ = [118, 390]": {**EXAMPLE_22, "first": "given", "zoom": "track"},
        "Example 22, the track": {**EXAMPLE_22, "seed": 2681, "step": STEPS},
    },
)
