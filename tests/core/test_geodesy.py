"""Geodetic and Cartesian coordinates, everywhere: ground, space, poles, equator, the Earth's interior."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import frames as fr
from tests.oracle import entry

properties = settings(deadline=None, max_examples=100)
PI = np.pi


def test_oracle_C1_27_geodetic_to_ecef_and_back():
    e = entry("C1-27")
    assert fr.WGS84.b_m == pytest.approx(6356752.314245, abs=1e-6)
    assert fr.WGS84.e2 == pytest.approx(0.00669437999014, abs=1e-14)
    for name, place in e["inputs"].items():
        lat, lon = np.radians([place["lat"], place["lon"]])
        r = fr.ecef_from_geodetic(lat, lon, place["h"])
        np.testing.assert_allclose(r, e["expected"][name], rtol=0, atol=1e-5, err_msg=name)
        back = fr.geodetic_from_ecef(r)
        assert float(np.degrees(back.lat_rad)) == pytest.approx(place["lat"], abs=1e-9)
        assert float(np.degrees(back.lon_rad)) == pytest.approx(place["lon"], abs=1e-9)
        assert float(back.h_m) == pytest.approx(place["h"], abs=1e-6)


def test_oracle_C1_30_radius_and_geocentric_latitude():
    e = entry("C1-30")
    lat = np.radians(e["inputs"]["origin"][0])
    assert float(fr.prime_vertical_radius(lat)) == pytest.approx(e["expected"]["N"], abs=1e-4)
    geocentric = np.degrees(fr.geocentric_latitude(lat))
    assert float(geocentric) == pytest.approx(e["expected"]["geocentric_lat"], abs=1e-9)
    r = fr.ecef_from_geodetic(lat, 0.3, 100.0)
    direct = np.arcsin(r[2] / np.linalg.norm(r))
    assert float(fr.geocentric_latitude(lat, 100.0)) == pytest.approx(float(direct), abs=1e-14)


@properties
@given(st.floats(-PI / 2, PI / 2), st.floats(-PI, PI), st.floats(-6.0e6, 1e9))
def test_round_trip_from_outside_the_evolute(lat, lon, h):
    """Down to 6000 km below ground the nearest point of the surface is the one started from."""
    r = fr.ecef_from_geodetic(lat, lon, h)
    back = fr.geodetic_from_ecef(r)
    size = max(6.4e6, h)
    near_centre = 6.4e6 / (6.4e6 + min(h, 0.0))            # rounding of r turns a short radius by more
    assert abs(float(back.lat_rad) - lat) < 2e-15 * near_centre**2
    assert abs(float(back.h_m) - h) < 2e-15 * size
    np.testing.assert_allclose(fr.ecef_from_geodetic(*back), r, rtol=0, atol=2e-15 * size)
    if np.cos(lat) > 1e-9:
        assert abs(np.angle(np.exp(1j * (float(back.lon_rad) - lon)))) < 1e-15 / np.cos(lat) * near_centre + 1e-15


@properties
@given(st.tuples(*[st.floats(-1e5, 1e5)] * 3), st.sampled_from([fr.WGS84, fr.GRS80, fr.Ellipsoid(1e5, 0.4)]))
def test_the_foot_is_the_nearest_point_of_the_surface_even_round_the_centre(r, ellipsoid):
    got = fr.geodetic_from_ecef(r, ellipsoid)
    np.testing.assert_allclose(fr.ecef_from_geodetic(*got, ellipsoid), r, rtol=0, atol=1e-14 * ellipsoid.a_m)
    lat, lon = np.meshgrid(np.linspace(-PI / 2, PI / 2, 91), np.linspace(-PI, PI, 37))
    surface = fr.ecef_from_geodetic(lat, lon, 0.0, ellipsoid)
    distance = np.linalg.norm(surface - np.array(r), axis=-1).min()
    assert abs(float(got.h_m)) <= distance + 1e-9


def test_special_places():
    a, b, e2 = fr.WGS84.a_m, fr.WGS84.b_m, fr.WGS84.e2
    places = {
        (0.0, 0.0, b + 5.0): (PI / 2, 0.0, 5.0),
        (0.0, 0.0, -b - 5.0): (-PI / 2, 0.0, 5.0),
        (-0.0, -0.0, b - 5.0): (PI / 2, 0.0, -5.0),
        (a + 7.0, 0.0, 0.0): (0.0, 0.0, 7.0),
        (-a, 0.0, 0.0): (0.0, PI, 0.0),
        (-a, -0.0, -0.0): (0.0, PI, 0.0),
        (0.0, -a, 0.0): (0.0, -PI / 2, 0.0),
        (0.0, 0.0, 0.0): (PI / 2, 0.0, -b),                # of all points the poles are the nearest to the centre
        (a * e2, 0.0, 0.0): (0.0, 0.0, a * e2 - a),        # the rim of the disc round the centre
    }
    for r, expected in places.items():
        np.testing.assert_allclose([float(c) for c in fr.geodetic_from_ecef(r)], expected, rtol=0, atol=2e-9)
    # inside the disc the two feet are mirror images; both distances are the same, the northern one is given
    inner = fr.geodetic_from_ecef([0.5 * a * e2, 0.0, 0.0])
    assert 0.0 < inner.lat_rad < PI / 2
    just_above, just_below = (fr.geodetic_from_ecef([0.5 * a * e2, 0.0, z]) for z in (1e-6, -1e-6))
    assert float(just_above.lat_rad) == pytest.approx(float(inner.lat_rad), abs=1e-9)
    assert float(just_below.lat_rad) == pytest.approx(-float(inner.lat_rad), abs=1e-9)
    assert float(just_above.h_m) == pytest.approx(float(inner.h_m), abs=1e-5)


def test_tiny_heights_above_the_equator_plane_keep_their_accuracy():
    z = np.array([1e-300, 1e-150, 1e-12, 1e-3, 1.0])
    r = np.stack([np.full(5, 6378137.0), np.zeros(5), z], axis=-1)
    lat = fr.geodetic_from_ecef(r).lat_rad
    np.testing.assert_allclose(lat, z / (6378137.0 * (1 - fr.WGS84.e2)), rtol=1e-12)


def test_sphere_has_the_textbook_answers():
    ball = fr.Ellipsoid(6371000.0, 0.0)
    r = np.array([[1e6, 2e6, 3e6], [0.0, 0.0, 0.0], [-5e6, 1.0, -5e6]])
    lat, _, h = fr.geodetic_from_ecef(r, ball)
    radius = np.linalg.norm(r, axis=-1)
    np.testing.assert_allclose(h, radius - 6371000.0, rtol=0, atol=5e-9)
    np.testing.assert_allclose(np.sin(lat[[0, 2]]), r[[0, 2], 2] / radius[[0, 2]], rtol=0, atol=2e-16)
    np.testing.assert_array_equal(fr.geocentric_latitude(0.7, 0.0, ball), 0.7)


def test_batch_equals_loop_and_inputs_stay():
    rng = np.random.default_rng(7)
    r = rng.normal(size=(3, 4, 3)) * 10.0 ** rng.uniform(3, 8, size=(3, 4, 1))
    before = r.copy()
    lat, lon, h = fr.geodetic_from_ecef(r)
    assert lat.shape == lon.shape == h.shape == (3, 4)
    for i in np.ndindex(3, 4):
        one = fr.geodetic_from_ecef(r[i])
        np.testing.assert_allclose([lat[i], lon[i], h[i]], [float(c) for c in one], rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(r, before)
    assert fr.ecef_from_geodetic(np.zeros((2, 1)), np.zeros(3), 0.0).shape == (2, 3, 3)
    assert fr.geodetic_from_ecef(np.zeros((0, 3))).h_m.shape == (0,)


def test_grs80_differs_from_wgs84_by_a_tenth_of_a_millimetre():
    assert abs(fr.GRS80.b_m - fr.WGS84.b_m) == pytest.approx(1.05e-4, abs=1e-6)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: fr.ecef_from_geodetic(61.5, 0.4, 0.0), "lat_rad: expected radians between -pi/2 and pi/2, got 61.5"),
    (lambda: fr.ecef_from_geodetic(np.nan, 0.4, 0.0), "lat_rad: expected finite"),
    (lambda: fr.ecef_from_geodetic(0.4, 0.4, np.inf), "h_m: expected finite"),
    (lambda: fr.geodetic_from_ecef([1.0, 2.0]), "r_m: expected shape (..., 3), got (2,)"),
    (lambda: fr.Ellipsoid(0.0, 0.1), "expected a_m > 0 and 0 <= f < 1, got a_m = 0.0"),
    (lambda: fr.Ellipsoid(1.0, 1.0), "expected a_m > 0 and 0 <= f < 1"),
    (lambda: fr.prime_vertical_radius(-2.0), "got -2"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
