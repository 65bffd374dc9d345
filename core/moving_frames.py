"""Frames that spin against each other: inertial (ECI), Earth-fixed (ECEF), local level, merry-go-round.  MAT 1.5.

w is the angular velocity of the turning frame A2 relative to A1, in A2 coordinates (what gyros fixed to A2 measure),
in rad/s; C = C_{A2}^{A1} maps A2 coordinates to A1 coordinates.  For a fixed axis w is the same in both frames.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.geodesy import WGS84, latitude, prime_vertical_radius
from core.quaternion import rotation_matrix
from core.types import Array

EARTH_RATE = 7.292115e-5        # rad/s, of WGS-84


class TurnRates(NamedTuple):
    """w_IL = w_IE + w_EL in local East-North-Up coordinates, each (..., 3) in rad/s.  MAT 1.5."""

    earth: Array
    transport: Array
    total: Array


class MeridianTrain(NamedTuple):
    """A train northwards along a meridian, each (...): exercise 1.19.

    lat_rad latitude; angle_to_axis_rad between its velocity and the Earth's axis; lateral_acceleration_mps2 and
    lateral_force_n the track's push on it, positive to the west.
    """

    lat_rad: Array
    angle_to_axis_rad: Array
    lateral_acceleration_mps2: Array
    lateral_force_n: Array


def dcm_ecef_from_eci(t_s: ArrayLike, rate_rad_s: float = EARTH_RATE) -> Array:
    """C_I^E = [[cos wt, sin wt, 0], [-sin wt, cos wt, 0], [0, 0, 1]].

    t_s (...) seconds since the two frames coincided -> (..., 3, 3): maps ECI coordinates to ECEF coordinates; their
    common z axis is the Earth's.  ValueError for a non-finite number.  MAT (1.15) with theta = wt, 1.5.

    >>> dcm_ecef_from_eci(0.25 * 2 * np.pi / EARTH_RATE).round(12).tolist()       # a quarter of a sidereal day
    [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    angle = finite("rate_rad_s", rate_rad_s) * finite("t_s", t_s)
    C = np.zeros((*angle.shape, 3, 3))
    C[..., 0, 0] = C[..., 1, 1] = np.cos(angle)
    C[..., 0, 1] = np.sin(angle)
    C[..., 1, 0] = 0.0 - C[..., 0, 1]
    C[..., 2, 2] = 1.0
    return C


def velocity_in_rotating_frame(a: ArrayLike, velocity: ArrayLike, C: ArrayLike, w: ArrayLike) -> Array:
    """da^{A2}/dt = C' da^{A1}/dt - w x C'a^{A1}  (= C' (da^{A1}/dt - w^{A1} x a^{A1})).

    a position and velocity da/dt in A1 coordinates, C = C_{A2}^{A1} (..., 3, 3), w in A2 coordinates, all (..., 3),
    broadcast -> the velocity that A2 sees, in A2 coordinates (..., 3), in the units of `velocity`.  Both frames share
    the origin.  ValueError for a wrong shape or a C that is no rotation.  MAT (1.23)-(1.24).

    >>> velocity_in_rotating_frame([1.0, 0.0, 0.0], [0.0, 0.0, 0.0], np.eye(3), [0.0, 0.0, 2.0]).tolist()
    [0.0, -2.0, 0.0]
    """
    a, v, w, C = finite("a", a, 3), finite("velocity", velocity, 3), finite("w", w, 3), rotation_matrix(C)
    return np.vecmat(v, C) - np.cross(w, np.vecmat(a, C)) + 0.0                             # (1.23)


def velocity_in_inertial_frame(a: ArrayLike, velocity: ArrayLike, C: ArrayLike, w: ArrayLike) -> Array:
    """da^{A1}/dt = C (da^{A2}/dt + w x a^{A2}).

    a position and velocity da/dt in A2 coordinates, C = C_{A2}^{A1} (..., 3, 3), w in A2 coordinates, all (..., 3),
    broadcast -> the velocity that A1 sees, in A1 coordinates (..., 3).  Inverse of `velocity_in_rotating_frame`.
    ValueError for a wrong shape or a C that is no rotation.  MAT (1.22).

    >>> velocity_in_inertial_frame([1.0, 0.0, 0.0], [0.0, 0.0, 0.0], np.eye(3), [0.0, 0.0, 2.0]).tolist()
    [0.0, 2.0, 0.0]
    """
    a, v, w, C = finite("a", a, 3), finite("velocity", velocity, 3), finite("w", w, 3), rotation_matrix(C)
    return np.matvec(C, v + np.cross(w, a)) + 0.0                                           # (1.22)


def turn_rates(lat_rad: ArrayLike, h_m: ArrayLike, velocity_enu_mps: ArrayLike) -> TurnRates:
    """w_IE^L = W [0, cos lat, sin lat],  w_EL^L = [-v_N / (M + h), v_E / (N + h), v_E tan lat / (N + h)].

    lat_rad, h_m (...), velocity_enu_mps (..., 3) over the ground, on WGS-84 with the radii of curvature M of the
    meridian and N across it -> the turning of the local frame by the Earth's rotation, by the user's motion, and
    their sum.  ValueError within 1e-6 rad of a pole, where East-North-Up turns without bound.  MAT 1.5.

    >>> turn_rates(0.0, 0.0, [0.0, 0.0, 0.0]).total.tolist() == [0.0, EARTH_RATE, 0.0]
    True
    """
    N = prime_vertical_radius(lat_rad)
    lat, h, v = latitude(lat_rad), finite("h_m", h_m), finite("velocity_enu_mps", velocity_enu_mps, 3)
    if np.any(np.cos(lat) < 1e-6):
        raise ValueError("lat_rad: expected a latitude at least 1e-6 rad from the poles, where ENU is not defined")
    M = N * (1.0 - WGS84.e2) / (1.0 - WGS84.e2 * np.square(np.sin(lat)))
    zero = np.zeros(np.broadcast_shapes(lat.shape, h.shape, v.shape[:-1]))
    east, north = v[..., 0] + zero, v[..., 1] + zero
    earth = EARTH_RATE * np.stack([zero, np.cos(lat) + zero, np.sin(lat) + zero], axis=-1)
    transport = np.stack([0.0 - north / (M + h), east / (N + h), east * np.tan(lat) / (N + h)], axis=-1)
    return TurnRates(earth, transport, earth + transport)


def coriolis_acceleration(velocity_enu_mps: ArrayLike, lat_rad: ArrayLike, rate_rad_s: float = EARTH_RATE) -> Array:
    """a = -2 w x v  with w = W [0, cos lat, sin lat].

    velocity_enu_mps (..., 3) over the ground, lat_rad (...), broadcast -> the apparent acceleration (..., 3) East,
    North, Up in m/s^2: to the right of the motion in the north, to the left in the south.  To hold its course the
    moving body needs the opposite push.  MAT (1.22) twice, exercise 1.19.

    >>> float(coriolis_acceleration([0.0, 100.0, 0.0], np.pi / 2)[0].round(6))    # northwards: deflected to the east
    0.014584
    """
    v, lat = finite("velocity_enu_mps", velocity_enu_mps, 3), latitude(lat_rad)
    w = finite("rate_rad_s", rate_rad_s) * np.stack([np.zeros(lat.shape), np.cos(lat), np.sin(lat)], axis=-1)
    return 0.0 - 2.0 * np.cross(w, v)


def meridian_train(
    t_s: ArrayLike, lat0_rad: ArrayLike, speed_mps: ArrayLike, mass_kg: ArrayLike, *,
    radius_m: float = 6371000.0, rate_rad_s: float = EARTH_RATE,
) -> MeridianTrain:
    """lat(t) = lat_0 + v t / R,  F = 2 M W v sin lat  to the west,  angle to the axis = |lat| northwards.

    t_s (...) after passing latitude lat0_rad on a sphere of radius_m, speed_mps northwards (negative: southwards),
    mass_kg.  Southwards the angle to the axis is pi - |lat|, and south of the equator F is negative: to the east.
    ValueError once the train has passed a pole, and for a mass or radius that is not positive.  MAT exercise 1.19.

    >>> float(meridian_train(0.0, np.radians(60.0), 100.0, 1000.0).lateral_force_n.round(6))
    12.630314
    """
    t, lat0 = finite("t_s", t_s), finite("lat0_rad", lat0_rad)
    v, M = finite("speed_mps", speed_mps), finite("mass_kg", mass_kg)
    if np.any(M <= 0.0) or not 0.0 < radius_m < np.inf:
        raise ValueError(f"mass_kg, radius_m: expected positive numbers, got {M.min():g} and {radius_m}")
    lat = lat0 + v * t / radius_m
    if np.abs(lat).max(initial=0.0) > 0.5 * np.pi + 1e-12:
        raise ValueError(f"t_s: expected a train that has not passed a pole, got latitude {np.abs(lat).max():g} rad")
    zero = np.zeros(lat.shape)
    velocity = np.stack([zero, v + zero, zero], axis=-1)
    west = coriolis_acceleration(velocity, lat, rate_rad_s)[..., 0]      # the push against an eastward deflection
    angle = np.where(v < 0.0, np.pi - np.abs(lat), np.abs(lat))
    return MeridianTrain(lat, angle, west, M * west)
