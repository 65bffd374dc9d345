"""p(o) = T(o | n) / sum T(o' | n),  T = min(TLL, l_max): where a walker goes on at a node.  GBPF 4.4.1, 5.1."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.indoor import (
    FloorGraph,
    Walk,
    advance,
    choice_probabilities,
    hall_map,
    objects_behind,
    place,
    room_corridor,
    total_link_length,
    tree_map,
)
from core.types import Array
from lessons.indoor._building import MAP, Building, building
from lessons.indoor._link_choice_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Names, choice, datafile, names, seed, slider, switch

STEPS, STEP_S = 40, 6                   # of the walkers; each step in moves of one second
RULES = ("tll", "equal")
CAPS = np.geomspace(10.0, 1000.0, 50)   # l_max in the plot, metres
SPREAD = 0.25                           # of the speeds, to each side
DRAWN = 400                             # walkers that are drawn, those of one rule
SMALL = {"corridor": (room_corridor, "c1", "s1"), "tree": (tree_map, "n3", "b"), "hall": (hall_map, "n4", "g")}
HOUSE = ("0S5", "0corrS5")


@dataclass(frozen=True, slots=True)
class Params:
    """The map, the node and the way to it, and the rule of the choice."""

    world: str = choice("corridor", ("corridor", "tree", "hall", "house"))
    map: str = datafile(MAP)
    rule: str = choice("tll", RULES)
    node: Names = names((), limit=1, group="choice")
    arrival: Names = names((), limit=1, group="choice")
    cap: bool = switch(True, group="choice")
    l_max_m: float = slider(100.0, low=10.0, high=1000.0, unit="m", log=True, group="choice")
    u_turn: float = slider(0.0, low=0.0, high=0.2, step=0.01, group="choice")
    walkers: int = slider(1000, low=100, high=5000, log=True, group="walkers")
    speed_mps: float = slider(1.2, low=0.4, high=2.0, step=0.1, unit="m/s", group="walkers")
    seed: int = seed(1, group="walkers")


class Result(NamedTuple):
    """The map; the choice at the node; and walkers that come out of it, for both rules.

    behind: choice -> the objects behind it; tll, capped in metres; probability: rule -> choice -> p; by_cap (CAPS,
    choices).  positions: rule -> (STEPS + 1, DRAWN, 3); shares: rule -> (STEPS + 1, 3) of the time since the start on
    dead ends, on other links, in areas; time_on: rule -> (STEPS + 1, objects) shares of that time.
    """

    building: Building | None
    graph: FloorGraph
    node: str
    arrival: str
    note: str
    behind: Mapping[str, tuple[str, ...]]
    tll: Mapping[str, float]
    capped: Mapping[str, float]
    probability: Mapping[str, Mapping[str, float]]
    by_cap: Array
    positions: Mapping[str, Array]
    shares: Mapping[str, Array]
    time_on: Mapping[str, Array]


def compute(p: Params, progress: Progress) -> Result:
    """The law of the choice, and the walk of many who make it again and again."""
    b = building(p.map) if p.world == "house" else None
    g = b.graph if b is not None else SMALL[p.world][0]()
    node, arrival, note = _where(g, p)
    l_max = p.l_max_m if p.cap else None
    probability = {rule: choice_probabilities(g, node, arrival, l_max, rule=rule, u_turn=p.u_turn) for rule in RULES}
    choices = list(probability["tll"])
    tll = {o: total_link_length(g, o, node) for o in choices}
    by_cap = np.array([[choice_probabilities(g, node, arrival, float(c), u_turn=p.u_turn)[o] for o in choices]
                       for c in CAPS])
    positions, shares, time_on = {}, {}, {}
    for k, rule in enumerate(RULES):
        walk = Walk(rule=rule, l_max_m=l_max, u_turn=p.u_turn, turn_rate_hz=0.0, stop_rate_hz=0.0, sigma_v_mps=0.0,
                    v_max_mps=2.5)
        positions[rule], time_on[rule] = _walked(g, node, arrival, p, walk,
                                                 lambda share, k=k: progress((k + share) / len(RULES)))
        shares[rule] = np.column_stack([time_on[rule][:, kind].sum(axis=1) for kind in _kinds(g)])
    return Result(b, g, node, arrival, note, {o: objects_behind(g, o, node) for o in choices}, tll,
                  {o: min(v, l_max or np.inf) for o, v in tll.items()}, probability, by_cap, positions, shares, time_on)


def _where(g: FloorGraph, p: Params) -> tuple[str, str, str]:
    """The node and the object through which one came; what the map does not have is replaced, and said."""
    node, arrival = HOUSE if p.world == "house" else SMALL[p.world][1:]
    if node not in g.nodes:
        node = max(g.nodes, key=lambda n: len(g.objects_at(n)))
    note = ""
    if p.node and p.node[0] in g.nodes:
        node = p.node[0]
    elif p.node:
        note = f"This map has no node {p.node[0]}; {node} is shown."
    if arrival not in g.objects_at(node):
        arrival = g.objects_at(node)[0]
    if p.arrival and p.arrival[0] in g.objects_at(node):
        arrival = p.arrival[0]
    elif p.arrival:
        note = note or f"{p.arrival[0]} does not lead to {node}; the walker comes through {arrival}."
    return node, arrival, note


def _kinds(g: FloorGraph) -> list[Array]:
    """Numbers of the objects that are dead ends, other links, areas."""
    ids = g.object_ids
    dead = [o in g.links and any(len(g.objects_at(n)) == 1 for n in g.nodes_of(o)) for o in ids]
    area = [o in g.areas for o in ids]
    return [np.flatnonzero(dead), np.flatnonzero(~np.array(dead) & ~np.array(area)), np.flatnonzero(area)]


def _walked(g: FloorGraph, node: str, arrival: str, p: Params, walk: Walk, progress: Progress) -> tuple[Array, Array]:
    """Walkers that arrive at the node now: where the drawn ones are, and the share of time spent on each object."""
    rng = np.random.default_rng(p.seed)
    speeds = p.speed_mps * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, p.walkers)
    if arrival in g.links:
        second = g.nodes_of(arrival)[1] == node
        cloud = place(g, arrival, p.walkers, offset_m=g.length(arrival) if second else 0.0,
                      direction=1 if second else -1, speed_mps=speeds)
    else:
        n = g.nodes[node]
        cloud = place(g, arrival, p.walkers, position_m=_inside(g, arrival, np.array([n.x_m, n.y_m])),
                      heading_rad=rng.uniform(-np.pi, np.pi, p.walkers), speed_mps=speeds)
    positions, time_on = [cloud.position_m[:DRAWN].copy()], np.zeros((STEPS + 1, len(g.object_ids)))
    time_on[0, cloud.object[0]] = 1.0
    spent = np.zeros(len(g.object_ids))
    for k in range(1, STEPS + 1):
        for _ in range(STEP_S):
            cloud = advance(g, cloud, 1.0, walk, rng).cloud
            spent += np.bincount(cloud.object, minlength=len(spent))
        positions.append(cloud.position_m[:DRAWN].copy())
        time_on[k] = spent / spent.sum()
        progress(k / STEPS)
    return np.array(positions), time_on


def _inside(g: FloorGraph, area: str, at: Array) -> Array:
    """A point of the area near a node on its border."""
    from core.indoor.geometry import contains

    polygon = g.areas[area].polygon
    middle = polygon.mean(axis=0)
    for share in np.linspace(0.0, 1.0, 41):
        for toward in (middle, *polygon):
            q = at + share * (toward - at)
            if contains(polygon, q) and share > 0.0:
                return q
    return middle


def timeline(p: Params) -> Timeline:
    """Time since the walkers came to the node; the law of the choice in three stages."""
    return Timeline(STEPS, ("behind", "cap", "choice"), start=6, scale=float(STEP_S), unit="s")


def unused(p: Params) -> Collection[str]:
    """A map file only in the house; the cap's length only when there is a cap; walkers of equal choice need neither."""
    return {*(() if p.world == "house" else ("map",)), *(() if p.cap else ("l_max_m",))}


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=1.5,
    refs=("GBPF 4.4.1", "GBPF 5.1", "GBPF (4.30)", "IPIN 2014"),
    presets={
        "a corridor with rooms": {},
        "the same, equal choice": {"rule": "equal"},
        "a tree": {"world": "tree"},
        "a cycle": {"world": "hall"},
        "from the hall": {"world": "hall", "node": ("n1",), "arrival": ("H",)},
        "our building": {"world": "house", "step": 20},
        "our building, equal choice": {"world": "house", "rule": "equal", "step": 20},
        "no cap at the entrance": {"world": "house", "node": ("0S8",), "arrival": ("0corrS8",), "cap": False,
                                   "step": 20},
    },
)
