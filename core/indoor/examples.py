"""Maps to try things on: the small ones of the oracle's examples, and a fictitious office building of two floors."""

from typing import Any

from core.indoor.graph import FloorGraph

_TREE_NODES = {"n1": (0, 0), "n2": (10, 0), "n3": (30, 0), "n4": (45, 0), "n5": (10, 5), "n6": (30, 12), "n7": (38, 12)}
_TREE_LINKS = {"a": ("n1", "n2"), "b": ("n2", "n3"), "c": ("n3", "n4"), "d": ("n2", "n5"), "e": ("n3", "n6"),
               "f": ("n6", "n7")}


def tree_map() -> FloorGraph:
    """Six links without a cycle, 70 m in all: a corridor a-b-c with the room d and the branch e-f."""
    return FloorGraph.from_dict({"nodes": _TREE_NODES, "links": _TREE_LINKS})


def hall_map() -> FloorGraph:
    """`tree_map` with a cycle g-h-i at n4 and a hall H of 320 m^2 at n1, 250 m in all."""
    return FloorGraph.from_dict({
        "nodes": _TREE_NODES | {"n8": (60, 0), "n9": (60, 8), "n10": (-20, 0), "n11": (-32, 0)},
        "links": _TREE_LINKS | {"g": ("n4", "n8"), "h": ("n8", "n9"), "i": ("n9", "n4"), "k": ("n10", "n11")},
        "areas": {"H": ([(-20, -8), (0, -8), (0, 8), (-20, 8)], ("n1", "n10"))},
    })


def room_corridor(length_m: float = 50.0, spacing_m: float = 5.0, room_m: float = 4.0) -> FloorGraph:
    """A straight corridor along the x axis with a room link every spacing_m, none at the ends.

    Nodes c0 .. cn along the corridor, links s1 .. sn between them, rooms r1 .. r(n-1) to the north.

    >>> g = room_corridor()
    >>> len(g.links), g.total_length_m
    (19, 86.0)
    """
    n = max(round(length_m / spacing_m), 1)
    nodes = {f"c{k}": (length_m * k / n, 0.0) for k in range(n + 1)}
    links = {f"s{k}": (f"c{k - 1}", f"c{k}") for k in range(1, n + 1)}
    for k in range(1, n):
        nodes[f"e{k}"] = (length_m * k / n, room_m)
        links[f"r{k}"] = (f"c{k}", f"e{k}")
    return FloorGraph.from_dict({"nodes": nodes, "links": links})


def office_building() -> FloorGraph:
    """Two floors of corridors and rooms with stairs and a lift; an L-shaped hall, a lounge above it, and a yard.

    60 links and 3 open areas.  Each floor has a corridor of 60 m from west (w) to east and a wing of 24 m to the north
    from its middle.  The hall is at the east end of floor 0, the yard outside leads from the hall round to the west
    door.

    >>> g = office_building()
    >>> len(g.links), len(g.areas), g.floors
    (60, 3, (0, 1))
    """
    nodes: dict[str, tuple[float, float, int]] = {}
    links: dict[str, tuple[str, str]] = {}
    for f in (0, 1):
        for k in range(11):
            nodes[f"{f}w{k}"] = (6.0 * k, 0.0, f)
        for k in range(1, 5):
            nodes[f"{f}n{k}"] = (30.0, 6.0 * k, f)
        for k in range(10):
            links[f"{f}c{k}"] = (f"{f}w{k}", f"{f}w{k + 1}")
        for k in range(1, 5):
            links[f"{f}wing{k}"] = (f"{f}w5" if k == 1 else f"{f}n{k - 1}", f"{f}n{k}")
        for k in (1, 2, 3, 4, 6, 7, 8, 9):
            nodes[f"{f}r{k}"] = (6.0 * k, -5.0 if k % 2 else 5.0, f)
            links[f"{f}room{k}"] = (f"{f}w{k}", f"{f}r{k}")
        for k in range(1, 4):
            nodes[f"{f}q{k}"] = (35.0, 6.0 * k, f)
            links[f"{f}lab{k}"] = (f"{f}n{k}", f"{f}q{k}")
            if k < 4 - f:
                nodes[f"{f}p{k}"] = (25.5, 6.0 * k, f)
                links[f"{f}store{k}"] = (f"{f}n{k}", f"{f}p{k}")
    nodes["landing"] = (-5.0, 0.0, 1)
    nodes["porch"] = (-6.0, -3.0, 0)
    nodes["hall_door"] = (72.0, -10.0, 0)
    nodes["corner"] = (84.0, 14.0, 0)
    nodes["cafe"] = (90.0, 14.0, 0)
    links |= {
        "stairs": ("0w0", "landing"), "landing_link": ("landing", "1w0"), "lift": ("0w5", "1w5"),
        "west_door": ("0w0", "porch"), "cafe_link": ("corner", "cafe"),
    }
    areas: dict[str, Any] = {
        "hall": ([(60, -10), (84, -10), (84, 16), (74, 16), (74, 4), (60, 4)], ("0w10", "hall_door", "corner")),
        "yard": ([(-12, -24), (90, -24), (90, -10), (60, -10), (60, -9), (54, -9), (54, -12), (0, -12), (0, -3),
                  (-12, -3)], ("porch", "hall_door")),
        "lounge": ([(60, -8), (74, -8), (76, 0), (74, 6), (60, 6)], ("1w10",)),
    }
    return FloorGraph.from_dict({"nodes": nodes, "links": links, "areas": areas})
