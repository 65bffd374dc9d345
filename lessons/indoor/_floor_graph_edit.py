"""Changes of a map, and what the validation says of them."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from core.indoor import FloorGraph


class Edit(NamedTuple):
    """The changed graph, None if it is not valid; its raw form; the problems in words, how many there are in all, and
    the ids that they name."""

    graph: FloorGraph | None
    raw: Mapping[str, Any]
    problems: tuple[str, ...]
    count: int
    named: frozenset[str]


def edited(graph: FloorGraph, node: Sequence[str], place: Sequence[float], removed: Sequence[str],
           added: Sequence[str]) -> Edit:
    """Move a node to `place`, take links away, join pairs of nodes: added[0] - added[1], added[2] - added[3], ...

    A single node left over waits for its partner.  Ids that the map does not have are problems too.
    """
    raw = graph.to_dict()
    strange = [n for n in (*node, *added) if n not in graph.nodes] + [o for o in removed if o not in graph.links]
    for n in node:
        if n in raw["nodes"]:
            raw["nodes"][n] = [*map(float, place), raw["nodes"][n][2]]
    for a in raw["areas"].values():
        a.pop("equivalent_length_m", None)            # follows the border
    raw["links"] = {o: link for o, link in raw["links"].items() if o not in removed}
    pairs = [(a, b) for a, b in zip(added[::2], added[1::2], strict=False) if a in graph.nodes and b in graph.nodes]
    for k, (a, b) in enumerate(pairs, 1):
        raw["links"][f"new{k}"] = {"nodes": [a, b]}
    problems = [f"this map has no {n!r}" for n in strange]
    made = None
    try:
        made = FloorGraph.from_dict(raw)
    except ValueError as error:
        first, *more = str(error).removeprefix("floor graph: ").split("\n- ")
        problems += more or [first]
    count = len(problems)
    if problems and (rest := re.fullmatch(r"\.\.\. and (\d+) more", problems[-1])):
        count += int(rest[1]) - 1
        problems.pop()
    named = {n for text in problems for n in re.findall(r"'([^']*)'", text.partition(":")[0])}
    return Edit(made, raw, tuple(problems), count, frozenset(named))
