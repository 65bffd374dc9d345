"""A lesson's parameters as widgets: events become changes of the scenario, the scenario sets the widgets."""

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from app.uploads import FileControl
from app.web.adapter import widget_id
from lessons.kit.params import SEED_LIMIT, Parameter, Value, values
from lessons.kit.words import Words

Change = Callable[[Mapping[str, object]], None]


class Controls:
    """The widgets of one lesson in the current container of `gui`."""

    def __init__(self, gui: Any, parameters: Mapping[str, Parameter], words: Words, params: Any,
                 change: Change, notify: Callable[[str, str], None], unused: Collection[str] = ()) -> None:
        """Of the groups the first two that are seen stand open, and those that are not seen at first."""
        self._gui = gui
        self._notify = notify
        self._words = words
        self._change = change
        self._parameters = parameters
        self._widgets: dict[str, Any] = {}
        self._shorten: dict[str, Any] = {}    # buttons below a list of points or names
        self._roots: list[Any] = []
        self._folders: list[tuple[Any, set[str]]] = []
        current = values(params)
        groups: dict[str, list[Parameter]] = {}
        for parameter in parameters.values():
            groups.setdefault(parameter.group, []).append(parameter)
        seen = 0
        for group, members in groups.items():
            hidden = all(p.name in unused for p in members)
            seen += not hidden
            if group:
                folder = gui.add_folder(words.label("groups", group), expand_by_default=hidden or seen <= 2)
                self._roots.append(folder)
                self._folders.append((folder, {p.name for p in members}))
                with folder:
                    self._add_all(members, current)
            else:
                self._roots += self._add_all(members, current)

    @property
    def log_ids(self) -> list[str]:
        """Ids of the sliders whose number field shows an exponent."""
        return [widget_id(self._widgets[p.name]) for p in self._parameters.values() if p.log]

    def show(self, params: Any, unused: Collection[str] = ()) -> None:
        """Set the widgets to these parameters and hide the unused ones; only what differs is sent."""
        for folder, members in self._folders:
            folder.visible = not members <= set(unused)
        for name, value in values(params).items():
            parameter, widget = self._parameters[name], self._widgets[name]
            widget.visible = name not in unused
            if name in self._shorten:
                self._shorten[name].visible = name not in unused
            if parameter.log:
                if _from_log(parameter, widget.value) != value:
                    widget.value = _to_log(float(value))  # type: ignore[arg-type]
                widget.label = self._label(parameter, value)
            elif parameter.kind == "choice":
                widget.value = self._words.option(name, str(value))
            elif parameter.kind in ("points", "names"):
                widget.value = parameter.format(value)
            else:
                widget.value = value

    def remove(self) -> None:
        for root in self._roots:
            root.remove()
        self._roots.clear()
        self._widgets.clear()

    def _add_all(self, members: list[Parameter], current: Mapping[str, Value]) -> list[Any]:
        made = []
        for parameter in members:
            widget = self._add(parameter, current[parameter.name])
            self._widgets[parameter.name] = widget
            made.append(widget)
            if parameter.kind in ("points", "names"):
                self._shorten[parameter.name] = self._list_buttons(parameter, widget)
                made.append(self._shorten[parameter.name])
            elif parameter.kind != "file":
                self._listen(parameter, widget)
            if parameter.kind == "seed":
                made.append(self._new_seed_button(parameter))
        return made

    def _add(self, p: Parameter, value: Any) -> Any:
        label, hint = self._label(p, value), self._words.hint(p.name)
        match p.kind:
            case "switch":
                return self._gui.add_checkbox(label, value, hint=hint)
            case "choice":
                options = [self._words.option(p.name, o) for o in p.options]
                return self._gui.add_dropdown(label, options, initial_value=self._words.option(p.name, value),
                                              hint=hint)
            case "point":
                add = self._gui.add_vector2 if len(value) == 2 else self._gui.add_vector3
                n = len(value)
                return add(label, value, min=(p.low,) * n, max=(p.high,) * n, step=p.step or _nice_step(p), hint=hint)
            case "points" | "names":
                return self._gui.add_text(label, p.format(value), disabled=True, hint=hint)
            case "file":
                return FileControl(self._gui, p, label, hint, value, self._change, self._notify)
            case "seed":
                return self._gui.add_number(label, value, min=0, max=SEED_LIMIT, step=1, hint=hint)
        if p.log:
            low, high = _to_log(p.low), _to_log(p.high)
            return self._gui.add_slider(label, low, high, 0.01, initial_value=_to_log(value), marks=_decades(p),
                                        hint=hint)
        if p.kind == "int":
            return self._gui.add_slider(label, int(p.low), int(p.high), int(p.step or 1), value, hint=hint)
        return self._gui.add_slider(label, float(p.low), float(p.high), p.step or _nice_step(p), value, hint=hint)

    def _label(self, p: Parameter, value: Any) -> str:
        name = self._words.label("params", p.name)
        if p.log:
            number = f"{value:,}" if p.kind == "int" else f"{value:.3g}"
            return f"{name} = {number} {p.unit}".rstrip()
        return f"{name} ({p.unit})" if p.unit else name

    def _listen(self, parameter: Parameter, widget: Any) -> None:
        options = {self._words.option(parameter.name, o): o for o in parameter.options}

        async def changed(event: Any) -> None:
            if event.client is None:  # our own assignment
                return
            value = widget.value
            if parameter.log:
                value = _from_log(parameter, value)
            elif parameter.kind == "choice":
                value = options.get(value, value)
            self._change({parameter.name: parameter.nearest(value)})

        widget.on_update(changed)

    def _list_buttons(self, parameter: Parameter, widget: Any) -> Any:
        """A list grows by clicks into the scene; here it gets shorter."""
        shown = ("remove last", "remove all") if parameter.limit > 1 else ("clear",)
        options = tuple(self._words.label("buttons", name).capitalize() for name in shown)
        last = options[0] if len(options) > 1 else ""
        buttons = self._gui.add_button_group("", options)

        async def shorten(event: Any) -> None:
            if event.client is not None:
                items: Any = parameter.parse(widget.value)
                self._change({parameter.name: items[:-1] if buttons.value == last else ()})

        buttons.on_click(shorten)
        return buttons

    def _new_seed_button(self, parameter: Parameter) -> Any:
        button = self._gui.add_button(self._words.label("buttons", "new seed").capitalize())

        async def draw(event: Any) -> None:
            fresh = int(np.random.default_rng().integers(1, 10_000))
            self._change({parameter.name: fresh})

        button.on_click(draw)
        return button


def _to_log(value: float) -> float:
    return round(math.log10(value), 6)


def _from_log(parameter: Parameter, exponent: float) -> Value:
    """Three significant digits, so that the address stays short; the ends are exact."""
    value = float(f"{10.0 ** exponent:.3g}")
    return parameter.nearest(int(value) if parameter.kind == "int" else value)


def _decades(p: Parameter) -> tuple[tuple[float, str], ...]:
    """Marks at the powers of ten, at most five of them labelled."""
    first, last = math.ceil(_to_log(p.low) - 1e-9), math.floor(_to_log(p.high) + 1e-9)
    every = max(1, math.ceil((last - first + 1) / 4))
    return tuple((float(k), _short(10.0**k)) for k in range(first, last + 1, every))


def _short(value: float) -> str:
    for size, suffix in ((1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:g}{suffix}"
    return f"{value:g}"


def _nice_step(p: Parameter) -> float:
    """A round step of about 1/200 of the range."""
    raw = (p.high - p.low) / 200
    power = 10.0 ** math.floor(math.log10(raw))
    return next(float(f"{power * m:.6g}") for m in (1, 2, 5, 10) if power * m >= raw * 0.999)
