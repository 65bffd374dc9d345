"""da^{A2}/dt = C (da^{A1}/dt - w x a^{A1}): spinning frames.  MAT 1.5, (1.22)-(1.25), exercise 1.19."""

from dataclasses import dataclass

from lessons.background._rotating_carousel import Ride, ride, ride_timeline, ride_view
from lessons.background._rotating_earth import Day, day, day_timeline, day_view
from lessons.background._rotating_train import Journey, journey, journey_timeline, journey_view
from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, slider

Result = Ride | Day | Journey

SCENES = {"carousel": (ride, ride_timeline, ride_view), "earth": (day, day_timeline, day_view),
          "train": (journey, journey_timeline, journey_view)}


@dataclass(frozen=True, slots=True)
class Params:
    """Which of the three scenes, and what there is to vary in each of them."""

    scene: str = choice("carousel", ("carousel", "earth", "train"))
    spin_rad_s: float = slider(0.7, low=-2.0, high=2.0, step=0.05, unit="rad/s", group="carousel")
    start: Point = draggable((0.0, 0.0, 0.0), low=-1.5, high=1.5, role="truth", group="carousel")
    goal: Point = draggable((1.5, 1.1, 0.0), low=-1.5, high=1.5, role="handle", group="carousel")
    arrows: str = choice("velocity", ("velocity", "acceleration", "none"), group="carousel")
    seen_from: str = choice("stars", ("stars", "earth"), group="earth")
    lat_deg: float = slider(60.0, low=-85.0, high=85.0, step=1.0, unit="°", group="earth")
    lon_deg: float = slider(25.0, low=-180.0, high=180.0, step=1.0, unit="°", group="earth")
    heading_deg: float = slider(70.0, low=0.0, high=360.0, step=5.0, unit="°", group="earth")
    pitch_deg: float = slider(55.0, low=-90.0, high=90.0, step=5.0, unit="°", group="earth")
    ground_speed_kmh: float = slider(0.0, low=0.0, high=1000.0, step=10.0, unit="km/h", group="earth")
    course_deg: float = slider(90.0, low=0.0, high=360.0, step=5.0, unit="°", group="earth")
    from_deg: float = slider(60.0 + 10.0 / 60.0, low=-89.0, high=89.0, unit="°", group="train")
    to_deg: float = slider(66.5, low=-89.0, high=89.0, unit="°", group="train")
    speed_kmh: float = slider(300.0, low=50.0, high=600.0, step=10.0, unit="km/h", group="train")
    mass_t: float = slider(100.0, low=10.0, high=1000.0, unit="t", log=True, group="train")


GROUPS = {
    "carousel": {"spin_rad_s", "start", "goal", "arrows"},
    "earth": {"seen_from", "lat_deg", "lon_deg", "heading_deg", "pitch_deg", "ground_speed_kmh", "course_deg"},
    "train": {"from_deg", "to_deg", "speed_kmh", "mass_t"},
}


def compute(p: Params, progress: Progress) -> Result:
    """The whole ride, day or journey of the chosen scene."""
    return SCENES[p.scene][0](p)


def view(p: Params, r: Result, at: Moment) -> View:
    """One moment of it."""
    return SCENES[p.scene][2](p, r, at.step)


def timeline(p: Params) -> Timeline:
    """Time of the scene: seconds, hours or minutes."""
    return SCENES[p.scene][1](p)


ACROSS = {"start": (-1.5, -1.0, 0.0), "goal": (1.5, 0.5, 0.0)}
EXAMPLE_13 = {"scene": "carousel", "spin_rad_s": 0.5, "start": (1.0, 1.0, 1.0), "goal": (1.0, 1.0, 1.0)}
TRAIN = {"scene": "train"}

LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    unused=lambda p: set().union(*(names for scene, names in GROUPS.items() if scene != p.scene)),
    refs=("MAT 1.5", "MAT Example 13", "MAT (1.22)-(1.25)", "MAT exercise 1.19"),
    presets={
        "a straight line becomes a spiral": {},
        "Example 13: a fixed object, ω = 0.5": {**EXAMPLE_13, "step": 20},
        "straight across the platform": {**ACROSS, "arrows": "acceleration"},
        "no spin, no Coriolis": {**ACROSS, "spin_rad_s": 0.0},
        "the Earth's frames I, E, L, B": {"scene": "earth"},
        "the same, Earth stands still": {"scene": "earth", "seen_from": "earth"},
        "a plane flying east": {"scene": "earth", "ground_speed_kmh": 900.0, "heading_deg": 90.0, "pitch_deg": 0.0},
        "exercise 1.19: Helsinki to Rovaniemi": TRAIN,
        "across the equator": {**TRAIN, "from_deg": -40.0, "to_deg": 40.0},
        "1.19 in the southern hemisphere": {**TRAIN, "from_deg": -(60.0 + 10.0 / 60.0), "to_deg": -66.5},
    },
)
