"""The floor graph against networkx.

A map becomes the bipartite graph of its nodes and objects: an area is one vertex joined to all its accessor nodes,
which keeps it from counting twice.  TLL(o | n) is then the length in the connected component of o after n has been
taken out.  For shortest ways areas become edges between all pairs of their accessor nodes.
"""

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.indoor import (
    link_chain,
    office_building,
    shortest_route,
    time_shares,
    total_link_length,
    total_link_lengths,
)
from core.indoor.visibility import shortest_path
from tests.core.indoor.maps import M0, M1, random_map

nx = pytest.importorskip("networkx")

maps = st.one_of(
    st.builds(random_map, st.integers(0, 10**6), st.integers(2, 12), st.integers(0, 6), st.just(0)),
    st.builds(random_map, st.integers(0, 10**6), st.integers(4, 12), st.integers(0, 4), st.integers(1, 3)),
)


def bipartite(graph):
    B = nx.Graph()
    B.add_nodes_from(("node", n) for n in graph.nodes)
    for o in graph.object_ids:
        B.add_node(("object", o), length=graph.length(o))
        B.add_edges_from((("object", o), ("node", n)) for n in graph.nodes_of(o))
    return B


def total_lengths(graph):
    B = bipartite(graph)
    for n in graph.nodes:
        without = B.subgraph(set(B) - {("node", n)})
        for o in graph.objects_at(n):
            part = nx.node_connected_component(without, ("object", o))
            yield (o, n), sum(without.nodes[v].get("length", 0.0) for v in part)


@settings(deadline=None, max_examples=50)
@given(maps)
def test_total_link_lengths_of_random_maps(graph):
    assert nx.is_connected(bipartite(graph))
    table = total_link_lengths(graph)
    for key, length in total_lengths(graph):
        assert table[key] == pytest.approx(length, rel=1e-12)
        assert total_link_length(graph, *key) == pytest.approx(length, rel=1e-12)


@pytest.mark.parametrize("graph", [M0, M1, office_building()], ids=["M0", "M1", "office"])
def test_total_link_lengths_of_the_examples(graph):
    assert total_link_lengths(graph) == pytest.approx(dict(total_lengths(graph)), rel=1e-12)


@settings(deadline=None, max_examples=40)
@given(maps)
def test_articulation_points_are_where_the_branches_differ(graph):
    """n separates the map exactly if some object at n does not reach everything."""
    cuts = {v for v in nx.articulation_points(bipartite(graph)) if v[0] == "node"}
    table, total = total_link_lengths(graph), graph.total_length_m
    for n in graph.nodes:
        whole = all(table[o, n] == pytest.approx(total, rel=1e-9) for o in graph.objects_at(n))
        assert whole == (("node", n) not in cuts)


def ways(graph):
    W = nx.MultiGraph()
    for link in graph.links.values():
        W.add_edge(*link.nodes, weight=link.length_m)
    for a in graph.areas.values():
        for n, m in combinations(a.accessor_nodes, 2):
            way = shortest_path(a.polygon, graph.nodes[n][:2], graph.nodes[m][:2])
            W.add_edge(n, m, weight=np.sqrt(np.square(np.diff(way, axis=0)).sum(axis=1)).sum())
    return W


@settings(deadline=None, max_examples=15)
@given(maps)
def test_shortest_routes(graph):
    lengths = nx.single_source_dijkstra_path_length(ways(graph), "n0")
    for n in graph.nodes:
        legs = shortest_route(graph, "n0", n)
        assert sum(leg.length_m for leg in legs) == pytest.approx(lengths[n], rel=1e-9)
        assert all(a.nodes[1] == b.nodes[0] for a, b in pairwise(legs))


def test_stationary_law_of_the_link_chain():
    """networkx's PageRank without random jumps is the stationary law."""
    states, A = link_chain(M0, u_turn=0.1)                # turning back makes the chain aperiodic
    rank = nx.pagerank(nx.DiGraph(A), alpha=1.0, tol=1e-13, max_iter=100_000)
    pi = np.array([rank[k] for k in range(len(states))])
    np.testing.assert_allclose(pi @ A, pi, atol=1e-12)
    time = {o: 0.0 for o in M0.links}
    for (o, _), p in zip(states, pi, strict=True):
        time[o] += p * M0.length(o)
    total = sum(time.values())
    assert time_shares(M0, u_turn=0.1) == pytest.approx({o: t / total for o, t in time.items()}, abs=1e-9)
