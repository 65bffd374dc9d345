"""x = (N + h) cos φ cos λ, ..., z = (N (1 - e²) + h) sin φ: geodetic and Cartesian coordinates.  MAT 1.4, Fig 1.5."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.geodesy import (
    WGS84,
    Ellipsoid,
    Geodetic,
    ecef_from_geodetic,
    geocentric_latitude,
    geodetic_from_ecef,
)
from core.geodetic_iteration import LatitudeIteration, latitude_iteration
from core.types import Array
from lessons.background._geodetic_view import MM, view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, slider

ITERATIONS = 8
LATITUDES_DEG = np.linspace(-90.0, 90.0, 181)


@dataclass(frozen=True, slots=True)
class Params:
    """A place, given by Cartesian or by geodetic coordinates, and the ellipsoid."""

    given: str = choice("point", ("point", "geodetic"), group="place")
    P: Point = draggable((6.0, 2.2, 3.3), low=-15.0, high=15.0, unit="1000 km", plane="sphere", role="truth",
                         group="place")
    lat_deg: float = slider(61.4978, low=-90.0, high=90.0, step=0.0001, unit="°", group="place")
    lon_deg: float = slider(23.761, low=-180.0, high=180.0, step=0.0001, unit="°", group="place")
    h_km: float = slider(0.1, low=-10.0, high=10000.0, step=0.01, unit="km", group="place")
    ellipsoid: str = choice("flattened", ("flattened", "wgs84"), group="ellipsoid")
    f: float = slider(0.35, low=0.0, high=0.6, step=0.01, group="ellipsoid")
    show: str = choice("all", ("all", "latitudes", "frames"), group="view")


class Result(NamedTuple):
    """The place in both kinds of coordinates, the way to its latitude, and curves over latitude."""

    ellipsoid: Ellipsoid
    r_m: Array                           # (3,) ECEF
    place: Geodetic
    geocentric_rad: float                # of r_m
    steps: LatitudeIteration             # (ITERATIONS + 1,) each
    error_deg: Array                     # (ITERATIONS + 1,) of the iterates
    error_wgs84_deg: Array               # the same at the same latitude and height on WGS-84
    difference_deg: Array                # (181,) geodetic minus geocentric, on the surface of the drawn ellipsoid
    difference_wgs84_arcmin: Array       # (181,) on WGS-84
    here_wgs84_arcmin: float             # at the place's latitude, on the surface


def compute(p: Params, progress: Progress) -> Result:
    """Cartesian from geodetic coordinates or back, and the iteration that finds the latitude."""
    ellipsoid = WGS84 if p.ellipsoid == "wgs84" else Ellipsoid(WGS84.a_m, p.f)
    if p.given == "point":
        r_m = MM * np.array(p.P)
        place = geodetic_from_ecef(r_m, ellipsoid)
    else:
        place = Geodetic(*(np.asarray(v) for v in (np.radians(p.lat_deg), np.radians(p.lon_deg), 1e3 * p.h_km)))
        r_m = ecef_from_geodetic(*place, ellipsoid)
    steps = latitude_iteration(r_m, ITERATIONS, ellipsoid)
    progress(0.5)
    real = latitude_iteration(ecef_from_geodetic(*place), ITERATIONS)
    lat = np.radians(LATITUDES_DEG)
    off, off_wgs84 = (np.degrees(lat - geocentric_latitude(lat, 0.0, e)) for e in (ellipsoid, WGS84))
    return Result(
        ellipsoid, r_m, place, float(steps.lat_rad[0]), steps,
        *(np.degrees(np.abs(s.lat_rad - place.lat_rad)) for s in (steps, real)), off, 60.0 * off_wgs84,
        60.0 * float(np.degrees(place.lat_rad - geocentric_latitude(place.lat_rad))))


def timeline(p: Params) -> Timeline:
    """The first guess (aim from the centre) and its improvements; the last is shown first."""
    return Timeline(ITERATIONS, start=ITERATIONS)


def _place(lat_deg: float, lon_deg: float, h_km: float, **other: object) -> dict[str, object]:
    return {"given": "geodetic", "lat_deg": lat_deg, "lon_deg": lon_deg, "h_km": h_km, **other}


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    unused=lambda p: ({"lat_deg", "lon_deg", "h_km"} if p.given == "point" else {"P"})
    | ({"f"} if p.ellipsoid == "wgs84" else set()),
    refs=("MAT 1.4", "MAT Fig 1.5", "MAT 1.5", "MAT (1.13)"),
    presets={
        "Fig 1.5, flattened": {},
        "first guess: from the centre": {"step": 0, "show": "latitudes"},
        "WGS-84: Tampere": _place(61.4978, 23.761, 0.1, ellipsoid="wgs84"),
        "WGS-84: Helsinki": _place(60.1699, 24.9384, 0.02, ellipsoid="wgs84"),
        "45°, 1 km high, Greenwich": _place(45.0, 0.0, 1.0, ellipsoid="wgs84"),
        "a sphere": {"f": 0.0},
        "the south": _place(-45.0, 65.0, 1200.0, f=0.45),
        "at the north pole": _place(90.0, 0.0, 500.0),
    },
)
