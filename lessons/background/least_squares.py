"""x = argmin |y - A x|^2 = (A'A)^-1 A'y: the foot of y on the column space, and what it is used for.  MAT 1.2."""

from collections.abc import Collection
from dataclasses import dataclass

from lessons.background import _least_squares_lines, _least_squares_road, _least_squares_space
from lessons.kit.lesson import Lesson, Moment, Progress, View
from lessons.kit.params import Point, Points, choice, draggable, points, slider, switch

SCENES = {"projection": _least_squares_space, "road": _least_squares_road, "guess": _least_squares_lines,
          "triangle": _least_squares_lines}
USED = {
    "projection": {"y", "slope_1", "slope_2", "other"},
    "road": {"fixes", "total", "squares"},
    "guess": {"x0", "mu", "rows", "y_1", "y_2", "y_3"},
    "triangle": {"d_1", "d_2", "d_3"},
}


@dataclass(frozen=True, slots=True)
class Params:
    """Which of four pictures, and what can be moved in it."""

    picture: str = choice("projection", tuple(SCENES))
    y: Point = draggable((1.0, 0.6, 2.6), low=-4.0, high=4.0, plane="free", unit="", role="measurement", group="space")
    slope_1: float = slider(0.4, low=-1.0, high=1.0, step=0.05, group="space")
    slope_2: float = slider(0.3, low=-1.0, high=1.0, step=0.05, group="space")
    other: Point = draggable((-0.8, 1.6), low=-3.0, high=3.0, unit="", group="space")
    fixes: Points = points(((-1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, 2.0)), limit=12, low=-4.0, high=4.0,
                           unit="km", role="measurement", group="road")
    squares: bool = switch(True, group="road")
    total: bool = switch(False, group="road")
    x0: Point = draggable((0.0, 1.0), low=-1.0, high=3.0, role="prior", group="guess")
    mu: float = slider(1.0, low=0.01, high=100.0, log=True, group="guess")
    rows: int = slider(3, low=1, high=3, group="guess")
    y_1: float = slider(1.0, low=-1.0, high=3.0, step=0.1, unit="m", group="guess")
    y_2: float = slider(2.0, low=-1.0, high=5.0, step=0.1, unit="m", group="guess")
    y_3: float = slider(3.0, low=-1.0, high=6.0, step=0.1, unit="m", group="guess")
    d_1: float = slider(1.0, low=0.0, high=6.0, step=0.1, unit="l", group="triangle")
    d_2: float = slider(2.0, low=0.0, high=6.0, step=0.1, unit="l", group="triangle")
    d_3: float = slider(3.0, low=0.0, high=6.0, step=0.1, unit="l", group="triangle")


def compute(p: Params, progress: Progress) -> object:
    """What the chosen picture needs."""
    if p.picture in ("guess", "triangle"):
        return _least_squares_lines.compute(p)
    return SCENES[p.picture].compute(p)


def view(p: Params, r: object, at: Moment) -> View:
    return SCENES[p.picture].view(p, r)


def unused(p: Params) -> Collection[str]:
    """Controls of the other pictures, and lines that are not used."""
    hidden = set().union(*USED.values()) - USED[p.picture]
    return hidden | {f"y_{k}" for k in (2, 3) if p.picture == "guess" and k > p.rows}


LESSON = Lesson(
    Params, compute, view, unused=unused, budget_s=0.3,
    refs=("MAT 1.2", "MAT (1.3)-(1.6)", "MAT Examples 3, 4", "MAT exercises 1.3, 1.7, 1.9, 2.7"),
    presets={
        "the right angle": {},
        "y in the column space": {"y": (1.0, 0.6, 0.58)},
        "Example 4: the road": {"picture": "road"},
        "one fix far off": {"picture": "road", "fixes": ((-1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, -3.0))},
        "a steep road": {"picture": "road", "total": True, "squares": False,
                         "fixes": ((0.0, -2.5), (0.3, -1.0), (-0.3, 0.2), (0.4, 1.2), (0.1, 2.6))},
        "Example 3: a guess": {"picture": "guess"},
        "one measurement and a guess": {"picture": "guess", "rows": 1, "mu": 0.01},
        "exercise 1.7: the triangle": {"picture": "triangle"},
        "distances that agree": {"picture": "triangle", "d_1": 1.2, "d_2": 1.9, "d_3": 2.1},
    },
)
