"""Broadcast ephemerides: position and clock of GPS satellites.  IS-GPS-200, 20.3.3.3.3 and 20.3.3.4.3."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.types import Array

SPEED_OF_LIGHT = 299_792_458.0        # m/s
MU = 3.986005e14                      # m^3/s^2, of IS-GPS-200
ROTATION = 7.2921151467e-5            # rad/s, of the Earth, of IS-GPS-200
RELATIVITY = -4.442807633e-10         # F in s/sqrt(m)
MAX_AGE_S = 7200.0                    # from toe; an ephemeris is fitted to four hours


class Ephemerides(NamedTuple):
    """K records: names (K,) such as "G07"; all numbers (K,) in IS-GPS-200's units, angles in rad.

    toe_s, toc_s: seconds from the start of the same week as all other times (negative before it); healthy (K,) bool.
    """

    names: NDArray[np.str_]
    toe_s: Array
    toc_s: Array
    sqrt_a: Array
    e: Array
    i0: Array
    omega0: Array
    omega: Array
    m0: Array
    delta_n: Array
    i_dot: Array
    omega_dot: Array
    cuc: Array
    cus: Array
    crc: Array
    crs: Array
    cic: Array
    cis: Array
    af0: Array
    af1: Array
    af2: Array
    tgd: Array
    healthy: NDArray[np.bool_]


class SatelliteState(NamedTuple):
    """position_m (m, 3) in the Earth-fixed frame of the time of transmission; clock_s (m,) with relativity and minus
    the group delay (for users of one frequency)."""

    position_m: Array
    clock_s: Array


def usable(ephemerides: Ephemerides, name: str, time_s: float) -> int | None:
    """The healthy record of this satellite whose toe is nearest to time_s, at most MAX_AGE_S from it; None without."""
    own = np.flatnonzero((ephemerides.names == name) & ephemerides.healthy)
    if not own.size:
        return None
    age = np.abs(ephemerides.toe_s[own] - time_s)
    best = int(age.argmin())
    return int(own[best]) if age[best] <= MAX_AGE_S else None


def satellite_state(ephemerides: Ephemerides, records: ArrayLike, time_s: ArrayLike) -> SatelliteState:
    """x_k, y_k, z_k of IS-GPS-200 table 20-IV, and dt = af0 + af1 t + af2 t^2 + F e sqrt(A) sin E - T_GD.

    records (m,) numbers of records, time_s (m,) GPS times of transmission, in the week of toe_s.
    """
    k = np.asarray(records, dtype=np.intp)
    t = np.asarray(time_s, dtype=np.float64)
    d = Ephemerides(*(np.asarray(column)[k] for column in ephemerides))
    a = d.sqrt_a**2
    tk = t - d.toe_s
    mean = d.m0 + (np.sqrt(MU / a**3) + d.delta_n) * tk
    E = mean
    for _ in range(12):                                   # Kepler's equation by Newton; e < 0.03 for GPS
        E = E - (E - d.e * np.sin(E) - mean) / (1.0 - d.e * np.cos(E))
    true = np.arctan2(np.sqrt(1.0 - d.e**2) * np.sin(E), np.cos(E) - d.e)
    phi = true + d.omega
    s2, c2 = np.sin(2.0 * phi), np.cos(2.0 * phi)
    u = phi + d.cus * s2 + d.cuc * c2
    r = a * (1.0 - d.e * np.cos(E)) + d.crs * s2 + d.crc * c2
    i = d.i0 + d.i_dot * tk + d.cis * s2 + d.cic * c2
    node = d.omega0 + (d.omega_dot - ROTATION) * tk - ROTATION * _seconds_of_week(d.toe_s)
    x, y = r * np.cos(u), r * np.sin(u)
    position = np.stack([x * np.cos(node) - y * np.cos(i) * np.sin(node),
                         x * np.sin(node) + y * np.cos(i) * np.cos(node), y * np.sin(i)], axis=-1)
    return SatelliteState(position, clock(d, t, E))


def clock(d: Ephemerides, time_s: Array, E: Array | None = None) -> Array:
    """dt = af0 + af1 (t - toc) + af2 (t - toc)^2, and with E also F e sqrt(A) sin E - T_GD.  Seconds, (m,)."""
    tc = time_s - d.toc_s
    dt = d.af0 + d.af1 * tc + d.af2 * tc**2
    return dt if E is None else dt + RELATIVITY * d.e * d.sqrt_a * np.sin(E) - d.tgd


def code_clock(ephemerides: Ephemerides, records: ArrayLike, time_s: Array) -> Array:
    """The clock polynomial alone: enough to find the time of transmission.  (m,) in seconds."""
    k = np.asarray(records, dtype=np.intp)
    return clock(Ephemerides(*(np.asarray(column)[k] for column in ephemerides)), time_s)


def _seconds_of_week(time_s: Array) -> Array:
    return np.mod(time_s, 604_800.0)
