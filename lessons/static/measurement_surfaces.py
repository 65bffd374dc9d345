"""y = h(x) + v: every measurement is a curve or a surface of possible places.  MAT 2.1, Example 14, Fig 2.1."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.types import Array
from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider, switch
from lessons.static import _surfaces_plane, _surfaces_space
from lessons.static._surfaces_model import KINDS, Row, bias_curve, radar_curve, rows_of, standard_errors

BIASES_M = np.arange(0.0, 81.0)              # assumed clock biases, one a step
TIMES_S = 0.1 * np.arange(0.0, 64.0)         # one turn of the radar's arm, 1 rad/s


def _station(x: float, y: float) -> Point:
    return draggable((x, y), low=-100.0, high=200.0, role="station", group="points")


def _height(metres: float) -> float:
    return slider(metres, low=0.0, high=150.0, step=1.0, unit="m", group="points")


@dataclass(frozen=True, slots=True)
class Params:
    """Up to three measurements, each with its own station (a radar makes two), and the truth behind them."""

    space: str = choice("plane", ("plane", "space"))
    first: str = choice("pseudorange", KINDS[1:])
    second: str = choice("pseudorange", KINDS[:-1])
    third: str = choice("pseudorange", KINDS[:-1])
    bias_m: float = slider(20.0, low=0.0, high=60.0, step=1.0, unit="m")
    user: Point = draggable((30.0, 40.0), low=-100.0, high=200.0, role="truth", group="points")
    station_1: Point = _station(0.0, 0.0)
    station_2: Point = _station(70.0, 0.0)
    station_3: Point = _station(10.0, 95.0)
    height_m: float = _height(20.0)
    height_1_m: float = _height(0.0)
    height_2_m: float = _height(30.0)
    height_3_m: float = _height(60.0)
    velocity_1_mps: float = slider(1.0, low=-5.0, high=5.0, step=0.1, unit="m/s", group="radar")
    velocity_2_mps: float = slider(-0.5, low=-5.0, high=5.0, step=0.1, unit="m/s", group="radar")
    arm_m: float = slider(1.0, low=0.0, high=20.0, step=0.5, unit="m", group="radar")
    sigma_m: float = slider(2.0, low=0.1, high=20.0, unit="m", log=True, group="errors")
    sigma_deg: float = slider(3.0, low=0.1, high=20.0, unit="°", log=True, group="errors")
    sigma_mps: float = slider(0.05, low=0.01, high=1.0, unit="m/s", log=True, group="errors")
    noisy: bool = switch(False, group="errors")
    seed: int = seed(group="errors")


class Result(NamedTuple):
    """What does not depend on where the timeline stands."""

    errors: Array                # (ROWS,) standard normal, zero without noise
    misfit_m: Array | None       # (BIASES_M,) rms misfit of the best place for each assumed bias
    radar: Array | None          # (TIMES_S, 2) range in m and range rate in m/s of the radar


def compute(p: Params, progress: Progress) -> Result:
    """The errors, and how well the measurements can be explained with each assumed clock bias."""
    errors = standard_errors(p)
    progress(0.1)
    return Result(errors, bias_curve(p, errors, BIASES_M), radar_curve(p, TIMES_S))


def state_at(p: Params, r: Result, step: int) -> tuple[list[Row], float, float]:
    """The measurements at this step, the assumed clock bias in m, and the time in s."""
    if p.first == "radar":
        time_s = float(TIMES_S[min(step, len(TIMES_S) - 1)])
        return rows_of(p, r.errors, time_s), p.bias_m, time_s
    assumed = float(BIASES_M[min(step, len(BIASES_M) - 1)])
    return rows_of(p, r.errors, 0.0), assumed, 0.0


def view(p: Params, r: Result, at: Moment) -> View:
    """Curves in the plane, or surfaces in space."""
    rows, assumed, time_s = state_at(p, r, at.step)
    draw = _surfaces_plane.view if p.space == "plane" else _surfaces_space.view
    return draw(p, r, at, rows, assumed, time_s)


def timeline(p: Params) -> Timeline:
    """The arm of a radar turns, or the assumed clock bias grows; else nothing moves."""
    stages = ("truth", "measure", "surface", "meet")
    chosen = (p.first, p.second, p.third)
    if p.first == "radar":
        return Timeline(len(TIMES_S) - 1, stages, scale=0.1, unit="s")
    if "pseudorange" in chosen:
        return Timeline(len(BIASES_M) - 1, stages, unit="m", unit_name="assumed b")
    return Timeline(0, stages)


def unused(p: Params) -> set[str]:
    """Stations, heights, sigmas and motion that none of the chosen measurements needs."""
    chosen = (p.first, p.second, p.third)
    needed = {i for i, kind in enumerate(chosen) if kind in ("range", "pseudorange", "difference", "bearing", "radar")}
    needed |= {(i + 1) % 3 for i, kind in enumerate(chosen) if kind == "difference"}
    found = {f"{name}_{i + 1}{unit}" for i in range(3) if i not in needed
             for name, unit in (("station", ""), ("height", "_m"))}
    if p.space == "plane":
        found |= {"height_m", "height_1_m", "height_2_m", "height_3_m"}
    if p.first != "radar":
        found |= {"velocity_1_mps", "velocity_2_mps", "arm_m", "sigma_mps"}
    if "pseudorange" not in chosen:
        found.add("bias_m")
    if "bearing" not in chosen:
        found.add("sigma_deg")
    return found if p.noisy else found | {"seed"}


ONE = {"second": "none", "third": "none"}
TWO = {"third": "none"}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.1", "MAT (2.1)", "MAT Example 14", "MAT Fig 2.1", "MAT exercise 2.1", "MAT exercise 2.6"),
    presets={
        "Fig 2.1: the clock is ignored": {},
        "Fig 2.1: the right clock bias": {"step": 20},
        "Example 14: three ranges": {"first": "range", "second": "range", "third": "range"},
        "exercise 2.1 a: a coordinate": {**ONE, "first": "x2"},
        "exercise 2.1 b: a range": {**ONE, "first": "range"},
        "exercise 2.1 c: a bearing": {**ONE, "first": "bearing"},
        "exercise 2.1 d: a range difference": {**ONE, "first": "difference"},
        "range differences need no clock": {**TWO, "first": "difference", "second": "difference"},
        "a range and a bearing": {**TWO, "first": "range", "second": "bearing", "station_2": (0.0, 0.0)},
        "exercise 2.6: radar on a rotating arm": {**ONE, "first": "radar", "user": (3.0, 4.0), "sigma_m": 0.1},
        "three spheres in space": {"space": "space", "first": "range", "second": "range", "third": "range"},
        "sphere, half-plane and plane": {"space": "space", "first": "range", "second": "bearing", "third": "height",
                                         "station_2": (0.0, 0.0), "height_1_m": 60.0},
        "a hyperboloid and a half-plane": {**TWO, "space": "space", "first": "difference", "second": "bearing",
                                           "user": (10.0, 30.0), "height_1_m": 20.0, "height_2_m": 20.0},
        "a cone: range rate in space": {**ONE, "space": "space", "first": "radar", "user": (3.0, 4.0), "sigma_m": 0.1,
                                        "height_m": 2.0},
    },
)
