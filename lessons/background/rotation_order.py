"""C_k = C_{k-1} R_k about own axes, C_k = R_k C_{k-1} about the desk's.  MAT (1.14), exercise 1.20."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.rotation import rotation_angle, rotation_sequence, rotation_vector_from_dcm
from core.types import Array
from lessons.background._rotation_order_figures import ORDERS
from lessons.background._rotation_order_view import PARTS, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, slider

SAME_RAD = 1e-6                              # attitudes closer than this count as one


@dataclass(frozen=True, slots=True)
class Params:
    """Three turns, the order in which they are made, and whose axes they are made about."""

    order: str = choice("123", ORDERS)
    about: str = choice("own", ("own", "desk"))
    axis_1: str = choice("y", ("x", "y", "z"), group="turns")
    angle_1_deg: float = slider(-90.0, low=-180.0, high=180.0, step=5.0, unit="°", group="turns")
    axis_2: str = choice("x", ("x", "y", "z"), group="turns")
    angle_2_deg: float = slider(90.0, low=-180.0, high=180.0, step=5.0, unit="°", group="turns")
    axis_3: str = choice("y", ("x", "y", "z"), group="turns")
    angle_3_deg: float = slider(90.0, low=-180.0, high=180.0, step=5.0, unit="°", group="turns")


class Result(NamedTuple):
    """The chosen order in small steps, and where every order ends."""

    axes: str                    # of the turns in the chosen order
    angles_deg: Array            # (3,)
    done_deg: Array              # (3 PARTS + 1, 3) how far each of them has come
    C: Array                     # (3 PARTS + 1, 3, 3) C_B^L on the way, in the chosen kind of axes
    C_other: Array               # the same in the other kind
    ends: Array                  # (6, 3, 3) of all orders, in the chosen kind of axes
    apart_deg: Array             # (6,) angle between each of these and the chosen one
    distinct: int                # number of different ends


def compute(p: Params, progress: Progress) -> Result:
    """Every order to its end, and the chosen one step by step."""
    def in_order(order: str) -> tuple[str, Array]:
        return ("".join(getattr(p, f"axis_{k}") for k in order),
                np.array([getattr(p, f"angle_{k}_deg") for k in order]))

    own = p.about == "own"
    axes, angles_deg = in_order(p.order)
    time = np.arange(3 * PARTS + 1)[:, None] / PARTS
    done_deg = angles_deg * np.clip(time - np.arange(3), 0.0, 1.0)
    C, C_other = (rotation_sequence(axes, np.radians(done_deg), intrinsic=kind)[:, -1] for kind in (own, not own))
    progress(0.5)
    ends = np.array([_end(*in_order(order), own) for order in ORDERS])
    between = rotation_angle(rotation_vector_from_dcm(ends[:, None].mT @ ends))             # (6, 6)
    first = [i for i in range(len(ORDERS)) if (between[i, :i] > SAME_RAD).all()]
    return Result(axes, angles_deg, done_deg, C, C_other, ends, np.degrees(between[ORDERS.index(p.order)]), len(first))


def _end(axes: str, angles_deg: Array, intrinsic: bool) -> Array:
    """The attitude after all turns."""
    return rotation_sequence(axes, np.radians(angles_deg), intrinsic=intrinsic)[-1]


def timeline(p: Params) -> Timeline:
    """Three turns, each in PARTS steps; the end is shown first."""
    return Timeline(3 * PARTS, start=3 * PARTS, scale=1.0 / PARTS, unit="turns", unit_name="k")


def _turns(*turns: tuple[str, float]) -> dict[str, str | float]:
    return {key: value for k, (axis, angle) in enumerate(turns, 1)
            for key, value in ((f"axis_{k}", axis), (f"angle_{k}_deg", angle))}


EXERCISE = _turns(("y", -90.0), ("x", 90.0), ("y", 90.0))
QUARTERS = _turns(("x", 90.0), ("y", 90.0), ("z", 90.0))

LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("MAT exercise 1.20", "MAT (1.14)", "MAT (1.17)"),
    presets={
        "exercise 1.20": EXERCISE,
        "1.20, the last two swapped": {**EXERCISE, "order": "132"},
        "1.20, backwards": {**EXERCISE, "order": "321"},
        "1.20, axes of the desk": {**EXERCISE, "about": "desk"},
        "six orders, six attitudes": QUARTERS,
        "desk axes = own axes backwards": {**QUARTERS, "about": "desk", "order": "321"},
        "small turns hardly care": _turns(("x", 10.0), ("y", 10.0), ("z", 10.0)),
        "one axis: the order is free": _turns(("z", 30.0), ("z", -80.0), ("z", 120.0)),
    },
)
