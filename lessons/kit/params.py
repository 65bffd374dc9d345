"""What the user may vary: one dataclass field is one control, with its limits, unit and kind."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Literal

from lessons.kit.parameter import SEED_LIMIT, FileKind, Kind, Names, Parameter, Point, Points, Value

__all__ = ["Names", "Parameter", "Point", "Points", "Value", "choice", "datafile", "draggable", "names", "parameters",
           "points", "seed", "slider", "switch", "values"]


def slider(default: float | int, *, low: float, high: float, step: float | None = None, unit: str = "",
           log: bool = False, group: str = "") -> Any:
    """A number between `low` and `high`; an int default makes it a whole number.  `log` needs low > 0."""
    kind = "int" if isinstance(default, int) and not isinstance(default, bool) else "float"
    if log and low <= 0:
        raise ValueError(f"a logarithmic slider needs low > 0, got {low}")
    return _field(kind, default, low=low, high=high, step=step, unit=unit, log=log, group=group)


def choice(default: str, options: Sequence[str], *, group: str = "") -> Any:
    """One of `options`; their names for the user stand in the lesson's words."""
    return _field("choice", default, options=tuple(options), group=group)


def switch(default: bool, *, group: str = "") -> Any:
    """On or off."""
    return _field("switch", default, group=group)


def draggable(default: Sequence[float], *, low: float = -1000.0, high: float = 1000.0, unit: str = "m",
              plane: Literal["xy", "sphere", "free"] = "xy", role: str = "handle", group: str = "",
              click: bool = False, about: str = "") -> Any:
    """A point of 2 or 3 coordinates with a handle in the scene, and number fields.

    plane: "xy" drags in the horizontal plane through the point, "sphere" keeps the distance from the origin (a
    direction), "free" drags in the plane parallel to the picture.  click: a click into the scene moves it there.
    about: the point parameter that this one is an offset from; its handle stands at their sum.
    """
    return _field("point", tuple(float(v) for v in default), low=low, high=high, unit=unit, plane=plane, role=role,
                  group=group, click=click, about=about)


def points(default: Sequence[Sequence[float]] = (), *, limit: int = 24, low: float = -1000.0, high: float = 1000.0,
           unit: str = "m", role: str = "handle", group: str = "", click: bool = True) -> Any:
    """Any number of points of the plane, at most `limit`, each with a handle.  click: a click adds one there."""
    return _field("points", tuple(tuple(float(v) for v in p) for p in default), low=low, high=high, unit=unit,
                  role=role, group=group, limit=limit, click=click)


def names(default: Sequence[str] = (), *, limit: int = 32, group: str = "") -> Any:
    """Names of things in the scene, in order; usually set by clicks on the `targets` of a view."""
    return _field("names", tuple(default), group=group, limit=limit)


def datafile(kind: FileKind, *, group: str = "") -> Any:
    """A file that the user gives: "" (the lesson's own data), or the key of its bytes in `lessons.kit.files`."""
    return _field("file", "", group=group, file=kind)


def seed(default: int = 1, *, group: str = "") -> Any:
    """The seed of everything random; the control has a button for a new one."""
    return _field("seed", default, low=0, high=SEED_LIMIT, group=group)


def _field(kind: Kind, default: Value, **spec: Any) -> Any:
    return dataclasses.field(default=default, metadata={"parameter": {"kind": kind, **spec}})


@cache
def parameters(params: type) -> Mapping[str, Parameter]:
    """The controls of a Params dataclass by name, in the order of its fields."""
    found = {}
    for field in dataclasses.fields(params):
        if "parameter" not in field.metadata:
            raise TypeError(f"{params.__qualname__}.{field.name}: expected slider, choice, switch, draggable or seed")
        parameter = Parameter(field.name, default=field.default, **field.metadata["parameter"])
        parameter.validate(parameter.default)
        found[field.name] = parameter
    return found


def values(params: object) -> dict[str, Value]:
    """Names and values of a Params instance."""
    return {name: getattr(params, name) for name in parameters(type(params))}
