"""Orbits, clocks, atmosphere and the fix: against formulas, against each other, and against simulated truth."""

from dataclasses import replace

import numpy as np
import pytest

from core.frames import ecef_from_geodetic, enu_from_ecef
from core.gnss import (
    Corrections,
    Epoch,
    NoFix,
    constellation,
    fix,
    klobuchar,
    saastamoinen,
    satellite_state,
    simulate,
    usable,
)
from core.gnss.ephemeris import MU, ROTATION, SPEED_OF_LIGHT
from core.gnss.fix import rotated

LAT, LON, H = np.deg2rad(61.45), np.deg2rad(23.86), 120.0
TIMES = 4 * 86_400.0 + 120.0 * np.arange(30)


def simulated(sigma=0.0, seed=5, times=TIMES):
    return simulate(LAT, LON, H, times, sigma, np.random.default_rng(seed))


QUIET = simulated()
ALL = Corrections(alpha=QUIET.alpha, beta=QUIET.beta)


def errors(s, corrections):
    return np.array([enu_from_ecef(fix(e, s.ephemerides, corrections).x[:3], LAT, LON, H) for e in s.epochs])


def plain(e):
    """A circular orbit without corrections, at the same time."""
    zero = np.zeros(len(e.names))
    return e._replace(e=zero, delta_n=zero, i_dot=zero, cuc=zero, cus=zero, crc=zero, crs=zero, cic=zero, cis=zero,
                      af0=zero, af1=zero, tgd=zero)


def test_a_circular_orbit_is_a_circle():
    e = plain(constellation(TIMES[0], np.random.default_rng(1)))
    for dt in (0.0, 1000.0, 5000.0):
        state = satellite_state(e, np.arange(24), np.full(24, TIMES[0] + dt))
        np.testing.assert_allclose(np.sqrt(np.square(state.position_m).sum(axis=1)), e.sqrt_a**2, rtol=1e-12)
        node = e.omega0 + (e.omega_dot - ROTATION) * dt - ROTATION * TIMES[0]
        u = e.m0 + e.omega + np.sqrt(MU / e.sqrt_a**6) * dt
        z = e.sqrt_a**2 * np.sin(u) * np.sin(e.i0)
        np.testing.assert_allclose(state.position_m[:, 2], z, atol=1e-4)
        x = e.sqrt_a**2 * (np.cos(u) * np.cos(node) - np.sin(u) * np.cos(e.i0) * np.sin(node))
        np.testing.assert_allclose(state.position_m[:, 0], x, atol=1e-4)
        np.testing.assert_array_equal(state.clock_s, 0.0)


def test_an_ellipse_keeps_its_energy():
    """v^2 / 2 - mu / r = -mu / 2a in inertial axes, the velocity by differences."""
    e = constellation(TIMES[0], np.random.default_rng(2))
    zero = np.zeros(24)
    e = e._replace(delta_n=zero, i_dot=zero, omega_dot=zero, cuc=zero, cus=zero, crc=zero, crs=zero, cic=zero, cis=zero)

    def inertial(t):
        at = satellite_state(e, np.arange(24), np.full(24, t)).position_m
        return rotated(at, np.full(24, -(t - TIMES[0])))

    t, h = TIMES[0] + 700.0, 0.5
    v = (inertial(t + h) - inertial(t - h)) / (2 * h)
    r = np.sqrt(np.square(inertial(t)).sum(axis=1))
    np.testing.assert_allclose(np.square(v).sum(axis=1) / 2 - MU / r, -MU / (2 * e.sqrt_a**2), rtol=1e-6)


def test_relativity_moves_a_clock_by_some_nanoseconds():
    e = constellation(TIMES[0], np.random.default_rng(3))
    still = e._replace(af0=np.zeros(24), af1=np.zeros(24), tgd=np.zeros(24))
    clock = satellite_state(still, np.arange(24), np.full(24, TIMES[0])).clock_s
    assert 1e-9 < np.abs(clock).max() < 4.5e-10 * 0.015 * 5154


def test_the_nearest_healthy_record_within_two_hours():
    e = constellation(TIMES[0], np.random.default_rng(1))
    both = type(e)(*(np.concatenate([a, b]) for a, b in zip(e, e._replace(toe_s=e.toe_s + 5000.0), strict=True)))
    assert usable(both, "G03", TIMES[0] + 1000.0) == 2 and usable(both, "G03", TIMES[0] + 4000.0) == 26
    assert usable(both, "G03", TIMES[0] - 7201.0) is None and usable(both, "G99", TIMES[0]) is None
    sick = both._replace(healthy=np.arange(48) != 2)
    assert usable(sick, "G03", TIMES[0]) == 26


def test_the_ionosphere_by_klobuchar():
    """At night the constant 5 ns; with the elevation as F = 1 + 16 (0.53 - E)^3; largest at 14 h local time."""
    alpha, beta = QUIET.alpha, QUIET.beta
    night = klobuchar(alpha, beta, 0.6, 0.0, 0.0, np.pi / 2, 2 * 3600.0)
    assert night == pytest.approx(SPEED_OF_LIGHT * 5e-9 * (1 + 16 * 0.03**3))
    hours = np.array([float(klobuchar(alpha, beta, 0.6, 0.0, 0.0, np.pi / 2, 3600.0 * h)) for h in range(24)])
    assert hours.argmax() == 14 and hours.max() > 2 * hours.min()
    el = np.deg2rad([5.0, 30.0, 90.0])
    delay = klobuchar(alpha, beta, 0.6, 0.0, np.zeros(3), el, 2 * 3600.0)
    assert delay[0] / delay[2] == pytest.approx((1 + 16 * (0.53 - 5 / 180) ** 3) / (1 + 16 * 0.03**3))


def test_the_troposphere_by_saastamoinen():
    zenith = float(saastamoinen(LAT, 0.0, np.pi / 2))
    assert 2.3 < zenith < 2.6                                   # about 2.3 m dry and 0.1 to 0.2 m wet at sea level
    assert float(saastamoinen(LAT, 0.0, np.deg2rad(30.0))) == pytest.approx(2 * zenith)
    assert float(saastamoinen(LAT, 3000.0, np.pi / 2)) < 0.75 * zenith
    assert saastamoinen(LAT, 1e5, np.array([1.0])).tolist() == [0.0]


def test_without_noise_the_fix_is_the_truth():
    assert np.abs(errors(QUIET, ALL)).max() < 1e-4
    clock = [fix(e, QUIET.ephemerides, ALL).x[3] for e in QUIET.epochs]
    np.testing.assert_allclose(clock, QUIET.clock_m, atol=1e-4)


def test_each_correction_left_out_shows_where_it_should():
    tropo, iono, still, clocks = (errors(QUIET, replace(ALL, **{name: False})).mean(axis=0) for name in
                                  ("troposphere", "ionosphere", "earth_rotation", "satellite_clock"))
    assert 2.0 < tropo[2] < 12.0 and np.hypot(*tropo[:2]) < 0.5 * tropo[2]          # signals come late: too high
    assert iono[2] > 1.0
    surface = ROTATION * 6.378e6 * np.cos(LAT) * 0.075
    assert still[0] == pytest.approx(surface, rel=0.6) and abs(still[0]) > 2 * abs(still[1])
    assert np.abs(clocks).max() > 1000.0


def test_the_error_is_what_the_geometry_and_the_noise_say():
    """Unweighted, sigma 0.5 m over sin(elevation): the rms lies between PDOP x 0.5 m and that over sin of the mask."""
    s = simulated(0.5)
    e = errors(s, ALL)
    pdop = np.mean([fix(epoch, s.ephemerides, ALL).dop.pdop for epoch in s.epochs])
    rms = np.sqrt(np.square(e).sum(axis=1).mean())
    assert 0.5 * pdop < rms < 0.5 * pdop / np.sin(ALL.mask_rad)


def test_weights_help():
    s = simulated(1.0, times=4 * 86_400.0 + 60.0 * np.arange(90))
    low = replace(ALL, mask_rad=np.deg2rad(5.0))
    weighted, plain_ = (np.square(errors(s, replace(low, weighted=w))).sum(axis=1).mean() for w in (True, False))
    assert weighted < 0.8 * plain_


def test_masks_and_residuals():
    f = fix(QUIET.epochs[0], QUIET.ephemerides, replace(ALL, mask_rad=np.deg2rad(25.0)))
    assert (f.used == (f.elevation_rad >= np.deg2rad(25.0))).all() and not f.used.all()
    assert np.isnan(f.residuals_m[~f.used]).all() and np.abs(f.residuals_m[f.used]).max() < 1e-4
    assert f.missing == () and f.dop.gdop > f.dop.pdop > f.dop.hdop


def test_positions_without_ephemerides():
    f = fix(QUIET.epochs[0], QUIET.ephemerides, ALL)
    at = rotated(f.satellites_m, -np.sqrt(np.square(f.satellites_m - f.x[:3]).sum(axis=1)) / SPEED_OF_LIGHT)
    clean = Epoch(QUIET.epochs[0].time_s, f.names, QUIET.epochs[0].pseudoranges_m + f.clock_m, at)
    np.testing.assert_allclose(fix(clean, None, ALL).x, f.x, atol=1e-3)


def test_what_cannot_be_solved_is_said():
    e = QUIET.epochs[0]
    few = Epoch(e.time_s, e.names[:3], e.pseudoranges_m[:3])
    with pytest.raises(NoFix, match="at least 4 satellites with an orbit, got 3"):
        fix(few, QUIET.ephemerides, ALL)
    with pytest.raises(NoFix, match="G99"):
        fix(few._replace(names=("G01", "G02", "G99")), QUIET.ephemerides, ALL)
    with pytest.raises(NoFix, match="above the mask of 80"):
        fix(e, QUIET.ephemerides, replace(ALL, mask_rad=np.deg2rad(80.0)))
    with pytest.raises(NoFix, match="without satellite positions"):
        fix(e, None, ALL)
    with pytest.raises(NoFix):
        fix(e._replace(pseudoranges_m=np.full(len(e.names), 2.1e7) + 1e6 * np.arange(len(e.names))),
            QUIET.ephemerides, ALL)
    same = np.tile(ecef_from_geodetic(0.0, 0.0, 2e7), (5, 1))
    with pytest.raises(NoFix):
        fix(Epoch(0.0, tuple("abcde"), np.full(5, 2e7), same), None, ALL)


def test_seeds():
    a, b, c = simulated(0.5, 1), simulated(0.5, 1), simulated(0.5, 2)
    assert a.epochs[3].pseudoranges_m.tobytes() == b.epochs[3].pseudoranges_m.tobytes()
    assert a.ephemerides.m0.tolist() != c.ephemerides.m0.tolist()
