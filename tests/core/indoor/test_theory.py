"""The chapters behind the filter: oracle G-12, G-13, G-15, G-16, G-21 and the link chain of G-24."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.gaussian import log_density
from core.importance import importance_weights, self_normalised
from core.indoor import (
    FloorGraph,
    constrained_transition,
    disc_probability,
    floor_rate,
    link_chain,
    mixed_measure,
    office_building,
    sample_measure,
    straighten,
    time_shares,
)
from core.metrics import error_summary
from core.resampling import effective_sample_size
from core.types import Gaussian
from tests.core.indoor.maps import M0, M1, random_map
from tests.oracle import entry


def test_mass_in_a_disc():                                                               # oracle G-12
    e = entry("G-12")
    i, want = e["inputs"], e["expected"]
    m = mixed_measure(M1, i["cA"], links=("a", "b"))
    assert m.c_L == pytest.approx(i["cL"])
    p = disc_probability(M1, m, M1.nodes["n1"][:2], i["radius"])
    assert p == pytest.approx((want["P_area"], want["P_link"], want["P"]), rel=1e-9)


def test_a_mixed_measure_is_a_probability():
    g = office_building()
    m = mixed_measure(g, 0.3)
    assert sum(m.areas.values()) == pytest.approx(1.0) and sum(m.links.values()) == pytest.approx(1.0)
    whole = [disc_probability(g, m, [40, 0], 200.0, floor) for floor in (0, 1)]
    assert sum(p.P for p in whole) == pytest.approx(1.0)
    # 20,000 darts in a disc on floor 0: sd 0.0034; 4.5 sd: false alarm 7e-6
    xy, objects = sample_measure(g, m, 20_000, np.random.default_rng(1))
    on_floor = np.array([{g.nodes[n].floor for n in g.nodes_of(o)} == {0} for o in g.object_ids])[objects]
    inside = np.square(xy - [62.0, 0.0]).sum(axis=1) <= 100.0
    assert (inside & on_floor).mean() == pytest.approx(disc_probability(g, m, [62, 0], 10.0, 0).P, abs=0.0155)
    for bad in (dict(area_mass=1.5), dict(area_mass=np.nan), dict(area_mass=0.5, areas=("a",)),
                dict(area_mass=0.5, links=("H",)), dict(area_mass=0.5, areas=())):
        with pytest.raises(ValueError, match="area"):
            mixed_measure(M1, **bad)
    with pytest.raises(ValueError, match="area_mass"):
        mixed_measure(M0, 0.5)


def test_a_bent_corridor_is_straightened():
    assert straighten(M0, ("a", "b", "e", "f")).tolist() == [[0, 10], [10, 30], [30, 42], [42, 50]]
    assert straighten(M0, ("f", "e")).tolist() == [[8, 0], [20, 8]] and straighten(M0, ("d",)).tolist() == [[0, 5]]
    for bad in ((), ("a", "c"), ("a", "b", "a"), ("zz",)):
        with pytest.raises(ValueError, match="links"):
            straighten(M0, bad)
    with pytest.raises(ValueError, match="'H'"):
        straighten(M1, ("H",))


def test_importance_weights():                                                           # oracle G-13
    e = entry("G-13")
    x, want = np.array(e["inputs"]["x"]), e["expected"]
    log_pi = log_density(Gaussian(np.array([1.0]), np.eye(1)), x[:, None])
    log_q = log_density(Gaussian(np.array([0.0]), 4.0 * np.eye(1)), x[:, None])
    w_tilde = np.exp(log_pi - log_q)
    assert w_tilde == pytest.approx(want["w_tilde"], rel=1e-9)
    assert importance_weights(np.full(4, 0.25), log_pi, 0.0, log_q) == pytest.approx(want["w"], rel=1e-9)
    assert (x * w_tilde).mean() == pytest.approx(want["est_unnormalised"], rel=1e-9)
    assert self_normalised(x, log_pi - log_q).mean == pytest.approx(want["est_normalised"], rel=1e-9)
    fine = np.linspace(-5, 8, 130_001)[:, None]
    ratio = np.exp(log_density(Gaussian(np.array([1.0]), np.eye(1)), fine)
                   - log_density(Gaussian(np.array([0.0]), 4.0 * np.eye(1)), fine))
    assert ratio.max() == pytest.approx(want["max_ratio"], rel=1e-8)
    assert fine[ratio.argmax(), 0] == pytest.approx(4 / 3, abs=1e-4)


def test_effective_sample_size():                                                        # oracle G-15
    want = entry("G-15")["expected"]
    w = np.zeros(1000)
    w[:10] = 0.1
    assert effective_sample_size(w) == pytest.approx(want["ess_10_equal"])
    w[:500], w[500:] = 2.0, 1.0
    assert effective_sample_size(w) == pytest.approx(1000 * want["ess_two_level_fraction"])


def test_a_free_motion_cut_by_the_map():                                                 # oracle G-16
    e = entry("G-16")
    i, want = e["inputs"], e["expected"]
    out = constrained_transition(i["A"], i["P_beta"], np.array(i["objects"]) - 1, i["prior"])
    assert out.rows[1] == pytest.approx(want["row_from_cell2"], rel=1e-10)
    assert out.predicted_rows == pytest.approx(want["predicted_428"], rel=1e-10)
    assert out.predicted_whole == pytest.approx(want["predicted_431"], rel=1e-10)
    np.testing.assert_allclose(out.rows.sum(axis=1), 1.0)
    assert out.predicted_whole.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [
    dict(A=[[0.7, 0.3]]), dict(A=[[-0.1, 1.1], [0.2, 0.8]]), dict(objects=[0, 0, 1]), dict(objects=[0, 0, 1, 2]),
    dict(objects=[0.0, 0, 1, 1]), dict(prior=[0.0] * 4), dict(prior=[0.5, 0.5]), dict(P_beta=np.zeros((4, 4))),
    dict(P_beta=np.full((4, 4), np.nan)),
])
def test_bad_transitions(bad):
    good = dict(A=[[0.7, 0.3], [0.2, 0.8]], P_beta=np.full((4, 4), 0.25), objects=[0, 0, 1, 1], prior=[0.25] * 4)
    with pytest.raises(ValueError, match="expected"):
        constrained_transition(**{**good, **bad})


def test_error_metrics():                                                                # oracle G-21
    e = entry("G-21")
    want, s = e["expected"], error_summary(np.array(e["inputs"]["err"]))
    for name, value in zip(s._fields, s, strict=True):
        assert value == pytest.approx(want[name], abs=1e-10)
    assert floor_rate(e["inputs"]["floor_ok"], np.ones(10)) == want["floor_rate"]


@settings(deadline=None, max_examples=30)
@given(st.builds(random_map, st.integers(0, 10**6), st.integers(2, 9), st.integers(0, 4), st.just(0)))
def test_the_link_chain_is_a_markov_chain_with_its_stationary_law(graph):
    states, A = link_chain(graph)
    assert len(states) == 2 * len(graph.links) and A.min() >= 0.0
    np.testing.assert_allclose(A.sum(axis=1), 1.0)
    shares = time_shares(graph)
    assert sum(shares.values()) == pytest.approx(1.0) and min(shares.values()) >= -1e-12
    pi = np.full(len(states), 1.0 / len(states))
    average = np.zeros(len(states))
    for _ in range(4000):                                 # Cesaro mean: also for periodic chains
        pi = pi @ A
        average += pi / 4000
    time = {o: 0.0 for o in graph.links}
    for (o, _), p in zip(states, average, strict=True):
        time[o] += p * graph.length(o)
    total = sum(time.values())
    if np.linalg.matrix_rank(A - np.eye(len(A)), tol=1e-9) == len(A) - 1:
        assert shares == pytest.approx({o: v / total for o, v in time.items()}, abs=5e-3)


def test_uniform_per_metre_is_not_what_tll_gives():
    uniform = entry("G-24")["expected"]["uniform"]
    shares = time_shares(M0)
    assert {o: M0.length(o) / 70 for o in M0.links} == pytest.approx(uniform)
    assert shares["b"] > uniform["b"] and shares["d"] < uniform["d"]
    with pytest.raises(ValueError, match="'H'"):
        link_chain(M1)


def test_a_ring_has_two_classes_and_equal_shares_per_metre():
    g = FloorGraph.from_dict({"nodes": {"a": [0, 0], "b": [4, 0], "c": [0, 3]},
                              "links": {"x": ["a", "b"], "y": ["b", "c"], "z": ["c", "a"]}})
    assert time_shares(g) == pytest.approx({"x": 4 / 12, "y": 5 / 12, "z": 3 / 12})
