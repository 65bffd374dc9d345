"""Probability on a map of areas and lines: P = c_A P_A + c_L P_L, which no density in the plane can hold.  GBPF ch. 2.

P_A has a density with respect to area, P_L, mapped to the line by T (link -> interval), with respect to length.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.indoor.discs import disc_area_in_polygon, length_in_disc
from core.indoor.graph import FloorGraph, Id
from core.indoor.map_arrays import map_arrays, object_numbers
from core.indoor.triangles import sample_polygon
from core.types import Array


class MixedMeasure(NamedTuple):
    """P = c_A P_A + c_L P_L on a map: uniform within each object.

    areas {id: P_A(area)} and links {id: P_L(link)}, each of sum 1 (or empty with its c = 0).
    """

    c_A: float
    c_L: float
    areas: Mapping[Id, float]
    links: Mapping[Id, float]


class Probability(NamedTuple):
    """P = c_A P_area + c_L P_link of a set."""

    P_area: float
    P_link: float
    P: float


def mixed_measure(
    graph: FloorGraph, area_mass: float, areas: tuple[Id, ...] | None = None, links: tuple[Id, ...] | None = None
) -> MixedMeasure:
    """c_A = area_mass, c_L = 1 - area_mass; P_A uniform on the union of areas, P_L on that of links.

    areas and links: ids, None for all of the map.  P_A shares by m^2, P_L by metres.  ValueError for a mass outside
    [0, 1], or on something that is not there.  GBPF (2.9)-(2.12).
    """
    c = float(finite("area_mass", area_mass))
    areas = tuple(graph.areas) if areas is None else areas
    links = tuple(graph.links) if links is None else links
    if wrong := [o for o in areas if o not in graph.areas] + [o for o in links if o not in graph.links]:
        raise ValueError(f"areas, links: expected ids of the map's areas and links, got {wrong[0]!r}")
    if not 0.0 <= c <= 1.0 or (c > 0.0 and not areas) or (c < 1.0 and not links):
        raise ValueError(f"area_mass: expected a number in [0, 1], 0 without areas and 1 without links, got {c}")
    m2, m = {o: graph.areas[o].area_m2 for o in areas}, {o: graph.length(o) for o in links}
    return MixedMeasure(c, 1.0 - c, {o: v / sum(m2.values()) for o, v in m2.items()},
                        {o: v / sum(m.values()) for o, v in m.items()})


def disc_probability(
    graph: FloorGraph, measure: MixedMeasure, centre_m: ArrayLike, radius_m: float, floor: int = 0
) -> Probability:
    """P(D) = c_A sum P_A(a) |D n a| / |a| + c_L sum P_L(l) |D n l| / |l|  for a disc D on one floor, exactly.

    centre_m (2,).  Links between floors count by the part of their plan on this floor's half.  GBPF (2.15).
    """
    maps, number = map_arrays(graph), object_numbers(graph)
    c = finite("centre_m", centre_m, 2)
    P_area = sum(p * disc_area_in_polygon(graph.areas[o].polygon, c, radius_m) / graph.areas[o].area_m2
                 for o, p in measure.areas.items() if graph.areas[o].floor == floor)
    P_link = 0.0
    for o, p in measure.links.items():
        k = number[o]
        a, b = maps.floors[k]
        start, end = maps.origin[k], maps.origin[k] + maps.length[k] * maps.unit[k]
        middle = 0.5 * (start + end)
        for s, e in [part for f, part in ((a, (start, middle)), (b, (middle, end))) if f == floor]:
            plan = float(np.sqrt(np.square(e[:2] - s[:2]).sum()))
            if plan > 0.0:
                share = float(length_in_disc(s[:2], e[:2], c, radius_m)) / plan
            else:                                         # a lift is a point in the plan
                share = float(np.square(s[:2] - c).sum() <= radius_m**2)
            P_link += p * share * float(np.sqrt(np.square(e - s).sum())) / maps.length[k]
    return Probability(float(P_area), P_link, float(measure.c_A * P_area + measure.c_L * P_link))


def straighten(graph: FloorGraph, links: tuple[Id, ...]) -> Array:
    """T(offset) = t_1 + (t_2 - t_1) offset / length: the points of a chain of links -> [0, sum of lengths].

    links l_1 .. l_K, each beginning where the one before ends -> (K, 2): t_1 and t_2, the distances along the chain of
    each link's own first and second node.  mu T^-1 is then an ordinary measure on the line.  ValueError for links that
    do not join up.  GBPF Def 2.11, Thm 2.12.

    >>> from core.indoor.examples import tree_map
    >>> straighten(tree_map(), ("c", "b", "a")).tolist()
    [[15.0, 0.0], [35.0, 15.0], [45.0, 35.0]]
    """
    if not links:
        raise ValueError("links: expected at least one link, got none")
    if wrong := [o for o in links if o not in graph.links]:
        raise ValueError(f"links: expected ids of links, got {wrong[0]!r}")
    at, rows, t = graph.nodes_of(links[0])[0], [], 0.0
    if len(links) > 1 and at in graph.nodes_of(links[1]):
        at = graph.nodes_of(links[0])[1]                  # the first link is walked backwards
    for k, o in enumerate(links):
        a, b = graph.nodes_of(o)
        if at not in (a, b):
            raise ValueError(f"links: expected {o!r} to begin where {links[k - 1]!r} ends, at node {at!r}")
        far = t + graph.length(o)
        rows.append((t, far) if at == a else (far, t))
        at, t = b if at == a else a, far
    return np.array(rows)


def sample_measure(graph: FloorGraph, measure: MixedMeasure, N: int, rng: "np.random.Generator") -> tuple[Array, Array]:
    """N darts: with probability c_A uniform in an area, else uniform on a link.

    -> positions (N, 2) in metres, and the numbers (N,) of their objects in `FloorGraph.object_ids`.
    """
    number, maps = object_numbers(graph), map_arrays(graph)
    ids = [*measure.areas, *measure.links]
    p = [measure.c_A * v for v in measure.areas.values()] + [measure.c_L * v for v in measure.links.values()]
    objects = np.array([number[o] for o in ids])[rng.choice(len(ids), size=N, p=np.array(p) / sum(p))]
    xy = np.empty((N, 2))
    for o in ids:
        here = np.flatnonzero(objects == number[o])
        if o in graph.areas:
            xy[here] = sample_polygon(graph.areas[o].polygon, here.size, rng)
        else:
            k = number[o]
            t = maps.length[k] * rng.random(here.size)
            xy[here] = maps.origin[k, :2] + t[:, None] * maps.unit[k, :2]
    return xy, objects
