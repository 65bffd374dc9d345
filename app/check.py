"""Does every lesson hold together?  Run it everywhere, and read its words against its code."""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from app import scenario as scenarios
from app.draw.lower import lower
from app.draw.primitives import style_for
from app.export.data_file import everything
from app.scenario import Scenario
from app.text.formula import FormulaError, typeset
from app.text.markdown import formulas_in
from app.theme import DARK, LIGHT
from lessons.kit.lesson import View, no_progress
from lessons.kit.params import Parameter, values
from lessons.kit.words import SECTIONS, Words
from lessons.registry import Entry, Registry


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong, and whether it only waits for a translation."""

    lesson: str
    text: str
    translation: bool = False


def check_all(registry: Registry) -> Iterator[Problem]:
    """Everything that is wrong with the lessons."""
    for entry in registry:
        yield from check(entry)


def check(entry: Entry) -> Iterator[Problem]:
    """Run one lesson at its default, presets and limits, at several moments."""
    try:
        words, lesson = entry.words(), entry.lesson
    except Exception as error:
        yield Problem(entry.id, f"cannot be loaded: {type(error).__name__}: {error}")
        return
    seen = Seen()
    for name, scenario in cases(entry):
        is_end = name != "default" and not name.startswith("preset ")
        if isinstance(scenario, ValueError):
            yield Problem(entry.id, f"{name}: {scenario}")
            continue
        started = time.perf_counter()
        try:
            result = lesson.compute(scenario.params, no_progress)
        except Exception as error:
            yield Problem(entry.id, f"{name}: compute raised {type(error).__name__}: {error}")
            continue
        if name == "default" and (spent := time.perf_counter() - started) > 4 * lesson.budget_s:
            yield Problem(entry.id, f"compute took {spent:.1f} s at the default, its budget is {lesson.budget_s:g} s")
        seen.stages |= set(lesson.timeline_of(scenario.params).stages)
        for k, moment in enumerate(ends_of_time(entry, scenario) if is_end else moments(entry, scenario)):
            at = scenarios.with_moment(scenario, entry, *moment)
            try:
                view = lesson.view(at.params, result, at.moment)
                seen.add(view)
                found = list(view_problems(view, at, entry, words, thorough=k == 0))
            except Exception as error:
                found = [f"view raised {type(error).__name__}: {error}"]
            yield from (Problem(entry.id, f"{name}, step {at.moment.step}, stage {at.moment.stage}: {text}")
                        for text in found)
    yield from (Problem(entry.id, text) for text in word_problems(entry, words, seen))
    if not any(f.name.endswith(".fi.md") for f in _beside(entry)):
        yield Problem(entry.id, "no Finnish words yet", translation=True)


class Seen:
    """Names that the views used."""

    def __init__(self) -> None:
        self.items: set[str] = set()
        self.readouts: set[str] = set()
        self.equations: set[str] = set()
        self.figures: set[str] = set()
        self.latex: set[str] = set()
        self.stages: set[str] = set()

    def add(self, view: View) -> None:
        self.items |= {item.name for item in view.scene}
        self.readouts |= {r.name for r in view.readouts}
        self.equations |= {e.name for e in view.equations}
        self.figures |= set(view.figures)
        self.latex |= {piece for e in view.equations for piece in e.pieces if isinstance(piece, str)}


def cases(entry: Entry) -> Iterator[tuple[str, Scenario | ValueError]]:
    """The default, every preset, and both ends of every parameter (other options of a choice)."""
    base = scenarios.default(entry)
    yield "default", base
    for name in entry.lesson.presets:
        try:
            yield f"preset {name!r}", scenarios.with_preset(base, entry, name)
        except ValueError as error:
            yield f"preset {name!r}", error
    for parameter in entry.parameters.values():
        for value in ends(parameter):
            yield f"{parameter.name}={parameter.format(value)}", scenarios.with_params(
                base, entry, {parameter.name: value})


def ends(parameter: Parameter) -> list[Any]:
    """The extreme values of a parameter, without its default."""
    match parameter.kind:
        case "switch":
            found: list[Any] = [True, False]
        case "choice":
            found = list(parameter.options)
        case "point":
            n = len(parameter.default)  # type: ignore[arg-type]
            found = [(parameter.low,) * n, (parameter.high,) * n]
        case "points":
            line = [(1.0 - t) * parameter.low + t * parameter.high for t in np.linspace(0.0, 1.0, parameter.limit)]
            found = [(), tuple((v, v) for v in line)]
        case "names" | "file":
            found = [parameter.default, "" if parameter.kind == "file" else ()]
        case "int" | "seed":
            found = [int(parameter.low), int(parameter.high)]
        case _:
            found = [parameter.low, parameter.high]
    return [value for value in found if value != parameter.default]


def ends_of_time(entry: Entry, scenario: Scenario) -> list[tuple[int, int]]:
    """The moment shown first, the very first and the very last."""
    shown, steps = scenario.moment, entry.lesson.timeline_of(scenario.params).steps
    return sorted({(shown.step, shown.stage), (0, 0), (steps, -1)})


def moments(entry: Entry, scenario: Scenario) -> list[tuple[int, int]]:
    """First, second, middle and last step, every stage of the one shown first, and that one."""
    timeline = entry.lesson.timeline_of(scenario.params)
    shown = scenario.moment
    steps = {0, 1, timeline.steps // 2, timeline.steps}
    found = {(step, -1) for step in steps if 0 <= step <= timeline.steps} | {(shown.step, shown.stage), (0, 0)}
    return sorted(found | {(shown.step, k) for k in range(len(timeline.stages))})


def view_problems(view: View, scenario: Scenario, entry: Entry, words: Words, thorough: bool = True) -> Iterator[str]:
    """What is wrong with one view: numbers and names; if thorough, also in the dark and as JSON (slow)."""
    yield from (f"unused names {name!r}, which is no parameter"
                for name in entry.lesson.unused_at(scenario.params) if name not in entry.parameters)
    for theme in (LIGHT, DARK) if thorough else (LIGHT,):
        for primitive in lower(view, style_for(view.camera, theme)):
            for key, value in primitive.props.items():
                if isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
                    yield f"scene item {primitive.name!r} has a {key} that is not finite"
    for name, figure in view.figures.items():
        for trace in figure.data:
            if not trace.meta or "role" not in trace.meta:
                yield f"figure {name!r} has a trace without a role; make traces with lessons.kit.figures"
    json.dumps(everything(entry, scenario, view, words), allow_nan=False)  # without indent: ten times as fast
    again = scenarios.from_query(scenarios.to_query(scenario, entry), _Only(entry))
    if again != (scenario, []):
        yield f"the scenario does not survive its own query: {again[1] or again[0]}"


def word_problems(entry: Entry, words: Words, seen: Seen) -> Iterator[str]:
    """What the English words lack, or say about things that do not exist."""
    if not words.title:
        yield "the words have no title"
    if not words.summary:
        yield "the words have no summary"
    yield from (f"the text has no section {name!r}" for name in SECTIONS if name not in words.body)
    needed = {
        "params": set(entry.parameters), "readouts": seen.readouts, "equations": seen.equations,
        "figures": seen.figures, "presets": set(entry.lesson.presets),
        "stages": seen.stages - {"all"},
        "groups": {p.group for p in entry.parameters.values() if p.group},
    }
    for section, names in needed.items():
        yield from (f"the words have no {section}: {name}" for name in sorted(names) if not words.has(section, name))
        extra = set(words.front.get(section) or {}) - names
        yield from (f"the words name {section}: {name}, which does not exist" for name in sorted(extra))
    for parameter in entry.parameters.values():
        if words.hint(parameter.name) is None:
            yield f"the words have no hint for params: {parameter.name}"
        for option in parameter.options:
            if words.option(parameter.name, option) == option and "_" in option:
                yield f"the words have no options: {parameter.name}: {option}"
        names = [words.option(parameter.name, option) for option in parameter.options]
        if len(set(names)) != len(names):
            yield f"options of {parameter.name} have the same name"
    yield from (f"the legend names {name!r}, which is never in the scene"
                for name in words.legend if name not in seen.items)
    for figure in sorted(seen.figures):
        yield from (f"the words have no axis title {axis} for figure {figure}"
                    for axis in ("x", "y") if not words.axis(figure, axis))
    texts = [*words.body.values(), *map(str, (words.front.get("presets") or {}).values())]
    for latex in seen.latex | {latex for text in texts for latex in formulas_in(text)}:
        try:
            typeset(latex)
        except FormulaError as error:
            yield str(error)


def overview(entry: Entry) -> dict[str, Any]:
    """What `paikka list --json` prints of one lesson."""
    words = entry.words()
    timeline = entry.lesson.timeline_of(entry.lesson.Params())
    return {
        "id": entry.id, "title": words.title, "summary": words.summary, "chapter": entry.chapter,
        "refs": list(entry.lesson.refs), "steps": timeline.steps, "stages": list(timeline.stages),
        "parameters": [{
            "name": p.name, "label": words.label("params", p.name), "kind": p.kind, "default": p.default,
            **({"low": p.low, "high": p.high} if p.kind not in ("choice", "switch") else {}),
            **({"options": list(p.options)} if p.kind == "choice" else {}), "unit": p.unit,
        } for p in entry.parameters.values()],
        "presets": {name: dict(changes) for name, changes in entry.lesson.presets.items()},
        "defaults": values(entry.lesson.Params()),
    }


class _Only(Registry):
    """A registry of one lesson."""

    def __init__(self, entry: Entry) -> None:
        self._entries = {entry.id: entry}


def _beside(entry: Entry) -> list[Any]:
    from pathlib import Path

    module = Path(str(entry.module.__file__))
    return list(module.parent.glob(f"{module.stem}.*.md"))
