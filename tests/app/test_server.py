"""A real server with real websocket clients: each has its own state, and none waits for another."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.server import App, free_port
from lessons.kit.lesson import Moment
from lessons.registry import Registry
from tests.app import sample_lessons
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


# -- many at once ---------------------------------------------------------------------------------------------------


def test_a_change_by_one_sends_nothing_to_another(visit: Go):
    one, other = visit(), visit()
    before = other.heard()
    for value in (3.0, 4.0, 5.0):
        one.browser.set("Amplitude", value)
    one.browser.press("early look")
    one.browser.key("Dark or light")
    one.browser.drag("/handle.start", (1.0, 2.0, 0.0))
    one.browser.set("Slow", True)
    until(lambda: one.session.scenario.lesson == "labs.slow")
    one.settle()
    assert len(one.heard()) > len(before)
    assert other.heard() == before


def test_two_who_look_at_the_same_share_one_computation(visit: Go, registry: Registry):
    begun = registry["labs.slow"].module.BEGUN
    begun.clear()
    one, other = visit("?lesson=labs.slow&target=77", settle=False), visit("?lesson=labs.slow&target=77", settle=False)
    one.settle(), other.settle()
    assert begun == [77.0]


def test_dragging_a_slow_lesson_ends_with_the_last_value_and_delays_nobody(visit: Go, registry: Registry):
    """One second of work, dragged at 20 Hz for two seconds.  Another's slider meanwhile: 95 % within 0.4 s."""
    begun, done = (getattr(registry["labs.slow"].module, name) for name in ("BEGUN", "DONE"))
    slow, quick = visit("?lesson=labs.slow"), visit()
    begun.clear(), done.clear()
    stop = threading.Event()
    delays: list[float] = []

    def other_student() -> None:
        value = 1.0
        while not stop.is_set():
            value = 1.1 + (value + 0.1) % 8.0
            sent = time.monotonic()
            quick.browser.set("Amplitude", value)
            quick.browser.wait(lambda b, v=value: height(b) == pytest.approx(0.5 * v, rel=0.02))
            delays.append(time.monotonic() - sent)
            stop.wait(0.02)

    student = threading.Thread(target=other_student)
    student.start()
    targets = [float(k) for k in range(1, 41)]
    started = time.monotonic()
    for k, target in enumerate(targets):
        time.sleep(max(0.0, started + 0.05 * k - time.monotonic()))      # the pace is what is tested
        slow.browser.set("Target", target)
    slow.browser.wait(lambda b: "40.00" in b.html, 15.0)
    finished = time.monotonic() - started - 0.05 * len(targets)
    stop.set()
    student.join()
    assert slow.session.scenario.params.target == slow.session.shown.params.target == 40.0
    assert begun[-1] == 40.0 and done == [40.0]              # all the others were stopped
    assert finished < 6.0
    assert len(delays) > 10
    assert float(np.percentile(delays, 95)) < 0.4, sorted(delays)[-5:]


def test_only_another_parameter_computes_again(visit: Go, registry: Registry):
    computed = registry["labs.quick"].module.COMPUTED
    one = visit("?lesson=labs.quick&amplitude=1.234")
    before = len(computed)
    for k in (3, 4, 5):
        one.browser.key("Step forwards")
        until(lambda k=k: one.session.scenario.moment.step == k)
    one.browser.key("Stage backwards")
    one.browser.key("Dark or light")
    until(lambda: one.session.scenario.theme == "dark")
    visit("?lesson=labs.quick&amplitude=1.234&step=6")
    assert len(computed) == before
    one.browser.set("Amplitude", 1.235)
    until(lambda: len(computed) == before + 1)


def test_progress_is_shown_and_hidden_again(visit: Go):
    one = visit("?lesson=labs.slow")
    bar = next(w for w in one.browser.widgets.values() if w["type"] == "GuiProgressBarMessage")
    assert bar["props"]["visible"] is False
    begun = len(one.browser.received)
    one.browser.set("Target", 55.5)
    one.browser.wait(lambda b: bar["props"]["visible"])
    one.settle()
    assert bar["props"]["visible"] is False
    shown = [m["updates"]["value"] for m in one.browser.received[begun:]
             if m["type"] == "GuiUpdateMessage" and m["uuid"] == bar["uuid"] and "value" in m["updates"]]
    assert len(shown) >= 3 and shown == sorted(shown) and 0.0 < shown[0] < shown[-1] <= 100.0


# -- failures -------------------------------------------------------------------------------------------------------


def test_a_failing_lesson_tells_its_user_and_the_log_and_nobody_else(visit: Go, caplog: pytest.LogCaptureFixture):
    one, other = visit("?lesson=labs.fragile"), visit()
    before = other.heard()
    with caplog.at_level(logging.ERROR):
        one.browser.set("Broken", True)
        one.browser.wait(lambda b: "could not be computed" in b.html)
    assert "ValueError: the matrix is &lt;b&gt;singular&lt;/b&gt;" in one.browser.html
    assert "labs.fragile" in one.browser.html and "<b>singular" not in one.browser.html
    assert "labs.fragile" in caplog.text and "Traceback" in caplog.text and "<b>singular</b>" in caplog.text
    assert other.heard() == before
    other.browser.set("Amplitude", 6.0)
    other.browser.wait(lambda b: height(b) == pytest.approx(3.0, rel=0.02))
    one.browser.set("Target", 5.0)                           # still broken, still alive
    until(lambda: one.session.scenario.params.target == 5.0)
    one.browser.set("Broken", False)
    one.settle()
    assert "could not be computed" not in one.browser.html and "5.000" in one.browser.html


def test_one_user_s_failure_does_not_reach_another_through_the_cache(visit: Go):
    one = visit("?lesson=labs.fragile&broken=1", settle=False)
    one.browser.wait(lambda b: "could not be computed" in b.html)
    other = visit("?lesson=labs.fragile")
    assert "could not be computed" not in other.browser.html


@pytest.fixture
def torn(tmp_path: Path) -> Iterator[App]:
    """A server with a lesson whose file cannot be imported."""
    folder = sample_lessons.write(tmp_path / "labs", "quick")
    (folder / "torn.py").write_text("raise RuntimeError('torn <apart>')", encoding="utf-8")
    app = App(Registry(folder), port=0, first_lesson="labs.quick")
    yield app
    app.stop()


@pytest.mark.parametrize("query", ["?lesson=labs.torn", ""], ids=["by its address", "from the contents"])
def test_a_lesson_that_cannot_be_imported_is_explained(torn: App, query: str, caplog: pytest.LogCaptureFixture):
    one = Visit(torn, query)
    try:
        with caplog.at_level(logging.ERROR):
            if not query:
                one.settle().browser.set("labs.torn", True)
            one.browser.wait(lambda b: any("torn" in note for note in b.notes))
        assert "Traceback" in caplog.text
        one.settle()
        assert one.session.scenario.lesson == "labs.quick" and "/wave" in one.browser.nodes
    finally:
        one.browser.close()


# -- leaving --------------------------------------------------------------------------------------------------------


def client_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("client ")]


def test_leaving_ends_the_session(app: App, visit: Go):
    until(lambda: not client_threads())
    one, other = visit(), visit()
    assert len(client_threads()) == 2
    one.browser.close()
    until(lambda: one.session not in app.sessions.values())
    until(lambda: len(client_threads()) == 1)
    assert one.session._worker.closed
    other.browser.set("Amplitude", 6.0)
    until(lambda: other.session.scenario.params.amplitude == 6.0)


def test_leaving_stops_the_computation_and_the_player(app: App, visit: Go, registry: Registry):
    module = registry["labs.slow"].module
    one, player = visit("?lesson=labs.slow"), visit("?lesson=labs.quick&last=60")
    module.DONE.clear()
    one.browser.set("Target", 66.0)
    until(lambda: module.BEGUN[-1:] == [66.0])
    player.browser.key("Play or pause")
    until(lambda: player.session.scenario.moment.step > 2)
    one.browser.close(), player.browser.close()
    until(lambda: not app.sessions)
    until(lambda: not client_threads())
    assert module.DONE == []
    assert not player.session._page.transport.playing
    at = player.session.scenario.moment
    player.session.go(50, -1)                                # a late event of a browser that has gone
    assert player.session._worker.pending is None and at.step < 60


def test_leaving_before_the_page_is_built(app: App):
    """A browser that goes while the server still asks for its address."""
    class Mute(FakeBrowser):
        def _take(self, m: Message) -> None:
            if m["type"] != "LocalStorageGetItemRequestMessage":
                super()._take(m)

    for _ in range(3):
        browser = Mute(app.port)
        until(lambda: app.sessions)
        browser.close()
        until(lambda: not app.sessions)
    until(lambda: not client_threads())


def test_a_session_is_soon_there(app: App, visit: Go):
    with pytest.raises(TimeoutError):
        app.wait_for_session(0.01)
    one = visit()
    assert app.wait_for_session(1.0) is one.session


def test_stop_ends_everything(registry: Registry):
    app = App(registry, port=0, first_lesson="labs.quick")
    one = Visit(app, "").settle()
    app.stop()
    until(lambda: not app.server._websock_server._server_thread.is_alive())
    assert one.session._worker.closed
    with pytest.raises(OSError):
        FakeBrowser(app.port)
    one.browser.close()


# -- ports ----------------------------------------------------------------------------------------------------------


def test_a_taken_port_is_passed_over(app: App):
    found = free_port("127.0.0.1", app.port)
    assert app.port < found < app.port + 100


def test_no_port_is_an_error():
    with pytest.raises(OSError, match="8080"):
        free_port("192.0.2.1", 8080)             # an address that no machine has
