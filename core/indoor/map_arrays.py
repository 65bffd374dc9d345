"""The floor graph as arrays, for particles: objects and ports by number instead of by id."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.indoor.geometry import Border, border, nearest_in_polygon, nearest_on_border, together
from core.indoor.graph import FloorGraph, Id
from core.types import Array

_FAR = 1e9


class MapArrays(NamedTuple):
    """Objects 0..O-1: first the n_links links, then the areas, as `FloorGraph.object_ids`.

    length (O,) in metres; origin (O, 3) = first end of a link, or (0, 0, height) for an area; unit (O, 3) the direction
    of a link, zero for an area: the place of a particle on a link is origin + offset unit.  floors (O, 2) at both ends;
    stairs, lifts (O,) masks, uneven if the map has any.

    A port is an object at one of its nodes, named (object, node) in `ports`: where a particle leaves or enters the
    object.  The ports of link k are 2k (first end) and 2k + 1; those of area a begin at area_port[a].  port_object,
    port_end (the number of the end or accessor node), port_node (P,).

    Areas a = 0..A-1 with at most J accessor nodes: borders, of all areas `together`; doors (A, J, 2) = nearest points
    of the area to the accessor nodes (far away if a has fewer); inward (A, J) = direction into the area in radians, NaN
    for a door far from the border.  door (A, nodes) = number of the accessor node in the area, -1 if it is none of its
    own.
    """

    n_links: int
    length: Array
    origin: Array
    unit: Array
    floors: NDArray[np.intp]
    stairs: NDArray[np.bool_]
    lifts: NDArray[np.bool_]
    uneven: bool
    ports: tuple[tuple[Id, Id], ...]
    port_number: dict[tuple[Id, Id], int]
    port_object: NDArray[np.intp]
    port_end: NDArray[np.intp]
    port_node: NDArray[np.intp]
    area_port: NDArray[np.intp]
    borders: Border
    doors: Array
    inward: Array
    door: NDArray[np.intp]


def map_arrays(graph: FloorGraph) -> MapArrays:
    """The arrays of a graph, made once."""
    return graph.cached("arrays", lambda: _make(graph))


def object_numbers(graph: FloorGraph) -> dict[Id, int]:
    """{object id: its number}."""
    return graph.cached("numbers", lambda: {o: k for k, o in enumerate(graph.object_ids)})


def _make(graph: FloorGraph) -> MapArrays:
    objects, L, h = graph.object_ids, len(graph.links), graph.floor_height_m
    node = {n: k for k, n in enumerate(graph.nodes)}
    place = np.array([(x, y, h * f) for x, y, f in graph.nodes.values()]).reshape(-1, 3)
    floor = np.array([n.floor for n in graph.nodes.values()], np.intp)
    O = len(objects)
    origin, unit, floors = np.zeros((O, 3)), np.zeros((O, 3)), np.zeros((O, 2), np.intp)
    for k, link in enumerate(graph.links.values()):
        a, b = (node[n] for n in link.nodes)
        origin[k], unit[k], floors[k] = place[a], (place[b] - place[a]) / link.length_m, (floor[a], floor[b])
    for k, area in enumerate(graph.areas.values(), L):
        origin[k, 2], floors[k] = h * area.floor, area.floor
    kinds = np.array([link.kind for link in graph.links.values()] + [""] * len(graph.areas))
    ports = tuple((o, n) for o in objects for n in graph.nodes_of(o))
    ends = [(k, e, node[n]) for k, o in enumerate(objects) for e, n in enumerate(graph.nodes_of(o))]
    port_object, port_end, port_node = np.array(ends, np.intp).reshape(-1, 3).T.copy()
    counts = [len(a.accessor_nodes) for a in graph.areas.values()]
    A, J = len(counts), max(counts, default=0)
    doors, inward = np.full((A, J, 2), _FAR), np.full((A, J), np.nan)
    door = np.full((A, len(node)), -1, np.intp)
    for k, area in enumerate(graph.areas.values()):
        for j, n in enumerate(area.accessor_nodes):
            doors[k, j] = nearest_in_polygon(area.polygon, place[node[n], :2])
            inward[k, j] = _inward(area.polygon, doors[k, j])
            door[k, node[n]] = j
    return MapArrays(
        n_links=L, length=np.array([graph.length(o) for o in objects]), origin=origin, unit=unit, floors=floors,
        stairs=kinds == "stairs", lifts=kinds == "lift",
        uneven=bool(np.isin(kinds, ("stairs", "lift")).any()), ports=ports,
        port_number={port: k for k, port in enumerate(ports)}, port_object=port_object, port_end=port_end,
        port_node=port_node, area_port=2 * L + np.cumsum([0, *counts[:-1]], dtype=np.intp)[:A],
        borders=together([border(a.polygon) for a in graph.areas.values()]), doors=doors, inward=inward, door=door,
    )


def _inward(polygon: Array, p: Array) -> float:
    """Direction of the bisector of the border at a door; NaN for a door more than 0.5 m from the border."""
    near = nearest_on_border(polygon, p)
    if near.distance > 0.5:
        return np.nan
    edges = border(polygon)
    along = np.clip(((near.point - edges.start) * edges.tangent).sum(axis=1), 0.0, edges.length)
    at = edges.start + along[:, None] * edges.tangent
    here = np.square(at - near.point).sum(axis=1) < 1e-12  # one edge, or two at a corner
    x, y = -edges.normal[here].sum(axis=0)
    return float(np.arctan2(y, x))
