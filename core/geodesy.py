"""Geodetic coordinates on an ellipsoid of revolution and Earth-fixed Cartesian ones (ECEF).  MAT 1.4.

Angles in radians, lengths in metres.  North latitude, east longitude and outward height are positive.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.types import Array


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """Ellipsoid of revolution with semi-major axis a and flattening f = (a - b) / a, 0 <= f < 1.

    a_m in metres.  ValueError for other numbers.  MAT 1.4.
    """

    a_m: float
    f: float

    def __post_init__(self) -> None:
        if not (0.0 < self.a_m < np.inf and 0.0 <= self.f < 1.0):
            raise ValueError(f"ellipsoid: expected a_m > 0 and 0 <= f < 1, got a_m = {self.a_m}, f = {self.f}")

    @property
    def b_m(self) -> float:
        """Semi-minor axis b = a (1 - f), metres."""
        return self.a_m * (1.0 - self.f)

    @property
    def e2(self) -> float:
        """Squared eccentricity e^2 = f (2 - f)."""
        return self.f * (2.0 - self.f)


WGS84 = Ellipsoid(6378137.0, 1.0 / 298.257223563)
GRS80 = Ellipsoid(6378137.0, 1.0 / 298.257222101)           # of EUREF-FIN


class Geodetic(NamedTuple):
    """lat_rad in [-pi/2, pi/2], lon_rad in [-pi, pi], h_m along the outward normal; each (...)."""

    lat_rad: Array
    lon_rad: Array
    h_m: Array


def prime_vertical_radius(lat_rad: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> Array:
    """N = a / sqrt(1 - e^2 sin^2 lat), the distance along the normal from the surface to the axis.

    lat_rad (...) geodetic -> (...) in metres.  ValueError for a latitude beyond the poles.  MAT 1.4.

    >>> float(prime_vertical_radius(0.0))
    6378137.0
    """
    return ellipsoid.a_m / np.sqrt(1.0 - ellipsoid.e2 * np.square(np.sin(latitude(lat_rad))))


def ecef_from_geodetic(
    lat_rad: ArrayLike, lon_rad: ArrayLike, h_m: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> Array:
    """x = (N + h) cos lat cos lon,  y = (N + h) cos lat sin lon,  z = (N (1 - e^2) + h) sin lat.

    lat_rad, lon_rad, h_m broadcast to (...) -> (..., 3) in metres: x towards Greenwich on the equator, z north.
    ValueError for a latitude beyond the poles (degrees, perhaps) or a non-finite number.  MAT 1.4, Fig 1.5.

    >>> ecef_from_geodetic(0.0, np.pi / 2, 100.0).round(6).tolist()
    [0.0, 6378237.0, 0.0]
    """
    lat, lon, h = np.broadcast_arrays(latitude(lat_rad), finite("lon_rad", lon_rad), finite("h_m", h_m))
    N = prime_vertical_radius(lat, ellipsoid)
    across = (N + h) * np.cos(lat)
    along = (N * (1.0 - ellipsoid.f) ** 2 + h) * np.sin(lat)
    return np.stack([across * np.cos(lon), across * np.sin(lon), along], axis=-1)


def geodetic_from_ecef(r_m: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> Geodetic:
    """Foot of the normal: u > 0 with (rho / (u + e^2))^2 + ((1 - f) z / u)^2 = 1,  tan lat = z (u + e^2) / (rho u).

    r_m (..., 3) in metres -> latitude, longitude, height, each (...).  With a = 1, the nearest point of the surface
    is at rho / (u + e^2) from the axis.  The left side falls in u and its power -1/2 is concave, so Newton's method
    from below converges from everywhere: to rounding (1e-15 rad, some 1e-9 m) in three steps above the ground, also
    at the poles, on the equator and inside the Earth.  On the axis the longitude is 0; on the disc round the centre
    (21 km from it for the Earth), whose nearest point is not unique, the northern one.  MAT 1.4, Fig 1.5.

    >>> [float(c.round(6)) for c in geodetic_from_ecef([6378137.0 + 50.0, 0.0, 0.0])]
    [0.0, 0.0, 50.0]
    """
    r = finite("r_m", r_m, 3)
    e2, c = ellipsoid.e2, 1.0 - ellipsoid.f
    x, y, height = (r[..., i] / ellipsoid.a_m + 0.0 for i in range(3))          # + 0.0: no negative zeros
    rho, z = np.hypot(x, y), np.abs(height)
    u = np.maximum(c * z, rho - e2)                       # one of the two terms is 1 here: not above the root
    unique = u > 1e-290                                  # nothing overflows; below, z is zero for all purposes
    u = np.where(unique, u, 1.0)
    for _ in range(60):
        A, B = rho / (u + e2), c * z / u
        size = np.square(A) + np.square(B)
        size = np.where(unique, size, 1.0)
        slope = (np.square(A) / (u + e2) + np.square(B) / u) / size
        step = np.where(unique, (np.sqrt(size) - 1.0) / np.where(unique, slope, 1.0), 0.0)
        u = u + step
        if np.all(np.abs(step) <= 4e-16 * u):
            break
    rise = np.where(unique, z * (u + e2) / u, np.sqrt(np.maximum(e2 * e2 - np.square(rho), 0.0)) / c)
    lat = np.arctan2(rise, rho)
    sin = np.sin(lat)
    h = ellipsoid.a_m * (rho * np.cos(lat) + z * sin - np.sqrt(1.0 - e2 * np.square(sin)))
    return Geodetic(np.where(height < 0.0, -lat, lat), np.arctan2(y, x), h)


def geocentric_latitude(lat_rad: ArrayLike, h_m: ArrayLike = 0.0, ellipsoid: Ellipsoid = WGS84) -> Array:
    """tan psi = (N (1 - e^2) + h) / (N + h) tan lat;  on the surface tan psi = (1 - e^2) tan lat.

    lat_rad geodetic, h_m, broadcast -> psi (...) in rad, the angle of the position vector to the equator.
    ValueError for a latitude beyond the poles.  MAT Fig 1.5.

    >>> float(np.degrees(geocentric_latitude(np.radians(45.0))).round(6))
    44.807577
    """
    lat, h = latitude(lat_rad), finite("h_m", h_m)
    N = prime_vertical_radius(lat, ellipsoid)
    return np.arctan2((N * (1.0 - ellipsoid.f) ** 2 + h) * np.sin(lat), (N + h) * np.cos(lat))


def latitude(lat_rad: ArrayLike) -> Array:
    """lat_rad (...) as an array; ValueError beyond the poles, as when degrees are given."""
    lat = finite("lat_rad", lat_rad)
    if np.abs(lat).max(initial=0.0) > 0.5 * np.pi + 1e-12:
        raise ValueError(f"lat_rad: expected radians between -pi/2 and pi/2, got {lat.flat[np.abs(lat).argmax()]:g}")
    return lat
