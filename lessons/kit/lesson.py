"""A lesson: parameters, a slow pure `compute`, a fast pure `view`, and a timeline."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from lessons.kit.equations import Equation
from lessons.kit.scene import Camera, Item

if TYPE_CHECKING:
    import plotly.graph_objects as go


class Cancelled(Exception):
    """Raised by a Progress callable when nobody waits for this result any more."""


class Progress(Protocol):
    """Call it now and then with the share that is done, 0 to 1; it raises Cancelled when the work became useless."""

    def __call__(self, fraction: float) -> None: ...


def no_progress(fraction: float) -> None:
    """A Progress for scripts and tests."""


@dataclass(frozen=True, slots=True)
class Moment:
    """Where on the timeline we look: step 0..steps, and the stage within the step."""

    step: int = 0
    stage: int = 0


@dataclass(frozen=True, slots=True)
class Timeline:
    """Steps 0..steps; each of them opens into `stages` (ids whose names stand in the words).

    start: the step shown first; start_stage: its stage (-1 is the last).  unit and scale turn a step into what the
    user reads: unit_name = step * scale unit, e.g. "t = 3.5 s" with scale=0.5, unit="s".
    """

    steps: int
    stages: tuple[str, ...] = ("all",)
    start: int = 0
    start_stage: int = -1
    scale: float = 1.0
    unit: str = ""
    unit_name: str = "t"

    def clamp(self, step: int, stage: int) -> Moment:
        """The nearest moment on this timeline; stage -1 means the last one."""
        last = len(self.stages) - 1
        return Moment(min(max(step, 0), self.steps), last if stage < 0 else min(stage, last))

    @property
    def first_shown(self) -> Moment:
        return self.clamp(self.start, self.start_stage)


@dataclass(frozen=True, slots=True)
class Readout:
    """One number for the user: its label stands in the words, its unit here.

    value: a number (an int is shown whole), a text, or None (shown as a dash).  digits: significant digits.
    """

    name: str
    value: float | str | None
    unit: str = ""
    digits: int = 4


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A place in the scene that can be clicked: the click sets `changes` (parameter names to values).

    Of several the one nearest to the pointer counts, within 18 pixels of it.
    """

    position: Sequence[float]
    changes: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Everything that is shown at one moment, as plain data.

    scene: what the 3-D window draws; camera: what it must show (depends on the result, not on the moment, so that
    it stands still in time).  figures: plotly figures by id.  equations: the algorithm's lines with this moment's
    numbers in them.  caption: a short line over the scene ("t = 12 s").  note: a sentence that the user must know
    ("2,000 of 1,000,000 particles are drawn").  targets: what can be clicked.
    """

    scene: Sequence[Item]
    camera: Camera
    figures: Mapping[str, "go.Figure"] = field(default_factory=dict)
    readouts: Sequence[Readout] = ()
    equations: Sequence[Equation] = ()
    caption: str = ""
    note: str = ""
    targets: Sequence[Target] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """The mathematics of one lesson; its words lie beside it in Markdown.

    presets: name -> changed parameters; the keys "step" and "stage" may be among them.  timeline: None (a still
    picture), or a function of the parameters.  unused: names of the parameters that have no effect at the others'
    values; their controls and handles are hidden.  budget_s: time that compute may take at the default.
    """

    Params: type
    compute: Callable[[Any, Progress], Any]
    view: Callable[[Any, Any, Moment], View]
    refs: tuple[str, ...] = ()
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    timeline: Callable[[Any], Timeline] | None = None
    unused: Callable[[Any], Collection[str]] | None = None
    budget_s: float = 1.0

    def timeline_of(self, params: Any) -> Timeline:
        """The timeline at these parameters; a still picture has one step with one stage."""
        return self.timeline(params) if self.timeline else Timeline(0)

    def unused_at(self, params: Any) -> Collection[str]:
        """Names of the parameters without effect at these."""
        return self.unused(params) if self.unused else ()
