"""What the tests of single lessons share: presets, results that are computed once, views and their numbers."""

from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import ziamath

from core.types import Gaussian
from lessons.kit.lesson import Moment, View, no_progress
from lessons.kit.params import parameters


class Desk:
    """One lesson's module on the desk; results are kept, so that tests of the same scenario share one."""

    def __init__(self, lesson: ModuleType) -> None:
        self._module = lesson
        self.lesson = lesson.LESSON
        self.default = self.lesson.Params()
        self.result = cache(lambda p: self._module.compute(p, no_progress))

    def params(self, **changes: Any) -> Any:
        return replace(self.default, **changes)

    def preset(self, name: str, **changes: Any) -> Any:
        """The parameters of a preset."""
        given = {k: v for k, v in self.lesson.presets[name].items() if k not in ("step", "stage")}
        return replace(self.default, **{**given, **changes})

    def view(self, p: Any = None, step: int | None = None, stage: int = -1) -> View:
        """The view at a step (default: the one shown first) and stage (default: the last)."""
        p = self.default if p is None else p
        timeline = self.lesson.timeline_of(p)
        at: Moment = timeline.first_shown if step is None else timeline.clamp(step, stage)
        return self.lesson.view(p, self.result(p), at)

    def readouts(self, p: Any = None, step: int | None = None, stage: int = -1) -> dict[str, Any]:
        return {r.name: r.value for r in self.view(p, step, stage).readouts}

    def items(self, p: Any = None, step: int | None = None, stage: int = -1) -> dict[str, Any]:
        """The things in the scene by name."""
        return {item.name: item for item in self.view(p, step, stage).scene}

    def ends(self) -> list[dict[str, Any]]:
        """Both ends of every parameter, and every choice, one at a time."""
        found: list[dict[str, Any]] = []
        for name, q in parameters(self.lesson.Params).items():
            match q.kind:
                case "choice":
                    values: list[Any] = list(q.options)
                case "switch":
                    values = [True, False]
                case "point":
                    values = [(q.low,) * len(q.default), (q.high,) * len(q.default)]  # type: ignore[arg-type]
                case "points" | "names" | "file":
                    values = []
                case "int" | "seed":
                    values = [int(q.low), int(q.high)]
                case _:
                    values = [q.low, q.high]
            found += [{name: value} for value in values]
        return found


@cache
def typeset(latex: str) -> None:
    """Fails where the app cannot show this formula."""
    ziamath.Latex(latex)


def check_formulas(view: View) -> None:
    """Fails where the app cannot show a formula, or a number in it is not finite."""
    for e in view.equations:
        for piece in e.pieces:
            if isinstance(piece, str):
                typeset(piece)
            else:
                assert np.isfinite(piece).all(), f"{e.name}: {piece}"


def check_plots(view: View) -> None:
    """Fails where a plot has a point that is not finite."""
    for name, figure in view.figures.items():
        for trace in figure.data:
            for values in (trace.x, trace.y):
                assert np.isfinite(np.asarray(values, dtype=float)).all(), f"{name}: {trace.meta}"


def names(view: View) -> set[str]:
    """What is in the scene."""
    return {item.name for item in view.scene}


def everything(view: View) -> bytes:
    """All numbers that a view holds, as float64: equal for equal views, and to be searched for what is not finite."""
    return np.concatenate([np.ravel(v) for v in _numbers(view)]).astype(np.float64).tobytes()


def _numbers(view: View) -> Iterator[Any]:
    found = [getattr(item, field.name) for item in view.scene for field in fields(item)]
    found += [values for figure in view.figures.values() for trace in figure.data for values in (trace.x, trace.y)]
    found += [piece for e in view.equations for piece in e.pieces]
    found += [readout.value for readout in view.readouts]
    for value in found:
        for part in value if isinstance(value, Gaussian) else (value,):
            if np.asarray(part).dtype.kind in "biuf":        # no text, and nothing for None
                yield part
