"""The walk: oracle G-07, G-09, G-24, and that nobody gets lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.indoor import FloorGraph, Walk, advance, directions, office_building, place, scatter, time_shares
from core.indoor.area_motion import MOST_REFLECTIONS, reflect
from core.indoor.clearance import clearance
from core.indoor.cloud import gather, put
from core.indoor.geometry import contains, nearest_on_border
from core.indoor.map_arrays import map_arrays
from core.indoor.triangles import sample_polygon
from core.indoor.walk import clamped_speed
from tests.core.indoor.maps import M0, M1, random_map
from tests.core.indoor.test_geometry import COMB, star
from tests.oracle import entry

STEADY = Walk(sigma_v_mps=0.0, turn_rate_hz=0.0, stop_rate_hz=0.0, l_max_m=None, sigma_heading_rad=0.0, v_max_mps=9.0)
OFFICE = office_building()


def on_map(graph, cloud):
    """Asserts that every particle is where it says it is."""
    ids, L = graph.object_ids, len(graph.links)
    length = np.array([graph.length(o) for o in ids])
    link = cloud.object < L
    assert (cloud.offset_m >= 0.0).all() and (cloud.offset_m <= length[cloud.object]).all()
    assert (np.abs(cloud.direction[link]) == 1.0).all() and (cloud.offset_m[~link] == 0.0).all()
    maps = map_arrays(graph)
    at = maps.origin[cloud.object] + cloud.offset_m[:, None] * maps.unit[cloud.object]
    np.testing.assert_allclose(cloud.position_m[link], at[link], atol=1e-9)
    for k, area in enumerate(graph.areas.values(), L):
        x = cloud.position_m[cloud.object == k]
        assert contains(area.polygon, x[:, :2]).all()
        assert (x[:, 2] == graph.floor_height_m * area.floor).all()
    low, high = np.sort(maps.floors, axis=1).T
    assert ((cloud.floor == low[cloud.object]) | (cloud.floor == high[cloud.object])).all()
    assert (np.abs(cloud.position_m[:, 2] / graph.floor_height_m - cloud.floor) <= 0.5 + 1e-12).all()


def test_overflow_at_a_node():                                                           # oracle G-07
    e = entry("G-07")
    i = e["inputs"]
    cloud = place(M0, i["link"], 2000, offset_m=i["l"], speed_mps=i["v"])
    moved, choices = advance(M0, cloud, i["dt"], STEADY, np.random.default_rng(1))
    ids = np.array(M0.object_ids)
    seen = set()
    for want in e["expected"]["result"]:
        took = ids[moved.object] == want["link"]
        seen.add(want["link"])
        np.testing.assert_allclose(moved.offset_m[took], want["l"], atol=1e-12)
        np.testing.assert_allclose(moved.position_m[took, :2], np.tile(want["xy"], (took.sum(), 1)), atol=1e-12)
        assert (moved.direction[took] == 1.0).all()
    assert set(ids[moved.object]) == seen
    # Shares 3/7 and 4/7 with sd 0.011; 4 sd: false alarm 6e-5.
    assert (ids[moved.object] == "c").mean() == pytest.approx(3 / 7, abs=0.045)
    assert (choices.particle == np.arange(2000)).all() and (ids[choices.arrival] == "b").all()
    assert (np.array(list(M0.nodes))[choices.node] == "n3").all() and (choices.next == moved.object).all()


def test_the_speed_is_clamped():                                                         # oracle G-07
    speed = clamped_speed(1.5, [2.0, -6.0], 1.0, Walk(sigma_v_mps=0.3))
    assert speed.tolist() == entry("G-07")["expected"]["speed"]


def test_reflection_at_a_wall():                                                         # oracle G-09
    e = entry("G-09")
    i = e["inputs"]
    out = reflect(i["area"], [i["p"]], np.radians(i["alpha_deg"]), i["v"] * i["dt"], np.random.default_rng())
    assert out.position[0] == pytest.approx(e["expected"]["p"], abs=1e-9)
    assert np.degrees(out.heading_rad) == pytest.approx(e["expected"]["alpha_deg"], abs=1e-9)
    assert out.reflections.tolist() == [1]
    cloud = place(M1, "H", position_m=i["p"], heading_rad=np.radians(i["alpha_deg"]), speed_mps=i["v"])
    moved = advance(M1, cloud, i["dt"], STEADY, np.random.default_rng()).cloud
    assert moved.position_m[0, :2] == pytest.approx(e["expected"]["p"], abs=1e-9)
    assert np.degrees(moved.heading_rad[0]) == pytest.approx(-60.0)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6))
def test_reflection_keeps_the_length_and_stays_inside(seed):
    P, rng = star(seed), np.random.default_rng(seed)
    x = sample_polygon(P, 200, rng)
    out = reflect(P, x, rng.uniform(-9, 9, 200), rng.uniform(0, 4, 200), rng)
    assert contains(P, out.position).all() and out.reflections.max() <= MOST_REFLECTIONS
    # A path that is walked back ends where it began.
    s = rng.uniform(0, 4, 200)
    there = reflect(P, x, np.zeros(200), s, rng)
    back = reflect(P, there.position, there.heading_rad + np.pi, s, rng)
    some = (there.reflections < MOST_REFLECTIONS) & (back.reflections == there.reflections)
    assert some.mean() > 0.95
    np.testing.assert_allclose(back.position[some], x[some], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("dt", [0.3, 1.0, 10.0])
@pytest.mark.parametrize("graph", [M0, M1, OFFICE, random_map(5, 14, 6, 3)], ids=["M0", "M1", "office", "random"])
def test_everybody_stays_on_the_map(graph, dt, seed):
    rng = np.random.default_rng(seed)
    cloud = scatter(graph, 400, rng)
    on_map(graph, cloud)
    for _ in range(12):
        before = [a.copy() for a in cloud]
        moved = advance(graph, cloud, dt, Walk(), rng).cloud
        assert all((a == b).all() for a, b in zip(cloud, before, strict=True))     # the input is left alone
        on_map(graph, moved)
        cloud = moved


@pytest.mark.parametrize("P", [COMB, star(1), star(2), star(3, 30)], ids=["comb", "star", "star2", "star30"])
def test_nobody_leaks_through_a_wall(P):
    g = FloorGraph.from_dict({"areas": {"A": (P, ())}})
    rng = np.random.default_rng(1)
    cloud = scatter(g, 3000, rng)
    for dt in (1.0, 1.0, 1.0, 5.0, 20.0):
        cloud = advance(g, cloud, dt, Walk(sigma_heading_rad=1.0), rng).cloud
        on_map(g, cloud)


def test_walls_are_not_crossed_on_the_way():
    """Between two steps of 0.1 s nobody walks straight through a wall of the comb."""
    g = FloorGraph.from_dict({"areas": {"A": (COMB, ())}})
    rng = np.random.default_rng(2)
    cloud = scatter(g, 2000, rng)
    for _ in range(50):
        new = advance(g, cloud, 0.1, Walk(), rng).cloud
        for t in (0.25, 0.5, 0.75):
            x = (1 - t) * cloud.position_m[:, :2] + t * new.position_m[:, :2]
            outside = ~contains(COMB, x)
            assert nearest_on_border(COMB, x[outside]).distance.max(initial=0.0) < 0.2   # chords of reflections
        cloud = new


def test_nothing_is_lost_at_nodes():
    """A ring of links: whoever cannot choose walks exactly v dt along it."""
    corners = [(0, 0), (7, 0), (9, 3), (5, 6), (0, 4)]
    g = FloorGraph.from_dict({"nodes": {f"n{k}": c for k, c in enumerate(corners)},
                              "links": {f"l{k}": (f"n{k}", f"n{(k + 1) % 5}") for k in range(5)}})
    total = g.total_length_m
    start = np.cumsum([0.0, *(g.length(f"l{k}") for k in range(4))])
    rng = np.random.default_rng(3)
    cloud = scatter(g, 500, rng)
    at = start[cloud.object] + cloud.offset_m
    moved = advance(g, cloud, 100.0, STEADY, rng).cloud
    walked = np.mod(start[moved.object] + moved.offset_m - at - cloud.direction * cloud.speed_mps * 100.0, total)
    np.testing.assert_allclose(np.minimum(walked, total - walked), 0.0, atol=1e-9)
    assert (moved.direction == cloud.direction).all()


def test_nothing_is_lost_at_doors():
    """Through the hall's only open door, straight ahead: link, hall and link add up to v dt."""
    g = FloorGraph.from_dict({"nodes": {"w": [-10, 0], "a": [0, 0]}, "links": {"l": ["w", "a"]},
                              "areas": {"H": ([[0, -5], [20, -5], [20, 5], [0, 5]], ["a"])}})
    straight = Walk(sigma_v_mps=0, turn_rate_hz=0, stop_rate_hz=0, sigma_heading_rad=0, entry_sigma_rad=0)
    moved, choices = advance(g, place(g, "l", offset_m=8.0, speed_mps=1.5), 8.0, straight, np.random.default_rng(1))
    assert moved.position_m[0, :2] == pytest.approx([10.0, 0.0], abs=1e-12) and moved.held[0].all()
    assert g.object_ids[moved.object[0]] == "H" and len(choices.particle) == 1
    back = place(g, "H", 4000, position_m=[4.0, 0.0], heading_rad=np.pi, speed_mps=1.0)
    there = advance(g, back, 9.0, straight, np.random.default_rng(2))
    left = there.cloud.object == 0
    # TLL 10 of the link, 80 of the hall: 1/9 leave, with sd 0.005; 4 sd: false alarm 6e-5.
    assert left.mean() == pytest.approx(10 / 90, abs=0.02)
    np.testing.assert_allclose(there.cloud.offset_m[left], 10.0 - (9.0 - 4.0), atol=1e-12)
    assert (there.cloud.direction[left] == -1.0).all()
    assert (there.choices.arrival == 1).all()
    free = advance(g, there.cloud, 0.1, straight, np.random.default_rng(3)).cloud
    assert there.cloud.held[~left].all() and not free.held.any()      # 5 m beyond the door: free to decide again


def test_a_decision_to_leave_is_carried_out_over_several_steps():
    g = FloorGraph.from_dict({"nodes": {"w": [-10, 0], "a": [0, 0]}, "links": {"l": ["w", "a"]},
                              "areas": {"H": ([[0, -5], [20, -5], [20, 5], [0, 5]], ["a"])}})
    straight = Walk(sigma_v_mps=0, turn_rate_hz=0, stop_rate_hz=0, sigma_heading_rad=0)
    cloud = place(g, "H", 300, position_m=[3.0, 0.7], heading_rad=np.pi, speed_mps=1.0)
    rng = np.random.default_rng(1)
    moved = advance(g, cloud, 2.0, straight, rng).cloud
    decided = moved.goal >= 0
    assert 0 < decided.sum() < 300
    entry_x = 3.0 - (3.0 - np.sqrt(1.5**2 - 0.7**2))      # where y = 0.7 enters the circle about the door
    way = np.hypot(entry_x, 0.7)
    later = advance(g, moved, 2.0, straight, rng).cloud
    assert (later.object[decided] == 0).all()
    np.testing.assert_allclose(later.offset_m[decided], 10 - (4.0 - (3.0 - entry_x) - way), atol=1e-9)


def test_a_door_behind_a_wall_is_not_taken():
    """A door 1 m away on the other side of a thin wall: only whoever sees it may decide."""
    P = [[0, 0], [10, 0], [10, 0.4], [4, 0.4], [4, 0.6], [10, 0.6], [10, 1], [0, 1]]
    g = FloorGraph.from_dict({"nodes": {"a": [9, 1], "b": [9, 5]}, "links": {"l": ["a", "b"]},
                              "areas": {"H": (P, ["a"])}})
    quiet = Walk(sigma_v_mps=0, turn_rate_hz=0, stop_rate_hz=0, sigma_heading_rad=0)
    below = advance(g, place(g, "H", 200, position_m=[8, 0.2], speed_mps=0.5), 3.0, quiet, np.random.default_rng(1))
    above = advance(g, place(g, "H", 200, position_m=[8, 0.8], speed_mps=0.5), 3.0, quiet, np.random.default_rng(1))
    assert len(below.choices.particle) == 0 and len(above.choices.particle) == 200


def test_stairs_are_slow_and_lifts_make_wait():
    g = FloorGraph.from_dict({"nodes": {"a": [0, 0, 0], "b": [3, 0, 1], "c": [9, 0, 1], "d": [9, 0, 0]},
                              "links": {"s": ["a", "b"], "m": ["b", "c"], "up": ["c", "d"]}})
    w = Walk(sigma_v_mps=0, turn_rate_hz=0, stop_rate_hz=0)
    on_stairs = advance(g, place(g, "s", speed_mps=1.0), 4.0, w, np.random.default_rng(1)).cloud
    assert on_stairs.offset_m[0] == pytest.approx(2.4) and on_stairs.floor[0] == 0
    assert on_stairs.position_m[0] == pytest.approx([2.4 * 0.6, 0.0, 2.4 * 0.8])
    further = advance(g, on_stairs, 1.0, w, np.random.default_rng(1)).cloud
    assert further.offset_m[0] == pytest.approx(3.0) and further.floor[0] == 1
    cloud = place(g, "m", 4000, offset_m=6.0, speed_mps=1.0)
    rng = np.random.default_rng(2)
    inside = advance(g, cloud, 1.0, w, rng).cloud
    assert (inside.object == 2).all() and (inside.wait_s > 0.0).mean() > 0.9
    # Exponential with mean 15 s, of which 1 s has passed: the mean of 4000 has sd 0.24; 4 sd: false alarm 6e-5.
    assert (inside.wait_s + 1.0)[inside.wait_s > 0].mean() == pytest.approx(15.0 + 1.0, abs=1.0)
    riding = inside.wait_s == 0.0
    assert (inside.offset_m[~riding] == 0.0).all() and (inside.offset_m[riding] <= 1.0).all()
    stood = advance(g, gather(inside, np.flatnonzero(riding)), 1.0, Walk(stop_rate_hz=1e9), rng).cloud
    assert (stood.offset_m > inside.offset_m[riding]).all()           # the lift carries those who stand


def test_long_run_shares():                                                              # oracle G-24
    e = entry("G-24")
    shares = time_shares(M0)
    assert shares == pytest.approx(e["expected"]["share"], abs=1e-9)
    # 100 particles over 1000 m each are 10^5 m.  The oracle's tolerance is some 4 sd of the largest share.
    rng = np.random.default_rng(24)
    cloud = place(M0, "b", 100, offset_m=10.0, speed_mps=1.0)
    time = np.zeros(6)
    for k in range(1000):
        cloud = advance(M0, cloud, 1.0, STEADY, rng).cloud
        if k >= 100:
            time += np.bincount(cloud.object, minlength=6)
    np.testing.assert_allclose(time / time.sum(), [shares[o] for o in M0.object_ids], atol=0.02)


def test_stops_and_turns_have_their_rates():
    # Chances 1 - exp(-0.1) = 0.095 with sd 0.002 for N = 20,000; 4.5 sd: false alarm 7e-6 each.
    g, rng, N = M0, np.random.default_rng(7), 20_000
    cloud = place(g, "b", N, offset_m=10.0, speed_mps=1.0)
    stopped = advance(g, cloud, 1.0, Walk(stop_rate_hz=0.1, turn_rate_hz=0.0, sigma_v_mps=0), rng).cloud
    assert stopped.stopped.mean() == pytest.approx(-np.expm1(-0.1), abs=0.0095)
    assert (stopped.speed_mps[stopped.stopped] == 0.0).all() and (stopped.offset_m[stopped.stopped] == 10.0).all()
    off = advance(g, stopped, 1.0, Walk(stop_rate_hz=0.0, go_rate_hz=0.1, sigma_v_mps=0), rng).cloud
    went = stopped.stopped & ~off.stopped
    assert went.sum() / stopped.stopped.sum() == pytest.approx(-np.expm1(-0.1), abs=0.032)
    assert (off.speed_mps[went] >= 0.4).all() and (off.speed_mps[went] <= 1.6).all()
    turned = advance(g, cloud, 1.0, Walk(stop_rate_hz=0.0, turn_rate_hz=0.1, sigma_v_mps=0), rng).cloud
    assert (turned.direction < 0).mean() == pytest.approx(-np.expm1(-0.1), abs=0.0095)
    assert turned.position_m[turned.direction < 0, 0] == pytest.approx(19.0)


def test_the_heading_walks_at_random():
    g = FloorGraph.from_dict({"areas": {"A": ([[-50, -50], [50, -50], [50, 50], [-50, 50]], ())}})
    w = Walk(sigma_heading_rad=0.3, stop_rate_hz=0)
    moved = advance(g, place(g, "A", 20_000, position_m=[0, 0]), 0.25, w, np.random.default_rng(1)).cloud
    assert moved.heading_rad.std() == pytest.approx(0.15, rel=0.025)  # relative sd 0.005; 5 sd


def test_scatter_is_uniform_over_the_length():
    rng = np.random.default_rng(11)
    cloud = scatter(OFFICE, 50_000, rng)
    on_map(OFFICE, cloud)
    length = np.array([OFFICE.length(o) for o in OFFICE.object_ids])
    expected = 50_000 * length / length.sum()
    chi2 = (np.square(np.bincount(cloud.object, minlength=63) - expected) / expected).sum()
    assert chi2 < 62 + 4.5 * np.sqrt(2 * 62)              # false alarm below 1e-4
    link = cloud.object < 60
    assert (cloud.offset_m / length[cloud.object])[link].mean() == pytest.approx(0.5, abs=0.012)
    assert cloud.direction[link].mean() == pytest.approx(0.0, abs=0.04)
    assert cloud.speed_mps.min() >= 0.4 and cloud.speed_mps.max() <= 1.6


def test_clearances_are_lower_bounds():
    clear, rng, maps = clearance(OFFICE), np.random.default_rng(1), map_arrays(OFFICE)
    for a, area in enumerate(OFFICE.areas.values()):
        x = sample_polygon(area.polygon, 3000, rng)
        walls = nearest_on_border(area.polygon, x).distance
        doors = np.sqrt(np.square(x[:, None] - maps.doors[a]).sum(axis=-1)).min(axis=1)
        for wall_m, door_m in ((0.5, 0.1), (2.0, 0.0), (0.0, 3.0)):
            by_wall, by_door = clear.near(
                np.full(3000, a), x[:, 0], x[:, 1], np.full(3000, wall_m), np.full(3000, door_m))
            assert by_wall[walls <= wall_m].all() and by_door[doors <= door_m].all()
            assert not by_wall[walls > wall_m + 0.75].any() and not by_door[doors > door_m + 0.75].any()


def test_directions_are_unit_vectors_that_agree_with_the_motion():
    rng = np.random.default_rng(2)
    cloud = place(M0, "f", 5, offset_m=[1, 2, 3, 4, 5.0], direction=-1, speed_mps=0.5)
    u = directions(M0, cloud)
    moved = advance(M0, cloud, 1.0, STEADY, rng).cloud
    np.testing.assert_allclose(moved.position_m[:, :2] - cloud.position_m[:, :2], 0.5 * u, atol=1e-12)
    assert directions(M1, place(M1, "H", position_m=[-5, 0], heading_rad=np.pi / 2))[0] == pytest.approx([0, 1])


def test_no_time_no_motion_and_the_same_seed_gives_the_same_walk():
    cloud = scatter(OFFICE, 300, np.random.default_rng(1))
    still = advance(OFFICE, cloud, 0.0, Walk(), np.random.default_rng(2))
    assert all((a == b).all() for a, b in zip(still.cloud, cloud, strict=True)) and not still.choices.particle.size
    a, b = (advance(OFFICE, cloud, 1.0, Walk(), np.random.default_rng(3)) for _ in range(2))
    assert all((p == q).all() for p, q in zip((*a.cloud, *a.choices), (*b.cloud, *b.choices), strict=True))


def test_gather_and_put():
    cloud = scatter(OFFICE, 50, np.random.default_rng(1))
    index = np.array([3, 3, 49, 0])
    some = gather(cloud, index)
    assert all((a == b[index]).all() for a, b in zip(some, cloud, strict=True))
    changed = put(cloud, np.array([1, 2, 5, 7]), some)
    assert all((a[[1, 2, 5, 7]] == b).all() for a, b in zip(changed, some, strict=True))
    assert all((a[8:] == b[8:]).all() for a, b in zip(changed, cloud, strict=True))


@pytest.mark.parametrize("bad", [
    dict(sigma_v_mps=-1), dict(v_min_mps=3.0), dict(stop_rate_hz=np.nan), dict(rule="x"), dict(l_max_m=0),
    dict(u_turn=1.0), dict(start_speeds_mps=(2, 1)), dict(capture_radius_m=0.0), dict(lift_speed_mps=0.0),
    dict(sigma_heading_rad=np.inf), dict(start_speeds_mps=(1, 2, 3)), dict(go_rate_hz="x"),
])
def test_bad_parameters_of_the_walk(bad):
    with pytest.raises(ValueError, match="expected"):
        Walk(**bad)


def test_bad_clouds():
    rng = np.random.default_rng(1)
    with pytest.raises(ValueError, match="offset_m"):
        place(M0, "b", offset_m=20.5)
    with pytest.raises(ValueError, match="direction"):
        place(M0, "b", direction=0.5)
    with pytest.raises(ValueError, match="speed_mps"):
        place(M0, "b", speed_mps=-1.0)
    with pytest.raises(ValueError, match="position_m"):
        place(M1, "H")
    with pytest.raises(ValueError, match="position_m"):
        place(M1, "H", position_m=[1.0, 0.0])
    with pytest.raises(ValueError, match="'zz'"):
        place(M0, "zz")
    with pytest.raises(ValueError, match="N:"):
        scatter(M0, 0, rng)
    with pytest.raises(ValueError, match="dt_s"):
        advance(M0, scatter(M0, 3, rng), -1.0, Walk(), rng)
    with pytest.raises(ValueError, match="cloud"):
        advance(M0, scatter(OFFICE, 300, rng), 1.0, Walk(), rng)
