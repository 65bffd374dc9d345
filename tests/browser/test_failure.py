"""A lesson that fails says so in its own page, and every other page goes on."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.server import App
from lessons.registry import Registry
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser

LESSON = '''
from dataclasses import dataclass

from lessons.kit.lesson import Lesson, View
from lessons.kit.params import slider
from lessons.kit.scene import Plane, Points


@dataclass(frozen=True, slots=True)
class Params:
    size: float = slider(1.0, low=0.0, high=4.0, step=1.0)


def compute(p, progress):
    if p.size > 2:
        raise ArithmeticError("the size <b>explodes</b> beyond 2")
    return p.size


def view(p, r, at):
    return View([Points("dot", [[r, 0.0]])], Plane((-3.0, 3.0), (-3.0, 3.0)))


LESSON = Lesson(Params, compute, view)
'''
WORDS = """---
title: Fragile
params: {size: {label: Size}}
---
# Idea
It breaks.
"""


@pytest.fixture
def fragile(tmp_path: Path) -> Iterator[App]:
    folder = tmp_path / "broken"
    folder.mkdir()
    (folder / "fragile.py").write_text(LESSON)
    (folder / "fragile.en.md").write_text(WORDS)
    app = App(Registry(folder), port=0)
    yield app
    app.stop()


def test_message_in_its_panel_and_others_go_on(new_visit, fragile: App) -> None:
    good: Visit = new_visit(fragile)
    good.open("lesson=background.rotation_vector", drawn=False)
    bad: Visit = new_visit(fragile)
    bad.open("lesson=broken.fragile&size=3", drawn=False)
    message = bad.page.locator(".pk-error")
    message.wait_for()
    assert "the size <b>explodes</b> beyond 2" in message.inner_text(), "in words, as text"
    assert "broken.fragile" in message.inner_text()

    slider = good.slider("Angle")
    slider.press("ArrowRight")
    good.shows(lambda s: s.params.angle_deg == 66.0, "the other page's slider")
    good.until(lambda: "66" in good.page.locator("#pk-caption").inner_text(), "the other page's picture")
    assert good.page.locator(".pk-error:visible").count() == 0

    bad.slider("Size").press("ArrowLeft")
    bad.shows(lambda s: s.params.size == 2.0, "a value that works")
    message.wait_for(state="hidden")
    assert not bad.session.error


def test_these_tests_notice_errors_and_requests_elsewhere(visit: Visit) -> None:
    visit.open("lesson=background.rotation_vector", drawn=False)
    visit.page.evaluate("fetch('http://192.0.2.1/outside').catch(() => 0)")
    visit.page.evaluate("setTimeout(() => { throw new Error('broken') })")
    visit.until(lambda: len(visit.complaints) >= 3, "the complaints")
    assert any("http://192.0.2.1/outside" in complaint for complaint in visit.complaints)
    assert any(complaint.startswith("page error") and "broken" in complaint for complaint in visit.complaints)
    assert any("ERR_FAILED" in complaint for complaint in visit.complaints), "it was blocked"
    visit.complaints.clear()
