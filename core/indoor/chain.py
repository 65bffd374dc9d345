"""Markov chains on the map: time spent per link in the long run, and a free motion cut by the map.  GBPF 4.2, 4.4.1."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.indoor.choice import choice_probabilities
from core.indoor.graph import FloorGraph, Id
from core.types import Array


class LinkChain(NamedTuple):
    """A_ij = P(next = j | now = i) between the 2L directed links: (link, node it is left by) in `states`."""

    states: tuple[tuple[Id, Id], ...]
    A: Array


class Constrained(NamedTuple):
    """Both forms of the map-constrained prediction over K cells.

    rows (K, K): P_x(j | i) of (4.28), each row normalised; predicted_rows (K,) = prior rows; predicted_whole (K,) of
    (4.31), normalised only after averaging over the prior.
    """

    rows: Array
    predicted_rows: Array
    predicted_whole: Array


def link_chain(graph: FloorGraph, l_max: float | None = None, *, rule: str = "tll", u_turn: float = 0.0) -> LinkChain:
    """The walk from link to link as a Markov chain: at the end of a link the next one is `choice_probabilities`.

    ValueError for a map with areas, whose crossing has no fixed order.  GBPF Def 4.5, (4.8).
    """
    if graph.areas:
        raise ValueError(f"graph: expected a map of links only, got the areas {list(graph.areas)}")
    states = tuple((o, n) for o, link in graph.links.items() for n in link.nodes)
    number = {s: k for k, s in enumerate(states)}
    A = np.zeros((len(states), len(states)))
    for (o, n), i in number.items():
        for nxt, p in choice_probabilities(graph, n, o, l_max, rule=rule, u_turn=u_turn).items():
            a, b = graph.links[nxt].nodes
            A[i, number[nxt, b if n == a else a]] += p
    return LinkChain(states, A)


def time_shares(
    graph: FloorGraph, l_max: float | None = None, *, rule: str = "tll", u_turn: float = 0.0
) -> dict[Id, float]:
    """share(o) = length(o) sum pi(o, .) / sum over all links,  pi A = pi: where a walker at constant speed spends time.

    -> {link: share}, of sum 1.  The equations pi (A - I) = 0, sum pi = 1 are solved by least squares, so a periodic
    chain has its stationary law too.  ValueError as in `link_chain`.
    """
    states, A = link_chain(graph, l_max, rule=rule, u_turn=u_turn)
    K = len(states)
    pi = np.linalg.lstsq(np.vstack([A.T - np.eye(K), np.ones(K)]), np.append(np.zeros(K), 1.0), rcond=None)[0]
    time = {o: 0.0 for o in graph.links}
    for (o, _), p in zip(states, pi, strict=True):
        time[o] += float(p) * graph.length(o)
    total = sum(time.values())
    return {o: t / total for o, t in time.items()}


def constrained_transition(A: ArrayLike, P_beta: ArrayLike, objects: ArrayLike, prior: ArrayLike) -> Constrained:
    """P_x(j | i) = A_{o(i) o(j)} P_beta(j | i) / sum_k A_{o(i) o(k)} P_beta(k | i).

    A (L, L) between objects, P_beta (K, K) the free motion between cells, objects (K,) numbers 0..L-1 of the cells'
    objects, prior (K,).  Without the denominator (4.31) the map acts as a measurement: cells from which the free motion
    mostly hits walls lose weight.  ValueError for wrong shapes, negative numbers, or a cell with nowhere to go.
    GBPF (4.28)-(4.31).
    """
    A, P, prior = finite("A", A, None, None), finite("P_beta", P_beta, None, None), finite("prior", prior, None)
    o = np.asarray(objects)
    K = len(prior)
    if prior.ndim != 1 or P.shape != (K, K) or o.shape != (K,) or A.shape != (len(A), len(A)):
        raise ValueError(f"expected A (L, L), P_beta ({K}, {K}), objects ({K},), got {A.shape}, {P.shape}, {o.shape}")
    if o.dtype.kind not in "iu" or o.min() < 0 or o.max() >= len(A):
        raise ValueError(f"objects: expected numbers 0 to {len(A) - 1}, got {o}")
    if min(A.min(), P.min(), prior.min()) < 0.0 or not prior.sum() > 0.0:
        raise ValueError("A, P_beta, prior: expected numbers >= 0 and a positive prior")
    free = A[np.ix_(o, o)] * P
    total = free.sum(axis=1)
    if not (total > 0.0).all():
        raise ValueError(f"P_beta: expected every cell to have somewhere to go, got none from cell {total.argmin()}")
    prior = prior / prior.sum()
    rows = free / total[:, None]                          # (4.28)
    whole = prior @ free                                  # (4.31)
    return Constrained(rows, prior @ rows, whole / whole.sum())
