"""The choice at a node: the oracle's total link lengths and probabilities, and where the walkers get to."""

import numpy as np
import pytest

from lessons.indoor import link_choice as lesson
from tests.lessons.support import Desk
from tests.oracle import entry

DESK = Desk(lesson)
LAST = lesson.STEPS


@pytest.mark.parametrize("oracle, world", [("G-01", "tree"), ("G-02", "hall")])
def test_the_oracle_s_lengths_and_probabilities(oracle, world):
    expected = entry(oracle)["expected"]
    for where, law in expected["choice"].items():
        node, arrival = where.split(" from ")
        r = DESK.result(DESK.params(world=world, node=(node,), arrival=(arrival,), cap=False, walkers=100))
        assert (r.node, r.arrival, r.note) == (node, arrival, "")
        assert r.probability["tll"] == pytest.approx(law)
        for o in set(r.tll) & set(expected["TLL"].get(node, {})):
            assert r.tll[o] == pytest.approx(expected["TLL"][node][o])


def test_the_chance_to_pass_all_rooms():
    """Oracle G-05: nine doors, each passed with probability A / (A + 4), or 1/2."""
    given = entry("G-05")["expected"]
    passed = {"tll": 1.0, "equal": 1.0}
    for k, ahead in enumerate(given["A"], 1):
        r = DESK.result(DESK.params(node=(f"c{k}",), arrival=(f"s{k}",), cap=False, walkers=100))
        assert r.tll[f"s{k + 1}"] == pytest.approx(ahead) and r.tll[f"r{k}"] == pytest.approx(4.0)
        for rule, law in r.probability.items():
            passed[rule] *= law[f"s{k + 1}"]
    assert passed["tll"] == pytest.approx(given["P_tll"]) and passed["equal"] == pytest.approx(given["P_equal"])


def test_equal_choice_gets_lost_in_the_rooms():
    found = DESK.readouts(step=LAST)
    assert found["rooms_equal"] > 2 * found["rooms_tll"]
    early = DESK.readouts(step=6)
    assert early["far_tll"] > 1.3 * early["far_equal"]
    house = DESK.readouts(DESK.preset("our building"), step=20)
    assert house["rooms_tll"] < 5.0 < 20.0 < house["rooms_equal"]


def test_behind_each_way_lies_what_is_highlighted():
    r = DESK.result(DESK.preset("a tree"))
    assert r.behind == {"c": ("c",), "e": ("e", "f")}
    items = DESK.items(DESK.preset("a tree"))
    assert len(items["behind_1"].pairs) == 1 and len(items["behind_2"].pairs) == 2


def test_without_a_cap_all_big_ways_are_alike():
    p = DESK.preset("no cap at the entrance")
    r = DESK.result(p)
    law = r.probability["tll"]
    assert len(law) == 3 and max(law.values()) - min(law.values()) < 1e-9
    assert min(r.tll.values()) > 2500.0
    capped = DESK.result(DESK.preset("our building"))
    assert max(capped.capped.values()) == 100.0 < max(capped.tll.values())


def test_the_cap_matters_only_below_the_longest_way():
    r = DESK.result(DESK.preset("a tree"))
    beyond = lesson.CAPS > 20.0
    np.testing.assert_allclose(r.by_cap[beyond], np.broadcast_to(r.by_cap[-1], r.by_cap[beyond].shape))
    assert r.by_cap[0] == pytest.approx([0.5, 0.5])                    # both ways are longer than 10 m


def test_shares_of_time_add_up_and_walkers_stay_on_the_map():
    for p in (DESK.default, DESK.preset("from the hall")):
        r = DESK.result(p)
        for rule in lesson.RULES:
            np.testing.assert_allclose(r.shares[rule].sum(axis=1), 1.0)
            assert np.isfinite(r.positions[rule]).all()


def test_clicks_choose_a_node_or_the_way_one_came():
    view = DESK.view(DESK.preset("a tree"))
    changes = [t.changes for t in view.targets]
    assert {"node": ("n6",), "arrival": ()} in changes and {"node": ("n3",), "arrival": ("e",)} in changes


def test_what_the_map_does_not_have_is_replaced_and_said():
    assert "no node nowhere" in DESK.view(DESK.params(node=("nowhere",))).note
    view = DESK.view(DESK.params(world="tree", node=("n2",), arrival=("f",)))
    assert "f does not lead to n2" in view.note


def test_stages_accumulate():
    views = [DESK.view(DESK.default, 3, k) for k in range(3)]
    names = [{i.name for i in v.scene} for v in views]
    assert names[0] == names[1] < names[2] and {"way_1", "p_1"} <= names[2]
    for k, v in enumerate(views):
        assert [e.current for e in v.equations] == [k == j for j in range(3)]
