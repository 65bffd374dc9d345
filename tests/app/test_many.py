"""Many browsers at one real server: none waits for, hears of or fails with another, and who leaves leaves nothing."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.server import App
from lessons.registry import Registry
from tests.app import sample_lessons
from tests.app.conftest import Visit, until
from tests.app.fake_browser import FakeBrowser, Message

pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
Go = Callable[..., Visit]


def height(browser: FakeBrowser) -> float:
    """Half the height of the drawn wave, in display units: 10 for 20 m."""
    return float(np.abs(browser.nodes["/wave"]["props"]["points"].reshape(-1, 3)[:, 1]).max())


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
