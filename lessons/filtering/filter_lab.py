"""The same truth and the same noise for every filter: tracks, ellipses, NEES, and many runs on request.

MAT chapter 3, Examples 20 and 22, exercise 3.14.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import metrics, particle, study
from core.gaussian import chi_square_level
from core.mixture import Upkeep
from core.mixture import run as run_mixture
from core.types import Array, Gaussian
from lessons.filtering._lab_view import view
from lessons.filtering._lab_worlds import NAMES, STEPS, World, world
from lessons.filtering._with_start import with_start
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider, switch

FILTERS = ("kf", "ekf", "ukf", "pf", "mixture", "grid")
DRAWN = 800                              # particles kept for the picture
ENTRIES = (0, 1)                         # errors, NEES and coverage are those of the position
GRID_WIDTH = 4.0
LOST_OUTSIDE = 0.999                     # of the filter's own law


@dataclass(frozen=True, slots=True)
class Params:
    """A scenario and the filters that take part."""

    scenario: str = choice("example_22", NAMES, group="world")
    truth: str = choice("straight", ("straight", "drawn"), group="world")
    seed: int = seed(20, group="world")
    runs: int = slider(0, low=0, high=500, step=10, group="world")
    kf: bool = switch(False, group="filters")
    ekf: bool = switch(True, group="filters")
    ukf: bool = switch(True, group="filters")
    pf: bool = switch(True, group="filters")
    mixture: bool = switch(True, group="filters")
    grid: bool = switch(False, group="filters")
    n_particles: int = slider(2000, low=100, high=20_000, log=True, group="more")
    kappa: float = slider(-1.0, low=-1.9, high=8.0, step=0.1, group="more")
    components: int = slider(16, low=1, high=40, group="more")


class Track(NamedTuple):
    """One filter on the shown measurements; time runs over 0..STEPS, the start included."""

    law: Gaussian                # (STEPS + 1, n), (STEPS + 1, n, n)
    error: Array                 # (STEPS + 1,) of the position, in m
    nees: Array                  # (STEPS + 1,) of the position
    work: float                  # values of h(x) per step; 0: as many as its fix needs


class Many(NamedTuple):
    """One filter over many runs; errors of the position."""

    rmse: Array                  # (STEPS,) over the runs
    total_rmse: float            # over runs and steps
    mean_nees: Array             # (STEPS,)
    coverage: Array              # (2,) share of the truths in the 68 % and 95 % ellipses, over runs and steps
    lost: float                  # share of runs that end far from the truth and do not know it


class Result(NamedTuple):
    """The shown run filter by filter, and the many runs if there are any."""

    world: World
    truth: Array                 # (STEPS + 1, n)
    y: Array                     # (STEPS, m)
    tracks: dict[str, Track]
    clouds: Array                # (STEPS + 1, M, 2) particles as weighted before resampling; M = 0 without them
    weights: Array               # (STEPS + 1, M)
    n_eff: Array                 # (STEPS + 1,); empty without particles
    parts: tuple[tuple[Array, Array], ...]   # per time: means (c, 2) and weights (c,) of the mixture
    many: dict[str, Many]
    band: tuple[float, float]    # 95 % band of the mean NEES over the runs


def compute(p: Params, progress: Progress) -> Result:
    """Draws one run and `runs` more, and gives them to the chosen filters."""
    w = world(p.scenario)
    one, more, cloud, others = np.random.default_rng(p.seed).spawn(4)
    shown = draw(p, w, 1, one)
    states, y = np.vstack([shown.initial, shown.states[0]]), shown.ys[0]
    chosen = [name for name in FILTERS if getattr(p, name) and (name != "grid" or w.cells)]
    share = 1.0 if p.runs == 0 else 0.2
    laws, work, parts = {}, {}, ()
    clouds, weights, n_eff = np.empty((STEPS + 1, 0, 2)), np.empty((STEPS + 1, 0)), np.empty(0)
    for name in chosen:
        if name == "pf":
            run = particle.run(w.initial, y, w.motion, w.sensor, p.n_particles, cloud, subsample=DRAWN)
            laws[name], work[name] = Gaussian(run.mean, run.cov), p.n_particles
            equal = np.full((1, len(run.index)), 1.0 / len(run.index))
            clouds = np.concatenate([run.initial[None, :, :2], run.predicted[..., :2]])
            weights, n_eff = np.concatenate([equal, run.weights_before]), np.append(p.n_particles, run.n_eff)
        elif name == "mixture":
            mix = run_mixture(w.initial, y, w.motion, w.sensor, upkeep(p, w))
            laws[name] = Gaussian(mix.means, mix.covs)
            work[name] = float(np.mean([s.update.prior.log_weights.size for s in mix.steps]))
            parts = ((w.initial.mean[None, :2], np.ones(1)),
                     *((s.posterior.means[:, :2], s.posterior.weights) for s in mix.steps))
        else:
            job = study.Job(w.initial, y[None], w.motion, w.sensor, cloud,
                            lambda done: progress(share * (0.1 + 0.9 * done)) if p.grid else None)
            law = filters(p, w)[name](job)
            laws[name] = Gaussian(law.mean[0], law.cov[0])
            n = len(w.initial.mean)
            work[name] = {"ekf": 1, "ukf": 2 * n + 1, "kf": 0}.get(name, float(np.prod(w.cells[:2])))
    progress(share)
    tracks = {name: _track(w, laws[name], states, float(work[name])) for name in chosen}
    many, band = study_of(p, w, [n for n in chosen if n != "grid"], more, others,
                          lambda done: progress(share + (1.0 - share) * done))
    return Result(w, states, y, tracks, clouds, weights, n_eff, parts, many, band)


def draw(p: Params, w: World, runs: int, rng: np.random.Generator) -> study.Truth:
    """Tracks and measurements: the same straight track for all runs, or a track of the model for each."""
    if p.truth == "drawn":
        return study.simulate(w.initial, w.motion, w.sensor, STEPS, runs, rng)
    track = [w.initial.mean]
    for _ in range(STEPS):
        track.append(w.motion.f(track[-1]))
    states = np.broadcast_to(np.array(track[1:]), (runs, STEPS, len(track[0])))
    return study.Truth(np.broadcast_to(track[0], (runs, len(track[0]))), states, study.observe(states, w.sensor, rng))


def upkeep(p: Params, w: World) -> Upkeep:
    """The mixture splits what is long compared with the curvature of h, and keeps a limited number of components."""
    return Upkeep(split_beyond=w.split_m, entries=ENTRIES, max_components=p.components)


def filters(p: Params, w: World) -> dict[str, study.Filter]:
    """Every filter with this lesson's settings."""
    found = {
        "kf": study.position_filter(w.fix_dim), "ekf": study.extended_filter(), "ukf": study.unscented_filter(p.kappa),
        "pf": study.particle_filter(p.n_particles), "mixture": study.mixture_filter(upkeep(p, w)),
    }
    return {**found, "grid": study.grid_filter(w.cells, width=GRID_WIDTH, components=ENTRIES)} if w.cells else found


def _track(w: World, law: Gaussian, states: Array, work: float) -> Track:
    whole = with_start(w.initial, law)
    here = Gaussian(whole.mean[:, :2], whole.cov[:, :2, :2])
    error = np.sqrt(np.square(here.mean - states[:, :2]).sum(axis=1))
    return Track(whole, error, metrics.nees(here, states[:, :2]), work)


def study_of(
    p: Params, w: World, names: list[str], rng: np.random.Generator, noise: np.random.Generator, progress: Progress
) -> tuple[dict[str, Many], tuple[float, float]]:
    """The many runs; the grid stays out of them, because one of its runs takes as long as a hundred of the others."""
    if p.runs == 0 or not names:
        return {}, (0.0, 0.0)
    known = filters(p, w)
    found = study.monte_carlo(
        {name: known[name] for name in names}, w.initial, w.motion, w.sensor, truth=draw(p, w, p.runs, rng),
        rng=noise, lost_beyond=w.lost_beyond_m, entries=ENTRIES, progress=progress)
    # A mean between two peaks is far off too, but its ellipse says so: lost is who is far off and outside the ellipse.
    beyond = chi_square_level(LOST_OUTSIDE, len(ENTRIES))
    many = {
        name: Many(r.rmse, float(np.sqrt(np.square(r.rmse).mean())), r.mean_nees, r.coverage.mean(axis=0),
                   float((r.failed | (r.lost & (r.nees[:, -1] > beyond))).mean()))
        for name, r in found.results.items()
    }
    return many, metrics.consistency_band(0.95, len(ENTRIES), p.runs)


def unused(p: Params) -> tuple[str, ...]:
    """Settings of filters that do not take part."""
    found = [setting for name, setting in (("pf", "n_particles"), ("ukf", "kappa"), ("mixture", "components"))
             if not getattr(p, name)]
    return (*found, "grid") if p.scenario == "gnss" else tuple(found)


def timeline(p: Params) -> Timeline:
    """Forty seconds; the end is shown first."""
    return Timeline(STEPS, start=STEPS, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=1.5,
    refs=("MAT chapter 3", "MAT Example 20", "MAT Example 22", "MAT exercise 3.14", "MAT 3.3", "MAT 3.5"),
    presets={
        "Example 22": {},
        "Example 22, 200 runs": {"runs": 200, "n_particles": 1000, "mixture": False},
        "Example 20": {"scenario": "example_20", "truth": "drawn", "kf": True, "n_particles": 5000, "seed": 1},
        "three stations": {"scenario": "three_stations", "kf": True},
        "bearings only": {"scenario": "bearings", "truth": "drawn", "kf": True, "seed": 3, "runs": 100,
                          "mixture": False, "n_particles": 1000},
        "GNSS with clock": {"scenario": "gnss", "truth": "drawn", "kf": True, "mixture": False, "seed": 1},
        "with the grid": {"grid": True},
    },
)
