"""One page of the browser, and the session that serves it."""

import io
import re
import time
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from PIL import Image
from playwright.sync_api import Locator, Page

from app.draw.space import Space, space_for
from app.scenario import Scenario
from app.server import App
from app.session import Session
from app.web import adapter

TIMEOUT = 60.0
LOCAL = r"(?:(?:http|ws)://127\.0\.0\.1[:/]|data:|blob:|about:)"
CANVAS = "canvas[data-engine]"
# viser's own client says this whenever a node is grabbed; it has no effect
HARMLESS = "Unable to preventDefault inside passive event listener invocation."
OUTSIDE = re.compile(f"^(?!{LOCAL})")


class Visit:
    """A page that has opened a scenario.  `complaints` collects what no test may cause."""

    def __init__(self, app: App, page: Page) -> None:
        self.app = app
        self.page = page
        self.complaints: list[str] = []
        self.session: Session = None  # type: ignore[assignment]  # comes with the first `open`
        page.set_default_timeout(1e3 * TIMEOUT)
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.complaints.append(f"page error: {error}"))
        page.on("request", lambda request: self._asked(request.url))
        page.on("websocket", lambda socket: self._asked(socket.url))

    def open(self, query: str, drawn: bool = True) -> "Visit":
        """Show the scenario of a query string; `drawn`: and wait until it is on the screen."""
        return self._loading(lambda: self.page.goto(f"{self.app.url}/?{query}&fixedDpr=1", wait_until="commit"), drawn)

    def reload(self) -> "Visit":
        return self._loading(lambda: self.page.reload(wait_until="commit"), False)

    def _loading(self, load: Callable[[], Any], drawn: bool) -> "Visit":
        before = set(self.app.sessions)
        load()
        self.until(lambda: set(self.app.sessions) - before, "a session")
        self.session = self.app.sessions[max(self.app.sessions)]
        self.until(lambda: self.session.ready, "the lesson to be computed")
        if drawn:
            self.drawn()
        return self

    def until_left(self) -> None:
        """After the page was closed: wait until the server has noticed, so that the next page is the only one."""
        client = self.session and self.session.client.client_id
        deadline = time.monotonic() + TIMEOUT
        while client in self.app.sessions and time.monotonic() < deadline:
            time.sleep(0.01)

    @property
    def scenario(self) -> Scenario:
        return self.session.scenario

    def until(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> None:
        """Let the browser work until the condition holds."""
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError(f"waited {timeout:g} s for {what}; scenario {self.session and self.scenario}")
            self.page.wait_for_timeout(20)

    def shows(self, condition: Callable[[Scenario], Any], what: str) -> None:
        """Wait until the scenario is as asked and has been computed and sent."""
        self.until(lambda: condition(self.scenario) and self.session.ready, what)

    def drawn(self) -> None:
        """Wait until all that the server knows is on the screen."""
        self.until(lambda: self.session.ready, "the lesson to be computed")
        client = self.session.client
        assert adapter.wait_drawn(client, self.session.has_labels, TIMEOUT), "the browser is still drawing"

    def canvas(self) -> np.ndarray:
        """The scene without what lies over it, as (height, width, 3) bytes."""
        self.drawn()
        assert not self.session.error, self.session.error
        png = self.page.locator(CANVAS).screenshot(
            style="#pk-overlay, .mantine-Notification-root { visibility: hidden !important; }")
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))

    def pixel(self, at: tuple[float, float, float]) -> tuple[float, float]:
        """Where in the page a point of the scene (in the lesson's units) is seen."""
        eye, axes, centre, scale = self._projection()
        d = axes @ (self._space.display(at) - eye)
        return (float(centre[0] + scale * d[0] / d[2]), float(centre[1] + scale * d[1] / d[2]))

    def scene_point(self, pixel: tuple[float, float], level: tuple[float, float, float]) -> np.ndarray:
        """The point of the scene that is seen at a pixel and lies as high as `level`."""
        eye, axes, centre, scale = self._projection()
        ray = axes.T @ np.array([*((np.asarray(pixel) - centre) / scale), 1.0])
        height = self._space.display(level)[2]
        return self._space.scene(eye + ray * (height - eye[2]) / ray[2])

    @property
    def _space(self) -> Space:
        assert self.session.view is not None
        return space_for(self.session.view.camera)

    def _projection(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Eye in display units; axes right, down, forward as rows; the canvas's centre; pixels per unit of slope."""
        camera = self.session.client.camera
        eye, ahead, up = (np.asarray(v, np.float64) for v in (camera.position, camera.look_at, camera.up_direction))
        forward = (ahead - eye) / np.linalg.norm(ahead - eye)
        right = np.cross(forward, up)
        right /= np.linalg.norm(right)
        box = self.canvas_box()
        centre = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
        scale = box["height"] / 2 / np.tan(camera.fov / 2)
        return eye, np.stack([right, np.cross(forward, right), forward]), centre, float(scale)

    def canvas_box(self) -> dict[str, float]:
        """The canvas's place in the page."""
        box = self.page.locator(CANVAS).bounding_box()
        assert box is not None
        return dict(box)

    @property
    def dragging(self) -> bool:
        """Whether the server thinks that a handle is held."""
        handles = self.session._handles
        return handles is not None and handles.dragging

    def slider(self, label: str) -> Locator:
        return self.page.get_by_role("slider", name=label)

    def drag(self, start: tuple[float, float], end: tuple[float, float],
             button: Literal["left", "right"] = "left") -> None:
        """Press at `start`, move in small steps to `end`, release."""
        mouse = self.page.mouse
        mouse.move(*start)
        mouse.down(button=button)
        for k in range(1, 9):
            mouse.move(*(a + (b - a) * k / 8 for a, b in zip(start, end, strict=True)))
        mouse.up(button=button)

    def plot(self) -> str:
        """The drawing of the plot that is shown, as SVG."""
        return "".join(self.page.locator(".js-plotly-plot .main-svg").evaluate_all("all => all.map(e => e.innerHTML)"))

    def server_value(self, field: Locator) -> object:
        """What the server thinks that an input holds."""
        return self.session.client.gui._gui_input_handle_from_uuid[field.get_attribute("id") or ""].value

    def readouts(self) -> str:
        return self.page.locator(".pk-readouts").inner_text()

    def notes(self) -> str:
        """The text of all notifications."""
        return "\n".join(self.page.get_by_role("alert").all_inner_texts())

    def _said(self, message: Any) -> None:
        if message.type == "error" and message.text != HARMLESS:
            self.complaints.append(f"console: {message.text}")

    def _asked(self, url: str) -> None:
        if OUTSIDE.match(url):
            self.complaints.append(f"left this machine: {url}")


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """The share of pixels that differ visibly between two pictures of one size."""
    assert a.shape == b.shape
    return float((np.abs(a.astype(int) - b.astype(int)).max(axis=-1) > 24).mean())


def colors(picture: np.ndarray) -> int:
    """How many different colours there are."""
    return len(np.unique(picture.reshape(-1, picture.shape[-1]), axis=0))
