"""Particles on the map: x = (object, place on it, direction, speed), as arrays.  GBPF (4.1), g(x, T)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.checks import finite
from core.indoor.geometry import contains
from core.indoor.graph import FloorGraph, Id
from core.indoor.map_arrays import MapArrays, map_arrays, object_numbers
from core.indoor.triangles import sample_in, triangulate
from core.indoor.walk import Walk
from core.types import Array

Numbers = NDArray[np.intp]


class Cloud(NamedTuple):
    """N particles.

    object (N,): number of the map object in `FloorGraph.object_ids`.  On a link: offset_m (N,) from its first node and
    direction (N,), +1 towards the second node or -1; in an area both are 0 and heading_rad (N,) counts, from the x axis
    counterclockwise.  position_m (N, 3) = g(x, T): x, y and the height; floor (N,), on stairs and in lifts that of the
    nearer end.  speed_mps (N,); stopped (N,) stands until it goes on; wait_s (N,) until the lift comes.  In an area:
    goal (N,) = the port by which the particle has decided to go on, -1 if none; held (N, J): accessor nodes where it
    has decided already and that it had not left when it last set out.
    """

    object: Numbers
    offset_m: Array
    direction: Array
    position_m: Array
    floor: Numbers
    heading_rad: Array
    speed_mps: Array
    stopped: NDArray[np.bool_]
    wait_s: Array
    goal: Numbers
    held: NDArray[np.bool_]


def scatter(graph: FloorGraph, N: int, rng: "np.random.Generator", walk: Walk | None = None) -> Cloud:
    """Uniform over the total length (areas by equivalent length), uniform direction, v ~ U(start speeds).

    N particles on the whole map: where a filter starts that knows nothing.  GBPF algorithm, step 1 (ours).
    """
    if N < 1:
        raise ValueError(f"N: expected a positive number of particles, got {N}")
    maps, walk = map_arrays(graph), walk or Walk()
    share = np.cumsum(maps.length)
    object = np.searchsorted(share, rng.random(N) * share[-1], side="right").clip(max=len(share) - 1)
    area = object >= maps.n_links
    offset = np.where(area, 0.0, rng.random(N) * maps.length[object])
    direction = np.where(area, 0.0, np.where(rng.random(N) < 0.5, -1.0, 1.0))
    heading = np.where(area, rng.uniform(-math.pi, math.pi, N), 0.0)
    speed = np.clip(rng.uniform(*walk.start_speeds_mps, N), walk.v_min_mps, walk.v_max_mps)
    xy = np.zeros((N, 2))
    for k, triangles in enumerate(_triangles(graph), maps.n_links):
        inside = np.flatnonzero(object == k)
        if inside.size:
            xy[inside] = sample_in(triangles, inside.size, rng)
    return _cloud(maps, object, offset, direction, xy, heading, speed)


def place(
    graph: FloorGraph,
    object_id: Id,
    N: int = 1,
    *,
    offset_m: float | Array = 0.0,
    direction: float = 1.0,
    position_m: Array | None = None,
    heading_rad: float | Array = 0.0,
    speed_mps: float | Array = 1.0,
) -> Cloud:
    """N particles on one object: on a link at offset_m, towards direction (+1 or -1); in an area at position_m.

    offset_m, heading_rad, speed_mps: a number or (N,); position_m (2,) or (N, 2) inside the area.  ValueError for a
    place that is not on the object.
    """
    maps, k = map_arrays(graph), object_numbers(graph).get(object_id, -1)
    length = graph.length(object_id)
    zero = np.zeros(N)
    speed = finite("speed_mps", speed_mps) + zero
    if speed.min(initial=0.0) < 0.0:
        raise ValueError(f"speed_mps: expected numbers >= 0, got {speed.min()}")
    objects = np.full(N, k, np.intp)
    if k < maps.n_links:
        offset = finite("offset_m", offset_m) + zero
        if direction not in (-1, 1):
            raise ValueError(f"direction: expected 1 or -1, got {direction}")
        if not (offset.min(initial=0.0) >= 0.0 and offset.max(initial=0.0) <= length):
            raise ValueError(f"offset_m: expected numbers from 0 to {length:g}, the length of {object_id!r}, got "
                             f"{offset_m}")
        return _cloud(maps, objects, offset, zero + direction, np.zeros((N, 2)), zero, speed)
    if position_m is None:
        raise ValueError(f"position_m: expected a place in the area {object_id!r}, got none")
    xy = finite("position_m", position_m, 2) + np.zeros((N, 2))
    if not contains(graph.areas[object_id].polygon, xy).all():
        raise ValueError(f"position_m: expected points in the area {object_id!r}, got {position_m}")
    return _cloud(maps, objects, zero, zero, xy, finite("heading_rad", heading_rad) + zero, speed)


def gather(cloud: Cloud, index: Numbers) -> Cloud:
    """The particles with these numbers, in this order: x^i = x^{index_i}, in new arrays."""
    position = np.empty((3, len(index)))
    for column, target in zip(cloud.position_m.T, position, strict=True):
        np.take(column, index, out=target, mode="clip")
    fields = {name: np.take(a, index, axis=0, mode="clip") for name, a in cloud._asdict().items()
              if name != "position_m"}
    return Cloud(position_m=position.T, **fields)


def put(cloud: Cloud, index: Numbers, new: Cloud) -> Cloud:
    """The cloud with the particles `index` replaced by those of `new`."""
    fields = []
    for a, b in zip(cloud, new, strict=True):
        a = a.copy(order="K")
        a[index] = b
        fields.append(a)
    return Cloud(*fields)


def directions(graph: FloorGraph, cloud: Cloud) -> Array:
    """dir(lambda): the direction in which each particle faces, (N, 2) unit vectors in the plane; 0 in a lift."""
    maps = map_arrays(graph)
    in_area = cloud.object >= maps.n_links
    u = maps.unit[cloud.object, :2] * cloud.direction[:, None]
    u /= np.maximum(np.sqrt(np.square(u).sum(axis=1, keepdims=True)), 1e-12)
    h = cloud.heading_rad
    return np.where(in_area[:, None], np.stack([np.cos(h), np.sin(h)], axis=1), u)


def locate(maps: MapArrays, object: Numbers, offset: Array, position: Array) -> Numbers:
    """g(x, T) = s_a + offset (s_b - s_a) / length for the particles on links, into position (N, 3); -> floors (N,).

    In areas x and y stay, the height is the floor's.
    """
    if maps.n_links == len(maps.length):
        for k in range(3):
            position[:, k] = maps.origin[:, k][object] + maps.unit[:, k][object] * offset
    else:
        on_link = np.flatnonzero(object < maps.n_links)
        o, s = object[on_link], offset[on_link]
        for k in range(2):
            position[on_link, k] = maps.origin[:, k][o] + maps.unit[:, k][o] * s
        position[:, 2] = maps.origin[:, 2][object] + maps.unit[:, 2][object] * offset
    floor = maps.floors[:, 0][object]
    if (maps.floors[:, 0] != maps.floors[:, 1]).any():
        floor = np.where(offset > 0.5 * maps.length[object], maps.floors[:, 1][object], floor)
    return floor


def _cloud(
    maps: MapArrays, object: Numbers, offset: Array, direction: Array, xy: Array, heading: Array, speed: Array
) -> Cloud:
    N = len(object)
    position = np.zeros((3, N)).T
    position[:, :2] = xy
    floor = locate(maps, object, offset, position)
    return Cloud(object, offset, direction, position, floor, heading, speed, np.zeros(N, bool), np.zeros(N),
                 np.full(N, -1, np.intp), np.zeros((N, maps.doors.shape[1]), bool))


def _triangles(graph: FloorGraph) -> list[Array]:
    return graph.cached("triangles", lambda: [triangulate(a.polygon) for a in graph.areas.values()])
