"""A scenario survives its query string, and whatever else a query holds ends in a valid scenario and a sentence."""

import math
from dataclasses import dataclass, replace
from typing import Any, get_args
from urllib.parse import parse_qsl, quote

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from app import scenario as scenarios
from app.scenario import MAX_QUERY, CameraPose, Scenario, Theme, from_query, to_query
from lessons.kit.lesson import Lesson, Moment, Timeline
from lessons.kit.params import Parameter, slider
from lessons.registry import Entry, Registry

ALL = Registry()
properties = settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(params=list(ALL), ids=lambda entry: entry.id)
def entry(request: pytest.FixtureRequest) -> Entry:
    return request.param


@pytest.fixture(scope="module")
def quick(registry: Registry) -> Entry:
    return registry["labs.quick"]


def values_of(p: Parameter) -> st.SearchStrategy[Any]:
    number = st.floats(p.low, p.high) if p.kind in ("float", "point") else st.integers(0, 0)
    match p.kind:
        case "switch":
            return st.booleans()
        case "choice":
            return st.sampled_from(p.options)
        case "point":
            return st.tuples(*[number] * len(p.default))
        case "points":
            place = st.floats(p.low, p.high)
            return st.lists(st.tuples(place, place), max_size=min(p.limit, 5)).map(tuple)
        case "names":
            name = st.from_regex(r"[A-Za-z0-9_.\-]{1,8}", fullmatch=True)
            return st.lists(name, max_size=min(p.limit, 5)).map(tuple)
        case "file":
            return st.just("")
        case "int" | "seed":
            return st.integers(int(p.low), int(p.high))
        case _:
            return number


coordinates = st.floats(-1e8, 1e8, allow_subnormal=False)
poses = st.builds(lambda p, look: CameraPose(p, look), *[st.tuples(*[coordinates] * 3)] * 2).filter(
    lambda pose: math.dist(pose.position, pose.look_at) > 1e-3)


@st.composite
def scenarios_of(draw: st.DrawFn, entry: Entry) -> Scenario:
    made = entry.lesson.Params(**{name: draw(values_of(p)) for name, p in entry.parameters.items()})
    timeline = entry.lesson.timeline_of(made)
    moment = Moment(draw(st.integers(0, timeline.steps)), draw(st.integers(0, len(timeline.stages) - 1)))
    return Scenario(entry.id, made, moment, draw(st.none() | poses), draw(st.sampled_from(scenarios.LANGUAGES)),
                    draw(st.sampled_from(get_args(Theme))))


def read(query: str, registry: Registry, count: int = 1) -> tuple[Scenario, str]:
    """The scenario and the one sentence about what is wrong with the query."""
    scenario, problems = from_query(query, registry)
    assert len(problems) == count, problems
    assert_valid(scenario, registry)
    return scenario, " ".join(problems)


def assert_valid(scenario: Scenario, registry: Registry) -> None:
    entry = registry[scenario.lesson]
    for name, parameter in entry.parameters.items():
        value = getattr(scenario.params, name)
        assert parameter.validate(value) == value
    timeline = entry.lesson.timeline_of(scenario.params)
    assert 0 <= scenario.moment.step <= timeline.steps and 0 <= scenario.moment.stage < len(timeline.stages)
    assert scenario.language in scenarios.LANGUAGES and scenario.theme in get_args(Theme)


# -- round trip -----------------------------------------------------------------------------------------------------


@properties
@given(data=st.data())
def test_a_scenario_survives_its_query(entry, data):
    scenario = data.draw(scenarios_of(entry))
    query = to_query(scenario, entry)
    assert from_query(query, ALL) == (scenario, [])
    assert from_query("?" + query, ALL) == (scenario, [])
    assert query.isascii() and not set(query) & set(" <>\"'#\\")


@properties
@given(data=st.data())
def test_every_kind_of_parameter_survives(quick, registry, data):
    scenario = data.draw(scenarios_of(quick))
    assert from_query(to_query(scenario, quick), registry) == (scenario, [])


@properties
@given(data=st.data())
def test_only_what_differs_from_the_default_is_written(entry, data):
    scenario, base = data.draw(scenarios_of(entry)), scenarios.default(entry)
    names = [name for name, _ in parse_qsl(to_query(scenario, entry), keep_blank_values=True, strict_parsing=True)]
    changed = [name for name in entry.parameters if getattr(scenario.params, name) != getattr(base.params, name)]
    assert len(set(names)) == len(names)
    assert [name for name in names if name in entry.parameters] == changed
    shown = entry.lesson.timeline_of(scenario.params).first_shown
    assert ("step" in names) == (scenario.moment != shown)
    assert ("camera" in names) == (scenario.camera is not None)
    assert ("lang" in names) == (scenario.language != "en")
    assert ("theme" in names) == (scenario.theme != "light")


def test_the_default_is_only_its_name(entry):
    assert to_query(scenarios.default(entry), entry) == f"lesson={entry.id}"
    assert from_query(f"?lesson={entry.id}", ALL) == (scenarios.default(entry), [])


def test_a_preset_survives(entry):
    for name in entry.lesson.presets:
        scenario = scenarios.with_preset(scenarios.default(entry), entry, name)
        assert from_query(to_query(scenario, entry), ALL) == (scenario, [])


def test_an_empty_query_opens_the_first_lesson_or_the_one_asked_for(registry):
    assert from_query("", registry) == (scenarios.default(registry.first), [])
    assert from_query("?", registry, "labs.slow")[0].lesson == "labs.slow"


def test_a_start_that_depends_on_the_parameters_survives():
    @dataclass(frozen=True)
    class Params:
        at: int = slider(3, low=0, high=10)

    lesson = Lesson(Params, lambda p, progress: None, lambda p, r, at: None,
                    timeline=lambda p: Timeline(10, start=p.at))
    entry = Entry("x.y")
    entry.__dict__["lesson"] = lesson
    registry = Registry()
    registry._entries = {"x.y": entry}
    scenario = scenarios.with_moment(replace(scenarios.default(entry), params=Params(8)), entry, 8, -1)
    assert from_query(to_query(scenario, entry), registry) == (scenario, [])


def test_a_close_look_at_an_earth_sized_scene_survives(quick, registry):
    pose = CameraPose((6378137.25, -1234567.5, 12.5), (6378140.0, -1234567.0, 12.0))
    scenario = replace(scenarios.default(quick), camera=pose)
    assert from_query(to_query(scenario, quick), registry) == (scenario, [])


# -- changes --------------------------------------------------------------------------------------------------------


def test_changes_are_validated_and_keep_the_moment(quick):
    base = scenarios.with_moment(scenarios.default(quick), quick, 5, 0)
    changed = scenarios.with_params(base, quick, {"amplitude": 3, "start": [0.5, 1.5]})
    assert (changed.params.amplitude, changed.params.start, changed.moment) == (3.0, (0.5, 1.5), Moment(5, 0))
    assert base.params.amplitude == 1.0
    for changes, word in (({"amplitude": 11.0}, "amplitude"), ({"amplitude": math.nan}, "amplitude"),
                          ({"shape": "flat"}, "shape"), ({"start": (1.0,)}, "start"), ({"colour": 1}, "colour"),
                          ({"filled": 1}, "filled"), ({"order": 2.5}, "order"), ({"amplitude": "3"}, "amplitude")):
        with pytest.raises(ValueError, match=word):
            scenarios.with_params(base, quick, changes)


def test_a_shorter_timeline_moves_the_moment_to_its_end(quick):
    base = scenarios.with_moment(scenarios.default(quick), quick, 6, 1)
    assert scenarios.with_params(base, quick, {"last": 4}).moment == Moment(4, 1)


def test_presets_start_from_the_defaults(quick):
    messy = scenarios.with_params(replace(scenarios.default(quick), theme="dark"), quick, {"seed": 99})
    high = scenarios.with_preset(messy, quick, "high")
    assert (high.params.amplitude, high.params.seed, high.moment, high.theme) == (9.0, 7, Moment(2, 1), "dark")
    assert scenarios.with_preset(messy, quick, "early look").moment == Moment(1, 0)
    with pytest.raises(ValueError, match=r"preset.*high.*early look.*nothing"):
        scenarios.with_preset(messy, quick, "nothing")


# -- rejection ------------------------------------------------------------------------------------------------------


def test_unknown_lesson(registry):
    scenario, problem = read("lesson=filtering.kalmann&amplitude=3&theme=dark", registry)
    assert (scenario.lesson, scenario.theme) == (registry.first.id, "dark")
    assert "filtering.kalmann" in problem and "filtering.kalman" in problem.replace("filtering.kalmann", "")
    assert read("lesson=", registry)[0].lesson == registry.first.id


def test_unknown_parameter(quick, registry):
    scenario, problem = read("lesson=labs.quick&colour=red&amplitude=3", registry)
    assert "colour" in problem and quick.id in problem
    assert scenario == scenarios.with_params(scenarios.default(quick), quick, {"amplitude": 3.0})


@pytest.mark.parametrize(("text", "name", "nearest"), [
    ("amplitude=11", "amplitude", 10.0), ("amplitude=-0.1", "amplitude", 0.0), ("amplitude=inf", "amplitude", 10.0),
    ("amplitude=-Infinity", "amplitude", 0.0), ("amplitude=1e999", "amplitude", 10.0),
    ("amplitude=nan", "amplitude", 1.0), ("amplitude=NaN", "amplitude", 1.0), ("amplitude=", "amplitude", 1.0),
    ("amplitude=high", "amplitude", 1.0), ("amplitude=0x10", "amplitude", 1.0), ("amplitude=1,5", "amplitude", 1.0),
    ("amplitude=%00", "amplitude", 1.0), ("amplitude=%FF%FE", "amplitude", 1.0), ("amplitude=true", "amplitude", 1.0),
    ("amplitude=%3Cscript%3E", "amplitude", 1.0), ("amplitude=[5]", "amplitude", 1.0),
    ("runs=9", "runs", 10), ("runs=1e9", "runs", 100_000), ("runs=nan", "runs", 100), ("order=2.5", "order", 2),
    ("order=-inf", "order", 0), ("order=two", "order", 2), ("seed=-1", "seed", 0), ("seed=4e9", "seed", 2**31 - 1),
    ("start=1", "start", (1.0, 2.0)), ("start=1,2,3", "start", (1.0, 2.0)), ("start=1,nan", "start", (1.0, 2.0)),
    ("start=99,-inf", "start", (10.0, -10.0)), ("start=,", "start", (1.0, 2.0)), ("start=(1,2)", "start", (1.0, 2.0)),
    ("shape=Round", "shape", "round"), ("shape=", "shape", "round"), ("filled=2", "filled", False),
    ("filled=None", "filled", False), ("filled=%EF%BC%91", "filled", False),
])
def test_wrong_values(registry, text, name, nearest):
    scenario, problem = read("lesson=labs.quick&" + text, registry)
    assert name in problem
    assert getattr(scenario.params, name) == nearest
    assert type(getattr(scenario.params, name)) is type(nearest)
    assert replace(scenario.params, **{name: nearest}) == replace(scenarios.default(registry["labs.quick"]).params,
                                                                  **{name: nearest})


@pytest.mark.parametrize(("text", "value"), [
    ("amplitude=2.50", 2.5), ("amplitude=%32.5", 2.5), ("amplitude=+2.5", 2.5), ("amplitude=%2B2.5", 2.5),
    ("amplitude=25e-1", 2.5)])
def test_other_ways_to_write_a_number(registry, text, value):
    assert read("lesson=labs.quick&" + text, registry, 0)[0].params.amplitude == value


@pytest.mark.parametrize(("text", "moment", "name"), [
    ("step=7", Moment(6, 1), "step"), ("step=-1", Moment(0, 1), "step"), ("step=1.5", Moment(2, 1), "step"),
    ("step=", Moment(2, 1), "step"), ("step=nan", Moment(2, 1), "step"), ("step=4&stage=hear", Moment(4, 1), "hear"),
    ("stage=", Moment(2, 1), "stage"), ("stage=0", Moment(2, 1), "stage"),
    ("step=" + "9" * 4000, Moment(6, 1), "step"),
])
def test_wrong_moments(registry, text, moment, name):
    scenario, problem = read("lesson=labs.quick&" + text, registry)
    assert scenario.moment == moment
    assert name in problem


@pytest.mark.parametrize("text", ["1,2,3", "1,2,3,4,5,nan", "1,2,3,4,5,inf", "1,2,3,1,2,3", "a,b,c,d,e,f", "",
                                  "1,2,3,4,5,1e12", "1,2,3,4,5,6,7"])
def test_wrong_cameras(registry, text):
    scenario, problem = read("lesson=labs.quick&camera=" + text, registry)
    assert scenario.camera is None and "camera" in problem.lower()


def test_wrong_language_and_theme(registry):
    scenario, problem = read("lesson=labs.quick&lang=sv", registry)
    assert scenario.language == "en" and "lang" in problem and "sv" in problem and "fi" in problem
    scenario, problem = read("lesson=labs.quick&theme=pink", registry)
    assert scenario.theme == "light" and "theme" in problem and "pink" in problem and "dark" in problem


def test_several_mistakes_are_all_named(registry):
    scenario, problem = read("lesson=labs.quick&amplitude=99&order=x&step=77&colour=1&lang=xx", registry, 5)
    assert all(name in problem for name in ("amplitude", "order", "step", "colour", "lang"))
    assert (scenario.params.amplitude, scenario.moment.step) == (10.0, 6)


def test_a_name_given_twice_is_named(registry):
    scenario, problem = read("lesson=labs.quick&amplitude=3&order=4&amplitude=5", registry)
    assert "amplitude" in problem and scenario.params.amplitude == 5.0 and scenario.params.order == 4
    assert "lesson" in read("lesson=labs.slow&lesson=labs.quick", registry)[1]


def test_an_overlong_query_is_cut_between_parameters(registry):
    query = "lesson=labs.quick&amplitude=3&" + "&".join(f"order={i % 10}" for i in range(2000)) + "&amplitude=4"
    assert len(query) > MAX_QUERY
    scenario, problems = from_query(query, registry)
    assert scenario.params.amplitude == 3.0
    assert any(str(MAX_QUERY) in problem for problem in problems)
    assert_valid(scenario, registry)


@pytest.mark.parametrize("head", ["lesson=", "lesson=labs.quick&amplitude=", "lesson=labs.quick&shape=", "camera=",
                                  "lesson=labs.quick&start=", "step=", "lang=", "lesson=labs.quick&",
                                  "lesson=labs.quick&stage=", "lesson=labs.quick&runs="])
def test_sentences_stay_short(registry, head):
    for text in ("q", "9", "%FF", "1,"):
        _, problems = from_query(head + text * 1000, registry)
        assert problems and all(len(problem) < 300 for problem in problems)


def test_the_viewer_s_own_names_are_no_mistakes(registry):
    query = "lesson=labs.quick&fixedDpr=2&darkMode&hideViserLogo=1&websocket=ws%3A%2F%2Fx&amplitude=3"
    assert read(query, registry, 0)[0].params.amplitude == 3.0


@properties
@given(text=st.text(max_size=200), raw=st.booleans())
@example(text="a=1&&=&&b&=c", raw=True)
@example(text="lesson=labs.quick&start=%2C&%=%&;;", raw=True)
@example(text="lesson=labs.quick\0&step=\ud800", raw=True)
def test_any_text_gives_a_valid_scenario(registry, text, raw):
    scenario, problems = from_query(text if raw else quote(text, safe="=&", errors="replace"), registry)
    assert_valid(scenario, registry)
    assert all(problem.endswith((".", "?")) for problem in problems)
    again = to_query(scenario, registry[scenario.lesson])
    assert from_query(again, registry) == (scenario, [])


names = ["lesson", "step", "stage", "camera", "lang", "theme", "amplitude", "runs", "order", "start", "shape", "filled",
         "seed", "last", "colour"]
texts = st.one_of(st.floats().map(str), st.integers().map(str), st.text(max_size=12),
                  st.lists(st.floats().map(str), max_size=7).map(",".join),
                  st.sampled_from(["labs.quick", "look", "round", "1", "dark", "fi"]))


@properties
@given(pairs=st.lists(st.tuples(st.sampled_from(names), texts), max_size=8))
def test_any_values_give_a_valid_scenario(registry, pairs):
    query = "&".join(f"{name}={quote(text, errors='replace')}" for name, text in [("lesson", "labs.quick"), *pairs])
    scenario, _ = from_query(query, registry)
    assert_valid(scenario, registry)
    assert from_query(to_query(scenario, registry[scenario.lesson]), registry) == (scenario, [])
