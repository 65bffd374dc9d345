"""Where to go on at a node: choice probabilities by total link length, or equal.  GBPF 5.1 and its notation cat(c)."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.checks import finite
from core.indoor.graph import FloorGraph, Id
from core.indoor.link_length import total_link_lengths
from core.indoor.map_arrays import map_arrays
from core.types import Array

RULES = ("tll", "equal")


class ChoiceTable(NamedTuple):
    """The categorical laws of all P ports, each with at most K alternatives.

    cumulative (P, K): c_1, c_1 + c_2, ..., with 1 from the last alternative on; next_port (P, K).  See `MapArrays`.
    """

    cumulative: Array
    next_port: NDArray[np.intp]


def choice_probabilities(
    graph: FloorGraph,
    node_id: Id,
    arrival_id: Id,
    l_max: float | None = None,
    *,
    rule: str = "tll",
    u_turn: float = 0.0,
) -> dict[Id, float]:
    """p(o) = T(o | n) / sum T(o' | n),  T = min(TLL, l_max): the next object of one who arrives at n through i.

    From a link the candidates are all other objects at n; at a dead end the link itself.  With u_turn > 0 the link
    itself has that probability and the others share the rest.  From an area the candidates are all objects at n, and
    the area itself means to stay in it.  l_max in metres, None for no cap; rule "equal": T = 1.  -> {object: p} in the
    order of the map's objects.  ValueError for unknown ids, an object that is not at the node, or bad parameters.
    GBPF 5.1 and IPIN 2014 for the principle; candidates, cap and u_turn are ours.

    >>> g = FloorGraph.from_dict({
    ...     "nodes": {"n1": [0, 0], "n2": [10, 0], "n3": [30, 0], "n4": [10, 5]},
    ...     "links": {"a": ["n1", "n2"], "b": ["n2", "n3"], "d": ["n2", "n4"]}})
    >>> choice_probabilities(g, "n2", "a"), choice_probabilities(g, "n1", "a")
    ({'b': 0.8, 'd': 0.2}, {'a': 1.0})
    """
    check_rule(rule, l_max, u_turn)
    objects = graph.objects_at(node_id)
    if arrival_id not in objects:
        graph.length(arrival_id)
        raise ValueError(f"arrival_id: expected an object at node {node_id!r}, one of {objects}, got {arrival_id!r}")
    is_link = arrival_id in graph.links
    others = [o for o in objects if o != arrival_id] if is_link else list(objects)
    if not others:
        return {arrival_id: 1.0}
    if rule == "equal":
        T = np.ones(len(others))
    else:
        tll = total_link_lengths(graph)
        T = np.minimum([tll[o, node_id] for o in others], np.inf if l_max is None else l_max)
    p = dict(zip(others, (T / T.sum()).tolist(), strict=True))
    if is_link and u_turn:
        p = {o: u_turn if o == arrival_id else (1.0 - u_turn) * p[o] for o in objects}
    return p


def trained(probabilities: Mapping[Id, float], counts: Mapping[Id, float], strength: float) -> dict[Id, float]:
    """p(o) = (kappa p_0(o) + k(o)) / (kappa + sum k): the mean of a Dirichlet law after observed turns.

    probabilities p_0 from the map alone, counts k(o) >= 0 of turns into o seen in training data, strength kappa > 0:
    how many turns the map is worth.  ValueError for a turn that the map does not have.

    >>> trained({"c": 0.4, "e": 0.6}, {"c": 3}, 5.0)
    {'c': 0.625, 'e': 0.375}
    """
    if unknown := set(counts) - set(probabilities):
        raise ValueError(f"counts: expected turns into {list(probabilities)}, got {sorted(unknown, key=str)}")
    k = {o: float(finite("counts", counts.get(o, 0.0))) for o in probabilities}
    if min(k.values()) < 0.0 or not strength > 0.0:
        raise ValueError(f"counts, strength: expected numbers >= 0 and > 0, got {dict(counts)} and {strength}")
    total = strength + sum(k.values())
    return {o: (strength * p + k[o]) / total for o, p in probabilities.items()}


def categorical(cumulative: ArrayLike, u: ArrayLike) -> NDArray[np.intp]:
    """i such that c_1 + ... + c_{i-1} <= u < c_1 + ... + c_i  (0-based): one draw of cat(c_1, ..., c_K) for each u.

    cumulative (..., K) sums, u (...) in [0, 1) -> (...).  The last sum counts as 1.

    >>> categorical([3 / 7, 1.0], [0.40, 0.43, 0.999]).tolist()
    [0, 1, 1]
    """
    c, u = np.asarray(cumulative), np.asarray(u)
    return (c[..., :-1] <= u[..., None]).sum(axis=-1)


def choice_table(graph: FloorGraph, rule: str = "tll", l_max: float | None = None, u_turn: float = 0.0) -> ChoiceTable:
    """`choice_probabilities` of every port as sums ready for drawing; computed once for each map and rule."""
    check_rule(rule, l_max, u_turn)
    return graph.cached(("choice", rule, l_max, u_turn), lambda: _table(graph, rule, l_max, u_turn))


def check_rule(rule: str, l_max: float | None, u_turn: float) -> None:
    """ValueError unless the parameters of the choice make sense."""
    if rule not in RULES:
        raise ValueError(f"rule: expected one of {', '.join(RULES)}, got {rule!r}")
    if l_max is not None and not (finite("l_max", l_max).ndim == 0 and l_max > 0.0):
        raise ValueError(f"l_max: expected a positive number of metres or None, got {l_max}")
    if not 0.0 <= u_turn < 1.0:
        raise ValueError(f"u_turn: expected a probability in [0, 1), got {u_turn}")


def _table(graph: FloorGraph, rule: str, l_max: float | None, u_turn: float) -> ChoiceTable:
    maps = map_arrays(graph)
    rows = [choice_probabilities(graph, n, o, l_max, rule=rule, u_turn=u_turn) for o, n in maps.ports]
    K = max((len(row) for row in rows), default=1)
    cumulative, next_port = np.ones((len(rows), K)), np.zeros((len(rows), K), np.intp)
    for k, (row, (_, n)) in enumerate(zip(rows, maps.ports, strict=True)):
        sums = np.cumsum(list(row.values()))
        cumulative[k, : len(row) - 1] = sums[:-1]         # the last one is 1 by definition
        next_port[k, : len(row)] = [maps.port_number[o, n] for o in row]
    return ChoiceTable(cumulative, next_port)
