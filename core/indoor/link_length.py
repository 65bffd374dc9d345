"""Total link length: how much map lies behind a door.  GBPF 5.1; the rule for cycles is ours."""

from collections.abc import Mapping
from types import MappingProxyType

from core.indoor.graph import FloorGraph, Id


def total_link_length(graph: FloorGraph, object_id: Id, node_id: Id) -> float:
    """TLL(o | n) = sum of length(q) over all objects q that can be reached through o without passing over n.

    The object o itself counts, every object counts once, and an object that only touches n with its far end (it closes
    a cycle through n) is reached from its other end and counts in full.  Areas count with their equivalent length.
    Metres.  ValueError for unknown ids or an object that does not touch the node.

    >>> g = FloorGraph.from_dict({
    ...     "nodes": {"n1": [0, 0], "n2": [10, 0], "n3": [30, 0], "n4": [10, 5]},
    ...     "links": {"a": ["n1", "n2"], "b": ["n2", "n3"], "d": ["n2", "n4"]}})
    >>> total_link_length(g, "a", "n1"), total_link_length(g, "b", "n2")
    (35.0, 20.0)
    """
    return sum(graph.length(q) for q in objects_behind(graph, object_id, node_id))


def objects_behind(graph: FloorGraph, object_id: Id, node_id: Id) -> tuple[Id, ...]:
    """The objects whose lengths TLL(o | n) adds up, o among them, in the map's order.  Errors as there.

    >>> g = FloorGraph.from_dict({
    ...     "nodes": {"n1": [0, 0], "n2": [10, 0], "n3": [30, 0], "n4": [10, 5]},
    ...     "links": {"a": ["n1", "n2"], "b": ["n2", "n3"], "d": ["n2", "n4"]}})
    >>> objects_behind(g, "a", "n1"), objects_behind(g, "b", "n2")
    (('a', 'b', 'd'), ('b',))
    """
    if object_id not in graph.objects_at(node_id):
        graph.length(object_id)                           # an unknown id is reported as such
        raise ValueError(f"object_id: expected an object at node {node_id!r}, one of {graph.objects_at(node_id)}, "
                         f"got {object_id!r}")
    reached, stack, passed = {object_id: None}, [object_id], {node_id}
    while stack:
        for m in graph.nodes_of(stack.pop()):
            if m not in passed:
                passed.add(m)
                fresh = [q for q in graph.objects_at(m) if q not in reached]
                reached |= dict.fromkeys(fresh)
                stack += fresh
    return tuple(q for q in graph.object_ids if q in reached)


def total_link_lengths(graph: FloorGraph) -> Mapping[tuple[Id, Id], float]:
    """TLL(o | n) for every object o at every node n, by one depth-first search of the whole map.

    -> {(object, node): metres}.  Nodes and objects are the vertices of one bipartite graph; TLL(o | n) is the length
    in the part that holds o after n has been taken out.  The parts under n in the search tree whose vertices have no
    way past n (low >= order, Hopcroft & Tarjan 1973) are cut off by n; everything else hangs together.

    >>> g = FloorGraph.from_dict({"nodes": {"n": [0, 0], "m": [3, 4]}, "links": {"a": ["n", "m"]}})
    >>> dict(total_link_lengths(g))
    {('a', 'n'): 5.0, ('a', 'm'): 5.0}
    """
    return graph.cached("total_link_lengths", lambda: MappingProxyType(_search(graph)))


def _search(graph: FloorGraph) -> dict[tuple[Id, Id], float]:
    root = (graph.object_ids[0], True)                    # (id, is an object): nodes and objects may share ids
    order, low, weight, size, parent = {root: 0}, {root: 0}, {}, {}, {root: None}
    children: dict[tuple[Id, bool], list[tuple[Id, bool]]] = {}
    stack = [(root, iter(_around(graph, root)))]
    while stack:
        v, rest = stack[-1]
        for w in rest:
            if w not in order:
                order[w] = low[w] = len(order)
                parent[w] = v
                children.setdefault(v, []).append(w)
                stack.append((w, iter(_around(graph, w))))
                break
            if w != parent[v]:
                low[v] = min(low[v], order[w])
        else:
            stack.pop()
            below = children.get(v, [])
            weight[v] = (graph.length(v[0]) if v[1] else 0.0) + sum(weight[c] for c in below)
            size[v] = 1 + sum(size[c] for c in below)
            low[v] = min([low[v], *(low[c] for c in below)])
    total = graph.total_length_m
    answer = {}
    for n in graph.nodes:
        v = (n, False)
        cut_off = [c for c in children.get(v, []) if low[c] >= order[v]]
        others = total - sum(weight[c] for c in cut_off)
        for o in graph.objects_at(n):
            at = order[o, True]
            part = next((c for c in cut_off if order[c] <= at < order[c] + size[c]), None)
            answer[o, n] = others if part is None else weight[part]
    return {(o, n): answer[o, n] for o in graph.object_ids for n in graph.nodes_of(o)}


def _around(graph: FloorGraph, v: tuple[Id, bool]) -> list[tuple[Id, bool]]:
    name, is_object = v
    neighbours = graph.nodes_of(name) if is_object else graph.objects_at(name)
    return [(w, not is_object) for w in neighbours]
