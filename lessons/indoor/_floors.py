"""How the building is drawn: floors above each other, walls, links, areas and nodes."""

from collections.abc import Iterable, Sequence

import numpy as np

from core.indoor import FloorGraph
from core.types import Array
from lessons.indoor._building import Building
from lessons.kit.scene import Item, Label, Orbit, Plane, Points, Polygon, Segments, Walls

WALL_M = 2.2


def height(graph: FloorGraph, floor: Array | int, lift_m: float = 0.0) -> Array:
    """z of a floor: storeys and `lift_m` more between them; the lowest lies at 0."""
    return (np.asarray(floor, dtype=np.float64) - graph.floors[0]) * (graph.floor_height_m + lift_m)


def spots(graph: FloorGraph, nodes: Iterable[str], lift_m: float = 0.0) -> Array:
    """Nodes as points (n, 3)."""
    found = [graph.nodes[n] for n in nodes]
    xy = np.array([n[:2] for n in found], dtype=np.float64).reshape(-1, 2)
    return np.column_stack([xy, height(graph, np.array([n.floor for n in found], dtype=int), lift_m)])


def lifted(graph: FloorGraph, position_m: Array, lift_m: float = 0.0) -> Array:
    """Positions (n, 3) whose z is the true height, with the floors apart; on stairs and lifts in between."""
    p = np.array(position_m, dtype=np.float64)
    p[..., 2] *= (graph.floor_height_m + lift_m) / graph.floor_height_m
    p[..., 2] -= graph.floors[0] * (graph.floor_height_m + lift_m)
    return p


def link_pairs(graph: FloorGraph, links: Sequence[str], lift_m: float = 0.0) -> Array:
    """Links as segments (n, 2, 3)."""
    ends = [spots(graph, (graph.links[o].nodes[k] for o in links), lift_m) for k in (0, 1)]
    return np.stack(ends, axis=1)


def outline(graph: FloorGraph, area: str, lift_m: float = 0.0, raised_m: float = 0.0) -> Array:
    """The border of an area (n, 3)."""
    a = graph.areas[area]
    z = float(height(graph, a.floor, lift_m)) + raised_m
    return np.column_stack([a.polygon, np.full(len(a.polygon), z)])


def floor_objects(graph: FloorGraph, floors: Sequence[int]) -> tuple[list[str], list[str]]:
    """Links with an end on these floors, and areas on them."""
    links = [o for o, l in graph.links.items() if any(graph.nodes[n].floor in floors for n in l.nodes)]
    return links, [o for o, a in graph.areas.items() if a.floor in floors]


def walls(b: Building, floors: Sequence[int], lift_m: float = 0.0, opacity: float = 0.16,
          height_m: float = WALL_M) -> list[Item]:
    """The walls of these floors."""
    items: list[Item] = []
    for f in floors:
        if len(segments := b.walls.get(f, ())):
            z = np.full((len(segments), 2, 1), float(height(b.graph, f, lift_m)))
            items.append(Walls(f"walls_{f}", np.concatenate([segments, z], axis=2), height_m, opacity=opacity))
    return items


def areas(graph: FloorGraph, floors: Sequence[int], lift_m: float = 0.0, opacity: float = 0.28) -> list[Item]:
    """The open areas of these floors."""
    return [Polygon(f"area_{k}", outline(graph, o, lift_m), role="area", opacity=opacity)
            for k, o in enumerate(floor_objects(graph, floors)[1])]


def graph_items(graph: FloorGraph, floors: Sequence[int], lift_m: float = 0.0, width: float = 3.0,
                nodes: bool = True) -> list[Item]:
    """Links (stairs and lifts dashed out in another colour), nodes and accessor nodes."""
    links, _ = floor_objects(graph, floors)
    level = [o for o in links if graph.links[o].kind == "corridor"]
    up = [o for o in links if graph.links[o].kind != "corridor"]
    items: list[Item] = []
    if level:
        items.append(Segments("links", link_pairs(graph, level, lift_m), role="link", width=width))
    if up:
        items.append(Segments("upright", link_pairs(graph, up, lift_m), role="vector", width=width + 1.0))
    if nodes:
        doors = {n for a in graph.areas.values() for n in a.accessor_nodes}
        plain = [n for n, at in graph.nodes.items() if at.floor in floors and n not in doors]
        doors_here = [n for n in doors if graph.nodes[n].floor in floors]
        if plain:
            items.append(Points("nodes", spots(graph, plain, lift_m), role="link", size=6.0))
        if doors_here:
            items.append(Points("accessors", spots(graph, sorted(doors_here), lift_m), role="accessor", size=11.0,
                                shape="diamond"))
    return items


def corners(b: Building, floors: Sequence[int]) -> Array:
    """(2, 2): the lowest and highest x, y of what lies on these floors."""
    g = b.graph
    parts = [spots(g, [n for n, at in g.nodes.items() if at.floor in floors])[:, :2],
             *(a.polygon for a in g.areas.values() if a.floor in floors),
             *(b.walls[f].reshape(-1, 2) for f in floors if f in b.walls)]
    points = np.concatenate(parts)
    return np.array([points.min(axis=0), points.max(axis=0)])


def floor_labels(g: FloorGraph, lift_m: float) -> list[Item]:
    """The number of each floor beside its north-east corner, which no floor hides from `house_camera`."""
    x = max(n.x_m for n in g.nodes.values())
    y = max(n.y_m for n in g.nodes.values()) + 8.0
    return [Label(f"floor_{f}", f"floor {f}", (x, y, float(height(g, f, lift_m))), 1.1) for f in g.floors]


def house_camera(b: Building, lift_m: float = 0.0, floors: Sequence[int] | None = None, elevation_deg: float = 42.0,
                 azimuth_deg: float = -24.0) -> Orbit:
    """The whole building from the south-west."""
    floors = b.graph.floors if floors is None else floors
    low, high = corners(b, floors)
    z = height(b.graph, np.array([min(floors), max(floors)]), lift_m)
    half = 0.5 * np.array([*(high - low), z[1] - z[0] + WALL_M])
    centre = (*(0.5 * (low + high)).tolist(), float(z.mean()))
    return Orbit(centre, float(0.95 * np.sqrt((half**2).sum())), azimuth_deg, elevation_deg)


def floor_camera(b: Building, floor: int) -> Plane:
    """One floor from above."""
    low, high = corners(b, [floor])
    pad = 0.03 * (high - low).max()
    return Plane((float(low[0] - pad), float(high[0] + pad)), (float(low[1] - pad), float(high[1] + pad)))
