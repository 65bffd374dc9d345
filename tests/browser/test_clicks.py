"""Clicks into the scene and files from the disk, by a real mouse in a real page."""

import json
from pathlib import Path

import pytest

from tests.browser.visit import Visit

pytestmark = pytest.mark.browser

MAP = {"nodes": {"a": [0, 0], "b": [20, 0], "c": [20, 15]}, "links": {"ab": ["a", "b"], "bc": ["b", "c"]}}


def test_a_click_chooses_a_node(visit: Visit) -> None:
    visit.open("lesson=indoor.link_choice&world=tree")
    target = next(t for t in visit.session.view.targets if t.changes["node"] == ("n2",))  # type: ignore[union-attr]
    before = visit.canvas()
    visit.page.mouse.click(*visit.pixel(tuple(float(v) for v in target.position)))
    visit.shows(lambda s: s.params.node == ("n2",), "the node that was clicked")
    assert (visit.canvas() != before).any()
    visit.page.get_by_role("button", name="Clear").first.click()
    visit.shows(lambda s: s.params.node == (), "no chosen node")


def test_a_map_from_the_disk_and_one_that_is_none(visit: Visit, tmp_path: Path) -> None:
    good, bad = tmp_path / "hut.json", tmp_path / "bad.json"
    good.write_text(json.dumps({"name": "a hut", **MAP}), encoding="utf-8")
    bad.write_text('{"nodes": \n oops', encoding="utf-8")
    visit.open("lesson=indoor.floor_graph", drawn=False)
    for path in (good, bad):
        with visit.page.expect_file_chooser() as chooser:
            visit.page.get_by_role("button", name="Load a map").click()
        chooser.value.set_files(path)
        if path is good:
            visit.shows(lambda s: s.params.map, "the map that was loaded")
        else:
            visit.page.get_by_text("bad.json: line 2").wait_for()
    assert visit.session.view is not None and visit.session.view.caption == "a hut"
    assert "map=" in visit.page.url
