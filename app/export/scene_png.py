"""A lesson's scene as PNG: our own server, a headless browser, and the same picture as the button in the page."""

import time

from app import picture, scenario
from app.export.chromium import visit
from app.scenario import Scenario
from app.server import App
from lessons.registry import Registry

WINDOW = (1400, 900)
TIMEOUT = 180.0


def scene_png(registry: Registry, wanted: Scenario, size: tuple[int, int], transparent: bool,
              with_legend: bool = True) -> bytes:
    """PNG bytes of size (width, height).  RuntimeError when the lesson fails or the browser does not answer."""
    app = App(registry, "127.0.0.1", 0, wanted.lesson)
    try:
        query = scenario.to_query(wanted, registry[wanted.lesson])
        with visit(f"{app.url}/?{query}&fixedDpr=1", *WINDOW):
            session = app.wait_for_session(60.0)
            deadline = time.monotonic() + TIMEOUT
            while not session.wait_ready(1.0):
                if session.error:
                    raise RuntimeError(f"{wanted.lesson}: {session.error}")
                if time.monotonic() > deadline:
                    raise RuntimeError(f"{wanted.lesson}: not computed within {TIMEOUT:g} s")
            return picture.take(session, *size, transparent, with_legend)
    finally:
        app.stop()
