"""What the lesson on resampling claims: the source's parents, what each scheme guarantees, and the two errata."""

from dataclasses import replace

import numpy as np
import pytest

from lessons.filtering import resampling as lesson
from lessons.kit.lesson import no_progress
from tests.lessons.support import Desk, check_formulas, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
shown = DESK.view


@pytest.mark.parametrize(("name", "case"), [("Algorithm 6", 0), ("comb at z₁ = 0.02", 1)])
def test_the_parents_are_those_of_the_oracle(name, case):
    inputs, expected = entry("C3-30")["inputs"], entry("C3-30")["expected"]
    r = result(preset(name))
    np.testing.assert_allclose(r.w, inputs["w"])
    assert r.z[0] == pytest.approx(inputs["z1"][case])
    assert (r.ancestors + 1).tolist() == expected["parents"][case]
    assert r.n_eff == pytest.approx(entry("C3-28")["expected"]["neff"][3], rel=1e-10)


def test_stratified_points_may_miss_a_particle_with_more_than_a_third_of_the_weight():
    inputs, expected = entry("C3-32")["inputs"], entry("C3-32")["expected"]
    p = preset("stratified: no copy for 0.34")
    r = result(p)
    np.testing.assert_allclose(r.w, inputs["w"])
    np.testing.assert_allclose(r.z, inputs["z"], atol=0.005)
    assert (r.ancestors + 1).tolist() == expected["parents"]
    assert r.copies[1] == 0 and r.w[1] > 1 / 3
    assert "gets 0 copies" in shown(p).note
    many = result(replace(p, repetitions=10_000)).many
    sd = np.sqrt(0.24 * 0.76 / 10_000)
    assert many.shares[1, 0] == pytest.approx(expected["prob_zero_copies"], abs=4 * sd)
    assert many.below[0] == many.below[3] == 0.0            # systematic and residual keep their promise
    assert result(preset("the same weights, systematic")).copies[1] >= 1


def test_all_schemes_are_unbiased_and_systematic_is_within_one_of_its_share():
    r = result(DESK.params(repetitions=5000))
    share = 5 * r.w
    sd = np.sqrt(share * (1 - r.w) / 5000)
    assert (np.abs(r.many.mean - share) < 5 * sd).all()
    np.testing.assert_allclose(r.many.variance[2], share * (1 - r.w), rtol=0.1)
    fraction = share - np.floor(share + 1e-12)
    np.testing.assert_allclose(r.many.variance[0], fraction * (1 - fraction), atol=0.02)
    # Every other scheme adds less noise to the mean than independent points.
    assert (r.many.mean_sd[[0, 1, 3]] < 0.85 * r.many.mean_sd[2]).all()
    for u in np.linspace(0.01, 1.0, 34).round(2):
        copies = result(DESK.params(u=float(u), repetitions=100)).copies
        assert (np.floor(share + 1e-9) <= copies).all() and (copies <= np.ceil(share - 1e-9)).all()


def test_copying_in_place_gives_children_of_the_wrong_parent():
    p = preset("copied in place")
    r, right = result(p), result(replace(p, gather="new"))
    np.testing.assert_array_equal(r.ancestors, right.ancestors)
    np.testing.assert_array_equal(right.children, right.x[right.ancestors])
    assert (r.children != right.children).any()
    assert "overwritten" in shown(p).note
    assert "wrong" in names(shown(p))
    # The source's own example happens to survive the printed loop.
    assert (result(DESK.params(gather="in_place")).children == result(DEFAULT).children).all()


def test_residual_copies_are_the_whole_shares_first():
    r = result(preset("residual"))
    assert r.outright.tolist() == [0, 0, 1, 1, 1]
    assert r.ancestors[:3].tolist() == [2, 3, 4] and len(r.z) == 2
    assert (r.copies >= r.outright).all()


@pytest.mark.parametrize("scheme", lesson.SCHEMES)
def test_the_points_shown_explain_the_ancestors(scheme):
    r = result(DESK.params(scheme=scheme, seed=4))
    by_hand = np.searchsorted(r.stairs, r.z)
    np.testing.assert_array_equal(by_hand, r.ancestors[len(r.ancestors) - len(r.z):])
    assert r.copies.sum() == 5


@pytest.mark.parametrize("scheme", lesson.SCHEMES)
def test_stages_accumulate_and_the_camera_stands_still(scheme):
    p = DESK.params(scheme=scheme)
    cameras = set()
    for step in range(6):
        counts = []
        for stage in range(3):
            v = shown(p, step, stage)
            cameras.add(v.camera)
            counts.append(sum(len(i.positions) for i in v.scene if i.name == "copies"))
            assert len(v.scene) <= 36
            assert sum(e.current for e in v.equations) >= 1
            check_formulas(v)
        assert counts == ([0] * 3 if step == 0 else [step - 1, step - 1, step])
    assert len(cameras) == 1


def test_particles_are_numbered_from_left_to_right():
    moved = DESK.params(p1=(9.5, 1.0))
    assert (np.diff(result(moved).x) >= 0).all()
    np.testing.assert_allclose(result(moved).w, [0.05, 0.3, 0.2, 0.35, 0.1])


def test_no_weight_anywhere_means_equal_weights():
    r = result(DESK.params(n=2, p1=(1.0, 0.0), p2=(3.0, 0.0)))
    assert r.w.tolist() == [0.5, 0.5]


@pytest.mark.parametrize("changes", DESK.ends(), ids=str)
def test_both_ends_of_every_parameter_are_finite(changes):
    p = DESK.params(**{"scheme": "residual", "repetitions": 100, **changes})
    v = shown(p)
    assert all(np.isfinite(x.value) for x in v.readouts)
    check_plots(v)
    assert len(result(p).ancestors) == p.n


def test_same_parameters_same_bytes():
    a, b = (lesson.compute(DEFAULT, no_progress) for _ in range(2))
    assert a.many.variance.tobytes() == b.many.variance.tobytes()
    assert lesson.compute(DESK.params(seed=2), no_progress).many.mean.tobytes() != a.many.mean.tobytes()
