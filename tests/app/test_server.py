"""A real server and a real websocket client: what a user does, and what comes back."""

from collections.abc import Callable

import numpy as np
import pytest

from app.server import App, free_port
from lessons.kit.lesson import Moment
from tests.app.conftest import Visit, until
from tests.app.fake_browser import FakeBrowser, Message

pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
Go = Callable[..., Visit]


def height(browser: FakeBrowser) -> float:
    """Half the height of the drawn wave, in display units: 10 for 20 m."""
    return float(np.abs(browser.nodes["/wave"]["props"]["points"].reshape(-1, 3)[:, 1]).max())


def address(browser: FakeBrowser) -> str:
    return (browser.scripts("setQuery") or [""])[-1].strip('"')


# -- opening --------------------------------------------------------------------------------------------------------


def test_a_lesson_opens(visit: Go):
    one = visit()
    browser = one.browser
    assert {"/wave", "/start", "/now", "/axes.grid", "/handle.start"} <= set(browser.nodes)
    assert height(browser) == pytest.approx(0.5, rel=0.02)
    assert "A quick wave" in browser.html and "Test 1" in browser.html
    assert browser.scripts("setTitle") == ['"A quick wave \\u00b7 Paikka"']
    assert '"k = 2"' in browser.scripts("setOverlay")[-1] and "the wave" in browser.scripts("setOverlay")[-1]
    assert address(browser) == "lesson=labs.quick"
    assert browser.notes == []
    assert browser.widget("Amplitude")["props"]["hint"] == "How high."
    assert browser.widget("Shape")["props"]["options"] == ["a round one", "square wave"]


def test_a_permalink_is_restored(visit: Go):
    query = "lesson=labs.quick&amplitude=4.5&start=0.5,-3&shape=square%20wave&last=30&step=11&stage=look&theme=dark"
    one = visit("?" + query)
    shown = one.session.scenario
    assert (shown.params.amplitude, shown.params.start, shown.params.shape) == (4.5, (0.5, -3.0), "square wave")
    assert shown.moment == Moment(11, 0) and shown.theme == "dark"
    assert address(one.browser) == query
    assert height(one.browser) == pytest.approx(2.25, rel=0.02)
    assert one.browser.widget("Amplitude")["value"] == 4.5 and one.browser.widget("Dark")["value"] is True
    assert one.browser.widget("Step 11")["value"] == 11
    assert one.browser.notes == []


def test_a_reload_loses_nothing(visit: Go):
    one = visit()
    one.browser.set("Amplitude", 7.5)
    one.browser.drag("/handle.start", (2.0, 2.0, 0.0))
    one.browser.wait(lambda b: "amplitude=7.5" in address(b) and "start=" in address(b))
    again = visit("?" + address(one.browser))
    assert again.session.scenario == one.session.scenario


def test_what_is_wrong_with_an_address_is_named(visit: Go):
    one = visit("?lesson=labs.quick&amplitude=99&colour=red&step=nine&shape=round")
    notes = " ".join(one.browser.notes)
    assert len(one.browser.notes) == 3 and all(word in notes for word in ("amplitude", "colour", "nine"))
    assert one.session.scenario.params.amplitude == 10.0
    assert address(one.browser) == "lesson=labs.quick&amplitude=10"


def test_an_unknown_lesson_is_named_and_the_first_opens(visit: Go):
    one = visit("?lesson=labs.quack&theme=dark")
    assert "labs.quack" in one.browser.notes[0] and "labs.quick" in one.browser.notes[0]
    assert one.session.scenario.lesson == "labs.quick" and one.session.scenario.theme == "dark"


def test_a_thousand_mistakes_are_a_few_notes(visit: Go):
    one = visit("?lesson=labs.quick&" + "&".join(f"x{i}=1" for i in range(500)))
    assert 1 <= len(one.browser.notes) <= 10


def test_a_page_that_never_answers_still_gets_the_first_lesson(app: App):
    """Local storage may be blocked; then the address is unknown, and the default opens."""
    class Blocked(FakeBrowser):
        def _take(self, m: Message) -> None:
            if m["type"] == "LocalStorageGetItemRequestMessage":
                self.send("LocalStorageGetItemResponseMessage", value=None, error="SecurityError",
                          request_uuid=m["request_uuid"])
            else:
                super()._take(m)

    browser = Blocked(app.port, "?lesson=labs.slow")
    try:
        browser.wait(lambda b: "/wave" in b.nodes)
    finally:
        browser.close()


# -- changing -------------------------------------------------------------------------------------------------------


def test_a_slider_changes_picture_numbers_and_address(visit: Go):
    one = visit()
    plot = next(w for w in one.browser.widgets.values() if w["type"] == "GuiPlotlyMessage")
    before = plot["props"]["_plotly_json_str"]
    one.browser.set("Amplitude", 8.0)
    one.browser.wait(lambda b: height(b) > 3.9)
    one.settle()
    assert plot["props"]["_plotly_json_str"] != before
    assert f"{8 * np.sin(0.2 + 0.7):.3f}" in one.browser.html       # step 2 of the wave, seed 7
    one.browser.wait(lambda b: address(b) == "lesson=labs.quick&amplitude=8")


def test_a_logarithmic_slider_says_its_number(visit: Go):
    one = visit()
    one.browser.set("Runs = 100", 3.0)
    until(lambda: one.session.scenario.params.runs == 1000)
    one.settle()
    assert one.browser.widget("Runs = 1,000")


def test_dragging_a_handle_moves_its_point(visit: Go):
    one = visit()
    one.browser.drag("/handle.start", (1.0, 2.0, 0.0))       # display units: 2 m each, from the middle (3, 0)
    until(lambda: one.session.scenario.params.start != (1.0, 2.0))
    one.settle()
    x, y = one.session.scenario.params.start
    assert (x, y) == pytest.approx((5.0, 4.0), abs=0.05)
    assert one.browser.widget("Start")["value"] == [x, y]
    assert one.browser.nodes["/handle.start"]["position"][:2] == pytest.approx([1.0, 2.0], abs=0.03)


def test_a_preset_a_reset_and_the_theme(visit: Go):
    one = visit()
    one.browser.set("Order", 3)
    until(lambda: one.session.scenario.params.order == 3)
    one.browser.press("high")
    until(lambda: one.session.scenario.params.amplitude == 9.0)
    assert one.session.scenario.params.order == 2            # presets start from the defaults
    one.browser.key("Preset 2")
    until(lambda: one.session.scenario.moment == Moment(1, 0))
    assert one.session.scenario.params.order == 5
    one.browser.key("Preset 9")                              # there is none
    one.browser.key("Dark or light")
    until(lambda: one.session.scenario.theme == "dark")
    one.settle()
    assert one.browser.scripts("setDark")[-1] == "true"
    one.browser.key("Reset the lesson")
    until(lambda: one.session.scenario.params.order == 2)
    one.settle()
    assert one.session.scenario.moment == Moment(2, 1) and one.session.scenario.theme == "dark"
    one.browser.wait(lambda b: address(b) == "lesson=labs.quick&theme=dark")


def test_the_same_preset_can_be_pressed_again(visit: Go):
    one = visit()
    for _ in range(2):
        one.browser.press("high")
        until(lambda: one.session.scenario.params.amplitude == 9.0)
        one.settle()
        one.browser.set("Amplitude", 2.0)
        until(lambda: one.session.scenario.params.amplitude == 2.0)


def test_another_lesson(visit: Go):
    one = visit()
    one.browser.set("Fragile", True)
    until(lambda: one.session.scenario.lesson == "labs.fragile")
    one.settle()
    assert {"/target"} <= set(one.browser.nodes) and "/wave" not in one.browser.nodes
    assert "/handle.start" not in one.browser.nodes
    assert one.browser.widget("Target") and not [w for w in one.browser.widgets.values()
                                                 if str(w["props"].get("label")).startswith("Amplitude")]
    one.browser.wait(lambda b: address(b) == "lesson=labs.fragile")
    assert not [w for w in one.browser.widgets.values() if w["type"] == "GuiPlotlyMessage"]


def test_steps_and_stages(visit: Go):
    one = visit("?lesson=labs.quick&step=3")
    for key, moment in (("Step forwards", Moment(4, 1)), ("Stage forwards", Moment(5, 0)),
                        ("Stage forwards", Moment(5, 1)), ("Stage backwards", Moment(5, 0)),
                        ("Stage backwards", Moment(4, 1)), ("Step backwards (B)", Moment(3, 1)),
                        ("Step forwards (N)", Moment(4, 1)), ("Step backwards", Moment(3, 1))):
        one.browser.key(key)
        until(lambda moment=moment: one.session.scenario.moment == moment)
    one.settle()
    one.browser.set("Step 3", 6)
    until(lambda: one.session.scenario.moment == Moment(6, 1))
    one.browser.key("Step forwards")                         # the end
    one.browser.press("Look")
    until(lambda: one.session.scenario.moment == Moment(6, 0))
    one.settle()
    assert '"k = 6"' in one.browser.scripts("setOverlay")[-1]
    one.browser.wait(lambda b: address(b) == "lesson=labs.quick&step=6&stage=look")


def test_keys_that_are_pressed_faster_than_the_picture_follows_all_count(visit: Go):
    one = visit("?lesson=labs.quick&last=60&step=10")
    with one.session.render_lock:                            # the picture cannot follow at all
        for key in ["Step forwards"] * 20 + ["Stage backwards", "Step backwards", "Stage forwards"]:
            one.browser.key(key)
        until(lambda: one.session.scenario.moment == Moment(30, 0))
    one.settle()
    assert '"k = 30"' in one.browser.scripts("setOverlay")[-1]


def test_scrubbing_while_it_plays_goes_on_from_there(visit: Go):
    one = visit("?lesson=labs.quick&last=60&step=5")
    one.browser.set("Speed", "20 steps/s")
    one.browser.key("Play or pause")
    until(lambda: one.session.scenario.moment.step > 6)
    one.browser.set("Step ", 50)
    until(lambda: one.session.scenario.moment.step > 50)
    until(lambda: one.session.scenario.moment.step == 60 and not one.session._page.transport.playing)


def test_play_goes_step_by_step_to_the_end_and_again_from_the_start(visit: Go):
    one = visit("?lesson=labs.quick&step=3")
    browser = one.browser
    browser.set("Speed", "20 steps/s")
    begun = len(browser.scripts("setOverlay"))
    browser.key("Play or pause")
    browser.wait(lambda b: any("Pause" in str(w["props"].get("label")) for w in b.widgets.values()))
    browser.wait(lambda b: "k = 6" in b.scripts("setOverlay")[-1])
    browser.wait(lambda b: any("Play" in str(w["props"].get("label")) for w in b.widgets.values()))
    captions = [text.split('"')[1] for text in browser.scripts("setOverlay")[begun:]]
    assert captions == ["k = 4", "k = 5", "k = 6"]
    browser.key("Play or pause")
    browser.wait(lambda b: "k = 1" in b.scripts("setOverlay")[-1])
    browser.key("Play or pause")                             # pause
    browser.wait(lambda b: any("Play" in str(w["props"].get("label")) for w in b.widgets.values()))
    one.settle()
    assert 1 <= one.session.scenario.moment.step < 6


def test_the_camera_becomes_part_of_the_scenario_and_can_be_reset(visit: Go):
    one = visit()
    until(lambda: one.session.camera._arrived)               # the page has reported the pose that it was sent
    before = len(one.browser.scripts("setQuery"))
    one.browser.move_camera((1.0, 2.0, 90.0), (1.0, 2.0, 0.0))
    until(lambda: one.session.scenario.camera)
    one.settle()
    assert one.session.scenario.camera.look_at == pytest.approx((5.0, 4.0, 0.0))
    one.browser.wait(lambda b: "camera=" in address(b))
    again = visit("?" + address(one.browser))
    assert again.session.scenario == one.session.scenario
    assert again.browser._camera["look_at"] == pytest.approx([1.0, 2.0, 0.0], abs=1e-3)
    one.browser.key("Reset the view")
    until(lambda: one.session.scenario.camera is None)
    one.browser.wait(lambda b: address(b) == "lesson=labs.quick" and len(b.scripts("setQuery")) > before)


def test_another_window_size_frames_the_scene_again(visit: Go):
    one = visit(size=(1000, 700))
    until(lambda: one.session.camera._arrived)
    before = list(one.browser._camera["position"])
    one.browser.resize(400, 1200)
    one.browser.wait(lambda b: b._camera["position"] != before)
    assert one.browser._camera["position"][2] > before[2]    # a narrow window shows the same width from further away
    assert one.session.scenario.camera is None


# -- ports ----------------------------------------------------------------------------------------------------------


def test_a_taken_port_is_passed_over(app: App):
    found = free_port("127.0.0.1", app.port)
    assert app.port < found < app.port + 100


def test_no_port_is_an_error():
    with pytest.raises(OSError, match="8080"):
        free_port("192.0.2.1", 8080)             # an address that no machine has
