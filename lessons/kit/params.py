"""What the user may vary: one dataclass field is one control, with its limits, unit and kind."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

Kind = Literal["float", "int", "choice", "switch", "point", "seed"]
Point = tuple[float, ...]
Value = float | int | str | bool | Point

SEED_LIMIT = 2**31 - 1


@dataclass(frozen=True, slots=True)
class Parameter:
    """One control: its kind, default, limits (inclusive), unit and how it is drawn."""

    name: str
    kind: Kind
    default: Value
    low: float = -math.inf
    high: float = math.inf
    step: float | None = None
    unit: str = ""
    log: bool = False
    options: tuple[str, ...] = ()
    plane: str = "xy"
    role: str = "handle"
    group: str = ""

    def validate(self, value: object) -> Value:
        """value as this parameter's type, or ValueError saying what would be right."""
        match self.kind:
            case "switch":
                if isinstance(value, bool):
                    return value
                raise self._error("true or false", value)
            case "choice":
                if isinstance(value, str) and value in self.options:
                    return value
                raise self._error("one of " + ", ".join(self.options), value)
            case "point":
                n = len(self.default)  # type: ignore[arg-type]
                if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != n:
                    raise self._error(f"{n} numbers", value)
                return tuple(self._number(v) for v in value)
            case "int" | "seed":
                number = self._number(value)
                if number != int(number):
                    raise self._error("a whole number", value)
                return int(number)
            case _:
                return self._number(value)

    def nearest(self, value: object) -> Value:
        """The valid value closest to `value`; the default if there is no closest one."""
        try:
            match self.kind:
                case "float":
                    return self.validate(self._clip(value))
                case "int" | "seed":
                    return self.validate(round(self._clip(value)))
                case "point":
                    return self.validate([self._clip(v) for v in value])  # type: ignore[union-attr]
        except (TypeError, ValueError, OverflowError):
            pass
        try:
            return self.validate(value)
        except ValueError:
            return self.default

    def parse(self, text: str) -> object:
        """The raw value that `text` writes (not yet validated); ValueError when it is not of this kind at all."""
        match self.kind:
            case "switch":
                words = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
                if text.lower() not in words:
                    raise self._error("1 or 0", text)
                return words[text.lower()]
            case "choice":
                return text
            case "point":
                return tuple(self._parse_number(part) for part in text.split(","))
            case "int" | "seed":
                number = self._parse_number(text)
                return int(number) if math.isfinite(number) and number == int(number) else number
            case _:
                return self._parse_number(text)

    def format(self, value: Value) -> str:
        """Text that `parse` reads back to exactly `value`."""
        match self.kind:
            case "switch":
                return "1" if value else "0"
            case "choice":
                return str(value)
            case "point":
                return ",".join(f"{v!r}".removesuffix(".0") for v in value)  # type: ignore[union-attr]
            case "int" | "seed":
                return str(value)
            case _:
                return f"{value!r}".removesuffix(".0")

    @property
    def expected(self) -> str:
        """What would be right, in words."""
        match self.kind:
            case "switch":
                return "1 or 0"
            case "choice":
                return "one of " + ", ".join(self.options)
            case "point":
                return f"{len(self.default)} numbers from {self.low:g} to {self.high:g}"  # type: ignore[arg-type]
            case "int" | "seed":
                return f"a whole number from {int(self.low)} to {int(self.high)}"
            case _:
                return f"a number from {self.low:g} to {self.high:g}"

    def _parse_number(self, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise self._error(self.expected, text) from None

    def _number(self, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not -math.inf < value < math.inf:
            raise self._error("a finite number", value)
        if not self.low <= value <= self.high:
            raise self._error(self.expected, value)
        return float(value)

    def _clip(self, value: object) -> float:
        if not isinstance(value, (int, float)) or value != value:
            raise self._error("a number", value)
        return min(max(value, self.low), self.high)

    def _error(self, expected: str, got: object) -> ValueError:
        return ValueError(f"{self.name}: expected {expected}, got {got!r:.60}")


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
              plane: Literal["xy", "sphere", "free"] = "xy", role: str = "handle", group: str = "") -> Any:
    """A point of 2 or 3 coordinates with a handle in the scene, and number fields.

    plane: "xy" drags in the horizontal plane through the point, "sphere" keeps the distance from the origin (a
    direction), "free" drags in the plane parallel to the picture.
    """
    return _field("point", tuple(float(v) for v in default), low=low, high=high, unit=unit, plane=plane, role=role,
                  group=group)


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
