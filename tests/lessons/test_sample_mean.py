"""The sample mean: unbiased, consistent with slope -1/2, whatever the law, unless there is no mean."""

import numpy as np
import pytest

from lessons.background import sample_mean as lesson
from tests.lessons.support import Desk

DESK = Desk(lesson)
MANY = DESK.params(repeats=2000)
LAST = len(lesson.NUMBERS) - 1


@pytest.mark.parametrize("law", ["normal", "uniform", "exponential"])
def test_the_covariance_of_the_means_is_sigma_over_n(law):
    """2000 means: variances within 4.5 standard deviations of 5 % (false alarm 1e-4 for all of them)."""
    r = DESK.result(DESK.params(repeats=2000, law=law))
    for k in (5, 12, LAST):
        cov = np.cov(r.means[k].T) * lesson.NUMBERS[k]
        np.testing.assert_allclose(np.diag(cov) / np.diag(r.law.cov), 1.0, atol=0.2)
        assert cov[0, 1] / r.law.cov[0, 1] == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("law", ["normal", "uniform", "exponential"])
def test_unbiased_and_consistent(law):
    r = DESK.result(DESK.params(repeats=2000, law=law))
    noise = np.sqrt(np.trace(r.law.cov) / lesson.NUMBERS / 2000)
    assert (r.bias < 4.0 * noise).all()
    slope = np.polyfit(np.log(lesson.NUMBERS), np.log(r.rms), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.02)
    assert r.rms[LAST] == pytest.approx(np.sqrt(np.trace(r.law.cov) / 1000), rel=0.1)


def test_the_ellipse_holds_68_percent():
    r = DESK.result(MANY)
    np.testing.assert_allclose(r.inside, 0.68, atol=4.5 * np.sqrt(0.68 * 0.32 / 2000))


def test_the_ellipse_shrinks_as_the_timeline_goes():
    def size(step):
        return np.sqrt(DESK.items(step=step)["mean_law"].gaussian.cov[0, 0])

    assert size(0) == pytest.approx(20.0) and size(LAST) == pytest.approx(20.0 / np.sqrt(1000))


def test_a_larger_n_continues_a_smaller_one():
    r = DESK.result(DESK.default)
    for k in (0, 4, 9):
        n = lesson.NUMBERS[k]
        np.testing.assert_allclose(r.means[k, 0], r.draws[:n].mean(axis=0))


def test_exponential_draws_are_lopsided_for_small_n():
    r = DESK.result(DESK.params(repeats=2000, law="exponential", correlation=0.0))
    z = (r.means - r.law.mean)[..., 0] / r.means[..., 0].std(axis=1, keepdims=True)
    skew = (z**3).mean(axis=1)
    assert skew[0] > 1.3 and abs(skew[LAST]) < 0.3


def test_cauchy_s_mean_never_settles():
    r = DESK.result(DESK.params(repeats=2000, law="cauchy"))
    spread = np.median(np.abs(r.means - r.law.mean)[..., 0], axis=1)
    assert spread[LAST] > 0.7 * spread[0]
    view = DESK.view(DESK.preset("Cauchy: no mean at all"), LAST)
    assert "no mean" in view.note and "outside" in view.caption


def test_numbers_and_formulas():
    found = DESK.readouts(step=9)
    assert found["n"] == lesson.NUMBERS[9] and found["sd_x"] == pytest.approx(20.0 / np.sqrt(found["n"]))
    numbers = {e.name: e.pieces[-1] for e in DESK.view(step=9).equations}
    np.testing.assert_allclose(numbers["variance"] * found["n"], DESK.result(DESK.default).law.cov)
