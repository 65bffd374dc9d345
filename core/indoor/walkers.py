"""Particles during a step: working copies of a cloud's arrays, and the time each particle has left."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from core.indoor.choice import ChoiceTable, categorical, choice_table
from core.indoor.clearance import Clearance, clearance
from core.indoor.cloud import Cloud, Numbers
from core.indoor.graph import FloorGraph
from core.indoor.map_arrays import MapArrays, map_arrays
from core.indoor.walk import Walk
from core.types import Array

_NONE = np.empty(0, np.intp)


@dataclass(slots=True)
class Walkers:
    """The fields of `Cloud`, to be written to; left (N,): seconds of the step not yet walked; log: the decisions."""

    object: Numbers
    offset: Array
    direction: Array
    position: Array
    heading: Array
    speed: Array
    stopped: Array
    wait: Array
    goal: Numbers
    held: Array
    left: Array
    maps: MapArrays
    clear: Clearance
    table: ChoiceTable
    walk: Walk
    rng: np.random.Generator
    special: bool
    bounces: Numbers
    log: list[tuple[Numbers, Numbers, Numbers]] = field(default_factory=lambda: [(_NONE, _NONE, _NONE)])

    @classmethod
    def of(
        cls, c: Cloud, dt_s: float, graph: FloorGraph, walk: Walk, rng: np.random.Generator
    ) -> Self:
        """Copies of a cloud's arrays, with a whole step to go."""
        maps, N = map_arrays(graph), len(c.object)
        return cls(
            c.object.copy(), c.offset_m.copy(), c.direction.copy(), np.array(c.position_m.T, order="C").T,
            c.heading_rad.copy(), c.speed_mps.copy(), c.stopped.copy(), c.wait_s.copy(), c.goal.copy(), c.held.copy(),
            np.full(N, float(dt_s)), maps, clearance(graph), choice_table(graph, walk.rule, walk.l_max_m, walk.u_turn),
            walk, rng, bool((maps.stairs | maps.lifts).any()), np.zeros(N if len(maps.doors) else 0, np.intp),
        )

    def rate(self, i: Numbers, o: Numbers) -> Array:
        """Metres per second along the objects o of the particles i."""
        v = self.speed[i]
        if not self.special:
            return v
        v = np.where(self.maps.stairs[o], self.walk.stairs_factor * v, v)
        return np.where(self.maps.lifts[o], self.walk.lift_speed_mps, v)


def choose(w: Walkers, i: Numbers, port: Numbers) -> Numbers:
    """Draws cat(c_1, ..., c_K) of each port (k,) at which the particles i (k,) arrive; -> the ports they enter by."""
    if not i.size:
        return port
    k = categorical(w.table.cumulative[port], w.rng.random(i.size))
    new = w.table.next_port[port, k]
    w.log.append((i, port, new))
    return new
