"""dC/dt = C (w x),  dp/dt = w + p x w / 2 + γ p x (p x w): from gyros to an attitude.  MAT (1.20), (1.21), (1.26)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.rotation import dcm_rate
from core.types import Array
from lessons.background._attitude_rate_model import (
    METHODS,
    Track,
    difference_errors,
    largest_errors,
    motion_of,
    track,
)
from lessons.background._attitude_rate_view import FRAMES, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, slider

CONE_RAD = 0.2                               # of the oracle's example
STUDY = (6, 12, 24, 48, 96)                  # steps of a turn in the plot of the error against the step


@dataclass(frozen=True, slots=True)
class Params:
    """How the body moves, how often its gyros are read, and which attitude is drawn beside the true one."""

    motion: str = choice("coning", ("coning", "fixed"), group="motion")
    half_angle_deg: float = slider(float(np.degrees(CONE_RAD)), low=0.5, high=60.0, unit="°", group="motion")
    rate_hz: float = slider(1.0, low=0.1, high=10.0, unit="1/s", log=True, group="motion")
    axis: Point = draggable((0.4, 0.8, 0.8), low=-1.5, high=1.5, unit="", plane="sphere", role="rotation",
                            group="motion")
    spin_rad_s: float = slider(0.8, low=0.1, high=5.0, step=0.05, unit="rad/s", group="motion")
    turns: int = slider(5, low=1, high=8, group="motion")
    samples: int = slider(20, low=4, high=200, log=True, group="gyros")
    method: str = choice("naive", METHODS, group="gyros")


class Result(NamedTuple):
    """All methods over all turns, their errors for other steps, and the test of (1.21)."""

    turn_s: float                # one turn of the cone, or about the axis
    track: Track                 # at the samples
    frames_s: Array              # (FRAMES turns + 1,) times of the timeline
    true_C: Array                # (FRAMES turns + 1, 3, 3)
    steps_s: Array               # (len(STUDY),)
    largest_deg: dict[str, Array]        # (len(STUDY),) by method: largest error in the first turn
    h_s: Array                   # steps of difference quotients
    quotient_errors: Array       # (2, len(h_s)) of the forward and the central quotient, relative
    check_s: float               # when: as in the oracle
    check_rate: Array            # (3, 3) C (w x) then


def compute(p: Params, progress: Progress) -> Result:
    """The true motion, and what each method makes of its gyro readings."""
    motion = motion_of(p)
    whole = track(motion, motion.turn_s / p.samples, p.turns * p.samples, progress, 0.6)
    frames_s = motion.turn_s / FRAMES * np.arange(FRAMES * p.turns + 1)
    largest = {name: np.empty(len(STUDY)) for name in METHODS}
    for k, n in enumerate(STUDY):
        for name, error in largest_errors(motion, n).items():
            largest[name][k] = error
        progress(0.6 + 0.4 * (k + 1) / len(STUDY))
    check_s = 0.1 if p.motion == "coning" else 1.1
    h_s, errors = difference_errors(motion, check_s)
    return Result(motion.turn_s, whole, frames_s, motion.C(frames_s), motion.turn_s / np.array(STUDY), largest, h_s,
                  errors, check_s, dcm_rate(motion.C(check_s), motion.w(check_s)))


def timeline(p: Params) -> Timeline:
    """Each turn in FRAMES steps; the end is shown first."""
    return Timeline(FRAMES * p.turns, start=FRAMES * p.turns, scale=motion_of(p).turn_s / FRAMES, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    unused=lambda p: {"half_angle_deg", "rate_hz"} if p.motion == "fixed" else {"axis", "spin_rad_s"},
    refs=("MAT 1.5", "MAT (1.19)-(1.21)", "MAT (1.26)", "MAT exercise 1.21"),
    presets={
        "coning, α = 0.2 rad": {},
        "the Bortz equation": {"method": "bortz"},
        "small rotations, one after the other": {"method": "middle"},
        "rates of the step's start": {"method": "start", "samples": 12},
        "a fixed axis: all are right": {"motion": "fixed", "turns": 2},
        "a wide cone": {"half_angle_deg": 45.0, "turns": 2},
        "vibration: 1°, 10 times a second": {"half_angle_deg": 1.0, "rate_hz": 10.0, "turns": 8},
        "few samples": {"samples": 5, "method": "bortz", "half_angle_deg": 30.0},
    },
)
