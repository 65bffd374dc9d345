"""A train along a meridian: the track must push it sideways by 2 M w v sin(latitude).  MAT exercise 1.19."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.frames import dcm_enu_from_ecef
from core.moving_frames import EARTH_RATE, MeridianTrain, coriolis_acceleration, meridian_train
from core.types import Array
from lessons.kit import figures as plot
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout, Timeline, View
from lessons.kit.scene import Arrow, Globe, Item, Label, Orbit, Points, Polyline, RotationVector

if TYPE_CHECKING:
    from lessons.background.rotating_frames import Params

STEPS = 40
LON_RAD = np.radians(25.0)                   # of Helsinki and of Rovaniemi, as the exercise rounds them
EARTH_RADIUS_M = 6371000.0
FORWARD = 0.42                               # length of the velocity's arrow, Earth radii
SIDEWAYS = 38.0                              # Earth radii per m/s^2
GRAVITY_MPS2 = 9.81
LATITUDES_DEG = np.linspace(-90.0, 90.0, 121)
UP = np.array([0.0, 0.0, 1.0])


class Journey(NamedTuple):
    """The train at every step of its way."""

    t_s: Array                   # (n,)
    way: MeridianTrain           # (n,) each
    velocity_mps: float          # northwards
    mass_kg: float
    force_n: Array               # (121,) to the west, at all latitudes


def journey(p: "Params") -> Journey:
    """From one latitude to the other at constant speed."""
    velocity = np.copysign(p.speed_kmh / 3.6, p.to_deg - p.from_deg)
    duration = EARTH_RADIUS_M * abs(np.radians(p.to_deg - p.from_deg)) / abs(velocity)
    t, mass = np.linspace(0.0, duration, STEPS + 1), 1e3 * p.mass_t
    way = meridian_train(t, np.radians(p.from_deg), velocity, mass, radius_m=EARTH_RADIUS_M)
    force = meridian_train(0.0, np.radians(LATITUDES_DEG), velocity, mass).lateral_force_n
    return Journey(t, way, float(velocity), mass, force)


def journey_timeline(p: "Params") -> Timeline:
    """The journey in forty steps; its time depends on way and speed."""
    minutes = EARTH_RADIUS_M * abs(np.radians(p.to_deg - p.from_deg)) / (p.speed_kmh / 3.6) / 60.0
    return Timeline(STEPS, start=STEPS // 2, scale=float(minutes) / STEPS, unit="min")


def journey_view(p: "Params", r: Journey, k: int) -> View:
    """The Earth with the route, the train's velocity, the deflection and the push of the track."""
    middle = 0.5 * np.radians(p.from_deg + p.to_deg)
    return View(
        scene=[*_earth(p), *_train(r, k)],
        camera=Orbit(centre=tuple((0.42 * _at(middle)).tolist()), radius=1.2, azimuth_deg=-22.0,
                     elevation_deg=float(18.0 * np.sin(middle) + 8.0)),
        figures=_figures(r, k), readouts=_readouts(r, k), equations=_equations(r, k),
        caption=f"t = {r.t_s[k] / 60.0:.0f} min, latitude {_latitude(float(r.way.lat_rad[k]))}",
        note="" if p.from_deg != p.to_deg else "Start and end are the same place: the train does not move on.")


def _latitude(lat_rad: float | np.floating) -> str:
    degrees = np.degrees(lat_rad)
    return f"{abs(degrees):.2f}° {'N' if degrees >= 0 else 'S'}"


def _at(lat_rad: Array | float) -> Array:
    """Points of the meridian on the sphere of radius 1."""
    lat = np.asarray(lat_rad)
    return np.stack([np.cos(lat) * np.cos(LON_RAD), np.cos(lat) * np.sin(LON_RAD), np.sin(lat)], axis=-1)


def _earth(p: "Params") -> list[Item]:
    ends = np.radians([p.from_deg, p.to_deg])
    west = np.array([np.sin(LON_RAD), -np.cos(LON_RAD), 0.0])
    forwards = np.sign(p.to_deg - p.from_deg) or 1.0
    # The names stand off the route at its two ends, clear of the arrows to the east and to the west.
    names = [(v, _at(v - side * forwards * 0.11) + 0.13 * west) for v, side in zip(ends, (1.0, -1.0), strict=True)]
    return [
        Globe("earth", role="reference", opacity=0.2),
        Polyline("axis", [-1.35 * UP, 1.35 * UP], role="reference", width=2.0, dashed=True),
        RotationVector("earth_rate", 1.6 * UP, origin=1.02 * UP, length=0.2, arc_radius=0.16, start=(1.0, 0.0, 0.0)),
        Label("earth_rate_name", "w", 1.4 * UP + [0.0, 0.09, 0.0], 1.1),
        Polyline("meridian", 1.002 * _at(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 65)), role="muted", width=2.5),
        Polyline("route", 1.004 * _at(np.linspace(*ends, 33)), role="truth", width=6.0),
        Points("ends", 1.004 * _at(ends), role="truth", size=10.0),
        *(Label(f"end_{k}", _latitude(v), at, 0.9) for k, (v, at) in enumerate(names)),
    ]


def _train(r: Journey, k: int) -> list[Item]:
    """Velocity, deflection, push, and the angle between the velocity and the Earth's axis."""
    lat = float(r.way.lat_rad[k])
    east, north, _ = dcm_enu_from_ecef(lat, LON_RAD)
    at = 1.015 * _at(lat)
    heading = np.sign(r.velocity_mps) * north
    push = SIDEWAYS * float(r.way.lateral_acceleration_mps2[k])
    angle = float(r.way.angle_to_axis_rad[k])
    # The direction that is an angle s from the axis towards the velocity, both in the plane of the meridian.
    across = heading - np.cos(angle) * UP
    across = across / max(float(np.linalg.norm(across)), 1e-12)
    fan = np.linspace(0.0, angle, 33)
    arc = np.cos(fan)[:, None] * UP + np.sin(fan)[:, None] * across
    items: list[Item] = [
        Points("train", [at], role="truth", size=15.0, shape="square"),
        Arrow("velocity", at, at + FORWARD * heading, role="vector", width=6.0),
        Label("velocity_name", "v", at + (FORWARD + 0.07) * heading, 1.1),
        Polyline("parallel", [at, at + FORWARD * UP], role="rotation", width=3.0, dashed=True),
        Polyline("angle", at + 0.28 * arc, role="rotation", width=3.0),
        Label("angle_name", f"{np.degrees(angle):.1f}°", at + 0.4 * arc[16], 0.9),
    ]
    if abs(push) > 0.01:
        side = np.sign(push) * 0.08 * east
        items += [Arrow("deflection", at, at + push * east, role="innovation", width=6.0),
                  Arrow("push", at, at - push * east, role="posterior", width=6.0),
                  Label("deflection_name", "−2w×v", at + push * east + 1.7 * side, 0.95),
                  Label("push_name", "F/M", at - push * east - 1.2 * side, 1.0)]
    return items


def _figures(r: Journey, k: int) -> dict:
    minutes, here = r.t_s / 60.0, float(r.t_s[k]) / 60.0
    span = (0.0, max(float(minutes[-1]), 1e-3))
    return {
        "force": plot.chart(plot.line("force", minutes, r.way.lateral_force_n, "posterior"), cursor=here, x_range=span),
        "angle": plot.chart(plot.line("angle", minutes, np.degrees(r.way.angle_to_axis_rad), "rotation"), cursor=here,
                            x_range=span),
        "by_latitude": plot.chart(plot.line("force", LATITUDES_DEG, r.force_n, "posterior"),
                                  cursor=float(np.degrees(r.way.lat_rad[k])), x_range=(-90.0, 90.0)),
    }


def _readouts(r: Journey, k: int) -> list[Readout]:
    push = float(r.way.lateral_acceleration_mps2[k])
    force = float(r.way.lateral_force_n[k])
    side = "none" if abs(force) < 1e-6 else "west" if force > 0 else "east"
    return [
        Readout("latitude", float(np.degrees(r.way.lat_rad[k])), "°"),
        Readout("force", abs(force), "N", digits=6),
        Readout("side", side),
        Readout("push", abs(push), "m/s²"),
        Readout("tilt", float(np.degrees(np.arctan(abs(push) / GRAVITY_MPS2))), "°", digits=2),
        Readout("axis_angle", float(np.degrees(r.way.angle_to_axis_rad[k])), "°", digits=5),
        Readout("travel", float(r.t_s[-1]) / 60.0, "min", digits=5),
    ]


def _equations(r: Journey, k: int) -> list[Equation]:
    lat, v = float(r.way.lat_rad[k]), r.velocity_mps
    apparent = coriolis_acceleration([0.0, v, 0.0], lat)
    return [
        Equation("train_latitude", (r"\varphi(t) = \varphi_0 + vt/R =", float(np.degrees(lat)), r"^\circ"), digits=6),
        Equation("train_v", (r"\mathbf{v}^L =", np.array([0.0, v, 0.0]), r"\mathrm{m/s},\quad \omega =",
                             1e5 * EARTH_RATE, r"\cdot 10^{-5}\ \mathrm{rad/s}"), digits=5),
        Equation("train_coriolis", (r"-2\,\mathbf{w}\times\mathbf{v} =", apparent, r"\mathrm{m/s^2}\ (E, N, U)")),
        Equation("train_force", (r"F = 2M\omega v\sin\varphi =", float(r.way.lateral_force_n[k]),
                                 r"\mathrm{N\ to\ the\ west},\quad M =", r.mass_kg, r"\mathrm{kg}"), digits=6,
                 current=True),
        Equation("train_angle", (r"\angle(\mathbf{v}, \mathbf{w}) =",
                                 float(np.degrees(r.way.angle_to_axis_rad[k])), r"^\circ"), digits=6),
    ]
