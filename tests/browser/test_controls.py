"""Sliders, presets, keys and handles change the scenario, and the picture follows."""

import pytest
from playwright.sync_api import expect

from lessons.kit.lesson import Moment
from tests.browser.visit import Visit, difference

pytestmark = pytest.mark.browser


def test_slider_by_keyboard_changes_numbers_plot_and_picture(visit: Visit) -> None:
    visit.open("lesson=filtering.kalman", drawn=False)
    before, numbers = visit.canvas(), visit.readouts()
    plot = visit.plot()
    slider = visit.slider("σ x (m)")
    slider.focus()
    for _ in range(3):
        visit.page.keyboard.press("ArrowRight", delay=400)  # held long enough for viser to notice it too
    value = float(slider.get_attribute("aria-valuenow") or 0)
    assert value > 30
    visit.shows(lambda s: s.params.sigma_x_m == value, "the slider's value")
    assert difference(before, visit.canvas()) > 0.002
    assert visit.readouts() != numbers
    visit.until(lambda: visit.plot() != plot, "the plot")
    assert visit.scenario.camera is None, "arrow keys on a slider leave the camera where it is"
    expect(visit.page.get_by_role("textbox", name="σ x (m)")).to_have_value(f"{value:g}")


def test_slider_by_mouse_changes_plot_and_picture(visit: Visit) -> None:
    visit.open("lesson=background.rotation_vector", drawn=False)
    before, plot = visit.canvas(), visit.plot()
    scrubber = visit.page.get_by_role("textbox", name="φ =")
    widget = scrubber.get_attribute("id")
    box = visit.slider("Angle").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    visit.drag((x, y), (x + 30, y))
    visit.shows(lambda s: s.params.angle_deg > 150, "a larger angle")
    angle = visit.scenario.params.angle_deg
    visit.page.get_by_text(f"φ = {angle:g} °", exact=True).first.wait_for()
    assert scrubber.get_attribute("id") == widget, "the timeline's other unit leaves its widget where it is"
    assert difference(before, visit.canvas()) > 0.005
    visit.until(lambda: visit.plot() != plot, "the plot")


def test_preset_button(visit: Visit) -> None:
    visit.open("lesson=background.rotation_vector", drawn=False)
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

    box = visit.canvas_box()
    centre = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    visit.drag(centre, (centre[0] + 60, centre[1]), button="right")
    visit.shows(lambda s: s.camera is not None, "a moved camera")
    assert difference(before, visit.canvas()) > 0.01
    visit.page.keyboard.press("v")
    visit.shows(lambda s: s.camera is None, "the camera of the lesson")
    assert difference(before, visit.canvas()) < 0.0005


def test_play_and_pause(visit: Visit) -> None:
    visit.open("lesson=filtering.kalman&step=0", drawn=False)
    visit.page.get_by_role("button", name="Play").wait_for()
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
    """The point goes where the pointer goes, even when the picture is fitted to it afterwards."""
    visit.open(f"lesson={lesson}", drawn=False)
    before, old = visit.canvas(), getattr(visit.scenario.params, point)
    x, y = visit.pixel(_xyz(old))
    expected = visit.scene_point((x + 40, y - 30), _xyz(old))
    visit.drag((x, y), (x + 40, y - 30))
    visit.shows(lambda s: getattr(s.params, point) != old and not visit.dragging, "a moved point")
    new = getattr(visit.scenario.params, point)
    if len(old) == 2:
        assert new == pytest.approx(expected[:2], abs=1.0)
    else:
        assert sum(v * v for v in new) == pytest.approx(sum(v * v for v in old), rel=0.02), "on its sphere"
        assert visit.pixel(new) == pytest.approx((x + 40, y - 30), abs=4)
    assert visit.scenario.camera is None, "the camera is the lesson's"
    assert difference(before, visit.canvas()) > 0.001
    entry = visit.app.registry[lesson]
    words, group = entry.words(), entry.parameters[point].group
    fields = visit.page.get_by_role("textbox", name=words.label("params", point))
    if not fields.count():
        visit.page.get_by_text(words.label("groups", group), exact=True).click()  # a folded group
    visit.until(lambda: [float(f.input_value()) for f in fields.all()] == pytest.approx(new, abs=0.006), "the fields")


def _xyz(point: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, *z = point
    return (x, y, z[0] if z else 0.0)
