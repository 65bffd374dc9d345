import copy
import json
import pickle
from types import MappingProxyType

import numpy as np
import pytest

from core.indoor import FloorGraph, hall_map, office_building, room_corridor, tree_map
from tests.core.indoor.maps import M0, M1, random_map
from tests.oracle import entry

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


def line(**more):
    return {"nodes": {"a": [0, 0], "b": [10, 0]}, "links": {"l": ["a", "b"]}, **more}


def test_lengths_and_totals_of_the_oracle_maps():
    assert M0.total_length_m == pytest.approx(70.0, abs=1e-12)
    area = entry("G-02")["inputs"]["area"]
    assert M1.areas["H"].area_m2 == area["area_m2"]
    assert M1.length("H") == area["equivalent_length"]
    assert M1.total_length_m == pytest.approx(250.0, abs=1e-12)
    assert hall_map().total_length_m == pytest.approx(250.0) and tree_map().total_length_m == pytest.approx(70.0)


def test_a_link_is_as_long_as_its_nodes_are_apart():                                     # oracle G-23
    g = FloorGraph.from_dict({"nodes": {"a": [0, 0], "b": [15, 8]}, "links": {"l": ["a", "b"]}})
    assert g.length("l") == entry("G-23")["expected"]["link_length"]


def test_stairs_and_lifts_have_the_floor_height_in_their_length():
    g = FloorGraph.from_dict({
        "nodes": {"a": [0, 0, 0], "b": [3, 0, 1], "c": [3, 0, 3]}, "floor_height_m": 4,
        "links": {"s": ["a", "b"], "l": ["b", "c"], "t": {"nodes": ["a", "c"], "kind": "stairs"}}})
    assert g.length("s") == 5.0 and g.links["s"].kind == "stairs"
    assert g.length("l") == 8.0 and g.links["l"].kind == "lift"
    assert g.length("t") == pytest.approx(np.hypot(3, 12)) and g.floors == (0, 1, 3)


def test_the_orientation_of_a_polygon_does_not_matter_and_it_may_be_a_closed_ring():
    areas = [FloorGraph.from_dict({"areas": {"A": (P, ())}}).areas["A"] for P in
             (SQUARE, SQUARE[::-1], [*SQUARE, SQUARE[0]], np.array(SQUARE))]
    for a in areas:
        assert a.area_m2 == 16.0 and len(a.polygon) == 4 and a.length_m == 16 / 2.5


def test_records_in_lists_named_entries_and_other_widths():
    g = FloorGraph.from_dict({
        "name": "A wing", "corridor_width_m": 2.0,
        "nodes": [{"id": 1, "x": 0, "y": 0}, {"id": 2, "x": 4, "y": 0, "floor": 0}],
        "links": [{"id": "l", "nodes": [1, 2]}],
        "areas": [{"id": "A", "polygon": SQUARE, "accessor_nodes": [1]},
                  {"id": "B", "polygon": [[4, 0], [8, 0], [8, 4]], "accessor_nodes": [2], "corridor_width_m": 4.0},
                  {"id": "C", "polygon": [[4, 0], [8, 0], [8, -4]], "accessor_nodes": [2], "equivalent_length_m": 7}]})
    assert [g.length(o) for o in "lABC"] == [4.0, 8.0, 2.0, 7.0]
    assert g.objects_at(2) == ("l", "B", "C") and g.nodes_of("A") == (1,)


@pytest.mark.parametrize("g", [M0, M1, random_map(3), office_building(), room_corridor()], ids=str)
def test_to_dict_and_json_come_back(g, tmp_path):
    (tmp_path / "map.json").write_text(json.dumps(g.to_dict()), encoding="utf-8")
    h = FloorGraph.from_json(tmp_path / "map.json")
    assert g.nodes == h.nodes and g.links == h.links and list(g.areas) == list(h.areas)
    for o in g.object_ids:
        assert h.length(o) == g.length(o)


def test_copies_and_pickles():
    for h in (copy.deepcopy(M1), pickle.loads(pickle.dumps(M1))):
        assert h.nodes == M1.nodes and h.links == M1.links and h.objects_at("n1") == M1.objects_at("n1")
        assert h.length("H") == 128.0
    assert repr(M1) == "FloorGraph(11 nodes, 10 links, 1 areas)"


def test_a_graph_cannot_be_changed_and_leaves_its_source_alone():
    d = line(areas={"A": {"polygon": [[10, -2], [14, -2], [14, 2], [10, 2]][::-1], "accessor_nodes": ["b"]}})
    before = json.dumps(d)
    g = FloorGraph.from_dict(d)
    assert json.dumps(d) == before and isinstance(g.nodes, MappingProxyType)
    with pytest.raises(TypeError):
        g.links["l"] = None
    with pytest.raises(ValueError, match="read-only"):
        g.areas["A"].polygon[0] = 0.0
    with pytest.raises(AttributeError):
        g.corridor_width_m = 3.0


def test_unknown_ids_are_named():
    with pytest.raises(ValueError, match=r"node_id.*'zz'"):
        M0.objects_at("zz")
    with pytest.raises(ValueError, match=r"object_id.*'zz'"):
        M0.length("zz")
    with pytest.raises(ValueError, match="node_id"):
        M0.objects_at(["n1"])


WRONG = {
    "dangling node": (line(links={"l": ["a", "zz"]}), ["link 'l'", "'zz'"]),
    "zero length": ({"nodes": {"a": [1, 2], "b": [1, 2]}, "links": {"l": ["a", "b"]}},
                    ["link 'l'", "length", "one node"]),
    "loop": (line(links={"l": ["a", "a"]}), ["link 'l'", "two different nodes"]),
    "one node": (line(links={"l": ["a"]}), ["link 'l'", "two node ids"]),
    "not finite": ({"nodes": {"a": [0, float("nan")], "b": [1, 0]}, "links": {"l": ["a", "b"]}},
                   ["node 'a'", "finite"]),
    "infinite": ({"nodes": {"a": [0, float("inf")], "b": [1, 0]}, "links": {"l": ["a", "b"]}}, ["node 'a'", "finite"]),
    "text": ({"nodes": {"a": [0, "x"], "b": [1, 0]}, "links": {"l": ["a", "b"]}}, ["node 'a'", "numbers", "'x'"]),
    "truth": ({"nodes": {"a": [0, True], "b": [1, 0]}, "links": {"l": ["a", "b"]}}, ["node 'a'", "numbers"]),
    "four numbers": ({"nodes": {"a": [0, 0, 0, 0], "b": [1, 0]}, "links": {"l": ["a", "b"]}}, ["node 'a'", "(x, y"]),
    "half a floor": ({"nodes": {"a": [0, 0, 0.5], "b": [1, 0]}, "links": {"l": ["a", "b"]}}, ["node 'a'", "whole"]),
    "far away": ({"nodes": {"a": [0, 1e9], "b": [1, 0]}, "links": {"l": ["a", "b"]}}, ["node 'a'", "local origin"]),
    "kind": (line(links={"l": {"nodes": ["a", "b"], "kind": "slide"}}), ["link 'l'", "'slide'", "lift"]),
    "level lift": (line(links={"l": {"nodes": ["a", "b"], "kind": "lift"}}), ["link 'l'", "different floors"]),
    "steep corridor": ({"nodes": {"a": [0, 0, 0], "b": [5, 0, 1]}, "links": {"l": {"nodes": ["a", "b"],
                        "kind": "corridor"}}}, ["link 'l'", "stairs or lift"]),
    "crossing border": ({"areas": {"A": ([[0, 0], [4, 4], [4, 0], [0, 4]], ())}}, ["area 'A'", "cross", "corner 0"]),
    "touching border": ({"areas": {"A": ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], ())}}, ["area 'A'", "corner 2"]),
    "spike": ({"areas": {"A": ([[0, 0], [4, 0], [6, 0], [4, 0], [4, 4]], ())}}, ["area 'A'"]),
    "fold": ({"areas": {"A": ([[0, 0], [6, 0], [4, 0], [4, 4]], ())}}, ["area 'A'", "turns back", "corner 1"]),
    "twice a corner": ({"areas": {"A": ([[0, 0], [4, 0], [4, 0], [4, 4]], ())}}, ["area 'A'", "same point"]),
    "flat": ({"areas": {"A": ([[0, 0], [4, 0], [2, 0]], ())}}, ["area 'A'"]),
    "two corners": ({"areas": {"A": ([[0, 0], [4, 0]], ())}}, ["area 'A'", "3 corners"]),
    "corner of three": ({"areas": {"A": ([[0, 0, 0], [4, 0, 0], [4, 4, 0]], ())}}, ["area 'A'", "(x, y)"]),
    "corner nan": ({"areas": {"A": ([[0, 0], [4, 0], [float("nan"), 4]], ())}}, ["area 'A'", "finite"]),
    "door outside": (line(areas={"A": ([[11, 0], [15, 0], [15, 4]], ["b"])}), ["area 'A'", "'b'", "1 m outside"]),
    "door unknown": (line(areas={"A": (SQUARE, ["zz"])}), ["area 'A'", "'zz'"]),
    "door twice": (line(areas={"A": (SQUARE, ["a", "a"])}), ["area 'A'", "'a'", "twice"]),
    "door upstairs": ({"nodes": {"a": [0, 0], "b": [0, 4, 1]}, "links": {"l": ["a", "b"]},
                       "areas": {"A": (SQUARE, ["a", "b"])}}, ["area 'A'", "floor", "'b'"]),
    "no door": (line(areas={"A": (SQUARE, [])}), ["area 'A'", "accessor nodes"]),
    "two parts": ({"nodes": {"a": [0, 0], "b": [1, 0], "c": [5, 0], "d": [6, 0]},
                   "links": {"l": ["a", "b"], "m": ["c", "d"]}}, ["link 'm'", "a way to it"]),
    "lonely node": ({"nodes": {"a": [0, 0], "b": [1, 0], "c": [5, 0]}, "links": {"l": ["a", "b"]}}, ["node 'c'"]),
    "shared id": (line(areas={"l": (SQUARE, ["a"])}), ["area 'l'", "a link has it too"]),
    "listed twice": ({"nodes": [{"id": "a", "x": 0, "y": 0}, {"id": "a", "x": 1, "y": 0}]}, ["node 'a'", "twice"]),
    "no id": ({"nodes": [{"x": 0, "y": 0}]}, ["'nodes'", "'id'"]),
    "id": ({"nodes": {1.5: [0, 0]}, "links": {}}, ["1.5", "string or a whole number"]),
    "slip": (line(link={"l": ["a", "b"]}), ["'link'", "did you mean 'links'"]),
    "slip in an area": ({"areas": {"A": {"polygons": SQUARE}}}, ["area 'A'", "did you mean 'polygon'"]),
    "width": (line(corridor_width_m=0.0), ["corridor_width_m", "at least"]),
    "height": (line(floor_height_m=float("nan")), ["floor_height_m", "finite"]),
    "empty": ({}, ["at least one link or area"]),
    "not a dict": ([], ["expected a dict"]),
    "nodes": ({"nodes": 3}, ["'nodes'", "mapping"]),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_named(what):
    d, words = WRONG[what]
    with pytest.raises(ValueError) as e:
        FloorGraph.from_dict(d)
    for word in words:
        assert word in str(e.value)


def test_all_problems_are_listed_at_once():
    d = {"nodes": {"a": [0, 0], "b": [0, 0], "c": [float("nan"), 0]},
         "links": {"l": ["a", "b"], "m": ["a", "zz"], "n": ["a", "c"]}}
    with pytest.raises(ValueError, match="3 problems") as e:
        FloorGraph.from_dict(d)
    assert all(w in str(e.value) for w in ("'l'", "'m'", "node 'c'")) and "'n'" not in str(e.value)


def test_json_that_is_broken_or_names_things_twice(tmp_path):
    path = tmp_path / "map.json"
    path.write_text('{"nodes": {"a": [0, 0], "a": [1, 0]}}', encoding="utf-8")
    with pytest.raises(ValueError, match="'a' twice"):
        FloorGraph.from_json(path)
    path.write_text('{"nodes": ', encoding="utf-8")
    with pytest.raises(ValueError, match="JSON"):
        FloorGraph.from_json(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="JSON"):
        FloorGraph.from_json(path)
    path.write_text('{"nodes": {"a": [NaN, 0], "b": [1, 0]}, "links": {"l": ["a", "b"]}}', encoding="utf-8")
    with pytest.raises(ValueError, match="node 'a'"):
        FloorGraph.from_json(path)
    with pytest.raises(OSError):
        FloorGraph.from_json(tmp_path / "none.json")


def test_a_door_may_lie_a_little_outside_or_well_inside():
    for x in (-0.4, 0.0, 2.0):
        g = FloorGraph.from_dict({"nodes": {"a": [x, 2], "b": [-9, 2]}, "links": {"l": ["a", "b"]},
                                  "areas": {"A": (SQUARE, ["a"])}})
        assert g.objects_at("a") == ("l", "A")
