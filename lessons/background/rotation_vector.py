"""One rotation as a vector, a matrix and a quaternion.  MAT 1.4, (1.12)-(1.18), Example 12, exercises 1.17, 1.18."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.rotation import dcm_from_rotation_vector, principal, quaternion_from_rotation_vector
from core.types import Array
from lessons.background._rotation_vector_view import STEPS, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, slider, switch

LOW_DEG, HIGH_DEG = -360.0, 720.0
EXAMPLE_P = (0.3, -0.2, 0.5)                 # rad
EXAMPLE_P_DEG = float(np.degrees(np.linalg.norm(EXAMPLE_P)))


@dataclass(frozen=True, slots=True)
class Params:
    """The axis u (only its direction counts), the angle about it, and a vector that stays where it is in A1."""

    angle_deg: float = slider(65.0, low=LOW_DEG, high=HIGH_DEG, step=1.0, unit="°")
    axis: Point = draggable((0.5, 0.5, 1.2), low=-3.0, high=3.0, unit="", plane="sphere", role="rotation")
    a: Point = draggable((0.6, 1.1, 0.8), low=-3.0, high=3.0, unit="", plane="free", role="vector")
    components: str = choice("both", ("both", "a1", "a2", "none"), group="view")
    carried: bool = switch(False, group="view")


class Result(NamedTuple):
    """The unit axis, and everything that depends on the angle over the slider's whole range."""

    u: Array                     # (3,) the same coordinates in A1 and A2
    has_direction: bool          # False: the axis was the zero vector and z was taken
    grid_deg: Array              # (k,) angles
    a_A2: Array                  # (k, 3) C_{A1}^{A2} a^{A1}
    q: Array                     # (k, 4) scalar first
    shorter_deg: Array           # (k,) the signed angle about u of the shortest equivalent rotation vector


def compute(p: Params, progress: Progress) -> Result:
    """a^{A2}, q and the shortest rotation vector for every angle about the axis."""
    axis = np.array(p.axis)
    length = np.linalg.norm(axis)
    has_direction = bool(length > 1e-6)
    u = axis / length if has_direction else np.array([0.0, 0.0, 1.0])
    grid_deg = np.linspace(LOW_DEG, HIGH_DEG, 361)
    vectors = np.radians(grid_deg)[:, None] * u
    progress(0.5)
    a_A2 = np.matvec(dcm_from_rotation_vector(vectors).mT, np.array(p.a))                  # (1.12), (1.17)
    return Result(u, has_direction, grid_deg, a_A2, quaternion_from_rotation_vector(vectors),
                  np.degrees(principal(vectors) @ u))


def timeline(p: Params) -> Timeline:
    """The turn from 0 to the chosen angle; the finished turn is shown first."""
    return Timeline(STEPS, start=STEPS, scale=p.angle_deg / STEPS, unit="°", unit_name="φ")


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("MAT 1.4", "MAT (1.12)-(1.18)", "MAT Example 12", "MAT exercise 1.17", "MAT exercise 1.18"),
    presets={
        "Example 12, θ = 30°": {"axis": (0.0, 0.0, 1.4), "angle_deg": 30.0, "a": (1.0, 1.0, 1.0)},
        "exercise 1.18, θ = −30°": {"axis": (0.0, 0.0, 1.4), "angle_deg": -30.0, "a": (1.0, 1.0, 1.0)},
        "p = [0.3, −0.2, 0.5]": {"axis": EXAMPLE_P, "angle_deg": EXAMPLE_P_DEG},
        "exercise 1.17: a along the axis": {"a": (0.7, 0.7, 1.68), "angle_deg": 110.0},
        "a half turn": {"angle_deg": 180.0},
        "400°: beyond a full turn": {"angle_deg": 400.0},
        "turn a with the frame": {"carried": True, "components": "a2", "angle_deg": 110.0},
    },
)
