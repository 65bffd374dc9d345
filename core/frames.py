"""Frames of the Earth: geodetic coordinates, Earth-fixed (ECEF), inertial (ECI), local East-North-Up.  MAT 1.4-1.5.

Angles in radians, lengths in metres.  Geodetic coordinates are worked out in `core.geodesy` and spinning frames in
`core.moving_frames`; their names can be imported from here too.
"""

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.geodesy import (
    GRS80,
    WGS84,
    Ellipsoid,
    Geodetic,
    ecef_from_geodetic,
    geocentric_latitude,
    geodetic_from_ecef,
    latitude,
    prime_vertical_radius,
)
from core.moving_frames import (
    EARTH_RATE,
    coriolis_acceleration,
    dcm_ecef_from_eci,
    turn_rates,
    velocity_in_inertial_frame,
    velocity_in_rotating_frame,
)
from core.types import Array

__all__ = [
    "EARTH_RATE",
    "GRS80",
    "WGS84",
    "Ellipsoid",
    "Geodetic",
    "azimuth_elevation",
    "change_basis",
    "coriolis_acceleration",
    "dcm_ecef_from_eci",
    "dcm_enu_from_ecef",
    "ecef_from_enu",
    "ecef_from_geodetic",
    "enu_from_ecef",
    "geocentric_latitude",
    "geodetic_from_ecef",
    "prime_vertical_radius",
    "turn_rates",
    "velocity_in_inertial_frame",
    "velocity_in_rotating_frame",
]


def dcm_enu_from_ecef(lat_rad: ArrayLike, lon_rad: ArrayLike) -> Array:
    """C_E^L with the rows East, North, Up in ECEF coordinates.

    lat_rad geodetic, lon_rad, broadcast to (...) -> (..., 3, 3): maps ECEF components of a vector to local ones.  At a
    pole the longitude decides where east is.  ValueError for a latitude beyond the poles.  MAT (1.13), 1.5.

    >>> dcm_enu_from_ecef(0.0, 0.0).tolist()
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    """
    lat, lon = np.broadcast_arrays(latitude(lat_rad), finite("lon_rad", lon_rad))
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    rows = [
        [-sin_lon, cos_lon, np.zeros(lat.shape)],
        [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
        [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) + 0.0


def enu_from_ecef(
    r_m: ArrayLike, lat_rad: ArrayLike, lon_rad: ArrayLike, h_m: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> Array:
    """r^L = C_E^L (r^E - r_0^E).

    r_m (..., 3) ECEF points, origin lat_rad, lon_rad, h_m, broadcast -> (..., 3) East, North, Up in metres.
    ValueError for a wrong shape or a latitude beyond the poles.  MAT (1.12), 1.5.

    >>> enu_from_ecef([6378137.0, 0.0, 7.0], 0.0, 0.0, 0.0).tolist()
    [0.0, 7.0, 0.0]
    """
    origin = ecef_from_geodetic(lat_rad, lon_rad, h_m, ellipsoid)
    return np.matvec(dcm_enu_from_ecef(lat_rad, lon_rad), finite("r_m", r_m, 3) - origin)


def ecef_from_enu(
    enu_m: ArrayLike, lat_rad: ArrayLike, lon_rad: ArrayLike, h_m: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> Array:
    """r^E = r_0^E + (C_E^L)' r^L, the inverse of `enu_from_ecef` with the same arguments.  MAT (1.12), 1.5.

    >>> ecef_from_enu([0.0, 7.0, 0.0], 0.0, 0.0, 0.0).tolist()
    [6378137.0, 0.0, 7.0]
    """
    origin = ecef_from_geodetic(lat_rad, lon_rad, h_m, ellipsoid)
    return origin + np.vecmat(finite("enu_m", enu_m, 3), dcm_enu_from_ecef(lat_rad, lon_rad))


def azimuth_elevation(enu_m: ArrayLike) -> tuple[Array, Array]:
    """azimuth = atan2(east, north),  elevation = atan2(up, sqrt(east^2 + north^2)).

    enu_m (..., 3) -> azimuth (...) in [0, 2 pi), clockwise from north, and elevation (...) above the horizon, rad.
    Straight up the azimuth is 0.  ValueError for a wrong shape.

    >>> [float(np.degrees(angle).round(9)) for angle in azimuth_elevation([1.0, 0.0, 1.0])]
    [90.0, 45.0]
    """
    east, north, up = np.moveaxis(finite("enu_m", enu_m, 3) + 0.0, -1, 0)
    azimuth = np.arctan2(east, north)
    azimuth = np.where(azimuth < 0.0, azimuth + 2.0 * np.pi, azimuth)
    return np.where(azimuth >= 2.0 * np.pi, 0.0, azimuth), np.arctan2(up, np.hypot(east, north))


def change_basis(m: ArrayLike, X_A: ArrayLike, X_B: ArrayLike) -> Array:
    """m^B = X_B^-1 X_A m^A.

    m (..., n) coordinates in A; X_A, X_B (..., n, n) with the basis vectors as columns, same origin -> (..., n).  For
    orthonormal bases X_B^-1 = X_B'.  ValueError for dependent basis vectors or a wrong shape.  MAT (1.11).

    >>> change_basis([3.0, 2.0], np.eye(2), [[1.0, 1.0], [0.0, 1.0]]).tolist()
    [1.0, 2.0]
    """
    m = finite("m", m, None)
    n = m.shape[-1]
    X_A, X_B = finite("X_A", X_A, n, n), finite("X_B", X_B, n, n)
    for name, X in (("X_A", X_A), ("X_B", X_B)):
        if np.any(np.linalg.matrix_rank(X) < n):
            raise ValueError(f"{name}: expected linearly independent basis vectors, got rank below {n}")
    return np.linalg.solve(X_B, np.matvec(X_A, m)[..., None])[..., 0]
