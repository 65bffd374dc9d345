"""Plots, readouts and formulas of the lesson on the order of rotations."""

from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from core.rotation import dcm_from_rotation_vector, rotation_angle, rotation_vector_from_dcm
from core.types import Array
from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.rotation_order import Params, Result

ORDERS = tuple("".join(str(k + 1) for k in order) for order in permutations(range(3)))


def figures(p: "Params", r: "Result", turns: float) -> dict[str, "go.Figure"]:
    """How far the orders end from each other, the angle from the start, and where the top of the phone points."""
    time = 3.0 * np.arange(len(r.C)) / (len(r.C) - 1)
    names = [float(order) for order in ORDERS]               # as categories they read 123, 132, ...
    shown = {"cursor": turns, "marks": (1.0, 2.0), "x_range": (0.0, 3.0)}
    angle, other = (np.degrees(rotation_angle(rotation_vector_from_dcm(C))) for C in (r.C, r.C_other))
    return {
        "apart": plot.chart(plot.bars("apart", names, r.apart_deg, "frame_a1"),
                            categories=True, y_range=(0.0, 185.0)),
        "top": plot.chart(*(plot.line(f"x_{axis}", time, r.C[:, i, 0], role) for i, (axis, role) in enumerate(
            (("x", "axis_x"), ("y", "axis_y"), ("z", "axis_z")))), y_range=(-1.08, 1.08), **shown),
        "angle": plot.chart(plot.line("other", time, other, "reference", dash=True),
                            plot.line("chosen", time, angle, "frame_a2"), y_range=(0.0, 185.0), **shown),
    }


def readouts(p: "Params", r: "Result", step: int) -> list[Readout]:
    C, vector = r.C[step], rotation_vector_from_dcm(r.C[-1])
    angle = float(rotation_angle(vector))
    axis = vector / angle if angle > 1e-9 else None
    return [
        Readout("top", _direction(C[:, 0])),
        Readout("screen", _direction(C[:, 2])),
        Readout("angle", float(np.degrees(angle)), "°"),
        Readout("axis", "none" if axis is None else _direction(axis)),
        Readout("distinct", f"{r.distinct} of 6"),
        Readout("backwards", float(r.apart_deg[ORDERS.index(p.order[::-1])]), "°"),
    ]


def equations(p: "Params", r: "Result", step: int) -> list[Equation]:
    """R_1, C_1, R_2, C_2, R_3, C_3 as far as they have come, and the rotation vector of what is reached."""
    parts = (len(r.C) - 1) // 3
    now = max(0, -(-step // parts) - 1)
    found = []
    for k, (axis, angle) in enumerate(zip(r.axes, r.done_deg[step], strict=True)):
        R = dcm_from_rotation_vector(np.radians(angle) * np.eye(3)["xyz".index(axis)])
        product = f"C_{k} R_{k + 1}" if p.about == "own" else f"R_{k + 1} C_{k}"
        begun, current = step > k * parts, k == now and step > 0
        C = r.C[min(step, (k + 1) * parts)]
        found += [
            Equation(f"turn_{k + 1}", (rf"R_{k + 1} = R_{axis}(", angle, r"^\circ) =", _clean(R)) if begun
                     else (rf"R_{k + 1} = R_{axis}(\varphi_{k + 1})",), current=current, digits=3),
            Equation(f"chain_{k + 1}", (rf"C_{k + 1} = {product} =", _clean(C)) if begun
                     else (rf"C_{k + 1} = {product}",), current=current, digits=3),
        ]
    whole = "R_1 R_2 R_3" if p.about == "own" else "R_3 R_2 R_1"
    vector = _clean(rotation_vector_from_dcm(r.C[step]))
    return [
        *found,
        Equation("whole", (rf"C_B^L = C_3 = {whole}",)),
        Equation("p", (r"\mathbf{p} =", vector, r"\mathrm{rad},\quad p =", float(np.degrees(np.linalg.norm(vector))),
                       r"^\circ")),
    ]


def _clean(values: Array) -> Array:
    """Without the rounding errors of right angles."""
    return np.round(values, 12) + 0.0


def _direction(v: Array) -> str:
    """"+y" along an axis of the desk, else the components."""
    i = int(np.argmax(np.abs(v)))
    if abs(v[i]) > 1.0 - 1e-9:
        return ("+" if v[i] > 0 else "−") + "xyz"[i]
    return "[" + ", ".join(f"{x:.2f}" for x in np.round(v, 2) + 0.0).replace("-", "−") + "]"
