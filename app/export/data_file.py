"""A lesson's numbers: readouts, plots and scene as JSON, the plots' curves as CSV."""

import csv
import dataclasses
import io
import json
import math
from typing import Any

import numpy as np

from app.scenario import Scenario, to_query
from lessons.kit.lesson import View
from lessons.kit.params import values
from lessons.kit.words import Words
from lessons.registry import Entry


def plain(value: Any) -> Any:
    """value as JSON knows it: arrays as lists, records as objects, no NaN or infinity (null)."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    return value


def summary(entry: Entry, scenario: Scenario, view: View, words: Words) -> dict[str, Any]:
    """What `paikka run` prints: scenario, readouts with units, names of scene items and figures."""
    timeline = entry.lesson.timeline_of(scenario.params)
    return plain({
        "lesson": scenario.lesson, "title": words.title, "params": values(scenario.params),
        "step": scenario.moment.step, "steps": timeline.steps, "stage": timeline.stages[scenario.moment.stage],
        "query": to_query(scenario, entry), "caption": view.caption, "note": view.note,
        "readouts": [{"name": r.name, "label": words.label("readouts", r.name), "value": r.value, "unit": r.unit}
                     for r in view.readouts],
        "scene": [item.name for item in view.scene], "figures": list(view.figures),
    })


def as_json(entry: Entry, scenario: Scenario, view: View, words: Words) -> str:
    """The summary with the data of every figure and scene item."""
    return json.dumps(everything(entry, scenario, view, words), ensure_ascii=False, indent=1, allow_nan=False) + "\n"


def everything(entry: Entry, scenario: Scenario, view: View, words: Words) -> dict[str, Any]:
    """What `as_json` writes."""
    found = summary(entry, scenario, view, words)
    found["figures"] = {name: [{"trace": t.meta["key"], "x": plain(np.asarray(t.x)), "y": plain(np.asarray(t.y))}
                               for t in figure.data if t.meta] for name, figure in view.figures.items()}
    found["scene"] = [{"kind": type(item).__name__, **plain(item)} for item in view.scene]
    return found


def as_csv(view: View, figure: str | None = None) -> str:
    """Rows figure, trace, x, y of all plots, or of one."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["figure", "trace", "x", "y"])
    for name, drawn in view.figures.items():
        if figure is not None and name != figure:
            continue
        for trace in drawn.data:
            if trace.meta and trace.x is not None and trace.y is not None:
                table.writerows([name, trace.meta["key"], x, y] for x, y in zip(trace.x, trace.y, strict=True))
    return out.getvalue()
