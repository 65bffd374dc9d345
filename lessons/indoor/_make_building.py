"""Writes building.json: the building of our own making in which all indoor lessons play.

    python -m lessons.indoor._make_building

Two floors of 108 m x 46 m: on each a rectangular loop of corridors with rooms along it; on floor 0 an L-shaped lobby
and a cafeteria inside the loop and a yard outside; on floor 1 an auditorium and a library.  Two stairs and a lift.
Only the transmitters are random: their places, powers and exponents vary a little, with a fixed seed.
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from core.types import Array

SEED = 2015
FILE = Path(__file__).with_name("building.json")
FLOOR_HEIGHT_M, CORRIDOR_M, DOOR_M = 4.0, 2.5, 1.4
STEP, COLUMNS = 6.0, 17                             # of the loop's long sides
LEFT, RIGHT, SOUTH, NORTH = 6.0, 102.0, 8.0, 38.0   # centre lines of the loop
SIDE = (15.5, 23.0, 30.5)                           # nodes of its short sides
OUTSIDE = (0.0, 108.0, 0.0, 46.0)                   # outer walls: x, x, y, y
ROOMS = {0: {"S": (*range(1, 8), *range(9, 16)), "N": tuple(range(1, 16))},
         1: {"S": tuple(range(1, 16)), "N": tuple(range(1, 16))}}
AREAS: dict[str, tuple[int, list[tuple[float, float]]]] = {
    "lobby": (0, [(20, 11), (64, 11), (64, 21), (42, 21), (42, 35), (20, 35)]),
    "cafeteria": (0, [(70, 24), (96, 24), (96, 35), (70, 35)]),
    "yard": (0, [(-10, -20), (120, -20), (120, 34), (112, 34), (112, -4), (-10, -4)]),
    "auditorium": (1, [(14, 13), (36, 13), (36, 33), (14, 33)]),
    "library": (1, [(62, 11), (90, 11), (97, 18), (97, 35), (62, 35)]),
}
DOORS = {  # accessor node: area, place, the corridor node that its link leads to (None: the area alone has it)
    "lobby_south": ("lobby", (54, 11), "0S8"), "lobby_north": ("lobby", (30, 35), "0N4"),
    "lobby_west": ("lobby", (20, 23), "0W2"), "lobby_east": ("lobby", (64, 15.5), "0E1"),
    "cafe_north": ("cafeteria", (84, 35), "0N13"), "cafe_east": ("cafeteria", (96, 30.5), "0E3"),
    "entrance": ("yard", (54, -4), "0S8"), "east_door": ("yard", (112, 23), "0E2"),
    "gate": ("yard", (-7, -16), None), "bus_stop": ("yard", (117, -16), None),
    "aud_west": ("auditorium", (14, 23), "1W2"), "aud_north": ("auditorium", (24, 33), "1N3"),
    "lib_south": ("library", (72, 11), "1S11"), "lib_east": ("library", (97, 23), "1E2"),
    "lib_north": ("library", (84, 35), "1N13"),
}
UPRIGHT = {  # node: place, floor, the corridor node beside it
    "stairs_a0": ((2, 40), 0, "0N0"), "stairs_a1": ((2, 31), 1, "1W3"),
    "stairs_b0": ((106, 5), 0, "0S16"), "stairs_b1": ((106, 14), 1, "1E1"),
    "lift0": ((105.5, 38), 0, "0N16"), "lift1": ((105.5, 38), 1, "1N16"),
}
ROUTES = {
    "corridors": ["0roomS1", "0roomS12", "0roomN14", "0roomN3"],
    "hall": ["0roomS3", "lobby_west", "lobby_east", "cafe_north", "0roomN5"],
    "outdoors": ["0roomS5", "entrance", "bus_stop", "east_door", "0roomS14"],
    "floors": ["0roomN5", "stairs_a1", "1roomS9", "lib_south", "lib_north", "lift1", "0roomN12"],
}
WLAN = {"power_dbm": (-40.0, 2.0), "exponent": (2.8, 0.15), "sigma_db": 6.0}      # mean, standard deviation
BLE = {"power_dbm": (-66.0, 2.0), "exponent": (2.2, 0.1), "sigma_db": 5.0}


def building() -> dict[str, Any]:
    """The whole file as plain lists and numbers."""
    nodes: dict[str, list[float]] = {}
    links: dict[str, Any] = {}
    for f in (0, 1):
        _loop(f, nodes, links)
    for name, (area, (x, y), beside) in DOORS.items():
        nodes[name] = [x, y, AREAS[area][0]]
        if beside:
            links[f"to_{name}"] = [beside, name]
    for name, ((x, y), floor, beside) in UPRIGHT.items():
        nodes[name] = [x, y, floor]
        links[f"to_{name}"] = [beside, name]
    links |= {"stairs_a": {"nodes": ["stairs_a0", "stairs_a1"], "kind": "stairs"},
              "stairs_b": {"nodes": ["stairs_b0", "stairs_b1"], "kind": "stairs"},
              "lift": {"nodes": ["lift0", "lift1"], "kind": "lift"}}
    areas = {name: {"polygon": [list(p) for p in polygon], "floor": floor,
                    "accessor_nodes": [d for d, (area, *_) in DOORS.items() if area == name]}
             for name, (floor, polygon) in AREAS.items()}
    rng = np.random.default_rng(SEED)
    return {
        "name": "Paikka house", "corridor_width_m": CORRIDOR_M, "floor_height_m": FLOOR_HEIGHT_M,
        "nodes": nodes, "links": links, "areas": areas, "routes": ROUTES,
        "walls": {str(f): _walls(f, nodes, links).round(2).tolist() for f in (0, 1)},
        "wlan": _transmitters("ap", {0: (5, 3), 1: (5, 2)}, WLAN, rng),
        "ble": _transmitters("beacon", {0: (7, 3), 1: (7, 3)}, BLE, rng, extra=-2),
    }


def _loop(f: int, nodes: dict[str, list[float]], links: dict[str, Any]) -> None:
    """The corridors of one floor and the rooms along its long sides."""
    for k in range(COLUMNS):
        for side, y in (("S", SOUTH), ("N", NORTH)):
            nodes[f"{f}{side}{k}"] = [LEFT + STEP * k, y, f]
            if k:
                links[f"{f}corr{side}{k}"] = [f"{f}{side}{k - 1}", f"{f}{side}{k}"]
    last = COLUMNS - 1
    for side, x, first, end in (("W", LEFT, f"{f}S0", f"{f}N0"), ("E", RIGHT, f"{f}S{last}", f"{f}N{last}")):
        names = [f"{f}{side}{k}" for k in range(1, len(SIDE) + 1)]
        for name, y in zip(names, SIDE, strict=True):
            nodes[name] = [x, y, f]
        for k, (a, b) in enumerate(zip([first, *names], [*names, end], strict=True), 1):
            links[f"{f}corr{side}{k}"] = [a, b]
    for side, columns in ROOMS[f].items():
        for k in columns:
            nodes[f"{f}room{side}{k}"] = [LEFT + STEP * k, 3.0 if side == "S" else NORTH + 5.0, f]
            links[f"{f}door{side}{k}"] = [f"{f}{side}{k}", f"{f}room{side}{k}"]


def _walls(f: int, nodes: dict[str, list[float]], links: dict[str, Any]) -> Array:
    """Segments (n, 2, 2): outer walls, both sides of the loop, room partitions, areas; open where links pass."""
    half = CORRIDOR_M / 2
    x0, x1, y0, y1 = OUTSIDE
    rings = [[(x0, y0), (x1, y0), (x1, y1), (x0, y1)],
             [(x, y) for x, y in _ring(LEFT - half, RIGHT + half, SOUTH - half, NORTH + half)],
             [(x, y) for x, y in _ring(LEFT + half, RIGHT - half, SOUTH + half, NORTH - half)],
             *([p for p in polygon] for name, (floor, polygon) in AREAS.items() if floor == f and name != "yard")]
    walls = [(ring[k], ring[(k + 1) % len(ring)]) for ring in rings for k in range(len(ring))]
    for side, wall, end in (("S", SOUTH - half, y0), ("N", NORTH + half, y1)):
        doors = [LEFT + STEP * k for k in ROOMS[f][side]]
        walls += [((x, wall), (x, end)) for x in [doors[0] - 3.0, *((a + b) / 2 for a, b in pairwise(doors)),
                                                  doors[-1] + 3.0]]
    passages = []
    for link in links.values():
        a, b = (nodes[n] for n in (link["nodes"] if isinstance(link, dict) else link))
        if a[2] == b[2] == f:
            passages.append((a[:2], b[:2]))
    return np.array([piece for wall in walls for piece in _opened(np.array(wall, float), passages)])


def _ring(x0: float, x1: float, y0: float, y1: float) -> list[tuple[float, float]]:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def _opened(wall: Array, passages: list[tuple[list[float], list[float]]]) -> list[Array]:
    """The wall without doors of width DOOR_M where passages cross or end at it."""
    a, b = wall
    length = float(np.hypot(*(b - a)))
    u = (b - a) / length
    normal = np.array([-u[1], u[0]])
    cuts = []
    for p, q in passages:
        hp, hq = ((np.array(v) - a) @ normal for v in (p, q))
        if hp * hq > 1e-9 or abs(hp - hq) < 1e-9:      # both on one side, or along the wall
            continue
        along = float((np.array(p) + hp / (hp - hq) * (np.array(q) - np.array(p)) - a) @ u)
        if -1e-9 < along < length + 1e-9:
            cuts.append((along - DOOR_M / 2, along + DOOR_M / 2))
    pieces, at = [], 0.0
    for low, high in sorted(cuts):
        if low > at:
            pieces.append((at, low))
        at = max(at, high)
    if at < length:
        pieces.append((at, length))
    return [np.array([a + s * u, a + t * u]) for s, t in pieces]


def _transmitters(prefix: str, grid: dict[int, tuple[int, int]], kind: dict[str, Any], rng: np.random.Generator,
                  extra: int = 0) -> list[dict[str, Any]]:
    """About a jittered grid of nx by ny on each floor; `extra` < 0 leaves the last ones out."""
    x0, x1, y0, y1 = OUTSIDE
    places = []
    for f, (nx, ny) in grid.items():
        dx, dy = (x1 - x0) / nx, (y1 - y0) / ny
        places += [(x0 + dx * (i + 0.5) + rng.uniform(-0.25, 0.25) * dx,
                    y0 + dy * (j + 0.5) + rng.uniform(-0.25, 0.25) * dy, f) for j in range(ny) for i in range(nx)]
    places = places[:extra or None]
    return [{"id": f"{prefix}{k}", "x": round(float(x), 1), "y": round(float(y), 1), "floor": f,
             "power_dbm": round(float(rng.normal(*kind["power_dbm"])), 1),
             "exponent": round(float(rng.normal(*kind["exponent"])), 2), "sigma_db": kind["sigma_db"]}
            for k, (x, y, f) in enumerate(places, 1)]


def text() -> str:
    """The file: one node, link, area or transmitter a line."""
    parts = []
    for key, value in building().items():
        if isinstance(value, dict):
            rows = ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in value.items())
            parts.append(f" {json.dumps(key)}: {{\n{rows}\n }}")
        elif isinstance(value, list):
            rows = ",\n".join(f"  {json.dumps(v)}" for v in value)
            parts.append(f" {json.dumps(key)}: [\n{rows}\n ]")
        else:
            parts.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
