"""Inertial, Earth-fixed, local and body frame on the turning Earth, and what gyros feel of it.  MAT 1.5."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.frames import dcm_enu_from_ecef
from core.moving_frames import EARTH_RATE, TurnRates, dcm_ecef_from_eci, turn_rates
from core.types import Array
from lessons.background._phone import phone
from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout, Timeline, View
from lessons.kit.scene import Arrow, Frame, Globe, Item, Label, Orbit, Points, Polyline, RotationVector

if TYPE_CHECKING:
    from lessons.background.rotating_frames import Params

STEPS, STEP_H = 96, 0.25
DEG_H = np.degrees(1.0) * 3600.0             # degrees an hour in one rad/s
LATITUDES_DEG = np.linspace(-85.0, 85.0, 86)
RATE_LENGTH = 0.45                           # Earth radii for the Earth's rate
ABOVE = 0.72                                 # height of the body over the place, for the eye
UP = np.array([0.0, 0.0, 1.0])


class Day(NamedTuple):
    """The frames at every step of a day, the rates at the place and those at all latitudes."""

    t_s: Array                   # (n,)
    C_IE: Array                  # (n, 3, 3) C_I^E
    C_EL: Array                  # (3, 3) C_E^L
    C_LB: Array                  # (3, 3) C_L^B
    velocity_mps: Array          # (3,) East, North, Up
    rates: TurnRates             # (3,) each, in L
    gyro_rad_s: Array            # (3,) w_IB^B
    by_latitude: Array           # (86, 3) w_IL^L at the same velocity


def day(p: "Params") -> Day:
    """All frames from ECI to the body; the body is fixed to the local frame."""
    t = 3600.0 * STEP_H * np.arange(STEPS + 1)
    lat, heading, pitch, course = np.radians([p.lat_deg, p.heading_deg, p.pitch_deg, p.course_deg])
    v = p.ground_speed_kmh / 3.6 * np.array([np.sin(course), np.cos(course), 0.0])
    C_LB = _body_from_local(heading, pitch)
    rates = turn_rates(lat, 0.0, v)
    return Day(t, dcm_ecef_from_eci(t), dcm_enu_from_ecef(lat, np.radians(p.lon_deg)), C_LB, v, rates,
               C_LB @ rates.total, turn_rates(np.radians(LATITUDES_DEG), 0.0, v).total)


def _body_from_local(heading: float, pitch: float) -> Array:
    """C_L^B with the rows x (forwards, clockwise from north by the heading, up by the pitch), y (left), z."""
    sin, cos = np.sin(heading), np.cos(heading)
    forwards = np.array([sin * np.cos(pitch), cos * np.cos(pitch), np.sin(pitch)])
    left = np.array([-cos, sin, 0.0])
    return np.stack([forwards, left, np.cross(forwards, left)])


def day_timeline(p: "Params") -> Timeline:
    """A day in quarters of an hour."""
    return Timeline(STEPS, start=8, scale=STEP_H, unit="h")


def day_view(p: "Params", r: Day, k: int) -> View:
    """The frames after t; the stars or the Earth stand still."""
    stars = p.seen_from == "stars"
    turn = r.C_IE[k].T                                           # C_E^I
    C_E, C_I = (turn, np.eye(3)) if stars else (np.eye(3), turn.T)
    return View(
        scene=[*_centre(C_E, C_I), *_here(p, r, k, C_E)],
        camera=Orbit(centre=(0.0, 0.0, 0.1), radius=1.9, azimuth_deg=-8.0, elevation_deg=22.0),
        figures=_figures(p, r, k), readouts=_readouts(r), equations=_equations(r, k),
        caption=f"t = {r.t_s[k] / 3600.0:.2f} h, the Earth has turned by {np.degrees(EARTH_RATE * r.t_s[k]):.1f}°")


def _centre(C_E: Array, C_I: Array) -> list[Item]:
    """The Earth, ECI and ECEF; their z axes are one line, so that ECI is drawn longer."""
    half = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 65)
    greenwich = 1.003 * np.stack([np.cos(half), np.zeros(65), np.sin(half)], axis=-1)
    return [
        Globe("earth", dcm=C_E, role="reference", opacity=0.2),
        Polyline("greenwich", np.matvec(C_E, greenwich), role="frame_a2", width=3.0),
        Frame("I", C_I, size=1.62, labels=("x I", "y I", "z I"), role="frame_a1", width=5.0),
        Frame("E", C_E, size=1.3, labels=("x E", "y E", "z E"), role="frame_a2", width=5.0),
        RotationVector("earth_rate", 4.5 * UP, origin=1.03 * UP, length=0.0, arc_radius=0.2, start=C_I[:, 0]),
    ]


def _here(p: "Params", r: Day, k: int, C_E: Array) -> list[Item]:
    """The local frame at the place, the body above it, the rate of the local frame, and the way of the place."""
    C_L, C_B = C_E @ r.C_EL.T, C_E @ r.C_EL.T @ r.C_LB.T         # C_L^scene, C_B^scene
    up = C_L[:, 2]
    body = (1.0 + ABOVE) * up
    rate = RATE_LENGTH / EARTH_RATE * (C_L @ r.rates.total)
    items: list[Item] = [
        Frame("L", C_L, up, 0.45, ("E", "N", "U"), role="likelihood", width=5.0),
        *phone("device", C_B, body, 0.13, detailed=False),
        Frame("B", C_B, body, 0.3, ("x B", "y B", "z B"), role="vector", width=4.0),
        Points("place", [up], role="truth", size=11.0),
        Arrow("rate", up, up + rate, role="rotation", width=6.0),
        Label("rate_name", "w", up + rate + 0.08 * rate / max(float(np.linalg.norm(rate)), 1e-12), 1.1),
    ]
    if p.ground_speed_kmh > 0.0:
        v = C_L @ r.velocity_mps
        items.append(Arrow("velocity", up, up + 0.4 * v / np.linalg.norm(v), role="truth", width=4.0))
    if p.seen_from == "stars" and k:
        way = np.matvec(r.C_IE[:k + 1].mT, r.C_EL[2])
        items.append(Polyline("way", 1.004 * way, role="truth", width=3.0))
    return items


def _figures(p: "Params", r: Day, k: int) -> dict:
    hours = r.t_s / 3600.0
    place = np.matvec(r.C_IE.mT, r.C_EL[2])                      # Up, the place on a sphere of radius 1
    east, north, up = DEG_H * r.by_latitude.T
    return {
        "rates": plot.chart(plot.line("east", LATITUDES_DEG, east, "axis_x"),
                            plot.line("north", LATITUDES_DEG, north, "axis_y"),
                            plot.line("up", LATITUDES_DEG, up, "axis_z"), cursor=p.lat_deg, x_range=(-85.0, 85.0)),
        "inertial": plot.chart(*(plot.line(axis, hours, place[:, i], role) for i, (axis, role) in enumerate(
            (("x", "axis_x"), ("y", "axis_y"), ("z", "axis_z")))), cursor=float(hours[k]), x_range=(0.0, 24.0)),
    }


def _readouts(r: Day) -> list[Readout]:
    return [
        *(Readout(f"rate_{name}", float(DEG_H * v), "°/h") for name, v in zip(("east", "north", "up"), r.rates.total,
                                                                           strict=True)),
        *(Readout(f"gyro_{axis}", float(DEG_H * v), "°/h") for axis, v in zip("xyz", r.gyro_rad_s, strict=True)),
        Readout("gyro", float(DEG_H * np.linalg.norm(r.gyro_rad_s)), "°/h", digits=5),
    ]


def _equations(r: Day, k: int) -> list[Equation]:
    scale = 1e5
    C_IB = r.C_LB @ r.C_EL @ r.C_IE[k]
    unit = r"\cdot 10^{-5}\ \mathrm{rad/s}"
    return [
        Equation("C_IE", (r"C_I^E =", np.round(r.C_IE[k], 12) + 0.0), digits=3),
        Equation("C_EL", (r"C_E^L =", np.round(r.C_EL, 12) + 0.0), digits=3),
        Equation("C_LB", (r"C_L^B =", np.round(r.C_LB, 12) + 0.0), digits=3),
        Equation("C_IB", (r"C_I^B = C_L^B\,C_E^L\,C_I^E =", np.round(C_IB, 12) + 0.0), digits=3),
        Equation("w_IE", (r"\mathbf{w}_{IE}^L = C_E^L\,[0,\,0,\,\omega]^T =", scale * r.rates.earth, unit)),
        Equation("w_EL", (r"\mathbf{w}_{EL}^L =", scale * r.rates.transport + 0.0, unit)),
        Equation("w_IL", (r"\mathbf{w}_{IL}^L = \mathbf{w}_{IE}^L + \mathbf{w}_{EL}^L =", scale * r.rates.total + 0.0,
                          unit)),
        Equation("w_IB", (r"\mathbf{w}_{IB}^B = C_L^B\,\mathbf{w}_{IL}^L =", scale * r.gyro_rad_s + 0.0, unit)),
    ]
