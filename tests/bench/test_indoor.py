"""The step of the graph-based particle filter against drawing normal noise, and against a loop over the particles."""

import numpy as np
import pytest

from core.indoor import AccessPoints, Walk, office_building, simulate_scans, start, step, walk_route
from tests.bench import at_most, faster, medians
from tests.bench.indoor_loop import Loop, Walker

GRAPH = office_building()
POINTS = AccessPoints([[5, 3], [20, -3], [40, 3], [55, -3], [30, 15], [70, 0], [10, 3], [45, -3]],
                      floor=[0, 0, 0, 0, 1, 0, 1, 1])
WALK = Walk()
N, PART = 10_000, 10                                          # the loop does every 10th particle
Y = POINTS.expected([30.0, 0.0, 0.0], 0) + np.array([3.0, -5, 8, 1, -2, -7, 4, 0])


def spread(N, steps=20):
    """A cloud that has walked for a while without scans."""
    rng = np.random.default_rng(1)
    belief = start(GRAPH, N, rng, WALK)
    for _ in range(steps):
        belief = step(GRAPH, belief, None, POINTS, rng, walk=WALK).after
    return belief


def walkers(cloud):
    out = []
    for i in range(len(cloud.object)):
        w = Walker()
        w.object = GRAPH.object_ids[cloud.object[i]]
        w.offset, w.direction = float(cloud.offset_m[i]), int(cloud.direction[i])
        w.x, w.y, w.z = map(float, cloud.position_m[i])
        w.heading, w.speed = float(cloud.heading_rad[i]), float(cloud.speed_mps[i])
        w.stopped, w.wait = bool(cloud.stopped[i]), float(cloud.wait_s[i])
        doors = GRAPH.areas[w.object].accessor_nodes if w.object in GRAPH.areas else ()
        w.held = tuple(n for n, h in zip(doors, cloud.held[i], strict=False) if h)
        w.goal = None
        out.append(w)
    return out


def test_the_map_is_the_one_that_was_asked_for():
    assert len(GRAPH.links) == 60 and len(GRAPH.areas) == 3


def test_the_loop_does_the_same_step():
    """Both walk 1500 particles for 15 steps: shares on the objects differ by less than 5 sd, false alarm below 1e-4."""
    belief, rng, M = spread(1500, 0), np.random.default_rng(2), 1500
    cloud, loop = walkers(belief.cloud), Loop(GRAPH, POINTS, WALK, 3)
    number = {o: k for k, o in enumerate(GRAPH.object_ids)}
    for _ in range(15):
        belief = step(GRAPH, belief, None, POINTS, rng, walk=WALK).after
        for w in cloud:
            loop.move(w, 1.0)
    ours = np.bincount(belief.cloud.object, minlength=63)
    theirs = np.bincount([number[w.object] for w in cloud], minlength=63)
    assert (np.abs(ours - theirs) <= 5.0 * np.sqrt(2.0 * np.maximum(ours + theirs, 8) / 2.0)).all()
    mean = [np.mean([getattr(w, c) for w in cloud]) for c in "xyz"]
    sd = belief.cloud.position_m.std(axis=0) * np.sqrt(2.0 / M)
    assert (np.abs(belief.cloud.position_m.mean(axis=0) - mean) <= 4.5 * sd).all()
    still = walkers(belief.cloud)
    want = POINTS.log_likelihood(Y, belief.cloud.position_m, belief.cloud.floor)
    np.testing.assert_allclose([loop.log_likelihood(w, Y) for w in still[:200]], want[:200], rtol=1e-9)


@pytest.mark.bench
def test_step():
    belief, rng = spread(N), np.random.default_rng(2)
    loop, some = Loop(GRAPH, POINTS, WALK, 3), walkers(belief.cloud)[::PART]

    def ours():
        return step(GRAPH, belief, Y, POINTS, rng, walk=WALK, threshold=1.0)

    def noise():
        return rng.standard_normal((N, 4))

    def one_by_one():
        return loop.step(some, Y, 1.0)

    what = "graph filter step, N = 10,000, 60 links, 3 areas, 8 access points"
    t = medians(5, batch=5, ours=ours, noise=noise)
    at_most(f"{what}: against 4 N normals", t["ours"], t["noise"], 12)
    at_most(f"{what}: against 5 ms", t["ours"], 5.0, 1)
    t = medians(3, ours=ours, loop=one_by_one)
    faster(f"{what}: against a loop over particles", t["ours"], PART * t["loop"], 25)


@pytest.mark.bench
def test_step_in_the_building_of_the_lessons():
    """A cloud that follows a walker, with a scan of all access points that are heard."""
    from lessons.indoor._building import building

    house, rng = building(), np.random.default_rng(2)
    points = house.transmitters["wlan"]
    scans = simulate_scans(walk_route(house.graph, house.routes["corridors"]), points, rng)
    belief = start(house.graph, N, rng, WALK)
    for y in scans[:20]:
        belief = step(house.graph, belief, y, points, rng, walk=WALK).after

    def ours():
        return step(house.graph, belief, scans[20], points, rng, walk=WALK, threshold=1.0)

    what = f"graph filter step in the lessons' building, N = 10,000, {int((~np.isnan(scans[20])).sum())} heard"
    t = medians(5, batch=5, ours=ours, noise=lambda: rng.standard_normal((N, 4)))
    at_most(f"{what}: against 4 N normals", t["ours"], t["noise"], 12)
    at_most(f"{what}: against 5 ms", t["ours"], 5.0, 1)
