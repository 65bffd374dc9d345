"""`paikka study indoor`: resumes where it was interrupted, and its table is what its runs say."""

import csv

import numpy as np
import pytest

from app import study
from app.cli import main
from lessons.indoor._building import parse
from tests.lessons.test_building import text

SMALL = parse(text())
SETTINGS = study.Settings(routes=2, seeds=2, technologies=("wlan",), intervals_s=(5.0,), particles=50, stops=3,
                          map=study.fingerprint(SMALL))


def rows(folder):
    with (folder / study.RUNS).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def stop_after(n):
    def progress(done, total):
        if done >= n:
            raise KeyboardInterrupt

    return progress


def numbers(folder):
    return [{k: v for k, v in r.items() if k != "ms_per_step"} for r in rows(folder)]


def test_an_interrupted_study_goes_on_and_gives_the_same_runs(tmp_path):
    study.run(SMALL, SETTINGS, tmp_path / "whole", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        study.run(SMALL, SETTINGS, tmp_path / "cut", stop_after(2))
    assert len(rows(tmp_path / "cut")) == 2 * 4
    with (tmp_path / "cut" / study.RUNS).open("a") as file:
        file.write("wlan,5,1,0,tll,3.1")                                     # killed in the middle of a line
    calls = []
    study.run(SMALL, SETTINGS, tmp_path / "cut", lambda *at: calls.append(at))
    assert [done for done, _ in calls] == [2, 3, 4] and calls[-1] == (4, 4)
    assert numbers(tmp_path / "cut") == numbers(tmp_path / "whole")


def test_the_table_is_the_mean_over_the_runs(tmp_path):
    lines = study.run(SMALL, SETTINGS, tmp_path, lambda *_: None)
    assert [x.filter for x in lines] == ["tll", "equal", "cvkf", "cpkf"] and {x.runs for x in lines} == {4}
    means = [float(r["mean_m"]) for r in rows(tmp_path) if r["filter"] == "tll"]
    assert lines[0].values[0] == pytest.approx(np.mean(means), rel=1e-5)
    assert lines[0].mean_error_m == pytest.approx(np.std(means, ddof=1) / 2, rel=1e-4)
    table = (tmp_path / study.TABLE_CSV).read_text().splitlines()
    assert table[0].startswith("technology,interval_s,filter,runs,mean_m") and len(table) == 5
    markdown = (tmp_path / study.TABLE_MD).read_text()
    assert markdown.count("\n") == 6 and "graph, total link length" in markdown and "right floor" in markdown


def test_more_seeds_go_on_other_settings_do_not(tmp_path):
    from dataclasses import replace

    study.run(SMALL, replace(SETTINGS, seeds=1), tmp_path, lambda *_: None)
    calls = []
    study.run(SMALL, SETTINGS, tmp_path, lambda *at: calls.append(at))
    assert len(calls) == 3
    with pytest.raises(ValueError, match=r"particles = 50, not 70; choose another folder"):
        study.run(SMALL, replace(SETTINGS, particles=70), tmp_path, lambda *_: None)
    (tmp_path / study.SETTINGS).write_text("{}")
    with pytest.raises(ValueError, match="expected the settings of a study"):
        study.run(SMALL, SETTINGS, tmp_path, lambda *_: None)


def test_the_command(tmp_path, capsys):
    path = tmp_path / "small.json"
    path.write_bytes(text())
    options = ["--map", str(path), "--routes", "1", "--seeds", "1", "--particles", "50", "--to", str(tmp_path / "s")]
    assert main(["study", "indoor", *options]) == 0
    out = capsys.readouterr().out
    assert out.count("| WLAN | 10 s |") == 4 and out.count("| BLE | 1 s |") == 4
    assert main(["study", "indoor", *options[:-3], "60", *options[-2:]]) == 2
    assert "particles = 50, not 60" in capsys.readouterr().err
    with pytest.raises(SystemExit) as error:
        main(["study", "outdoor"])
    assert error.value.code == 2
