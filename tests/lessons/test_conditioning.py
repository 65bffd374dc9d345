"""What the lesson on conditioning claims: the slice at area 1 is N(6/13 y, 64/13), whatever y is."""

import itertools

import numpy as np
import pytest

from core.gaussian import log_density
from lessons.background import conditioning as lesson
from lessons.background._conditioning_view import CURVES, HILL, REGRESSION
from tests.lessons.finite import assert_finite
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

desk = Desk(lesson)


def test_example_11_has_the_numbers_of_the_oracle():
    want, found = entry("C1-24")["expected"], desk.readouts()
    for name, key in (("mean", "mean"), ("var", "var"), ("sd", "sd"), ("f_y", "f_y")):
        assert found[name] == pytest.approx(want[key], rel=1e-9)
    assert found["below"] == pytest.approx(100.0 * want["P_below_minus4"], rel=1e-9)
    np.testing.assert_allclose(desk.result(desk.default).joint.cov, [[16.0, 24.0], [24.0, 52.0]])
    given = np.asarray(desk.items()["given"].points)
    alone = np.asarray(desk.items()["x_law"].points)
    assert given[:, 2].max() == pytest.approx(CURVES, rel=2e-3)
    assert given[:, 2].max() / alone[:, 2].max() == pytest.approx(want["peak"] * np.sqrt(32.0 * np.pi), rel=2e-3)
    assert "−5.54 ± 2.22 m; before ± 4.00 m" in desk.view().caption


@pytest.mark.parametrize("y", [-12.0, 0.0, 7.0])
def test_the_slice_divided_by_its_area_is_the_conditional_law(y):
    r = desk.result(desk.params(probe=(-4.0, y)))
    t = np.linspace(-30.0, 30.0, 6001)
    slice_ = np.exp(log_density(r.joint, np.column_stack([t, np.full(len(t), y)])))
    assert slice_.sum() * (t[1] - t[0]) == pytest.approx(r.f_y, rel=1e-9)
    np.testing.assert_allclose(slice_ / r.f_y, np.exp(log_density(r.given, t[:, None])), rtol=1e-9)
    assert r.given.mean[0] == pytest.approx(6.0 / 13.0 * y, abs=1e-12)
    assert r.given.cov[0, 0] == pytest.approx(64.0 / 13.0)                 # the same for every y


@pytest.mark.parametrize("name", list(desk.lesson.presets))
def test_the_samples_in_the_strip_agree(name):
    """The mean of those with y within 1 m, less than 4.5 standard errors off (the strip itself shifts it a little)."""
    r = desk.result(desk.preset(name))
    x = r.draws[r.near, 0]
    assert len(x) > 25
    assert abs(x.mean() - r.given.mean[0]) < 4.5 * np.sqrt(r.given.cov[0, 0] / len(x)) + 0.05 * abs(r.K)


def test_completing_the_square():
    equations = {e.name: e.pieces for e in desk.view().equations}
    r, (x, y) = desk.result(desk.default), desk.default.probe
    assert equations["square"][-1] == pytest.approx((x - r.K * y) ** 2 / r.given.cov[0, 0])
    assert equations["quotient"][-1] == pytest.approx(float(np.exp(log_density(r.given, [x]))))


def test_the_cut_takes_the_front_away():
    whole, cut = desk.items(stage=0, step=0)["hill"], desk.items()["hill"]
    assert whole.y[0] < -12.5 and cut.y[0] == pytest.approx(-12.0)
    assert cut.z.max() == pytest.approx(HILL, rel=0.02)
    assert desk.items(desk.params(whole=True))["hill"].y[0] < -12.5
    slice_ = np.asarray(desk.items()["slice"].points)
    np.testing.assert_allclose(np.interp(slice_[:, 0], cut.x, cut.z[0]), slice_[:, 2], atol=0.05)


def test_what_a_measurement_teaches():
    """An accurate one nearly everything, one without x in it nothing; a negative H turns the sign."""
    assert desk.readouts(desk.preset("an accurate measurement"))["sd"] == pytest.approx(4.0 / np.sqrt(37.0))
    assert desk.readouts(desk.preset("a poor measurement"))["sd"] > 3.7
    nothing = desk.preset("H = 0: nothing is learnt")
    assert desk.readouts(nothing)["sd"] == pytest.approx(4.0) and desk.readouts(nothing)["mean"] == 0.0
    np.testing.assert_allclose(desk.items(nothing)["given_shadow"].points, desk.items(nothing)["x_law"].points)
    assert "H = 0" in desk.view(nothing).note
    assert desk.readouts(desk.preset("H < 0"))["mean"] == pytest.approx(72.0 / 13.0)


def test_stages_accumulate_and_formulas_typeset():
    shown = [desk.view(step=0, stage=k) for k in range(REGRESSION + 1)]
    for earlier, later in itertools.pairwise(shown):
        assert {i.name for i in earlier.scene} - {"hill_name"} < {i.name for i in later.scene}
    for k, v in enumerate(shown):
        for e in v.equations:
            for piece in e.pieces:
                if isinstance(piece, str):
                    typeset(piece)
        assert any(e.current for e in v.equations)
        assert all(any(not isinstance(x, str) for x in e.pieces) for e in v.equations) == (k == REGRESSION)


@pytest.mark.parametrize("changes", [
    {"probe": (16.0, 16.0)}, {"probe": (-16.0, -16.0), "sigma_v_m": 0.2}, {"sigma_x_m": 8.0, "gain": 3.0},
    {"sigma_x_m": 0.5, "gain": 0.0, "sigma_v_m": 0.2, "probe": (0.0, 16.0)}, {"sigma_v_m": 20.0},
    {"sigma_x_m": 0.5, "gain": 3.0, "sigma_v_m": 0.2, "probe": (0.0, -16.0)}], ids=str)
def test_extremes_stay_finite(changes):
    for stage in range(REGRESSION + 1):
        assert_finite(desk.view(desk.params(**changes), 0, stage))
