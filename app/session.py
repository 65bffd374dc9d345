"""One browser: its scenario, the worker that computes it, and everything that shows it."""

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from app import picture
from app import scenario as scenarios
from app.address import AddressBar
from app.cache import ResultCache
from app.camera import CameraController
from app.clicks import Clicks
from app.controls import Controls
from app.draw.lower import lower
from app.draw.primitives import Style, style_for
from app.draw.space import space_for
from app.handles import Handles
from app.page import Page
from app.scenario import Scenario
from app.scene_renderer import SceneRenderer
from app.theme import THEMES, Theme, css
from app.web import adapter
from app.worker import LatestWins
from lessons.kit.lesson import Cancelled, View
from lessons.kit.words import Words
from lessons.registry import Entry, Registry

log = logging.getLogger(__name__)

PROGRESS_SECONDS = 0.1
MAX_NOTES = 6  # about the address


class Session:
    """State lives in `scenario`; every change goes through `update`, and the worker shows the latest."""

    def __init__(self, client: Any, registry: Registry, cache: ResultCache, first_lesson: str | None = None) -> None:
        self.client = client
        self._registry = registry
        self._cache = cache
        self._lock = threading.Lock()
        self.render_lock = threading.RLock()
        self.scenario = scenarios.default(registry[first_lesson] if first_lesson else registry.first)
        self.view: View | None = None
        self.shown: Scenario | None = None
        self.camera = CameraController(client)
        self._scene = SceneRenderer(client.scene)
        self._page: Page | None = None
        self._controls: Controls | None = None
        self._handles: Handles | None = None
        self._clicks: Clicks | None = None
        self._built: str | None = None
        self._address = AddressBar(lambda query: adapter.call_page(client, "setQuery", query))
        self._settling: asyncio.TimerHandle | None = None
        self.error: str = ""
        self._worker: LatestWins[Callable[[], None] | Scenario] = LatestWins(self._work, f"client {client.client_id}")
        self._worker.submit(self._open)

    # -- changes ------------------------------------------------------------------------------------------------

    def update(self, change: Callable[[Scenario], Scenario]) -> None:
        """Replace the scenario by change(scenario), and show it; an error leaves it as it was and tells the user."""
        with self._lock:
            try:
                new = change(self.scenario)
            except Exception as error:
                if not isinstance(error, ValueError):  # a lesson that cannot be imported
                    log.exception("cannot change the scenario")
                self.notify("This cannot be", str(error))
                return
            if new == self.scenario:
                return
            self.scenario = new
        self._worker.submit(new)

    def change_params(self, changes: Mapping[str, object]) -> None:
        self.update(lambda s: scenarios.with_params(s, self._registry[s.lesson], changes))

    def go(self, step: int, stage: int) -> None:
        self.update(lambda s: scenarios.with_moment(s, self._registry[s.lesson], step, stage))

    def open_lesson(self, lesson_id: str) -> None:
        self._stop_playing()
        self.update(lambda s: scenarios.default(self._registry[lesson_id], s.language, s.theme))

    def apply_preset(self, name: str) -> None:
        self._stop_playing()
        self.update(lambda s: scenarios.with_preset(s, self._registry[s.lesson], name))

    def apply_preset_number(self, number: int) -> None:
        """The number-th preset of the lesson shown, counted from 1; nothing when there are fewer."""
        names = list(self._registry[self.scenario.lesson].lesson.presets)
        if number <= len(names):
            self.apply_preset(names[number - 1])

    def reset(self) -> None:
        """The lesson as it opened."""
        self.open_lesson(self.scenario.lesson)

    def reset_view(self) -> None:
        self.update(lambda s: replace(s, camera=None))

    def set_theme(self, dark: bool) -> None:
        self.update(lambda s: replace(s, theme="dark" if dark else "light"))

    def toggle_theme(self) -> None:
        self.set_theme(self.scenario.theme == "light")

    def notify(self, title: str, body: str) -> None:
        """A note at the top left of the page."""
        self.client.add_notification(title, body, auto_close_seconds=12.0)

    @property
    def ready(self) -> bool:
        """Whether the scenario is on the screen."""
        return self._worker.idle and (self.shown == self.scenario or bool(self.error))

    def wait_ready(self, timeout: float) -> bool:
        """True when everything has been computed and sent; False after `timeout` seconds."""
        return self._worker.wait_idle(timeout) and self.shown == self.scenario and not self.error

    def close(self) -> None:
        """The browser has left."""
        self._stop_playing()
        self._address.close()
        self._worker.close()

    # -- the worker's thread ------------------------------------------------------------------------------------

    def _work(self, job: Callable[[], None] | Scenario) -> None:
        if callable(job):
            job()
            return
        try:
            self._show(job)
        except Cancelled:
            self._page_do(lambda page: page.show_progress(None))
        except Exception as error:
            if self._worker.closed:
                return
            log.exception("lesson %s failed", job.lesson)
            self.error = f"{type(error).__name__}: {error}"
            self._page_do(lambda page: page.show_error(job.lesson, self.error))

    def _open(self) -> None:
        """First work for a new browser: read its address, build the page, show what it asks for."""
        query = adapter.ask_page(self.client, "window.paikka.search", 10.0)
        try:
            wanted, problems = scenarios.from_query(query, self._registry, self.scenario.lesson)
        except Exception as error:  # a lesson that cannot be imported
            log.exception("cannot open %.80r", query)
            wanted, problems = self.scenario, [f"It asks for a lesson that cannot be opened: {error}"]
        with self._lock:
            self.scenario = wanted
        light_scene(self.client.scene)
        self._page = Page(self, self._registry)
        self.client.camera.on_update(self._camera_moved)
        if len(problems) > MAX_NOTES:
            problems[MAX_NOTES - 1:] = [f"There are {len(problems) - MAX_NOTES + 1} more mistakes."]
        for problem in problems:
            self.notify("The address is not quite right", problem)
        self._worker.submit(wanted)

    def _show(self, wanted: Scenario) -> None:
        entry = self._registry[wanted.lesson]
        page, words = self._page, entry.words(wanted.language)
        if page is None:
            return
        with self.render_lock, self.client.atomic():
            if self._built != wanted.lesson:
                self._build(entry, words, wanted)
            self._sync(entry)
        self.client.flush()
        result = self._cache.get(wanted.compute_key, lambda p: entry.lesson.compute(wanted.params, p),
                                 self._progress(wanted))
        view = entry.lesson.view(wanted.params, result, wanted.moment)
        if self.view is not None and self._handles is not None and self._handles.dragging:
            # the picture stands still under the pointer, and is fitted again when the handle is let go
            view = replace(view, camera=self.view.camera)
        with self.render_lock, self.client.atomic():
            self.error = ""
            self.draw(view, words, wanted)
            self.view, self.shown = view, wanted
        self.client.flush()

    def draw(self, view: View, words: Words, scenario: Scenario) -> None:
        """Send what differs from what the client shows."""
        page, theme = self._page, THEMES[scenario.theme]
        if page is None:
            return
        page.set_theme(scenario.theme == "dark")
        style = style_for(view.camera, theme)
        entries = legend(view, words, style)
        self.camera.show(view.camera, scenario.camera, len(words.legend))
        self.draw_scene(view, style, scenario)
        page.figures.render(view.figures, words, theme)
        page.show_view(view, words, entries)

    def draw_scene(self, view: View, style: Style, scenario: Scenario) -> None:
        """The 3-D part alone: also drawn enlarged for a saved picture."""
        space = space_for(view.camera)
        self._scene.render(space.place(lower(view, style)))
        if self._handles is not None:
            lesson = self._registry[scenario.lesson].lesson
            self._handles.show(scenario.params, style, space, lesson.unused_at(scenario.params))
        if self._clicks is not None:
            self._clicks.show(scenario.params, view.targets, style, space, lesson.unused_at(scenario.params))

    def redraw_scene(self, view: View, scenario: Scenario) -> None:
        """The 3-D part as the client's own screen wants it."""
        self.draw_scene(view, style_for(view.camera, THEMES[scenario.theme]), scenario)

    def legend_of(self, view: View, scenario: Scenario, theme: Theme) -> list[tuple[str, str]]:
        return legend(view, self._registry[scenario.lesson].words(scenario.language), style_for(view.camera, theme))

    def save_picture(self, width: int, height: int, transparent: bool, with_legend: bool) -> None:
        """Send the picture to the browser as a download; runs in a thread of its own."""
        threading.Thread(target=self._save_picture, args=(width, height, transparent, with_legend),
                         name="picture", daemon=True).start()

    def _save_picture(self, width: int, height: int, transparent: bool, with_legend: bool) -> None:
        try:
            png = picture.take(self, width, height, transparent, with_legend)
        except (RuntimeError, TimeoutError, ValueError) as error:
            log.warning("picture: %s", error)
            self.notify("No picture", str(error))
            return
        self.client.send_file_download(f"{self.scenario.lesson}.png", png, save_immediately=True)
        self.client.flush()

    @property
    def has_labels(self) -> bool:
        """Whether there is text in the scene."""
        return self._scene.shows("label")

    @property
    def node_names(self) -> list[str]:
        return self._scene.names

    def _build(self, entry: Entry, words: Words, wanted: Scenario) -> None:
        """Everything that belongs to one lesson."""
        page = self._page
        assert page is not None
        for part in (self._controls, self._handles, self._clicks):
            if part is not None:
                part.remove()
        self._scene.clear()
        page.open_lesson(entry, words, wanted)
        with page.controls_folder:
            self._controls = Controls(self.client.gui, entry.parameters, words, wanted.params, self.change_params,
                                      self.notify, entry.lesson.unused_at(wanted.params))
        self._clicks = Clicks(self.client, entry.parameters, self.change_params, self.notify,
                              lambda: self.camera.canvas[1])
        self._handles = Handles(self.client, entry.parameters, self.change_params,
                                lambda: self._worker.submit(self.scenario))
        self._built = entry.id
        adapter.call_page(self.client, "setTitle", f"{words.title} \u00b7 Paikka")

    def _sync(self, entry: Entry) -> None:
        """Widgets and address follow the latest scenario, which may be newer than the one being computed."""
        latest = self.scenario
        if latest.lesson != entry.id or self._page is None or self._controls is None:
            return
        self._controls.show(latest.params, entry.lesson.unused_at(latest.params))
        self._page.show_moment(latest, entry)
        adapter.call_page(self.client, "hideNumber", self._controls.log_ids)
        self._address.show(scenarios.to_query(latest, entry))

    def _progress(self, wanted: Scenario) -> Callable[[float], None]:
        shown_at = time.monotonic()

        def progress(fraction: float) -> None:
            nonlocal shown_at
            waiting = self._worker.pending
            if self._worker.closed or (isinstance(waiting, Scenario) and waiting.compute_key != wanted.compute_key):
                raise Cancelled
            if time.monotonic() - shown_at > PROGRESS_SECONDS:
                shown_at = time.monotonic()
                self._page_do(lambda page: page.show_progress(fraction))

        return progress

    def _page_do(self, action: Callable[[Page], None]) -> None:
        if self._page is not None and not self._worker.closed:
            action(self._page)
            self.client.flush()

    def _stop_playing(self) -> None:
        if self._page is not None:
            self._page.transport.stop()

    # -- the camera ---------------------------------------------------------------------------------------------

    async def _camera_moved(self, _: Any) -> None:
        """Wait until the camera rests: then it is part of the scenario, or the picture is fitted to the new canvas."""
        self.camera.report()
        loop = asyncio.get_running_loop()
        if self._settling is not None:
            self._settling.cancel()
        self._settling = loop.call_later(0.35, self._camera_rests)

    def _camera_rests(self) -> None:
        view, shown = self.view, self.shown
        if view is None or shown is None or self._worker.closed:
            return
        chosen = self.camera.user_pose()
        if chosen is not None:
            self.camera.accept(chosen, view.camera)
            self.update(lambda s: replace(s, camera=chosen) if s.lesson == shown.lesson else s)
        elif self.scenario.camera is None and self.camera.stale(view.camera):
            self._worker.submit(self.scenario)


def light_scene(scene: Any) -> None:
    """Even light without shadows or reflections, so that a role's colour is the same on every body."""
    scene.configure_default_lights(enabled=False, cast_shadow=False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light.ambient", intensity=2.4)
    scene.add_light_directional("/light.sun", intensity=1.3, position=(-2.0, -3.0, 5.0))


def legend(view: View, words: Words, style: Style) -> list[tuple[str, str]]:
    """Colour and text of the legend's entries whose things are in the scene."""
    roles = {item.name: getattr(item, "role", None) for item in view.scene}
    return [(css(style.theme.color(roles[name])), text) for name, text in words.legend.items() if roles.get(name)]
