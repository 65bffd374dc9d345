"""Geodetic coordinates: the oracle's places, a normal that misses the centre, and aims that improve."""

import dataclasses

import numpy as np
import pytest

from core.geodesy import WGS84, ecef_from_geodetic
from lessons.background import geodetic as lesson
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

DESK = Desk(lesson)
MM = 1e6


def pieces(p, name, step=None):
    return next(e for e in DESK.view(p, step).equations if e.name == name).pieces


@pytest.mark.parametrize("name", ["Tampere", "Helsinki", "equator", "north pole", "Greenwich45"])
def test_places_of_the_oracle(name):
    given, expected = (entry("C1-27")[k][name] for k in ("inputs", "expected"))
    p = DESK.params(given="geodetic", ellipsoid="wgs84", lat_deg=float(given["lat"]), lon_deg=float(given["lon"]),
                    h_km=given["h"] / 1e3)
    np.testing.assert_allclose(DESK.result(p).r_m, expected, atol=1e-5)
    np.testing.assert_allclose(pieces(p, "r")[1], expected, atol=1e-3)
    shown = DESK.readouts(p)
    assert shown["lat"] == pytest.approx(given["lat"], abs=1e-9)
    assert shown["h"] == pytest.approx(given["h"] / 1e3, abs=1e-6)
    assert DESK.result(p).steps.h_m[-1] == pytest.approx(given["h"], abs=1e-6)


def test_presets_carry_these_places():
    for name in ("Tampere", "Helsinki"):
        p, want = DESK.preset(f"WGS-84: {name}"), entry("C1-27")["inputs"][name]
        assert (p.lat_deg, p.lon_deg, p.h_km) == (want["lat"], want["lon"], want["h"] / 1e3)
    case = entry("C1-30")["expected"]
    p = DESK.preset("WGS-84: Tampere")
    np.testing.assert_allclose(pieces(p, "enu")[-1], case["C_E_L"], atol=1e-9)
    below = DESK.result(dataclasses.replace(p, h_km=0.0))
    assert np.degrees(below.geocentric_rad) == pytest.approx(case["geocentric_lat"], abs=1e-9)
    assert below.here_wgs84_arcmin == pytest.approx(9.701, abs=1e-3)
    assert DESK.readouts(p)["difference"] == pytest.approx(0.16, abs=0.005)


def test_the_latitudes_of_the_earth_differ_most_near_45_degrees():
    p = DESK.preset("45°, 1 km high, Greenwich")
    arcmin = DESK.result(p).difference_wgs84_arcmin
    at = np.abs(arcmin).argmax()
    assert abs(lesson.LATITUDES_DEG[at]) == 45.0 and abs(arcmin[at]) == pytest.approx(11.54, abs=0.01)
    assert np.radians(abs(arcmin[at]) / 60.0) * 6371.0 > 21.0
    sphere = DESK.result(DESK.preset("a sphere"))
    assert np.abs(sphere.difference_deg).max() < 1e-12
    assert sphere.error_deg.max() < 1e-12


def test_at_the_default_the_normal_clearly_misses_the_centre():
    r, items = DESK.result(DESK.default), DESK.items()
    Q, P = np.asarray(items["normal"].points)
    foot = np.asarray(items["foot"].positions)[0]
    assert np.linalg.norm(Q) > 2.5 and abs(Q[0]) == abs(Q[1]) == 0.0               # thousand km below the centre
    across = np.linalg.norm(np.cross(P - Q, foot - Q)) / np.linalg.norm(P - Q)
    assert across < 0.01                                                           # the line meets the foot of P
    a, b = WGS84.a_m / MM, r.ellipsoid.b_m / MM
    gradient = foot / [a * a, a * a, b * b]
    np.testing.assert_allclose(np.cross(gradient / np.linalg.norm(gradient), items["enu"].dcm[:, 2]), 0.0, atol=1e-9)
    assert DESK.readouts()["difference"] > 15.0
    np.testing.assert_allclose(ecef_from_geodetic(*r.place, r.ellipsoid), r.r_m, atol=1e-6)


def test_each_aim_improves_and_the_earth_gains_two_digits_each():
    r = DESK.result(DESK.default)
    assert (np.diff(r.error_deg) < 0).all() and r.error_deg[-1] < 0.01 < 15.0 < r.error_deg[0]
    ratios = r.error_wgs84_deg[1:4] / r.error_wgs84_deg[:3]
    assert (ratios < 0.01).all()
    assert np.asarray(DESK.items(step=0)["axis_points"].positions).shape == (1, 3)
    start, end = (DESK.items(step=k) for k in (0, lesson.ITERATIONS))
    np.testing.assert_allclose(start["normal"].points, start["radius"].points, atol=1e-9)
    assert len(end["axis_points"].positions) == lesson.ITERATIONS + 1
    assert start["earth"].polar == end["earth"].polar and DESK.view(step=0).camera == DESK.view().camera


def test_formulas_of_an_aim_use_the_aim_before():
    p = DESK.default
    r = DESK.result(p)
    for step in (1, 3):
        N, z_k = pieces(p, "radius", step)[1], pieces(p, "aim", step)[1]
        assert z_k == pytest.approx(-r.ellipsoid.e2 * N * np.sin(r.steps.lat_rad[step - 1]))
        assert pieces(p, "latitude", step)[1] == pytest.approx(
            np.degrees(np.arctan2(r.r_m[2] - z_k, np.hypot(*r.r_m[:2]))))
    for name in LEGENDS:
        assert name in DESK.items(p)
    for e in DESK.view(p).equations:
        for piece in e.pieces:
            if isinstance(piece, str):
                typeset(piece)


LEGENDS = ("normal", "radius", "height", "meridian", "enu", "ecef")


def test_dragging_keeps_the_distance_and_changes_the_height():
    P = np.array(DESK.default.P)
    other = np.array([0.5, 0.0, np.sqrt(P @ P - 0.25)])
    heights = [float(DESK.result(DESK.params(P=tuple(q.tolist()))).place.h_m) for q in (P, other)]
    assert heights[1] > heights[0] + 1e6


def test_only_what_matters_is_shown():
    assert DESK.lesson.unused_at(DESK.default) == {"lat_deg", "lon_deg", "h_km"}
    assert DESK.lesson.unused_at(DESK.preset("WGS-84: Tampere")) == {"P", "f"}


EXTREMES = [{"P": (0.0, 0.0, 0.0)}, {"P": (0.0, 0.0, 1.0)}, {"P": (1.0, 0.0, 0.0), "f": 0.6}, {"P": (0.5, 0.3, -0.2)},
            {"P": (0.0, 0.0, 0.0), "f": 0.0}, {"P": (0.0, -9.0, 0.0)},
            *({"given": "geodetic", "lat_deg": lat, "h_km": h, "f": 0.6} for lat in (-90.0, 0.0, 90.0)
              for h in (-10.0, 1e4))]


@pytest.mark.parametrize("changes", [*DESK.ends(), *EXTREMES], ids=str)
def test_finite_everywhere(changes):
    p = DESK.params(**changes)
    for step in (0, 1, lesson.ITERATIONS):
        view = DESK.view(p, step)
        for item in view.scene:
            for name in ("points", "positions", "pairs", "position", "origin"):
                assert np.isfinite(np.asarray(getattr(item, name, 0.0), dtype=float)).all()
        assert view.camera.radius > 8.0
        assert all(np.isfinite(x.value) for x in view.readouts)


def test_places_deep_inside_are_told():
    assert "another normal" in DESK.view(DESK.params(P=(1.0, 0.0, 0.0))).note
    assert "still off" in DESK.view(DESK.params(P=(3.0, 0.0, 0.5))).note
    assert DESK.view().note == ""
