"""The floor graph: the oracle's mixed measure, exact probabilities against darts, and what the validation says."""

from dataclasses import replace

import numpy as np
import pytest

from lessons.indoor import floor_graph as lesson
from tests.lessons.support import Desk

DESK = Desk(lesson)
MEASURE = DESK.preset("half of the mass in the areas")


def test_the_default_shows_the_whole_house():
    found = DESK.readouts()
    assert found["links"] == 161 and found["areas"] == 5 and found["link_length"] == pytest.approx(960.5, abs=0.1)
    assert {"links", "upright", "nodes", "accessors", "walls_0", "walls_1", "area_0"} <= set(DESK.items())


def test_floors_are_lifted_apart_on_demand():
    apart, together = (DESK.items(DESK.params(lift_m=v))["nodes"].positions[:, 2].max() for v in (20.0, 0.0))
    assert apart == 24.0 and together == 4.0


@pytest.mark.parametrize("mass", [0.0, 0.3, 1.0])
def test_the_disc_s_probability_agrees_with_darts(mass):
    """20,000 darts: within 4.5 standard deviations (false alarm 1e-5)."""
    p = replace(MEASURE, area_mass=mass, darts=20_000)
    found, r = DESK.readouts(p), DESK.result(p)
    share = found["p_disc"] / 100
    assert share == pytest.approx(mass * r.disc.P_area + (1 - mass) * r.disc.P_link)
    assert found["p_darts"] / 100 == pytest.approx(share, abs=4.5 * np.sqrt(share * (1 - share) / 20_000))
    assert r.on_area.mean() == pytest.approx(mass, abs=0.02)


def test_both_densities_have_their_own_unit():
    found, g = DESK.readouts(MEASURE), DESK.result(MEASURE).building.graph
    assert found["per_m"] == pytest.approx(1e6 * 0.5 / sum(link.length_m for link in g.links.values()))
    assert found["per_m2"] == pytest.approx(1e6 * 0.5 / sum(a.area_m2 for a in g.areas.values()))


def test_the_areas_part_grows_with_the_square_and_the_links_part_in_proportion():
    g = DESK.result(MEASURE).building.graph
    r = DESK.result(replace(MEASURE, disc=(30.0, 20.0))).by_radius[:8, 0]         # inside the lobby
    radii = lesson.RADII[:8]
    np.testing.assert_allclose(r, 0.5 * np.pi * radii**2 / sum(a.area_m2 for a in g.areas.values()), rtol=1e-9)
    r = DESK.result(replace(MEASURE, disc=(9.0, 8.0))).by_radius[:3, 1]           # on a corridor, far from doors
    np.testing.assert_allclose(r, 0.5 * 2 * radii[:3] / sum(link.length_m for link in g.links.values()), rtol=1e-9)


def test_presets_say_what_the_validation_says():
    moved = DESK.view(DESK.preset("move a node"))
    assert moved.note == "" and {x.name: x.value for x in moved.readouts}["verdict"] == "valid"
    door = DESK.view(DESK.preset("a door in the wrong place"))
    assert "lobby_west" in door.note and "6 m outside" in door.note
    assert "bad_area_0" in {item.name for item in door.scene} or "bad_area_1" in {item.name for item in door.scene}
    cut = DESK.view(DESK.preset("cut the stairs"))
    found = {x.name: x.value for x in cut.readouts}
    assert "expected a way to it" in cut.note and found["problems"] > 40 and found["total_length"] is None
    assert "bad_links" in {item.name for item in cut.scene}
    joined = DESK.items(DESK.preset("join two corridors"))
    assert {"new_links", "removed", "waiting"} <= set(joined)


def test_clicks_move_join_and_remove():
    view = DESK.view(DESK.params(show="edit"))
    at = {t.changes["node"][0]: t for t in view.targets}
    assert at["0S5"].changes == {"node": ("0S5",), "place": (36.0, 8.0)} and tuple(at["0S5"].position) == (36.0, 8.0)
    p = DESK.params(show="edit", action="remove")
    removal = next(t for t in DESK.view(p).targets if t.changes["removed"] == ("0corrS1",))
    assert tuple(removal.position) == (9.0, 8.0)
    p = DESK.params(show="edit", action="add", added=("0S1",))
    pairs = [t.changes["added"] for t in DESK.view(p).targets]
    assert ("0S1", "0S2") in pairs and ("0S1", "0S1") not in pairs


def test_names_that_the_map_does_not_have():
    view = DESK.view(DESK.params(show="edit", node=("nowhere",), removed=("nothing",), added=("0S1", "ghost")))
    assert "nowhere" in view.note and {x.name: x.value for x in view.readouts}["problems"] == 3


def test_only_what_the_view_needs_is_shown():
    hidden = DESK.lesson.unused_at(DESK.default)
    assert {"area_mass", "node", "removed", "place"} <= set(hidden) and "lift_m" not in hidden
    assert "place" not in DESK.lesson.unused_at(DESK.params(show="edit", node=("0S5",)))
