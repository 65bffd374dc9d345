"""The script of the Code tab runs by itself and prints the numbers that the lesson shows."""

import subprocess
import sys

import pytest

from app import code_tab, scenario
from lessons.kit.lesson import no_progress
from lessons.registry import Registry

LESSONS = list(Registry())


def readout_lines(entry, at):
    view = entry.lesson.view(at.params, entry.lesson.compute(at.params, no_progress), at.moment)
    return [f"{r.name} {r.value} {r.unit}" for r in view.readouts]


@pytest.mark.parametrize("entry", LESSONS, ids=lambda e: e.id)
def test_script_reproduces_the_readouts(entry, capsys):
    at = scenario.default(entry)
    exec(compile(code_tab.script(entry, at), "<script>", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out.splitlines() == readout_lines(entry, at)
    assert readout_lines(entry, at), "a lesson without numbers has nothing to reproduce"


def test_script_is_complete_and_follows_the_scenario(tmp_path):
    entry = Registry()["filtering.kalman"]
    at = scenario.with_moment(scenario.with_params(scenario.default(entry), entry, {"sigma_x_m": 12.0}), entry, 7, 2)
    (tmp_path / "reproduce.py").write_text(code_tab.script(entry, at), encoding="utf-8")
    done = subprocess.run([sys.executable, "reproduce.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == readout_lines(entry, at)
    assert readout_lines(entry, at) != readout_lines(entry, scenario.default(entry))


@pytest.mark.parametrize("entry", LESSONS, ids=lambda e: e.id)
def test_sources_are_those_of_core(entry):
    found = code_tab.core_functions(entry)
    assert found, "a lesson composes functions of core"
    for name, source in found:
        assert name.startswith("core.")
        assert f"def {name.rpartition('.')[2]}" in source or f"class {name.rpartition('.')[2]}" in source
    assert "<details>" in code_tab.functions_html(entry)
