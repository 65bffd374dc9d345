"""The address bar follows at a pace that browsers allow, and always ends at the last query."""

import threading
from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace

import pytest

from app import address
from app.address import SECONDS_BETWEEN, AddressBar


class Clock:
    """Time and timers that the test drives."""

    def __init__(self) -> None:
        self.now = 100.0
        self.timers: list[Timer] = []

    def monotonic(self) -> float:
        return self.now

    def go(self, seconds: float) -> None:
        end = self.now + seconds
        while due := [t for t in self.timers if t.running and t.at <= end]:
            timer = min(due, key=lambda t: t.at)
            self.now, timer.running = timer.at, False
            timer.function()
        self.now = end


class Timer:
    """threading.Timer on that clock."""

    clock: Clock

    def __init__(self, interval: float, function: Callable[[], None]) -> None:
        self.at, self.function, self.running, self.daemon = self.clock.now + interval, function, False, False
        self.clock.timers.append(self)

    def start(self) -> None:
        assert self.daemon
        self.running = True

    def cancel(self) -> None:
        self.running = False


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    kind = type("OurTimer", (Timer,), {"clock": made})
    # in this module only: other threads of the test run need the real ones
    monkeypatch.setattr(address, "time", SimpleNamespace(monotonic=made.monotonic))
    monkeypatch.setattr(address, "threading", SimpleNamespace(Timer=kind, Lock=threading.Lock))
    return made


@pytest.fixture
def sent(clock: Clock) -> list[tuple[float, str]]:
    return []


@pytest.fixture
def bar(clock: Clock, sent: list[tuple[float, str]]) -> AddressBar:
    return AddressBar(lambda query: sent.append((clock.now, query)))


def test_the_first_goes_at_once(bar, sent):
    bar.show("a=1")
    assert sent == [(100.0, "a=1")]


def test_the_same_is_not_sent_again(bar, sent, clock):
    for _ in range(3):
        bar.show("a=1")
        clock.go(1.0)
    assert sent == [(100.0, "a=1")] and not clock.timers


def test_a_drag_is_thinned_and_the_last_one_arrives(bar, sent, clock):
    for i in range(40):                          # 2 s at 20 Hz
        bar.show(f"a={i}")
        clock.go(0.05)
    clock.go(1.0)
    times = [at for at, _ in sent]
    assert sent[-1][1] == "a=39"
    assert all(b - a >= SECONDS_BETWEEN - 1e-9 for a, b in pairwise(times))
    assert 2.0 / SECONDS_BETWEEN - 1 <= len(sent) <= 2.0 / SECONDS_BETWEEN + 2   # browsers stop at 100 in 30 s


def test_back_to_what_is_shown_sends_nothing(bar, sent, clock):
    bar.show("a=1")
    bar.show("a=2")
    bar.show("a=1")
    clock.go(1.0)
    assert [query for _, query in sent] == ["a=1"]
    bar.show("a=2")
    assert [query for _, query in sent] == ["a=1", "a=2"]


def test_nothing_is_sent_after_close(bar, sent, clock):
    bar.show("a=1")
    bar.show("a=2")
    bar.close()
    clock.go(1.0)
    bar.show("a=3")
    clock.go(1.0)
    bar.show("a=4")
    clock.go(1.0)
    assert [query for _, query in sent] == ["a=1"]


def test_close_before_anything_was_sent(bar, sent, clock):
    bar.close()
    bar.show("a=1")
    clock.go(1.0)
    assert sent == []


def test_with_a_real_timer():
    arrived = threading.Event()
    bar = AddressBar(lambda query: arrived.set() if query == "a=2" else None)
    bar.show("a=1")
    bar.show("a=2")
    assert arrived.wait(10.0)
