"""What the lesson on degeneracy claims: SIS collapses, resampling and better proposals help, ancestors are lost."""


import numpy as np
import pytest

from core.resampling import effective_sample_size
from lessons.filtering import degeneracy as lesson
from lessons.filtering._degeneracy_view import lines_alive
from lessons.kit.lesson import Moment, no_progress
from tests.lessons.support import Desk, check_formulas, check_plots

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
shown = DESK.view
LAST = 2
END = lesson.STEPS


def test_sis_ends_on_one_particle_and_sir_does_not():
    r = result(DEFAULT)
    assert r.sis.n_eff[-1] < 2.0 and r.sis.before[-1].max() > 0.7
    assert (r.sir.n_eff[1:] > 8.0).all()
    assert not r.sis.resampled.any() and r.sir.resampled[1:].all()
    exact = np.sqrt(np.mean(np.square(r.exact.mean - r.truth)))
    errors = [np.sqrt(np.mean(np.square(f.mean - r.truth))) for f in (r.sis, r.sir)]
    assert errors[1] < 0.75 * errors[0] and errors[1] < 1.5 * exact


def test_it_is_no_accident_of_the_seed():
    runs = [result(DESK.params(seed=s)) for s in range(6)]
    assert all(r.sis.n_eff[-1] < 3.0 for r in runs)
    assert all(r.sir.n_eff[1:].mean() > 10.0 for r in runs)


def test_resampling_costs_ancestors():
    r = result(DEFAULT)
    assert r.sir.roots[0] == DEFAULT.n_particles and r.sir.roots[-1] <= 6
    assert (np.diff(r.sir.roots) <= 0).all()
    alive = lines_alive(r.sir, Moment(END, LAST))
    assert alive[0].sum() == r.sir.roots[-1]


def test_a_threshold_resamples_only_below_it():
    p = preset("threshold N/2")
    r = result(p)
    np.testing.assert_array_equal(r.sir.resampled[1:], r.sir.n_eff[1:] < 0.5 * p.n_particles)
    assert 0 < r.sir.resampled.sum() == 7
    none = result(DESK.params(threshold=0.0))
    np.testing.assert_array_equal(none.sis.before, none.sir.before)


def test_sharp_measurements_want_a_better_proposal():
    prior, best = result(preset("sharp measurements")), result(preset("sharp, optimal proposal"))
    assert prior.sis.n_eff[3] < 1.2 and np.median(prior.sir.n_eff[1:]) < 5.0
    assert best.sis.n_eff[-1] > 10.0 and (best.sir.n_eff[2:] > 25.0).all()
    np.testing.assert_array_equal(prior.y, best.y)
    # All proposals that have seen a linear measurement draw from the same law.
    assert (prior.study[1:, 1] > 0.9).all() and prior.study[0, 1] < 0.2
    np.testing.assert_allclose(result(DESK.params(proposal="ekf")).sis.before,
                               result(DESK.params(proposal="ukf")).sis.before, atol=1e-6)


def test_more_particles_only_delay_the_collapse():
    assert result(preset("more particles do not help SIS")).sis.n_eff[-1] < 3.0


def test_the_mast_leaves_two_sides():
    r = result(preset("range to a mast"))
    side = r.sir.x[-1] > lesson.MAST[0, 0]
    share = float(r.sir.before[-1] @ side)
    assert 0.1 < share < 0.9
    assert r.exact is None and np.isnan(r.study[3]).all()
    fallen = preset("range to a mast", proposal="optimal")
    assert result(fallen).proposal == "ekf" and "linear sensor only" in shown(fallen).note


def test_the_tree_is_the_filter_s():
    r = result(DEFAULT)
    for f in (r.sis, r.sir):
        np.testing.assert_allclose(f.before.sum(axis=1), 1.0)
        np.testing.assert_allclose(f.n_eff, effective_sample_size(f.before))
        np.testing.assert_allclose((f.before * f.x).sum(axis=1)[1:], f.mean[1:])
    np.testing.assert_array_equal(r.sis.x[0], r.sir.x[0])
    np.testing.assert_array_equal(r.sis.parent, np.tile(np.arange(30), (END + 1, 1)))


def test_stages_accumulate():
    for step in (1, 6, END):
        views = [shown(DEFAULT, step, s) for s in range(3)]
        assert len({v.camera for v in views}) == 1
        sizes = [next(i.weights for i in v.scene if i.name == "sir_cloud") for v in views]
        assert sizes[0].shape == sizes[1].shape and not np.allclose(sizes[0], sizes[1])
        for stage, v in enumerate(views):
            assert len(v.scene) <= 42
            assert any(e.current for e in v.equations)
            check_formulas(v)
            measured = next((len(i.positions) for i in v.scene if i.name == "sis_y"), 0)
            assert measured == (step if stage else step - 1)


@pytest.mark.parametrize("changes", DESK.ends(), ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    p = DESK.params(**{"n_particles": 10, "sensor": "mast", **changes})
    for step in (0, END):
        v = shown(p, step)
        assert all(np.isfinite(x.value) for x in v.readouts)
        check_plots(v)


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.sir.x.tobytes() == b.sir.x.tobytes() and a.study.tobytes() == b.study.tobytes()
    assert lesson.compute(DESK.params(seed=2), no_progress).y.tobytes() != a.y.tobytes()
