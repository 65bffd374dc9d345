"""One step of the walk, for all particles at once: speed, turns, links, nodes, areas.  GBPF 5.1, details ours."""

import math
from typing import NamedTuple

import numpy as np

from core.checks import finite
from core.indoor.area_motion import across_areas
from core.indoor.cloud import Cloud, Numbers, locate
from core.indoor.graph import FloorGraph
from core.indoor.map_arrays import map_arrays
from core.indoor.walk import Walk, chance, clamped_speed
from core.indoor.walkers import Walkers, choose


class Choices(NamedTuple):
    """K decisions at nodes, in the order of time for each particle: all (K,).

    particle; arrival and next: numbers of the objects before and after the node, equal if the particle turned back or
    stayed in its area; node: number of the node in `FloorGraph.nodes`.
    """

    particle: Numbers
    arrival: Numbers
    node: Numbers
    next: Numbers


class Moved(NamedTuple):
    """The cloud after a step, and the decisions on the way."""

    cloud: Cloud
    choices: Choices


def advance(graph: FloorGraph, cloud: Cloud, dt_s: float, walk: Walk, rng: "np.random.Generator") -> Moved:
    """x_t ~ P_x(x_t | x_{t-1}): every particle walks v dt along links and across areas, choosing at the nodes.

    On a link: offset += direction v t; what is left over at the end is walked on the next object, as often as needed.
    Stops, sharp turns and the changes of speed and heading happen at the start of the step, so dt_s should be about a
    second.  No particle is lost, leaves the map or crosses a wall.  The sampler never needs the normaliser of (4.28).
    ValueError for dt_s < 0.  GBPF (4.1), (4.28); IPIN 2014 for the choice at nodes.
    """
    if not float(finite("dt_s", dt_s)) >= 0.0:
        raise ValueError(f"dt_s: expected seconds >= 0, got {dt_s}")
    maps = map_arrays(graph)
    if cloud.object.min() < 0 or cloud.object.max() >= len(maps.length) or cloud.held.shape[1] != maps.doors.shape[1]:
        raise ValueError("cloud: expected particles of this map, got object numbers or doors that it does not have")
    w = Walkers(cloud, dt_s, graph, walk, rng)
    if dt_s > 0.0:
        _vary(w, dt_s)
        _wait(w, (w.wait > 0.0).nonzero()[0])
        in_area = w.object >= maps.n_links
        links, areas = (~in_area).nonzero()[0], in_area.nonzero()[0]
        while links.size or areas.size:
            at_node, ports = _along_links(w, links)
            new = choose(w, at_node, ports)
            at_door, exits, areas = across_areas(w, areas)
            at_node, new = np.concatenate([at_node, at_door]), np.concatenate([new, exits])
            into_link = w.maps.port_object[new] < maps.n_links
            links = _enter_links(w, at_node[into_link], new[into_link])
            areas = np.concatenate([areas, _enter_areas(w, at_node[~into_link], new[~into_link])])
    floor = locate(maps, w.object, w.offset, w.position)
    moved = Cloud(w.object, w.offset, w.direction, w.position, floor, w.heading, w.speed, w.stopped, w.wait, w.goal,
                  w.held)
    return Moved(moved, _choices(w))


def _vary(w: Walkers, dt: float) -> None:
    """Speed, stops, sharp turns and headings."""
    walk, rng, N = w.walk, w.rng, len(w.object)
    w.speed = clamped_speed(w.speed, rng.standard_normal(N), dt, walk)
    if walk.stop_rate_hz or w.stopped.any():
        u = rng.random(N)
        goes = np.flatnonzero(w.stopped & (u < chance(walk.go_rate_hz, dt)))
        stops = np.flatnonzero(~w.stopped & (u < chance(walk.stop_rate_hz, dt)))
        w.stopped[goes], w.stopped[stops] = False, True
        w.speed[goes] = np.clip(rng.uniform(*walk.start_speeds_mps, goes.size), walk.v_min_mps, walk.v_max_mps)
        w.speed[w.stopped] = 0.0
    if walk.turn_rate_hz:
        turns = (rng.random(N) < chance(walk.turn_rate_hz, dt)).nonzero()[0]
        turns = turns[~w.maps.lifts[w.object[turns]]]     # nobody turns a lift round
        w.direction[turns] *= -1.0
    if len(w.maps.doors) and walk.sigma_heading_rad:
        inside = (w.object >= w.maps.n_links).nonzero()[0]
        w.heading[inside] += walk.sigma_heading_rad * math.sqrt(dt) * rng.standard_normal(inside.size)


def _wait(w: Walkers, i: Numbers) -> None:
    """Time that passes before the lift comes."""
    passed = np.minimum(w.wait[i], w.left[i])
    w.wait[i] -= passed
    w.left[i] -= passed


def _along_links(w: Walkers, i: Numbers) -> tuple[Numbers, Numbers]:
    """Walks to the end of the link or of the step; -> those that reached an end with time to spare, and its port."""
    o, x, d = w.object[i], w.offset[i], w.direction[i]
    rate, L = w.rate(i, o), w.maps.length[o]
    target = x + d * rate * w.left[i]
    w.offset[i] = np.clip(target, 0.0, L)
    over = ((target < 0.0) | (target > L)).nonzero()[0]
    done = i[over]
    to_end = np.where(d[over] > 0.0, L[over] - x[over], x[over])
    left = w.left[done] - to_end / rate[over]
    w.left[i] = 0.0
    w.left[done] = np.maximum(left, 0.0)
    return done, 2 * o[over] + (d[over] > 0.0)


def _enter_links(w: Walkers, i: Numbers, port: Numbers) -> Numbers:
    """Puts particles at the ends of links; -> those with time left."""
    o, at_far_end = w.maps.port_object[port], w.maps.port_end[port] == 1
    w.object[i], w.goal[i] = o, -1
    w.offset[i] = np.where(at_far_end, w.maps.length[o], 0.0)
    w.direction[i] = np.where(at_far_end, -1.0, 1.0)
    w.held[i] = False
    lift = i[w.maps.lifts[o]]
    if lift.size:
        w.wait[lift] = w.walk.lift_wait_s * w.rng.standard_exponential(lift.size)
        _wait(w, lift)
    return i[w.left[i] > 0.0]


def _enter_areas(w: Walkers, i: Numbers, port: Numbers) -> Numbers:
    """Puts particles at the doors of areas, facing inwards; -> those with time left."""
    if not i.size:
        return i
    o, j = w.maps.port_object[port], w.maps.port_end[port]
    a = o - w.maps.n_links
    w.object[i], w.offset[i], w.direction[i], w.goal[i] = o, 0.0, 0.0, -1
    w.position[i, :2] = w.maps.doors[a, j]
    inward = w.maps.inward[a, j]
    anywhere = np.isnan(inward)                           # a door in the middle of the area
    noise = w.walk.entry_sigma_rad * w.rng.standard_normal(i.size)
    w.heading[i] = np.where(anywhere, w.rng.uniform(-math.pi, math.pi, i.size), inward + noise)
    w.held[i] = False
    w.held[i, j] = True
    return i[w.left[i] > 0.0]


def _choices(w: Walkers) -> Choices:
    particle, port, new = (np.concatenate(column) for column in zip(*w.log, strict=True))
    return Choices(particle, w.maps.port_object[port], w.maps.port_node[port], w.maps.port_object[new])
