"""The timeline: play and pause, steps and stages in both directions, a scrubber and the speed."""

import asyncio
from collections.abc import Callable
from typing import Any

from app.scenario import Scenario
from lessons.kit.lesson import Moment, Timeline
from lessons.kit.words import Words

STEP_BACK, STAGE_BACK, STAGE_ON, STEP_ON = "\u25c2\u25c2 step", "\u25c2 stage", "stage \u25b8", "step \u25b8\u25b8"
PLAY, PAUSE = "\u25b6  Play", "\u275a\u275a  Pause"
SPEEDS = {"1 step/s": 1.0, "2 steps/s": 2.0, "5 steps/s": 5.0, "10 steps/s": 10.0, "20 steps/s": 20.0}

STAGE_SECONDS = 1.5

Go = Callable[[int, int], None]


def moves(timeline: Timeline) -> bool:
    """Whether there is anything to play."""
    return timeline.steps > 0 or len(timeline.stages) > 1


class Transport:
    """The timeline's widgets.

    `go(step, stage)` moves the scenario, `now()` is its moment (perhaps newer than what is shown), and `ready()`
    tells whether it has been drawn.
    """

    def __init__(self, gui: Any, go: Go, now: Callable[[], Moment], ready: Callable[[], bool]) -> None:
        self._gui = gui
        self._go = go
        self._now = now
        self._ready = ready
        self._timeline = Timeline(0)
        self._step = 0  # the one shown
        self._task: asyncio.Task[None] | None = None
        self._moves = gui.add_button_group("", (STEP_BACK, STAGE_BACK, STAGE_ON, STEP_ON),
                                           hint="Backwards or forwards: N and B, Shift+N and Shift+B")
        self._moves.on_click(self._moved)
        self._play = gui.add_button(PLAY)
        self._play.on_click(self._toggled)
        self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="5 steps/s")
        self._scrubber: Any = None
        self._stages: Any = None
        self._stage_names: list[str] = []

    @property
    def playing(self) -> bool:
        return self._task is not None and not self._task.done()

    def rebuild(self, timeline: Timeline, words: Words) -> None:
        """Widgets for another timeline: the scrubber's range and the names of the stages."""
        names = [words.label("stages", stage) for stage in timeline.stages]
        before, self._timeline = (self._timeline.steps, self._stage_names), timeline
        if before == (timeline.steps, names):
            return  # only the scale differs: widgets that the user may hold stay, and `show` changes the label
        self._stage_names = names
        for widget in (self._scrubber, self._stages):
            if widget is not None:
                widget.remove()
        self._scrubber, self._stages = None, None
        if timeline.steps > 0:
            self._scrubber = self._gui.add_slider(self._label(), 0, timeline.steps, 1, 0)

            async def scrubbed(event: Any) -> None:
                if event.client is not None:
                    stage = self._now().stage
                    self._go(int(self._scrubber.value), -1 if stage == len(timeline.stages) - 1 else stage)

            self._scrubber.on_update(scrubbed)
        if len(timeline.stages) > 1:
            self._stages = self._gui.add_button_group("Stage", tuple(names))

            async def chosen(event: Any) -> None:
                if event.client is not None and self._stages.value in names:
                    self._go(self._now().step, names.index(self._stages.value))

            self._stages.on_click(chosen)

    def show(self, scenario: Scenario) -> None:
        """Set the widgets to the scenario's moment."""
        self._step = scenario.moment.step
        if self._scrubber is not None:
            self._scrubber.value = self._step
            self._scrubber.label = self._label()
        if self._stages is not None:
            self._stages.label = f"Stage: {self._stage_names[scenario.moment.stage]}"

    def step(self, by: int) -> None:
        """`by` steps on, at the same kind of moment: all stages done."""
        self._go(self._now().step + by, -1)

    def stage(self, by: int) -> None:
        """One stage on or back, across the borders of steps."""
        last = len(self._timeline.stages) - 1
        step, stage = self._now().step, self._now().stage + by
        if stage > last:
            step, stage = step + 1, 0
        elif stage < 0:
            step, stage = step - 1, last
        if 0 <= step <= self._timeline.steps:
            self._go(step, stage)

    def toggle(self) -> None:
        """Play, or stop playing; from the end it plays from the start.  Call it on the event loop."""
        if self.playing:
            self.stop()
        elif moves(self._timeline):
            self._play.label = PAUSE
            self._task = asyncio.get_running_loop().create_task(self._run())

    def stop(self) -> None:
        task, self._task = self._task, None
        if task is not None and not task.done():
            task.get_loop().call_soon_threadsafe(task.cancel)
            self._play.label = PLAY

    async def _run(self) -> None:
        try:
            at, last, still = self._progress()
            if at >= last:
                at = -1
            while at < last:
                self._go(*((0, at + 1) if still else (at + 1, -1)))
                await asyncio.sleep(1.0 / SPEEDS.get(self._speed.value, 5.0) if not still else STAGE_SECONDS)
                while not self._ready():
                    await asyncio.sleep(0.02)
                at, last, still = self._progress()
        finally:
            self._play.label = PLAY

    def _progress(self) -> tuple[int, int, bool]:
        """How far the timeline has played, its end, and whether it is the stages that play (there is one step)."""
        still = self._timeline.steps == 0
        return ((self._now().stage, len(self._timeline.stages) - 1, True) if still
                else (self._now().step, self._timeline.steps, False))

    async def _moved(self, event: Any) -> None:
        self.stop()
        {STEP_BACK: lambda: self.step(-1), STAGE_BACK: lambda: self.stage(-1), STAGE_ON: lambda: self.stage(1),
         STEP_ON: lambda: self.step(1)}.get(self._moves.value, lambda: None)()

    async def _toggled(self, event: Any) -> None:
        self.toggle()

    def _label(self) -> str:
        timeline = self._timeline
        if not timeline.unit:
            return f"Step {self._step}"
        return f"{timeline.unit_name} = {self._step * timeline.scale:g} {timeline.unit}"
