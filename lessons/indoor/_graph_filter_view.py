"""How the graph filter's step is drawn: particles on links and areas of both floors, tracks, and the true walker."""

from typing import TYPE_CHECKING

import numpy as np

from core.indoor import FloorGraph
from core.types import Array
from lessons.indoor._floors import (
    areas,
    corners,
    floor_labels,
    floor_objects,
    graph_items,
    house_camera,
    lifted,
    link_pairs,
)
from lessons.indoor._graph_filter_figures import ROLES, equations, figures, readouts
from lessons.kit.lesson import Moment, Target, View
from lessons.kit.scene import Camera, Item, Label, Particles, Plane, Points, Polygon, Polyline, Segments

if TYPE_CHECKING:
    from lessons.indoor.graph_filter import Params, Result

MOVE, WEIGH, ESTIMATE, RESAMPLE = range(4)
LIFT_M, GAP_M = 26.0, 12.0
TAIL = 60                           # seconds of the estimates' tracks that are drawn


class House:
    """Both floors above each other in space."""

    def __init__(self, r: "Result") -> None:
        self.r, self.g = r, r.building.graph

    def place(self, position_m: Array, floor: Array) -> Array:
        return lifted(self.g, position_m, LIFT_M) + np.array([0.0, 0.0, 0.3])

    def background(self) -> list[Item]:
        g = self.g
        return [*areas(g, g.floors, LIFT_M, opacity=0.2), *graph_items(g, g.floors, LIFT_M, width=1.8, nodes=False),
                *floor_labels(g, LIFT_M)]

    def camera(self) -> Camera:
        return house_camera(self.r.building, LIFT_M)


class Plans:
    """The floors side by side in the plane, the higher ones above."""

    def __init__(self, r: "Result") -> None:
        self.r, self.g = r, r.building.graph
        low, high = corners(r.building, self.g.floors)
        self.low, self.high, self.shift = low, high, float(high[1] - low[1]) + GAP_M

    def place(self, position_m: Array, floor: Array) -> Array:
        p = np.array(position_m, dtype=np.float64)[..., :2]
        p[..., 1] += self.shift * (np.asarray(floor) - self.g.floors[0])
        return p

    def background(self) -> list[Item]:
        g, items = self.g, []
        for f in g.floors:
            links, here = floor_objects(g, [f])
            level = [o for o in links if g.links[o].kind == "corridor"]
            up = np.array([0.0, self.shift * (f - g.floors[0])])
            items += [Polygon(f"area_{f}_{k}", g.areas[o].polygon + up, role="area", opacity=0.2)
                      for k, o in enumerate(here)]
            if len(segments := self.r.building.walls[f]):
                items.append(Segments(f"walls_{f}", segments + up, role="muted", width=1.2, fade=0.3))
            if level:
                items.append(Segments(f"links_{f}", link_pairs(g, level)[..., :2] + up, role="link", width=1.8))
            items.append(Label(f"floor_{f}", f"floor {f}", (self.low[0], self.low[1] + up[1] - 4.0), 1.0, "left"))
        return items

    def camera(self) -> Camera:
        top = self.high[1] + self.shift * (len(self.g.floors) - 1)
        return Plane((float(self.low[0] - 4.0), float(self.high[0] + 4.0)),
                     (float(self.low[1] - 8.0), float(top + 4.0)), axes=False)


def view(p: "Params", r: "Result", at: Moment) -> View:
    world: House | Plans = House(r) if p.picture == "house" else Plans(r)
    t = at.step
    scan = "" if np.isnan(r.scans[t]).all() else ", a scan"
    shown = len(r.tll.weights[t])
    note = r.note or (f"{shown:,} of the {p.particles:,} particles are drawn." if shown < p.particles else "")
    return View(scene=_scene(p, r, at, world), camera=world.camera(), figures=figures(p, r, t),
                readouts=readouts(p, r, t), equations=equations(p, r, at), caption=f"t = {t} s{scan}", note=note,
                targets=_targets(p, r.building.graph, world))


def _scene(p: "Params", r: "Result", at: Moment, world: House | Plans) -> list[Item]:
    t, tll = at.step, r.tll
    items = world.background()
    floors = _floors(r.building.graph, tll.predicted[t] if at.stage < RESAMPLE else tll.after[t])
    if at.stage < RESAMPLE:
        weights = tll.weights[t] if at.stage >= WEIGH else None
        items.append(Particles("particles", world.place(tll.predicted[t], floors), weights, size=6.0))
    else:
        items.append(Particles("particles", world.place(tll.after[t], floors), size=6.0))
    truth = world.place(r.truth.position_m, r.truth.floor)
    if t:
        items.append(Polyline("walked", truth[:t + 1], role="truth", width=3.5))
    items.append(Points("truth", truth[[t]], role="truth", size=16, shape="diamond"))
    done = t + (at.stage >= ESTIMATE)
    for name, track in r.tracks.items():
        if done and (name == "tll" or p.others):
            items += _track(r, name, track, done, world)
    return items


def _track(r: "Result", name: str, track: Array, done: int, world: House | Plans) -> list[Item]:
    """The last estimates of one filter, and the latest as a dot."""
    floor = r.floors[name][:done]
    z = r.building.graph.floor_height_m * floor
    at = world.place(np.column_stack([track[:done], z]), floor)
    items: list[Item] = [Points(f"now_{name}", at[[-1]], role=ROLES[name], size=14 if name == "tll" else 11)]
    recent = at[-TAIL:]
    same = floor[-TAIL:][1:] == floor[-TAIL:][:-1]
    pairs = np.stack([recent[:-1], recent[1:]], axis=1)[same]
    if len(pairs):
        items.append(Segments(f"track_{name}", pairs, role=ROLES[name], width=3.5 if name == "tll" else 2.0))
    return items


def _floors(g: FloorGraph, position_m: Array) -> Array:
    """The nearest floor of each position, from its height."""
    return np.clip(np.rint(position_m[:, 2] / g.floor_height_m), g.floors[0], g.floors[-1])


def _targets(p: "Params", g: FloorGraph, world: House | Plans) -> list[Target]:
    """A click on a node adds it to the route."""
    if p.walk == "own" and len(p.route) >= 12:
        return []
    before = p.route if p.walk == "own" else ()
    nodes = [n for n in g.nodes if not before or n != before[-1]]
    floors = np.array([g.nodes[n].floor for n in nodes])
    position = np.array([[*g.nodes[n][:2], g.floor_height_m * g.nodes[n].floor] for n in nodes])
    return [Target(at, {"walk": "own", "route": (*before, n)})
            for n, at in zip(nodes, world.place(position, floors), strict=True)]
