"""[x; b] = p lambda + q and one quadratic for lambda = |x|^2 - b^2.  MAT 2.2, Example 15, exercise 2.8."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.closed_form import ClosedForm
from core.types import Array
from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider
from lessons.static import _closed_form_globe, _closed_form_plane
from lessons.static._closed_form_model import (
    EXPERIMENTS,
    Problem,
    Spread,
    closed,
    from_afar,
    iterated,
    measurements,
    nearest,
    problem_of,
    spread,
)

STAGES = ("measure", "square", "line", "roots", "tests")


def _satellite(x: float, y: float, z: float) -> Point:
    return draggable((x, y, z), low=-30.0, high=30.0, unit="1000 km", plane="sphere", role="satellite",
                     group="satellites")


def _station(x: float, y: float) -> Point:
    return draggable((x, y), low=-100.0, high=200.0, role="station", group="stations")


def _error(metres: float) -> float:
    return slider(metres, low=-60.0, high=60.0, step=1.0, unit="m", group="stations")


@dataclass(frozen=True, slots=True)
class Params:
    """Pseudoranges to satellites (Bancroft), or ranges to stations in the plane (exercise 2.8)."""

    mode: str = choice("globe", ("globe", "plane"))
    count: int = slider(4, low=4, high=6, group="satellites")
    clock_km: float = slider(85.347, low=-300.0, high=300.0, unit="km", group="satellites")
    user: Point = draggable((2.79515588, 1.236075421, 5.579601908), low=-49.5, high=49.5, unit="1000 km",
                            plane="sphere", role="truth", group="satellites")
    sat_1: Point = _satellite(1.561016, 8.022563, 25.271235)
    sat_2: Point = _satellite(8.791963, 22.580941, 10.873643)
    sat_3: Point = _satellite(23.130183, 0.619064, 13.040131)
    sat_4: Point = _satellite(5.194061, -18.801008, 18.02713)
    sat_5: Point = _satellite(7.594037, 2.357346, 25.341806)
    sat_6: Point = _satellite(-8.457812, 20.944868, 13.971811)
    stations: int = slider(2, low=2, high=3, group="stations")
    place: Point = draggable((0.0, 0.0), low=-100.0, high=200.0, role="truth", group="stations")
    station_1: Point = _station(100.0, 0.0)
    station_2: Point = _station(0.0, 50.0)
    station_3: Point = _station(120.0, 120.0)
    error_1_m: float = _error(8.0)
    error_2_m: float = _error(-4.0)
    error_3_m: float = _error(0.0)
    sigma_m: float = slider(10.0, low=0.1, high=1e5, unit="m", log=True, group="noise")
    seed: int = seed(group="noise")


class Result(NamedTuple):
    """Row 0 of every array are the given measurements, rows 1, 2, ... the experiments with new errors."""

    problem: Problem
    y: Array                     # (EXPERIMENTS + 1, m) m
    fix: ClosedForm | None       # of all of them; None where the geometry has no closed form
    chosen: Array                # (EXPERIMENTS + 1, n) the root that is taken; NaN where none is admissible
    gauss_newton: Array          # (EXPERIMENTS + 1, n) m; NaN where it does not converge
    approach: Array              # (k + 1,) m: error of the iterates for row 0, from far away
    spread: Spread | None        # rms errors over the noise


def compute(p: Params, progress: Progress) -> Result:
    """Both methods on the given measurements and on the experiments."""
    problem = problem_of(p)
    y = measurements(problem, p)
    fix = closed(problem, y)
    progress(0.2)
    n = problem.stations_m.shape[1]
    chosen = np.full((len(y), n), np.nan) if fix is None else nearest(problem, fix)
    iterates = iterated(problem, y)
    progress(0.5)
    return Result(problem, y, fix, chosen, iterates, from_afar(problem, y[0]),
                  None if fix is None else spread(problem, p.seed, progress))


def view(p: Params, r: Result, at: Moment) -> View:
    """The globe or the plane."""
    return _closed_form_globe.view(p, r, at) if p.mode == "globe" else _closed_form_plane.view(p, r, at)


def timeline(p: Params) -> Timeline:
    """Step 0: the given measurements; then one experiment with new errors after the other."""
    return Timeline(EXPERIMENTS, STAGES, unit_name="experiment")


def unused(p: Params) -> set[str]:
    """What belongs to the other picture, and satellites and stations that are not measured."""
    globe = {"count", "clock_km", "user", *(f"sat_{i}" for i in range(1, 7))}
    plane = {"stations", "place", *(f"station_{i}" for i in (1, 2, 3)), *(f"error_{i}_m" for i in (1, 2, 3))}
    if p.mode == "plane":
        return globe | ({"station_3", "error_3_m"} if p.stations == 2 else set())
    return plane | {f"sat_{i}" for i in range(p.count + 1, 7)}


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.2", "MAT Example 15", "MAT (2.2)", "MAT exercise 2.8"),
    presets={
        "Example 15: four satellites": {},
        "five satellites": {"count": 5},
        "the second root in outer space": {"user": (8.7885, 3.8864, 17.5433)},
        "a rocket beyond the satellites": {"user": (24.17, 10.69, 48.24)},
        "noise: against Gauss-Newton": {"count": 6, "sigma_m": 10.0, "step": EXPERIMENTS},
        "exercise 2.8: two ranges": {"mode": "plane"},
        "circles that do not meet": {"mode": "plane", "error_1_m": -30.0, "error_2_m": -20.0},
        "two ranges, noise": {"mode": "plane", "place": (35.0, 20.0), "error_1_m": 0.0, "error_2_m": 0.0,
                              "sigma_m": 10.0, "step": EXPERIMENTS},
        "three ranges: not the same estimate": {"mode": "plane", "stations": 3, "sigma_m": 10.0, "step": EXPERIMENTS},
    },
)
