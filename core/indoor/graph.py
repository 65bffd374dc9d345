"""The floor graph G = (S, O): nodes s, and map objects o, which are links or open areas.  GBPF ch. 3."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from types import MappingProxyType
from typing import Any, NamedTuple

from core.types import Array

Id = str | int


class Node(NamedTuple):
    """x_m, y_m in the building's plane, and the number of the floor."""

    x_m: float
    y_m: float
    floor: int


class Link(NamedTuple):
    """A corridor, stairs or a lift between two nodes; length_m is the straight distance, floor heights included."""

    nodes: tuple[Id, Id]
    kind: str
    length_m: float


class Area(NamedTuple):
    """An open area: polygon (V, 2) counterclockwise, in metres, read-only, with the nodes that lead into it.

    length_m = area_m2 / corridor_width_m, the length of a corridor of mean width with the same floor area.  GBPF 5.1.
    """

    polygon: Array
    accessor_nodes: tuple[Id, ...]
    floor: int
    area_m2: float
    length_m: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FloorGraph:
    """G = (S, O), O = links and open areas.  GBPF ch. 3.

    Make one with `from_dict` or `from_json`: they check everything and name the object that is wrong.  `nodes`,
    `links` and `areas` map ids to records and cannot be written to.  Objects are numbered links first, then areas,
    in the order given.

    >>> g = FloorGraph.from_dict({"nodes": {"n1": [0, 0], "n2": [15, 8]}, "links": {"a": ["n1", "n2"]}})
    >>> g.length("a"), g.objects_at("n1")
    (17.0, ('a',))
    """

    nodes: Mapping[Id, Node]
    links: Mapping[Id, Link]
    areas: Mapping[Id, Area]
    corridor_width_m: float
    floor_height_m: float
    _at: Mapping[Id, tuple[Id, ...]] = field(init=False)
    _cache: dict[Hashable, Any] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        at: dict[Id, list[Id]] = {n: [] for n in self.nodes}
        for name in ("nodes", "links", "areas"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for o in self.object_ids:
            for n in self.nodes_of(o):
                at[n].append(o)
        object.__setattr__(self, "_at", {n: tuple(objects) for n, objects in at.items()})

    def __repr__(self) -> str:
        return f"FloorGraph({len(self.nodes)} nodes, {len(self.links)} links, {len(self.areas)} areas)"

    def __reduce__(self) -> tuple[Any, ...]:              # read-only mappings cannot be pickled or copied by themselves
        return FloorGraph, (dict(self.nodes), dict(self.links), dict(self.areas), self.corridor_width_m,
                            self.floor_height_m)

    @classmethod
    def from_dict(cls, d: Mapping[str, Any]) -> "FloorGraph":
        """{"nodes": id -> (x, y, floor), "links": id -> (node, node), "areas": id -> (polygon, accessor nodes)}.

        Metres; the floor is 0 if left out.  A link may be {"nodes": [a, b], "kind": "corridor" | "stairs" | "lift"};
        without a kind, nodes of different floors are joined by a lift if they lie above each other, else by stairs.
        An area may be {"polygon": ..., "accessor_nodes": ..., "floor": ..., "corridor_width_m": ...,
        "equivalent_length_m": ...}.  Each of the three may also be a list of records with an "id".  "corridor_width_m"
        (2.5) and "floor_height_m" (4) belong to the whole map.  Other entries, such as a name, are left alone unless
        they look like a slip of the pen.

        ValueError that lists, by id, whatever is wrong: unknown nodes, links without length, borders that cross
        themselves, accessor nodes away from their area, parts that cannot be reached, ids used twice, numbers that are
        not finite.
        """
        from core.indoor.validation import parsed

        return cls(*parsed(d))

    @classmethod
    def from_json(cls, path: str | PathLike[str]) -> "FloorGraph":
        """`from_dict` of a JSON file, in which also an id used twice is an error.

        ValueError for a file that is not JSON, with the line; OSError for a file that cannot be read.
        """
        import json

        from core.indoor.validation import unique_keys

        try:
            with open(path, encoding="utf-8") as file:
                d = json.load(file, object_pairs_hook=unique_keys)
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"{path}: expected JSON in UTF-8, got {error}") from None
        return cls.from_dict(d)

    def to_dict(self) -> dict[str, Any]:
        """What `from_dict` reads: plain lists and numbers."""
        return {
            "corridor_width_m": self.corridor_width_m,
            "floor_height_m": self.floor_height_m,
            "nodes": {i: list(n) for i, n in self.nodes.items()},
            "links": {i: {"nodes": list(l.nodes), "kind": l.kind} for i, l in self.links.items()},
            "areas": {
                i: {"polygon": a.polygon.tolist(), "accessor_nodes": list(a.accessor_nodes), "floor": a.floor,
                    "equivalent_length_m": a.length_m}
                for i, a in self.areas.items()
            },
        }

    @property
    def object_ids(self) -> tuple[Id, ...]:
        """Ids of the links, then of the areas."""
        return (*self.links, *self.areas)

    @property
    def total_length_m(self) -> float:
        """sum of the lengths of all objects."""
        return sum(self.length(o) for o in self.object_ids)

    @property
    def floors(self) -> tuple[int, ...]:
        """The numbers of the floors, rising."""
        return tuple(sorted({n.floor for n in self.nodes.values()} | {a.floor for a in self.areas.values()}))

    def length(self, object_id: Id) -> float:
        """length(o) in metres: of a link its length, of an area its equivalent length."""
        return self._object(object_id).length_m

    def nodes_of(self, object_id: Id) -> tuple[Id, ...]:
        """The two ends of a link, or the accessor nodes of an area."""
        o = self._object(object_id)
        return o.nodes if isinstance(o, Link) else o.accessor_nodes

    def objects_at(self, node_id: Id) -> tuple[Id, ...]:
        """Ids of the objects that meet at a node, in the order of `object_ids`.  ValueError for an unknown node."""
        try:
            return self._at[node_id]
        except (KeyError, TypeError):
            raise ValueError(f"node_id: expected one of {_some(self.nodes)}, got {node_id!r}") from None

    def cached(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """make(), computed once for this graph and key."""
        if key not in self._cache:
            self._cache[key] = make()
        return self._cache[key]

    def _object(self, object_id: Id) -> Link | Area:
        try:
            return self.links[object_id] if object_id in self.links else self.areas[object_id]
        except (KeyError, TypeError):
            raise ValueError(f"object_id: expected one of {_some(self.object_ids)}, got {object_id!r}") from None


def _some(ids: Iterable[Id]) -> str:
    ids = [repr(i) for i in ids]
    return ", ".join(ids if len(ids) <= 8 else [*ids[:8], f"... ({len(ids)} in all)"])
