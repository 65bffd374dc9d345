"""Sliders, presets, keys and handles change the scenario, and the picture follows."""

import pytest
from playwright.sync_api import expect

from lessons.kit.lesson import Moment
from tests.browser.visit import Visit, difference


def test_slider_by_keyboard_changes_numbers_plot_and_picture(visit: Visit) -> None:
    visit.open("lesson=filtering.kalman")
    before, numbers = visit.canvas(), visit.readouts()
    plot = visit.plot()
    slider = visit.slider("σ x (m)")
    slider.focus()
    for _ in range(5):
        visit.page.keyboard.press("ArrowRight")
    value = float(slider.get_attribute("aria-valuenow") or 0)
    assert value > 30
    visit.shows(lambda s: s.params.sigma_x_m == value, "the slider's value")
    assert difference(before, visit.canvas()) > 0.002
    assert visit.readouts() != numbers
    visit.until(lambda: visit.plot() != plot, "the plot")
    assert visit.scenario.camera is None, "arrow keys on a slider leave the camera where it is"
    expect(visit.page.get_by_role("textbox", name="σ x (m)")).to_have_value(f"{value:g}")


def test_slider_by_mouse_changes_plot_and_picture(visit: Visit) -> None:
    visit.open("lesson=background.rotation_vector")
    before, plot = visit.canvas(), visit.plot()
    box = visit.slider("Angle").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    visit.drag((x, y), (x + 30, y))
    visit.shows(lambda s: s.params.angle_deg > 150, "a larger angle")
    assert difference(before, visit.canvas()) > 0.005
    visit.until(lambda: visit.plot() != plot, "the plot")


def test_preset_button(visit: Visit) -> None:
    visit.open("lesson=background.rotation_vector")
    before = visit.canvas()
    visit.page.get_by_role("button", name="a half turn").click()
    visit.shows(lambda s: s.params.angle_deg == 180.0, "the preset")
    assert difference(before, visit.canvas()) > 0.005


def test_keys(visit: Visit) -> None:
    """Steps, stages, presets, reset, theme and view from the keyboard."""
    visit.open("lesson=filtering.kalman")
    entry = visit.app.registry["filtering.kalman"]
    fresh, last = visit.scenario, len(entry.lesson.timeline_of(visit.scenario.params).stages) - 1
    step = fresh.moment.step

    def press(key: str, expected: Moment) -> None:
        visit.page.keyboard.press(key)
        visit.shows(lambda s: s.moment == expected, f"{expected} after {key}, from {visit.scenario.moment}")

    before = visit.canvas()
    press("n", Moment(step + 1, last))
    press("PageDown", Moment(step + 2, last))
    assert difference(before, visit.canvas()) > 0.001
    press("b", Moment(step + 1, last))
    press("PageUp", Moment(step, last))
    assert difference(before, visit.canvas()) < 0.0005, "the same scenario is the same picture"
    press("Shift+N", Moment(step + 1, 0))
    press("Shift+N", Moment(step + 1, 1))
    press("Shift+B", Moment(step + 1, 0))
    press("Shift+B", Moment(step, last))

    name = list(entry.lesson.presets)[2]
    visit.page.keyboard.press("3")
    wanted = {k: v for k, v in entry.lesson.presets[name].items() if k not in ("step", "stage")}
    assert wanted
    visit.shows(lambda s: all(getattr(s.params, k) == v for k, v in wanted.items()), f"preset {name}")
    visit.page.keyboard.press("r")
    visit.shows(lambda s: s == fresh, "the lesson as it opened")

    visit.page.keyboard.press("t")
    visit.shows(lambda s: s.theme == "dark", "the dark theme")
    visit.page.keyboard.press("t")
    visit.shows(lambda s: s.theme == "light", "the light theme")

    box = visit.page.locator("canvas[data-engine]").bounding_box()
    assert box is not None
    centre = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    visit.drag(centre, (centre[0] + 60, centre[1]), button="right")
    visit.shows(lambda s: s.camera is not None, "a moved camera")
    assert difference(before, visit.canvas()) > 0.01
    visit.page.keyboard.press("v")
    visit.shows(lambda s: s.camera is None, "the camera of the lesson")
    assert difference(before, visit.canvas()) < 0.0005


def test_play_and_pause(visit: Visit) -> None:
    visit.open("lesson=filtering.kalman&step=0", drawn=False)
    visit.page.keyboard.press("p")
    visit.shows(lambda s: s.moment.step >= 3, "three steps played")
    pause = visit.page.get_by_role("button", name="Pause")
    pause.wait_for()
    visit.page.keyboard.press("p")
    visit.page.get_by_role("button", name="Play").wait_for()
    assert pause.count() == 0
    step = visit.scenario.moment.step
    # a step takes a fifth of a second; one that had been asked for already may still come
    visit.page.wait_for_timeout(1000)
    assert step <= visit.scenario.moment.step <= step + 1 < 60
    visit.page.get_by_role("button", name="Play").click()
    visit.shows(lambda s: s.moment.step > step + 2, "playing on")


@pytest.mark.parametrize("lesson, point", [
    ("filtering.unscented", "mean"), ("filtering.particle_vs_ekf", "station_1"), ("background.rotation_vector", "axis"),
])
def test_handle_is_dragged(visit: Visit, lesson: str, point: str) -> None:
    visit.open(f"lesson={lesson}")
    before, old = visit.canvas(), getattr(visit.scenario.params, point)
    x, y = visit.pixel(old if len(old) == 3 else (*old, 0.0))
    visit.drag((x, y), (x + 40, y - 30))
    visit.shows(lambda s: getattr(s.params, point) != old, "a moved point")
    assert visit.scenario.camera is None, "the camera stays"
    new = getattr(visit.scenario.params, point)
    if len(old) == 2:
        assert new[0] > old[0] and new[1] > old[1], "right and up"
    else:
        assert sum(v * v for v in new) == pytest.approx(sum(v * v for v in old), rel=0.02), "on its sphere"
    at = visit.pixel(new if len(new) == 3 else (*new, 0.0))
    assert at == pytest.approx((x + 40, y - 30), abs=6), "it follows the pointer"
    assert difference(before, visit.canvas()) > 0.001
    label = visit.app.registry[lesson].words().label("params", point)
    fields = visit.page.locator("label", has_text=label).locator("xpath=../..").get_by_role("textbox")
    shown = [float(field.input_value()) for field in fields.all()]
    assert shown == pytest.approx(new, abs=1e-3)
