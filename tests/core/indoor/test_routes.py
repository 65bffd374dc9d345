"""Ground truth: shortest ways, walks along them, and what is heard."""

import numpy as np
import pytest

from core.indoor import (
    AccessPoints,
    FloorGraph,
    Walk,
    office_building,
    project,
    random_stops,
    shortest_route,
    simulate_scans,
    walk_route,
)
from core.indoor.geometry import contains
from tests.core.indoor.maps import M0, M1

OFFICE = office_building()


def test_the_way_through_a_tree():
    legs = shortest_route(M0, "n1", "n7")
    assert [leg.object_id for leg in legs] == ["a", "b", "e", "f"]
    assert [leg.nodes for leg in legs] == [("n1", "n2"), ("n2", "n3"), ("n3", "n6"), ("n6", "n7")]
    assert sum(leg.length_m for leg in legs) == 50.0 and sum(leg.time_s for leg in legs) == pytest.approx(50 / 1.2)
    assert shortest_route(M0, "n1", "n1") == ()
    assert [leg.object_id for leg in shortest_route(M1, "n11", "n9")] == ["k", "H", "a", "b", "c", "i"]


def test_areas_are_crossed_round_their_corners():
    g = FloorGraph.from_dict({
        "nodes": {"p": [0.5, 4], "q": [4, 0.5], "r": [4, 9]}, "links": {"l": ["r", "p"]},
        "areas": {"L": ([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]], ["p", "q"])}})
    (leg,) = shortest_route(g, "p", "q")
    assert leg.points.tolist() == [[0.5, 4], [1, 1], [4, 0.5]]
    assert leg.length_m == pytest.approx(2 * np.hypot(0.5, 3))
    truth = walk_route(g, ["p", "q"], speed_mps=1.0, dt_s=0.25)
    assert contains(g.areas["L"].polygon, truth.position_m[:, :2]).all()


def test_a_walk_has_its_speed_its_rests_and_its_end():
    truth = walk_route(M0, ["n1", "n4", "n5"], speed_mps=1.5, pause_s=[4.0, 0.0], dt_s=0.5)
    step = np.sqrt(np.square(np.diff(truth.position_m, axis=0)).sum(axis=1)) / 0.5
    assert truth.length_m == 45 + 35 + 5
    assert truth.time_s[-1] == np.ceil((85 / 1.5 + 4.0) / 0.5) * 0.5
    resting = (truth.time_s[:-1] >= 30.0) & (truth.time_s[1:] <= 34.0)
    assert resting.sum() == 8 and (step[resting] == 0.0).all()
    straight = ~resting & (np.diff(truth.object) == 0) & (truth.time_s[1:] < truth.time_s[-1])
    assert step[straight][:-1] == pytest.approx(1.5) and step.max() <= 1.5 + 1e-9
    assert truth.position_m[-1, :2].tolist() == [10.0, 5.0]
    for k in range(0, len(truth.time_s), 7):
        assert project(M0, truth.position_m[k, :2], 0).distance_m < 1e-9
    longer = walk_route(M0, ["n1", "n2"], epochs=30)
    assert len(longer.time_s) == 30 and (longer.position_m[12:, :2] == [10.0, 0.0]).all()
    assert walk_route(M0, ["n3"], epochs=3).position_m[:, :2].tolist() == [[30.0, 0.0]] * 3


def test_a_walk_over_floors():
    w = Walk(lift_wait_s=10.0, lift_speed_mps=0.5)
    truth = walk_route(OFFICE, ["0w5", "1w5"], speed_mps=1.0, dt_s=1.0, walk=w)
    assert [leg.object_id for leg in truth.legs] == ["lift"] and truth.time_s[-1] == 18.0
    height = truth.position_m[:, 2]
    assert (height[:11] == 0.0).all() and height[14] == pytest.approx(2.0) and height[-1] == 4.0
    assert truth.floor[14] == 0 and truth.floor[15] == 1 and (truth.position_m[:, 0] == 30.0).all()
    slow = Walk(lift_wait_s=1000.0)
    by_stairs = walk_route(OFFICE, ["0w5", "1w5"], speed_mps=1.0, walk=slow)
    assert "stairs" in [leg.object_id for leg in by_stairs.legs]
    assert set(np.unique(by_stairs.floor)) == {0, 1} and by_stairs.position_m[-1].tolist() == [30.0, 0.0, 4.0]


def test_random_stops_are_rooms_and_never_twice_in_a_row():
    stops = random_stops(OFFICE, 200, np.random.default_rng(1))
    assert all(len(OFFICE.objects_at(n)) == 1 for n in stops)
    assert all(a != b for a, b in zip(stops[1:], stops[:-1], strict=True)) and len(set(stops)) > 20
    ring = FloorGraph.from_dict({"nodes": {"a": [0, 0], "b": [4, 0], "c": [0, 3]},
                                 "links": {"x": ["a", "b"], "y": ["b", "c"], "z": ["c", "a"]}})
    assert set(random_stops(ring, 30, np.random.default_rng(1))) == {"a", "b", "c"}


def test_scans_come_at_their_times_with_their_law():
    points = AccessPoints([[0, 6], [40, 0]], sigma_db=[3.0, 6.0], threshold_dbm=-200.0)
    truth = walk_route(M0, ["n1", "n4"], speed_mps=0.05, dt_s=1.0)
    y = simulate_scans(truth, points, np.random.default_rng(1))
    z = (y - points.expected(truth.position_m, truth.floor)) / points.sigma_db
    T = len(truth.time_s)                                 # 901 epochs; mean sd 0.033, sd of the sd 0.024; 4.5 sd each
    assert not np.isnan(y).any() and abs(z.mean(axis=0)).max() < 4.5 / np.sqrt(T)
    assert abs(z.std(axis=0) - 1.0).max() < 4.5 / np.sqrt(2 * T)
    rare = simulate_scans(truth, points, np.random.default_rng(1), interval_s=10.0)
    assert np.flatnonzero(~np.isnan(rare).all(axis=1)).tolist() == list(range(0, T, 10))
    odd = simulate_scans(truth, points, np.random.default_rng(1), interval_s=2.5)
    assert np.flatnonzero(~np.isnan(odd).all(axis=1))[:5].tolist() == [0, 3, 5, 8, 10]
    deaf = simulate_scans(truth, AccessPoints([[0, 6], [40, 0]], threshold_dbm=-70), np.random.default_rng(1))
    assert np.isnan(deaf).any() and np.nanmin(deaf) >= -70


def test_bad_walks():
    rng = np.random.default_rng(1)
    for bad in (dict(nodes=[]), dict(nodes=["zz"]), dict(nodes=["n1", "zz"]), dict(speed_mps=0.0), dict(dt_s=0.0),
                dict(pause_s=-1.0), dict(epochs=0), dict(dt_s=np.nan), dict(speed_mps=np.inf)):
        with pytest.raises(ValueError, match="expected"):
            walk_route(**{"graph": M0, "nodes": ["n1", "n2"], **bad})
    with pytest.raises(ValueError, match="interval_s"):
        simulate_scans(walk_route(M0, ["n1", "n2"]), AccessPoints([[0, 0]]), rng, interval_s=0.0)
    with pytest.raises(ValueError, match="count"):
        random_stops(M0, 0, rng)
