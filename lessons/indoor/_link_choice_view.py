"""How the choice at a node is drawn: what lies behind each way, its probability, and where walkers get to."""

from typing import TYPE_CHECKING

import numpy as np

from core.indoor import FloorGraph
from core.types import Array
from lessons.indoor._floors import areas, graph_items, height, house_camera, lifted, link_pairs, outline, spots, walls
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Moment, Readout, Target, View
from lessons.kit.roles import Role
from lessons.kit.scene import Arrow, Camera, Item, Label, Plane, Points, Polygon, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.indoor.link_choice import Params, Result

WAYS: tuple[Role, ...] = ("measurement", "posterior", "likelihood", "innovation", "vector", "mixture", "ekf", "grid")
RULES: dict[str, Role] = {"tll": "pf", "equal": "mixture"}
NAMES = {"tll": "walkers with total link length", "equal": "walkers with equal choice"}
LIFT_M = 20.0
BEHIND, CAP, CHOICE = range(3)


def view(p: "Params", r: "Result", at: Moment) -> View:
    flat = r.building is None
    lift = 0.0 if flat else LIFT_M
    size = _size(r.graph)
    return View(
        scene=_scene(p, r, at, lift, size), camera=_camera(r, lift), figures=_figures(p, r, at),
        readouts=_readouts(p, r, at), equations=_equations(p, r, at), note=r.note,
        caption=f"at {r.node}, coming through {r.arrival}", targets=_targets(r, lift))


def _size(g: FloorGraph) -> float:
    xy = np.array([n[:2] for n in g.nodes.values()])
    return float(np.ptp(xy, axis=0).max())


def _camera(r: "Result", lift: float) -> Camera:
    if r.building is not None:
        return house_camera(r.building, lift)
    points = np.concatenate([spots(r.graph, r.graph.nodes)[:, :2], *(a.polygon for a in r.graph.areas.values())])
    low, high = points.min(axis=0) - [0.0, _below(r.graph)], points.max(axis=0)
    pad = 0.08 * float((high - low).max())
    return Plane((float(low[0] - pad), float(high[0] + pad)), (float(low[1] - pad), float(high[1] + pad)))


def _scene(p: "Params", r: "Result", at: Moment, lift: float, size: float) -> list[Item]:
    g = r.graph
    items: list[Item] = areas(g, g.floors, lift)
    if r.building is not None:
        items += walls(r.building, g.floors, lift, opacity=0.08)
    broad = 4.5 if r.building is None else 2.0
    for k, objects in enumerate(r.behind.values()):       # wider below narrower, so that all stay in sight
        items += _strip(g, f"behind_{k + 1}", objects, WAYS[k % len(WAYS)], broad * (len(r.behind) - k + 1), lift)
    items += graph_items(g, g.floors, lift, width=2.0)
    items.append(Points("walkers", lifted(g, r.positions[p.rule][at.step], lift), role=RULES[p.rule], size=6.0))
    if r.building is None:
        items += _other(p, r, at, size)
    node = spots(g, [r.node], lift)[0]
    items.append(Points("node", [node], role="truth", size=17))
    start = _leg(g, r.arrival, node, lift, 0.16 * size)
    items.append(Arrow("came", start, start + 0.8 * (node - start), role="truth", width=5.0))
    if at.stage >= CHOICE:
        for k, (o, share) in enumerate(r.probability[p.rule].items()):
            end = _leg(g, o, node, lift, 0.16 * size)
            items.append(Arrow(f"way_{k + 1}", node + 0.2 * (end - node), end, role=WAYS[k % len(WAYS)],
                               width=2.0 + 12.0 * share))
            items.append(Label(f"p_{k + 1}", f"{o}: {100 * share:.3g} %", end + 0.35 * (end - node), 1.0))
    return items


def _below(g: FloorGraph) -> float:
    """How far below the map its second copy is drawn."""
    points = np.concatenate([spots(g, g.nodes)[:, :2], *(a.polygon for a in g.areas.values())])
    wide, tall = np.ptp(points, axis=0)
    return float(tall + 0.22 * wide)


def _other(p: "Params", r: "Result", at: Moment, size: float) -> list[Item]:
    """The same map once more below, with the walkers of the other rule."""
    g, rule = r.graph, next(k for k in RULES if k != p.rule)
    down = np.array([0.0, -_below(g), 0.0])
    items: list[Item] = [Polygon(f"other_area_{k}", outline(g, o) + down, role="area", opacity=0.28)
                         for k, o in enumerate(g.areas)]
    items.append(Segments("other_links", link_pairs(g, list(g.links)) + down, role="link", width=2.0))
    items.append(Points("other_walkers", r.positions[rule][at.step] * [1, 1, 0] + down, role=RULES[rule], size=6.0))
    items.append(Points("other_node", spots(g, [r.node]) + down, role="truth", size=12))
    at = spots(g, g.nodes)
    low, top = float(at[:, 0].min()), float(at[:, 1].max()) + 0.1 * size
    for name, key, y in (("title", p.rule, top), ("other_title", rule, top - _below(g))):
        items.append(Label(name, NAMES[key], (low, y), 1.0, "left"))
    return items


def _strip(g: FloorGraph, name: str, objects: tuple[str, ...], role: Role, width: float, lift: float) -> list[Item]:
    """All that lies behind one choice as a broad line along links and round areas."""
    links = [o for o in objects if o in g.links]
    pairs = [link_pairs(g, links, lift)] if links else []
    for o in objects:
        if o in g.areas:
            ring = outline(g, o, lift)
            pairs.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
    return [Segments(name, np.concatenate(pairs), role=role, width=width, fade=0.45)] if pairs else []


def _leg(g: FloorGraph, o: str, node: Array, lift: float, reach: float) -> Array:
    """A point of the object a little away from the node."""
    if o in g.links:
        a, b = spots(g, g.nodes_of(o), lift)
        other = b if np.abs(a - node).sum() <= np.abs(b - node).sum() else a
    else:
        other = np.append(g.areas[o].polygon.mean(axis=0), float(height(g, g.areas[o].floor, lift)))
    d = other - node
    length = float(np.sqrt(d @ d))
    return node + d * min(reach, length) / max(length, 1e-9)


def _targets(r: "Result", lift: float) -> list[Target]:
    """Another node; or the middle of another object at this node: one came through it."""
    g = r.graph
    found = [Target(at, {"node": (n,), "arrival": ()}) for n, at in zip(g.nodes, spots(g, g.nodes, lift), strict=True)
             if n != r.node]
    for o in g.objects_at(r.node):
        if o in g.links:
            found.append(Target(link_pairs(g, [o], lift)[0].mean(axis=0), {"node": (r.node,), "arrival": (o,)}))
        else:
            middle = (*g.areas[o].polygon.mean(axis=0), float(height(g, g.areas[o].floor, lift)))
            found.append(Target(middle, {"node": (r.node,), "arrival": (o,)}))
    return found


def _figures(p: "Params", r: "Result", at: Moment) -> "dict[str, go.Figure]":
    from lessons.indoor.link_choice import CAPS, STEP_S, STEPS

    choices = list(r.behind)
    x = np.arange(1, len(choices) + 1)
    t = STEP_S * np.arange(STEPS + 1)
    law = chart(bars("tll", x - 0.18, [100 * r.probability["tll"][o] for o in choices], "pf", width=0.34),
                bars("equal", x + 0.18, [100 * r.probability["equal"][o] for o in choices], "mixture", width=0.34))
    law.layout.xaxis.tickvals, law.layout.xaxis.ticktext = x.tolist(), choices
    visits = [line(f"rooms_{rule}", t, 100 * r.shares[rule][:, 0], role) for rule, role in RULES.items()]
    if r.graph.areas:
        visits += [line(f"areas_{rule}", t, 100 * r.shares[rule][:, 2], role, dash=True)
                   for rule, role in RULES.items()]
    by_cap = chart(*(line(f"way_{k + 1}", CAPS, 100 * r.by_cap[:, k], WAYS[k % len(WAYS)])
                     for k in range(min(len(choices), 4))), log_x=True, cursor=p.l_max_m if p.cap else None,
                   y_range=(-3.0, 103.0))
    return {"law": law, "visits": chart(*visits, cursor=float(t[at.step])), "cap": by_cap}


def _readouts(p: "Params", r: "Result", at: Moment) -> list[Readout]:
    tll, equal = (r.shares[rule][at.step] for rule in RULES)
    far = {rule: _spread(r.positions[rule][at.step], r.positions[rule][0]) for rule in RULES}
    best = max(r.probability[p.rule].items(), key=lambda kv: kv[1])
    return [
        Readout("choices", len(r.behind)), Readout("likeliest", best[0]), Readout("p_best", 100 * best[1], "%"),
        Readout("rooms_tll", 100 * tll[0], "%"), Readout("rooms_equal", 100 * equal[0], "%"),
        Readout("far_tll", far["tll"], "m"), Readout("far_equal", far["equal"], "m"),
        Readout("total", r.graph.total_length_m, "m"),
    ]


def _spread(now: Array, start: Array) -> float:
    return float(np.sqrt(np.square(now - start).sum(axis=1)).mean())


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    tll = np.array([r.tll[o] for o in r.behind])
    capped = np.array([r.capped[o] for o in r.behind])
    cap = rf"\,l_{{max}}) \;\; (l_{{max}} = {p.l_max_m:.3g}\,\mathrm{{m}}) =" if p.cap else r"\,\infty) ="
    law = np.array(list(r.probability[p.rule].values()))
    rule = r"p(o) = T(o\,|\,n) / \sum T(o'\,|\,n) =" if p.rule == "tll" else r"p(o) = 1 / K ="
    return [
        Equation("behind", (r"\mathrm{TLL}(o\,|\,n) =", tll), current=at.stage == BEHIND),
        Equation("cap", (r"T = \min(\mathrm{TLL}," + cap, *([capped] if at.stage >= CAP else [])),
                 current=at.stage == CAP),
        Equation("choice", (rule, *([law] if at.stage >= CHOICE else [])), current=at.stage == CHOICE),
    ]
