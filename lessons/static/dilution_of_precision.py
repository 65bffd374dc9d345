"""GDOP = sqrt(tr (J'J)^-1): how geometry multiplies the errors of measurements.  MAT 2.3.2, exercises 2.5 and 2.17."""

from dataclasses import dataclass

from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider, switch
from lessons.static import _dop_ground_view, _dop_sky_view
from lessons.static._dop_ground import DRAWS, Ground, ground
from lessons.static._dop_sky import TOP, Sky, directions, sky

BATCH = 50                                   # experiments that one step of the timeline adds
# Azimuth and elevation in degrees.  The first five are the satellites of the oracle's example (C2-08).
DIRECTIONS = ((40.0, 60.0), (120.0, 30.0), (215.0, 45.0), (300.0, 20.0), (350.0, 75.0), (75.0, 15.0), (180.0, 65.0),
              (255.0, 35.0))
SATELLITES = tuple(f"sat_{i + 1}" for i in range(TOP))


def _satellite(i: int) -> Point:
    return draggable(directions(*DIRECTIONS[i]).tolist(), low=-1.2, high=1.2, unit="", plane="sphere", role="satellite",
                     group="satellites")


@dataclass(frozen=True, slots=True)
class Params:
    """Satellites on the sky over a street, or stations in the plane."""

    mode: str = choice("sky", ("sky", "map", "surface", "cloud"))
    count: int = slider(6, low=4, high=TOP)
    mask_deg: float = slider(10.0, low=0.0, high=60.0, step=1.0, unit="°")
    wall_deg: float = slider(0.0, low=0.0, high=80.0, step=1.0, unit="°")
    street_deg: float = slider(40.0, low=0.0, high=180.0, step=5.0, unit="°")
    sigma_m: float = slider(5.0, low=0.5, high=50.0, unit="m", log=True)
    third: bool = switch(False)
    ratio_2: float = slider(1.0, low=0.1, high=10.0, log=True, group="weights")
    ratio_3: float = slider(1.0, low=0.1, high=10.0, log=True, group="weights")
    weight_2: float = slider(1.0, low=0.001, high=10.0, log=True, group="weights")
    weight_3: float = slider(1.0, low=0.001, high=10.0, log=True, group="weights")
    seed: int = seed(group="weights")
    user: Point = draggable((0.0, 0.0), low=-50.0, high=150.0, role="truth", group="points")
    station_1: Point = draggable((100.0, 0.0), low=-200.0, high=300.0, role="station", group="points")
    station_2: Point = draggable((0.0, 50.0), low=-200.0, high=300.0, role="station", group="points")
    station_3: Point = draggable((120.0, 120.0), low=-200.0, high=300.0, role="station", group="points")
    sat_1: Point = _satellite(0)
    sat_2: Point = _satellite(1)
    sat_3: Point = _satellite(2)
    sat_4: Point = _satellite(3)
    sat_5: Point = _satellite(4)
    sat_6: Point = _satellite(5)
    sat_7: Point = _satellite(6)
    sat_8: Point = _satellite(7)


_SKY = {"count", "mask_deg", "wall_deg", "street_deg", *SATELLITES}
_PLANE = {"third", "ratio_2", "ratio_3", "weight_2", "weight_3", "seed", "user", "station_1", "station_2", "station_3"}


def compute(p: Params, progress: Progress) -> Sky | Ground:
    """The DOP numbers of the satellites that are seen, or a map and a thousand experiments."""
    return sky(p) if p.mode == "sky" else ground(p, progress)


def view(p: Params, r: Sky | Ground, at: Moment) -> View:
    """Satellites up to this step, or experiments up to it."""
    return _dop_sky_view.view(p, r, at) if isinstance(r, Sky) else _dop_ground_view.view(p, r, at, BATCH)


def timeline(p: Params) -> Timeline:
    """One more satellite a step after the first four; or fifty more experiments."""
    if p.mode == "sky":
        return Timeline(p.count - 4, start=p.count - 4, unit_name="added")
    if p.mode == "surface":
        return Timeline(0)
    return Timeline(DRAWS // BATCH, start=DRAWS // BATCH, scale=BATCH, unit_name="n")


def unused(p: Params) -> set[str]:
    """Of the other world; satellites and stations that are switched off; points too far away to be dragged."""
    if p.mode == "sky":
        return _PLANE | set(SATELLITES[p.count:]) | (set() if p.wall_deg else {"street_deg"})
    off = set() if p.third else {"station_3", "ratio_3", "weight_2", "weight_3"}
    points = {"user", "station_1", "station_2", "station_3"} if p.mode == "cloud" else set()
    weights = {"ratio_2", "ratio_3", "weight_2", "weight_3", "seed", "sigma_m"} if p.mode == "surface" else set()
    return _SKY | off | points | weights


def _placed(*angles: tuple[float, float]) -> dict[str, Point]:
    """Satellites at these azimuths and elevations (degrees)."""
    return {name: tuple(directions(*pair).tolist()) for name, pair in zip(SATELLITES, angles, strict=False)}


_UNEQUAL = {"mode": "cloud", "third": True, "sigma_m": 1.0, "ratio_2": 5.0, "ratio_3": 10.0, "user": (50.0, 30.0),
            "station_1": (10.0, 5.0), "station_2": (120.0, 0.0), "station_3": (40.0, 90.0)}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 2.3.2", "MAT (2.6)", "MAT exercise 2.5", "MAT exercise 2.17"),
    presets={
        "five satellites": {"count": 5},
        "a street canyon": {"count": 8, "wall_deg": 62.0, "street_deg": 40.0},
        "one overhead, three low": {"count": 4, "mask_deg": 0.0,
                                    **_placed((0.0, 90.0), (0.0, 5.0), (120.0, 5.0), (240.0, 5.0))},
        "all on one cone": {"count": 6, **_placed(*((60.0 * i, 45.0) for i in range(6)))},
        "exercise 2.17(b): DOP map": {"mode": "map", "sigma_m": 10.0},
        "exercise 2.17(b): surf": {"mode": "surface"},
        "exercise 2.17(a), σ = 1 m": {"mode": "cloud", "sigma_m": 1.0},
        "exercise 2.17(a), σ = 10 m": {"mode": "cloud", "sigma_m": 10.0},
        "a banana": {"mode": "cloud", "sigma_m": 5.0, "station_1": (100.0, -12.0), "station_2": (100.0, 12.0)},
        "exercise 2.5, W = I": _UNEQUAL,
        "exercise 2.5, W = Σ⁻¹": {**_UNEQUAL, "weight_2": 0.04, "weight_3": 0.01},
    },
)
