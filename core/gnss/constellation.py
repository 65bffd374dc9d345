"""Satellites and code measurements of our own: a seeded constellation in six planes, seen from one place."""

from typing import NamedTuple

import numpy as np

from core.frames import azimuth_elevation, ecef_from_geodetic, enu_from_ecef
from core.gnss.atmosphere import klobuchar, saastamoinen
from core.gnss.ephemeris import SPEED_OF_LIGHT, Ephemerides, satellite_state
from core.gnss.fix import Epoch, rotated
from core.types import Array

PLANES, SLOTS = 6, 4
SEMI_MAJOR_M = 26_559_800.0
ALPHA = (1.1e-8, 1.5e-8, -6.0e-8, -6.0e-8)      # a quiet ionosphere, as broadcast in April 2005
BETA = (88_000.0, 16_000.0, -197_000.0, -131_000.0)


class Simulated(NamedTuple):
    """ephemerides; epochs, T of them; truth_m (3,) in ECEF; clock_m (T,) the receiver's; alpha, beta: ionosphere."""

    ephemerides: Ephemerides
    epochs: tuple[Epoch, ...]
    truth_m: Array
    clock_m: Array
    alpha: tuple[float, ...]
    beta: tuple[float, ...]


def constellation(toe_s: float, rng: "np.random.Generator") -> Ephemerides:
    """24 satellites, four in each of six planes at 55 degrees, with clocks and small departures from a circle."""
    K = PLANES * SLOTS
    plane, slot = np.divmod(np.arange(K), SLOTS)
    zero, omega = np.zeros(K), rng.uniform(-np.pi, np.pi, K)
    along = np.deg2rad(90.0) * slot + np.deg2rad(40.0) * plane + rng.normal(0.0, 0.05, K)    # from the ascending node
    return Ephemerides(
        names=np.array([f"G{k:02d}" for k in range(1, K + 1)]), toe_s=np.full(K, toe_s), toc_s=np.full(K, toe_s),
        sqrt_a=np.full(K, np.sqrt(SEMI_MAJOR_M)), e=rng.uniform(0.001, 0.015, K),
        i0=np.deg2rad(55.0) + rng.normal(0.0, 0.01, K), omega0=np.deg2rad(60.0) * plane + 0.3, omega=omega,
        m0=np.mod(along - omega + np.pi, 2.0 * np.pi) - np.pi, delta_n=rng.normal(4.5e-9, 3e-10, K),
        i_dot=rng.normal(0.0, 3e-10, K), omega_dot=rng.normal(-8e-9, 2e-10, K), cuc=rng.normal(0.0, 3e-6, K),
        cus=rng.normal(7e-6, 2e-6, K), crc=rng.normal(250.0, 60.0, K), crs=rng.normal(0.0, 60.0, K),
        cic=rng.normal(0.0, 1e-7, K), cis=rng.normal(0.0, 1e-7, K), af0=rng.normal(0.0, 2e-4, K),
        af1=rng.normal(0.0, 3e-12, K), af2=zero, tgd=rng.normal(-5e-9, 3e-9, K), healthy=np.ones(K, dtype=bool))


def simulate(lat_rad: float, lon_rad: float, height_m: float, times_s: Array, sigma_m: float,
             rng: "np.random.Generator", *, lowest_rad: float = np.deg2rad(5.0)) -> Simulated:
    """rho = |s - x| + b - c dt + ionosphere + troposphere + v,  v ~ N(0, (sigma / sin el)^2).

    A receiver at rest at the place; its clock drifts from 30 km by 20 m a second.  times_s (T,): GPS seconds of the
    week.  Satellites lower than lowest_rad are not measured.  The signal's time of transmission is solved by iteration.
    """
    times = np.asarray(times_s, dtype=np.float64)
    orbits = constellation(float(times.mean()), rng)
    x = ecef_from_geodetic(lat_rad, lon_rad, height_m)
    every = np.arange(len(orbits.names))
    clock_m = 3e4 + 20.0 * (times - times[0])
    epochs = []
    for t, b in zip(times, clock_m, strict=True):
        true_s = t - b / SPEED_OF_LIGHT                    # GPS time when the receiver's clock shows t
        travel = np.full(len(every), 0.075)
        for _ in range(6):
            state = satellite_state(orbits, every, true_s - travel)
            s = rotated(state.position_m, travel)
            travel = np.sqrt(np.square(s - x).sum(axis=1)) / SPEED_OF_LIGHT
        az, el = azimuth_elevation(enu_from_ecef(s, lat_rad, lon_rad, height_m))
        seen = el >= lowest_rad
        noise = rng.standard_normal(len(every))
        rho = (SPEED_OF_LIGHT * (travel - state.clock_s) + b
               + klobuchar(ALPHA, BETA, lat_rad, lon_rad, az, el, float(np.mod(t, 604_800.0)))
               + saastamoinen(lat_rad, height_m, el) + sigma_m * noise / np.sin(np.maximum(el, lowest_rad)))
        epochs.append(Epoch(float(t), tuple(orbits.names[seen].tolist()), rho[seen]))
    return Simulated(orbits, tuple(epochs), x, clock_m, ALPHA, BETA)
