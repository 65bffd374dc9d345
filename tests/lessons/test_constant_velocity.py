"""The constant-velocity model: Q of the oracle, the semigroup, and how far the approximations are off."""

import itertools

import numpy as np
import pytest

from core.motion import constant_velocity
from lessons.filtering import constant_velocity as lesson
from lessons.filtering._constant_velocity_view import PROBABILITY
from lessons.kit.lesson import Moment, no_progress
from tests.lessons.support import Desk, check_plots, names
from tests.oracle import entry

DESK = Desk(lesson)
DEFAULT, preset, result = DESK.default, DESK.preset, DESK.result
AXIS = np.ix_([0, 2], [0, 2])
MOVE, NOISE = range(2)


@pytest.mark.parametrize("case", [0, 1])
def test_one_step_has_the_phi_and_q_of_the_oracle(case):
    asked, expected = (entry("C3-01")[key]["cases"][case] for key in ("inputs", "expected"))
    r = result(DESK.params(horizon_s=16.0 * asked["dt"], halvings=4, sigma_c=float(np.sqrt(asked["sc2"]))))
    np.testing.assert_allclose(r.motion.Phi[AXIS], expected["Phi1"], rtol=1e-12)
    np.testing.assert_allclose(r.motion.Q[AXIS], expected["Q1"], rtol=1e-12)


def test_two_half_steps_are_one_step_in_the_formulas_too():
    equations = {e.name: e.pieces for e in DESK.view(DEFAULT, 3).equations}
    np.testing.assert_allclose(equations["halves"][-1], equations["noise"][-1], rtol=1e-12)
    np.testing.assert_allclose(equations["law"][-1], equations["moved"][-1] + equations["noise"][-1], rtol=1e-12)


def test_paths_and_the_exact_prediction_do_not_depend_on_the_number_of_steps():
    runs = [result(DESK.params(halvings=j)) for j in (0, 2, 6)]
    for r in runs[1:]:
        assert r.paths.tobytes() == runs[0].paths.tobytes()
        np.testing.assert_allclose(r.laws.cov[-1], runs[0].laws.cov[-1], rtol=1e-12)
    assert runs[0].laws.cov[-1, 0, 0] == pytest.approx(20.0**3 / 3)


@pytest.mark.parametrize("scheme", ["euler", "acceleration"])
@pytest.mark.parametrize("halvings", [0, 2, 5])
def test_the_approximations_fall_short_by_the_factors_of_the_text(scheme, halvings):
    r = result(DESK.params(scheme=scheme, halvings=halvings))
    k = np.arange(1, 2**halvings + 1)
    factor = (1 - 1 / k) * (1 - 1 / (2 * k)) if scheme == "euler" else 1 - 1 / (4 * k**2)
    np.testing.assert_allclose(r.rival_laws.cov[1:, 0, 0], factor * r.laws.cov[1:, 0, 0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(r.rival_laws.cov[:, 2, 2], r.laws.cov[:, 2, 2], rtol=1e-12)
    assert np.linalg.matrix_rank(r.rival.Q) == 2 < np.linalg.matrix_rank(r.motion.Q)


def test_the_exact_ellipses_hold_the_paths_and_euler_s_do_not():
    r = result(DEFAULT)
    # 1000 paths: a standard deviation of 1.5 percentage points.
    assert (np.abs(r.inside[1:] - PROBABILITY) < 0.045).all()
    assert r.rival_inside[-1] < 0.57 and r.rival_inside[1] == 0.0
    np.testing.assert_allclose(r.spread[1:], np.sqrt(r.laws.cov[1:, 0, 0]), rtol=0.08)
    fine = result(preset("64 steps"))
    assert abs(fine.rival_inside[-1] - fine.inside[-1]) < 0.03
    one = result(preset("one step of 20 s"))
    assert one.rival_laws.cov[1, 0, 0] == 0.0 and one.rival_inside[1] == 0.0
    better = result(preset("constant acceleration"))
    assert better.rival_laws.cov[1, 0, 0] == pytest.approx(0.75 * better.laws.cov[1, 0, 0])
    np.testing.assert_allclose(better.rival.Q[0, 2], better.motion.Q[0, 2], rtol=1e-12)


def test_velocity_is_brownian_and_position_its_integral():
    r = result(DESK.params(sigma_c=2.0))
    steps = np.diff(r.paths[:, :, 2:], axis=0).reshape(lesson.FINE, -1)
    h = DEFAULT.horizon_s / lesson.FINE
    assert steps.std() == pytest.approx(2.0 * np.sqrt(h), rel=0.03)
    neighbours = np.mean(steps[1:] * steps[:-1]) / steps.var()
    assert abs(neighbours) < 0.03                                              # white: 12,000 products, sd 0.009
    trapezoids = np.cumsum(0.5 * h * (r.paths[1:, :, 2:] + r.paths[:-1, :, 2:]), axis=0)
    # The trapezoids miss the integral of a Brownian bridge in each of the 256 intervals: 2 h sqrt(T / 12) in all.
    assert np.abs(r.paths[1:, :, :2] - trapezoids).max() < 5 * 2.0 * h * np.sqrt(DEFAULT.horizon_s / 12)


def test_the_approximate_path_uses_the_same_brownian_motion():
    few, many = (result(DESK.params(halvings=j)) for j in (2, 6))
    ends = [np.linalg.norm(r.rival_path[-1] - r.paths[-1, 0, :2]) for r in (few, many)]
    assert ends[0] > 15.0 > 3.0 > ends[1]


def test_example_20_carries_the_numbers_of_the_notes():
    p = preset("Example 20 before any measurement")
    r = result(p)
    np.testing.assert_allclose(r.laws.mean[0], [0, 0, 5, 0])
    np.testing.assert_allclose(r.laws.cov[0], np.diag([100.0, 100.0, 9.0, 9.0]))
    first = constant_velocity(1.0, 1.0, 2)
    np.testing.assert_allclose(r.laws.cov[1], first.Phi @ r.laws.cov[0] @ first.Phi.T + first.Q, rtol=1e-12)
    assert r.laws.cov[1, 0, 0] == pytest.approx(109.0 + 1.0 / 3.0)


def test_stages_accumulate():
    r = result(DEFAULT)
    before, after = (DESK.view(DEFAULT, 3, stage) for stage in (MOVE, NOISE))
    assert {"moved", "motion", "fan_2"} <= names(before) and "law" not in names(before)
    assert {"law", "rival", "fan_2"} <= names(after)
    assert before.camera == after.camera == DESK.view(DEFAULT, 0).camera
    running = {"mean": 0, "moved": 0, "noise": 1, "law": 1, "halves": 1, "rival": 1, "rival_law": 1}
    for stage, v in enumerate((before, after)):
        for e in v.equations:
            assert e.current == (running[e.name] == stage)
            assert any(not isinstance(piece, str) for piece in e.pieces) == (running[e.name] <= stage)
    cloud = {item.name: item for item in before.scene}["cloud"].positions
    np.testing.assert_allclose(cloud, (r.cloud[2] @ r.motion.Phi.T)[:, :2])     # moved, not yet shaken


def test_a_picture_has_few_segments_and_few_nodes():
    for j in (0, 3, 6):
        p = DESK.params(halvings=j)
        v = DESK.view(p, 2**j)
        assert len(v.scene) <= 32
        assert len(next(i for i in v.scene if i.name == "paths").pairs) < 1000


def test_same_parameters_same_bytes_and_another_seed_another_path():
    a, b, c = (lesson.compute(DESK.params(seed=seed), no_progress) for seed in (DEFAULT.seed, DEFAULT.seed, 7))
    assert a.paths.tobytes() == b.paths.tobytes() != c.paths.tobytes()
    assert a.rival_inside.tobytes() == b.rival_inside.tobytes()


@pytest.mark.parametrize("changes", [
    dict(zip(("sigma_c", "horizon_s", "start_sigma_m", "halvings"), corner, strict=True))
    for corner in itertools.product((0.01, 10.0), (1.0, 120.0), (0.0, 50.0), (0, 6))], ids=str)
def test_finite_at_the_corners(changes):
    p = DESK.params(speed_mps=0.0, **changes)
    r = result(p)
    assert all(np.isfinite(a).all() for a in (r.paths, r.rival_path, r.laws.cov, r.rival_laws.cov, r.spread, r.inside))
    for step in (0, 1, 2**p.halvings):
        v = lesson.view(p, r, Moment(step, NOISE))
        assert v.camera.x[1] > v.camera.x[0] and v.camera.y[1] > v.camera.y[0]
        check_plots(v)
