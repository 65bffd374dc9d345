"""Every lesson, whatever it teaches: whole, repeatable, and quick enough for a lecture."""

import time
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from app import scenario as scenarios
from app.check import check
from app.export.data_file import as_json
from app.scenario import Scenario
from lessons.kit.lesson import Cancelled, Moment, no_progress
from lessons.registry import Entry, Registry

VIEW_MS = 50.0
ALL = Registry()
# One lesson after the other, so that what one test has computed serves the next.
pytestmark = pytest.mark.parametrize("entry", list(ALL), ids=lambda entry: entry.id, scope="module")


class Computed(NamedTuple):
    scenario: Scenario
    result: Any
    seconds: float
    work_seconds: float          # of this thread, however busy the machine is
    progress: list[float]


@cache
def default(lesson: str) -> Computed:
    """The default scenario of a lesson, computed once for all tests here."""
    entry, progress = ALL[lesson], []
    scenario = scenarios.default(entry)
    begun, work = time.perf_counter(), time.thread_time()
    result = entry.lesson.compute(scenario.params, progress.append)
    return Computed(scenario, result, time.perf_counter() - begun, time.thread_time() - work, progress)


def shown(entry: Entry, at: Moment, result: Any) -> str:
    """All numbers of the default scenario's view at this moment."""
    scenario = default(entry.id).scenario
    return as_json(entry, scenario, entry.lesson.view(scenario.params, result, at), entry.words())


def test_a_lesson_holds_together_everywhere(entry):
    """At default, presets and both ends of every parameter, first to last step, all its words included."""
    problems = [problem.text for problem in check(entry) if not problem.translation]
    assert not problems, "\n".join(problems)


def test_the_same_scenario_gives_the_same_bytes(entry):
    scenario, result, *_ = default(entry.id)
    again = entry.lesson.compute(scenario.params, no_progress)
    assert shown(entry, scenario.moment, result) == shown(entry, scenario.moment, again)


def test_a_view_does_not_change_what_it_is_given(entry):
    """The result is shared by all who look at the same scenario, at whatever step."""
    scenario, result, *_ = default(entry.id)
    timeline = entry.lesson.timeline_of(scenario.params)
    first = shown(entry, scenario.moment, result)
    for step, stage in ((0, 0), (timeline.steps, -1), (timeline.steps // 2, 0)):
        entry.lesson.view(scenario.params, result, timeline.clamp(step, stage))
    assert shown(entry, scenario.moment, result) == first


def test_compute_keeps_to_its_budget(entry):
    """Four times the budget, as `paikka check` allows; a busy machine gets three tries."""
    spent, tries = default(entry.id).seconds, 1
    while spent > 4 * entry.lesson.budget_s and tries < 3:
        begun = time.perf_counter()
        entry.lesson.compute(entry.lesson.Params(), no_progress)
        spent, tries = min(spent, time.perf_counter() - begun), tries + 1
    assert spent <= 4 * entry.lesson.budget_s


def test_scrubbing_is_quick(entry):
    """Time that this thread works: what else the machine does is not the lesson's fault."""
    scenario, result, *_ = default(entry.id)
    timeline = entry.lesson.timeline_of(scenario.params)
    spent = []
    for k in range(12):
        moment = timeline.clamp(scenario.moment.step + k % 3, -1)
        begun = time.thread_time()
        entry.lesson.view(scenario.params, result, moment)
        spent.append(1e3 * (time.thread_time() - begun))
    assert np.median(spent[1:]) < VIEW_MS


def test_a_long_computation_can_be_cancelled(entry):
    """What takes longer than a fifth of a second asks now and then whether anybody still waits."""
    computed = default(entry.id)
    assert all(0.0 <= fraction <= 1.0 for fraction in computed.progress)
    assert computed.progress == sorted(computed.progress)
    assert computed.progress or computed.work_seconds < 0.2

    def stop(fraction: float) -> None:
        raise Cancelled

    if computed.progress:
        with pytest.raises(Cancelled):
            entry.lesson.compute(computed.scenario.params, stop)
