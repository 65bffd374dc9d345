"""Shortest ways through the map, across areas too, and walks along them as ground truth.  GBPF 6.1 (ours)."""

import heapq
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from core.checks import finite
from core.indoor.cloud import Numbers, locate
from core.indoor.graph import FloorGraph, Id
from core.indoor.map_arrays import MapArrays, map_arrays, object_numbers
from core.indoor.visibility import shortest_path
from core.indoor.walk import Walk
from core.types import Array


class Leg(NamedTuple):
    """One object on the way: from node to node along points (K, 2) in its plane, length_m in all, taking time_s."""

    object_id: Id
    nodes: tuple[Id, Id]
    points: Array
    length_m: float
    time_s: float


class Truth(NamedTuple):
    """A walker at T epochs: time_s (T,), position_m (T, 3), floor (T,), object (T,) its number in the graph.

    legs: the way; length_m: metres walked in all.
    """

    time_s: Array
    position_m: Array
    floor: Numbers
    object: Numbers
    legs: tuple[Leg, ...]
    length_m: float


def shortest_route(
    graph: FloorGraph, start: Id, goal: Id, *, speed_mps: float = 1.2, walk: Walk | None = None
) -> tuple[Leg, ...]:
    """The way of least time from node to node (Dijkstra); on one floor that is the shortest way.

    Areas are crossed from accessor node to accessor node round their corners.  Stairs are slower, a lift takes its mean
    waiting time and its ride.  () if start = goal.  ValueError for unknown nodes.
    """
    graph.objects_at(start), graph.objects_at(goal)
    if not float(finite("speed_mps", speed_mps)) > 0.0:
        raise ValueError(f"speed_mps: expected a positive number, got {speed_mps}")
    walk = walk or Walk()
    cost, how, done, tie = {start: 0.0}, {}, set(), 0
    queue: list[tuple[float, int, Id]] = [(0.0, tie, start)]
    while queue:
        t, _, n = heapq.heappop(queue)
        if n in done:
            continue
        done.add(n)
        if n == goal:
            break
        for o in graph.objects_at(n):
            for m in graph.nodes_of(o):
                if m in done:
                    continue
                leg = _leg(graph, o, n, m, speed_mps, walk)
                if t + leg.time_s < cost.get(m, np.inf):
                    cost[m], how[m], tie = t + leg.time_s, leg, tie + 1
                    heapq.heappush(queue, (cost[m], tie, m))
    legs, n = [], goal
    while n != start:
        legs.append(how[n])
        n = legs[-1].nodes[0]
    return tuple(legs[::-1])


def walk_route(
    graph: FloorGraph,
    nodes: Sequence[Id],
    *,
    speed_mps: float = 1.2,
    pause_s: float | Sequence[float] = 0.0,
    dt_s: float = 1.0,
    epochs: int | None = None,
    walk: Walk | None = None,
) -> Truth:
    """A walk by shortest ways through the given nodes at constant speed, seen at t = 0, dt, 2 dt, ...

    pause_s: rest at each node after the first, a number or one for each.  epochs: how many, None for as many as reach
    the end; the walker then stays there.  ValueError for fewer than one node, unknown ones, or negative times.
    """
    nodes = list(nodes)
    if not nodes:
        raise ValueError("nodes: expected at least one node, got none")
    pauses = np.broadcast_to(finite("pause_s", pause_s), (len(nodes) - 1,)) if len(nodes) > 1 else np.zeros(0)
    if not float(finite("dt_s", dt_s)) > 0.0 or pauses.min(initial=0.0) < 0.0 or (epochs is not None and epochs < 1):
        raise ValueError(f"dt_s, pause_s, epochs: expected > 0, >= 0 and >= 1, got {dt_s}, {pause_s}, {epochs}")
    walk = walk or Walk()
    maps, number = map_arrays(graph), object_numbers(graph)
    routes = [shortest_route(graph, a, b, speed_mps=speed_mps, walk=walk)
              for a, b in pairwise(nodes)]
    frames = [_start(graph, nodes[0], routes, number)]
    for route, pause in zip(routes, pauses, strict=True):
        for leg in route:
            frames += _frames(graph, maps, number[leg.object_id], leg, frames[-1].time_s, walk)
        frames.append(frames[-1]._replace(time_s=frames[-1].time_s + float(pause), begin=frames[-1].end))
    t, x, y, objects, begin, end = (np.array(column) for column in zip(*frames, strict=True))
    T = int(np.ceil(t[-1] / dt_s - 1e-9)) + 1 if epochs is None else epochs
    time = dt_s * np.arange(T)
    after = np.searchsorted(t, time, side="left").clip(max=len(t) - 1)
    before = np.maximum(after - 1, 0)
    share = np.clip((time - t[before]) / np.maximum(t[after] - t[before], 1e-12), 0.0, 1.0)
    o, offset = objects[after], begin[after] + share * (end[after] - begin[after])
    position = np.zeros((3, T)).T
    position[:, 0], position[:, 1] = (c[before] + share * (c[after] - c[before]) for c in (x, y))
    floor = locate(maps, o, offset, position)
    legs = tuple(leg for route in routes for leg in route)
    return Truth(time, position, floor, o, legs, float(sum(leg.length_m for leg in legs)))


def random_stops(graph: FloorGraph, count: int, rng: "np.random.Generator") -> list[Id]:
    """`count` nodes to visit, no two in a row the same: dead ends (rooms) if the map has two, else any nodes."""
    ends = [n for n in graph.nodes if len(graph.objects_at(n)) == 1]
    choices = ends if len(ends) >= 2 else list(graph.nodes)
    if len(choices) < 2 or count < 1:
        raise ValueError(f"expected a map of at least 2 nodes and a positive count, got {len(choices)} and {count}")
    stops = [int(rng.integers(len(choices)))]
    for _ in range(count - 1):
        stops.append((stops[-1] + 1 + int(rng.integers(len(choices) - 1))) % len(choices))
    return [choices[k] for k in stops]


def _leg(graph: FloorGraph, o: Id, n: Id, m: Id, speed: float, walk: Walk) -> Leg:
    if o in graph.links:
        link = graph.links[o]
        points = np.array([graph.nodes[n][:2], graph.nodes[m][:2]])
        time = {"corridor": link.length_m / speed, "stairs": link.length_m / (walk.stairs_factor * speed),
                "lift": walk.lift_wait_s + link.length_m / walk.lift_speed_mps}[link.kind]
        return Leg(o, (n, m), points, link.length_m, time)
    points = graph.cached(("way", o, n, m), lambda: _across(graph, o, n, m))
    length = float(np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)).sum())
    return Leg(o, (n, m), points, length, length / speed)


def _across(graph: FloorGraph, o: Id, n: Id, m: Id) -> Array:
    """Shortest way in an area between two of its accessor nodes, which may lie a little outside."""
    maps, k = map_arrays(graph), object_numbers(graph)[o] - len(graph.links)
    doors = graph.areas[o].accessor_nodes
    inner = shortest_path(graph.areas[o].polygon, *(maps.doors[k, doors.index(q)] for q in (n, m)))
    way = np.array([graph.nodes[n][:2], *inner, graph.nodes[m][:2]])
    moves = np.concatenate([[True], (np.diff(way, axis=0) != 0.0).any(axis=1)])
    return way[moves]


class _Frame(NamedTuple):
    """The end of a straight stretch on one object, where offsets run from begin to end (links only)."""

    time_s: float
    x_m: float
    y_m: float
    object: int
    begin: float
    end: float


def _start(graph: FloorGraph, node: Id, routes: Sequence[tuple[Leg, ...]], number: dict[Id, int]) -> _Frame:
    first = next((leg for route in routes for leg in route), None)
    o = first.object_id if first else graph.objects_at(node)[0]
    x, y, _ = graph.nodes[node]
    offset = graph.length(o) if o in graph.links and graph.links[o].nodes[1] == node else 0.0
    return _Frame(0.0, x, y, number[o], offset, offset)


def _frames(graph: FloorGraph, maps: MapArrays, o: int, leg: Leg, t: float, walk: Walk) -> list[_Frame]:
    """The stretches of a leg that begins at time t."""
    if o < maps.n_links:
        forward = graph.links[leg.object_id].nodes[0] == leg.nodes[0]
        begin, end = (0.0, leg.length_m) if forward else (leg.length_m, 0.0)
        waiting = [_Frame(t + walk.lift_wait_s, *leg.points[0], o, begin, begin)] if maps.lifts[o] else []
        return [*waiting, _Frame(t + leg.time_s, *leg.points[1], o, begin, end)]
    pieces = np.sqrt(np.square(np.diff(leg.points, axis=0)).sum(axis=1))
    times = t + leg.time_s * np.cumsum(pieces) / leg.length_m
    return [_Frame(float(s), *p, o, 0.0, 0.0) for s, p in zip(times, leg.points[1:], strict=True)]
