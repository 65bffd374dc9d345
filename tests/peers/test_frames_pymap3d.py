"""Frames against pymap3d.

pymap3d works in degrees on its own WGS-84 (the same a, and f through b).  Its inverse is a closed form with one
correction: as good as ours near the ground, but 7e-8 degrees off at 1000 km and 7e-5 degrees at the height of GPS
satellites, where the comparison is looser and the starting coordinates decide.
"""

import numpy as np
import pytest

from core import frames as fr

pymap3d = pytest.importorskip("pymap3d")
RNG = np.random.default_rng(2010)
LAT, LON = np.degrees(np.arcsin(RNG.uniform(-1, 1, 300))), RNG.uniform(-180, 180, 300)
H = RNG.choice([-5000.0, 0.0, 100.0, 1e4, 1e6, 2.02e7], 300)


def test_geodetic_to_ecef():
    ours = fr.ecef_from_geodetic(np.radians(LAT), np.radians(LON), H)
    np.testing.assert_allclose(ours, np.stack(pymap3d.geodetic2ecef(LAT, LON, H), axis=-1), rtol=0, atol=2e-8)


def test_ecef_to_geodetic():
    r = np.stack(pymap3d.geodetic2ecef(LAT, LON, H), axis=-1)
    lat, lon, h = fr.geodetic_from_ecef(r)
    their_lat, their_lon, their_h = pymap3d.ecef2geodetic(*r.T)
    assert np.all(np.abs(np.degrees(lat) - their_lat) < np.where(H > 1e5, 1e-4, 1e-10))
    np.testing.assert_allclose(np.degrees(lon), their_lon, rtol=0, atol=1e-11)
    assert np.all(np.abs(h - their_h) < np.where(H > 1e5, 1e-4, 1e-8))
    np.testing.assert_allclose(np.degrees(lat), LAT, rtol=0, atol=1e-12)
    np.testing.assert_allclose(h, H, rtol=0, atol=2e-8)


@pytest.mark.parametrize(("lat", "lon", "h"), [(90, 0, 0), (-90, 0, -10), (0, 180, 0), (0, -90, 1), (45, 45, -1e5)])
def test_poles_equator_and_below_ground(lat, lon, h):
    r = np.array(pymap3d.geodetic2ecef(lat, lon, h), dtype=float)
    ours = fr.geodetic_from_ecef(r)
    theirs = pymap3d.ecef2geodetic(*r)
    np.testing.assert_allclose(np.degrees(ours.lat_rad), theirs[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.h_m, theirs[2], rtol=0, atol=1e-4)
    np.testing.assert_allclose([np.degrees(ours.lat_rad), ours.h_m], [lat, h], rtol=0, atol=1e-8)


def test_local_vectors_and_directions():
    lat, lon, h = 61.4978, 23.761, 100.0
    r = np.stack(pymap3d.geodetic2ecef(LAT, LON, H), axis=-1)
    enu = fr.enu_from_ecef(r, np.radians(lat), np.radians(lon), h)
    np.testing.assert_allclose(enu, np.stack(pymap3d.ecef2enu(*r.T, lat, lon, h), axis=-1), rtol=0, atol=1e-7)
    azimuth, elevation = fr.azimuth_elevation(enu)
    theirs = pymap3d.enu2aer(*enu.T)
    np.testing.assert_allclose(np.degrees(azimuth), theirs[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.degrees(elevation), theirs[1], rtol=0, atol=1e-9)


def test_geocentric_latitude():
    ours = np.degrees(fr.geocentric_latitude(np.radians(LAT)))
    np.testing.assert_allclose(ours, pymap3d.geodetic2geocentric(LAT, 0.0), rtol=0, atol=1e-10)
