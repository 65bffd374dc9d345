"""The address bar holds the scenario: links and reloads lose nothing, and a wrong link says what is wrong."""

from urllib.parse import parse_qs, urlsplit

import pytest

from lessons.kit.lesson import Moment
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser


def query_of(visit: Visit) -> dict[str, str]:
    return {k: v[0] for k, v in parse_qs(urlsplit(visit.page.url).query).items()}


def test_link_and_reload_restore_everything(new_visit) -> None:
    first: Visit = new_visit()
    first.open("lesson=filtering.kalman", drawn=False)
    slider = first.slider("σ x (m)")
    for _ in range(3):
        slider.press("ArrowRight")
    value = slider.get_attribute("aria-valuenow")
    for key in ("Shift+N", "Shift+N", "t"):
        first.page.keyboard.press(key)
    first.shows(lambda s: s.theme == "dark" and s.moment.stage == 1, "the changes")
    first.until(lambda: query_of(first).get("theme") == "dark", "the address")
    scenario = first.scenario
    assert query_of(first) == {
        "lesson": "filtering.kalman", "sigma_x_m": value, "step": str(scenario.moment.step), "stage": "innovation",
        "theme": "dark", "fixedDpr": "1",
    }
    readouts, link = first.readouts(), first.page.url

    second: Visit = new_visit()
    second.open(urlsplit(link).query, drawn=False)
    assert second.scenario == scenario
    second.until(lambda: second.readouts() == readouts, "the same numbers")

    first.reload()
    assert first.scenario == scenario and first.page.url == link
    first.until(lambda: first.readouts() == readouts, "the same numbers after a reload")


def test_link_with_mistakes_names_them(visit: Visit) -> None:
    visit.open("lesson=filtering.kalman&nonsense=1&sigma_x_m=12abc&r_ratio=1e9&step=7", drawn=False)
    visit.until(lambda: all(word in visit.notes() for word in ("nonsense", "12abc", "r_ratio", "1e9")), "the notes")
    defaults = visit.app.registry["filtering.kalman"].lesson.Params()
    params = visit.scenario.params
    assert (params.sigma_x_m, params.r_ratio) == (defaults.sigma_x_m, 20.0), "the default, and the nearest value"
    assert visit.scenario.moment == Moment(7, 3), "what is right is kept"
    right = {"lesson": "filtering.kalman", "r_ratio": "20", "step": "7", "fixedDpr": "1"}
    visit.until(lambda: query_of(visit) == right, "an address that is right")


def test_link_to_an_unknown_lesson(visit: Visit) -> None:
    visit.open("lesson=filtering.kalmann&sigma_x_m=40", drawn=False)
    visit.until(lambda: "filtering.kalmann" in visit.notes() and "filtering.kalman" in visit.notes(), "the note")
    assert visit.scenario.lesson == visit.app.registry.first.id
    visit.page.locator(".pk-title", has_text=visit.app.registry.first.words().title).wait_for()
