"""From a plain dict to checked nodes, links and areas; every problem is named with the object that has it."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from core.indoor import records
from core.indoor.graph import Area, Id, Link, Node
from core.indoor.records import Consequence, Problem, either, positive, short

_MOST = 12
_MAP_KEYS = ("nodes", "links", "areas", "corridor_width_m", "corridor_width", "floor_height_m", "floor_height")
_AREA_KEYS = ("id", "polygon", "accessor_nodes", "floor", "corridor_width_m", "corridor_width",
              "equivalent_length_m", "equivalent_length")


class _Problems(list[str]):
    """Sentences about single objects; `stop` raises them all as one ValueError."""

    def stop(self) -> None:
        if not self:
            return
        if len(self) == 1:
            raise ValueError(f"floor graph: {self[0]}")
        more = [f"... and {len(self) - _MOST} more"] if len(self) > _MOST else []
        raise ValueError("\n- ".join([f"floor graph: {len(self)} problems", *self[:_MOST], *more]))


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
    width = _size(d, "corridor_width", 2.5, problems)
    height = _size(d, "floor_height", 4.0, problems)
    nodes: dict[Id, Node] = {}
    ids = set()                                           # also of the nodes that are wrong themselves
    for i, value in _records("nodes", "node", d, problems):
        ids.add(i)
        with _collect(problems, f"node {i!r}"):
            nodes[i] = records.node(value)
    links: dict[Id, Link] = {}
    for i, value in _records("links", "link", d, problems):
        with _collect(problems, f"link {i!r}"):
            links[i] = records.link(value, nodes, height, ids)
    areas: dict[Id, Area] = {}
    for i, value in _records("areas", "area", d, problems):
        if isinstance(value, Mapping):
            _slips(f"area {i!r}: ", value, _AREA_KEYS, problems)
        with _collect(problems, f"area {i!r}"):
            if i in links:
                raise Problem("expected an id of its own, but a link has it too")
            areas[i] = records.area(value, nodes, width, ids)
    if not links and not areas and not problems:
        problems.append("expected at least one link or area, got none")
    problems.stop()
    _check_reachable(nodes, links, areas, problems)
    problems.stop()
    return nodes, links, areas, width, height


class _collect:
    """Turns a Problem into one sentence of `problems`."""

    def __init__(self, problems: _Problems, about: str) -> None:
        self.problems, self.about = problems, about

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, Problem):
            if not isinstance(error, Consequence):
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
            problems.append(f"{key!r}: expected a mapping, or records with an 'id', got {short(missing[0])}")
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


def _size(d: Mapping[str, Any], name: str, default: float, problems: _Problems) -> float:
    value = either(d, name)
    with _collect(problems, f"{name}_m"):
        return default if value is None else positive(name, value)
    return default
