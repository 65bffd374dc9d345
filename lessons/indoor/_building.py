"""The building that the indoor lessons play in: our own, or a map that the user gives."""

import json
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from core.indoor import AccessPoints, FloorGraph, scatter
from core.indoor.validation import unique_keys
from core.types import Array
from lessons.kit import files
from lessons.kit.parameter import NAME, FileKind

OWN = Path(__file__).with_name("building.json")
TECHNOLOGIES = ("wlan", "ble")
SPARE = {"wlan": (25, -40.0, 2.8, 6.0), "ble": (40, -66.0, 2.2, 5.0)}   # number, power, exponent, sigma
MAX_OBJECTS, MAX_TRANSMITTERS = 2000, 500


class Building(NamedTuple):
    """name; graph; walls: floor -> segments (n, 2, 2); transmitters: technology -> access points, and their names.

    routes: name -> ids of the nodes to walk through.  placed: the technologies whose transmitters the file left out
    and that were therefore spread over the map with a fixed seed.
    """

    name: str
    graph: FloorGraph
    walls: Mapping[int, Array]
    transmitters: Mapping[str, AccessPoints]
    transmitter_names: Mapping[str, tuple[str, ...]]
    routes: Mapping[str, tuple[str, ...]]
    placed: tuple[str, ...]


def building(key: str = "") -> Building:
    """The building of a file in `lessons.kit.files`, or our own for "".  LookupError when the file is not here."""
    return _ours() if key == "" else _read(files.get(key).content)


def parse(content: bytes) -> Building:
    """A building from JSON: what `FloorGraph.from_dict` reads, and perhaps name, walls, wlan, ble, routes.

    ValueError that names the line, or the object, and says what was expected.
    """
    try:
        d = json.loads(content.decode("utf-8"), object_pairs_hook=unique_keys)
    except UnicodeDecodeError as error:
        raise ValueError(f"expected JSON in UTF-8, got the byte {content[error.start]:#04x} at {error.start}") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno}: expected JSON, but {error.msg.lower()}") from None
    except RecursionError:
        raise ValueError("expected a map, got brackets within brackets without end") from None
    if not isinstance(d, dict):
        raise ValueError(f"expected a JSON object with nodes, links and areas, got {type(d).__name__}")
    graph = FloorGraph.from_dict(d)
    if len(graph.object_ids) > MAX_OBJECTS:
        raise ValueError(f"expected at most {MAX_OBJECTS} links and areas, got {len(graph.object_ids)}")
    odd = [i for i in (*graph.nodes, *graph.object_ids) if not isinstance(i, str) or not NAME.fullmatch(i)]
    if odd:
        raise ValueError(f"expected ids of at most 32 letters, digits and the signs _ . -, got {odd[0]!r}")
    heard = {kind: _transmitters(kind, d.get(kind), graph) for kind in TECHNOLOGIES}
    name = d.get("name", "the given map")
    return Building(str(name)[:60], graph, _walls(d.get("walls", {}), graph), {k: p for k, (p, _) in heard.items()},
                    {k: n for k, (_, n) in heard.items()}, _routes(d.get("routes", {}), graph),
                    tuple(k for k in TECHNOLOGIES if not d.get(k)))


MAP = FileKind("a map", (".json",), lambda content: content.lstrip()[:1] == b"{", parse)


@cache
def _ours() -> Building:
    return parse(OWN.read_bytes())


@lru_cache(maxsize=8)
def _read(content: bytes) -> Building:
    return parse(content)


def _walls(d: Any, graph: FloorGraph) -> dict[int, Array]:
    found = {f: np.zeros((0, 2, 2)) for f in graph.floors}
    if not isinstance(d, Mapping):
        raise ValueError(f"walls: expected floors with segments [[x, y], [x, y]], got {type(d).__name__}")
    for floor, segments in d.items():
        if str(floor) not in {str(f) for f in graph.floors}:
            raise ValueError(f"walls: expected one of the floors {', '.join(map(str, graph.floors))}, got {floor!r}")
        try:
            a = np.array(segments, dtype=np.float64).reshape(-1, 2, 2)
        except (TypeError, ValueError):
            raise ValueError(f"walls of floor {floor}: expected segments [[x, y], [x, y]]") from None
        if not np.isfinite(a).all():
            raise ValueError(f"walls of floor {floor}: expected finite numbers")
        found[int(floor)] = a
    return found


def _transmitters(kind: str, rows: Any, graph: FloorGraph) -> tuple[AccessPoints, tuple[str, ...]]:
    """Access points from records; spread over the map where the file has none."""
    if not rows:
        return _spread(kind, graph)
    if not isinstance(rows, list) or len(rows) > MAX_TRANSMITTERS:
        raise ValueError(f"{kind}: expected a list of at most {MAX_TRANSMITTERS} transmitters with id, x, y, floor")
    _, power, exponent, sigma = SPARE[kind]
    xy, floors, laws, names = [], [], [], []
    for k, row in enumerate(rows, 1):
        if not isinstance(row, Mapping) or not {"x", "y"} <= set(row):
            raise ValueError(f"{kind}, transmitter {k}: expected id, x, y, floor, power_dbm, exponent and sigma_db")
        name = str(row.get("id", k))[:32]
        numbers = [row["x"], row["y"], row.get("floor", 0), row.get("power_dbm", power), row.get("exponent", exponent),
                   row.get("sigma_db", sigma)]
        if any(isinstance(v, bool) or not isinstance(v, int | float) or not np.isfinite(v) for v in numbers):
            raise ValueError(f"{kind}, {name}: expected finite numbers, got {numbers}")
        if numbers[2] not in graph.floors:
            raise ValueError(f"{kind}, {name}: expected one of the floors {graph.floors}, got {numbers[2]}")
        xy.append(numbers[:2])
        floors.append(int(numbers[2]))
        laws.append(numbers[3:])
        names.append(name)
    power, exponent, sigma = np.array(laws).T
    try:
        points = AccessPoints(np.array(xy), np.array(floors), power, exponent, sigma,
                              floor_height_m=graph.floor_height_m)
    except ValueError as error:
        raise ValueError(f"{kind}: {error}") from None
    return points, tuple(names)


def _spread(kind: str, graph: FloorGraph) -> tuple[AccessPoints, tuple[str, ...]]:
    number, power, exponent, sigma = SPARE[kind]
    cloud = scatter(graph, number, np.random.default_rng([1, len(kind)]))
    points = AccessPoints(cloud.position_m[:, :2], cloud.floor, power, exponent, sigma,
                          floor_height_m=graph.floor_height_m)
    return points, tuple(f"{kind}{k}" for k in range(1, number + 1))


def _routes(d: Any, graph: FloorGraph) -> dict[str, tuple[str, ...]]:
    if not isinstance(d, Mapping):
        raise ValueError(f"routes: expected names with lists of nodes, got {type(d).__name__}")
    found = {}
    for name, nodes in d.items():
        if not isinstance(nodes, list) or len(nodes) < 2:
            raise ValueError(f"route {name!r}: expected at least two node ids")
        unknown = [n for n in nodes if n not in graph.nodes]
        if unknown:
            raise ValueError(f"route {name!r}: expected ids of nodes, got {unknown[0]!r}")
        found[str(name)] = tuple(nodes)
    return found
