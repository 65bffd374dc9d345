"""DOP: the oracle's numbers for satellites and stations, and how far the promised ellipse is true."""

import numpy as np
import pytest

from core.dop import dop
from lessons.static import _dop_ground, _dop_sky
from lessons.static import dilution_of_precision as lesson
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
NUMBERS = ("gdop", "pdop", "hdop", "vdop", "tdop")


def numbers(**changes):
    shown = DESK.readouts(DESK.params(**changes))
    return np.array([shown[name] for name in NUMBERS], dtype=float)


def test_five_satellites_have_the_oracle_s_dop():
    expected = entry("C2-08")["expected"]
    shown = DESK.readouts(DESK.preset("five satellites"))
    for name in NUMBERS:
        assert shown[name] == pytest.approx(expected[name.upper()], rel=1e-4)     # round angles, rounded coordinates
    assert shown["gdop"]**2 == pytest.approx(shown["pdop"]**2 + shown["tdop"]**2)
    assert shown["pdop"]**2 == pytest.approx(shown["hdop"]**2 + shown["vdop"]**2)
    assert shown["vdop"] > 1.3 * shown["hdop"]                                    # height and clock are alike


def test_the_blocks_of_earth_centred_axes_are_no_hdop():
    """Erratum M7: the number in the text."""
    given = entry("C2-08")["inputs"]
    u = np.array(given["satellites"]) - given["user"]
    J = np.column_stack([-u / np.linalg.norm(u, axis=1)[:, None], np.ones(5)])
    assert dop(J).hdop == pytest.approx(1.7608, abs=1e-3)


def test_only_directions_count():
    p = DESK.params(sat_1=tuple(0.5 * v for v in DESK.default.sat_1))
    np.testing.assert_allclose([DESK.readouts(p)[n] for n in NUMBERS], [DESK.readouts()[n] for n in NUMBERS])


def test_a_street_hides_what_lies_across_it():
    p = DESK.preset("a street canyon")
    r = DESK.result(p)
    assert np.flatnonzero(r.visible).tolist() == [0, 2, 4, 6]
    assert DESK.readouts(p)["gdop"] == pytest.approx(9.85, abs=0.01)
    assert _dop_sky.horizon(p, np.array([40.0, 130.0, 85.0]), 10.0) == pytest.approx(
        [10.0, 62.0, np.degrees(np.arctan(np.tan(np.radians(62.0)) * np.sqrt(0.5)))])
    cov = _dop_sky.solved(r.u[r.visible]).cofactor[:2, :2]
    across = np.array([np.cos(np.radians(40.0)), -np.sin(np.radians(40.0))])
    along = np.array([across[1], -across[0]])
    assert across @ cov @ across > 4.0 * (along @ cov @ along)                    # the satellites stand in one line


def test_the_best_four_and_none():
    assert DESK.readouts(DESK.preset("one overhead, three low"))["gdop"] == pytest.approx(1.83, abs=0.005)
    v = DESK.view(DESK.preset("all on one cone"))
    assert "singular" in v.note and "error" not in {item.name for item in v.scene}
    assert {r.name: r.value for r in v.readouts}["gdop"] is None
    assert {r.name: r.value for r in v.readouts}["seen"] == "6 of 6"


def test_satellites_come_one_by_one_and_never_hurt():
    p = DESK.params(count=8)
    r = DESK.result(p)
    assert (np.diff(r.growth, axis=0) <= 1e-12).all()
    steps = [DESK.readouts(p, step)["pdop"] for step in range(5)]
    np.testing.assert_allclose(steps, r.growth[:, 1])
    assert "four are needed" in DESK.view(DESK.params(count=8, mask_deg=60.0), 0).note


def test_the_map_is_the_oracle_s():
    given, expected = entry("C2-21")["inputs"], entry("C2-21")["expected"]
    for point, value in zip(given["points"], expected["DOP"], strict=True):
        p = DESK.params(mode="surface", user=tuple(float(v) for v in point))
        r = DESK.result(p)
        assert DESK.readouts(p)["dop"] == pytest.approx(value, rel=1e-9)
        i, j = (int(np.abs(_dop_ground.AXIS - v).argmin()) for v in point)
        assert r.map[i, j] == pytest.approx(value, rel=1e-9)
        theta = np.radians(DESK.readouts(p)["angle"])
        assert np.sqrt(2.0) / abs(np.sin(theta)) == pytest.approx(value)
    assert r.map.max() == 10.0 and r.lowest == pytest.approx(np.sqrt(2.0), abs=1e-3)


@pytest.mark.parametrize(("name", "sigma"), [("exercise 2.17(a), σ = 1 m", 1.0), ("exercise 2.17(a), σ = 10 m", 10.0)])
def test_a_thousand_estimates_have_the_oracle_s_moments(name, sigma):
    expected = entry("C2-23")["expected"][f"sigma{sigma:g}"]
    p = DESK.preset(name)
    r = DESK.result(p)
    np.testing.assert_allclose(r.V, sigma**2 * np.eye(2), atol=1e-12)
    x = r.spread.x[r.spread.found]
    variances = np.diagonal(expected["cov"])
    assert (np.abs(np.diagonal(np.cov(x.T)) / variances - 1.0) < 0.15).all()      # 3.4 standard deviations
    assert (np.abs(x.mean(axis=0) - expected["mean"]) < 3.3 * np.sqrt(variances / len(x))).all()
    assert 93.0 < DESK.readouts(p)["inside"] < 97.0
    missing = 1000 - len(x)
    assert missing == 0 if sigma == 1.0 else 0 < missing < 10                     # 3.46 expected
    assert ("are left out" in DESK.view(p).note) == (missing > 0)


def test_a_banana_leaves_the_ellipse():
    p = DESK.preset("a banana")
    shown, r = DESK.readouts(p), DESK.result(p)
    assert 76.0 < shown["inside"] < 84.0
    x = r.spread.x
    far = np.abs(x[:, 1]) > 45.0
    assert np.median(x[far, 0]) > 10.0                                               # both ends are bent one way
    assert DESK.readouts(DESK.preset("a banana", sigma_m=0.5))["inside"] > 93.0


def test_weights_of_exercise_2_5():
    expected = entry("C2-16")["expected"]
    equal, best = (DESK.preset(f"exercise 2.5, W = {w}") for w in ("I", "Σ⁻¹"))
    np.testing.assert_allclose(DESK.result(equal).V, expected["cov_W_I"], rtol=1e-9)
    np.testing.assert_allclose(DESK.result(best).V, expected["cov_optimal"], rtol=1e-9)
    assert DESK.readouts(equal)["trace"] == pytest.approx(59.016, abs=1e-3)
    assert DESK.readouts(best)["trace"] == pytest.approx(29.340, abs=1e-3) == DESK.readouts(equal)["least"]
    r = DESK.result(best)
    assert r.traces.min() >= _dop_ground.rms(r.best) - 1e-12                      # no other weight is better
    lowest = _dop_ground.WEIGHTS[r.traces.argmin(axis=1)]
    assert np.abs(np.log(lowest / [0.04, 0.01])).max() < 0.2
    doubled = DESK.result(DESK.preset("exercise 2.5, W = Σ⁻¹", sigma_m=2.0))
    np.testing.assert_allclose(doubled.V, 4.0 * r.V)                              # only ratios of weights matter


def test_weights_are_nothing_to_two_ranges():
    a, b = (DESK.result(DESK.params(mode="cloud", ratio_2=3.0, weight_2=w)) for w in (1.0, 0.01))
    np.testing.assert_allclose(a.V, b.V)
    assert "weight_2" in lesson.LESSON.unused_at(DESK.params(mode="cloud"))


def test_experiments_accumulate():
    p = DESK.preset("exercise 2.17(a), σ = 1 m")
    clouds = [DESK.items(p, step).get("estimates") for step in (1, 10, 20)]
    assert [len(c.positions) for c in clouds] == sorted(len(c.positions) for c in clouds)
    assert "estimates" not in DESK.items(p, 0)


@pytest.mark.parametrize("changes", [
    {"user": (100.0, 0.0)}, {"user": (50.0, 25.0)}, {"station_2": (100.0, 0.0)}, {"sigma_m": 50.0},
    {"third": True, "station_3": (0.0, 0.0), "user": (0.0, 0.0)}, {"third": True, "weight_3": 1e-3, "ratio_3": 10.0},
    {"third": True, "station_3": (200.0, -50.0), "user": (50.0, 25.0)},
], ids=str)
@pytest.mark.parametrize("mode", ["map", "surface", "cloud"])
def test_degenerate_geometry_is_told_and_drawn(mode, changes):
    p = DESK.params(mode=mode, **changes)
    for step in (0, 20):
        v = DESK.view(p, step)
        for readout in v.readouts:
            assert readout.value is None or isinstance(readout.value, str) or np.isfinite(readout.value)
        for item in v.scene:
            if item.name == "estimates":
                assert np.isfinite(item.positions).all()
        for figure in v.figures.values():
            for trace in figure.data:
                assert np.isfinite(trace.x).all() and np.isfinite(trace.y).all()
    if DESK.result(p).V is None:
        assert "singular" in v.note


@pytest.mark.parametrize("changes", [{"sat_1": (0.0, 0.0, 0.0)}, {"sat_1": (0.0, 0.0, -1.0), "count": 4},
                                     {"mask_deg": 60.0}, {"wall_deg": 80.0, "street_deg": 90.0}], ids=str)
def test_finite_on_the_sky(changes):
    v = DESK.view(DESK.params(**changes))
    for figure in v.figures.values():
        for trace in figure.data:
            assert np.isfinite(trace.x).all() and np.isfinite(trace.y).all()
