"""Particles during a step: working copies of a cloud's arrays, and the time each particle has left."""

import numpy as np

from core.indoor.choice import categorical, choice_table
from core.indoor.clearance import clearance
from core.indoor.cloud import Cloud, Numbers
from core.indoor.graph import FloorGraph
from core.indoor.map_arrays import map_arrays
from core.indoor.walk import Walk
from core.types import Array

_NONE = np.empty(0, np.intp)


class Walkers:
    """The fields of `Cloud`, copied to be written to.

    left (N,): seconds of the step not yet walked; log: the decisions, as particles and ports before and after; bounces
    (N,): reflections so far, empty on a map without areas.
    """

    def __init__(self, c: Cloud, dt_s: float, graph: FloorGraph, walk: Walk, rng: "np.random.Generator") -> None:
        N = len(c.object)
        self.object, self.offset, self.direction = c.object.copy(), c.offset_m.copy(), c.direction.copy()
        self.position = np.array(c.position_m.T, order="C").T
        self.heading, self.speed, self.stopped = c.heading_rad.copy(), c.speed_mps.copy(), c.stopped.copy()
        self.wait, self.goal, self.held = c.wait_s.copy(), c.goal.copy(), c.held.copy()
        self.left = np.full(N, float(dt_s))
        self.maps, self.clear = map_arrays(graph), clearance(graph)
        self.table = choice_table(graph, walk.rule, walk.l_max_m, walk.u_turn)
        self.walk, self.rng = walk, rng
        self.bounces = np.zeros(N if len(self.maps.doors) else 0, np.intp)
        self.log = [(_NONE, _NONE, _NONE)]

    def rate(self, i: Numbers, o: Numbers) -> Array:
        """Metres per second along the objects o of the particles i."""
        v = self.speed[i]
        if not self.maps.uneven:
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
