"""The merry-go-round: the same motion seen from the ground, A1, and from the platform, A2.  MAT Example 13."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.moving_frames import dcm_ecef_from_eci, velocity_in_rotating_frame
from core.types import Array
from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout, Timeline, View
from lessons.kit.roles import Role
from lessons.kit.scene import Arrow, Frame, Item, Label, Orbit, Points, Polygon, Polyline, RotationVector, Segments

if TYPE_CHECKING:
    from lessons.background.rotating_frames import Params

STEPS, DURATION_S = 100, 10.0
SHOWN = 80                                   # step shown first
RADIUS = 2.0                                 # of the platform, m
ASIDE = np.array([4.4, 0.0, 0.0])            # where A2's view stands beside A1's, which is at the origin
LONGEST = 1.2                                # longest arrow, scene units
RIM = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]


class Ride(NamedTuple):
    """The object at every step: in A1, in A2, and why A2 sees it accelerate.  Metres and seconds."""

    t_s: Array                   # (n,)
    C: Array                     # (n, 3, 3) C_{A1}^{A2}
    a_A1: Array                  # (n, 3)
    a_A2: Array                  # (n, 3)
    v_A1: Array                  # (3,)
    carried: Array               # (n, 3) -w x a^{A2}, what the spin adds
    v_A2: Array                  # (n, 3)
    coriolis: Array              # (n, 3) -2 w x v^{A2}
    centrifugal: Array           # (n, 3) -w x (w x a^{A2})


def ride(p: "Params") -> Ride:
    """From start to goal in ten seconds, straight and at constant speed, as no force acts."""
    t = np.linspace(0.0, DURATION_S, STEPS + 1)
    w = np.array([0.0, 0.0, p.spin_rad_s])
    C = dcm_ecef_from_eci(t, p.spin_rad_s)                                                  # (1.15), theta = w t
    v_A1 = (np.array(p.goal) - p.start) / DURATION_S
    a_A1 = p.start + t[:, None] * v_A1
    a_A2 = np.matvec(C, a_A1)
    v_A2 = velocity_in_rotating_frame(a_A1, v_A1, C.mT, w)                                  # (1.23)
    return Ride(t, C, a_A1, a_A2, v_A1, -np.cross(w, a_A2), v_A2, -2.0 * np.cross(w, v_A2),
                -np.cross(w, np.cross(w, a_A2)))


def ride_timeline(p: "Params") -> Timeline:
    """Ten seconds in tenths."""
    return Timeline(STEPS, start=SHOWN, scale=DURATION_S / STEPS, unit="s")


def ride_view(p: "Params", r: Ride, k: int) -> View:
    """The ground's view at the left, the platform's at the right."""
    return View(
        scene=[*_ground(p, r, k), *_platform(p, r, k)],
        camera=Orbit(centre=(2.2, 0.0, 0.1), radius=4.55, azimuth_deg=-90.0, elevation_deg=52.0),
        figures=_figures(r, k), readouts=_readouts(r, k), equations=_equations(p, r, k),
        caption=f"t = {r.t_s[k]:.1f} s, the platform has turned by {_degrees(p.spin_rad_s * r.t_s[k])}",
        note="" if p.spin_rad_s else "Without spin both frames see the same.")


def _degrees(angle_rad: float) -> str:
    return f"{np.degrees(angle_rad):.0f}°".replace("-", "−")


def _disc(name: str, at: Array, C: Array) -> list[Item]:
    """The platform with spokes; C maps its coordinates to the scene's."""
    rim = np.stack([RADIUS * np.cos(RIM), RADIUS * np.sin(RIM), np.zeros(len(RIM))], axis=-1)
    spokes = np.stack([0.12 * rim[::6], rim[::6]], axis=1)
    return [Polygon(f"{name}_disc", at + rim, role="muted", opacity=0.25),
            Segments(f"{name}_spokes", at + np.matvec(C, spokes), role="muted", width=2.5)]


def _triads(name: str, at: Array, C_A1: Array, C_A2: Array) -> list[Item]:
    return [Frame(f"{name}_A1", C_A1, at, 1.25, ("x₁", "y₁", ""), role="frame_a1", width=4.0),
            Frame(f"{name}_A2", C_A2, at, 1.25, ("x₂", "y₂", ""), role="frame_a2", width=4.0)]


def _object(name: str, at: Array, path: Array) -> list[Item]:
    """Where it has been, where it is, and its foot on the platform when it hovers."""
    here = at + path[-1]
    items: list[Item] = [Points(name, [here], role="truth", size=11.0)]
    if len(path) > 1:
        items.append(Polyline(f"{name}_path", at + path, role="truth", width=4.0))
    if abs(path[-1, 2]) > 0.02:
        items.append(Polyline(f"{name}_drop", [here, here * [1.0, 1.0, 0.0]], role="muted", width=1.5, dashed=True))
    return items


def _ground(p: "Params", r: Ride, k: int) -> list[Item]:
    """A1: the axes stand still, the platform turns, the object moves straight."""
    C, angle = r.C[k].T, p.spin_rad_s * r.t_s[k]
    items = [*_disc("ground", np.zeros(3), C), *_triads("ground", np.zeros(3), np.eye(3), C),
             Label("ground_name", "seen from the ground, A1", (0.0, -RADIUS - 0.75, 0.0), 1.1),
             Polyline("plan", [p.start, p.goal], role="muted", width=2.0, dashed=True),
             *_object("object_A1", np.zeros(3), r.a_A1[:k + 1])]
    turned = np.sign(angle) * (abs(angle) % (2.0 * np.pi))
    if abs(turned) > 1e-6:
        items.append(RotationVector("spin", (0.0, 0.0, turned), length=0.0, arc_radius=RADIUS + 0.16,
                                    start=(1.0, 0.0, 0.0)))
    if p.arrows == "velocity":
        items += _arrow("v_A1", r.a_A1[k], _scale(r.v_A2, r.v_A1, r.carried) * r.v_A1, "vector", "v in A1")
    return items


def _platform(p: "Params", r: Ride, k: int) -> list[Item]:
    """A2: the platform stands still, the ground turns the other way, and the object's path bends."""
    items = [*_disc("platform", ASIDE, np.eye(3)), *_triads("platform", ASIDE, r.C[k], np.eye(3)),
             Label("platform_name", "seen from the platform, A2", ASIDE - [0.0, RADIUS + 0.75, 0.0], 1.1),
             Polyline("plan_A2", ASIDE + r.a_A2, role="muted", width=2.0, dashed=True),
             *_object("object_A2", ASIDE, r.a_A2[:k + 1])]
    here = ASIDE + r.a_A2[k]
    if p.arrows == "velocity":
        scale, turned = _scale(r.v_A2, r.v_A1, r.carried), r.C[k] @ r.v_A1
        if not turned.any():                                     # then both are one arrow
            return [*items, *_arrow("v_A2", here, scale * r.v_A2[k], "posterior", "v in A2 = −w×a")]
        items += [*_arrow("v_turned", here, scale * turned, "vector", "C v"),
                  *_arrow("carried", here + scale * turned, scale * r.carried[k], "rotation", ""),
                  *_arrow("v_A2", here, scale * r.v_A2[k], "posterior", "v in A2")]
    if p.arrows == "acceleration":
        scale = _scale(r.coriolis, r.centrifugal)
        items += [*_arrow("coriolis", here, scale * r.coriolis[k], "innovation", "−2w×v"),
                  *_arrow("centrifugal", here, scale * r.centrifugal[k], "linearised", "−w×(w×a)")]
    return items


def _scale(*vectors: Array) -> float:
    """Scene units per unit of the vectors, the same all the time."""
    longest = max(float(np.sqrt((v * v).sum(axis=-1)).max()) for v in vectors)
    return LONGEST / max(longest, LONGEST, 1e-12) if longest > 0.4 * LONGEST else 0.6 * LONGEST / max(longest, 1e-12)


def _arrow(name: str, at: Array, v: Array, role: Role, text: str) -> list[Item]:
    length = float(np.linalg.norm(v))
    if length < 0.02:
        return []
    items: list[Item] = [Arrow(name, at, at + v, role=role, width=6.0)]
    if text and length > 0.25:
        items.append(Label(f"{name}_name", text, at + v * (1.0 + 0.22 / length), 0.9))
    return items


def _norm(v: Array) -> Array:
    return np.sqrt((v * v).sum(axis=-1))


def _figures(r: Ride, k: int) -> dict:
    shown = {"cursor": float(r.t_s[k]), "x_range": (0.0, DURATION_S)}
    still = np.full(len(r.t_s), float(_norm(r.v_A1)))
    return {
        "components": plot.chart(plot.line("x", r.t_s, r.a_A2[:, 0], "axis_x"),
                                 plot.line("y", r.t_s, r.a_A2[:, 1], "axis_y"),
                                 plot.line("z", r.t_s, r.a_A2[:, 2], "axis_z"), **shown),
        "speed": plot.chart(plot.line("ground", r.t_s, still, "vector"),
                            plot.line("platform", r.t_s, _norm(r.v_A2), "posterior"), **shown),
        "apparent": plot.chart(plot.line("coriolis", r.t_s, _norm(r.coriolis), "innovation"),
                               plot.line("centrifugal", r.t_s, _norm(r.centrifugal), "linearised"), **shown),
    }


def _readouts(r: Ride, k: int) -> list[Readout]:
    return [
        Readout("speed_A1", float(_norm(r.v_A1)), "m/s"),
        Readout("speed_A2", float(_norm(r.v_A2[k])), "m/s"),
        Readout("distance", float(_norm(r.a_A1[k])), "m"),
        Readout("coriolis", float(_norm(r.coriolis[k])), "m/s²"),
        Readout("centrifugal", float(_norm(r.centrifugal[k])), "m/s²"),
    ]


def _equations(p: "Params", r: Ride, k: int) -> list[Equation]:
    clean = [np.round(v, 12) + 0.0 for v in (r.C[k], r.a_A1[k], r.a_A2[k], r.C[k] @ r.v_A1, r.carried[k], r.v_A2[k],
                                             r.coriolis[k], r.centrifugal[k])]
    C, a_A1, a_A2, turned, carried, v_A2, coriolis, centrifugal = clean
    return [
        Equation("theta", (r"\theta = \omega t =", float(p.spin_rad_s * r.t_s[k]), r"\mathrm{rad}")),
        Equation("dcm", (r"C_{A1}^{A2} =", C), digits=3),
        Equation("a", (r"\mathbf{a}^{A2} = C_{A1}^{A2}", a_A1, "=", a_A2, r"\mathrm{m}"), digits=3),
        Equation("velocity", (r"\frac{d\mathbf{a}^{A2}}{dt} = C_{A1}^{A2}\frac{d\mathbf{a}^{A1}}{dt} - "
                              r"\mathbf{w}\times\mathbf{a}^{A2} =", turned, "+", carried, "=", v_A2,
                              r"\mathrm{m/s}"), digits=3, current=p.arrows == "velocity"),
        Equation("acceleration", (r"\frac{d^2\mathbf{a}^{A2}}{dt^2} = -2\,\mathbf{w}\times\frac{d\mathbf{a}^{A2}}{dt}"
                                  r" - \mathbf{w}\times(\mathbf{w}\times\mathbf{a}^{A2}) =", coriolis, "+", centrifugal,
                                  r"\mathrm{m/s^2}"), digits=3, current=p.arrows == "acceleration"),
    ]
