"""What the rotation vector lesson shows at one angle of the turn."""

from typing import TYPE_CHECKING

import numpy as np

from core.rotation import dcm_from_rotation_vector, principal, quaternion_from_rotation_vector, skew
from core.types import Array
from lessons.kit import figures
from lessons.kit.equations import Equation
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.roles import Role
from lessons.kit.scene import Arrow, Frame, Item, Label, Orbit, Points, Polyline, RotationVector, Segments

if TYPE_CHECKING:
    from lessons.background.rotation_vector import Params, Result

LENGTH = 0.45            # scene units per radian of p, as long as the whole arrow is not longer than
LONGEST = 1.7            # this: beyond it the frames would become tiny
ARC = 0.5
TIP = 1.1                # where the names of the axes stand
STEPS = 60               # of the turn; the same for every angle, so that "the end" stays the end

DCM = (r"C_{A2}^{A1} = I + \frac{\sin p}{p}(\mathbf{p}\times) + "
       r"\frac{1-\cos p}{p^2}(\mathbf{p}\times)(\mathbf{p}\times) =")


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The frames, p and a after the share `at.step` / STEPS of the turn."""
    angle_deg = p.angle_deg * at.step / STEPS
    vector = np.radians(angle_deg) * r.u
    C = dcm_from_rotation_vector(vector)
    a = np.array(p.a)
    a_A2 = C.T @ a
    length = min(LENGTH, LONGEST / max(abs(np.radians(p.angle_deg)), 1e-9))
    reach = max(1.4, length * abs(np.radians(p.angle_deg)), 0.95 * np.linalg.norm(a), np.linalg.norm(p.axis)) + 0.1
    return View(
        scene=[*_frames(C, r.u, angle_deg), *_rotation(vector, r.u, angle_deg, length, np.linalg.norm(p.axis)),
               *_vector(p, a, a_A2, C, vector)],
        camera=Orbit(centre=(0.0, 0.0, 0.3), radius=reach, azimuth_deg=20.0, elevation_deg=22.0, ground=1.2),
        figures=_figures(r, angle_deg),
        readouts=_readouts(vector, a, a_A2, C),
        equations=_equations(vector, a, a_A2, C),
        caption=f"turned by {_degrees(angle_deg)} of {_degrees(p.angle_deg)}",
        note=_note(r, vector),
    )


def _frames(C: Array, u: Array, angle_deg: float) -> list[Item]:
    """Both triads, and the arcs along which the tips of A2 came from those of A1."""
    share = np.linspace(0.0, np.clip(angle_deg, -360.0, 360.0), 49)
    paths = dcm_from_rotation_vector(np.radians(share)[:, None] * u)                        # (k, 3, 3)
    return [
        Frame("A1", np.eye(3), labels=("x₁", "y₁", "z₁"), role="frame_a1"),
        Frame("A2", C, labels=("x₂", "y₂", "z₂"), role="frame_a2"),
        *(Polyline(f"path_{name}", paths[:, :, i], role="frame_a2", width=1.5, fade=0.45)
          for i, name in enumerate("xyz")),
    ]


def _rotation(vector: Array, u: Array, angle_deg: float, length: float, handle: float) -> list[Item]:
    """The axis, p on it, and its angle at the arc."""
    start = np.eye(3)[int(np.argmin(np.abs(u)))]
    start = start - u * (u @ start)
    start /= np.linalg.norm(start)
    middle = dcm_from_rotation_vector(0.5 * np.clip(np.radians(angle_deg), -np.pi, np.pi) * u) @ start
    reach = max(1.3, handle)
    items: list[Item] = [
        Polyline("axis", np.array([-reach * u, reach * u]), role="rotation", width=1.5, dashed=True, fade=0.3),
        Label("axis_name", "axis u", (reach + 0.05) * u + 0.25 * start, size=0.9),
    ]
    if np.linalg.norm(vector) > 1e-9:
        items += [
            RotationVector("p", vector, length=length, arc_radius=ARC, start=start),
            Label("p_name", f"p, {np.linalg.norm(vector):.2f} rad", length * vector - 0.22 * start, size=0.9),
            Label("angle", f"φ = {_degrees(angle_deg)}", (ARC + 0.2) * middle, size=0.9),
        ]
    return items


def _vector(p: "Params", a: Array, a_A2: Array, C: Array, vector: Array) -> list[Item]:
    """a, its components along the chosen triads, and the copy of it that turns with A2."""
    items: list[Item] = [Arrow("a", (0.0, 0.0, 0.0), a, role="vector", width=6.0), Label("a_name", "a", 1.08 * a)]
    if p.components in ("both", "a1"):
        items += _components("A1", np.eye(3), a, a, "frame_a1")
    if p.components in ("both", "a2"):
        items += _components("A2", C, a_A2, a, "frame_a2")
    if p.carried:
        path = dcm_from_rotation_vector(np.linspace(0.0, 1.0, 73)[:, None] * vector)
        turned = C @ a
        items += [
            Polyline("carried_path", np.matvec(path, a), role="vector", width=2.0, dashed=True, fade=0.3),
            Arrow("carried", (0.0, 0.0, 0.0), turned, role="posterior", width=4.0),
            Label("carried_name", "C a", 1.08 * turned),
        ]
    return items


def _components(name: str, axes: Array, components: Array, a: Array, role: Role) -> list[Item]:
    """Component i of a: from the origin to the foot of the perpendicular from its tip to axis i."""
    feet = (axes * components).T                                                            # (3, 3), one foot a row
    return [
        Segments(f"components_{name}", np.stack([np.zeros((3, 3)), feet], axis=1), role=role, width=9.0, fade=0.35),
        Segments(f"perpendiculars_{name}", np.stack([feet, np.tile(a, (3, 1))], axis=1), role=role, width=1.5,
                 fade=0.25),
        Points(f"feet_{name}", feet, role=role, size=10.0),
        *(Label(f"component_{name}_{axis}", f"{value:.2f}", _beside(foot), size=0.9)
          for axis, value, foot in zip("xyz", components, feet, strict=True)),
    ]


def _beside(foot: Array) -> Array:
    """A little off the foot, so that the number does not cover its dot."""
    return foot + np.array([0.0, 0.0, -0.13])


def _figures(r: "Result", angle_deg: float) -> dict:
    roles: tuple[Role, ...] = ("axis_x", "axis_y", "axis_z")
    shown = {"cursor": angle_deg, "marks": (0.0, 360.0), "x_range": (r.grid_deg[0], r.grid_deg[-1])}
    return {
        "components": figures.chart(
            *(figures.line(f"a_{axis}", r.grid_deg, r.a_A2[:, i], role)
              for i, (axis, role) in enumerate(zip("xyz", roles, strict=True))), **shown),
        "quaternion": figures.chart(
            figures.line("q_0", r.grid_deg, r.q[:, 0], "reference"),
            *(figures.line(f"q_{i + 1}", r.grid_deg, r.q[:, i + 1], role) for i, role in enumerate(roles)), **shown),
        "shorter": figures.chart(
            figures.line("chosen", r.grid_deg, r.grid_deg, "reference", dash=True),
            figures.line("shortest", r.grid_deg, r.shorter_deg, "rotation"), **shown),
    }


def _readouts(vector: Array, a: Array, a_A2: Array, C: Array) -> list[Readout]:
    short = principal(vector)
    same = quaternion_from_rotation_vector(vector) @ quaternion_from_rotation_vector(short) > 0.0
    return [
        Readout("angle_rad", float(np.linalg.norm(vector)), "rad"),
        Readout("shortest_deg", float(np.degrees(np.linalg.norm(short))), "°"),
        Readout("sign", "+q" if same else "−q"),
        Readout("trace", round(float(np.trace(C)), 12)),
        Readout("a_difference", round(float(np.linalg.norm(a_A2 - a)), 12)),
        Readout("p_difference", round(float(np.linalg.norm(C.T @ vector - vector)), 12), "rad"),
    ]


def _equations(vector: Array, a: Array, a_A2: Array, C: Array) -> list[Equation]:
    p = float(np.linalg.norm(vector))
    short = principal(vector)
    turns = round(float(np.linalg.norm(vector - short)) / (2.0 * np.pi))
    return [
        Equation("p", (r"\mathbf{p} = \varphi\,\mathbf{u} =", vector, r"\mathrm{rad},\quad p =", p, r"\mathrm{rad}")),
        Equation("skew", (r"(\mathbf{p}\times) =", skew(vector))),
        Equation("factors", (r"\frac{\sin p}{p} =", float(np.sinc(p / np.pi)), r",\quad \frac{1-\cos p}{p^2} =",
                             float(0.5 * np.sinc(0.5 * p / np.pi)**2))),
        Equation("dcm", (DCM, C)),
        Equation("dcm_back", (r"C_{A1}^{A2} = (C_{A2}^{A1})^T =", C.T)),
        Equation("a", (r"\mathbf{a}^{A2} = C_{A1}^{A2}\,\mathbf{a}^{A1} = C_{A1}^{A2}", a, "=", a_A2)),
        Equation("invariant", (r"\mathbf{p}^{A2} = C_{A1}^{A2}\,\mathbf{p}^{A1} =", C.T @ vector,
                               r"= \mathbf{p}^{A1}")),
        Equation("quaternion", (r"q_{A2}^{A1} = [\,\cos\frac{p}{2};\ \sin\frac{p}{2}\,\mathbf{p}/p\,] =",
                                quaternion_from_rotation_vector(vector))),
        Equation("shortest", (r"\mathbf{p}_s = \mathbf{p}\,(1 - 2\pi k/p) =", short, r"\mathrm{rad},\quad k =",
                              float(turns))),
    ]


def _note(r: "Result", vector: Array) -> str:
    if not r.has_direction:
        return "The zero vector has no direction: the z axis is used instead."
    short = principal(vector)
    angle, shortest = (float(np.degrees(v @ r.u)) for v in (vector, short))
    if abs(abs(angle) - 180.0) < 1e-6:
        return "A half turn: p and −p give the same frame A2, and neither is shorter."
    if abs(angle) > 180.0:
        same = quaternion_from_rotation_vector(vector) @ quaternion_from_rotation_vector(short) > 0.0
        return (f"{_degrees(angle)} and {_degrees(shortest)} about u give the same frame A2 and the same DCM"
                + (", and even the same quaternion: two full turns lie between them." if same
                   else ", but quaternions of opposite sign."))
    return ""


def _degrees(angle: float) -> str:
    """Whole degrees where they are whole, else one decimal, with a real minus sign."""
    text = f"{angle:.1f}".removesuffix(".0")
    return ("0" if text == "-0" else text).replace("-", "−") + "°"
