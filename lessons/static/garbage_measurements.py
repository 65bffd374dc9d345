"""p'R^-1 p ~ chi2(m - n) unless a measurement is garbage: find it, leave it out, or weigh it down; and G x <= g.

MAT 2.3.2, notes 1 to 3.
"""

from dataclasses import dataclass

from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider
from lessons.static import _garbage_view, _sector_view
from lessons.static._garbage_model import LARGEST, Confined, Garbage, confined, garbage

STAGES = ("measure", "solve", "test", "repair", "repeat")
ROUNDS = 20                                  # of reweighting that the timeline shows; the last one shows its end
STEPS = 8                                    # of the constrained iteration; the last one shows its end


def _station(x: float, y: float) -> Point:
    return draggable((x, y), low=-200.0, high=200.0, role="station", group="points")


@dataclass(frozen=True, slots=True)
class Params:
    """Ranges to some stations, the error of one of them, and how sharp the tests are."""

    mode: str = choice("garbage", ("garbage", "sector"))
    count: int = slider(5, low=3, high=LARGEST)
    bad: int = slider(2, low=1, high=LARGEST)
    error_m: float = slider(50.0, low=-80.0, high=100.0, step=1.0, unit="m")
    sigma_m: float = slider(5.0, low=1.0, high=20.0, step=0.5, unit="m")
    false_alarm: float = slider(0.01, low=0.001, high=0.2, log=True)
    huber: float = slider(1.345, low=0.3, high=5.0, step=0.005)
    direction_deg: float = slider(60.0, low=0.0, high=360.0, step=5.0, unit="°")
    width_deg: float = slider(90.0, low=20.0, high=170.0, step=5.0, unit="°")
    seed: int = seed()
    zoom: str = choice("all", ("all", "near"))
    user: Point = draggable((10.0, 5.0), low=-200.0, high=200.0, role="truth", group="points")
    station_1: Point = _station(-60.0, -45.0)
    station_2: Point = _station(65.0, -50.0)
    station_3: Point = _station(75.0, 45.0)
    station_4: Point = _station(-15.0, 75.0)
    station_5: Point = _station(-80.0, 25.0)
    station_6: Point = _station(10.0, -80.0)


def compute(p: Params, progress: Progress) -> Garbage | Confined | None:
    """One set of ranges and what can be done about it; None where they determine no position."""
    return garbage(p, progress) if p.mode == "garbage" else confined(p)


def view(p: Params, r: Garbage | Confined | None, at: Moment) -> View:
    """The argument up to this stage; the remedy up to this step."""
    draw = _garbage_view.view if p.mode == "garbage" else _sector_view.view
    return draw(p, r, at, _rounds(p))


def timeline(p: Params) -> Timeline:
    """Rounds of reweighting, or iterations in the sector."""
    return Timeline(_rounds(p), STAGES, start=_rounds(p), unit_name="k")


def _rounds(p: Params) -> int:
    return ROUNDS if p.mode == "garbage" else STEPS


def unused(p: Params) -> set[str]:
    """Stations that are not there, or too far away to be dragged; what belongs to the other world."""
    stations = {f"station_{i}" for i in range(1 if p.zoom == "near" else p.count + 1, LARGEST + 1)}
    return stations | ({"direction_deg", "width_deg"} if p.mode == "garbage" else {"false_alarm", "huber"})


_SECTOR = {"mode": "sector", "count": 3, "sigma_m": 15.0, "direction_deg": 60.0, "width_deg": 60.0, "seed": 2,
           "user": (20.0, -40.0), "station_1": (-90.0, -60.0), "station_2": (60.0, -110.0), "station_3": (100.0, -90.0)}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.3.2", "MAT (2.5)"),
    presets={
        "one garbage range": {},
        "nothing is wrong": {"error_m": 0.0},
        "too small to be seen": {"error_m": 15.0},
        "three ranges: noticed, not located": {"count": 3, "error_m": 25.0, "station_3": (-15.0, 75.0)},
        "four ranges: the wrong one is blamed": {"count": 4, "bad": 1},
        "a range that nothing checks": {"count": 4, "bad": 4, "error_m": 40.0, "station_1": (-190.0, -10.0),
                                        "station_2": (190.0, -10.0), "station_3": (170.0, -20.0),
                                        "station_4": (10.0, 110.0)},
        "Huber step by step": {"step": 0},
        "a sector as an inequality": {**_SECTOR, "bad": 2, "error_m": -40.0, "stage": "repair"},
        "a sector and a mirror image": {**_SECTOR, "bad": 3, "error_m": 40.0, "stage": "repair"},
        "a sector, 300 times": {**_SECTOR, "error_m": 0.0},
    },
)
