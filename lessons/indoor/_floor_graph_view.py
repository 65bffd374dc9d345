"""How the map, the probability on it and its changes are drawn."""

from typing import TYPE_CHECKING, Any

import numpy as np

from core.indoor.geometry import contains
from core.types import Array
from lessons.indoor._floors import (
    areas,
    floor_camera,
    floor_labels,
    graph_items,
    height,
    house_camera,
    link_pairs,
    outline,
    walls,
)
from lessons.kit.figures import chart, line
from lessons.kit.lesson import Moment, Readout, Target, View
from lessons.kit.scene import Item, Label, Points, Polygon, Polyline, Segments, Walls

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.indoor._floor_graph_edit import Edit
    from lessons.indoor.floor_graph import Params, Result

TALLEST_M = 6.0           # of the densities, above the floor


def view(p: "Params", r: "Result", at: Moment) -> View:
    return {"building": _building, "measure": _measure, "edit": _edit}[p.show](p, r)


def _building(p: "Params", r: "Result") -> View:
    g = r.building.graph
    scene: list[Item] = areas(g, g.floors, p.lift_m)
    scene += graph_items(g, g.floors, p.lift_m)
    if p.walls:
        scene += walls(r.building, g.floors, p.lift_m)
    scene += [Label(f"name_{o}", o.replace("_", " "),
                    (*_name_place(a.polygon), float(height(g, a.floor, p.lift_m)) + 1.0))
              for o, a in g.areas.items()]
    scene += floor_labels(r.building.graph, p.lift_m)
    return View(scene=scene, camera=house_camera(r.building, p.lift_m), figures={"lengths": _lengths(r)},
                readouts=_counts(r), caption=r.building.name)


def _name_place(polygon: Array) -> Array:
    """The mean of the corners; where that lies outside, the middle of the longest diagonal that stays inside."""
    middle = polygon.mean(axis=0)
    if contains(polygon, middle):
        return middle
    i, j = np.triu_indices(len(polygon), 2)
    a, b = polygon[i], polygon[j]
    shares = np.linspace(0.05, 0.95, 19)[:, None, None]
    inside = contains(polygon, ((1 - shares) * a + shares * b).reshape(-1, 2)).reshape(19, -1).all(axis=0)
    length = np.where(inside, np.linalg.norm(b - a, axis=1), 0.0)
    return 0.5 * (a + b)[length.argmax()]


def _counts(r: "Result") -> list[Readout]:
    g = r.building.graph
    return [Readout("nodes", len(g.nodes)), Readout("links", len(g.links)), Readout("areas", len(g.areas)),
            Readout("link_length", sum(l.length_m for l in g.links.values()), "m"),
            Readout("area_m2", sum(a.area_m2 for a in g.areas.values()), "m²"),
            Readout("area_length", sum(a.length_m for a in g.areas.values()), "m")]


def _lengths(r: "Result") -> "go.Figure":
    """How many objects are at least so long: areas by their equivalent lengths."""
    g = r.building.graph
    curves = []
    for key, role, lengths in (("links", "link", [l.length_m for l in g.links.values()]),
                               ("areas", "area", [a.length_m for a in g.areas.values()])):
        at = np.sort(lengths)
        curves.append(line(key, np.repeat(at, 2), np.repeat(np.arange(len(at), -1, -1), 2)[1:-1], role))
    return chart(*curves, log_x=True, log_y=False)


def _measure(p: "Params", r: "Result") -> View:
    g, m = r.building.graph, r.measure
    per_m = m.c_L / max(sum(g.length(o) for o in m.links), 1e-9)
    per_m2 = m.c_A / max(sum(g.areas[o].area_m2 for o in m.areas), 1e-9)
    tall_links, tall_areas = TALLEST_M * m.c_L, TALLEST_M * m.c_A
    scene: list[Item] = []
    for k, o in enumerate(g.areas):
        scene.append(Polygon(f"area_{k}", outline(g, o, p.lift_m, tall_areas), role="area", opacity=0.35))
        ring = outline(g, o, p.lift_m)
        if tall_areas > 0.05:
            sides = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
            scene.append(Walls(f"side_{k}", sides, tall_areas, "area", 0.2))
    pairs = link_pairs(g, list(g.links), p.lift_m)
    if tall_links > 0.05:
        scene.append(Walls("curtains", pairs, tall_links, "link", 0.45))
    scene.append(Segments("links", pairs, role="link", width=2.5))
    if p.walls:
        scene += walls(r.building, g.floors, p.lift_m, opacity=0.06)
    z = height(g, r.darts[:, 2].astype(int), p.lift_m) + 0.3
    at = np.column_stack([r.darts[:, :2], z])
    shown = np.arange(len(at))[:3000]
    for name, which, role in (("darts_out", ~r.in_disc, "monte_carlo"), ("darts_in", r.in_disc, "likelihood")):
        if which[shown].any():
            scene.append(Points(name, at[shown][which[shown]], role=role, size=4.0 if name == "darts_out" else 6.0))
    circle = _circle(p)
    scene.append(Polyline("disc", np.column_stack([circle, np.full(len(circle), 0.3)]), role="likelihood", width=4,
                          closed=True))
    share = float(r.in_disc.mean()) if len(r.in_disc) else 0.0
    readouts = [
        Readout("c_area", m.c_A), Readout("c_links", m.c_L), Readout("per_m2", 1e6 * per_m2, "10⁻⁶/m²"),
        Readout("per_m", 1e6 * per_m, "10⁻⁶/m"), Readout("p_area", 100 * m.c_A * r.disc.P_area, "%"),
        Readout("p_links", 100 * m.c_L * r.disc.P_link, "%"), Readout("p_disc", 100 * r.disc.P, "%"),
        Readout("p_darts", 100 * share, "%"),
    ]
    from lessons.indoor.floor_graph import RADII

    figure = chart(line("areas", RADII, 100 * r.by_radius[:, 0], "area"),
                   line("links", RADII, 100 * r.by_radius[:, 1], "link"),
                   line("both", RADII, 100 * r.by_radius[:, 2], "likelihood"), cursor=p.radius_m)
    note = "" if p.darts <= 3000 else f"3,000 of the {p.darts:,} darts are drawn; all are counted."
    return View(scene=scene, camera=house_camera(r.building, p.lift_m, elevation_deg=50.0),
                figures={"probability": figure, "lengths": _lengths(r)}, readouts=readouts,
                caption=f"P = {m.c_A:.2f} P_A + {m.c_L:.2f} P_L", note=note)


def _circle(p: "Params") -> Array:
    turn = np.linspace(0.0, 2 * np.pi, 61)[:-1]
    return np.array(p.disc) + p.radius_m * np.column_stack([np.cos(turn), np.sin(turn)])


def _edit(p: "Params", r: "Result") -> View:
    g, e = r.building.graph, r.edit
    floor = g.floors[min(p.floor, len(g.floors) - 1)]
    nodes: dict[str, Any] = {n: at for n, at in e.raw["nodes"].items() if at[2] == floor}
    links = {o: link["nodes"] for o, link in e.raw["links"].items() if all(n in nodes for n in link["nodes"])}
    upright = {o: next(n for n in link["nodes"] if n in nodes) for o, link in e.raw["links"].items()
               if sum(n in nodes for n in link["nodes"]) == 1}
    scene: list[Item] = [Polygon(f"{'bad_' * (o in e.named)}area_{k}", np.array(a["polygon"]),
                                 role="warning" if o in e.named else "area")
                         for k, (o, a) in enumerate(e.raw["areas"].items()) if a["floor"] == floor]
    if len(walls_here := r.building.walls[floor]):
        scene.append(Segments("walls", walls_here, role="muted", width=1.5, fade=0.35))
    bad_links = {o for o in links if o in e.named} | {o for o in e.named & set(upright)}
    for name, chosen, role in (("links", [o for o in links if o not in bad_links and not o.startswith("new")], "link"),
                               ("new_links", [o for o in links if o.startswith("new")], "vector"),
                               ("bad_links", [o for o in links if o in bad_links], "warning")):
        if chosen:
            scene.append(Segments(name, np.array([[nodes[n][:2] for n in links[o]] for o in chosen]), role=role,
                                  width=4.0))
    gone = [o for o in p.removed if o in g.links and all(n in nodes for n in g.links[o].nodes)]
    if gone:
        scene.append(Segments("removed", np.array([[nodes[n][:2] for n in g.links[o].nodes] for o in gone]),
                              role="warning", width=2.0, fade=0.6))
    good = [at[:2] for n, at in nodes.items() if n not in e.named]
    ends = {n for o in bad_links & set(g.links) for n in g.nodes_of(o)}
    bad = [at[:2] for n, at in nodes.items() if n in e.named | ends]
    if good:
        scene.append(Points("nodes", good, role="link", size=9))
    if upright:
        scene.append(Points("upright", [nodes[n][:2] for n in upright.values()], role="vector", size=13,
                            shape="square"))
    if bad:
        scene.append(Points("bad_nodes", bad, role="warning", size=13))
    waiting = p.added[-1] if len(p.added) % 2 else None
    if waiting in nodes:
        scene.append(Points("waiting", [nodes[waiting][:2]], role="vector", size=15))
    return View(scene=scene, camera=floor_camera(r.building, floor), figures={"lengths": _lengths(r)}, readouts=[
        Readout("problems", e.count), Readout("nodes", len(e.raw["nodes"])),
        Readout("links", len(e.raw["links"])),
        Readout("total_length", e.graph.total_length_m if e.graph is not None else None, "m"),
        Readout("verdict", "valid" if e.graph is not None and not e.problems else "not valid"),
    ], caption=f"floor {floor}: click to {p.action}", note=_problems(e),
        targets=_targets(p, r, nodes, links, upright))


def _problems(e: "Edit") -> str:
    """The first of them, as a line over the scene."""
    if not e.problems:
        return ""
    return f"Validation: {e.problems[0]}" + (f" \u2026 and {e.count - 1} more like this." if e.count > 1 else "")


def _targets(p: "Params", r: "Result", nodes: dict[str, Any], links: dict[str, Any],
             upright: dict[str, str]) -> list[Target]:
    """Nodes to take or to join, the middles of links to take away."""
    if p.action == "move":
        return [Target(at[:2], {"node": (n,), "place": tuple(at[:2])}) for n, at in nodes.items()]
    if p.action == "add":
        return [Target(at[:2], {"added": (*p.added, n)}) for n, at in nodes.items()
                if len(p.added) < 40 and not (len(p.added) % 2 and p.added[-1] == n)]
    middles = {o: np.mean([nodes[n][:2] for n in ends], axis=0).tolist() for o, ends in links.items()}
    middles |= {o: nodes[n][:2] for o, n in upright.items()}
    return [Target(at, {"removed": (*p.removed, o)}) for o, at in middles.items()
            if o in r.building.graph.links and len(p.removed) < 40]
