"""x_{k+1} = x_k - (J'J)^-1 J'p(x_k): straight lines for circles.  MAT 2.3, Algorithms 1, 2, exercises 2.3, 2.16."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.gauss_newton import Solution, Solutions
from core.sensors import Range
from core.types import Array
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, slider, switch
from lessons.static._gauss_newton_model import (
    all_starts,
    measured,
    picture_box,
    residual_norms,
    run,
    sensor_of,
    sorted_ends,
)
from lessons.static._gauss_newton_view import view

CELLS = 81                                   # per axis of the maps


def _station(x: float, y: float) -> Point:
    return draggable((x, y), low=-100.0, high=200.0, role="station", group="measurements")


def _range(metres: float) -> float:
    return slider(metres, low=1.0, high=200.0, step=1.0, unit="m", group="measurements")


def _sigma(metres: float) -> float:
    return slider(metres, low=0.5, high=50.0, unit="m", log=True, group="measurements")


@dataclass(frozen=True, slots=True)
class Params:
    """Ranges to two or three stations, the start, and how a step is computed."""

    show: str = choice("map", ("map", "basins", "surface"))
    start: Point = draggable((60.0, 40.0), low=-100.0, high=200.0, role="handle", click=True)
    weighted: bool = switch(False, group="method")
    damped: bool = switch(False, group="method")
    damping: float = slider(1.0, low=1e-3, high=1e3, log=True, group="method")
    tolerance_m: float = slider(1e-3, low=1e-6, high=10.0, unit="m", log=True, group="method")
    count: int = slider(2, low=2, high=3, group="measurements")
    station_1: Point = _station(100.0, 0.0)
    station_2: Point = _station(0.0, 50.0)
    station_3: Point = _station(120.0, 120.0)
    y_1_m: float = _range(108.0)
    y_2_m: float = _range(46.0)
    y_3_m: float = _range(100.0)
    sigma_1_m: float = _sigma(10.0)
    sigma_2_m: float = _sigma(10.0)
    sigma_3_m: float = _sigma(10.0)


class Result(NamedTuple):
    """One run in full, and where all the starts of the map lead."""

    sensor: Range
    y: Array                     # (m,) m
    fix: Solution | None         # None: the Jacobian is singular at the start
    other: Solution | None       # weighted if `fix` is not, and the other way round, from the same start
    box: Array                   # (2, 2) corners of the picture
    axes: tuple[Array, Array]    # (CELLS,) x and y of the maps
    norms: Array                 # (CELLS, CELLS) |p|, or sqrt(p' R^-1 p) if weighted; rows are y
    starts: Solutions            # from every cell of the map
    ends: Array                  # (s, 2) what most starts lead to: A, B, ...
    where: Array                 # (CELLS, CELLS) the number of the end, -1 for none of them


def compute(p: Params, progress: Progress) -> Result:
    """The run from the start, and from everywhere."""
    sensor, y, box = sensor_of(p), measured(p), picture_box(p)
    axes = tuple(np.linspace(low, high, CELLS) for low, high in box.T)
    points = np.stack(np.meshgrid(*axes), axis=-1)
    fix, other = run(p, p.weighted), run(p, not p.weighted)
    progress(0.1)
    starts = all_starts(p, points)
    progress(0.8)
    ends, where = sorted_ends(starts, y, sensor)
    return Result(sensor, y, fix, other, box, axes, residual_norms(p, points), starts, ends, where)


def timeline(p: Params) -> Timeline:
    """One step is one iteration, as many as this start needs; four stages each."""
    fix = run(p, p.weighted)
    steps = 0 if fix is None else max(len(fix.steps) - 1, 0)
    return Timeline(steps, ("linearise", "solve", "step", "test"), unit_name="k")


def unused(p: Params) -> set[str]:
    """Station 3 when there are two, and the damping of a method without it."""
    return ({"station_3", "y_3_m", "sigma_3_m"} if p.count == 2 else set()) | ({"damping"} if not p.damped else set())


THREE = {"count": 3, "station_1": (10.0, 5.0), "station_2": (120.0, 0.0), "station_3": (40.0, 90.0), "y_1_m": 52.0,
         "y_2_m": 77.0, "y_3_m": 57.0}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.3", "MAT (2.3)-(2.6)", "MAT Algorithm 1", "MAT Algorithm 2", "MAT Example 16", "MAT exercise 2.3",
          "MAT exercise 2.4", "MAT exercise 2.16"),
    presets={
        "exercise 2.3: first step from [0, 0]": {"start": (0.0, 0.0), "step": 0},
        "exercise 2.16 a: start [0, 0]": {"start": (0.0, 0.0), "step": 3},
        "exercise 2.16 b: start [100, 100]": {"start": (100.0, 100.0), "step": 4},
        "exercise 2.16: the residual norm as a surface": {"show": "surface", "start": (100.0, 100.0), "step": 4},
        "exercise 2.16 c: where every start leads": {"show": "basins", "start": (0.0, 0.0), "step": 3},
        "Example 16: three ranges": {**THREE, "start": (10.0, 20.0), "step": 0},
        "Algorithm 2: weighted": {**THREE, "y_2_m": 90.0, "start": (10.0, 20.0), "weighted": True, "sigma_1_m": 1.0,
                                  "sigma_2_m": 5.0, "sigma_3_m": 10.0, "step": 40},
        "a start that goes astray": {"show": "basins", "start": (150.0, 0.0), "step": 18},
        "the same start, damped": {"show": "basins", "start": (150.0, 0.0), "damped": True, "step": 40},
        "circles that do not meet": {"y_1_m": 60.0, "y_2_m": 30.0, "start": (60.0, 60.0), "step": 6},
    },
)
