"""The command `paikka`: serve, list, run, export, check."""

import argparse
import json
import logging
import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from app.scenario import Scenario, with_moment, with_params, with_preset
from app.scenario import default as default_scenario
from lessons.kit.lesson import View, no_progress
from lessons.registry import Entry, Registry

USAGE_ERROR = 2


class UsageError(Exception):
    """Something in the command is wrong; the message names the option and what would be right."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 well, 1 something failed, 2 the command was wrong."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or (given[0].startswith("-") and given[0] not in ("-h", "--help", "--version")):
        given.insert(0, "serve")
    options = _parser().parse_args(given)
    logging.basicConfig(level=logging.INFO if getattr(options, "verbose", False) else logging.WARNING,
                        format="%(levelname)s %(name)s: %(message)s")
    try:
        return options.command(options)
    except UsageError as error:
        print(f"paikka: {error}", file=sys.stderr)
        return USAGE_ERROR
    except (RuntimeError, OSError) as error:
        print(f"paikka: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paikka", description="An interactive laboratory for the mathematics of positioning.",
        epilog="Without a command, the lessons are served.")
    parser.add_argument("--version", action="version", version=f"paikka {_version()}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, action: Any, help_text: str) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=help_text, description=help_text)
        made.set_defaults(command=action)
        made.add_argument("--lessons", metavar="DIR", type=Path, help="also take the lessons of this folder")
        return made

    serve = command("serve", _serve, "Serve the lessons to browsers on this machine.")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (default: only this machine)")
    serve.add_argument("--port", type=_port, default=8080, help="port; the next free one if it is taken")
    serve.add_argument("--lesson", metavar="ID", help="the lesson that opens first")
    serve.add_argument("--no-open", action="store_true", help="do not open a browser")
    serve.add_argument("--allow-host", action="append", default=[], metavar="NAME",
                       help="a name under which other machines may ask for this server; may be repeated")
    serve.add_argument("--verbose", action="store_true", help="log what happens")

    listing = command("list", _list, "List the lessons.")
    listing.add_argument("--json", action="store_true", help="with parameters and presets, as JSON")

    run = command("run", _run, "Compute a lesson without a browser and print its numbers.")
    _scenario_options(run)
    run.add_argument("--json", action="store_true", help="as JSON")

    export = command("export", _export, "Write a lesson's scene, a plot or its numbers to a file.")
    _scenario_options(export)
    export.add_argument("--to", required=True, type=Path, metavar="FILE",
                        help=".png (scene; plot with --figure), .svg, .pdf, .html (plot), .csv, .json (numbers)")
    export.add_argument("--size", type=_size, default=None, metavar="WxH", help="pixels, e.g. 1920x1080")
    export.add_argument("--transparent", action="store_true", help="no background")
    export.add_argument("--figure", metavar="NAME", help="the plot to write instead of the scene")
    export.add_argument("--no-legend", action="store_true", help="without caption and legend")

    check = command("check", _check, "Run every lesson at its default, presets and limits; print what is wrong.")
    check.add_argument("--json", action="store_true", help="as JSON")
    return parser


def _scenario_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("lesson", metavar="LESSON", help="id, as `paikka list` prints it")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="changes",
                        help="a parameter; may be repeated")
    parser.add_argument("--preset", metavar="NAME", help="start from this preset")
    parser.add_argument("--step", type=int, metavar="K", help="the step of the timeline")
    parser.add_argument("--stage", metavar="NAME", help="the stage within the step")


def _serve(options: argparse.Namespace) -> int:
    from app.server import App, free_port

    registry = _registry(options)
    if options.lesson:
        _entry(registry, options.lesson, "--lesson")
    try:
        port = free_port(options.host, options.port)
    except OSError as error:
        raise UsageError(f"--host/--port: {error}") from None
    if port != options.port:
        print(f"Port {options.port} is taken; using {port}.", flush=True)
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    app = App(registry, options.host, port, options.lesson, frozenset(n.lower() for n in options.allow_host))
    if options.host not in ("127.0.0.1", "localhost", "::1"):
        print("Other machines can reach this server: there are no passwords; serve only a network that you trust.")
    print(f"Paikka is at {app.url}  (Ctrl-C ends it)", flush=True)
    if not options.no_open and _can_open_browser():
        webbrowser.open(app.url)
    stopped.wait()
    print("\nGoodbye.", flush=True)
    closing = threading.Thread(target=app.stop, daemon=True)
    closing.start()
    closing.join(1.0)
    sys.stdout.flush()
    os._exit(0)  # viser's and our worker threads may still be in a long computation


def _list(options: argparse.Namespace) -> int:
    from app.check import overview

    found = [overview(entry) for entry in _registry(options)]
    if options.json:
        print(json.dumps(found, ensure_ascii=False, indent=1))
        return 0
    width = max(len(lesson["id"]) for lesson in found)
    for lesson in found:
        print(f"{lesson['id']:<{width}}  {lesson['title']}  ({', '.join(lesson['refs'])})")
    return 0


def _run(options: argparse.Namespace) -> int:
    from app.export.data_file import summary
    from app.text.numbers import readout_text

    entry, scenario = _scenario(options)
    view = _view(entry, scenario)
    words = entry.words()
    if options.json:
        print(json.dumps(summary(entry, scenario, view, words), ensure_ascii=False, indent=1, allow_nan=False))
        return 0
    print(words.title, f"\u2013 {view.caption}" if view.caption else "")
    for readout in view.readouts:
        print(f"  {words.label('readouts', readout.name)}: {readout_text(readout)} {readout.unit}".rstrip())
    return 0


def _export(options: argparse.Namespace) -> int:
    from app.export import data_file, figure_file

    kind = options.to.suffix[1:].lower()
    if kind not in ("csv", "json", *figure_file.FORMATS):
        raise UsageError(f"--to: expected a file that ends in .png, .svg, .pdf, .html, .csv or .json, "
                         f"got {options.to.name}")
    if not options.to.absolute().parent.is_dir():
        raise UsageError(f"--to: expected a file in a folder that exists, got {options.to}")
    entry, scenario = _scenario(options)
    words = entry.words()
    if kind == "png" and not options.figure:
        from app.export.scene_png import scene_png

        png = scene_png(_registry(options), scenario, options.size or (1920, 1080), options.transparent,
                        not options.no_legend)
        options.to.write_bytes(png)
        return 0
    view = _view(entry, scenario)
    if options.figure is not None and options.figure not in view.figures:
        raise UsageError(f"--figure: expected one of {', '.join(view.figures) or 'none'}, got {options.figure}")
    if kind == "csv":
        options.to.write_text(data_file.as_csv(view, options.figure), encoding="utf-8")
    elif kind == "json":
        options.to.write_text(data_file.as_json(entry, scenario, view, words), encoding="utf-8")
    elif options.figure is None:
        raise UsageError(f"--figure: .{kind} holds a plot; name one of {', '.join(view.figures)}")
    else:
        import plotly.graph_objects as go

        from app.figure_renderer import themed
        from app.theme import LIGHT

        size = options.size or (1200, 800)
        enlarge = size[1] / 480
        figure = themed(view.figures[options.figure], options.figure, words, LIGHT, size=enlarge, titled=True)
        if not options.transparent:
            figure["layout"].update(paper_bgcolor="white", plot_bgcolor="white")
        figure_file.write(go.Figure(figure), options.to, size)
    return 0


def _check(options: argparse.Namespace) -> int:
    from app.check import check_all

    problems = list(check_all(_registry(options)))
    wrong = [p for p in problems if not p.translation]
    if options.json:
        print(json.dumps([{"lesson": p.lesson, "problem": p.text, "translation": p.translation} for p in problems],
                         ensure_ascii=False, indent=1))
    else:
        for problem in wrong:
            print(f"{problem.lesson}: {problem.text}")
        if waiting := [p.lesson for p in problems if p.translation]:
            print(f"No Finnish words yet (English is shown): {', '.join(waiting)}")
        print(f"{len(wrong)} problems." if wrong else "All lessons are well.")
    return 1 if wrong else 0


def _registry(options: argparse.Namespace) -> Registry:
    try:
        return Registry(options.lessons)
    except ValueError as error:
        raise UsageError(f"--lessons: {error}") from None


def _entry(registry: Registry, lesson_id: str, option: str) -> Entry:
    try:
        return registry[lesson_id]
    except KeyError as error:
        raise UsageError(f"{option}: {error.args[0]}") from None


def _scenario(options: argparse.Namespace) -> tuple[Entry, Scenario]:
    entry = _entry(_registry(options), options.lesson, "LESSON")
    scenario = default_scenario(entry)
    try:
        if options.preset is not None:
            scenario = with_preset(scenario, entry, options.preset)
    except ValueError as error:
        raise UsageError(f"--preset: {error}") from None
    changes: dict[str, object] = {}
    for text in options.changes:
        name, found, value = text.partition("=")
        if not found:
            raise UsageError(f"--set: expected NAME=VALUE, got {text!r}")
        if name not in entry.parameters:
            raise UsageError(f"--set: unknown parameter {name!r} of {entry.id}; "
                             f"expected one of {', '.join(entry.parameters)}")
        try:
            changes[name] = entry.parameters[name].validate(entry.parameters[name].parse(value))
        except ValueError as error:
            raise UsageError(f"--set: {error}") from None
    if changes:
        scenario = with_params(scenario, entry, changes)
    timeline = entry.lesson.timeline_of(scenario.params)
    step, stage = scenario.moment.step, scenario.moment.stage
    if options.step is not None:
        if not 0 <= options.step <= timeline.steps:
            raise UsageError(f"--step: expected a whole number from 0 to {timeline.steps}, got {options.step}")
        step, stage = options.step, -1
    if options.stage is not None:
        if options.stage not in timeline.stages:
            raise UsageError(f"--stage: expected one of {', '.join(timeline.stages)}, got {options.stage}")
        stage = timeline.stages.index(options.stage)
    return entry, with_moment(scenario, entry, step, stage)


def _view(entry: Entry, scenario: Scenario) -> View:
    result = entry.lesson.compute(scenario.params, no_progress)
    return entry.lesson.view(scenario.params, result, scenario.moment)


def _port(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to 65535, got {text!r}")
    return int(text)


def _size(text: str) -> tuple[int, int]:
    from app.picture import MAX_SIDE

    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and 16 <= int(width) <= MAX_SIDE and 16 <= int(height) <= MAX_SIDE):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, each 16 to {MAX_SIDE}, e.g. 1920x1080, got {text!r}")
    return int(width), int(height)


def _can_open_browser() -> bool:
    if os.environ.get("CI"):
        return False
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _version() -> str:
    try:
        return version("paikka")
    except PackageNotFoundError:
        return "0 (not installed)"


if __name__ == "__main__":
    sys.exit(main())
