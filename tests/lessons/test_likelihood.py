"""Likelihoods: the oracle's numbers, products and their maxima, and least squares as the normal special case."""

import itertools
import math

import numpy as np
import pytest

from core.likelihood import likelihood_map, weighted_cost
from core.sensors import Bearing, Range, Stack
from lessons.static import _likelihood_line as lines
from lessons.static import _likelihood_plane as planes
from lessons.static import likelihood as lesson
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
FACTOR, PRODUCT = range(2)
FLOOR = "exercise 2.11: floor"


def pair(text):
    return np.array([float(v.replace("−", "-")) for v in text.split(",")])


def test_fig_2_2_has_the_oracle_s_numbers():
    given, expected = entry("C2-30")["inputs"], entry("C2-30")["expected"]
    assert DESK.default.probe == tuple(given["x"]) and DESK.default.sigma_m == given["sd_range"]
    ranges, both = DESK.readouts(step=0), DESK.readouts()
    assert ranges["alone"] == pytest.approx(expected["range_lik"], abs=1e-6)
    assert both["alone"] == pytest.approx(expected["bearing_lik"], abs=1e-6)
    assert both["product"] == pytest.approx(expected["range_lik"] * expected["bearing_lik"], abs=1e-6)
    np.testing.assert_allclose(pair(both["ml"]), expected["peak"], atol=0.01)
    assert ranges["measured"] == "50.0 m" and both["measured"] == "60.0°"


def test_a_ring_alone_has_no_single_maximum():
    assert DESK.readouts(step=0)["ml"] is None and DESK.readouts()["ml"] is not None
    assert "no single" in DESK.view(step=0).note and DESK.view().note == ""


def test_products_are_products():
    p = DESK.params(ranges=2, bearings=2, difference=True, strength=True, wrong=True)
    r = DESK.result(p)
    assert len(r.factors) == planes.count_of(p) == 6
    product = np.cumprod(r.parts, axis=0)
    np.testing.assert_allclose(product / product.max(axis=(1, 2), keepdims=True), r.products, atol=1e-9)
    kinds = [f.kind for f in r.factors]
    assert kinds == ["range", "bearing", "range", "bearing", "difference", "strength"]


@pytest.mark.parametrize("changes", [{"ranges": 3, "bearings": 0}, {"strength": True},
                                     {"difference": True, "ranges": 2}], ids=str)
def test_normal_errors_make_maximum_likelihood_and_least_squares_one(changes):
    """Example 17, whatever is measured."""
    p = DESK.params(wrong=True, **changes)
    r = DESK.result(p)
    assert r.single[-1]
    np.testing.assert_allclose(r.best[-1], r.squares[-1], atol=0.02)
    logs = {t.meta["key"]: t for t in DESK.view(p).figures["mirror"].data}
    middle = np.abs(logs["log"].y) < 9.0
    np.testing.assert_allclose(logs["log"].y[middle], -logs["cost"].y[middle], atol=1e-9)
    numbers = {e.name: e.pieces for e in DESK.view(p).equations}
    assert numbers["mirror"][-1] == pytest.approx(numbers["log"][-1])


def test_example_17_with_the_oracle_s_cost():
    """The constant and the cost of the text, with the stations and variances of C2-14."""
    sensor = Range(np.array([[10.0, 5.0], [120.0, 0.0], [40.0, 90.0]]), [1.0, 5.0, 10.0])
    cost = float(weighted_cost(sensor, [52.0, 77.0, 57.0], [50.0, 30.0]))
    assert cost == pytest.approx(entry("C2-30")["expected"]["wls_cost"])
    constant = math.exp(float(sensor.log_likelihood(sensor.h(np.zeros(2)), np.zeros(2))))
    assert constant * math.exp(-0.5 * cost) == pytest.approx(9.99494685e-09, rel=1e-6)


def test_two_rings_meet_twice():
    p = DESK.preset("two ranges, two peaks")
    r = DESK.result(p)
    assert not r.single[-1] and "no single" in DESK.view(p).note
    third = DESK.result(DESK.preset("two ranges, two peaks", ranges=3))
    assert third.single[-1]
    np.testing.assert_allclose(third.best[-1], DESK.default.truth, atol=0.02)


def test_bounded_errors_leave_a_set():
    p = DESK.preset("uniform errors")
    r = DESK.result(p)
    assert set(np.unique(r.products[-1])) == {0.0, 1.0} and not r.single[-1]
    for f in r.factors:                                                 # the truth is always possible
        assert planes.relative(f, np.array(p.truth)) == 1.0
    assert np.isfinite(r.squares[-1]).all()
    impossible = DESK.params(ranges=3, bearings=0, noise="uniform", wrong=True, sigma_m=2.0, inside="no",
                             radius_m=120.0)
    assert not DESK.result(impossible).possible[-1] and "contradict" in DESK.view(impossible).note


def test_binary_answers_have_the_oracle_s_probabilities():
    expected = entry("C2-26")
    for letter, edge in (("c", 0.0), ("d", 1.0)):
        for distance, value in zip(expected["inputs"][letter]["r"], expected["expected"][letter], strict=True):
            p = DESK.params(ranges=0, bearings=0, inside="yes", radius_m=100.0, edge_m=edge, station_3=(-40.0, 0.0),
                            probe=(distance - 40.0, 0.0))
            assert DESK.readouts(p)["alone"] == pytest.approx(value, rel=1e-7)
            no = DESK.readouts(DESK.params(ranges=0, bearings=0, inside="no", radius_m=100.0, edge_m=edge,
                                           station_3=(-40.0, 0.0), probe=(distance - 40.0, 0.0)))
            assert no["alone"] == pytest.approx(1.0 - value, abs=1e-9)


def test_a_binary_answer_moves_maximum_likelihood_but_not_least_squares():
    p = DESK.params(inside="yes", radius_m=55.0, station_3=(10.0, 80.0), edge_m=1.0)
    r = DESK.result(p)
    np.testing.assert_allclose(r.squares[-1], r.squares[-2], atol=0.05)
    assert np.linalg.norm(r.best[-1] - r.best[-2]) > 3.0


def test_x_squared_with_bounded_errors_is_in_two_intervals():
    p = DESK.preset("exercise 2.10(a): y = x² + v")
    r, given = DESK.result(p), entry("C2-26")
    assert r.y.tolist() == [given["inputs"]["a"]["y"]]
    for x, value in zip(given["inputs"]["a"]["x"], given["expected"]["a"], strict=True):
        assert np.interp(x, lines.X, r.parts[0]) == pytest.approx(value)
    assert DESK.readouts(p)["where"] == "−1.73 … −1.00, 1.00 … 1.73"
    assert {"ml", "ml_2"} <= set(DESK.items(p))


def test_rounded_readings_have_the_oracle_s_likelihood():
    given, expected = entry("C2-28")["inputs"], entry("C2-28")["expected"]["P"]
    r = DESK.result(DESK.params(world="floor", readings=1))
    for x, value in zip(given["x"], expected, strict=True):
        assert np.exp(r.sensor.log_likelihood(np.array([given["y"]]), np.array([x]))) == pytest.approx(value, abs=1e-9)
    shown = DESK.view(DESK.params(world="floor", readings=1)).figures["of_y"].data[0]
    assert sum(shown.y) == pytest.approx(1.0, abs=1e-9)                 # a probability in y
    assert np.trapezoid(r.parts[0], lines.X) == pytest.approx(1.0, abs=1e-3)


def test_five_rounded_readings_and_their_mean():
    p = DESK.preset(FLOOR)
    assert [p.y_1, p.y_2, p.y_3, p.y_4, p.y_5] == [0, -2, -1, 0, -1]
    shown = DESK.readouts(p)
    assert shown["mean"] == pytest.approx(-0.8) and shown["middle_mean"] == pytest.approx(-0.3)
    assert shown["ml_x"] == pytest.approx(-0.3057, abs=2e-4)
    fine = np.linspace(-1.0, 0.5, 150001)
    logs = likelihood_map(DESK.result(p).sensor, np.array([[0.0], [-2.0], [-1.0], [0.0], [-1.0]]), [fine])
    assert shown["ml_x"] == pytest.approx(float(logs.peak[0]), abs=1e-4)
    one = DESK.readouts(DESK.params(world="floor", readings=1))
    assert one["ml_x"] == pytest.approx(0.5, abs=1e-3)                  # the middle of the bump


def test_stages_show_one_and_then_the_product():
    p = DESK.params(ranges=2)
    for step, stage in itertools.product(range(3), (FACTOR, PRODUCT)):
        v, names = DESK.view(p, step, stage), set(DESK.items(p, step, stage))
        assert v.camera == DESK.view(p).camera and "factor" in names
        assert ("product" in names) == (stage == PRODUCT or step > 0)
        assert ("ml" in names) == (stage == PRODUCT and bool(DESK.result(p).single[step]))
        for e in v.equations:
            assert not e.current or any(not isinstance(x, str) for x in e.pieces) or e.name in ("ml", "wls")
    assert DESK.params(shown="surface") and "factor_surface" in DESK.items(DESK.params(shown="surface"))


def test_least_squares_starts_at_the_maximum():
    f = DESK.result(DESK.params(bearings=2, wrong=True)).factors
    assert isinstance(f[1].sensor, Bearing) and isinstance(f[0].sensor, Range)
    sensor = Stack(tuple(g.sensor for g in f))
    r = DESK.result(DESK.params(bearings=2, wrong=True))
    y = np.concatenate([g.y for g in f])
    around = r.best[-1] + 0.5 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    assert (sensor.log_likelihood(y, around) < sensor.log_likelihood(y, r.best[-1])).all()


@pytest.mark.parametrize("changes", [
    {"ranges": 0, "bearings": 0}, {"truth": (0.0, 0.0)}, {"probe": (0.0, 0.0)},
    {"station_2": (0.0, 0.0), "difference": True}, {"truth": (115.0, 115.0), "noise": "uniform", "wrong": True},
    {"ranges": 3, "bearings": 2, "strength": True, "difference": True, "inside": "yes"},
    {"world": "floor", "sigma": 0.1, "y_1": -4, "y_2": 3}, {"world": "floor", "readings": 1, "y_1": 3, "sigma": 2.0},
    {"world": "square", "y": -1.0, "noise": "uniform", "half_width": 0.2}, {"world": "square", "noise": "normal"},
    {"world": "square", "y": 6.0, "x": -4.0},
], ids=str)
def test_finite_everywhere(changes):
    p = DESK.params(**changes)
    timeline = lesson.LESSON.timeline_of(p)
    for step, stage in itertools.product((0, timeline.steps), (FACTOR, PRODUCT)):
        v = DESK.view(p, step, stage)
        for item in v.scene:
            for field in ("pairs", "positions", "points", "values", "z"):
                assert np.isfinite(np.asarray(getattr(item, field, 0.0), dtype=float)).all(), item.name
        for readout in v.readouts:
            assert not isinstance(readout.value, float) or np.isfinite(readout.value)
        for figure in v.figures.values():
            for trace in figure.data:
                assert np.isfinite(np.asarray(trace.x, dtype=float)).all()
                assert np.isfinite(np.asarray(trace.y, dtype=float)).all()
        for e in v.equations:
            assert all(isinstance(x, str) or np.isfinite(x).all() for x in e.pieces)


def test_only_what_matters_is_shown():
    assert {"station_2", "station_3", "sigma_db", "seed", "sigma", "y"} <= lesson.LESSON.unused_at(DESK.default)
    assert "sigma" not in lesson.LESSON.unused_at(DESK.preset(FLOOR))
    assert "truth" in lesson.LESSON.unused_at(DESK.preset(FLOOR))
