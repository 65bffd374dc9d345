"""One control of a lesson: what values it takes, how they are written in an address, and what is said of wrong ones."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from lessons.kit import files

Kind = Literal["float", "int", "choice", "switch", "point", "points", "names", "file", "seed"]
Point = tuple[float, ...]
Points = tuple[Point, ...]
Names = tuple[str, ...]
Value = float | int | str | bool | Point | Points | Names

SEED_LIMIT = 2**31 - 1
NAME = re.compile(r"[A-Za-z0-9_.\-]{1,32}")


@dataclass(frozen=True, slots=True)
class FileKind:
    """A kind of file that a lesson can be given instead of its own data.

    name: what the user calls it ("a map").  suffixes: what the upload dialogue offers.  recognise: whether bytes look
    like this kind at all.  check: ValueError naming line and what was expected for bytes that cannot be used.
    """

    name: str
    suffixes: tuple[str, ...]
    recognise: Callable[[bytes], bool]
    check: Callable[[bytes], object]


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
    limit: int = 0
    click: bool = False
    about: str = ""
    file: FileKind | None = None

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
            case "points":
                if not isinstance(value, Sequence) or isinstance(value, str) or len(value) > self.limit or any(
                        not isinstance(p, Sequence) or isinstance(p, str) or len(p) != 2 for p in value):
                    raise self._error(self.expected, value)
                return tuple(tuple(self._number(v) for v in p) for p in value)
            case "names":
                if not isinstance(value, Sequence) or isinstance(value, str) or len(value) > self.limit or any(
                        not isinstance(n, str) or not NAME.fullmatch(n) for n in value):
                    raise self._error(self.expected, value)
                return tuple(value)
            case "file":
                if isinstance(value, str) and (value == "" or self._is_ours(value)):
                    return value
                raise self._error(self.expected, value)
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
                case "points":
                    return self.validate([[self._clip(v) for v in p] for p in value][:self.limit])
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
            case "points":
                return tuple(tuple(self._parse_number(part) for part in p.split(",")) for p in text.split(";") if p)
            case "names":
                return tuple(part.strip() for part in text.split(",") if part.strip())
            case "file":
                return text
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
            case "choice" | "file":
                return str(value)
            case "point":
                return _written(value)  # type: ignore[arg-type]
            case "points":
                return ";".join(_written(p) for p in value)  # type: ignore[union-attr, arg-type]
            case "names":
                return ",".join(value)  # type: ignore[arg-type]
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
            case "points":
                return f"at most {self.limit} points x,y;x,y with numbers from {self.low:g} to {self.high:g}"
            case "names":
                return (f"at most {self.limit} names with commas between them, each of at most 32 letters, digits and "
                        "the signs _ . -")
            case "file":
                return f"{self.file.name} that this server has been given"  # type: ignore[union-attr]
            case "int" | "seed":
                return f"a whole number from {int(self.low)} to {int(self.high)}"
            case _:
                return f"a number from {self.low:g} to {self.high:g}"

    def _is_ours(self, key: str) -> bool:
        """Whether a file of this kind lies in the store under `key`."""
        return self.file is not None and files.has(key) and self.file.recognise(files.get(key).content)

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


def _written(point: Sequence[float]) -> str:
    return ",".join(f"{v!r}".removesuffix(".0") for v in point)
