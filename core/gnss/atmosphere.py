"""What delays a code measurement on its way down: broadcast ionosphere, standard troposphere."""

import numpy as np
from numpy.typing import ArrayLike

from core.gnss.ephemeris import SPEED_OF_LIGHT
from core.types import Array


def klobuchar(alpha: ArrayLike, beta: ArrayLike, lat_rad: float, lon_rad: float, azimuth_rad: ArrayLike,
              elevation_rad: ArrayLike, time_s: float) -> Array:
    """c F (5e-9 + A (1 - x^2/2 + x^4/24)): the ionosphere's delay on L1 in metres.

    alpha (4,), beta (4,): the coefficients of the navigation message.  azimuth, elevation (m,) of the satellites seen
    from lat, lon; time_s: GPS seconds of the week -> (m,).  IS-GPS-200 20.3.3.5.2.5 (Klobuchar 1987).
    """
    az, el = np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64) / np.pi
    lat, lon = lat_rad / np.pi, lon_rad / np.pi           # semicircles
    psi = 0.0137 / (el + 0.11) - 0.022
    phi = np.clip(lat + psi * np.cos(az), -0.416, 0.416)
    lam = lon + psi * np.sin(az) / np.cos(phi * np.pi)
    phi = phi + 0.064 * np.cos((lam - 1.617) * np.pi)     # geomagnetic
    local = np.mod(43_200.0 * lam + time_s, 86_400.0)
    powers = phi[..., None] ** np.arange(4)
    amplitude = np.maximum(powers @ np.asarray(alpha, dtype=np.float64), 0.0)
    period = np.maximum(powers @ np.asarray(beta, dtype=np.float64), 72_000.0)
    x = 2.0 * np.pi * (local - 50_400.0) / period
    day = np.where(np.abs(x) < 1.57, 5e-9 + amplitude * (1.0 - x**2 / 2.0 + x**4 / 24.0), 5e-9)
    return SPEED_OF_LIGHT * (1.0 + 16.0 * (0.53 - el) ** 3) * day


def saastamoinen(lat_rad: float, height_m: float, elevation_rad: ArrayLike, humidity: float = 0.7) -> Array:
    """(0.0022768 p / (1 - 0.00266 cos 2 lat - 0.00028 h_km) + 0.002277 (1255/T + 0.05) e) / sin(elevation).

    The troposphere's delay in metres in the standard atmosphere (p in hPa, T in K, e the pressure of the vapour at this
    relative humidity, all at height_m), elevation (m,) -> (m,).  0 for heights outside -100 m to 10 km, where the
    standard atmosphere means nothing.  Saastamoinen (1972).
    """
    el = np.asarray(elevation_rad, dtype=np.float64)
    if not -100.0 <= height_m <= 1e4:
        return np.zeros(el.shape)
    h = max(height_m, 0.0)
    pressure = 1013.25 * (1.0 - 2.2557e-5 * h) ** 5.2568
    temperature = 15.0 - 6.5e-3 * h + 273.16
    vapour = 6.108 * humidity * np.exp((17.15 * temperature - 4684.0) / (temperature - 38.45))
    dry = 0.0022768 * pressure / (1.0 - 0.00266 * np.cos(2.0 * lat_rad) - 0.00028 * h / 1e3)
    wet = 0.002277 * (1255.0 / temperature + 0.05) * vapour
    return (dry + wet) / np.sin(np.maximum(el, np.deg2rad(1.0)))
