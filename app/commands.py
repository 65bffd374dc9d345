"""What the commands of `paikka` do; each takes the parsed options and returns the exit code."""

import argparse
import json
import os
import signal
import sys
import threading
import webbrowser

from app.scenario import Scenario, with_moment, with_params, with_preset
from app.scenario import default as default_scenario
from lessons.kit.lesson import View, no_progress
from lessons.registry import Entry, Registry


class UsageError(Exception):
    """Something in the command is wrong; the message names the option and what would be right."""


def serve(options: argparse.Namespace) -> int:
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


def list_lessons(options: argparse.Namespace) -> int:
    from app.check import overview

    found, broken = [], []
    for entry in _registry(options):
        try:
            found.append(overview(entry))
        except Exception as error:
            broken.append(f"{entry.id} cannot be opened: {type(error).__name__}: {error}")
    if options.json:
        print(json.dumps(found, ensure_ascii=False, indent=1))
    else:
        width = max((len(lesson["id"]) for lesson in found), default=0)
        for lesson in found:
            print(f"{lesson['id']:<{width}}  {lesson['title']}  ({', '.join(lesson['refs'])})")
    for line in broken:
        print(f"paikka: {line}", file=sys.stderr)
    return 1 if broken else 0


def run(options: argparse.Namespace) -> int:
    from app.export.data_file import summary
    from app.text.numbers import readout_text

    entry, scenario = _scenario(_registry(options), options)
    view = _view(entry, scenario)
    words = entry.words()
    if options.json:
        print(json.dumps(summary(entry, scenario, view, words), ensure_ascii=False, indent=1, allow_nan=False))
        return 0
    print(words.title, f"\u2013 {view.caption}" if view.caption else "")
    for readout in view.readouts:
        print(f"  {words.label('readouts', readout.name)}: {readout_text(readout)} {readout.unit}".rstrip())
    return 0


def export(options: argparse.Namespace) -> int:
    from app.export import data_file, figure_file

    kind = options.to.suffix[1:].lower()
    if kind not in ("csv", "json", *figure_file.FORMATS):
        raise UsageError(f"--to: expected a file that ends in .png, .svg, .pdf, .html, .csv or .json, "
                         f"got {options.to.name}")
    if not options.to.absolute().parent.is_dir():
        raise UsageError(f"--to: expected a file in a folder that exists, got {options.to}")
    registry = _registry(options)
    entry, scenario = _scenario(registry, options)
    words = entry.words()
    if kind == "png" and not options.figure:
        from app.export.scene_png import scene_png

        png = scene_png(registry, scenario, options.size or (1920, 1080), options.transparent,
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


def check(options: argparse.Namespace) -> int:
    from app.check import check_all

    if options.files:
        return _check_files(options)
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


def study(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    from app import study as studies
    from lessons.indoor._building import building

    if len(options.files) > 1:
        raise UsageError("--map: expected one map, as a study compares filters on one building")
    house = building(_registry(options)["indoor.floor_graph"].start.map if options.files else "")
    settings = studies.Settings(options.routes, options.seeds, particles=options.particles,
                                map=studies.fingerprint(house))
    try:
        bars: list[tqdm] = []    # none before the folder has been looked at

        def progress(done: int, total: int) -> None:
            if not bars:
                bars.append(tqdm(total=total, initial=done, unit="run", dynamic_ncols=True))
            bars[0].update(done - bars[0].n)

        try:
            lines = studies.run(house, settings, options.to, progress)
        finally:
            for bar in bars:
                bar.close()
    except KeyboardInterrupt:
        print(f"Interrupted; the same command goes on from {options.to / studies.RUNS}.", file=sys.stderr)
        return 130
    except ValueError as error:
        raise UsageError(f"study: {error}") from None
    print(studies.as_markdown(lines))
    print(f"Written: {options.to / studies.TABLE_CSV}, {options.to / studies.TABLE_MD}")
    return 0


def _check_files(options: argparse.Namespace) -> int:
    """Say of each file whether lessons can use it."""
    from app import given

    registry, wrong = _registry(options), 0
    for path in options.files:
        try:
            kind, _ = given.read(path, registry)
        except ValueError as error:
            wrong += 1
            print(error)
        else:
            print(f"{path}: {kind}, and all is well with it.")
    return 1 if wrong else 0


def _registry(options: argparse.Namespace) -> Registry:
    from app import given

    try:
        registry = Registry(options.lessons)
    except ValueError as error:
        raise UsageError(f"--lessons: {error}") from None
    if options.command is check or not getattr(options, "files", []):
        return registry
    try:
        return Registry(options.lessons, dict(given.read(path, registry) for path in options.files))
    except ValueError as error:
        raise UsageError(f"--data: {error}") from None


def _entry(registry: Registry, lesson_id: str, option: str) -> Entry:
    try:
        return registry[lesson_id]
    except KeyError as error:
        raise UsageError(f"{option}: {error.args[0]}") from None


def _scenario(registry: Registry, options: argparse.Namespace) -> tuple[Entry, Scenario]:
    entry = _entry(registry, options.lesson, "LESSON")
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
    try:
        result = entry.lesson.compute(scenario.params, no_progress)
        return entry.lesson.view(scenario.params, result, scenario.moment)
    except Exception as error:
        raise RuntimeError(f"{entry.id} failed: {type(error).__name__}: {error}") from error


def _can_open_browser() -> bool:
    if os.environ.get("CI"):
        return False
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
