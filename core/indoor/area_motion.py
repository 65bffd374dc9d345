"""Walking in open areas: straight on, reflected at walls, deciding at accessor nodes.  GBPF 5.1; the rules are ours."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.checks import finite
from core.indoor.cloud import Numbers
from core.indoor.geometry import Border, border, exits, together
from core.indoor.walkers import Walkers, choose
from core.types import Array

MOST_REFLECTIONS = 10
_NONE = np.empty(0, np.intp)
Mask = NDArray[np.bool_]


class Reflected(NamedTuple):
    """Where a straight walk of N particles ends: position (N, 2), heading_rad (N,), reflections (N,)."""

    position: Array
    heading_rad: Array
    reflections: NDArray[np.intp]


class Walls(NamedTuple):
    """The first wall that a segment meets: fraction (M,) of the segment, infinite if none; normal (M, 2) out of it."""

    fraction: Array
    normal: Array


class Doors(NamedTuple):
    """The first door that a segment comes near: distance (M,) to walk before, infinite if none; number (M,)."""

    distance: Array
    number: Numbers


def reflect(
    polygon: ArrayLike, position: ArrayLike, heading_rad: ArrayLike, distance_m: ArrayLike, rng: "np.random.Generator"
) -> Reflected:
    """p + s [cos a, sin a], with specular reflection of the rest of the way and of the heading at every wall.

    polygon (V, 2) simple; position (N, 2) inside, heading_rad, distance_m (N,) or numbers.  After 10 reflections, as in
    a sharp corner, a particle stays at the last place with a new uniform heading (from rng).  Headings come back in
    (-pi, pi] if they were reflected.

    >>> H = [[-20, -8], [0, -8], [0, 8], [-20, 8]]
    >>> p, a, _ = reflect(H, [[-5, 6]], np.radians(60), 4.8, np.random.default_rng())
    >>> p.round(6).tolist(), np.degrees(a).round(6).tolist()
    ([[-2.6, 5.843078]], [-60.0])
    """
    edges = together([border(polygon)])
    p = finite("position", position, 2).reshape(-1, 2).copy()
    heading = finite("heading_rad", heading_rad) + np.zeros(len(p))
    left = finite("distance_m", distance_m) + np.zeros(len(p))
    count = np.zeros(len(p), np.intp)
    i = np.arange(len(p))
    while i.size:
        step = left[i, None] * _unit(heading[i])
        wall = _first_wall(edges, np.zeros(len(i), np.intp), p[i], p[i] + step)
        p[i] += np.minimum(wall.fraction, 1.0)[:, None] * step
        hit = wall.fraction <= 1.0
        left[i] *= np.where(hit, 1.0 - np.minimum(wall.fraction, 1.0), 0.0)
        i = i[hit]
        heading[i] = _mirrored(heading[i], wall.normal[hit])
        count[i] += 1
        i = _give_up(i, count, heading, rng)
    return Reflected(p, heading, count)


def across_areas(w: Walkers, i: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Walks each particle i to its next event: the end of the step, a wall, a decision or its door.

    -> the particles at their door and the ports they enter by; and those inside with time left.
    """
    if not i.size:
        return _NONE, _NONE, _NONE
    moving = w.speed[i] > 0.0
    w.left[i[~moving]] = 0.0
    i = i[moving]
    leaving = w.goal[i] >= 0
    gone = _to_door(w, i[leaving])
    on = _roam(w, i[~leaving])
    return gone, w.goal[gone], on


def _to_door(w: Walkers, i: Numbers) -> Numbers:
    """Walks straight to the door of the goal; -> those that arrive."""
    if not i.size:
        return i
    a = w.object[i] - w.maps.n_links
    j = w.maps.door[a, w.maps.port_node[w.goal[i]]]
    d = w.maps.doors[a, j] - w.position[i, :2]
    distance = np.sqrt(np.square(d).sum(axis=1))
    reach = w.speed[i] * w.left[i]
    arrives = reach >= distance
    share = np.where(arrives, 1.0, reach / np.where(arrives, 1.0, distance))
    w.position[i, :2] += share[:, None] * d
    w.heading[i] = np.arctan2(d[:, 1], d[:, 0])
    w.left[i] = np.where(arrives, w.left[i] - distance / w.speed[i], 0.0).clip(0.0)
    return i[arrives]


def _roam(w: Walkers, i: Numbers) -> Numbers:
    """One straight piece of the way; -> those that have reflected or decided and have time left."""
    if not i.size:
        return i
    a, h, r = w.object[i] - w.maps.n_links, w.heading[i], w.walk.capture_radius_m
    x, y, ux, uy = w.position[:, 0][i], w.position[:, 1][i], np.cos(h), np.sin(h)
    reach = w.speed[i] * w.left[i]
    w.position[:, 0][i] = x + reach * ux                  # right for all that are far from walls and doors
    w.position[:, 1][i] = y + reach * uy
    w.left[i] = 0.0
    by_wall, by_door = w.clear.near(a, x, y, reach, np.maximum(reach + r, 2.0 * r))
    w.held[i[~by_door]] = False                           # they are free to decide again
    near = (by_wall | by_door).nonzero()[0]
    if not near.size:
        return near
    p, u = np.stack([x[near], y[near]], axis=1), np.stack([ux[near], uy[near]], axis=1)
    return _near_walls(w, i[near], a[near], p, u, reach[near], by_wall[near], by_door[near])


def _near_walls(
    w: Walkers, i: Numbers, a: Numbers, p: Array, u: Array, reach: Array, by_wall: Mask, by_door: Mask
) -> Numbers:
    """`_roam` from p (M, 2) in the direction u (M, 2), with those walls and doors that may be near."""
    walked, hits, normal = reach.copy(), np.zeros(len(i), bool), np.zeros((len(i), 2))
    k = by_wall.nonzero()[0]
    if k.size:
        wall = _first_wall(w.maps.borders, a[k], p[k], p[k] + reach[k, None] * u[k])
        walked[k] *= np.minimum(wall.fraction, 1.0)
        hits[k], normal[k] = wall.fraction <= 1.0, wall.normal
    decides, number = np.zeros(len(i), bool), np.zeros(len(i), np.intp)
    k = by_door.nonzero()[0]
    if k.size:
        door = _first_door(w, i[k], a[k], p[k], u[k], walked[k])
        decides[k], number[k] = np.isfinite(door.distance), door.number
        walked[k] = np.minimum(walked[k], door.distance)
    hits &= ~decides
    event = (decides | hits).nonzero()[0]
    j = i[event]
    w.position[j, :2] = p[event] + walked[event, None] * u[event]
    w.left[j] = ((reach[event] - walked[event]) / w.speed[j]).clip(0.0)
    on = np.concatenate([_decide(w, i[decides], number[decides]), _bounce(w, i[hits], normal[hits])])
    return on[w.left[on] > 0.0]


def _decide(w: Walkers, i: Numbers, j: Numbers) -> Numbers:
    """Draws stay or the next object at door j."""
    if i.size:
        port = w.maps.area_port[w.object[i] - w.maps.n_links] + j
        new = choose(w, i, port)
        w.held[i, j] = True
        w.goal[i] = np.where(new == port, -1, new)
    return i


def _bounce(w: Walkers, i: Numbers, normal: Array) -> Numbers:
    if not i.size:
        return i
    w.heading[i] = _mirrored(w.heading[i], normal)
    w.bounces[i] += 1
    return _give_up(i, w.bounces, w.heading, w.rng)


def _give_up(i: Numbers, count: Numbers, heading: Array, rng: "np.random.Generator") -> Numbers:
    """Those of i that have not been reflected too often; the others get a new heading."""
    stuck = count[i] >= MOST_REFLECTIONS
    if stuck.any():
        heading[i[stuck]] = rng.uniform(-math.pi, math.pi, int(stuck.sum()))
        return i[~stuck]
    return i


def _first_wall(edges: Border, a: Numbers, p: Array, q: Array) -> Walls:
    """The first exit of the segments p q (M, 2) from their areas a (M,)."""
    fraction, normal = np.full(len(p), np.inf), np.zeros((len(p), 2))
    out = exits(edges, p, q, a)
    if out.segment.size:
        s, e, t = (c[np.argsort(-out.fraction, kind="stable")] for c in out)   # the nearest of several is written last
        fraction[s] = t
        normal[s] = edges.normal[e, a[s]]
    return Walls(fraction, normal)


def _first_door(w: Walkers, i: Numbers, a: Numbers, p: Array, u: Array, reach: Array) -> Doors:
    """|p + t u - door| <= r for the smallest t in [0, reach], at a door that is in sight from there and not held.

    Doors that a particle has left by 2 r are free to decide at again.
    """
    r = w.walk.capture_radius_m
    distance, number = np.full(len(i), np.inf), np.zeros(len(i), np.intp)
    cx = w.maps.doors[:, :, 0].T[:, a] - p[:, 0]          # (J, M): the long axis last
    cy = w.maps.doors[:, :, 1].T[:, a] - p[:, 1]
    squares = cx * cx + cy * cy
    held = w.held[i].T & (squares <= 4.0 * r * r)
    w.held[i] = held.T
    j, k = ((squares <= (reach + r) ** 2) & ~held).nonzero()
    if not k.size:
        return Doors(distance, number)
    x, y = cx[j, k], cy[j, k]
    along = x * u[k, 0] + y * u[k, 1]
    inside = x * x + y * y <= r * r
    room = r * r - (x * x + y * y - along * along)
    t = np.where(inside, 0.0, along - np.sqrt(np.maximum(room, 0.0)))
    meets = np.flatnonzero((inside | ((room >= 0.0) & (along > 0.0))) & (t <= reach[k]))
    k, j, t = k[meets], j[meets], t[meets]
    here = p[k] + t[:, None] * u[k]
    to_door = w.maps.doors[a[k], j] - here
    seen = np.isinf(_first_wall(w.maps.borders, a[k], here, here + (1.0 - 1e-6) * to_door).fraction)
    k, j, t = k[seen], j[seen], t[seen]
    last_first = np.argsort(-t, kind="stable")
    distance[k[last_first]], number[k[last_first]] = t[last_first], j[last_first]
    return Doors(distance, number)


def _mirrored(heading: Array, normal: Array) -> Array:
    """Heading of u - 2 (u . n) n."""
    u = _unit(heading)
    u -= 2.0 * (u * normal).sum(axis=1, keepdims=True) * normal
    return np.arctan2(u[:, 1], u[:, 0])


def _unit(heading: Array) -> Array:
    return np.stack([np.cos(heading), np.sin(heading)], axis=1)
