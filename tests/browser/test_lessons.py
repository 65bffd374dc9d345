"""Every lesson opens, in light and in dark, with typeset formulas and named controls; the page works on a phone."""

import numpy as np
import pytest

from app.draw.lower import lower
from app.draw.primitives import style_for
from app.theme import THEMES
from lessons.registry import Registry
from tests.browser.visit import Visit, colors

pytestmark = pytest.mark.browser

LESSONS = [entry.id for entry in Registry()]


def near_labels(visit: Visit, picture: np.ndarray) -> np.ndarray:
    """The pixels round the texts of the scene, (n, 3)."""
    view = visit.session.view
    assert view is not None
    box = visit.canvas_box()
    found = []
    for primitive in lower(view, style_for(view.camera, THEMES["light"])):
        if primitive.kind == "label" and primitive.props["text"].strip():
            x, y = (int(a - b) for a, b in zip(visit.pixel(primitive.position), (box["x"], box["y"]), strict=True))
            found.append(picture[max(y - 20, 0):y + 20, max(x - 20, 0):x + 20].reshape(-1, 3))
    return np.concatenate(found)


@pytest.mark.parametrize("lesson", LESSONS)
def test_lesson(visit: Visit, lesson: str) -> None:
    visit.open(f"lesson={lesson}", drawn=False)
    check_text(visit)
    check_names(visit)
    check_light(visit)
    visit.page.keyboard.press("t")
    visit.shows(lambda s: s.theme == "dark", "the dark theme")
    check_dark(visit)


def check_text(visit: Visit) -> None:
    """Title, typeset formulas, and nothing from another host."""
    page, words = visit.page, visit.app.registry[visit.scenario.lesson].words()
    page.locator(".pk-title", has_text=words.title).wait_for()
    formulas = page.locator(".pk svg")
    formulas.first.wait_for()
    assert formulas.count() > 5
    assert page.locator(".pk-bad").count() == 0, "every formula can be typeset"
    assert "$" not in page.locator(".pk", has=page.locator(".pk-title")).inner_text()
    size = formulas.first.bounding_box()
    assert size is not None and size["width"] > 5 and size["height"] > 5
    linked = page.evaluate("[...document.querySelectorAll('[src], [href]')].map(e => e.src || e.href)"
                           ".filter(u => typeof u === 'string')")
    assert all(link.startswith((visit.app.url, "data:", "blob:")) for link in linked), linked


def check_names(visit: Visit) -> None:
    """Every slider's accessible name is the text beside it, and they all differ."""
    entry = visit.app.registry[visit.scenario.lesson]
    visit.page.wait_for_function(
        "[...document.querySelectorAll('[role=slider]')].every(e => e.getAttribute('aria-label'))")
    names = visit.page.evaluate(
        "[...document.querySelectorAll('[role=slider]')].map(e => e.getAttribute('aria-label'))")
    shown = visit.page.evaluate("[...document.querySelectorAll('label[for]')].map(e => e.textContent)")
    unused = entry.lesson.unused_at(visit.scenario.params)
    first = next((p for p in entry.parameters.values() if p.kind in ("float", "int") and p.name not in unused), None)
    assert first is None or any(name.startswith(entry.words().label("params", first.name)) for name in names)
    assert len(set(names)) == len(names) and set(names) <= set(shown), names


def check_light(visit: Visit) -> None:
    """A white scene with things in it, and dark labels."""
    picture = visit.canvas()
    texts = near_labels(visit, picture)
    assert colors(picture) > 100 and (picture != 255).any(axis=-1).mean() > 0.01
    assert (np.median(picture.reshape(-1, 3), axis=0) > 250).all()
    assert (texts.max(axis=1) < 90).mean() > 0.005, "dark text"


def check_dark(visit: Visit) -> None:
    """A dark scene with light labels that have no boxes, and dark plots."""
    picture = visit.canvas()
    texts = near_labels(visit, picture)
    assert visit.page.evaluate("window.paikka.labels.dark && window.paikka.labels.patched > 0")
    assert colors(picture) > 100
    assert (np.median(picture.reshape(-1, 3), axis=0) < 40).all()
    assert 0.005 < (texts.min(axis=1) > 170).mean() < 0.3, "light text, and no light boxes behind it"
    background = visit.page.locator(".js-plotly-plot").first.evaluate(
        "plot => { let e = plot, c; do { c = getComputedStyle(e).backgroundColor; e = e.parentElement } "
        "while (e && c === 'rgba(0, 0, 0, 0)'); return c.match(/[0-9]+/g).slice(0, 3).map(Number) }")
    assert max(background) < 60, "plots are dark too"


@pytest.mark.parametrize("lesson, control", [("background.rotation_vector", "Angle"), ("filtering.kalman", "σ x (m)")])
def test_on_a_phone(new_visit, lesson: str, control: str) -> None:
    visit = new_visit(width=390, height=844).open(f"lesson={lesson}", drawn=False)
    before = visit.canvas()
    assert colors(before) > 100
    slider = visit.slider(control)
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    assert box is not None and 0 <= box["x"] < 390 and 422 < box["y"] < 844, "in the lower half"
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 390
    old = visit.scenario.params
    slider.press("ArrowRight")
    visit.shows(lambda s: s.params != old, "the changed control")
    assert (visit.canvas() != before).any()
    visit.page.get_by_role("button", name="Timeline and numbers").click()
    visit.page.get_by_role("button", name="step ▸▸").wait_for()
