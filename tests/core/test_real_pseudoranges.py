"""Bancroft and Gauss-Newton on the code measurements of a real station, from a file that is not part of the project.

The folder is named by the environment variable PAIKKA_GNSS_DATA (GEONET station 0759, 2 April 2005, RINEX 2.10, from
the test data of RTKLIB).  Broadcast orbits by IS-GPS-200; no atmosphere, so the height comes out some 14 m too large.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from core.closed_form import bancroft
from core.dop import dop, local_jacobian
from core.frames import dcm_enu_from_ecef, enu_from_ecef, geodetic_from_ecef
from core.gauss_newton import gauss_newton
from core.residual_test import residual_test
from core.sensors import Pseudorange

C, MU, EARTH_RATE, F = 299792458.0, 3.986005e14, 7.2921151467e-5, -4.442807633e-10
TIME = 6 * 86400.0                                            # the first epoch: Saturday 0:00, in seconds of the week


def folder():
    place = os.environ.get("PAIKKA_GNSS_DATA", "")
    if not (Path(place) / "07590920.05o").is_file():
        pytest.skip("PAIKKA_GNSS_DATA does not name the folder with the observation file")
    return Path(place)


def first_epoch(path):
    """Marker and {satellite: C1} of the first epoch."""
    lines = path.read_text(encoding="ascii").splitlines()
    marker = next(np.array(line[:60].split(), dtype=float) for line in lines if "APPROX POSITION XYZ" in line)
    start = next(i for i, line in enumerate(lines) if "END OF HEADER" in line) + 1
    names = [int(lines[start][33 + 3 * k:35 + 3 * k]) for k in range(int(lines[start][29:32]))]
    return marker, {name: float(lines[start + 1 + k][16:30]) for k, name in enumerate(names)}


def ephemerides(path):
    """{satellite: numbers of the healthy record nearest to TIME}."""
    lines = path.read_text(encoding="ascii").splitlines()
    start = next(i for i, line in enumerate(lines) if "END OF HEADER" in line) + 1
    best = {}
    for i in range(start, len(lines) - 7, 8):
        text = lines[i][22:] + "".join(line[3:].ljust(76) for line in lines[i + 1:i + 8])
        e = [float(text[k:k + 19].replace("D", "E") or 0) for k in range(0, 29 * 19, 19) if text[k:k + 19].strip()]
        name, age = int(lines[i][:2]), abs(apart(TIME, e[11]))
        if e[24] == 0 and age <= 7200 and (name not in best or age < abs(apart(TIME, best[name][11]))):
            best[name] = e
    return best


def apart(t, reference):
    """t - reference across the end of the week."""
    return (t - reference + 302400.0) % 604800.0 - 302400.0


def orbit(e, t):
    """ECEF position (3,) at GPS time t, and the eccentric term of the relativistic clock."""
    (crs, dn, m0), (cuc, ecc, cus, root_a) = e[4:7], e[7:11]
    (toe, cic, omega0, cis), (i0, crc, omega, omega_dot, i_dot) = e[11:15], e[15:20]
    tk = apart(t, toe)
    M = m0 + (np.sqrt(MU) / root_a**3 + dn) * tk
    E = M
    for _ in range(20):
        E = M + ecc * np.sin(E)
    phi = np.arctan2(np.sqrt(1 - ecc**2) * np.sin(E), np.cos(E) - ecc) + omega
    s, c = np.sin(2 * phi), np.cos(2 * phi)
    u, r = phi + cus * s + cuc * c, root_a**2 * (1 - ecc * np.cos(E)) + crs * s + crc * c
    i = i0 + i_dot * tk + cis * s + cic * c
    node = omega0 + (omega_dot - EARTH_RATE) * tk - EARTH_RATE * toe
    x, y = r * np.cos(u), r * np.sin(u)
    place = [x * np.cos(node) - y * np.cos(i) * np.sin(node), x * np.sin(node) + y * np.cos(i) * np.cos(node),
             y * np.sin(i)]
    return np.array(place), F * ecc * root_a * np.sin(E)


def corrected(measured, records, user):
    """Satellites in the axes of the time of reception, and pseudoranges without the satellites' clock errors."""
    places, ranges = [], []
    for name, P in measured.items():
        e = records[name]
        af0, af1, af2, toc, group_delay = *e[:3], e[11], e[25]

        def clock(t, af0=af0, af1=af1, af2=af2, toc=toc):
            return af0 + af1 * apart(t, toc) + af2 * apart(t, toc) ** 2

        sent = TIME - P / C
        sent -= clock(sent)
        place, relativity = orbit(e, sent)
        turn = EARTH_RATE * np.linalg.norm(place - user) / C
        c, s = np.cos(turn), np.sin(turn)
        places.append(np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ place)
        ranges.append(P + C * (clock(sent) + relativity - group_delay))
    return np.array(places), np.array(ranges)


def test_first_epoch_of_a_real_station():
    here = folder()
    (marker, measured), records = first_epoch(here / "07590920.05o"), ephemerides(here / "07590920.05n")
    assert sorted(measured) == [3, 7, 8, 11, 19, 20, 24, 28]
    user = np.zeros(3)
    for _ in range(4):                                        # the Earth turns while the signal travels
        satellites, y = corrected(measured, records, user)
        fix = bancroft(satellites, y)
        user = fix.best[:3]
    # the same data through another program
    np.testing.assert_allclose(fix.roots[0], [-3976229.786, 3382384.756, 3652523.336, -77224.183], atol=2e-2)
    np.testing.assert_allclose(fix.roots[1], [6882760.639, -5915131.421, -5568206.247, 57341537.242], atol=1.0)
    assert fix.admissible.tolist() == [True, False] and not fix.sign_ok[1]
    sensor = Pseudorange(satellites, 5.0)
    iterated = gauss_newton(sensor, y, np.zeros(4))
    assert iterated.converged and len(iterated.steps) <= 6 and iterated.residual_norms[-1] <= fix.residual_norms[0]
    lat, lon, h = (float(v) for v in geodetic_from_ecef(marker))
    east, north, up = enu_from_ecef(iterated.x[:3], lat, lon, h)
    assert np.hypot(east, north) < 10.0 and 0.0 < up < 30.0
    numbers = dop(local_jacobian(iterated.jacobians[-1], dcm_enu_from_ecef(lat, lon)))
    assert 1.0 < numbers.hdop < numbers.pdop < numbers.gdop < 4.0
    spoiled = y + 300.0 * (np.arange(8) == 4)                 # a gross error in the fifth measurement
    test = residual_test(sensor, spoiled, gauss_newton(sensor, spoiled, np.zeros(4)).x)
    assert not test.passed and int(test.suspect) == 4
