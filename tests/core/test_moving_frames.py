"""Velocities between turning frames, the Earth's rotation and the maglev train."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import frames as fr
from core import moving_frames as mf
from core.attitude import rotate
from core.rotation import dcm_from_rotation_vector, rotation_vector_from_dcm
from tests.oracle import entry

properties = settings(deadline=None, max_examples=60)
vector = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


def test_oracle_C1_36_fixed_object_seen_from_a_merry_go_round():
    e = entry("C1-36")
    omega, t, a = (e["inputs"][k] for k in ("omega", "t", "a_A1"))
    w, C = np.array([0.0, 0.0, omega]), dcm_from_rotation_vector([0.0, 0.0, omega * t])
    seen = fr.velocity_in_rotating_frame(a, np.zeros(3), C, w)
    np.testing.assert_allclose(seen, e["expected"]["da_A2"], rtol=0, atol=1e-10)
    assert np.linalg.norm(seen) == pytest.approx(e["expected"]["speed"], abs=1e-10)
    # and back: the object stands still
    np.testing.assert_allclose(fr.velocity_in_inertial_frame(C.T @ a, seen, C, w), 0.0, atol=1e-15)


def test_oracle_C1_39_maglev_train():
    e = entry("C1-39")
    M, v_kmh, R, omega, lat0, lat1 = (e["inputs"][k] for k in ("M", "v_kmh", "R", "omega", "lat0", "lat1"))
    expected = e["expected"]
    assert omega == fr.EARTH_RATE
    v = v_kmh / 3.6
    travel = np.radians(lat1 - lat0) * R / v
    assert travel == pytest.approx(expected["travel_time"], rel=1e-8)
    train = mf.meridian_train([0.0, travel], np.radians(lat0), v, M, radius_m=R)
    np.testing.assert_allclose(train.lateral_force_n, [expected["F_Helsinki"], expected["F_Rovaniemi"]], rtol=1e-8)
    np.testing.assert_allclose(train.lateral_acceleration_mps2,
                               [expected["accel_Helsinki"], expected["accel_Rovaniemi"]], rtol=1e-8)
    for at, angle in zip(expected["angle_deg_at"], train.angle_to_axis_rad, strict=True):
        assert float(np.degrees(angle)) == pytest.approx(at["deg"], rel=1e-8)
    for k, lat in enumerate(train.lat_rad):                 # the angle itself, from vectors in ECEF
        north = fr.dcm_enu_from_ecef(lat, np.radians(25.0))[1]
        assert np.arccos(north[2]) == pytest.approx(float(train.angle_to_axis_rad[k]), rel=1e-12)
        w_cross_v = np.cross([0, 0, omega], v * north)
        east = fr.dcm_enu_from_ecef(lat, np.radians(25.0))[0]
        assert 2 * w_cross_v @ east == pytest.approx(-float(train.lateral_acceleration_mps2[k]), rel=1e-12)


def test_train_in_the_south_and_southwards():
    south = mf.meridian_train(0.0, np.radians(-30.0), 50.0, 1000.0)
    north = mf.meridian_train(0.0, np.radians(30.0), 50.0, 1000.0)
    back = mf.meridian_train(0.0, np.radians(30.0), -50.0, 1000.0)
    assert float(south.lateral_force_n) == -float(north.lateral_force_n) < 0.0
    assert float(back.lateral_force_n) == -float(north.lateral_force_n)
    assert float(south.angle_to_axis_rad) == float(north.angle_to_axis_rad)
    assert float(back.angle_to_axis_rad) == pytest.approx(np.radians(150.0), rel=1e-15)
    southward = -fr.dcm_enu_from_ecef(np.radians(30.0), 0.0)[1]
    assert float(back.angle_to_axis_rad) == pytest.approx(float(np.arccos(southward[2])), rel=1e-12)


def test_coriolis_acceleration_is_the_second_derivative_left_over():
    """A body that moves freely (straight in the inertial frame) seen from the turning frame at its start."""
    lat, v = 1.0, np.array([3.0, -7.0, 2.0])
    w = fr.EARTH_RATE * 1e4 * np.array([0.0, np.cos(lat), np.sin(lat)])      # fast, to stand above rounding
    got = mf.coriolis_acceleration(v, lat, rate_rad_s=fr.EARTH_RATE * 1e4)
    h = 1e-4

    def seen(t):                                             # starts at the origin of the turning axis with velocity v
        return dcm_from_rotation_vector(w * t).T @ (v * t)

    second = (seen(h) - 2 * seen(0.0) + seen(-h)) / h**2
    np.testing.assert_allclose(got, second, rtol=0, atol=1e-5)
    assert mf.coriolis_acceleration([[0, 1.0, 0], [1.0, 0, 0]], [0.1, 0.2]).shape == (2, 3)


@properties
@given(vector, vector, vector, vector)
def test_velocities_invert_and_match_finite_differences(a, velocity, p, w):
    C = dcm_from_rotation_vector(p)
    seen = fr.velocity_in_rotating_frame(a, velocity, C, w)
    np.testing.assert_allclose(fr.velocity_in_inertial_frame(C.T @ a, seen, C, w), velocity, rtol=0, atol=1e-13)
    # as printed in (1.23), with w in A1 coordinates
    np.testing.assert_allclose(seen, C.T @ (velocity - np.cross(C @ w, a)), rtol=0, atol=1e-13)
    h = 1e-4
    ahead, behind = (rotate(C, w, s).T @ (a + s * velocity) for s in (h, -h))
    np.testing.assert_allclose(seen, (ahead - behind) / (2 * h), rtol=0, atol=1e-4)


def test_velocities_broadcast_and_leave_inputs():
    rng = np.random.default_rng(9)
    a, v = rng.normal(size=(4, 1, 3)), rng.normal(size=(5, 3))
    before = a.copy(), v.copy()
    C = dcm_from_rotation_vector(rng.normal(size=(5, 3)))
    seen = fr.velocity_in_rotating_frame(a, v, C, [0.0, 0.1, 0.2])
    assert seen.shape == (4, 5, 3)
    one = fr.velocity_in_rotating_frame(a[2, 0], v[3], C[3], [0.0, 0.1, 0.2])
    np.testing.assert_allclose(seen[2, 3], one, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(a, before[0])
    np.testing.assert_array_equal(v, before[1])


def test_earth_turns_eastwards_once_in_a_sidereal_day():
    C = fr.dcm_ecef_from_eci([0.0, 3600.0, 2 * np.pi / fr.EARTH_RATE])
    np.testing.assert_allclose(C[[0, 2]], np.tile(np.eye(3), (2, 1, 1)), rtol=0, atol=1e-15)
    # C_E^I = C(p), p = w t about z; a star that stands still moves west over an observer on the equator
    np.testing.assert_allclose(rotation_vector_from_dcm(C[1].T), [0, 0, 3600 * fr.EARTH_RATE], rtol=0, atol=1e-15)
    star = C[1] @ [1.0, 0.0, 0.0]
    assert star[1] < 0.0
    # a point fixed to the ground moves east at w a cos(lat): 465 m/s on the equator
    r = fr.ecef_from_geodetic(0.0, 0.0, 0.0)
    speed = fr.velocity_in_inertial_frame(r, np.zeros(3), C[1].T, [0.0, 0.0, fr.EARTH_RATE])
    assert np.linalg.norm(speed) == pytest.approx(6378137.0 * fr.EARTH_RATE, rel=1e-12)


def test_turn_rates_are_the_rates_of_the_local_frame():
    lat, lon, h, v = np.radians(61.5), np.radians(23.8), 120.0, np.array([200.0, -150.0, 5.0])
    rates = fr.turn_rates(lat, h, v)
    np.testing.assert_allclose(rates.earth, fr.dcm_enu_from_ecef(lat, lon) @ [0, 0, fr.EARTH_RATE], rtol=0, atol=1e-19)
    np.testing.assert_array_equal(rates.total, rates.earth + rates.transport)
    r0, C0 = fr.ecef_from_geodetic(lat, lon, h), fr.dcm_enu_from_ecef(lat, lon)
    dt = 1.0
    after, before = (fr.geodetic_from_ecef(r0 + s * C0.T @ v) for s in (dt, -dt))
    C_after, C_before = (fr.dcm_enu_from_ecef(g.lat_rad, g.lon_rad) for g in (after, before))
    turned = rotation_vector_from_dcm(C_before @ C_after.T) / (2 * dt)       # C_{L(after)}^{L(before)}
    np.testing.assert_allclose(rates.transport, turned, rtol=0, atol=1e-9)
    many = fr.turn_rates([[0.1], [0.2]], 0.0, np.ones((3, 3)))
    assert many.total.shape == many.earth.shape == many.transport.shape == (2, 3, 3)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: fr.velocity_in_rotating_frame([1, 2], [0, 0, 0], np.eye(3), [0, 0, 1]), "a: expected shape (..., 3)"),
    (lambda: fr.velocity_in_rotating_frame([1, 2, 3], [0, 0, 0], 2 * np.eye(3), [0, 0, 1]), "expected orthonormal"),
    (lambda: fr.velocity_in_inertial_frame([1, 2, 3], [0, np.nan, 0], np.eye(3), [0, 0, 1]), "velocity: expected fin"),
    (lambda: fr.dcm_ecef_from_eci(np.inf), "t_s: expected finite"),
    (lambda: fr.turn_rates(np.pi / 2, 0.0, [1, 0, 0]), "at least 1e-6 rad from the poles"),
    (lambda: mf.coriolis_acceleration([0, 1, 0], 60.0), "lat_rad: expected radians"),
    (lambda: mf.meridian_train(1e6, 1.0, 100.0, 1.0), "expected a train that has not passed a pole"),
    (lambda: mf.meridian_train(0.0, 1.0, 100.0, -1.0), "expected positive numbers, got -1"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
