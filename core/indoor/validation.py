"""From a plain dict to checked nodes, links and areas; every problem is named with the object that has it."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from core.indoor.geometry import contains, is_simple, nearest_on_border, signed_area
from core.indoor.graph import Area, Id, Link, Node
from core.types import Array

KINDS = ("corridor", "stairs", "lift")
SHORTEST_M = 1e-3                                         # a shorter link is a mistake, not a corridor
DOOR_TOLERANCE_M = 0.5                                    # how far from its area an accessor node may be drawn
_FARTHEST_M = 1e7
_MOST = 12
_MAP_KEYS = ("nodes", "links", "areas", "corridor_width_m", "corridor_width", "floor_height_m", "floor_height")
_AREA_KEYS = ("id", "polygon", "accessor_nodes", "floor", "corridor_width_m", "corridor_width",
              "equivalent_length_m", "equivalent_length")


class _Problem(Exception):
    """What is wrong with one object."""


class _Problems(list[str]):
    """Sentences about single objects; `stop` raises them all as one ValueError."""

    def stop(self) -> None:
        if not self:
            return
        shown = self[:_MOST] + ([f"... and {len(self) - _MOST} more"] if len(self) > _MOST else [])
        raise ValueError("floor graph: " + (shown[0] if len(shown) == 1 else "\n- ".join(["", *shown]).lstrip("\n")))


def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object whose keys differ.  ValueError otherwise."""
    d = dict(pairs)
    if len(d) < len(pairs):
        keys = [k for k, _ in pairs]
        twice = next(k for k in keys if keys.count(k) > 1)
        raise ValueError(f"floor graph: expected ids that differ, got {twice!r} twice")
    return d


def parsed(d: Mapping[str, Any]) -> tuple[dict[Id, Node], dict[Id, Link], dict[Id, Area], float, float]:
    """Checked records: nodes, links, areas, corridor_width_m, floor_height_m.  ValueError with all problems found."""
    if not isinstance(d, Mapping):
        raise ValueError(f"floor graph: expected a dict with nodes, links and areas, got {type(d).__name__}")
    problems = _Problems()
    _slips("", d, _MAP_KEYS, problems)
    if not isinstance(d.get("nodes", {}), Mapping | list | tuple):
        problems.append(f"'nodes': expected a mapping id -> (x, y, floor), got {type(d['nodes']).__name__}")
    width = _size(d, "corridor_width", 2.5, problems)
    height = _size(d, "floor_height", 4.0, problems)
    nodes: dict[Id, Node] = {}
    for i, value in _records("nodes", "node", d, problems):
        with _collect(problems, f"node {i!r}"):
            nodes[i] = _node(value)
    links: dict[Id, Link] = {}
    for i, value in _records("links", "link", d, problems):
        with _collect(problems, f"link {i!r}"):
            links[i] = _link(value, nodes, height, d)
    areas: dict[Id, Area] = {}
    for i, value in _records("areas", "area", d, problems):
        if isinstance(value, Mapping):
            _slips(f"area {i!r}: ", value, _AREA_KEYS, problems)
        with _collect(problems, f"area {i!r}"):
            if i in links:
                raise _Problem("expected an id of its own, but a link has it too")
            areas[i] = _area(value, nodes, width, d)
    if not links and not areas and not problems:
        problems.append("expected at least one link or area, got none")
    problems.stop()
    _check_reachable(nodes, links, areas, problems)
    problems.stop()
    return nodes, links, areas, width, height


class _collect:
    """Turns a _Problem into one sentence of `problems`."""

    def __init__(self, problems: _Problems, about: str) -> None:
        self.problems, self.about = problems, about

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, _Problem):
            self.problems.append(f"{self.about}: {error}")
            return True
        return False


def _records(key: str, what: str, d: Mapping[str, Any], problems: _Problems) -> Iterator[tuple[Id, Any]]:
    given = d.get(key, {})
    if isinstance(given, Mapping):
        pairs: Iterable[tuple[Any, Any]] = given.items()
    elif isinstance(given, list | tuple):
        missing = [r for r in given if not isinstance(r, Mapping) or "id" not in r]
        if missing:
            problems.append(f"{key!r}: expected a mapping, or records with an 'id', got {_short(missing[0])}")
        pairs = [(r["id"], r) for r in given if isinstance(r, Mapping) and "id" in r]
    else:
        problems.append(f"{key!r}: expected a mapping from ids to {what}s, got {type(given).__name__}")
        return
    seen = set()
    for i, value in pairs:
        if isinstance(i, bool) or not isinstance(i, str | int):
            problems.append(f"{what} {i!r}: expected a string or a whole number as its id")
        elif i in seen:
            problems.append(f"{what} {i!r}: expected ids that differ, got this one twice")
        else:
            seen.add(i)
            yield i, value


def _node(value: Any) -> Node:
    if isinstance(value, Mapping):
        if not {"x", "y"} <= set(value):
            raise _Problem(f"expected x, y and perhaps floor, got {_short(dict(value))}")
        value = (value["x"], value["y"], value.get("floor", 0))
    if not _is_list(value) or len(value) not in (2, 3):
        raise _Problem(f"expected (x, y) or (x, y, floor), got {_short(value)}")
    x, y = _coordinates(value[:2])
    return Node(x, y, _floor(value[2]) if len(value) == 3 else 0)


def _link(value: Any, nodes: Mapping[Id, Node], height: float, d: Mapping[str, Any]) -> Link:
    kind = None
    if isinstance(value, Mapping):
        kind, value = value.get("kind"), value.get("nodes")
    if not _is_list(value) or len(value) != 2:
        raise _Problem(f"expected two node ids, got {_short(value)}")
    a, b = (_known(n, nodes, d) for n in value)
    if a == b:
        raise _Problem(f"expected two different nodes, got {a!r} twice")
    if a not in nodes or b not in nodes:
        raise _Problem("its nodes are wrong themselves")
    p, q = nodes[a], nodes[b]
    rise = p.floor != q.floor
    plan = float(np.hypot(p.x_m - q.x_m, p.y_m - q.y_m))
    if kind is None:
        kind = "corridor" if not rise else "lift" if plan < SHORTEST_M else "stairs"
    if kind not in KINDS:
        raise _Problem(f"expected a kind out of {', '.join(KINDS)}, got {kind!r}")
    if rise and kind == "corridor":
        raise _Problem(f"expected the kind stairs or lift between floors {p.floor} and {q.floor}, got 'corridor'")
    if kind == "lift" and not rise:
        raise _Problem(f"expected a lift to join different floors, got floor {p.floor} at both ends")
    length = float(np.sqrt(plan**2 + (height * (p.floor - q.floor)) ** 2))
    if length < SHORTEST_M:
        raise _Problem(f"expected a length of at least {SHORTEST_M:g} m, but {a!r} and {b!r} both lie at "
                       f"({p.x_m:g}, {p.y_m:g}) on floor {p.floor}; make them one node")
    return Link((a, b), kind, length)


def _area(value: Any, nodes: Mapping[Id, Node], width: float, d: Mapping[str, Any]) -> Area:
    extra: Mapping[str, Any] = {}
    if isinstance(value, Mapping):
        extra, value = value, (value.get("polygon"), value.get("accessor_nodes", ()))
    if not _is_list(value) or len(value) != 2:
        raise _Problem(f"expected (polygon, accessor nodes), got {_short(value)}")
    polygon, doors = _polygon(value[0]), value[1]
    if not _is_list(doors):
        raise _Problem(f"expected a list of accessor node ids, got {_short(doors)}")
    doors = tuple(_known(n, nodes, d) for n in doors)
    if len(set(doors)) < len(doors):
        raise _Problem(f"expected accessor nodes that differ, got {next(n for n in doors if doors.count(n) > 1)!r} "
                       f"twice")
    if any(n not in nodes for n in doors):
        raise _Problem("its accessor nodes are wrong themselves")
    floors = {nodes[n].floor for n in doors}
    floor = _floor(extra["floor"]) if "floor" in extra else min(floors, default=0)
    for n in doors:
        if nodes[n].floor != floor:
            raise _Problem(f"expected accessor nodes on floor {floor}, got {n!r} on floor {nodes[n].floor}")
        p = np.array(nodes[n][:2])
        far = 0.0 if contains(polygon, p) else float(nearest_on_border(polygon, p).distance)
        if far > DOOR_TOLERANCE_M:
            raise _Problem(f"expected accessor node {n!r} on the border or inside, to {DOOR_TOLERANCE_M:g} m, got "
                           f"({p[0]:g}, {p[1]:g}), {far:.3g} m outside")
    m2 = signed_area(polygon)
    own = _either(extra, "corridor_width")
    length = _either(extra, "equivalent_length")
    if own is not None:
        width = _positive("corridor width", own)
    return Area(polygon, doors, floor, m2, m2 / width if length is None else _positive("equivalent length", length))


def _polygon(value: Any) -> Array:
    if not _is_list(value) or len(value) < 3 or not all(_is_list(c) and len(c) == 2 for c in value):
        raise _Problem(f"expected a polygon of at least 3 corners (x, y), got {_short(value)}")
    P = np.array([_coordinates(c) for c in value])
    if (P[0] == P[-1]).all() and len(P) > 3:
        P = P[:-1]                                        # written as a closed ring
    simple, why = is_simple(P)
    if not simple:
        raise _Problem(f"expected a border that does not touch or cross itself, but {why}")
    m2 = signed_area(P)
    if abs(m2) < SHORTEST_M**2:
        raise _Problem(f"expected corners that enclose an area, got {abs(m2):.3g} m^2")
    P = np.ascontiguousarray(P if m2 > 0.0 else P[::-1])
    P.setflags(write=False)
    return P


def _check_reachable(
    nodes: Mapping[Id, Node], links: Mapping[Id, Link], areas: Mapping[Id, Area], problems: _Problems
) -> None:
    at: dict[Id, list[Id]] = {n: [] for n in nodes}
    ends = {o: l.nodes for o, l in links.items()} | {o: a.accessor_nodes for o, a in areas.items()}
    for o, around in ends.items():
        for n in around:
            at[n].append(o)
    problems += [f"node {n!r}: expected a link or an area that has it, got none" for n, objects in at.items()
                 if not objects]
    first = next(iter(ends))
    seen, stack = {first}, [first]
    while stack:
        fresh = {o for n in ends[stack.pop()] for o in at[n]} - seen
        seen |= fresh
        stack += fresh
    for o in ends:
        if o not in seen:
            what = "link" if o in links else "area"
            if not ends[o]:
                problems.append(f"area {o!r}: expected accessor nodes, got none: it cannot be reached")
            else:
                problems.append(f"{what} {o!r}: expected a way to it from {first!r}, got none; join the parts of the "
                                f"map by a link")


def _slips(where: str, d: Mapping[str, Any], known: tuple[str, ...], problems: _Problems) -> None:
    from difflib import get_close_matches

    for key in d:
        if key not in known and isinstance(key, str) and (near := get_close_matches(key, known, 1, 0.8)):
            problems.append(f"{where}unknown entry {key!r}; did you mean {near[0]!r}?")


def _known(n: Any, nodes: Mapping[Id, Node], d: Mapping[str, Any]) -> Id:
    """n, if it is the id of a node (perhaps of one that is wrong itself)."""
    given = d.get("nodes", {})
    ids = given if isinstance(given, Mapping) else [r.get("id") for r in given if isinstance(r, Mapping)]
    if isinstance(n, bool) or not isinstance(n, str | int) or n not in ids:
        raise _Problem(f"expected the id of a node, got {n!r}, which is not among the nodes")
    return n


def _size(d: Mapping[str, Any], name: str, default: float, problems: _Problems) -> float:
    value = _either(d, name)
    with _collect(problems, f"{name}_m"):
        return default if value is None else _positive(name, value)
    return default


def _either(d: Mapping[str, Any], name: str) -> Any:
    return d.get(f"{name}_m", d.get(name))


def _positive(name: str, value: Any) -> float:
    number = _number(value)
    if not SHORTEST_M <= number <= _FARTHEST_M:
        raise _Problem(f"expected a {name.replace('_', ' ')} of at least {SHORTEST_M:g} m, got {number:g}")
    return number


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise _Problem(f"expected numbers, got {_short(value)}")
    if not np.isfinite(value):
        raise _Problem(f"expected finite numbers, got {value}")
    return float(value)


def _coordinates(pair: Any) -> tuple[float, float]:
    x, y = (_number(v) for v in pair)
    if max(abs(x), abs(y)) > _FARTHEST_M:
        raise _Problem(f"expected coordinates in metres near a local origin, got ({x:g}, {y:g})")
    return x, y


def _floor(value: Any) -> int:
    number = _number(value)
    if number != int(number):
        raise _Problem(f"expected a whole number as its floor, got {number:g}")
    return int(number)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
