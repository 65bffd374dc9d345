"""The iteration for the latitude ends where the direct inverse does, at the rate that its docstring promises."""

import numpy as np
import pytest

from core.geodesy import WGS84, Ellipsoid, ecef_from_geodetic, geocentric_latitude, geodetic_from_ecef
from core.geodetic_iteration import latitude_iteration

FLAT = Ellipsoid(6378137.0, 0.35)


@pytest.mark.parametrize("ellipsoid", [WGS84, FLAT, Ellipsoid(1.0, 0.0)])
def test_ends_where_the_direct_inverse_does(ellipsoid):
    lat = np.radians([[-90.0], [-61.5], [0.0], [1e-6], [45.0], [89.9], [90.0]])
    h = np.array([0.0, 0.1, 4.0]) * ellipsoid.a_m
    r = ecef_from_geodetic(lat, 0.7, h, ellipsoid)
    found = latitude_iteration(r, 120, ellipsoid)
    want = geodetic_from_ecef(r, ellipsoid)
    np.testing.assert_allclose(found.lat_rad[-1], want.lat_rad, atol=1e-14)
    np.testing.assert_allclose(found.h_m[-1], want.h_m, atol=1e-14 * 5 * ellipsoid.a_m)
    np.testing.assert_allclose(found.lat_rad[0], geocentric_latitude(lat, h, ellipsoid), atol=1e-14)
    assert not found.axis_z_m[0].any()


def test_rate_of_convergence():
    lat, h = np.radians(50.0), 1.0e6
    error = np.abs(latitude_iteration(ecef_from_geodetic(lat, 0.0, h, FLAT), 20, FLAT).lat_rad - lat)
    e2, N = FLAT.e2, FLAT.a_m / np.sqrt(1 - FLAT.e2 * np.sin(lat) ** 2)
    rate = e2 * np.cos(lat) ** 2 / (1 - e2 * np.sin(lat) ** 2) * N / (N + h)
    assert error[16] / error[15] == pytest.approx(rate, rel=1e-3)


def test_batch_equals_loop_and_wrong_input_is_refused():
    points = np.array([[4.0e6, 1.0e6, 5.0e6], [0.0, 0.0, -7.0e6], [0.0, 0.0, 0.0]])
    many = latitude_iteration(points, 6)
    for i, r in enumerate(points):
        one = latitude_iteration(r, 6)
        np.testing.assert_array_equal(many.lat_rad[:, i], one.lat_rad)
        np.testing.assert_array_equal(many.axis_z_m[:, i], one.axis_z_m)
    with pytest.raises(ValueError, match="iterations"):
        latitude_iteration(points, -1)
    with pytest.raises(ValueError, match="r_m"):
        latitude_iteration([1.0, 2.0], 3)
