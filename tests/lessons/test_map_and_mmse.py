"""What the lesson on MAP and MMSE claims: one bottom, two formulas for it, and the mean of the worlds that fit."""

from dataclasses import replace

import numpy as np
import pytest

from core.linear_update import map_cost
from lessons.bayes_kalman import map_and_mmse as lesson
from lessons.kit.lesson import no_progress
from lessons.kit.params import parameters
from lessons.kit.scene import Surface
from tests.lessons.support import Desk, check_formulas, check_plots
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
MEAN = 4


PRESETS = list(lesson.LESSON.presets)


def cost(r, x):
    return sum(map_cost(r.gain_form.prior, r.y, r.sensor, x))


def test_the_default_has_the_numbers_of_the_oracle():
    want, r = entry("T-04")["expected"], result(DEFAULT)
    np.testing.assert_allclose(r.y, entry("T-04")["inputs"]["y"])
    np.testing.assert_allclose(r.info.posterior.mean, want["x_map"], rtol=1e-10)
    np.testing.assert_allclose(r.info.hessian, want["hessian"], rtol=1e-10)
    np.testing.assert_allclose(r.info.posterior.cov, want["P_post"], rtol=1e-10)
    np.testing.assert_allclose(r.gain_form.gain, want["K"], rtol=1e-10)
    assert cost(r, r.info.posterior.mean) == pytest.approx(want["cost"], rel=1e-10)


@pytest.mark.parametrize("name", PRESETS)
def test_both_forms_give_the_bottom_of_the_bowl(name):
    r = result(preset(name))
    assert r.gap_m < 1e-10
    np.testing.assert_allclose(r.info.posterior.cov, r.gain_form.posterior.cov, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(r.info.posterior.cov @ r.info.hessian, 2 * np.eye(2), atol=1e-9)
    around = r.info.posterior.mean + np.random.default_rng(0).standard_normal((200, 2))
    assert (cost(r, around) > cost(r, r.info.posterior.mean)).all()


@pytest.mark.parametrize("name", PRESETS)
def test_the_mean_of_the_worlds_that_fit_is_the_same_point(name):
    """Within 4.5 standard errors on each axis, and 5 % of a standard deviation for the width of the slice."""
    r = result(preset(name))
    kept = r.counts[-1]
    assert kept > 200
    sd = np.sqrt(np.diagonal(r.info.posterior.cov))
    np.testing.assert_array_less(np.abs(r.means[-1] - r.info.posterior.mean), 4.5 * sd / np.sqrt(kept) + 0.05 * sd)
    if name == "two measurements":                # keeping what is only near y widens; a vague prior makes that a lot
        np.testing.assert_allclose(np.std(r.x, axis=0), sd, rtol=0.1)


def test_one_measurement_makes_a_valley_and_the_prior_closes_it():
    r = result(preset("one measurement only: a valley"))
    assert np.linalg.matrix_rank(r.info.measured) == 1                   # erratum K5
    assert np.linalg.eigvalsh(r.info.hessian).min() > 0
    measured, _ = map_cost(r.gain_form.prior, r.y, r.sensor, np.column_stack([np.full(9, 2.0), np.arange(9.0)]))
    assert np.ptp(measured) < 1e-12                                      # flat along x2
    prior, post = r.gain_form.prior.cov, r.info.posterior.cov
    assert post[0, 0] < prior[0, 0] and post[1, 1] < prior[1, 1]         # x2 gains by its correlation


def test_a_vague_prior_gives_what_the_measurement_says():
    r = result(preset("a vague prior: least squares"))
    prior = r.gain_form.prior.mean
    assert np.linalg.norm(r.info.posterior.mean - r.told) < 0.1 * np.linalg.norm(r.told - prior)


def test_disagreement_costs_but_does_not_widen_the_posterior():
    quarrel = preset("they disagree")
    peace = replace(quarrel, told=quarrel.prior)
    least = [cost(result(p), result(p).info.posterior.mean) for p in (quarrel, peace)]
    assert least[0] > 5.0 and least[1] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_array_equal(result(quarrel).info.posterior.cov, result(peace).info.posterior.cov)


def test_the_mean_square_error_is_least_at_the_minimum():
    figure = DESK.view(DEFAULT, 40).figures["mmse"]
    theory, worlds = figure.data
    assert abs(theory.x[np.argmin(theory.y)]) < 1e-9
    assert min(theory.y) == pytest.approx(np.trace(result(DEFAULT).info.posterior.cov))
    assert abs(worlds.x[np.argmin(worlds.y)]) <= theory.x[1] - theory.x[0] + 1e-9


def test_stages_open_the_derivation():
    views = [DESK.view(DEFAULT, 40, stage) for stage in range(5)]
    surfaces = [[i.name for i in v.scene if isinstance(i, Surface)] for v in views]
    assert surfaces == [["prior_cost"], ["prior_cost", "measurement_cost"], ["sum_cost"], ["sum_cost"], ["sum_cost"]]
    for v in views:
        assert v.camera == views[0].camera and any(e.current for e in v.equations)
    bowl = next(i for i in views[3].scene if i.name == "sum_cost")
    low = next(i for i in views[3].scene if i.name == "minimum").positions[0]
    assert (bowl.x[bowl.z.argmin() % len(bowl.x)], bowl.y[bowl.z.argmin() // len(bowl.x)]) == pytest.approx(low[:2])
    assert bowl.z.min() == pytest.approx(low[2])


def test_the_density_turns_the_bowl_over():
    p = preset("the posterior density")
    hill = DESK.items(p, 40)["sum_cost"]
    at = hill.z.argmax()
    np.testing.assert_allclose((hill.x[at % len(hill.x)], hill.y[at // len(hill.x)]), result(p).info.posterior.mean,
                               atol=1e-9)


CORNERS = [{name: (q.low, q.high)} for name, q in parameters(lesson.Params).items() if q.kind == "point"]


@pytest.mark.parametrize("changes", [e for e in DESK.ends() + CORNERS if "seed" not in e], ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    p = DESK.params(**changes)
    for step, stage in ((0, MEAN), (1, 1), (40, MEAN)):
        v = DESK.view(p, step, stage)
        check_plots(v)
        check_formulas(v)
        for i in v.scene:
            if isinstance(i, Surface):
                assert np.isfinite(i.z).all() and np.ptp(i.x) > 0


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.x.tobytes() == b.x.tobytes() and a.info.posterior.mean.tobytes() == b.info.posterior.mean.tobytes()
    assert lesson.compute(DESK.params(seed=2), no_progress).x.tobytes() != a.x.tobytes()
