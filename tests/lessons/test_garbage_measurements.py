"""Garbage among ranges: found, left out, weighed down, or not; and a sector that confines the position."""

import itertools

import numpy as np
import pytest

from core.constrained import constrained_least_squares
from core.sensors import Range
from lessons.static import _garbage_model as model
from lessons.static import _sector_view
from lessons.static import garbage_measurements as lesson
from tests.lessons.support import Desk

DESK = Desk(lesson)
MEASURE, SOLVE, TEST, REPAIR, REPEAT = range(5)
HUBER = "Huber step by step"
SECTOR = "a sector as an inequality"


def errors(p):
    shown = DESK.readouts(p)
    return [shown[name] for name in ("error_plain", "error_cleaned", "error_huber")]


def test_the_default_loses_26_metres_and_gets_them_back():
    plain, cleaned, huber = errors(DESK.default)
    assert (plain, cleaned, huber) == pytest.approx((25.8, 3.6, 9.1), abs=0.1)
    shown = DESK.readouts()
    assert shown["suspect"] == "S2" and shown["statistic"] > 5 * shown["level"]
    assert DESK.result(DESK.default).cleaned.excluded == (1,)
    assert "range 2" in DESK.view(stage=TEST, step=0).caption


def test_without_garbage_nothing_changes():
    p = DESK.preset("nothing is wrong")
    assert len({round(e, 3) for e in errors(p)}) == 1 and DESK.readouts(p)["suspect"] == "none"
    assert DESK.result(p).test.passed


def test_what_is_too_small_is_not_seen():
    p = DESK.preset("too small to be seen")
    shown = DESK.readouts(p)
    assert p.error_m < shown["detectable"] == pytest.approx(22.2, abs=0.1)
    assert shown["suspect"] == "none" and shown["error_plain"] == pytest.approx(10.3, abs=0.1)
    power = {t.meta["key"]: t for t in DESK.view(p).figures["power"].data}["each"]
    assert np.interp(shown["detectable"], power.x, power.y) == pytest.approx(0.8, abs=0.01)


def test_three_ranges_notice_and_do_not_locate():
    p = DESK.preset("three ranges: noticed, not located")
    r = DESK.result(p)
    assert not r.test.passed and r.test.freedom == 1
    np.testing.assert_allclose(np.abs(r.test.normalised), np.abs(r.test.normalised[0]), rtol=1e-3)
    assert DESK.readouts(p)["suspect"] == "none" and "not located" in DESK.view(p).note


def test_four_ranges_may_blame_the_wrong_one():
    p = DESK.preset("four ranges: the wrong one is blamed")
    assert DESK.result(p).cleaned.excluded == (2,) and p.bad == 1
    plain, cleaned, _ = errors(p)
    assert (plain, cleaned) == pytest.approx((27.3, 47.6), abs=0.1)
    assert DESK.result(DESK.params(count=5, bad=1)).cleaned.excluded == (0,)


def test_what_nothing_checks_goes_into_the_position():
    p = DESK.preset("a range that nothing checks")
    r, shown = DESK.result(p), DESK.readouts(p)
    assert r.test.redundancy[3] < 0.03 and r.test.passed and shown["detectable"] > 100.0
    assert shown["error_plain"] == pytest.approx(34.1, abs=0.1) and "hardly check" in DESK.view(p).note


def test_errors_grow_bounded_only_for_the_robust_ones():
    r = DESK.result(DESK.default)
    at = {round(float(b)): e for b, e in zip(model.SWEEP_M, r.errors, strict=True)}
    assert at[100][0] > 1.9 * at[50][0] > 40.0
    assert at[100][1:] == pytest.approx(at[50][1:], abs=0.05)           # left out, and Huber's
    assert at[100][1] < 5.0 and at[100][2] < 10.0


def test_huber_s_rounds_come_to_rest_where_the_pulls_balance():
    p = DESK.preset(HUBER)
    assert lesson.LESSON.presets[HUBER]["step"] == 0
    r = DESK.result(p)
    np.testing.assert_allclose(DESK.items(p, 0)["huber_now"].positions, [r.fix.x])
    assert r.robust.converged
    sensor, x = Range(r.stations, p.sigma_m), r.robust.iterates[-1]
    z = (sensor.h(x) - r.y) / p.sigma_m
    np.testing.assert_allclose(sensor.jacobian(x).T @ np.clip(z, -p.huber, p.huber), 0.0, atol=1e-3)
    np.testing.assert_allclose(r.robust.weights[-1], np.minimum(1.0, p.huber / np.abs(z)))
    assert r.robust.weights[-1].argmin() == r.bad
    moves = np.linalg.norm(np.diff(r.robust.iterates, axis=0), axis=1)
    assert moves[0] > 3.0 > 0.01 > moves[-1]


def test_stages_accumulate():
    for p, ever in ((DESK.default, {"bad_range", "truth", "stations"}), (DESK.preset(SECTOR), {"sector", "truth"})):
        views = [DESK.view(p, lesson.LESSON.timeline_of(p).steps, stage) for stage in range(5)]
        for earlier, later in itertools.pairwise(views):
            assert earlier.camera == later.camera
            assert [e.name for e in earlier.equations] == [e.name for e in later.equations]
            assert sum(r.value is None for r in later.readouts) <= sum(r.value is None for r in earlier.readouts)
        assert ever <= set.intersection(*({i.name for i in v.scene} for v in views))
        for stage, v in enumerate(views[:REPAIR + 1]):
            assert any(e.current for e in v.equations) and all(
                not e.current or any(not isinstance(x, str) for x in e.pieces) for e in v.equations), stage


def test_the_sector_holds_the_estimate_on_its_edge():
    p = DESK.preset(SECTOR)
    r, shown = DESK.result(p), DESK.readouts(p)
    assert model.outside_m(r, r.fix.x) == pytest.approx(47.3, abs=0.1)
    assert r.inside.converged and r.inside.active.tolist() == [True, False]
    assert r.inside.x[1] == pytest.approx(-60.0, abs=1e-6)              # the clockwise edge points to the east
    assert shown["error_plain"] == pytest.approx(67.3, abs=0.1)
    assert shown["error_confined"] == pytest.approx(21.8, abs=0.1)
    arrow = DESK.items(p, 8, REPAIR)["downhill"]
    assert arrow.end[1] < arrow.start[1] and arrow.end[0] == pytest.approx(arrow.start[0])
    again = constrained_least_squares(Range(r.stations, p.sigma_m), r.y, p.user, r.G, r.g)
    np.testing.assert_allclose(again.x, r.inside.x, atol=0.05)          # from another start


def test_the_sector_rejects_a_mirror_image():
    p = DESK.preset("a sector and a mirror image")
    r, shown = DESK.result(p), DESK.readouts(p)
    assert model.outside_m(r, r.fix.x) > 80.0 and not r.inside.active.any()
    assert shown["error_plain"] > 100.0 > 15.0 > shown["error_confined"]


def test_the_sector_helps_on_average():
    p = DESK.preset("a sector, 300 times")
    shown = DESK.readouts(p)
    assert shown["outside"] == pytest.approx(100.0 / 7.0, abs=1.5)
    assert shown["rms_free"] == pytest.approx(26.6, abs=0.1) and shown["rms_confined"] == pytest.approx(18.2, abs=0.1)
    free, held, moved = model.repeated(p, DESK.result(p))
    np.testing.assert_allclose(free[~moved], held[~moved], atol=1e-2)


def test_what_is_seen_of_a_sector_lies_in_it():
    r = DESK.result(DESK.preset(SECTOR))
    box = np.array([[-100.0, -200.0], [120.0, 40.0]])
    corners = _sector_view._in_sector(r, box)
    assert len(corners) >= 3 and (corners @ r.G.T <= r.g + 1e-9).all()
    assert (corners >= box[0] - 1e-9).all() and (corners <= box[1] + 1e-9).all()
    assert len(_sector_view._in_sector(r, np.array([[-190.0, -190.0], [-120.0, -100.0]]))) == 0


@pytest.mark.parametrize("changes", [
    {"user": (-60.0, -45.0)}, {f"station_{i}": (0.0, 0.0) for i in range(1, 7)}, {"station_2": (-60.0, -45.0)},
    {"count": 3, "station_1": (-50.0, 0.0), "station_2": (0.0, 0.0), "station_3": (50.0, 0.0), "user": (10.0, 0.0)},
    {"sigma_m": 20.0, "error_m": 100.0, "count": 3}, {"user": (200.0, -200.0)}, {"direction_deg": 240.0},
    {"huber": 0.3}, {"zoom": "near"},
], ids=str)
@pytest.mark.parametrize("mode", ["garbage", "sector"])
def test_finite_everywhere(mode, changes):
    p = DESK.params(mode=mode, **changes)
    for stage in range(5):
        v = DESK.view(p, 3, stage)
        assert v.camera.x[1] > v.camera.x[0] and v.camera.y[1] > v.camera.y[0]
        for item in v.scene:
            for field in ("pairs", "positions", "points", "vertices"):
                assert np.isfinite(np.asarray(getattr(item, field, 0.0), dtype=float)).all(), item.name
        for readout in v.readouts:
            assert not isinstance(readout.value, float) or np.isfinite(readout.value)
        for figure in v.figures.values():
            for trace in figure.data:
                assert np.isfinite(trace.x).all() and np.isfinite(trace.y).all()
    if DESK.result(p) is None:
        assert "determine no position" in v.note


def test_only_what_matters_is_shown():
    assert "direction_deg" in lesson.LESSON.unused_at(DESK.default)
    assert {"false_alarm", "huber", "station_4"} <= lesson.LESSON.unused_at(DESK.preset(SECTOR))
    assert {"station_1", "station_5"} <= lesson.LESSON.unused_at(DESK.params(zoom="near"))
