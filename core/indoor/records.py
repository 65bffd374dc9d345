"""One node, link or area of a map file, read and checked by itself."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from core.indoor.geometry import contains, is_simple, nearest_on_border, signed_area
from core.indoor.graph import Area, Id, Link, Node
from core.types import Array

KINDS = ("corridor", "stairs", "lift")
SHORTEST_M = 1e-3                                         # a shorter link is a mistake, not a corridor
DOOR_TOLERANCE_M = 0.5                                    # how far from its area an accessor node may be drawn
_FARTHEST_M = 1e7


class Problem(Exception):
    """What is wrong with one object, as the rest of a sentence that begins with its name."""


class Consequence(Problem):
    """Wrong only because another object, named elsewhere, is wrong."""


def node(value: Any) -> Node:
    """(x, y), (x, y, floor) or {"x", "y", "floor"}.  Problem if it is neither."""
    if isinstance(value, Mapping):
        if not {"x", "y"} <= set(value):
            raise Problem(f"expected x, y and perhaps floor, got {short(dict(value))}")
        value = (value["x"], value["y"], value.get("floor", 0))
    if not _is_list(value) or len(value) not in (2, 3):
        raise Problem(f"expected (x, y) or (x, y, floor), got {short(value)}")
    x, y = _coordinates(value[:2])
    return Node(x, y, _floor(value[2]) if len(value) == 3 else 0)


def link(value: Any, nodes: Mapping[Id, Node], height: float, ids: set[Any]) -> Link:
    """(node, node) or {"nodes", "kind"}; ids of all nodes, `nodes` those without a problem.  Problem otherwise."""
    kind = None
    if isinstance(value, Mapping):
        kind, value = value.get("kind"), value.get("nodes")
    if not _is_list(value) or len(value) != 2:
        raise Problem(f"expected two node ids, got {short(value)}")
    a, b = (_known(n, ids) for n in value)
    if a == b:
        raise Problem(f"expected two different nodes, got {a!r} twice")
    if a not in nodes or b not in nodes:
        raise Consequence
    p, q = nodes[a], nodes[b]
    rise = p.floor != q.floor
    plan = float(np.hypot(p.x_m - q.x_m, p.y_m - q.y_m))
    if kind is None:
        kind = "corridor" if not rise else "lift" if plan < SHORTEST_M else "stairs"
    if kind not in KINDS:
        raise Problem(f"expected a kind out of {', '.join(KINDS)}, got {kind!r}")
    if rise and kind == "corridor":
        raise Problem(f"expected the kind stairs or lift between floors {p.floor} and {q.floor}, got 'corridor'")
    if kind == "lift" and not rise:
        raise Problem(f"expected a lift to join different floors, got floor {p.floor} at both ends")
    length = float(np.sqrt(plan**2 + (height * (p.floor - q.floor)) ** 2))
    if length < SHORTEST_M:
        raise Problem(f"expected a length of at least {SHORTEST_M:g} m, but {a!r} and {b!r} both lie at "
                      f"({p.x_m:g}, {p.y_m:g}) on floor {p.floor}; make them one node")
    return Link((a, b), kind, length)


def area(value: Any, nodes: Mapping[Id, Node], width: float, ids: set[Any]) -> Area:
    """(polygon, accessor nodes) or a mapping; width_m of a corridor unless it has its own.  Problem otherwise."""
    extra: Mapping[str, Any] = {}
    if isinstance(value, Mapping):
        extra, value = value, (value.get("polygon"), value.get("accessor_nodes", ()))
    if not _is_list(value) or len(value) != 2:
        raise Problem(f"expected (polygon, accessor nodes), got {short(value)}")
    polygon, doors = _polygon(value[0]), value[1]
    if not _is_list(doors):
        raise Problem(f"expected a list of accessor node ids, got {short(doors)}")
    doors = tuple(_known(n, ids) for n in doors)
    if len(set(doors)) < len(doors):
        raise Problem(f"expected accessor nodes that differ, got {next(n for n in doors if doors.count(n) > 1)!r} "
                       f"twice")
    if any(n not in nodes for n in doors):
        raise Consequence
    floors = {nodes[n].floor for n in doors}
    floor = _floor(extra["floor"]) if "floor" in extra else min(floors, default=0)
    for n in doors:
        if nodes[n].floor != floor:
            raise Problem(f"expected accessor nodes on floor {floor}, got {n!r} on floor {nodes[n].floor}")
        p = np.array(nodes[n][:2])
        far = 0.0 if contains(polygon, p) else float(nearest_on_border(polygon, p).distance)
        if far > DOOR_TOLERANCE_M:
            raise Problem(f"expected accessor node {n!r} on the border or inside, to {DOOR_TOLERANCE_M:g} m, got "
                          f"({p[0]:g}, {p[1]:g}), {far:.3g} m outside")
    m2 = signed_area(polygon)
    own = either(extra, "corridor_width")
    length = either(extra, "equivalent_length")
    if own is not None:
        width = positive("corridor width", own)
    return Area(polygon, doors, floor, m2, m2 / width if length is None else positive("equivalent length", length))


def _polygon(value: Any) -> Array:
    if not _is_list(value) or len(value) < 3 or not all(_is_list(c) and len(c) == 2 for c in value):
        raise Problem(f"expected a polygon of at least 3 corners (x, y), got {short(value)}")
    P = np.array([_coordinates(c) for c in value])
    if (P[0] == P[-1]).all() and len(P) > 3:
        P = P[:-1]                                        # written as a closed ring
    simple, why = is_simple(P)
    if not simple:
        raise Problem(f"expected a border that does not touch or cross itself, but {why}")
    m2 = signed_area(P)
    if abs(m2) < SHORTEST_M**2:
        raise Problem(f"expected corners that enclose an area, got {abs(m2):.3g} m^2")
    P = np.ascontiguousarray(P if m2 > 0.0 else P[::-1])
    P.setflags(write=False)
    return P


def _known(n: Any, ids: set[Any]) -> Id:
    """n, if it is the id of a node (perhaps of one that is wrong itself)."""
    if isinstance(n, bool) or not isinstance(n, str | int) or n not in ids:
        raise Problem(f"expected the id of a node, got {n!r}, which is not among the nodes")
    return n


def either(d: Mapping[str, Any], name: str) -> Any:
    """d[name_m], or d[name] where the unit is left out."""
    return d.get(f"{name}_m", d.get(name))


def positive(name: str, value: Any) -> float:
    """value as a length in metres; Problem unless it is positive and within reason."""
    number = _number(value)
    if not SHORTEST_M <= number <= _FARTHEST_M:
        raise Problem(f"expected a {name.replace('_', ' ')} of at least {SHORTEST_M:g} m, got {number:g}")
    return number


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise Problem(f"expected numbers, got {short(value)}")
    if not np.isfinite(value):
        raise Problem(f"expected finite numbers, got {value}")
    return float(value)


def _coordinates(pair: Any) -> tuple[float, float]:
    x, y = (_number(v) for v in pair)
    if max(abs(x), abs(y)) > _FARTHEST_M:
        raise Problem(f"expected coordinates in metres near a local origin, got ({x:g}, {y:g})")
    return x, y


def _floor(value: Any) -> int:
    number = _number(value)
    if number != int(number):
        raise Problem(f"expected a whole number as its floor, got {number:g}")
    return int(number)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray)


def short(value: Any) -> str:
    """value as text for a message, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
