"""East-North-Up, directions and changes of basis."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import frames as fr
from core.rotation import chain, dcm_from_rotation_vector
from tests.oracle import entry

properties = settings(deadline=None, max_examples=60)
latitudes, longitudes = st.floats(-np.pi / 2, np.pi / 2), st.floats(-np.pi, np.pi)


def test_oracle_C1_30_enu():
    e = entry("C1-30")
    lat, lon = np.radians(e["inputs"]["origin"][:2])
    h = e["inputs"]["origin"][2]
    target = e["inputs"]["target"]
    np.testing.assert_allclose(fr.dcm_enu_from_ecef(lat, lon), e["expected"]["C_E_L"], rtol=0, atol=1e-12)
    r = fr.ecef_from_geodetic(*np.radians(target[:2]), target[2])
    np.testing.assert_allclose(fr.enu_from_ecef(r, lat, lon, h), e["expected"]["enu"], rtol=0, atol=1e-4)
    np.testing.assert_allclose(fr.ecef_from_enu(e["expected"]["enu"], lat, lon, h), r, rtol=0, atol=1e-4)


@properties
@given(latitudes, longitudes)
def test_rows_are_east_north_up(lat, lon):
    C = fr.dcm_enu_from_ecef(lat, lon)
    np.testing.assert_allclose(C @ C.T, np.eye(3), rtol=0, atol=1e-15)
    assert np.linalg.det(C) == pytest.approx(1.0, abs=1e-14)
    # two turns from ECEF: longitude about z, then latitude about the new -y; then name the axes E, N, U
    turned = chain(dcm_from_rotation_vector([0, 0, lon]), dcm_from_rotation_vector([0, -lat, 0]))
    np.testing.assert_allclose(C, turned[:, [1, 2, 0]].T, rtol=0, atol=1e-15)
    if np.cos(lat) > 0.01:
        lat2, lon2 = min(lat + 1e-6, np.pi / 2), lon + 1e-6
        here = fr.ecef_from_geodetic(lat, lon, 0.0)
        assert (fr.ecef_from_geodetic(lat, lon2, 0.0) - here) @ C[0] > 0
        assert (fr.ecef_from_geodetic(lat2, lon, 0.0) - here) @ C[1] > 0
    up = fr.ecef_from_geodetic(lat, lon, 10.0) - fr.ecef_from_geodetic(lat, lon, 0.0)
    np.testing.assert_allclose(C @ up, [0.0, 0.0, 10.0], rtol=0, atol=1e-8)


@properties
@given(latitudes, longitudes, st.tuples(*[st.floats(-1e7, 1e7)] * 3))
def test_enu_round_trip_keeps_lengths(lat, lon, enu):
    r = fr.ecef_from_enu(enu, lat, lon, 12.0)
    np.testing.assert_allclose(fr.enu_from_ecef(r, lat, lon, 12.0), enu, rtol=0, atol=2e-8)
    origin = fr.ecef_from_geodetic(lat, lon, 12.0)
    assert np.linalg.norm(r - origin) == pytest.approx(np.linalg.norm(enu), abs=2e-8)


def test_batches():
    lat, lon = np.radians([[10.0], [60.0]]), np.radians([5.0, 25.0, 45.0])
    C = fr.dcm_enu_from_ecef(lat, lon)
    assert C.shape == (2, 3, 3, 3)
    np.testing.assert_array_equal(C[1, 2], fr.dcm_enu_from_ecef(lat[1, 0], lon[2]))
    r = np.random.default_rng(1).normal(size=(5, 1, 3)) * 7e6
    enu = fr.enu_from_ecef(r, lat[:, 0], lon[:2], 0.0)
    assert enu.shape == (5, 2, 3)
    np.testing.assert_allclose(enu[3, 1], fr.enu_from_ecef(r[3, 0], lat[1, 0], lon[1], 0.0), rtol=1e-14)


def test_azimuth_runs_clockwise_from_north():
    enu = [[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [1, 1, np.sqrt(2)]]
    azimuth, elevation = fr.azimuth_elevation(enu)
    np.testing.assert_allclose(np.degrees(azimuth), [0, 90, 180, 270, 0, 0, 45], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.degrees(elevation), [0, 0, 0, 0, 90, -90, 45], rtol=0, atol=1e-12)
    assert fr.azimuth_elevation([-1e-300, 1.0, 0.0])[0] < 2 * np.pi


def test_change_basis_gives_the_same_point():
    rng = np.random.default_rng(4)
    X_A, X_B, m = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=(6, 3))
    moved = fr.change_basis(m, X_A, X_B)
    np.testing.assert_allclose(np.matvec(X_B, moved), np.matvec(X_A, m), rtol=0, atol=1e-12)
    np.testing.assert_allclose(fr.change_basis(moved, X_B, X_A), m, rtol=0, atol=1e-11)
    C = dcm_from_rotation_vector([0.3, -0.2, 0.5])         # orthonormal basis: (1.12) with C_A^B = X_B'
    np.testing.assert_allclose(fr.change_basis(m, np.eye(3), C), m @ C, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: fr.dcm_enu_from_ecef(60.0, 25.0), "lat_rad: expected radians"),
    (lambda: fr.enu_from_ecef([1.0, 2.0], 0.1, 0.2, 0.0), "r_m: expected shape (..., 3), got (2,)"),
    (lambda: fr.change_basis([1.0, 2.0], np.eye(2), np.ones((2, 2))), "X_B: expected linearly independent"),
    (lambda: fr.change_basis([1.0, 2.0], np.eye(3), np.eye(2)), "X_A: expected shape (..., 2, 2), got (3, 3)"),
    (lambda: fr.azimuth_elevation([np.nan, 0, 0]), "enu_m: expected finite"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
