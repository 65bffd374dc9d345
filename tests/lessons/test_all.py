"""Every lesson, whatever it teaches: whole, repeatable, and quick enough for a lecture."""

import time

import numpy as np
import pytest

from app import scenario as scenarios
from app.check import check
from app.export.data_file import as_json
from app.scenario import Scenario
from lessons.kit.lesson import Cancelled, no_progress
from lessons.registry import Entry, Registry

VIEW_MS = 50.0


@pytest.fixture(params=list(Registry()), ids=lambda entry: entry.id)
def entry(request: pytest.FixtureRequest) -> Entry:
    return request.param


def shown(entry: Entry, scenario: Scenario) -> str:
    """All numbers of the scenario's view, from a computation of its own."""
    result = entry.lesson.compute(scenario.params, no_progress)
    return as_json(entry, scenario, entry.lesson.view(scenario.params, result, scenario.moment), entry.words())


def test_a_lesson_holds_together_everywhere(entry):
    """At default, presets and both ends of every parameter, first to last step, all its words included."""
    problems = [problem.text for problem in check(entry) if not problem.translation]
    assert not problems, "\n".join(problems)


def test_the_same_scenario_gives_the_same_bytes(entry):
    scenario = scenarios.default(entry)
    assert shown(entry, scenario) == shown(entry, scenario)


def test_a_view_does_not_change_what_it_is_given(entry):
    """The result is shared by all who look at the same scenario, at whatever step."""
    scenario = scenarios.default(entry)
    result = entry.lesson.compute(scenario.params, no_progress)
    words = entry.words()

    def at(moment) -> str:
        return as_json(entry, scenario, entry.lesson.view(scenario.params, result, moment), words)

    timeline = entry.lesson.timeline_of(scenario.params)
    first = at(scenario.moment)
    for step, stage in ((0, 0), (timeline.steps, -1), (timeline.steps // 2, 0)):
        at(timeline.clamp(step, stage))
    assert at(scenario.moment) == first


def test_compute_keeps_to_its_budget(entry):
    """Four times the budget, as `paikka check` allows; a busy machine gets three tries."""
    params, spent = entry.lesson.Params(), np.inf
    for _ in range(3):
        begun = time.perf_counter()
        entry.lesson.compute(params, no_progress)
        spent = min(spent, time.perf_counter() - begun)
        if spent <= 4 * entry.lesson.budget_s:
            return
    pytest.fail(f"compute took {spent:.2f} s, its budget is {entry.lesson.budget_s:g} s")


def test_scrubbing_is_quick(entry):
    scenario = scenarios.default(entry)
    result = entry.lesson.compute(scenario.params, no_progress)
    timeline = entry.lesson.timeline_of(scenario.params)
    spent = []
    for k in range(12):
        moment = timeline.clamp(scenario.moment.step + k % 3, -1)
        begun = time.perf_counter()
        entry.lesson.view(scenario.params, result, moment)
        spent.append(1e3 * (time.perf_counter() - begun))
    assert np.median(spent[1:]) < VIEW_MS, f"median {np.median(spent[1:]):.0f} ms"


def test_a_long_computation_can_be_cancelled(entry):
    """What takes longer than a tenth of a second asks now and then whether anybody still waits."""
    params, calls = entry.lesson.Params(), []
    begun = time.perf_counter()
    entry.lesson.compute(params, calls.append)
    spent = time.perf_counter() - begun
    assert all(0.0 <= fraction <= 1.0 for fraction in calls) and calls == sorted(calls)
    if spent < 0.1 and not calls:
        return

    def stop(fraction: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        entry.lesson.compute(params, stop)
