"""p(x | y) = p(x) p(y | x) / int p(x) p(y | x) dx: what is known of x now, and how large the error is.

MAT 2.5 (2.7), 2.5.1, Examples 18 and 19, Fig 2.3, exercises 2.13 and 2.14.
"""

from dataclasses import dataclass

from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, slider
from lessons.static import _bayes_line_view, _bayes_plane_view
from lessons.static._bayes_line import Line, line
from lessons.static._bayes_plane import Plane2D, plane

STEPS = 3                                 # measurements
STAGES = ("prior", "likelihood", "posterior", "estimate")
LOW_M, HIGH_M = -10.0, 20.0
AREA_M = 200.0


@dataclass(frozen=True, slots=True)
class Params:
    """Three problems: a place on a line, a number of which only the sign is measured, a position from ranges."""

    problem: str = choice("line", ("line", "sign", "plane"))
    prior: str = choice("uniform", ("uniform", "rough", "normal", "flat"), group="prior")
    length_m: float = slider(10.0, low=2.0, high=100.0, unit="m", log=True, group="prior")
    mean_m: float = slider(4.0, low=LOW_M, high=HIGH_M, step=0.5, unit="m", group="prior")
    prior_sigma_m: float = slider(2.0, low=0.3, high=50.0, unit="m", log=True, group="prior")
    y1: float = slider(8.0, low=LOW_M, high=HIGH_M, step=0.1, unit="m", group="measurement")
    y2: float = slider(5.0, low=LOW_M, high=HIGH_M, step=0.1, unit="m", group="measurement")
    y3: float = slider(6.5, low=LOW_M, high=HIGH_M, step=0.1, unit="m", group="measurement")
    sigma_m: float = slider(3.0, low=0.3, high=10.0, unit="m", log=True, group="measurement")
    s1: float = slider(0.5, low=-1.0, high=1.0, step=0.05, group="measurement")
    s2: float = slider(0.5, low=-1.0, high=1.0, step=0.05, group="measurement")
    s3: float = slider(-0.2, low=-1.0, high=1.0, step=0.05, group="measurement")
    sigma_range_m: float = slider(5.0, low=2.0, high=40.0, unit="m", log=True, group="measurement")
    dy1_m: float = slider(3.0, low=-60.0, high=60.0, step=1.0, unit="m", group="measurement")
    dy2_m: float = slider(-4.0, low=-60.0, high=60.0, step=1.0, unit="m", group="measurement")
    dy3_m: float = slider(2.0, low=-60.0, high=60.0, step=1.0, unit="m", group="measurement")
    estimate_m: float = slider(5.0, low=LOW_M, high=HIGH_M, step=0.1, unit="m", group="estimate")
    estimate: float = slider(0.0, low=-1.0, high=1.0, step=0.05, group="estimate")
    guess: Point = draggable((58.0, 24.0), low=-AREA_M, high=AREA_M, role="handle", group="estimate")
    truth: Point = draggable((50.0, 30.0), low=-AREA_M, high=AREA_M, role="truth", group="points")
    station_1: Point = draggable((10.0, 5.0), low=-AREA_M, high=AREA_M, role="station", group="points")
    station_2: Point = draggable((120.0, 0.0), low=-AREA_M, high=AREA_M, role="station", group="points")
    station_3: Point = draggable((40.0, 90.0), low=-AREA_M, high=AREA_M, role="station", group="points")
    zoom: str = choice("near", ("near", "all"), group="points")


OF_LINE = {"prior", "length_m", "mean_m", "prior_sigma_m", "y1", "y2", "y3", "sigma_m", "estimate_m"}
OF_SIGN = {"s1", "s2", "s3", "estimate"}
OF_PLANE = {"sigma_range_m", "dy1_m", "dy2_m", "dy3_m", "guess", "truth", "station_1", "station_2", "station_3", "zoom"}
UNUSED_PRIOR = {"uniform": {"mean_m", "prior_sigma_m"}, "rough": set(), "normal": {"length_m"},
                "flat": {"length_m", "mean_m", "prior_sigma_m"}}


def compute(p: Params, progress: Progress) -> Line | Plane2D:
    """Three updates one after the other: each posterior is the next prior."""
    return plane(p, progress) if p.problem == "plane" else line(p)


def view(p: Params, r: Line | Plane2D, at: Moment) -> View:
    """One update, up to its stage."""
    return _bayes_plane_view.view(p, r, at) if isinstance(r, Plane2D) else _bayes_line_view.view(p, r, at)


def timeline(p: Params) -> Timeline:
    """The measurements; Example 18 has one, Example 19 three."""
    return Timeline(STEPS, STAGES, start=STEPS if p.problem == "plane" else 1, unit_name="k")


def unused(p: Params) -> set[str]:
    """What belongs to the other problems, or to another prior."""
    match p.problem:
        case "line":
            return OF_SIGN | OF_PLANE | UNUSED_PRIOR[p.prior]
        case "sign":
            return OF_LINE | OF_PLANE
        case _:
            return OF_LINE | OF_SIGN


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.5", "MAT (2.7)", "MAT 2.5.1", "MAT Example 18", "MAT Example 19", "MAT Fig 2.3", "MAT exercise 2.13",
          "MAT exercise 2.14"),
    presets={
        "Example 18: the pipe": {},
        "a second measurement": {"step": 2},
        "a rough idea of the place": {"prior": "rough", "mean_m": 4.0, "prior_sigma_m": 1.5},
        "a flat prior": {"prior": "flat"},
        "exercise 2.13": {"prior": "normal", "mean_m": 0.0, "prior_sigma_m": 2.0, "y1": 5.0, "sigma_m": 1.0,
                          "estimate_m": 2.5},
        "exercise 2.13, a vague prior": {"prior": "normal", "mean_m": 0.0, "prior_sigma_m": 20.0, "y1": 5.0,
                                         "sigma_m": 1.0, "estimate_m": 2.5},
        "exercise 2.14": {"problem": "sign"},
        "exercise 2.14, three signs": {"problem": "sign", "step": 3},
        "Example 19": {"problem": "plane"},
        "Example 19, range by range": {"problem": "plane", "zoom": "all", "step": 2},
        "Example 19, near a station": {"problem": "plane", "truth": (20.0, 12.0), "sigma_range_m": 10.0, "dy1_m": 10.0,
                                       "dy2_m": 10.0, "dy3_m": 10.0, "guess": (20.0, 30.0)},
    },
)
