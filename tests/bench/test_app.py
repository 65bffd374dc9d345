"""The app between the mathematics and the browser: its reaction to a slider, and what its renderer costs.

Every lesson is measured at its defaults.
"""

import contextlib
import gc
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np
import pytest

from app.draw.lower import DRAW, backdrop, lower
from app.draw.primitives import Primitive, style_for
from app.draw.space import space_for
from app.scene_renderer import SceneRenderer
from app.server import App
from app.session import Session
from app.theme import LIGHT
from lessons.kit.lesson import View, no_progress
from lessons.kit.params import Parameter
from lessons.registry import Entry, Registry
from tests.bench import at_most
from tests.bench.wire import Frame, Wire

pytestmark = pytest.mark.bench

LESSONS = [entry.id for entry in Registry()]
# The slider that is moved, where it is not the lesson's first plain one.
SLIDERS = {"filtering.particle_vs_ekf": "sigma_m"}
MOVES, FEWEST_MOVES, SECONDS = 9, 3, 6.0
ROUND_TRIPS, UPDATES, SWEEPS = 25, 40, 3
DATA = {"lines": "points", "points": "points", "arrows": "points", "mesh": "vertices"}
LENGTHS = ("point_size", "shaft_radius", "head_radius", "head_length", "render_width", "render_height")


@pytest.fixture(scope="module")
def app() -> Iterator[App]:
    app = App(Registry(), port=0)
    yield app
    app.stop()


@contextlib.contextmanager
def connected(app: App, lesson: str) -> Iterator[tuple[Wire, Session]]:
    """A browser that draws nothing, with the lesson open."""
    wire = Wire(app.port, f"?lesson={lesson}")
    try:
        session = app.wait_for_session(60.0)
        assert session.wait_ready(60.0) and session.scenario.lesson == lesson, session.error
        wire.everything_sent(session.client)
        yield wire, session
    finally:
        wire.close()
        _wait(lambda: not app.sessions)


@pytest.mark.parametrize("lesson", LESSONS)
def test_slider_to_last_scene_message(lesson: str, app: App) -> None:
    """From the widget's message to the last change of the scene on the wire: at most 3 times the lesson's own time
    and ten bare round trips of viser (plots and texts of a lesson are sent together with its scene)."""
    entry = app.registry[lesson]
    slider = _slider(entry)
    ours, own, began = [], [], time.monotonic()
    with connected(app, lesson) as (wire, session):
        uuid = _uuid(wire, entry.words().label("params", slider.name))
        for value in _places(slider):
            before, since = session.scenario, wire.mark()
            start = wire.set_widget(uuid, value)
            _wait(lambda before=before: session.scenario != before)
            assert session.wait_ready(60.0)
            wire.everything_sent(session.client)
            ours.append(_last_scene_message(wire.frames(since)) - start)

            params, moment = session.scenario.params, session.scenario.moment
            start = time.perf_counter()
            entry.lesson.view(params, entry.lesson.compute(params, no_progress), moment)
            own.append(time.perf_counter() - start)
            if len(own) >= FEWEST_MOVES and time.monotonic() - began > SECONDS:
                break
        trip = _round_trip(wire, session)
    at_most(f"{lesson}: slider to scene / compute + view + 10 round trips", 1e3 * median(ours),
            1e3 * (median(own) + 10 * trip), 3.0)


@pytest.mark.parametrize("lesson", LESSONS)
def test_renderer_against_hand_written_updates(lesson: str, app: App) -> None:
    """Scrubbing: axes, lowering, placing and comparing cost at most half as much again as a program that builds the
    same arrays for the same nodes and assigns only those that can change."""
    views = _scrubbed(app.registry[lesson])
    ours, reference = [], []
    gc.disable()
    try:
        with connected(app, lesson) as (wire, session):
            scene = session.client.scene
            renderer, by_hand = SceneRenderer(scene), ByHand(scene)

            def render(view: View) -> None:
                renderer.render(space_for(view.camera).place(lower(view, style_for(view.camera, LIGHT))))

            for sweep in range(SWEEPS):
                for view in views:
                    times = [_timed(show, view, wire, session) for show in (render, by_hand.show)]
                    if sweep > 0:  # the first adds most of the nodes
                        ours.append(times[0])
                        reference.append(times[1])
    finally:
        gc.enable()
    assert set(renderer.names) == set(by_hand.nodes)
    at_most(f"{lesson}: renderer / hand-written updates of {len(by_hand.nodes)} nodes", 1e3 * median(ours),
            1e3 * median(reference), 1.5)


class ByHand:
    """What a program for one lesson would do: add a node once, and later assign the data that changes with time.

    It draws with the kit's own functions, as the arrays must be the same.
    """

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self.nodes: dict[str, Any] = {}

    def show(self, view: View) -> None:
        style, space = style_for(view.camera, LIGHT), space_for(view.camera)
        origin, scale = np.array(space.origin), space.scale
        first = not self.nodes
        found: list[tuple[Primitive, float]] = []
        if first:
            found += [(p, 0.0) for p in backdrop(view.camera, style)]
        for layer, item in enumerate(view.scene):
            lift = 0.5 * layer * style.pixel if style.layered else 0.0
            found += [(p, lift) for p in DRAW[type(item)](item, style)]
        for p, lift in found:
            self._update(p, lift, origin, scale)
        if not first:
            kept = {p.name for p, _ in found}
            for name in [n for n in self.nodes if n not in kept and not n.startswith(("axes.", "ground"))]:
                self.nodes.pop(name).remove()

    def _update(self, p: Primitive, lift: float, origin: np.ndarray, scale: float) -> None:
        node = self.nodes.get(p.name)
        if p.kind in DATA:
            data = ((p.props[DATA[p.kind]] - origin) * scale).astype(np.float32)
            if node is not None and self._fits(node, p, data):
                setattr(node, DATA[p.kind], data)
                if p.kind == "arrows":
                    for key in ("head_length", "head_radius"):
                        if getattr(node, key) != p.props[key] * scale:
                            setattr(node, key, p.props[key] * scale)
                return
            position = (0.0, 0.0, lift * scale)
        else:
            x, y, z = p.position
            position = ((x - origin[0]) * scale, (y - origin[1]) * scale, (z + lift - origin[2]) * scale)
            if node is not None:
                key = "text" if p.kind == "label" else "image"
                setattr(node, key, p.props[key])
                node.position = position
                return
        if node is not None:
            node.remove()
        self.nodes[p.name] = self._add(p, position, origin, scale)

    def _fits(self, node: Any, p: Primitive, data: np.ndarray) -> bool:
        """Whether the node takes this many points; colours per point and faces come when a node is added."""
        if p.kind == "mesh":
            return len(node.vertices) == len(data)
        if p.kind in ("points", "arrows") and p.props["colors"].ndim > 1:
            return len(node.points) == len(data)
        return True

    def _add(self, p: Primitive, position: tuple[float, ...], origin: np.ndarray, scale: float) -> Any:
        props = dict(p.props)
        for key in LENGTHS:
            if key in props:
                props[key] = float(props[key] * scale)
        for key in ("points", "vertices"):
            if key in props:
                props[key] = ((props[key] - origin) * scale).astype(np.float32)
        add = {"lines": self._scene.add_line_segments, "points": self._scene.add_point_cloud,
               "arrows": self._scene.add_arrows, "mesh": self._scene.add_mesh_simple, "label": self._scene.add_label,
               "image": self._scene.add_image}[p.kind]
        return add(f"/hand/{p.name}", position=position, **props)


def _slider(entry: Entry) -> Parameter:
    """The control that is moved: the lesson's first plain slider, or else what comes nearest to one."""
    if entry.id in SLIDERS:
        return entry.parameters[SLIDERS[entry.id]]
    kinds = [("float", False), ("int", False), ("float", True), ("int", True), ("seed", False)]
    found = [p for p in entry.parameters.values() if (p.kind, p.log) in kinds]
    return min(found, key=lambda p: kinds.index((p.kind, p.log)))


def _places(slider: Parameter) -> list[float]:
    """Where its widget is moved to, near the default; a logarithmic one holds the exponent."""
    low, high, at = (math.log10(v) if slider.log else v for v in (slider.low, slider.high, float(slider.default)))  # type: ignore[arg-type]
    step = 0.02 if slider.log else 1.0 if slider.kind == "seed" else slider.step or (high - low) / 200
    step *= 1.0 if at + (MOVES + 1) * step <= high else -1.0
    found = [round(at + k * step, 6) for k in range(1, MOVES + 1)]
    return [int(v) for v in found] if slider.kind in ("int", "seed") and not slider.log else found


def _scrubbed(entry: Entry) -> list[View]:
    """The views along the timeline, or, where it has one step, along a slider; at most UPDATES."""
    lesson, params = entry.lesson, entry.lesson.Params()
    timeline = lesson.timeline_of(params)
    if timeline.steps > 0:
        result = lesson.compute(params, no_progress)
        steps = np.unique(np.linspace(0, timeline.steps, UPDATES).astype(int))
        return [lesson.view(params, result, timeline.clamp(int(k), -1)) for k in steps]
    slider = _slider(entry)
    values = [10.0**v if slider.log else v for v in _places(slider)[:5]]
    moved = [replace(params, **{slider.name: slider.nearest(value)}) for value in values]
    return [lesson.view(p, lesson.compute(p, no_progress), timeline.clamp(0, -1)) for p in moved] * 4


def _round_trip(wire: Wire, session: Session) -> float:
    """Seconds from a widget's message to the node that its callback moves, with viser alone."""
    client = session.client
    widget = client.gui.add_slider("bare", 0.0, 100.0, 1.0, 0.0)
    node = client.scene.add_frame("/bare", show_axes=False)

    async def moved(_: Any) -> None:
        node.position = (0.0, 0.0, widget.value)
        client.flush()

    widget.on_update(moved)
    wire.everything_sent(client)
    uuid = _uuid(wire, "bare")
    spent = []
    for k in range(1, ROUND_TRIPS + 1):
        since = wire.mark()
        start = wire.set_widget(uuid, float(k))
        wire.wait_for("SetPositionMessage", since, name="/bare")
        spent.append(_last_scene_message(wire.frames(since)) - start)
        wire.everything_sent(client)
    widget.remove()
    node.remove()
    return median(spent)


def _timed(show: Callable[[View], None], view: View, wire: Wire, session: Session) -> float:
    """Seconds of this thread to show the view; then all messages are sent, so that they disturb nobody."""
    start = time.thread_time()
    with session.client.atomic():
        show(view)
    session.client.flush()
    spent = time.thread_time() - start
    wire.everything_sent(session.client)
    return spent


def _uuid(wire: Wire, label: str) -> str:
    """The id of the slider with this label."""
    return next(m["uuid"] for frame in wire.frames(0) for m in frame.messages
                if m["type"] == "GuiSliderMessage" and m["props"]["label"].startswith(label))


def _last_scene_message(frames: list[Frame]) -> float:
    """When the last message about a node of the scene came."""
    return max(frame.at for frame in frames if any(str(m.get("name", "")).startswith("/") for m in frame.messages))


def _wait(condition: Callable[[], bool], timeout: float = 60.0) -> None:
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("the server did not come to what was asked of it")
        time.sleep(0.001)
