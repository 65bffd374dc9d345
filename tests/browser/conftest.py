"""One server and one browser for all of these tests; each test has a page of its own, and none may complain."""

import os
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from app.export import chromium
from app.server import App
from lessons.registry import Registry
from tests.browser.visit import OUTSIDE, Visit

NewVisit = Callable[..., Visit]


@pytest.fixture(scope="package")
def app() -> Iterator[App]:
    app = App(Registry(), port=0)
    yield app
    app.stop()


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    try:
        executable = chromium.find()
    except chromium.NoChromium as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))
    # Package scope: Playwright keeps an event loop in this thread, which other packages' tests must not meet.
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(chromium.FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def new_visit(browser: Browser, app: App) -> Iterator[NewVisit]:
    """Makes pages, each in a fresh context.  Afterwards: no error in any console, no request to anywhere else."""
    visits: list[Visit] = []

    def make(server: App = app, width: int = 1200, height: int = 800) -> Visit:
        context = browser.new_context(viewport={"width": width, "height": height}, accept_downloads=True)
        context.route(OUTSIDE, lambda route: route.abort())
        visits.append(Visit(server, context.new_page()))
        return visits[-1]

    yield make
    for visit in visits:
        visit.page.context.close()
        visit.until_left()
    complaints = [complaint for visit in visits for complaint in visit.complaints]
    assert not complaints, "\n".join(complaints)


@pytest.fixture
def visit(new_visit: NewVisit) -> Visit:
    """One page in a window of a small laptop: larger ones take longer to render."""
    return new_visit()
