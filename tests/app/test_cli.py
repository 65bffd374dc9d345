"""The command line: what it prints, what it writes, and errors that name the option and what would be right."""

import csv
import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from app.cli import main
from lessons import registry as registry_module
from lessons.registry import Registry
from tests.app import sample_lessons
from tests.app.conftest import until
from tests.app.fake_browser import FakeBrowser

ROOT = Path(__file__).parents[2]


@pytest.fixture
def labs(lesson_folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The option that makes the small lessons the only ones."""
    monkeypatch.setattr(registry_module, "CHAPTERS", {})
    return ["--lessons", str(lesson_folder)]


@pytest.fixture
def paikka(labs: list[str], capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """paikka(command, ...) with the small lessons; returns what it prints."""
    def call(command: str, *options: str) -> str:
        capsys.readouterr()
        assert main([command, *labs, *options]) == 0
        return capsys.readouterr().out

    return call


@pytest.fixture
def refused(labs: list[str], capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """refused(command, ...) must end with exit code 2; returns the message."""
    def call(command: str, *options: str) -> str:
        capsys.readouterr()
        try:
            code: Any = main([command, *labs, *options])
        except SystemExit as stopped:            # argparse
            code = stopped.code
        shown = capsys.readouterr()
        assert code == 2 and shown.out == "" and "Traceback" not in shown.err
        return shown.err

    return call


# -- what it prints -------------------------------------------------------------------------------------------------


def test_version(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["--version"])
    assert stopped.value.code == 0 and capsys.readouterr().out == f"paikka {version('paikka')}\n"


@pytest.mark.parametrize("arguments", [["--help"], ["serve", "--help"], ["list", "-h"], ["run", "-h"], ["export", "-h"],
                                       ["check", "-h"]])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    out = capsys.readouterr().out
    assert stopped.value.code == 0 and out.startswith("usage: paikka")
    if len(arguments) == 1:
        assert all(name in out for name in ("serve", "list", "run", "export", "check"))
    else:
        assert "--lessons DIR" in out


def test_list(paikka):
    rows = paikka("list").splitlines()
    assert [row.split()[0] for row in rows] == ["labs.fragile", "labs.picked", "labs.quick", "labs.slow",
                                               "labs.stubborn"]
    assert "A quick wave" in rows[2] and "(Test 1)" in rows[2]


def test_list_as_json(paikka):
    quick = json.loads(paikka("list", "--json"))[2]
    assert (quick["id"], quick["title"], quick["chapter"], quick["refs"]) == ("labs.quick", "A quick wave", "labs",
                                                                             ["Test 1"])
    assert quick["steps"] == 6 and quick["stages"] == ["look", "see"]
    parameters = {p["name"]: p for p in quick["parameters"]}
    assert list(parameters) == ["amplitude", "runs", "order", "start", "shape", "filled", "seed", "last"]
    amplitude = parameters["amplitude"]
    assert (amplitude["kind"], amplitude["default"], amplitude["low"], amplitude["high"]) == ("float", 1.0, 0.0, 10.0)
    assert (amplitude["unit"], amplitude["label"]) == ("m", "Amplitude")
    assert parameters["start"]["default"] == [1.0, 2.0] and parameters["shape"]["options"] == ["round", "square wave"]
    assert quick["presets"] == {"high": {"amplitude": 9.0}, "early look": {"order": 5, "step": 1, "stage": "look"}}


def test_a_lesson_that_cannot_be_opened_does_not_hide_the_others(labs, tmp_path, capsys):
    folder = sample_lessons.write(tmp_path / "labs", "quick")
    (folder / "broken.py").write_text("import nothing_of_this_name\n", encoding="utf-8")
    assert main(["list", "--lessons", str(folder)]) == 1
    out, err = capsys.readouterr()
    assert "A quick wave" in out and "labs.broken cannot be opened: ModuleNotFoundError" in err
    good = tmp_path / "any.note"
    good.write_bytes(b"NOTE 1")
    assert main(["check", "--lessons", str(sample_lessons.write(folder, "picked")), "--map", str(good)]) == 0


def test_our_own_lessons_are_listed(capsys):
    assert main(["list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [lesson["id"] for lesson in found] == [entry.id for entry in Registry()]
    assert all(lesson["title"] and lesson["refs"] and lesson["summary"] for lesson in found)


def test_run(paikka):
    out = paikka("run", "labs.quick", "--set", "amplitude=2", "--step", "3")
    assert out.splitlines()[0] == "A quick wave \u2013 k = 3"
    assert re.search(r"^  Height: 1\.683 m$", out, re.MULTILINE)         # 2 sin(0.3 + 0.7)


def test_run_as_json(paikka):
    found = json.loads(paikka("run", "labs.quick", "--preset", "early look", "--set", "start=0.5,-1", "--set",
                              "filled=yes", "--set", "shape=square wave", "--json"))
    assert found["lesson"] == "labs.quick" and (found["step"], found["steps"], found["stage"]) == (1, 6, "look")
    assert found["params"]["start"] == [0.5, -1.0] and found["params"]["filled"] is True
    assert found["params"]["order"] == 5
    assert found["query"] == ("lesson=labs.quick&order=5&start=0.5,-1&shape=square%20wave&filled=1&step=1&stage=look")
    (height,) = found["readouts"]
    assert (height["name"], height["label"], height["unit"]) == ("height", "Height", "m") and height["value"] > 0
    assert found["scene"] == ["wave", "start", "now", "level"] and found["figures"] == ["height"]


def test_run_takes_a_stage_and_repeats_itself(paikka):
    options = ["run", "labs.quick", "--step", "2", "--stage", "look", "--json"]
    first = paikka(*options)
    assert json.loads(first)["stage"] == "look" and paikka(*options) == first


def test_check(labs, capsys, tmp_path):
    assert main(["check", "--lessons", str(sample_lessons.write(tmp_path / "labs", "quick"))]) == 0
    out = capsys.readouterr().out
    assert "All lessons are well." in out and "No Finnish words yet (English is shown): labs.quick" in out


def test_check_names_what_is_wrong(labs, capsys, tmp_path):
    folder = sample_lessons.write(tmp_path / "labs", "quick", "fragile")
    words = (folder / "quick.en.md").read_text(encoding="utf-8")
    (folder / "quick.en.md").write_text(
        words.replace("  order: {label: Order, hint: Unused.}, ", "").replace("$y =", r"$\frac{y =")
        .replace("legend: {", "legend: {ghost: boo, "), encoding="utf-8")
    (folder / "torn.py").write_text("import no_such_module\n", encoding="utf-8")
    assert main(["check", "--lessons", str(folder)]) == 1
    out = capsys.readouterr().out
    for text in ("labs.fragile: broken=1: compute raised ValueError: the matrix is <b>singular</b>",
                 "labs.quick: the words have no params: order", "labs.quick: the words have no hint for params: order",
                 "labs.quick: the legend names 'ghost'", "labs.quick: cannot typeset",
                 "labs.torn: cannot be loaded: ModuleNotFoundError", "No Finnish words yet"):
        assert text in out, out
    capsys.readouterr()
    assert main(["check", "--json", "--lessons", str(folder)]) == 1
    found = json.loads(capsys.readouterr().out)
    assert {p["lesson"] for p in found} == {"labs.fragile", "labs.quick", "labs.torn"}
    assert {p["problem"] for p in found if p["translation"]} == {"no Finnish words yet"}


# -- what it writes -------------------------------------------------------------------------------------------------


def test_export_json(paikka, tmp_path):
    path = tmp_path / "wave.json"
    paikka("export", "labs.quick", "--set", "amplitude=2", "--step", "3", "--to", str(path))
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["params"]["amplitude"] == 2.0 and found["step"] == 3
    (curve,) = found["figures"]["height"]
    assert curve["trace"] == "height" and len(curve["x"]) == len(curve["y"]) == 61
    wave = found["scene"][0]
    assert wave["kind"] == "Polyline" and wave["name"] == "wave" and len(wave["points"]) == 61


def test_export_csv(paikka, tmp_path):
    path = tmp_path / "wave.csv"
    paikka("export", "labs.quick", "--to", str(path))
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"))))
    assert rows[0] == ["figure", "trace", "x", "y"] and len(rows) == 62
    assert rows[1][:2] == ["height", "height"] and float(rows[1][2]) == 0.0
    paikka("export", "labs.quick", "--figure", "height", "--to", str(path))
    assert list(csv.reader(io.StringIO(path.read_text(encoding="utf-8")))) == rows


def test_the_same_scenario_is_the_same_file(paikka, tmp_path):
    for ending in ("json", "csv", "html"):
        paths = [tmp_path / f"{k}.{ending}" for k in range(2)]
        for path in paths:
            paikka("export", "labs.quick", "--preset", "high", "--to", str(path),
                   *(["--figure", "height"] if ending == "html" else []))
        first, second = (re.sub(r"[0-9a-f]{8}-[0-9a-f-]{27}", "", p.read_text(encoding="utf-8")) for p in paths)
        assert first == second


# -- errors ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("arguments", "names"), [
    (["run", "labs.quack"], ["LESSON", "labs.quack", "labs.quick"]),
    (["run"], ["LESSON"]),
    (["run", "labs.quick", "--set", "amplitude"], ["--set", "NAME=VALUE", "amplitude"]),
    (["run", "labs.quick", "--set", "colour=1"], ["--set", "colour", "amplitude, runs"]),
    (["run", "labs.quick", "--set", "amplitude=high"], ["--set", "amplitude", "a number from 0 to 10", "high"]),
    (["run", "labs.quick", "--set", "amplitude=11"], ["--set", "amplitude", "a number from 0 to 10", "11"]),
    (["run", "labs.quick", "--set", "amplitude=nan"], ["--set", "amplitude", "a finite number"]),
    (["run", "labs.quick", "--set", "amplitude=inf"], ["--set", "amplitude", "a finite number"]),
    (["run", "labs.quick", "--set", "order=2.5"], ["--set", "order", "a whole number"]),
    (["run", "labs.quick", "--set", "start=1"], ["--set", "start", "2 numbers"]),
    (["run", "labs.quick", "--set", "shape=flat"], ["--set", "shape", "round, square wave"]),
    (["run", "labs.quick", "--set", "filled=maybe"], ["--set", "filled", "1 or 0"]),
    (["run", "labs.quick", "--preset", "low"], ["--preset", "high, early look", "low"]),
    (["run", "labs.fragile", "--preset", "low"], ["--preset", "none", "low"]),
    (["run", "labs.quick", "--step", "7"], ["--step", "from 0 to 6", "7"]),
    (["run", "labs.quick", "--step", "-1"], ["--step", "from 0 to 6", "-1"]),
    (["run", "labs.quick", "--step", "two"], ["--step", "two"]),
    (["run", "labs.quick", "--stage", "hear"], ["--stage", "look, see", "hear"]),
    (["export", "labs.quick"], ["--to"]),
    (["export", "labs.quick", "--to", "wave.bmp"], ["--to", ".png", "wave.bmp"]),
    (["export", "labs.quick", "--to", "wave"], ["--to", ".png", "wave"]),
    (["export", "labs.quick", "--to", "missing/wave.json"], ["--to", "folder that exists", "missing"]),
    (["export", "labs.quick", "--to", "wave.svg"], ["--figure", "height"]),
    (["export", "labs.quick", "--to", "wave.svg", "--figure", "depth"], ["--figure", "height", "depth"]),
    (["export", "labs.fragile", "--to", "wave.csv", "--figure", "x"], ["--figure", "none", "x"]),
    (["export", "labs.quick", "--to", "wave.png", "--size", "big"], ["--size", "1920x1080", "big"]),
    (["export", "labs.quick", "--to", "wave.png", "--size", "8x99999"], ["--size", "8192", "8x99999"]),
    (["serve", "--port", "0"], ["--port", "1 to 65535", "'0'"]),
    (["serve", "--port", "http"], ["--port", "1 to 65535", "http"]),
    (["serve", "--port", "70000"], ["--port", "1 to 65535", "70000"]),
    (["serve", "--lesson", "labs.quack"], ["--lesson", "labs.quack", "labs.quick"]),
    (["serve", "--host", "192.0.2.1"], ["--host", "192.0.2.1"]),
    (["list", "--colour"], ["--colour"]),
    (["check", "--lessons", "missing"], ["--lessons", "folder", "missing"]),
], ids=lambda value: " ".join(value) if value[0] in ("run", "export", "serve", "list", "check") else "")
def test_errors_name_the_option_and_what_would_be_right(refused, arguments, names, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    message = refused(*arguments)
    assert all(name in message for name in names), message
    assert not list(tmp_path.iterdir())


def test_an_empty_folder_of_lessons(capsys, tmp_path):
    assert main(["list", "--lessons", str(tmp_path)]) == 2
    assert "--lessons" in capsys.readouterr().err


def test_a_failing_lesson_is_an_error_of_its_own(labs, capsys, tmp_path):
    for command in (["run"], ["export", "--to", str(tmp_path / "x.json")]):
        assert main([command[0], *labs, "labs.fragile", "--set", "broken=1", *command[1:]]) == 1
        assert capsys.readouterr().err == "paikka: labs.fragile failed: ValueError: the matrix is <b>singular</b>\n"
    assert not list(tmp_path.iterdir())


def test_an_unknown_command(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["fly"])
    assert stopped.value.code == 2 and "fly" in capsys.readouterr().err


# -- serve ----------------------------------------------------------------------------------------------------------


class Served:
    """`paikka serve` in a process of its own, on a port after one that is taken."""

    def __init__(self, folder: Path, *options: str) -> None:
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            self.taken = taken.getsockname()[1]
            self.process = subprocess.Popen(
                [sys.executable, "-m", "app.cli", "serve", "--no-open", "--port", str(self.taken), "--lessons",
                 str(folder), *options],
                cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "CI": "1"})
            self.lines: list[str] = []
            while not (self.lines and "Paikka is at" in self.lines[-1]):
                line = self.process.stdout.readline()
                assert line, self.process.communicate()[1]
                self.lines.append(line)
        self.port = int(re.search(r"http://127\.0\.0\.1:(\d+)", self.lines[-1])[1])

    def stop(self, number: int) -> tuple[int, float]:
        """Send the signal; exit code and seconds that it took."""
        begun = time.monotonic()
        self.process.send_signal(number)
        return self.process.wait(20), time.monotonic() - begun

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


@pytest.fixture
def serve(lesson_folder: Path) -> Iterator[Callable[..., Served]]:
    started: list[Served] = []

    def start(*options: str) -> Served:
        started.append(Served(lesson_folder, *options))
        return started[-1]

    yield start
    for served in started:
        served.close()


def test_serve_takes_the_next_port_and_ends_at_once_with_ctrl_c(serve):
    served = serve("--lesson", "labs.quick")
    assert served.taken < served.port < served.taken + 100
    assert any(f"Port {served.taken} is taken; using {served.port}." in line for line in served.lines)
    with urllib.request.urlopen(f"http://127.0.0.1:{served.port}/", timeout=20) as response:
        assert response.status == 200 and b"<html" in response.read()
    browser = FakeBrowser(served.port)
    browser.wait(lambda b: "/wave" in b.nodes)
    code, seconds = served.stop(signal.SIGINT)
    assert code == 0 and seconds < 2.0
    assert "Traceback" not in served.process.stderr.read()
    browser.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_serve_ends_also_while_a_lesson_computes_that_does_not_listen(serve, number):
    served = serve("--lesson", "labs.stubborn")
    browser = FakeBrowser(served.port)
    browser.wait(lambda b: "/target" in b.nodes)
    browser.set("Target", 9.0)
    until(lambda: "target=9" in (browser.scripts("setQuery") or [""])[-1])      # then it computes for half a minute
    code, seconds = served.stop(number)
    assert code == 0 and seconds < 2.0
    assert "Traceback" not in served.process.stderr.read()
    browser.close()
