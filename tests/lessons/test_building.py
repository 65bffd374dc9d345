"""The building of the indoor lessons: what the issue of the house asks for, and maps that users give."""

import json

import numpy as np
import pytest

from core.indoor import is_open_area
from core.indoor.geometry import contains
from lessons.indoor import _make_building as make_building
from lessons.indoor._building import MAP, building, parse
from lessons.kit import files

HOUSE = building()
G = HOUSE.graph
SMALL = {"nodes": {"a": [0, 0], "b": [10, 0], "c": [10, 8]}, "links": {"ab": ["a", "b"], "bc": ["b", "c"]}}


def text(**changes):
    return json.dumps({**SMALL, **changes}).encode()


def cross(u, v):
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def is_convex(polygon):
    d = np.roll(polygon, -1, axis=0) - polygon
    return (cross(d, np.roll(d, -1, axis=0)) > 0).all()


def test_the_file_is_what_its_script_writes():
    assert make_building.FILE.read_text(encoding="utf-8") == make_building.text()


def test_it_is_a_house_of_two_floors():
    assert G.floors == (0, 1) and len(G.links) >= 60 and len(G.areas) >= 5
    assert {link.kind for link in G.links.values()} == {"corridor", "stairs", "lift"}
    assert not all(is_convex(a.polygon) for a in G.areas.values())
    assert all(is_open_area(a.polygon) for a in G.areas.values())
    assert len(HOUSE.transmitters["wlan"]) == 25 and len(HOUSE.transmitters["ble"]) == 40
    rooms = [n for n in G.nodes if "room" in n]
    assert len(rooms) > 40 and all(len(G.objects_at(n)) == 1 for n in rooms)
    assert set(HOUSE.routes) == {"corridors", "hall", "outdoors", "floors"} and not HOUSE.placed


def test_corridors_make_a_loop():
    """Without any one of its corridor links every floor still hangs together."""
    import networkx as nx

    for f in G.floors:
        graph = nx.Graph(link.nodes for o, link in G.links.items() if o.startswith(f"{f}corr"))
        assert nx.is_biconnected(graph)


def test_no_wall_crosses_a_link():
    for f in G.floors:
        walls = HOUSE.walls[f]
        for link in G.links.values():
            a, b = (G.nodes[n] for n in link.nodes)
            if a.floor == b.floor == f:
                p, q = np.array(a[:2]), np.array(b[:2])
                s, t = walls[:, 0], walls[:, 1]
                side = cross(t - s, p - s) * cross(t - s, q - s)
                other = cross(q - p, s - p) * cross(q - p, t - p)
                assert not ((side < -1e-9) & (other < -1e-9)).any(), link


def test_the_yard_is_outdoors():
    walls = np.concatenate(list(HOUSE.walls.values())).reshape(-1, 2)
    assert not contains(G.areas["yard"].polygon, walls).any()


def test_a_small_map_gets_transmitters():
    b = parse(text())
    assert b.placed == ("wlan", "ble") and len(b.transmitters["wlan"]) == 25 and not b.routes
    assert b.walls[0].shape == (0, 2, 2)
    key = files.put("small.json", text(name="a hut"))
    assert building(key).name == "a hut" and MAP.recognise(text()) and not MAP.recognise(b"RINEX")


@pytest.mark.parametrize("content, says", [
    (b"{", "line 1: expected JSON"), (b"\xff{", "expected JSON in UTF-8"), (b"[1]", "expected a JSON object"),
    (b"{}", "expected at least one link or area"), (text(links={"ab": ["a", "z"]}), "'ab'.*'z'"),
    (text(links={"ab": ["a", "b"]}), "node 'c'"), (b'{"nodes": {}, "nodes": {}}', "twice"),
    (b"[" * 100_000, "expected"), (text(walls=[1]), "walls: expected"), (text(walls={"7": []}), "one of the floors 0"),
    (text(walls={"0": [[1, 2, 3]]}), "expected segments"), (text(wlan=[{"x": 1}]), "transmitter 1: expected id"),
    (text(wlan=[{"x": 1, "y": "no"}]), "expected finite numbers"), (text(ble=[{"x": 1, "y": 1, "floor": 3}]), "floors"),
    (text(ble=[{"x": 1, "y": 1, "sigma_db": 0}]), "sigma_db"), (text(routes={"r": ["a"]}), "at least two"),
    (text(routes={"r": ["a", "q"]}), "got 'q'"), (text(routes=[1]), "routes: expected"),
    (json.dumps({"nodes": {"a b": [0, 0], "b": [1, 0]}, "links": {"l": ["a b", "b"]}}).encode(), "letters, digits"),
    (json.dumps({"nodes": [{"id": 1, "x": 0, "y": 0}, {"id": 2, "x": 1, "y": 0}], "links": {"l": [1, 2]}}).encode(),
     "letters, digits"),
])
def test_a_bad_map_is_refused_in_words(content, says):
    with pytest.raises(ValueError, match=says):
        parse(content)


def test_any_cut_of_our_own_file_is_refused_in_words():
    whole = make_building.FILE.read_bytes()
    for end in range(1, len(whole) - 2, 1511):
        with pytest.raises(ValueError, match="expected"):
            parse(whole[:end])
