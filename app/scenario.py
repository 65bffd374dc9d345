"""The one state of the app: which lesson, with which parameters, at which moment, seen from where.

A scenario round-trips through a query string in which only what differs from the default is written.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args
from urllib.parse import parse_qsl, quote, urlencode

from lessons.kit.lesson import Moment
from lessons.kit.params import Parameter, values
from lessons.registry import Entry, Registry

Theme = Literal["light", "dark"]
LANGUAGES = ("en", "fi")
MAX_QUERY = 4096
# Options of the viewer's own page; they are neither ours nor an error.
VIEWER_NAMES = frozenset({
    "darkMode", "dummyWindowDimensions", "dummyWindowTitle", "fixedDpr", "forceOrbitOriginTool", "hideViserLogo",
    "initialCameraFar", "initialCameraFov", "initialCameraLookAt", "initialCameraNear", "initialCameraPosition",
    "initialCameraUp", "logCamera", "playbackPath", "server", "showStats", "websocket",
})
OWN_NAMES = ("lesson", "step", "stage", "camera", "lang", "theme")


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Where the user has moved the camera: its position and the point it looks at, in scene units."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]

    def format(self) -> str:
        return ",".join(f"{v!r}".removesuffix(".0") for v in (*self.position, *self.look_at))

    def rounded(self) -> "CameraPose":
        """The pose to about a hundred-thousandth of the distance looked at, so that the address stays short."""
        digits = 5 - math.floor(math.log10(math.dist(self.position, self.look_at)))
        return CameraPose(*(tuple(round(v, digits) for v in p) for p in (self.position, self.look_at)))

    @staticmethod
    def parse(text: str) -> "CameraPose":
        """Six numbers: position, then the point looked at.  ValueError otherwise."""
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != 6 or not all(math.isfinite(v) and abs(v) < 1e9 for v in numbers):
            raise ValueError(f"camera: expected six numbers x,y,z,x,y,z, got {text[:40]!r}")
        if math.dist(numbers[:3], numbers[3:]) < 1e-9:
            raise ValueError("camera: expected a position that differs from the point looked at")
        return CameraPose(tuple(numbers[:3]), tuple(numbers[3:]))  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Scenario:
    """Everything that decides what is shown."""

    lesson: str
    params: Any
    moment: Moment
    camera: CameraPose | None = None
    language: str = "en"
    theme: Theme = "light"

    @property
    def compute_key(self) -> tuple[str, Any]:
        """Scenarios with the same key share one computed result."""
        return (self.lesson, self.params)


def default(entry: Entry, language: str = "en", theme: Theme = "light") -> Scenario:
    """The lesson as it opens."""
    params = entry.start
    return Scenario(entry.id, params, entry.lesson.timeline_of(params).first_shown, None, language, theme)


def with_moment(scenario: Scenario, entry: Entry, step: int, stage: int) -> Scenario:
    """The scenario at the nearest moment of its timeline; stage -1 is the last."""
    return replace(scenario, moment=entry.lesson.timeline_of(scenario.params).clamp(step, stage))


def with_params(scenario: Scenario, entry: Entry, changes: Mapping[str, object]) -> Scenario:
    """The scenario with validated parameters; ValueError names the wrong one.  The moment stays if it can."""
    checked = {name: _parameter(entry, name).validate(value) for name, value in changes.items()}
    params = replace(scenario.params, **checked)
    old, new = (entry.lesson.timeline_of(p) for p in (scenario.params, params))
    moment = new.first_shown if old.steps != new.steps and scenario.moment == old.first_shown else scenario.moment
    return with_moment(replace(scenario, params=params), entry, moment.step, moment.stage)


def with_preset(scenario: Scenario, entry: Entry, name: str) -> Scenario:
    """The preset: its parameters over the defaults, at its moment."""
    if name not in entry.lesson.presets:
        raise ValueError(f"preset: expected one of {', '.join(entry.lesson.presets) or 'none'}, got {name!r}")
    chosen = dict(entry.lesson.presets[name])
    step, stage = chosen.pop("step", None), chosen.pop("stage", None)
    fresh = with_params(default(entry, scenario.language, scenario.theme), entry, chosen)
    if step is None and stage is None:
        return with_moment(fresh, entry, *_first(entry, fresh))
    timeline = entry.lesson.timeline_of(fresh.params)
    return with_moment(fresh, entry, fresh.moment.step if step is None else step,
                       -1 if stage is None else timeline.stages.index(stage))


def to_query(scenario: Scenario, entry: Entry) -> str:
    """The query string without '?'; only what differs from the default is written."""
    bases = entry.lesson.Params(), entry.start
    pairs = [("lesson", scenario.lesson)]
    for name, value in values(scenario.params).items():
        if any(value != getattr(base, name) for base in bases):
            pairs.append((name, entry.parameters[name].format(value)))
    timeline = entry.lesson.timeline_of(scenario.params)
    if scenario.moment != timeline.first_shown:
        pairs.append(("step", str(scenario.moment.step)))
        if scenario.moment.stage != len(timeline.stages) - 1:
            pairs.append(("stage", timeline.stages[scenario.moment.stage]))
    if scenario.camera is not None:
        pairs.append(("camera", scenario.camera.format()))
    if scenario.language != "en":
        pairs.append(("lang", scenario.language))
    if scenario.theme != "light":
        pairs.append(("theme", scenario.theme))
    return urlencode(pairs, safe=",;", quote_via=quote)


def from_query(query: str, registry: Registry, fallback: str | None = None) -> tuple[Scenario, list[str]]:
    """The scenario that the query writes, and what was wrong with it, one sentence each.

    What cannot be used is replaced by the nearest valid value, or the default.  fallback: the lesson opened when
    the query names none.
    """
    problems: list[str] = []
    if len(query) > MAX_QUERY:
        problems.append(f"The address is longer than {MAX_QUERY} characters; the rest was ignored.")
        query = query[:MAX_QUERY].rpartition("&")[0]
    pairs = parse_qsl(query.lstrip("?"), keep_blank_values=True)
    given = {name: text for name, text in pairs if name not in VIEWER_NAMES}
    counts = Counter(name for name, _ in pairs)
    problems += [f"{name[:40]}: given more than once; the last one is used." for name in given if counts[name] > 1]

    entry = registry[fallback] if fallback else registry.first
    lesson = given.pop("lesson", entry.id)[:80]
    try:
        entry = registry[lesson]
    except KeyError as error:
        problems.append(_sentence(str(error.args[0])))
        given = {name: text for name, text in given.items() if name in OWN_NAMES}

    scenario = default(entry)
    step, stage, camera = (given.pop(name, None) for name in ("step", "stage", "camera"))
    scenario = replace(scenario, language=_choice(given.pop("lang", "en"), LANGUAGES, "lang", problems),
                       theme=_choice(given.pop("theme", "light"), get_args(Theme), "theme", problems))
    changes: dict[str, object] = {}
    for name, text in given.items():
        parameter = entry.parameters.get(name)
        if parameter is None:
            problems.append(f"Unknown parameter {name[:40]!r} of {entry.id}; it was ignored.")
            continue
        value, problem = _read(parameter, text)
        changes[name] = value
        if problem:
            problems.append(problem)
    scenario = with_params(scenario, entry, changes)
    scenario = _moment(scenario, entry, step, stage, problems)
    if camera is not None:
        try:
            scenario = replace(scenario, camera=CameraPose.parse(camera))
        except ValueError as error:
            problems.append(f"{error}.")
    return scenario, problems


def _moment(scenario: Scenario, entry: Entry, step: str | None, stage: str | None, problems: list[str]) -> Scenario:
    timeline = entry.lesson.timeline_of(scenario.params)
    if step is None and stage is None:
        return with_moment(scenario, entry, *_first(entry, scenario))
    wanted, wanted_stage = timeline.first_shown.step, -1
    if step is not None:
        try:
            wanted = int(step)
        except ValueError:
            problems.append(f"step: expected a whole number from 0 to {timeline.steps}, got {step[:40]!r}.")
        else:
            if not 0 <= wanted <= timeline.steps:
                problems.append(f"step: expected a whole number from 0 to {timeline.steps}, got {step[:40]}.")
    if stage is not None:
        if stage in timeline.stages:
            wanted_stage = timeline.stages.index(stage)
        else:
            problems.append(f"stage: expected one of {', '.join(timeline.stages)}, got {stage[:40]!r}.")
    return with_moment(scenario, entry, wanted, wanted_stage)


def _read(parameter: Parameter, text: str) -> tuple[object, str]:
    try:
        value = parameter.parse(text)
    except ValueError as error:
        return parameter.default, f"{error}. The default {parameter.format(parameter.default)} is used."
    try:
        return parameter.validate(value), ""
    except ValueError:
        nearest = parameter.nearest(value)
        return nearest, (f"{parameter.name}: expected {parameter.expected}, got {text[:40]!r}. "
                         f"{parameter.format(nearest)} is used.")


def _choice(text: str, options: tuple[str, ...], name: str, problems: list[str]) -> Any:
    if text in options:
        return text
    problems.append(f"{name}: expected one of {', '.join(options)}, got {text[:40]!r}.")
    return options[0]


def _parameter(entry: Entry, name: str) -> Parameter:
    if name not in entry.parameters:
        raise ValueError(f"unknown parameter {name!r} of {entry.id}; expected one of {', '.join(entry.parameters)}")
    return entry.parameters[name]


def _first(entry: Entry, scenario: Scenario) -> tuple[int, int]:
    first = entry.lesson.timeline_of(scenario.params).first_shown
    return first.step, first.stage


def _sentence(text: str) -> str:
    text = text[:1].upper() + text[1:]
    return text if text.endswith((".", "?")) else text + "."
