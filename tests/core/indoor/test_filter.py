"""The graph-based particle filter."""

import dataclasses

import numpy as np
import pytest

from core.cloud import AllWeightsZero
from core.indoor import (
    AccessPoints,
    Belief,
    FloorGraph,
    Recovery,
    Walk,
    advance,
    estimates,
    floor_rate,
    object_weights,
    office_building,
    place,
    project,
    run,
    scatter,
    simulate_scans,
    start,
    step,
    walk_route,
)
from core.indoor.cloud import gather
from core.indoor.point_estimates import mean_and_cov
from core.resampling import effective_sample_size
from tests.core.indoor.maps import M0, M1
from tests.core.indoor.test_motion import on_map

OFFICE = office_building()
POINTS = AccessPoints([[5, 6], [25, -6], [45, 6]])
OFFICE_POINTS = AccessPoints(
    [[6, 3], [30, -3], [54, 3], [30, 20], [72, -2], [80, 12], [40, -18], [-8, -10],
     [6, 3], [30, -3], [54, 3], [30, 20]],
    floor=[0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1])


def scan(graph, points, x, floor=0, noise=0.0, seed=1):
    z = np.array([x[0], x[1], graph.floor_height_m * floor])
    return points.expected(z, floor) + noise * np.random.default_rng(seed).standard_normal(len(points))


def same(a, b):
    return all(np.array_equal(p, q) for p, q in zip(a, b, strict=True))


def test_a_step_shows_everything_it_did():
    rng = np.random.default_rng(1)
    belief = start(OFFICE, 800, rng)
    y = scan(OFFICE, OFFICE_POINTS, (20.0, 0.0))
    s = step(OFFICE, belief, y, OFFICE_POINTS, rng)
    assert s.before is belief and s.resampled
    on_map(OFFICE, s.predicted)
    np.testing.assert_allclose(
        s.log_likelihood, OFFICE_POINTS.log_likelihood(y, s.predicted.position_m, s.predicted.floor))
    w = np.exp(s.log_likelihood - s.log_likelihood.max())
    np.testing.assert_allclose(s.weights_before, w / w.sum())
    assert s.n_eff == pytest.approx(effective_sample_size(s.weights_before))
    assert s.log_evidence == pytest.approx(np.log(np.exp(s.log_likelihood).mean()))
    assert same(s.particles, gather(s.predicted, s.ancestors)) and s.after.cloud is s.particles
    assert (s.weights == 1 / 800).all() and np.allclose(np.exp(s.after.log_weights), s.weights)
    copies = np.bincount(s.ancestors, minlength=800)
    assert np.abs(copies - 800 * s.weights_before).max() < 1.0 + 1e-9     # systematic
    here = s.predicted.floor == s.floor
    mean, cov = mean_and_cov(s.predicted.position_m[here, :2], s.weights_before[here])
    np.testing.assert_allclose(s.mean, mean)
    np.testing.assert_allclose(s.cov, cov, atol=1e-9)
    p = project(OFFICE, s.mean, s.floor)
    assert s.projection.object_id == p.object_id and (s.projection.xy_m == p.xy_m).all()
    e = estimates(OFFICE, s.predicted, s.weights_before)
    assert e.floor == s.floor and e.mean == pytest.approx(s.mean)


def test_the_walk_inside_a_step_is_advance():
    belief = start(OFFICE, 300, np.random.default_rng(1))
    s = step(OFFICE, belief, None, OFFICE_POINTS, np.random.default_rng(2), dt_s=1.0)
    moved = advance(OFFICE, belief.cloud, 1.0, Walk(), np.random.default_rng(2))
    assert same(s.predicted, moved.cloud) and same(s.choices, moved.choices)


def test_without_a_scan_nothing_is_weighed():
    rng = np.random.default_rng(1)
    w = rng.uniform(1, 2, 400)
    belief = Belief(scatter(M0, 400, rng), np.log(w / w.sum()))
    for y in (None, [np.nan] * 3):
        s = step(M0, belief, y, POINTS, rng, threshold=1.0)
        assert not s.resampled and (s.ancestors == np.arange(400)).all() and s.log_evidence == pytest.approx(0.0)
        np.testing.assert_allclose(s.weights, w / w.sum())
        np.testing.assert_allclose(s.after.log_weights, belief.log_weights)


def test_the_threshold_decides_about_resampling():
    rng = np.random.default_rng(1)
    belief = Belief(place(M0, "b", 200, offset_m=np.linspace(0, 20, 200)), np.full(200, -np.log(200)))
    y = scan(M0, POINTS, (20.0, 0.0))
    never = step(M0, belief, y, POINTS, rng, dt_s=0.0, threshold=0.0)
    assert not never.resampled and np.allclose(np.exp(never.after.log_weights), never.weights_before)
    share = never.n_eff / 200
    assert step(M0, belief, y, POINTS, rng, dt_s=0.0, threshold=share + 0.01).resampled
    assert not step(M0, belief, y, POINTS, rng, dt_s=0.0, threshold=share - 0.01).resampled
    for name in ("stratified", "multinomial", "residual"):
        assert step(M0, belief, y, POINTS, rng, threshold=1.0, resampler=name).resampled


def test_weights_carry_over():
    """Two scans without resampling weigh like both at once."""
    rng = np.random.default_rng(1)
    belief = start(M0, 500, rng)
    y1, y2 = scan(M0, POINTS, (20, 0)), scan(M0, POINTS, (22, 0))
    one = step(M0, belief, y1, POINTS, rng, dt_s=0.0, threshold=0.0)
    two = step(M0, one.after, y2, POINTS, rng, dt_s=0.0, threshold=0.0)
    total = one.log_likelihood + two.log_likelihood
    w = np.exp(total - total.max())
    np.testing.assert_allclose(two.weights, w / w.sum())
    assert one.log_evidence + two.log_evidence == pytest.approx(np.log(np.exp(total).mean()))


def test_no_underflow():
    rng = np.random.default_rng(1)
    belief = start(M0, 300, rng)
    for y in ([-1000.0, -1000.0, -1000.0], [1e5, -1e5, 0.0]):
        s = step(M0, belief, y, POINTS, rng, recovery=None)
        assert np.isfinite(s.weights).all() and s.weights.sum() == pytest.approx(1.0) and s.n_eff >= 1.0 - 1e-12
        assert s.log_evidence < -1e3


def test_one_access_point_leaves_two_modes():
    """A long corridor and an access point beside its middle: the posterior is symmetric."""
    g = FloorGraph.from_dict({"nodes": {"w": [-40, 0], "e": [40, 0]}, "links": {"l": ["w", "e"]}})
    one = AccessPoints([[0, 5]], sigma_db=2.0)
    belief = Belief(place(g, "l", 1601, offset_m=np.linspace(0, 80, 1601)), np.full(1601, -np.log(1601)))
    s = step(g, belief, scan(g, one, (20, 0)), one, np.random.default_rng(1), dt_s=0.0, threshold=0.0)
    np.testing.assert_allclose(s.weights, s.weights[::-1], rtol=1e-9)
    assert s.mean == pytest.approx([0.0, 0.0], abs=1e-9) and abs(s.predicted.position_m[s.weights.argmax(), 0]) > 15
    out = estimates(g, s.predicted, s.weights)
    assert abs(s.predicted.position_m[out.mode, 0]) == pytest.approx(20.0, abs=3.0)
    two = AccessPoints([[0, 5], [40, 5]], sigma_db=2.0)
    t = step(g, belief, scan(g, two, (20, 0)), two, np.random.default_rng(1), dt_s=0.0, threshold=0.0)
    assert t.mean[0] == pytest.approx(20.0, abs=3.0)


def test_the_filter_agrees_with_a_point_mass_filter_on_a_corridor():
    """Speed v for all, known direction: the posterior is a translated likelihood, computed on a fine grid."""
    g = FloorGraph.from_dict({"nodes": {"w": [0, 0], "e": [100, 0]}, "links": {"l": ["w", "e"]}})
    points, steady = AccessPoints([[20, 5], [60, -5]], sigma_db=4.0), Walk(
        sigma_v_mps=0, turn_rate_hz=0, stop_rate_hz=0)
    N, rng = 20_000, np.random.default_rng(2)
    belief = Belief(place(g, "l", N, offset_m=rng.uniform(0, 60, N), speed_mps=1.0), np.full(N, -np.log(N)))
    x = np.linspace(0, 60, 6001)
    log_p = np.zeros(6001)
    for k in range(8):
        y = scan(g, points, (22 + k, 0.0), noise=4.0, seed=k)
        s = step(g, belief, y, points, rng, dt_s=1.0, walk=steady, recovery=None)
        belief = s.after
        at = np.column_stack([x + k + 1, 0 * x, 0 * x])
        log_p += points.log_likelihood(y, at, np.zeros(6001))
        p = np.exp(log_p - log_p.max())
        p /= p.sum()
        mean = p @ (x + k + 1)
        sd = np.sqrt(p @ np.square(x + k + 1 - mean))
        # Monte Carlo sd about sd / sqrt(N) a few times over: 0.02 sd here; 5 of them
        assert s.mean[0] == pytest.approx(mean, abs=0.1 * sd)
        assert np.sqrt(s.cov[0, 0]) == pytest.approx(sd, rel=0.1)


def test_recovery_finds_a_walker_who_was_carried_away():
    sharp = dataclasses.replace(OFFICE_POINTS, sigma_db=3.0)
    rng = np.random.default_rng(1)
    away = place(OFFICE, "yard", 500, position_m=[-10.0, -20.0])
    y = scan(OFFICE, sharp, (90.0, 14.0))
    belief = Belief(away, np.full(500, -np.log(500)))
    first = step(OFFICE, belief, y, sharp, rng)
    assert first.recovered.size == 0 and first.after.bad_scans == 1
    second = step(OFFICE, first.after, y, sharp, rng)
    assert second.recovered.size == 150 and second.after.bad_scans == 0
    assert np.hypot(*(second.projection.xy_m - [90, 14])) < 12.0
    outside = np.setdiff1d(np.arange(500), second.recovered)
    assert np.hypot(*(second.predicted.position_m[outside, :2] - [-10, -20]).T).max() < 6.0
    stubborn = step(OFFICE, first.after, y, sharp, rng, recovery=None)
    assert stubborn.recovered.size == 0 and np.hypot(*(stubborn.projection.xy_m - [90, 14])) > 80.0
    good = step(OFFICE, Belief(away, belief.log_weights, 1), scan(OFFICE, sharp, (-10, -20)), sharp, rng)
    assert good.after.bad_scans == 0 and good.recovered.size == 0
    eager = step(OFFICE, belief, y, sharp, rng, recovery=Recovery(scans=1, share=1.0))
    assert eager.recovered.tolist() == list(range(500))


def test_a_walk_through_the_building_is_followed():
    truth = walk_route(OFFICE, ["0r1", "cafe", "0w5", "1r8"], pause_s=[10.0, 0.0, 0.0])
    rng = np.random.default_rng(4)
    y = simulate_scans(truth, OFFICE_POINTS, rng, interval_s=2.0)
    out = run(OFFICE, y, OFFICE_POINTS, rng, n_particles=800)
    e = np.hypot(*(out.projected - truth.position_m[:, :2]).T)
    assert np.mean(e[10:]) < 4.0 and floor_rate(out.floor, truth.floor) > 0.9
    assert (out.scanned == (np.arange(len(y)) % 2 == 0)).all() and not out.resampled[~out.scanned].any()
    assert out.time_s.tolist() == truth.time_s.tolist() and len(out.object_ids) == len(y)
    for k in (0, 7, len(y) - 1):
        s = out.steps[k]
        assert (s.mean == out.mean[k]).all() and s.n_eff == out.n_eff[k]
        on_map(OFFICE, s.particles)
        if k:
            assert s.before is out.steps[k - 1].after
    final = object_weights(OFFICE, out.last.cloud, np.exp(out.last.log_weights))
    assert sum(final.values()) == pytest.approx(1.0)


def test_run_is_a_loop_of_steps():
    y = simulate_scans(walk_route(M1, ["n11", "n4"]), POINTS, np.random.default_rng(1), interval_s=3.0)[:12]
    rng, again = np.random.default_rng(5), np.random.default_rng(5)
    seen = []
    out = run(M1, y, POINTS, rng, n_particles=200, keep=lambda k, s: (k, s.n_eff), progress=seen.append)
    belief = start(M1, 200, again)
    for k in range(12):
        s = step(M1, belief, y[k], POINTS, again, dt_s=1.0 if k else 0.0)
        belief = s.after
        assert same(s.particles, out.steps[k].particles) and (s.mean == out.mean[k]).all()
        assert out.kept[k] == (k, s.n_eff)
    assert seen == [(k + 1) / 12 for k in range(12)]
    assert same(out.last.cloud, belief.cloud)
    repeated = run(M1, y, POINTS, np.random.default_rng(5), n_particles=200)
    assert (repeated.projected == out.projected).all()


def test_large_clouds_are_kept_thinned():
    y = simulate_scans(walk_route(M1, ["n1", "n4"], epochs=5), POINTS, np.random.default_rng(1), interval_s=2.0)
    out = run(M1, y, POINTS, np.random.default_rng(1), n_particles=3000, subsample=100)
    whole = run(M1, y, POINTS, np.random.default_rng(1), n_particles=3000, subsample=3000)
    assert (out.mean == whole.mean).all() and len(out.last.log_weights) == 3000 and len(out.index) == 100
    for thin, s in zip(out.steps, whole.steps, strict=True):
        assert (thin.predicted.offset_m == s.predicted.offset_m[out.index]).all()
        assert (thin.particles.position_m == s.particles.position_m[out.index]).all()
        assert thin.weights_before.sum() == pytest.approx(1.0)
        assert (thin.before.cloud.object == s.before.cloud.object[out.index]).all()
        assert (thin.ancestors == s.ancestors[out.index]).all() and len(thin.after.log_weights) == 100


def test_cancelling():
    class Stop(Exception):
        pass

    def progress(share):
        if share > 0.3:
            raise Stop

    with pytest.raises(Stop):
        run(M0, np.full((10, 3), -60.0), POINTS, np.random.default_rng(1), n_particles=50, progress=progress)


def test_inputs_are_left_alone():
    rng = np.random.default_rng(1)
    belief = start(M1, 300, rng)
    copies = [a.copy() for a in belief.cloud], belief.log_weights.copy()
    y = np.array([-60.0, np.nan, -70.0])
    for _ in range(3):
        step(M1, belief, y, POINTS, rng)
    assert same(belief.cloud, copies[0]) and (belief.log_weights == copies[1]).all()
    assert np.array_equal(y, [-60.0, np.nan, -70.0], equal_nan=True)


def test_bad_input():
    rng = np.random.default_rng(1)
    belief = start(M0, 50, rng)
    y = [-60.0, -60.0, -60.0]
    for bad in ([-60.0], [np.inf, 0, 0], [y, y]):
        with pytest.raises(ValueError, match="y: expected"):
            step(M0, belief, bad, POINTS, rng)
    for threshold in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match="threshold"):
            step(M0, belief, y, POINTS, rng, threshold=threshold)
    with pytest.raises(ValueError, match="resampler"):
        step(M0, belief, y, POINTS, rng, threshold=1.0, resampler="x")
    with pytest.raises(ValueError, match="dt_s"):
        step(M0, belief, y, POINTS, rng, dt_s=-1.0)
    for log_w in (belief.log_weights[:9], np.full(50, np.nan), np.full(50, np.inf)):
        with pytest.raises(ValueError, match="belief"):
            step(M0, Belief(belief.cloud, log_w), y, POINTS, rng)
    with pytest.raises(AllWeightsZero):
        step(M0, Belief(belief.cloud, np.full(50, -np.inf)), y, POINTS, rng)
    with pytest.raises(ValueError, match="cloud"):
        step(M1, belief, y, POINTS, rng)
    with pytest.raises(ValueError, match="floor height"):
        low = AccessPoints([[0, 0]], floor_height_m=3.0)
        step(OFFICE, start(OFFICE, 20, rng), [-60.0], low, rng)
    for bad in (dict(scans=y), dict(scans=np.zeros((0, 3))), dict(subsample=0), dict(dt_s=0.0), dict(n_particles=0)):
        with pytest.raises(ValueError, match="expected"):
            run(**{"graph": M0, "scans": [y], "points": POINTS, "rng": rng, **bad})
