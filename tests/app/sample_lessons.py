"""Small lessons for tests of the app, written to a folder as a user's own would be."""

from pathlib import Path

QUICK = '''
from dataclasses import dataclass
import numpy as np
from core.types import Gaussian
from lessons.kit import figures, scene
from lessons.kit.equations import Equation
from lessons.kit.lesson import Lesson, Readout, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider, switch

@dataclass(frozen=True, slots=True)
class Params:
    """One of each kind."""
    amplitude: float = slider(1.0, low=0.0, high=10.0, step=0.1, unit="m")
    runs: int = slider(100, low=10, high=100_000, log=True, group="more")
    order: int = slider(2, low=0, high=9)
    start: Point = draggable((1.0, 2.0), low=-10.0, high=10.0)
    shape: str = choice("round", ("round", "square wave"), group="more")
    filled: bool = switch(False, group="more")
    seed: int = seed(7)
    last: int = slider(6, low=1, high=60)

COMPUTED = []

def compute(p, progress):
    COMPUTED.append(p)
    x = np.linspace(0.0, 6.0, 61)
    return np.column_stack([x, p.amplitude * np.sin(x + 0.1 * p.seed)])

def view(p, wave, at):
    items = [scene.Polyline("wave", wave), scene.Points("start", [p.start], role="prior"),
             scene.Points("now", wave[at.step:at.step + 1], size=12)]
    if p.filled:
        items.append(scene.LevelEllipse("level", Gaussian(np.zeros(2), np.eye(2)), filled=True))
    chart = figures.chart(figures.line("height", wave[:, 0], wave[:, 1], "truth"))
    return View(items, scene.Plane((-1.0, 7.0), (-10.0, 10.0)), {"height": chart},
                [Readout("height", float(wave[at.step, 1]), "m")],
                [Equation("height", (r"y = a \\sin x =", wave[at.step]), current=at.stage == 1)],
                caption=f"k = {at.step}")

LESSON = Lesson(Params, compute, view, refs=("Test 1",), timeline=lambda p: Timeline(p.last, ("look", "see"), start=2),
                presets={"high": {"amplitude": 9.0}, "early look": {"order": 5, "step": 1, "stage": "look"}})
'''

QUICK_WORDS = '''---
title: A quick wave
summary: For tests.
params: {amplitude: {label: Amplitude, hint: How high.}, runs: {label: Runs, hint: How often.},
  order: {label: Order, hint: Unused.}, start: {label: Start, hint: Where.}, shape: {label: Shape, hint: Which.},
  filled: {label: Filled, hint: Or not.}, seed: {label: Seed, hint: Chance.}, last: {label: Last step, hint: Steps.}}
options: {shape: {round: "a round one"}}
groups: {more: More}
stages: {look: Look, see: See}
presets: {high: High., early look: Early.}
readouts: {height: Height}
equations: {height: Height}
figures: {height: {title: Height of the wave, x: "x (m)", y: "y (m)", traces: {height: the wave}}}
legend: {wave: the wave}
---
# Idea
A wave $y = a \\sin x$.
# What to try
Slide.
# Questions
Why?
'''

STILL = '''
import time
from dataclasses import dataclass
import numpy as np
from lessons.kit import scene
from lessons.kit.lesson import Lesson, Readout, View
from lessons.kit.params import slider, switch

@dataclass(frozen=True, slots=True)
class Params:
    """A number, and whether it fails."""
    target: float = slider(0.0, low=0.0, high=100.0)
    broken: bool = switch(False)

%s

def view(p, result, at):
    return View([scene.Points("target", [(result, 0.0)])], scene.Plane((0.0, 100.0), (-50.0, 50.0)),
                readouts=[Readout("target", result)])

LESSON = Lesson(Params, compute, view)
'''

SLOW = STILL % '''
BEGUN, DONE = [], []

def compute(p, progress):
    """One second of work on large arrays, as in a particle filter."""
    if p.target == 0.0:
        return 0.0
    BEGUN.append(p.target)
    x, begun = np.full(100_000, p.target), time.monotonic()
    while (spent := time.monotonic() - begun) < 1.0:
        x = np.sin(x) + p.target
        progress(spent)
    DONE.append(p.target)
    return p.target
'''

FRAGILE = STILL % '''
def compute(p, progress):
    if p.broken:
        raise ValueError("the matrix is <b>singular</b>")
    return p.target
'''

STUBBORN = STILL % '''
def compute(p, progress):
    """Never asks whether anybody still waits."""
    if p.target > 0:
        time.sleep(30.0)
    return p.target
'''

PICKED = '''
from dataclasses import dataclass
from lessons.kit import files, scene
from lessons.kit.lesson import Lesson, Readout, Target, View
from lessons.kit.parameter import FileKind
from lessons.kit.params import Names, Point, Points, datafile, draggable, names, points, switch

def check(content):
    if not content.startswith(b"NOTE 1"):
        raise ValueError("line 1: expected NOTE 1")

NOTE = FileKind("a note", (".note",), lambda content: content.startswith(b"NOTE"), check)
CORNERS = {"a": (-40.0, -40.0), "b": (40.0, -40.0)}

@dataclass(frozen=True, slots=True)
class Params:
    """What is set by clicks and files."""
    route: Names = names((), limit=3)
    fixes: Points = points(((10.0, 10.0),), limit=3, low=-50.0, high=50.0)
    start: Point = draggable((0.0, 20.0), low=-50.0, high=50.0, click=True)
    tip: Point = draggable((10.0, 0.0), low=-50.0, high=50.0, about="start")
    note: str = datafile(NOTE)
    hidden: bool = switch(False)

def compute(p, progress):
    return len(files.get(p.note).content) if p.note else 0

def view(p, size, at):
    targets = [Target(xy, {"route": (*p.route, name)}) for name, xy in CORNERS.items() if len(p.route) < 3]
    return View([scene.Points("corners", list(CORNERS.values()))], scene.Plane((-50.0, 50.0), (-50.0, 50.0)),
                readouts=[Readout("bytes", size, "B")], targets=targets)

LESSON = Lesson(Params, compute, view, unused=lambda p: {"fixes"} if p.hidden else ())
'''

PICKED_WORDS = '''---
title: Picked
summary: For tests.
params: {route: {label: Route, hint: Clicks.}, fixes: {label: Fixes, hint: Clicks.},
  start: {label: Start, hint: Click.}, tip: {label: Tip, hint: From start.},
  note: {label: Note, hint: File.}, hidden: {label: Hidden, hint: No list.}}
readouts: {bytes: Size}
---
# Idea
Click.
# What to try
Load.
# Questions
None.
'''

SHORT_WORDS = '''---
title: %s
summary: For tests.
params: {target: {label: Target, hint: A number.}, broken: {label: Broken, hint: Fails.}}
readouts: {target: Target}
---
# Idea
One number.
# What to try
Slide.
# Questions
None.
'''

LESSONS = {"quick": (QUICK, QUICK_WORDS), "picked": (PICKED, PICKED_WORDS), "slow": (SLOW, SHORT_WORDS % "Slow"),
           "fragile": (FRAGILE, SHORT_WORDS % "Fragile"), "stubborn": (STUBBORN, SHORT_WORDS % "Stubborn")}


def write(folder: Path, *names: str) -> Path:
    """Write these lessons (all of them if none is named) into `folder` and return it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or LESSONS:
        code, words = LESSONS[name]
        (folder / f"{name}.py").write_text(code, encoding="utf-8")
        (folder / f"{name}.en.md").write_text(words, encoding="utf-8")
    return folder
