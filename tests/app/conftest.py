"""One server with small lessons for all tests that need one, and browsers that visit it."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.server import App
from app.session import Session
from app.web import adapter
from lessons.registry import Registry
from tests.app import sample_lessons
from tests.app.fake_browser import FakeBrowser, Message

MARK = "heardSoFar"


def until(true: Callable[[], Any], timeout: float = 20.0) -> Any:
    """Wait for something that tells nobody when it becomes true."""
    deadline = time.monotonic() + timeout
    while not (found := true()):
        assert time.monotonic() < deadline, f"not true within {timeout:g} s"
        time.sleep(0.005)
    return found


class Visit:
    """A fake browser and the session that the server made for it."""

    def __init__(self, app: App, query: str, size: tuple[int, int] = (1000, 700)) -> None:
        before = set(app.sessions)
        self.browser = FakeBrowser(app.port, query, size)
        number = until(lambda: set(app.sessions) - before).pop()
        self.session: Session = app.sessions[number]
        self._marks = 0

    def settle(self, timeout: float = 20.0) -> "Visit":
        """Wait until the scenario has been computed and the browser has got all of it."""
        until(lambda: self.session.wait_ready(0.5), timeout)
        return self.hear(timeout)

    def hear(self, timeout: float = 20.0) -> "Visit":
        """Wait until the browser has got everything that was sent so far."""
        self._marks += 1
        adapter.call_page(self.session.client, MARK, self._marks)
        self.session.client.flush()
        self.browser.wait(lambda b: b.scripts(MARK)[-1:] == [str(self._marks)], timeout)
        return self

    def heard(self) -> list[Message]:
        """Everything that the browser has got, without our own marks."""
        self.hear()
        return [m for m in self.browser.received if not (m["type"] == "RunJavascriptMessage" and MARK in m["source"])]


@pytest.fixture(scope="session")
def lesson_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_lessons.write(tmp_path_factory.mktemp("lessons") / "labs")


@pytest.fixture(scope="session")
def registry(lesson_folder: Path) -> Registry:
    return Registry(lesson_folder)


@pytest.fixture(scope="session")
def app(registry: Registry) -> Iterator[App]:
    made = App(registry, port=0, first_lesson="labs.quick")
    yield made
    made.stop()


@pytest.fixture
def visit(app: App) -> Iterator[Callable[..., Visit]]:
    """visit(query) opens a page and waits until it shows its lesson; all pages are closed in the end."""
    opened: list[Visit] = []

    def go(query: str = "", *, settle: bool = True, size: tuple[int, int] = (1000, 700)) -> Visit:
        opened.append(Visit(app, query, size))
        return opened[-1].settle() if settle else opened[-1]

    yield go
    for one in opened:
        one.session.wait_ready(5.0)
        one.browser.close()
    until(lambda: not app.sessions)
