"""Positioning by fingerprints: the oracle's data base, and what a denser or longer survey and Bayes are worth."""

import numpy as np
import pytest

from core.confidence import highest_density
from core.grid import moments
from core.sensors_radio import Fingerprint
from lessons.kit.lesson import Moment
from lessons.static import fingerprint as lesson
from lessons.static._fingerprint_model import (
    METHODS,
    SIDE_M,
    axes,
    estimates,
    field_of,
    grid_points,
    posterior,
    radio_map,
)
from lessons.static._fingerprint_view import outline
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
SURVEY, SCAN, NEIGHBOURS, POSTERIOR = range(4)
NN, KNN, WKNN, MEAN = range(4)
EMPTY = DESK.params(grid=False)


def test_oracle_C2_25():
    given, expected = entry("C2-25")["inputs"], entry("C2-25")["expected"]
    # its points at the corners of a square of 10 m: moved into the hall so that each owns a quarter of it
    points = np.array(given["points"]) + 0.5 * SIDE_M - 5.0
    m = radio_map(Fingerprint(points, given["a"], given["sigma"]), 100)
    np.testing.assert_allclose(m.share, 0.25)
    y = np.array(given["y"])
    np.testing.assert_allclose(m.sensor.squared_distances(y), expected["d2"])
    found = estimates(m, y, 3) - 0.5 * SIDE_M + 5.0
    np.testing.assert_allclose(found[NN], given["points"][expected["nn"]])
    np.testing.assert_allclose(found[WKNN], expected["wknn3"], rtol=1e-9)
    np.testing.assert_allclose(m.sensor.posterior(y, m.share), expected["posterior"], rtol=1e-9)
    np.testing.assert_allclose(m.sensor.posterior(y) @ np.array(given["points"]), expected["posterior_mean"], rtol=1e-9)
    # the lesson's posterior lives on the hall, not on the points: the means of the quarters
    np.testing.assert_allclose(estimates(m, y, 3)[MEAN], expected["posterior"] @ m.centroids, rtol=1e-9)


def test_the_posterior_mean_beats_the_nearest_neighbour():
    tests = DESK.result(DESK.default).tests
    assert tests.rms[MEAN] < 0.85 * tests.rms[NN]                       # 7.35 m and 8.96 m
    assert tests.rms[MEAN] < tests.rms[WKNN] < tests.rms[KNN] < tests.rms[NN]
    assert 0.92 < tests.covered < 0.97                                  # and it knows how good it is
    shown = DESK.readouts()
    assert shown["error_nn"] > 9.0 and shown["error_mean"] < 4.0        # the scan that is shown first says the same


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_so_it_is_in_other_halls(seed):
    r = DESK.result(DESK.params(seed=seed))
    assert r.tests.rms[MEAN] < 0.95 * r.tests.rms[NN]
    assert r.by_spacing[-3:, MEAN].mean() < 0.85 * r.by_spacing[:2, MEAN].mean()
    assert r.by_samples[-1, MEAN] < r.by_samples[0, MEAN]


def test_more_points_and_more_measurements_lower_the_error():
    r = DESK.result(DESK.default)
    for method in (NN, WKNN, MEAN):
        assert r.by_spacing[-2, method] < 0.8 * r.by_spacing[0, method]  # every 5 m and every 25 m
        assert r.by_samples[-1, method] < 0.9 * r.by_samples[0, method]
    assert (np.diff(r.by_spacing[:, MEAN]) < 0.05).all() and (np.diff(r.by_samples[:, MEAN]) < 0.05).all()
    at = list(lesson.SAMPLES).index(DESK.default.samples)
    np.testing.assert_allclose(r.by_samples[at], r.tests.rms)
    np.testing.assert_allclose(r.by_spacing[list(lesson.PER_AXIS).index(5)], r.tests.rms)
    dense = DESK.result(DESK.preset("every 5 m"))
    assert len(dense.map.share) == 100 and dense.tests.rms[MEAN] < r.tests.rms[MEAN]
    assert DESK.result(DESK.preset("one measurement per point")).tests.rms[MEAN] > 1.1 * r.tests.rms[MEAN]


def test_who_believes_in_too_little_noise_is_too_sure():
    sure, default = DESK.result(DESK.preset("too sure of itself")), DESK.result(DESK.default)
    assert sure.tests.covered == pytest.approx(0.62, abs=0.02)           # as the preset says
    assert sure.tests.rms[MEAN] > default.tests.rms[MEAN]
    assert DESK.readouts(DESK.preset("too sure of itself"))["region"] < 0.6 * DESK.readouts()["region"]


def test_surveyed_shadows_help():
    p = DESK.preset("shadows tell places apart")
    without = DESK.params(shadow_db=0.0, spacing_m=p.spacing_m, samples=p.samples)
    assert DESK.result(p).tests.rms[MEAN] < 0.95 * DESK.result(without).tests.rms[MEAN]


def test_one_access_point_gives_a_ring_with_the_mean_in_its_hole():
    p = DESK.preset("one access point: a ring")
    r = DESK.result(p)
    law = posterior(r.map, r.scans[1])
    region = highest_density(law, 0.95).inside
    middle = len(region) // 2
    assert not region[middle, middle]
    away = np.linalg.norm(law.points - np.array(p.ap_1), axis=-1)
    assert (law.weights * away).sum() > 12.0 and np.linalg.norm(r.found[1, MEAN] - np.array(p.ap_1)) < 3.0


def test_a_survey_of_ones_own():
    p = DESK.preset("survey it yourself")
    r = DESK.result(p)
    np.testing.assert_array_equal(r.map.sensor.points_m, p.by_hand)
    more = DESK.result(DESK.params(grid=False, by_hand=(*p.by_hand, (38.0, 38.0))))
    np.testing.assert_array_equal(more.map.sensor.powers_dbm[:4], r.map.sensor.powers_dbm)   # nothing is measured anew
    assert len(DESK.result(DESK.params(by_hand=((1.0, 2.0),))).map.share) == 26


def test_without_a_survey_there_is_nothing_to_say():
    r = DESK.result(EMPTY)
    assert r.map is None and np.isnan(r.by_samples).all() and np.isfinite(r.by_spacing).all()
    for show in ("stages", "learned", "field", "surface"):
        v = DESK.view(DESK.params(grid=False, show=show))
        assert "click" in v.note and v.readouts[1].value is None


@pytest.mark.parametrize("by_hand", [((10.0, 10.0),), ((10.0, 10.0),) * 3, ((0.0, 0.0), (50.0, 50.0))], ids=str)
def test_few_and_coinciding_points(by_hand):
    p = DESK.params(grid=False, by_hand=by_hand, neighbours=8)
    r = DESK.result(p)
    assert np.isfinite(r.found).all() and r.map.share.sum() == pytest.approx(1.0)
    assert f"only {len(by_hand)} survey points" in DESK.view(p).note
    if len(set(by_hand)) == 1:
        np.testing.assert_allclose(r.found[1, MEAN], 0.5 * SIDE_M, atol=0.02)               # the whole hall is one part


def test_grid_and_points_agree():
    """The posterior on the grid has the mean that comes from the parts, and its region is what the test counts."""
    r = DESK.result(DESK.default)
    for y, found in zip(r.scans[1:6], r.found[1:6], strict=True):
        np.testing.assert_allclose(moments(posterior(r.map, y)).mean, found[MEAN], atol=1e-9)
    p = DESK.default
    field, rng = field_of(p), np.random.default_rng(7)
    places = rng.uniform(0.0, SIDE_M, (60, 2))
    ys = field.power(places) + p.noise_db * rng.standard_normal((60, 4))
    covered = lesson.performance(r.map, places, ys, 3).covered
    step = SIDE_M / lesson.CELLS
    inside = [highest_density(posterior(r.map, y), 0.95).inside[tuple((x / step).astype(int))]
              for x, y in zip(places, ys, strict=True)]
    assert covered == pytest.approx(np.mean(inside), abs=0.02)


def test_the_field_is_what_the_sliders_say():
    p = DESK.params(shadow_db=6.0, length_m=5.0)
    x = np.random.default_rng(1).uniform(0.0, 400.0, (4000, 2))        # far larger than the hall, for the statistics
    shadow = field_of(p).power(x) - field_of(DESK.params(shadow_db=0.0)).power(x)
    np.testing.assert_allclose(shadow.std(axis=0), 6.0, rtol=0.12)
    y = x + np.array([5.0, 0.0])
    moved = field_of(p).power(y) - field_of(DESK.params(shadow_db=0.0)).power(y)
    assert (shadow * moved).mean() / (shadow**2).mean() == pytest.approx(np.exp(-0.5), abs=0.1)
    assert len(grid_points(10.0)) == 25 and len(grid_points(25.0)) == 4 and len(grid_points(4.0)) == 144


def test_the_outline_goes_round_the_region():
    inside = np.zeros((100, 100), dtype=bool)
    inside[10:20, 30:34] = True
    edges = outline(inside, axes(100))
    assert len(edges) == 2 * (10 + 4)
    corners = edges.reshape(-1, 2)
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[5, 15], [10, 17]])
    assert len(outline(np.ones((100, 100), dtype=bool), axes(100))) == 400


def test_stages_show_one_idea_each():
    shown = [DESK.items(step=3, stage=stage) for stage in range(4)]
    assert "map" in shown[SURVEY] and "likelihood" in shown[SCAN] and "posterior" in shown[POSTERIOR]
    assert {"nn", "knn", "wknn", "neighbours"} <= set(shown[NEIGHBOURS]) and "mean" not in shown[NEIGHBOURS]
    assert {"nn", "wknn", "mean", "region", "mean_before"} <= set(shown[POSTERIOR])
    running = {"survey": 0, "scan": 1, "distance": 2, "nn": 2, "knn": 2, "wknn": 2, "posterior": 3, "mean": 3}
    for stage in range(4):
        for e in DESK.view(step=3, stage=stage).equations:
            assert e.current == (running[e.name] == stage)
            assert any(not isinstance(x, str) for x in e.pieces) == (running[e.name] <= stage)
    r = DESK.result(DESK.default)
    numbers = {e.name: e.pieces[-1] for e in DESK.view(step=3).equations}
    np.testing.assert_array_equal(numbers["scan"], r.scans[3])
    np.testing.assert_array_equal(numbers["mean"], r.found[3, METHODS.index("mean")])
    assert set(DESK.items(step=0)) == set(DESK.items(step=0, stage=SURVEY)) and "map" in DESK.items(step=0)


def test_only_what_matters_is_shown():
    assert lesson.LESSON.unused_at(DESK.default) == set()
    assert lesson.LESSON.unused_at(DESK.params(count=2, grid=False)) == {"ap_3", "ap_4", "spacing_m"}


def test_finite_where_much_is_extreme():
    corner = {f"ap_{i}": (0.0, 0.0) for i in range(1, 5)}
    noisy = {"noise_db": 10.0, "assumed_db": 0.5, "samples": 1, "shadow_db": 10.0, "length_m": 2.0}
    for changes in (corner, noisy, {"truth": (3.0, 4.0), "exponent": 5.0}, {"neighbours": 8, "spacing_m": 25.0}):
        p = DESK.params(**changes)
        r = DESK.result(p)
        assert all(np.isfinite(a).all() for a in (r.scans, r.found, r.by_spacing, r.by_samples, r.tests.errors))
        for show in ("stages", "surface"):
            for item in DESK.lesson.view(DESK.params(show=show, **changes), r, Moment(1, POSTERIOR)).scene:
                for name in ("values", "positions", "pairs", "points", "z"):
                    assert np.isfinite(np.asarray(getattr(item, name, 0.0), dtype=float)).all()
