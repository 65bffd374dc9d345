"""What the lesson on the Gaussian mixture filter claims: it keeps both peaks, and its moments are the particles'."""

from typing import Any

import numpy as np
import pytest

from core import mixture as core_mixture
from core.gaussian import log_density
from core.types import Gaussian
from lessons.filtering import _cutting, _mixture_tree, mixture
from lessons.filtering._histogram import weighted_density
from lessons.filtering._mixture_drawing import density, shown
from lessons.filtering._mixture_model import EDGES, side
from lessons.kit.scene import HeatMap, Label, LevelEllipse, Particles, Points, Polyline, Segments
from tests.lessons.support import Desk, typeset
from tests.oracle import entry

DESK = Desk(mixture)
PREDICT, SPLIT, UPDATE, REWEIGHT, REDUCE, ESTIMATE = range(6)
EXERCISE = DESK.preset("exercise 3.11")


def numbers(p: Any = None, step: int | None = None, stage: int = -1) -> dict[str, tuple]:
    return {e.name: e.pieces for e in DESK.view(p, step, stage).equations}


def test_the_mixture_keeps_both_peaks_where_the_ekf_keeps_one():
    r = DESK.result(DESK.default)
    assert r.ekf.mean[40, 1] < -60 and r.share_ekf[40] < 1e-6           # the truth is at +90
    assert np.sqrt(r.ekf.cov[40, 1, 1]) < 13
    (upper, above), (lower, below) = (side(r.posterior(40), up) for up in (True, False))
    assert upper == pytest.approx(0.634, abs=0.01) and upper + lower == pytest.approx(1.0)
    assert np.linalg.norm(above.mean[:2] - r.truth[40]) < 5
    assert np.linalg.norm(below.mean[:2] - r.truth[40] * [1, -1]) < 10  # the mirror image
    shown_here = DESK.readouts()
    assert shown_here["ekf_error"] > 170 and shown_here["side_error"] < 5
    scene = DESK.items()
    assert (scene["share_above"].text, scene["share_below"].text) == ("63 %", "37 %") and "mean_name" in scene


def test_its_moments_agree_with_the_particles():
    r = DESK.result(DESK.default)
    apart = np.linalg.norm(r.law.mean[:, :2] - r.pf.mean[:, :2], axis=1)
    assert apart.max() < 6                                              # of a spread of up to 85 m
    np.testing.assert_allclose(np.sqrt(r.law.cov[:, 1, 1]), np.sqrt(r.pf.cov[:, 1, 1]), rtol=0.15)
    assert np.abs(r.share - r.share_pf).max() < 0.07
    assert np.abs(r.share_ekf - r.share_pf).max() > 0.6
    assert DESK.readouts()["apart"] == pytest.approx(apart[40])


@pytest.mark.parametrize("seed", [0, 7, 2690])
def test_other_seeds_keep_both_peaks_too(seed):
    assert 0.1 < DESK.result(DESK.params(seed=seed, n_particles=200)).share[40] < 0.9


def test_one_component_that_is_never_split_is_the_ekf():
    p = DESK.preset("one component is an EKF")
    r = DESK.result(p)
    np.testing.assert_allclose(r.law.mean, r.ekf.mean, atol=1e-6)
    np.testing.assert_allclose(r.law.cov, r.ekf.cov, atol=1e-5)
    assert "is the EKF" in DESK.view(p).note
    assert DESK.readouts(p)["side_error"] is None


@pytest.mark.parametrize(("name", "share"), [("one component, but split", 1.0), ("two components are too few", 1.0),
                                             ("split too finely", 0.0)])
def test_these_lose_a_peak(name, share):
    assert DESK.result(DESK.preset(name)).share[40] == pytest.approx(share, abs=1e-6)


def test_split_and_merge_keep_the_moments_and_the_weights_follow_the_evidence():
    for s in DESK.result(DESK.default).steps[::7]:
        for before, after in ((s.predicted, s.division.after), (s.pruned.after, s.merged.after)):
            for a, b in zip(core_mixture.moments(before), core_mixture.moments(after), strict=True):
                np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-6)
        u = s.update
        w = u.prior.weights * np.exp(u.log_evidences)
        np.testing.assert_allclose(u.posterior.weights, w / w.sum(), rtol=1e-9)


def test_every_stage_shows_what_it_does():
    views = [DESK.items(DESK.default, 3, stage) for stage in range(6)]
    assert "density_prior" in views[PREDICT] and "density_prior" in views[SPLIT]
    s = DESK.result(DESK.default).steps[2]
    assert len(s.division.after.means) > len(s.predicted.means)
    assert len(views[SPLIT]["links"].pairs) >= len(s.division.after.means) - len(s.predicted.means)
    assert {"range_1", "range_2", "links"} <= set(views[UPDATE]) and "density" not in views[UPDATE]
    assert "density" in views[REWEIGHT] and "links" not in views[REWEIGHT]
    assert "before_all" in views[REDUCE] and "mean" not in views[REDUCE]
    assert "mean" in views[ESTIMATE]
    assert views[SPLIT]["ekf_now"].dashed and not views[UPDATE]["ekf_now"].dashed
    for v in views:                                                     # the heaviest class is never empty
        assert "now_3" in v and v["now_3"].width > 5
    assert len({DESK.view(DESK.default, k, stage).camera for k in (0, 9, 40) for stage in (0, 5)}) == 1
    assert max(len(v) for v in views) <= 30


def test_the_bars_are_the_weights_before_and_after():
    u = DESK.result(DESK.default).steps[9].update
    before, after = DESK.view(DESK.default, 10, REWEIGHT).figures["weights"].data
    order = shown(u.posterior)
    np.testing.assert_allclose(before.y, 100 * u.prior.weights[order])
    np.testing.assert_allclose(after.y, 100 * u.posterior.weights[order])
    assert (np.diff(u.posterior.means[order, 1]) >= 0).all()
    for stage in (PREDICT, SPLIT, REDUCE):
        (bars,) = DESK.view(DESK.default, 10, stage).figures["weights"].data
        assert sum(bars.y) == pytest.approx(100.0)


def test_the_formulas_hold_the_numbers_of_the_heaviest_component():
    n = numbers(None, 10)
    assert n["innovation"][2] - n["innovation"][4] == pytest.approx(n["innovation"][6])
    assert n["split"][2] * n["split"][4] == pytest.approx(n["split"][6])
    r = DESK.result(DESK.default)
    assert n["reweight"][-1] == pytest.approx(r.steps[9].update.posterior.weights.max())
    np.testing.assert_allclose(n["estimate"][-1], r.law.mean[10])
    waiting = DESK.view(DESK.default, 10, PREDICT).equations
    assert [len(e.pieces) > 1 for e in waiting] == [True] + [False] * (len(waiting) - 1)
    for p, step in ((DESK.default, 0), (DESK.default, 10), (EXERCISE, 3)):
        for pieces in numbers(p, step).values():
            for piece in pieces:
                if isinstance(piece, str):
                    typeset(piece)


def test_the_family_tree_follows_every_component():
    p = DESK.preset("the crossing in slow motion")
    s = DESK.result(p).steps[9]
    v = DESK.items(p, 10, REDUCE)
    counts = [len(m.means) for m in (DESK.result(p).posterior(9), s.predicted, s.division.after, s.division.after,
                                     s.update.posterior, s.posterior)]
    assert counts == [10, 10, 26, 26, 26, 11]
    assert len(v["tree"].positions) == sum(counts)
    survivors = _mixture_tree.survivors(s)
    assert len(v["tree_now"].pairs) == (survivors >= 0).sum() == 24
    assert len(v["tree_dropped"].positions) == len(v["dropped"].positions) == 2
    assert [len(DESK.items(p, 10, stage)["tree"].positions) for stage in (PREDICT, SPLIT)] == [20, 46]
    assert set(survivors[survivors >= 0]) == set(range(11))
    assert "left this picture" in DESK.view(p, 40).note
    assert "tree" not in DESK.items(DESK.default, 10, REDUCE)


def test_the_map_is_cut_at_its_frame():
    box = np.array([[0.0, 0.0], [10.0, 10.0]])
    law = Gaussian(np.array([20.0, 5.0]), np.eye(2))
    x = np.linspace(-5.0, 15.0, 21)
    items = [Points("a", [[5.0, 5.0], [11.0, 5.0]]), Particles("b", np.array([[1.0, 1.0], [-1.0, 1.0]]), np.ones(2)),
             Polyline("c", [[-5.0, 5.0], [15.0, 5.0]]), LevelEllipse("d", law), Label("e", "x", (5.0, 11.0)),
             Segments("f", np.array([[[1.0, 1.0], [2.0, 2.0]], [[9.0, 9.0], [11.0, 9.0]]])),
             HeatMap("g", x, x, np.ones((21, 21))), HeatMap("h", x + 50, x, np.ones((21, 21)))]
    left = {i.name: i for i in _cutting.cut(items, box)}
    assert set(left) == {"a", "b", "c", "f", "g"}
    assert len(left["a"].positions) == len(left["b"].weights) == len(left["f"].pairs) == 1
    np.testing.assert_allclose(left["c"].pairs, [[[0, 5], [10, 5]]])
    assert left["g"].values.shape == (11, 11)


def test_the_fill_is_the_density():
    m = DESK.result(DESK.default).posterior(12)
    x, P = m.means[:, :2], m.covs[:, :2, :2]
    a, b = np.linspace(-130, -90, 5), np.linspace(-60, 60, 7)
    points = np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1)
    expected = sum(w * np.exp(log_density(Gaussian(i, j), points)) for w, i, j in zip(m.weights, x, P, strict=True))
    np.testing.assert_allclose(density(m.weights, x, P, a, b), expected, rtol=1e-9)


def test_the_histogram_is_numpy_s():
    rng = np.random.default_rng(0)
    x, w = rng.normal(0.0, 80.0, 5000), rng.random(5000)
    expected = np.histogram(x, EDGES, weights=w)[0] / (EDGES[1] - EDGES[0])
    np.testing.assert_allclose(weighted_density(x, w, EDGES), expected)


def test_exercise_3_11_has_the_oracle_s_numbers():
    known = entry("C3-22")["expected"]
    r = DESK.result(EXERCISE)
    np.testing.assert_allclose(r.law.mean, known["mean"], rtol=1e-9)
    np.testing.assert_allclose(r.law.cov, known["total_cov"], rtol=1e-9)
    for cov in r.y.covs:
        np.testing.assert_allclose(cov, known["comp_cov"], rtol=1e-9)
    assert r.density == pytest.approx(known["pdf"], rel=1e-9)
    shown_here = DESK.readouts(EXERCISE)
    assert (shown_here["mean_1"], shown_here["mean_2"]) == pytest.approx(known["mean"])
    assert shown_here["density"] == r.density
    # The draws agree within five standard errors.
    error = np.sqrt(np.diag(r.law.cov) / len(r.draws[2]))
    assert (np.abs(r.draws[2].mean(axis=0) - r.law.mean) < 5 * error).all()


def test_the_lemma_needs_the_mean_from_before_the_update():
    known = entry("C3-22")["expected"]["lemma"]

    def normal(x, mean, variance):
        return float(np.exp(log_density(Gaussian(np.array([mean]), np.array([[variance]])), np.array([x]))))

    K, S = 4 * 2 / 19, 19.0                                             # mu 1, Sigma_1 4, H 2, Sigma_2 3
    updated = normal(0.5, 1 + K * (4 - 2), (1 - K * 2) * 4)
    left, right, printed = normal(0.5, 1, 4) * normal(4, 1, 3), updated * normal(4, 2, S), updated * normal(
        4, 2 * (1 + K * 2), S)
    assert left == pytest.approx(known["lhs"]) == pytest.approx(right)
    assert printed == pytest.approx(known["rhs_printed"])


def test_the_exercise_goes_step_by_step():
    names = [set(DESK.items(EXERCISE, step)) for step in range(4)]
    assert "x_3" in names[0] and "image_3" not in names[0]
    assert {"x_all", "image_3", "column_1"} <= names[1]
    assert {"y_3", "share_1"} <= names[2] and "law" not in names[2]
    assert {"density", "law", "mean"} <= names[3]
    assert set(DESK.lesson.unused_at(EXERCISE)) & set(DESK.lesson.unused_at(DESK.default)) == set()


@pytest.mark.parametrize("changes", [
    {"f_1": (0.0, 0.0), "f_2": (0.0, 0.0)}, {"alpha": 0.0}, {"alpha": 1.0}, {"mu_1": (4.0, 2.0)},
    {"mu_1": (-10.0, -10.0), "mu_2": (10.0, 10.0), "f_1": (3.0, 3.0), "f_2": (3.0, 3.0), "sigma": 2.0},
    {"probe": (20.0, -20.0), "q_1": 0.05, "q_2": 0.05, "sigma": 0.2}], ids=str)
def test_the_exercise_is_finite_everywhere(changes):
    p = DESK.preset("exercise 3.11", **changes)
    v = DESK.view(p)
    assert all(np.isfinite(x.value) for x in v.readouts)
    assert v.camera.x[1] > v.camera.x[0] and v.camera.y[1] > v.camera.y[0]
    for f in v.figures.values():
        for trace in f.data:
            assert np.isfinite(np.asarray(trace.y, dtype=float)).all()


@pytest.mark.parametrize("changes", [{"components": 32, "split_m": 4.0, "parts": 5, "merge_nats": 0.001},
                                     {"sigma_m": 50.0, "split_m": 4.0}, {"sigma_m": 2.0, "components": 1}], ids=str)
def test_the_filter_is_finite_everywhere(changes):
    p = DESK.params(n_particles=200, **changes)
    for zoom in ("track", "tree"):
        q = DESK.params(n_particles=200, zoom=zoom, **changes)
        for stage in range(6):
            v = DESK.lesson.view(q, DESK.result(p), DESK.lesson.timeline_of(q).clamp(20, stage))
            assert all(x.value is None or isinstance(x.value, str) or np.isfinite(x.value) for x in v.readouts)
            assert sum(len(i.pairs) for i in v.scene if isinstance(i, Segments)) < 6000
