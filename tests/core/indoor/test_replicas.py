"""Copies of the graph filter in one cloud: the same law as the filter itself, and independent of each other."""

import numpy as np
import pytest

from core.cloud import AllWeightsZero
from core.indoor import AccessPoints, Walk, replicate, room_corridor, run, simulate_scans, walk_route

GRAPH = room_corridor()
POINTS = AccessPoints([[5, 6], [25, -6], [45, 6]])
TRUTH = walk_route(GRAPH, ["c0", "c10"], speed_mps=1.2, epochs=16)
SCANS = simulate_scans(TRUTH, POINTS, np.random.default_rng(1), interval_s=3.0)
WALK = Walk(l_max_m=None)


def x(cloud):
    return cloud.position_m[:, :1]


def replicas(n=200, runs=40, seed=1, **options):
    return replicate(GRAPH, SCANS, POINTS, x, n, runs, np.random.default_rng(seed), walk=WALK, **options)


def test_the_mean_over_copies_is_that_of_single_filters():
    """40 copies and 40 filters of 200 particles: their means agree within 4.5 standard errors (false alarm 1e-4)."""
    made = replicas()
    single = np.array([run(GRAPH, SCANS, POINTS, np.random.default_rng([2, k]), n_particles=200, walk=WALK,
                           recovery=None, subsample=1).mean[:, 0] for k in range(40)])
    for t in (0, 6, 15):
        a, b = made.values[:, t, 0], single[:, t]
        assert abs(a.mean() - b.mean()) < 4.5 * np.sqrt((a.var() + b.var()) / 40)
        assert 0.5 < a.std() / b.std() < 2.0


def test_copies_are_independent():
    """The mean of 40 copies has the error of one filter with 40 times as many particles, not that of one copy."""
    exact = replicas(n=20_000, runs=2).values[:, -1, 0].mean()
    errors = replicas().values[:, -1, 0] - exact
    assert abs(errors.mean()) < 4.5 * errors.std() / np.sqrt(40)


def test_thresholds():
    never, always = replicas(threshold=0.0), replicas(threshold=1.0)
    scanned = ~np.isnan(SCANS).all(axis=1)
    assert not never.resampled.any() and (always.resampled == scanned).all()
    assert never.n_eff[:, -1].mean() < 0.2 * always.n_eff[:, -1].mean()
    assert never.crossings[0] == 0.0 and (never.crossings[1:] > 0.0).all()


def test_seeds_progress_and_cancellation():
    a, b = replicas(runs=3), replicas(runs=3)
    assert a.values.tobytes() == b.values.tobytes()
    seen = []
    replicas(runs=2, progress=seen.append)
    assert seen[-1] == 1.0 and seen == sorted(seen)


def test_errors():
    with pytest.raises(ValueError, match="threshold"):
        replicas(threshold=2.0)
    with pytest.raises(ValueError, match="n_particles"):
        replicas(n=0)
    with pytest.raises(ValueError, match="expected"):
        replicate(GRAPH, SCANS[0], POINTS, x, 10, 2, np.random.default_rng(1))
    loud = AccessPoints([[5, 6], [25, -6], [45, 6]], sigma_db=1e-160)
    with pytest.raises(AllWeightsZero), np.errstate(over="ignore"):
        replicate(GRAPH, SCANS, loud, x, 10, 2, np.random.default_rng(1))
