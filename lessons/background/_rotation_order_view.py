"""How three turns of a phone are drawn: the phone on its way, and the ends of all six orders in a row below."""

from typing import TYPE_CHECKING

import numpy as np

from core.rotation import dcm_from_rotation_vector, rotation_angle, rotation_vector_from_dcm
from core.types import Array
from lessons.background._phone import outline, phone
from lessons.background._rotation_order_figures import ORDERS, equations, figures, readouts
from lessons.kit.lesson import Moment, Target, View
from lessons.kit.scene import Frame, Item, Label, Orbit, Polyline, RotationVector

if TYPE_CHECKING:
    from lessons.background.rotation_order import Params, Result

PARTS = 10                                   # steps of each turn
AZIMUTH_DEG, ELEVATION_DEG = -150.0, 26.0    # from below the keys and a little from the right
RIGHT = np.array([-np.sin(np.radians(AZIMUTH_DEG)), np.cos(np.radians(AZIMUTH_DEG)), 0.0])
AT = np.zeros(3)                             # of the large phone
ROW, APART, SMALL = -2.15, 0.8, 0.3          # height, distance and size of the small ones


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The phone after at.step / PARTS turns."""
    return View(
        scene=[*_phone(r.C[at.step], at.step), *_turn(p, r, at.step), *_row(p, r)],
        camera=Orbit(centre=(0.0, 0.0, -0.42), radius=2.5, azimuth_deg=AZIMUTH_DEG, elevation_deg=ELEVATION_DEG),
        figures=figures(p, r, at.step / PARTS), readouts=readouts(p, r, at.step), equations=equations(p, r, at.step),
        caption=_caption(p, r, at.step), note=_note(r),
        targets=[Target(place, {"order": order}) for order, place in zip(ORDERS, _places(), strict=True)],
    )


def _places() -> Array:
    return AT + np.outer(APART * (np.arange(6) - 2.5), RIGHT) + np.array([0.0, 0.0, ROW])


def running(step: int) -> int:
    """Index of the turn that leads to this step; the first one at the start."""
    return max(0, -(-step // PARTS) - 1)


def _phone(C: Array, step: int) -> list[Item]:
    """The phone with its axes, the axes of the desk, and the outline of how it lay at the start."""
    items: list[Item] = [
        Frame("desk", np.eye(3), AT, 1.8, ("x desk", "y desk", "z desk"), role="frame_a1", width=3.0, fade=0.35),
        *phone("phone", C, AT, 1.0),
        Frame("body", C, AT, 1.25, ("x", "y", "z"), width=6.0),
    ]
    if step:
        items.append(outline("start", np.eye(3), AT, 1.0))
    return items


def _turn(p: "Params", r: "Result", step: int) -> list[Item]:
    """The axis of the turn that is being made and how far it has come; at the end the one turn that replaces all."""
    if step == 3 * PARTS:
        return _total(rotation_vector_from_dcm(r.C[-1]))
    k = running(step)
    before = r.C[k * PARTS] if p.about == "own" else np.eye(3)
    axis = before["xyz".index(r.axes[k])] if p.about == "desk" else before[:, "xyz".index(r.axes[k])]
    items: list[Item] = [Polyline("axis", AT + np.outer([-1.7, 1.7], axis), role="rotation", width=2.0, dashed=True)]
    done = np.radians(r.done_deg[step, k])
    if abs(done) > 1e-9:
        start = r.C[k * PARTS][:, "xyz".index(_across(r.axes[k]))]
        start = start - (start @ axis) * axis
        if np.linalg.norm(start) < 0.1:
            start = np.eye(3)[int(np.argmin(np.abs(axis)))]
        items.append(RotationVector("turn", done * axis, origin=AT, length=1.6 / abs(done), arc_radius=1.2, start=start,
                                    width=5.0))
    return items


def _across(axis: str) -> str:
    """The body axis whose path shows a turn about `axis`."""
    return "x" if axis != "x" else "z"


def _total(p: Array) -> list[Item]:
    angle = float(rotation_angle(p))
    if angle < 1e-9:
        return []
    axis = p / angle
    start = np.eye(3)[int(np.argmin(np.abs(axis)))]
    start = start - (start @ axis) * axis
    middle = dcm_from_rotation_vector(0.5 * p) @ start / np.linalg.norm(start)
    return [RotationVector("total", p, role="vector", origin=AT, length=1.6 / angle, arc_radius=1.2, start=start,
                           width=5.0),
            Label("total_angle", f"{np.degrees(angle):.0f}°", AT + 1.45 * middle, 1.0)]


def _row(p: "Params", r: "Result") -> list[Item]:
    """Where each of the six orders ends; the chosen one in blue and underlined."""
    items: list[Item] = []
    for order, C, place in zip(ORDERS, r.ends, _places(), strict=True):
        chosen = order == p.order
        items += phone(f"end_{order}", C, place, SMALL, detailed=False, chosen=chosen)
        line, name = (place - np.array([0.0, 0.0, below]) for below in (0.42, 0.49))
        items.append(Label(f"name_{order}", " ".join(order), name, 1.05 if chosen else 0.9, "top"))
        if chosen:
            items.append(Polyline("chosen", [line - 0.3 * RIGHT, line + 0.3 * RIGHT], role="frame_a2", width=5.0))
    return items


def _caption(p: "Params", r: "Result", step: int) -> str:
    whose = "its own" if p.about == "own" else "the desk's"
    if step == 0:
        return "before the first turn"
    k = running(step)
    done = f", {_degrees(r.done_deg[step, k])} done" if step % PARTS else ""
    return f"turn {p.order[k]}: {_degrees(r.angles_deg[k])} about {whose} {r.axes[k]} axis{done}"


def _note(r: "Result") -> str:
    if r.distinct == 1:
        return "All six orders end in the same attitude: these turns commute."
    return ""


def _degrees(angle: float) -> str:
    return f"{angle:+.4g}°".replace("-", "−").replace("+0°", "0°")
