"""x_ML = argmax p(y | x) = argmax prod p(y_i | x): likelihoods of all kinds of measurements, multiplied one by one.

MAT 2.4, Fig 2.2, Example 17, exercises 2.10 and 2.11.
"""

from dataclasses import dataclass

from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider, switch
from lessons.static import _likelihood_line_view, _likelihood_plane_view
from lessons.static._likelihood_line import READINGS, Line, line
from lessons.static._likelihood_plane import Plane2D, count_of, plane

STAGES = ("factor", "product")


@dataclass(frozen=True, slots=True)
class Params:
    """What is measured in the plane, or what is read on a line."""

    world: str = choice("plane", ("plane", "floor", "square"))
    ranges: int = slider(1, low=0, high=3)
    bearings: int = slider(1, low=0, high=2)
    difference: bool = switch(False)
    strength: bool = switch(False)
    inside: str = choice("off", ("off", "yes", "no"))
    shown: str = choice("map", ("map", "surface"))
    noise: str = choice("normal", ("normal", "uniform"), group="errors")
    sigma_m: float = slider(5.0, low=2.0, high=30.0, step=0.5, unit="m", group="errors")
    sigma_deg: float = slider(10.0, low=2.0, high=40.0, step=0.5, unit="°", group="errors")
    sigma_db: float = slider(4.0, low=1.0, high=12.0, step=0.5, unit="dB", group="errors")
    radius_m: float = slider(60.0, low=10.0, high=120.0, step=1.0, unit="m", group="errors")
    edge_m: float = slider(0.0, low=0.0, high=20.0, step=0.5, unit="m", group="errors")
    wrong: bool = switch(False, group="errors")
    seed: int = seed(group="errors")
    truth: Point = draggable((43.30127, 25.0), low=-75.0, high=115.0, role="truth", group="points")
    probe: Point = draggable((40.0, 30.0), low=-75.0, high=115.0, group="points")
    station_1: Point = draggable((0.0, 0.0), low=-75.0, high=115.0, role="station", group="points")
    station_2: Point = draggable((95.0, -20.0), low=-75.0, high=115.0, role="station", group="points")
    station_3: Point = draggable((10.0, 80.0), low=-75.0, high=115.0, role="station", group="points")
    readings: int = slider(READINGS, low=1, high=READINGS, group="line")
    y_1: int = slider(0, low=-4, high=3, group="line")
    y_2: int = slider(-2, low=-4, high=3, group="line")
    y_3: int = slider(-1, low=-4, high=3, group="line")
    y_4: int = slider(0, low=-4, high=3, group="line")
    y_5: int = slider(-1, low=-4, high=3, group="line")
    sigma: float = slider(0.5, low=0.1, high=2.0, step=0.05, group="line")
    y: float = slider(2.0, low=-1.0, high=6.0, step=0.05, group="line")
    half_width: float = slider(1.0, low=0.2, high=2.0, step=0.05, group="line")
    x: float = slider(0.5, low=-4.0, high=4.0, step=0.05, group="line")


def compute(p: Params, progress: Progress) -> Plane2D | Line:
    """Every measurement's log-likelihood on a grid, their sums, and the estimates after each of them."""
    return plane(p, progress) if p.world == "plane" else line(p)


def view(p: Params, r: Plane2D | Line, at: Moment) -> View:
    """One measurement alone, or the product of all up to it."""
    return _likelihood_plane_view.view(p, r, at) if isinstance(r, Plane2D) else _likelihood_line_view.view(p, r, at)


def timeline(p: Params) -> Timeline:
    """One measurement after the other."""
    number = count_of(p) if p.world == "plane" else p.readings if p.world == "floor" else 1
    last = max(number - 1, 0)
    return Timeline(last, STAGES, start=last, unit_name="i")


_PLANE = {"ranges", "bearings", "difference", "strength", "inside", "shown", "sigma_m", "sigma_deg", "sigma_db",
          "radius_m", "edge_m", "wrong", "seed", "truth", "probe", "station_1", "station_2", "station_3"}
_FLOOR = {"readings", *(f"y_{i + 1}" for i in range(READINGS)), "sigma"}
_SQUARE = {"y", "half_width"}


def unused(p: Params) -> set[str]:
    """Of the other worlds, and of what is not measured."""
    if p.world == "floor":
        return _PLANE | _SQUARE | {"noise"} | {f"y_{i + 1}" for i in range(p.readings, READINGS)}
    if p.world == "square":
        return _PLANE | _FLOOR
    off = {"station_2"} if not (p.ranges > 1 or p.bearings > 1 or p.difference or p.strength) else set()
    off |= {"station_3"} if not (p.ranges > 2 or p.inside != "off") else set()
    off |= {"radius_m", "edge_m"} if p.inside == "off" else set()
    off |= {"sigma_m"} if not (p.ranges or p.difference) else set()
    off |= set() if p.bearings else {"sigma_deg"}
    off |= set() if p.strength else {"sigma_db"}
    return _FLOOR | _SQUARE | {"x"} | off | (set() if p.wrong else {"seed"})


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.4", "MAT Fig 2.2", "MAT Example 17", "MAT exercise 2.10", "MAT exercise 2.11"),
    presets={
        "Fig 2.2: range and bearing": {},
        "Fig 2.2 as a surface": {"shown": "surface"},
        "Example 17: three ranges": {"ranges": 3, "bearings": 0, "sigma_m": 10.0, "wrong": True},
        "two ranges, two peaks": {"ranges": 2, "bearings": 0},
        "range difference and power": {"ranges": 0, "bearings": 0, "difference": True, "strength": True},
        "uniform errors": {"ranges": 3, "bearings": 0, "noise": "uniform", "wrong": True, "sigma_m": 8.0},
        "exercise 2.10(c): within 100 m": {"ranges": 1, "bearings": 0, "inside": "yes", "radius_m": 100.0,
                                           "station_3": (75.0, 80.0)},
        "exercise 2.10(d), ten times softer": {"ranges": 1, "bearings": 0, "inside": "yes", "radius_m": 100.0,
                                               "edge_m": 10.0, "station_3": (75.0, 80.0)},
        "exercise 2.10(a): y = x² + v": {"world": "square", "noise": "uniform"},
        "exercise 2.11: floor": {"world": "floor"},
    },
)
