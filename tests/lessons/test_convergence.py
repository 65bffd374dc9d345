"""Convergence: the slope of the error, what resampling adds, what doors cost."""

import numpy as np
import pytest

from lessons.indoor import convergence as lesson
from lessons.indoor._convergence_view import slope
from tests.lessons.support import Desk

DESK = Desk(lesson)
LAST = lesson.SECONDS


def test_the_error_falls_as_one_over_the_root_of_n():
    """20 filters for each N: the slope of six points has a standard deviation of about 0.05."""
    r = DESK.result(DESK.default)
    for name in ("threshold", "always"):
        assert slope(r, name, LAST) == pytest.approx(-0.5, abs=0.2)
    assert slope(r, "never", 0) == pytest.approx(-0.5, abs=0.2)


def test_without_resampling_the_error_stays_large():
    r = DESK.result(DESK.default)
    never, threshold, always = (r.errors[name][-1, LAST] for name in ("never", "threshold", "always"))
    assert never > 2 * threshold and never > 2 * always
    assert r.n_eff["never"][LAST] < 0.03 < 0.3 < r.n_eff["threshold"][LAST]


def test_at_the_start_there_is_no_difference():
    r = DESK.result(DESK.default)
    start = np.array([r.errors[name][:, 0] for name in r.errors])
    assert (start.max(axis=0) < 2 * start.min(axis=0)).all()


def test_few_particles_disagree_many_agree():
    few, many = (DESK.readouts(DESK.preset(name)) for name in ("20 particles", "2000 particles"))
    assert few["own"] > 5 * many["own"] and many["own"] < 0.5


def test_rare_scans_need_no_resampling():
    r = DESK.result(DESK.preset("rare scans"))
    assert r.scanned.sum() == 3
    assert r.errors["never"][-1, LAST] < 2.5 * r.errors["always"][-1, LAST]


def test_more_doors_are_more_choices():
    crossings = DESK.result(DESK.default).by_crossings[:, 0]
    assert (np.diff(crossings) < 0).all() and crossings[0] > 3 * crossings[-1]


def test_the_exact_density_is_one_and_the_filters_densities_too():
    r = DESK.result(DESK.default)
    np.testing.assert_allclose(r.density.sum(axis=1), 1.0)
    np.testing.assert_allclose(r.shown.sum(axis=2), 1.0)
    assert r.shown.shape[1] == lesson.SHOWN and abs(r.reference[LAST] - r.truth[LAST]) < 10.0
