"""G = (S, O): a building as nodes, links and open areas, and P = c_A P_A + c_L P_L on it.  GBPF ch. 2-3."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.indoor import FloorGraph, disc_probability, mixed_measure, sample_measure
from core.indoor.density import MixedMeasure, Probability
from core.types import Array
from lessons.indoor._building import MAP, Building, building
from lessons.indoor._floor_graph_edit import Edit, edited
from lessons.indoor._floor_graph_view import view
from lessons.kit.lesson import Lesson, Progress
from lessons.kit.params import Names, Point, choice, datafile, draggable, names, seed, slider, switch

RADII = np.linspace(0.5, 40.0, 60)                 # of the disc in the plot
USED = {
    "building": {"lift_m", "walls"},
    "measure": {"lift_m", "walls", "area_mass", "disc", "radius_m", "darts", "seed"},
    "edit": {"floor", "action", "removed", "added", "place", "node"},
}


@dataclass(frozen=True, slots=True)
class Params:
    """What is looked at: the building, the probability on it, or changes of the map."""

    show: str = choice("building", ("building", "measure", "edit"))
    map: str = datafile(MAP)
    lift_m: float = slider(20.0, low=0.0, high=40.0, step=1.0, unit="m", group="view")
    walls: bool = switch(True, group="view")
    area_mass: float = slider(0.5, low=0.0, high=1.0, step=0.01, group="measure")
    disc: Point = draggable((54.0, 8.0), low=-200.0, high=400.0, role="likelihood", group="measure")
    radius_m: float = slider(12.0, low=0.5, high=40.0, step=0.5, unit="m", group="measure")
    darts: int = slider(1500, low=100, high=20_000, log=True, group="measure")
    seed: int = seed(1, group="measure")
    action: str = choice("move", ("move", "remove", "add"), group="edit")
    floor: int = slider(0, low=0, high=4, group="edit")
    node: Names = names((), limit=1, group="edit")
    place: Point = draggable((0.0, 0.0), low=-200.0, high=400.0, group="edit")
    removed: Names = names((), limit=40, group="edit")
    added: Names = names((), limit=40, group="edit")


class Result(NamedTuple):
    """The building; the mixed measure, the disc's probability, that of discs of other radii, and darts; the edit."""

    building: Building
    measure: MixedMeasure
    disc: Probability
    by_radius: Array            # (RADII, 3) of areas, of links, and together, each with its mass
    darts: Array                # (N, 3) x, y, floor
    on_area: Array              # (N,)
    in_disc: Array              # (N,)
    edit: Edit


def compute(p: Params, progress: Progress) -> Result:
    """Only what the chosen view needs is computed in full."""
    b = building(p.map)
    g = b.graph
    mass = p.area_mass if g.areas and g.links else float(bool(g.areas))
    measure = mixed_measure(g, mass)
    floor = g.floors[0]
    disc = disc_probability(g, measure, p.disc, p.radius_m, floor)
    by_radius = np.zeros((len(RADII), 3))
    darts, on_area = np.zeros((0, 3)), np.zeros(0, dtype=bool)
    if p.show == "measure":
        for k, r in enumerate(RADII):
            at = disc_probability(g, measure, p.disc, float(r), floor)
            by_radius[k] = measure.c_A * at.P_area, measure.c_L * at.P_link, at.P
            progress(0.8 * (k + 1) / len(RADII))
        xy, objects = sample_measure(g, measure, p.darts, np.random.default_rng(p.seed))
        on_area = objects >= len(g.links)
        darts = np.column_stack([xy, _floors_of(g, xy, objects)])
    inside = (np.square(darts[:, :2] - p.disc).sum(axis=1) <= p.radius_m**2) & (darts[:, 2] == floor)
    edit = edited(g, p.node, p.place, p.removed, p.added) if p.show == "edit" else Edit(g, {}, (), 0, frozenset())
    return Result(b, measure, disc, by_radius, darts, on_area, inside, edit)


def _floors_of(g: FloorGraph, xy: Array, objects: Array) -> Array:
    """The floor of each dart: on stairs and lifts that of the nearer end."""
    ids = g.object_ids
    found = np.empty(len(xy))
    for o in np.unique(objects):
        here = objects == o
        if o >= len(g.links):
            found[here] = g.areas[ids[o]].floor
            continue
        a, b = (g.nodes[n] for n in g.links[ids[o]].nodes)
        nearer = [np.square(xy[here] - (n.x_m, n.y_m)).sum(axis=1) for n in (a, b)]
        found[here] = np.where(nearer[0] <= nearer[1], a.floor, b.floor)
    return found


def unused(p: Params) -> Collection[str]:
    """Controls of the other views; the handle of a node is there when a node has been chosen."""
    hidden = set().union(*USED.values()) - USED[p.show]
    hidden |= {"node", "removed", "added"} - {{"move": "node", "remove": "removed", "add": "added"}[p.action]}
    if not p.node or p.action != "move":
        hidden |= {"place"}
    return hidden


LESSON = Lesson(
    Params, compute, view, unused=unused, budget_s=1.0,
    refs=("GBPF ch. 2", "GBPF ch. 3", "GBPF (2.9)-(2.15)"),
    presets={
        "the building": {},
        "floors together, no walls": {"lift_m": 0.0, "walls": False},
        "half of the mass in the areas": {"show": "measure"},
        "nearly all on the links": {"show": "measure", "area_mass": 0.05},
        "the yard holds most of the area": {"show": "measure", "area_mass": 0.95, "disc": (54.0, -12.0)},
        "move a node": {"show": "edit", "node": ("0S8",), "place": (54.0, 4.0)},
        "join two corridors": {"show": "edit", "action": "add", "removed": ("0corrN7",),
                               "added": ("0S3", "0N6", "0S12")},
        "cut the stairs": {"show": "edit", "action": "remove", "floor": 1, "removed": ("stairs_a", "stairs_b", "lift")},
        "a door in the wrong place": {"show": "edit", "node": ("lobby_west",), "place": (14.0, 23.0)},
    },
)
