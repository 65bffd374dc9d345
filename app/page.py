"""The panels round the scene: controls and timeline at the right, text, formulas, contents and plots at the left."""

import html
import logging
from typing import TYPE_CHECKING, Any

import viser

from app.code_tab import functions_html, script_html
from app.figure_renderer import FigureRenderer
from app.picture import SIZES
from app.scenario import Scenario
from app.text.markdown import to_html
from app.text.numbers import equations_html, readouts_html
from app.transport import Transport, moves
from app.web import adapter
from lessons.kit.lesson import View
from lessons.kit.words import SECTIONS, Words
from lessons.registry import CHAPTER_NAMES, Entry, Registry

if TYPE_CHECKING:
    from app.session import Session

log = logging.getLogger(__name__)

LEFT_WIDTH, RIGHT_WIDTH = 400, 330
BRAND = {False: (0, 84, 166), True: (82, 152, 255)}
KEYS = (
    ("PageDown, N", "one step forwards"), ("PageUp, B", "one step backwards"),
    ("Shift+N, Shift+B", "one stage forwards, backwards"), ("P", "play, pause"), ("R", "reset the lesson"),
    ("V", "reset the view"), ("1 \u2026 9", "presets"), ("T", "dark or light"), ("Ctrl+K", "all commands"),
    ("drag", "turn the view; drag a ball to move its point"), ("right drag", "shift the view"), ("wheel", "zoom"),
)


class Page:
    """The widgets of one client that outlive a change of lesson."""

    def __init__(self, session: "Session", registry: Registry) -> None:
        self._session = session
        self._client = session.client
        gui = self._gui = session.client.gui
        self._dark: bool | None = None
        self._presets: Any = None
        self._lesson_buttons: dict[str, Any] = {}
        with self._client.atomic():
            self.set_theme(session.scenario.theme == "dark")
            self._right()
            self._left(registry)
            self._commands()
        self.figures = FigureRenderer(gui, self._plots)

    # -- building -----------------------------------------------------------------------------------------------

    def _right(self) -> None:
        gui, session = self._gui, self._session
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT_WIDTH)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Controls", viser.Icon.ADJUSTMENTS):
            self._status = gui.add_html("", visible=False)
            self._progress = gui.add_progress_bar(0.0, visible=False, animated=True)
            self._preset_folder = gui.add_folder(None)
            with self._preset_folder:
                gui.add_html('<div class="pk-head">Presets (keys 1 to 9)</div>')
            self.controls_folder = gui.add_folder(None)
        with tabs.add_tab("Picture", viser.Icon.CAMERA):
            self._picture_controls()
        with tabs.add_tab("Help", viser.Icon.KEYBOARD):
            rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in KEYS)
            gui.add_html(f'<div class="pk"><h1>Keys and mouse</h1><table class="pk-keys">{rows}</table>'
                         "<p>Without a graphics processor the browser draws slowly: show fewer particles.</p></div>")
        panel = gui.add_panel(order=1)
        with panel.add_tab("Timeline and numbers", viser.Icon.CLOCK):
            self._transport_folder = gui.add_folder(None)
            with self._transport_folder:
                self.transport = Transport(gui, session.go, lambda: session.scenario.moment, lambda: session.ready)
            self._readouts = gui.add_html("")
        panel.dock_below(gui.main_panel)

    def _left(self, registry: Registry) -> None:
        gui = self._gui
        panel = gui.add_panel(order=0)
        with panel.add_tab("Lesson", viser.Icon.BOOK):
            self._text = gui.add_html("")
        with panel.add_tab("Formulas", viser.Icon.MATH_FUNCTION):
            self._equations = gui.add_html("")
        with panel.add_tab("Code", viser.Icon.CODE):
            self._script = gui.add_html("")
            self._functions = gui.add_html("")
        with panel.add_tab("Contents", viser.Icon.LIST):
            self._contents(registry)
        panel.dock_left()
        panel.set_width(LEFT_WIDTH)
        self._plots = gui.add_panel(order=2, visible=False)
        self._plots.dock_below(panel)

    def _contents(self, registry: Registry) -> None:
        names = CHAPTER_NAMES["en"]
        for chapter, entries in registry.chapters().items():
            with self._gui.add_folder(names.get(chapter, chapter.replace("_", " ").capitalize())):
                for entry in entries:
                    self._lesson_button(entry)

    def _lesson_button(self, entry: Entry) -> None:
        try:
            words = entry.words(self._session.scenario.language)
        except Exception:  # a broken lesson is still listed; opening it shows what is wrong
            log.exception("lesson %s has no readable words", entry.id)
            words = Words()
        button = self._gui.add_button(words.title or entry.id, hint=words.summary or None, color="gray")

        async def open_it(_: Any) -> None:
            self._session.open_lesson(entry.id)

        button.on_click(open_it)
        self._lesson_buttons[entry.id] = button

    def _picture_controls(self) -> None:
        gui, session = self._gui, self._session
        size = gui.add_dropdown("Size", tuple(SIZES), hint="Pixels of the saved picture")
        background = gui.add_dropdown("Background", ("white", "transparent"))
        with_legend = gui.add_checkbox("Legend", True, hint="Draw the caption and the legend into the picture")
        save = gui.add_button("Save picture", icon=viser.Icon.DOWNLOAD)
        gui.add_html('<div class="pk"><p>Each plot saves as SVG from the camera button in its own bar.</p></div>')
        self._dark_box = gui.add_checkbox("Dark", session.scenario.theme == "dark", hint="Dark or light (T)")
        view = gui.add_button("Reset view", icon=viser.Icon.HOME, hint="Show the whole scene again (V)")

        async def saved(_: Any) -> None:
            session.save_picture(*SIZES[size.value], background.value == "transparent", with_legend.value)

        async def darkened(event: Any) -> None:
            if event.client is not None:
                session.set_theme(self._dark_box.value)

        async def reset(_: Any) -> None:
            session.reset_view()

        save.on_click(saved)
        self._dark_box.on_update(darkened)
        view.on_click(reset)

    def _commands(self) -> None:
        session, transport = self._session, self.transport

        def moving(action: Any, by: int) -> Any:
            def act() -> None:
                transport.stop()
                action(by)
            return act

        for label, hotkey, modifier, action in (
            ("Step forwards", "pagedown", None, moving(transport.step, 1)),
            ("Step forwards (N)", "N", None, moving(transport.step, 1)),
            ("Step backwards", "pageup", None, moving(transport.step, -1)),
            ("Step backwards (B)", "B", None, moving(transport.step, -1)),
            ("Stage forwards", "N", "shift", moving(transport.stage, 1)),
            ("Stage backwards", "B", "shift", moving(transport.stage, -1)),
            ("Play or pause", "P", None, transport.toggle),
            ("Reset the lesson", "R", None, session.reset),
            ("Reset the view", "V", None, session.reset_view),
            ("Dark or light", "T", None, session.toggle_theme),
            *((f"Preset {k}", str(k), None, lambda k=k: session.apply_preset_number(k)) for k in range(1, 10)),
        ):
            self._command(label, hotkey, modifier, action)

    def _command(self, label: str, hotkey: Any, modifier: Any, action: Any) -> None:
        command = self._gui.add_command(label, hotkey=hotkey, modifier=modifier)

        async def triggered(_: Any) -> None:
            action()

        command.on_trigger(triggered)

    # -- showing ------------------------------------------------------------------------------------------------

    def set_theme(self, dark: bool) -> None:
        if dark == self._dark:
            return
        first, self._dark = self._dark is None, dark
        self._gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False, brand_color=BRAND[dark])
        adapter.call_page(self._client, "setDark", dark)
        if not first:
            self._dark_box.value = dark

    def open_lesson(self, entry: Entry, words: Words, scenario: Scenario) -> None:
        """Texts, presets and timeline of another lesson."""
        for lesson_id, button in self._lesson_buttons.items():
            button.color = "blue" if lesson_id == entry.id else "gray"
        self._text.content = lesson_html(entry, words)
        self._functions.content = functions_html(entry)
        self.figures.clear()
        if self._presets is not None:
            self._presets.remove()
            self._presets = None
        names = tuple(entry.lesson.presets)
        self._preset_folder.visible = bool(names)
        if names:
            with self._preset_folder:
                presets = self._gui.add_button_group("", names)
                self._presets = presets

            async def chosen(event: Any) -> None:
                if event.client is not None and presets.value in names:
                    self._session.apply_preset(presets.value)

            presets.on_click(chosen)
        self._built_timeline = None

    def show_moment(self, scenario: Scenario, entry: Entry) -> None:
        """The timeline's widgets follow the scenario."""
        timeline = entry.lesson.timeline_of(scenario.params)
        if timeline != self._built_timeline:
            self._built_timeline = timeline
            self._transport_folder.visible = moves(timeline)
            with self._transport_folder:
                self.transport.rebuild(timeline, entry.words(scenario.language))
        self.transport.show(scenario)
        self._script.content = script_html(entry, scenario)

    def show_view(self, view: View, words: Words, legend: list[tuple[str, str]]) -> None:
        """The numbers and what lies over the scene."""
        self._readouts.content = (f'<div class="pk">{readouts_html(tuple(view.readouts), words)}'
                                  f"{legend_html(legend)}</div>")
        self._equations.content = equations_html(tuple(view.equations), words)
        self._status.visible = False
        self.show_progress(None)
        overlay = (view.caption, view.note, legend)
        if overlay != getattr(self, "_overlay", None):
            self._overlay = overlay
            adapter.call_page(self._client, "setOverlay", *overlay)

    def show_progress(self, fraction: float | None) -> None:
        """The share that is done in percent; None hides the bar."""
        self._progress.visible = fraction is not None
        if fraction is not None:
            self._progress.value = 100.0 * min(max(fraction, 0.0), 1.0)

    def show_error(self, lesson: str, message: str) -> None:
        self._status.content = error_html(lesson, message)
        self._status.visible = True
        self.show_progress(None)


def lesson_html(entry: Entry, words: Words) -> str:
    """Title, sources, the text, and what the presets are for."""
    parts = [f'<div class="pk-title">{html.escape(words.title or entry.id)}</div>']
    if entry.lesson.refs:
        parts.append(f'<div class="pk-refs">{html.escape(", ".join(entry.lesson.refs))}</div>')
    parts += [f"<h1>{html.escape(name)}</h1>{to_html(words.body[name])}" for name in SECTIONS if name in words.body]
    notes = [(name, words.label("presets", name)) for name in entry.lesson.presets if words.has("presets", name)]
    if notes:
        rows = "".join(f"<li><b>{html.escape(name)}</b>: {to_html(text)[3:-5]}</li>" for name, text in notes)
        parts.append(f"<h1>Presets</h1><ul>{rows}</ul>")
    return f'<div class="pk">{"".join(parts)}</div>'


def legend_html(legend: list[tuple[str, str]]) -> str:
    """The legend for windows that are too narrow to have it over the scene."""
    rows = "".join(f'<div><i style="background:{color}"></i>{html.escape(text)}</div>' for color, text in legend)
    return f'<div class="pk-narrow-legend">{rows}</div>'


def error_html(lesson: str, message: str) -> str:
    """What a user sees when a lesson fails."""
    return (f'<div class="pk pk-error"><b>This lesson could not be computed.</b><br>{html.escape(message)}<br>'
            f"<small>{html.escape(lesson)}: change a value, press R to reset, or choose another lesson. "
            "The details are in the server's log.</small></div>")
