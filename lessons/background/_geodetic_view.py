"""How a place on the ellipsoid is drawn: the normal that misses the centre, both latitudes, ECEF and ENU."""

from typing import TYPE_CHECKING

import numpy as np

from core.frames import dcm_enu_from_ecef
from core.geodesy import ecef_from_geodetic
from core.types import Array
from lessons.background._geodetic_figures import equations, figures, readouts
from lessons.kit.lesson import Moment, View
from lessons.kit.roles import Role
from lessons.kit.scene import Frame, Globe, Item, Label, Orbit, Points, Polyline, Segments

if TYPE_CHECKING:
    from lessons.background.geodetic import Params, Result

MM = 1e6                                     # metres in one scene unit, 1000 km
CIRCLE = np.linspace(-np.pi, np.pi, 97)
UP = np.array([0.0, 0.0, 1.0])


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Iterate at.step of the latitude at the place."""
    a = r.ellipsoid.a_m / MM
    reach = max(1.32 * a, float(np.linalg.norm(r.r_m)) / MM + 1.2)
    items = _earth(r)
    if p.show != "frames":
        items += [*_geocentric(r), *_aim(r, at.step), *_longitude(r)]
    if p.show != "latitudes":
        items += _frames(r)
    return View(
        scene=[*items, *_place(p, r)],
        camera=Orbit(radius=reach, azimuth_deg=-32.0, elevation_deg=17.0),
        figures=figures(r, at.step), readouts=readouts(r, at.step), equations=equations(r, at.step),
        caption=_caption(r, at.step), note=_note(r),
    )


def _earth(r: "Result") -> list[Item]:
    """The ellipsoid, its axis, its equator, and the meridians of Greenwich and of the place."""
    a, b = r.ellipsoid.a_m / MM, r.ellipsoid.b_m / MM
    half = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 65)
    return [
        Globe("earth", a, b, role="reference", opacity=0.16),
        Polyline("equator", a * _across(CIRCLE), role="reference", width=2.5),
        Polyline("greenwich", _meridian(half, 0.0, a, b), role="reference", width=2.5),
        Polyline("meridian", _meridian(half, float(r.place.lon_rad), a, b), role="truth", width=3.0),
        Polyline("axis", np.outer([-1.0, 1.0], (b + 0.12 * a) * UP), role="reference", width=1.5, dashed=True),
    ]


def _across(lon: Array | float) -> Array:
    """Unit vectors of the equator's plane."""
    lon = np.asarray(lon)
    return np.stack([np.cos(lon), np.sin(lon), np.zeros(lon.shape)], axis=-1)


def _meridian(angle: Array, lon: float, a: float, b: float) -> Array:
    return a * np.cos(angle)[:, None] * _across(lon) + b * np.sin(angle)[:, None] * UP


def _arc(name: str, centre: Array, lat: float, lon: float, radius: float, role: Role, text: str) -> list[Item]:
    """The angle from the equator's plane up to a line of this latitude, with its name."""
    out = _across(lon)
    share = np.linspace(0.0, lat, 33)[:, None]
    middle = np.cos(0.5 * lat) * out + np.sin(0.5 * lat) * UP
    return [Polyline(name, centre + radius * (np.cos(share) * out + np.sin(share) * UP), role=role, width=3.5),
            Label(f"{name}_name", text, centre + (radius + 0.45) * middle)]


def _geocentric(r: "Result") -> list[Item]:
    """The line from the centre, and its angle."""
    P, lon = r.r_m / MM, float(r.place.lon_rad)
    return [
        Polyline("radius", [np.zeros(3), P], role="linearised", width=3.0),
        *_arc("geocentric", np.zeros(3), r.geocentric_rad, lon, 0.28 * r.ellipsoid.a_m / MM, "linearised", "ψ"),
        Points("centre", [np.zeros(3)], role="linearised", size=11.0),
    ]


def _aim(r: "Result", step: int) -> list[Item]:
    """The line from the axis point of this iterate to P, the earlier ones faintly, and the latitude that it has."""
    P, out = r.r_m / MM, _across(float(r.place.lon_rad))
    Q = r.steps.axis_z_m[:step + 1, None] / MM * UP
    rho, z, lat = float(P @ out), P[2], float(r.steps.lat_rad[step])
    height = Q[-1, 2]
    crossing = rho * -height / (z - height) if abs(z - height) > 1e-9 else 0.0      # of the line with the equator
    lines = np.stack([Q, np.broadcast_to(P, Q.shape)], axis=1)
    items: list[Item] = [
        Segments("equator_radius", np.array([[np.zeros(3), r.ellipsoid.a_m / MM * out]]), role="reference", width=2.0),
        Polyline("normal", lines[-1], role="posterior", width=4.0),
        *_arc("geodetic", crossing * out, lat, float(r.place.lon_rad), 0.36 * r.ellipsoid.a_m / MM, "posterior", "φ"),
        Points("axis_points", Q, role="posterior", size=9.0),
    ]
    if step > 1:
        items.append(Segments("earlier", lines[1:-1], role="posterior", width=1.5, fade=0.6))
    if step and abs(height) > 0.3:
        items.append(Label("axis_point_name", "Q", Q[-1] + [0.0, 0.0, -0.4 if height < 0 else 0.4]))
    return items


def _longitude(r: "Result") -> list[Item]:
    lon, radius = float(r.place.lon_rad), 0.6 * r.ellipsoid.a_m / MM
    share = np.linspace(0.0, lon, 49)
    return [Polyline("longitude", radius * _across(share), role="truth", width=2.5),
            Label("longitude_name", "λ", (radius + 0.4) * _across(0.5 * lon) - 0.25 * UP)]


def _frames(r: "Result") -> list[Item]:
    """ECEF at the centre, East-North-Up at the place."""
    enu = dcm_enu_from_ecef(r.place.lat_rad, r.place.lon_rad)
    a = r.ellipsoid.a_m / MM
    return [Frame("ecef", np.eye(3), size=1.2 * a, labels=("x", "y", "z"), role="frame_a1", width=4.5),
            Frame("enu", enu.T, origin=r.r_m / MM, size=0.36 * a, labels=("E", "N", "U"), role="frame_a2", width=6.0)]


def _place(p: "Params", r: "Result") -> list[Item]:
    """P, the foot of its normal on the surface and the height between them."""
    P = r.r_m / MM
    foot = ecef_from_geodetic(r.place.lat_rad, r.place.lon_rad, 0.0, r.ellipsoid) / MM
    east, north, _ = dcm_enu_from_ecef(r.place.lat_rad, r.place.lon_rad)
    items: list[Item] = [Points("foot", [foot], role="truth", size=9.0),
                         Label("place_name", "P", P - 0.65 * north, 1.1)]
    if p.given == "geodetic":
        items.append(Points("place", [P], role="truth", size=14.0))
    if np.linalg.norm(P - foot) > 0.3:
        items += [Segments("height", np.array([[foot, P]]), role="measurement", width=7.0),
                  Label("height_name", "h", 0.5 * (foot + P) - 0.75 * east)]
    return items


def _caption(r: "Result", step: int) -> str:
    angle = f"φ = {np.degrees(r.steps.lat_rad[step]):.4f}°".replace("-", "−")
    return f"aim 0, from the centre: {angle}" if step == 0 else f"aim {step}, from Q: {angle}"


def _note(r: "Result") -> str:
    if r.error_deg[-1] > 0.1 and r.error_deg[-1] > r.error_deg[-2] - 1e-9:
        return "The aims stay at another normal: P is so deep inside that the nearest surface is elsewhere."
    if r.error_deg[-1] > 0.1:
        return f"After these aims the latitude is still off by {r.error_deg[-1]:.2g}°."
    return ""
