"""The shape of RINEX 2 and 3 files, line by line: whatever is missing or no number is named with its line.

The values themselves are read by RTKLIB's reader (`_gnss_files`), which passes over bad lines without a word.
"""

import re
from collections.abc import Iterator
from datetime import datetime
from typing import NamedTuple

FIELD, VALUE = 16, 14                     # characters of an observation with its flags, and of its number
PER_LINE, LISTED = 5, 12                  # observations and names of satellites in a line of RINEX 2
NUMBER = 19                               # characters of a number in a navigation file
ORBIT_LINES = 7                           # after the first line of a GPS record
MEASUREMENT = re.compile(r" *-?\d*\.\d{3}")
PARAMETER = re.compile(r" *-?\d?\.\d+[DEde][+-]\d\d")
CODES_2, CODES_3 = ("C1", "P1"), ("C1",)  # what a pseudorange on L1 is called, or begins with


class Observations(NamedTuple):
    """version; the number of GPS measurements; marker: the approximate position of the header, or None."""

    version: float
    measured: int
    marker: tuple[float, float, float] | None


class Navigation(NamedTuple):
    """version, and the number of GPS records."""

    version: float
    records: int


class Lines:
    """The lines of a text, one after the other, with their numbers."""

    def __init__(self, content: bytes) -> None:
        try:
            text = content.decode("ascii")
        except UnicodeDecodeError as error:
            line = content[:error.start].count(b"\n") + 1
            raise ValueError(f"line {line}: expected plain text, got the byte {content[error.start]:#04x}") from None
        self._lines = text.replace("\r", "").split("\n")
        while self._lines and not self._lines[-1].strip():
            self._lines.pop()
        self.number = 0

    @property
    def left(self) -> bool:
        return self.number < len(self._lines)

    def next(self, expected: str) -> str:
        """The next line; ValueError when the file ends before what was expected."""
        if not self.left:
            raise ValueError(f"line {self.number + 1}: expected {expected}, got the end of the file")
        self.number += 1
        return self._lines[self.number - 1]

    def peek(self) -> str:
        return self._lines[self.number] if self.left else ""

    def error(self, expected: str, got: str) -> ValueError:
        return ValueError(f"line {self.number}: expected {expected}, got {got.strip()[:40]!r}")


def kind_of(content: bytes) -> str:
    """'O' for observations, 'N' for navigation, '' for what is no RINEX."""
    first = content[:200].split(b"\n")[0].decode("ascii", errors="replace")
    return first[20:21].upper() if "RINEX VERSION / TYPE" in first[60:] else ""


def check_observations(content: bytes) -> Observations:
    """Walk through an observation file.  ValueError with line and expectation."""
    lines = Lines(content)
    version = _version(lines, "O", "an observation file (type O)")
    marker, types, system = None, [], " "
    for line, label in _header(lines):
        if label == "APPROX POSITION XYZ":
            x, y, z = (_number(lines, line[14 * k:14 * k + 14], "three coordinates in metres") for k in range(3))
            marker = (x, y, z) if abs(x) + abs(y) + abs(z) > 1.0 else None
        elif label == "# / TYPES OF OBSERV":
            types += line[6:60].split()
        elif label == "SYS / # / OBS TYPES":
            system = line[:1].strip() or system            # a continuation names no system
            types += line[6:58].split() if system == "G" else []
    codes = CODES_2 if version < 3 else CODES_3
    if not any(t.startswith(codes) for t in types):
        raise ValueError(f"line {lines.number}: expected a GPS code on L1 ({' or '.join(codes)}) among the types "
                         f"of observation of the header, got {' '.join(types) or 'none'}")
    measured = sum((_epochs_2 if version < 3 else _epochs_3)(lines, types))
    if not measured:
        raise ValueError(f"line {lines.number}: expected epochs with GPS satellites, got none")
    return Observations(version, measured, marker)


def check_navigation(content: bytes) -> Navigation:
    """Walk through a navigation file of GPS, or of several systems.  ValueError with line and expectation."""
    lines = Lines(content)
    version = _version(lines, "N", "a GPS navigation file (type N)")
    for _ in _header(lines):
        pass
    records, wide = 0, version >= 3
    while lines.left:
        first = lines.next("a navigation record")
        if not first.strip():
            raise lines.error("a navigation record", "an empty line")
        if wide and first[0] != "G":
            _skip(lines, first)
            continue
        _satellite(lines, first[:3] if wide else first[:2])
        _date(lines, first[3:23] if wide else first[2:22], wide)
        for k in range(3):
            _field(lines, first, (23 if wide else 22) + NUMBER * k, "a clock coefficient")
        for row in range(1, ORBIT_LINES + 1):
            line = lines.next(f"line {row + 1} of 8 of the record of {first[:3].strip()}")
            for k in range(4):
                start = (4 if wide else 3) + NUMBER * k
                if row < ORBIT_LINES or k == 0 or line[start:start + NUMBER].strip():     # the last line has spares
                    _field(lines, line, start, "an orbit parameter")
        records += 1
    if not records:
        raise ValueError(f"line {lines.number}: expected records of GPS satellites, got none")
    return Navigation(version, records)


def _version(lines: Lines, kind: str, expected: str) -> float:
    first = lines.next(expected)
    if "RINEX VERSION / TYPE" not in first[60:]:
        raise lines.error(f"{expected}, which begins with its RINEX VERSION / TYPE", first)
    version = _number(lines, first[:9], "a RINEX version")
    if not 2.0 <= version < 4.0:
        raise lines.error("RINEX 2 or 3", first[:9])
    if first[20:21].upper() != kind:
        raise lines.error(expected, f"type {first[20:21]}")
    return version


def _header(lines: Lines) -> Iterator[tuple[str, str]]:
    while True:
        line = lines.next("END OF HEADER")
        label = line[60:].strip()
        if label == "END OF HEADER":
            return
        yield line, label


def _epochs_2(lines: Lines, types: list[str]) -> Iterator[int]:
    """How many GPS measurements each epoch has."""
    while lines.left:
        line = lines.next("an epoch")
        flag, count = _flag(lines, line[28:29], line[29:32])
        if flag in (2, 3, 4, 5):
            for k in range(count):
                lines.next(f"line {k + 1} of {count} of an event")
            continue
        _date(lines, line[:26], False)
        names = line[32:68].ljust(3 * LISTED)
        while len(names) < 3 * count:
            names += lines.next(f"the names of {count} satellites")[32:68].ljust(3 * LISTED)
        listed = [names[3 * k:3 * k + 3] for k in range(count)]
        for name in listed:
            _satellite(lines, name)
        for k, name in enumerate(listed):
            for row in range(-(-len(types) // PER_LINE)):
                values = lines.next(f"measurements of {name.strip()}, satellite {k + 1} of {count}")
                _values(lines, values, min(PER_LINE, len(types) - PER_LINE * row))
        if flag in (0, 1):
            yield sum(name[0] in " G" for name in listed)


def _epochs_3(lines: Lines, types: list[str]) -> Iterator[int]:
    while lines.left:
        line = lines.next("an epoch")
        if line[:1] != ">":
            raise lines.error("an epoch, which begins with '>'", line)
        flag, count = _flag(lines, line[31:32], line[32:35])
        if flag in (2, 3, 4, 5):
            for k in range(count):
                lines.next(f"line {k + 1} of {count} of an event")
            continue
        _date(lines, line[1:29], True)
        gps = 0
        for k in range(count):
            values = lines.next(f"measurements of satellite {k + 1} of {count}")
            _satellite(lines, values[:3])
            if values[0] == "G":
                gps += 1
                _values(lines, values[3:], len(types))
        if flag in (0, 1):
            yield gps


def _values(lines: Lines, text: str, most: int) -> None:
    """Numbers or blanks in fields of 16 characters."""
    if len(text.rstrip()) > FIELD * most:
        raise lines.error(f"at most {most} measurements", text[FIELD * most:])
    for k in range(-(-len(text) // FIELD)):
        field = text[FIELD * k:FIELD * k + VALUE]
        if field.strip() and not MEASUREMENT.fullmatch(field):    # a cut number is still a number, but another one
            raise lines.error("a measurement with three decimals", field)


def _flag(lines: Lines, flag: str, count: str) -> tuple[int, int]:
    if flag.strip() and flag not in "0123456":
        raise lines.error("an epoch with a flag from 0 to 6", flag)
    if not count.strip().isdigit():
        raise lines.error("the number of satellites of an epoch", count)
    return int(flag.strip() or 0), int(count)


def _satellite(lines: Lines, name: str) -> None:
    letter, digits = (name[:1], name[1:]) if len(name) > 2 or not name[:1].strip().isdigit() else (" ", name)
    if letter not in " GRSECJI" or not digits.strip().isdigit() or not 1 <= int(digits) <= 99:
        raise lines.error("a satellite such as G07", name)


def _date(lines: Lines, text: str, long_year: bool) -> None:
    parts = text.split()
    try:
        year, month, day, hour, minute = (int(p) for p in parts[:5])
        seconds = float(parts[5])
        if not long_year:
            year += 1900 if year >= 80 else 2000
        datetime(year, month, day, hour, minute)
        if len(parts) != 6 or not 0.0 <= seconds < 61.0:
            raise ValueError
    except (ValueError, IndexError):
        raise lines.error("year month day hour minute second", text) from None


def _field(lines: Lines, line: str, start: int, what: str) -> None:
    field = line[start:start + NUMBER]
    if not PARAMETER.fullmatch(field):
        raise lines.error(f"{what} such as -1.234567890120D-03", field)


def _number(lines: Lines, text: str, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise lines.error(what, text) from None
    if not abs(value) < 1e300:
        raise lines.error(what, text)
    return value


def _skip(lines: Lines, first: str) -> None:
    """The rest of another system's record: its lines begin with blanks."""
    if first[0] not in "RSECJI":
        raise lines.error("a record that begins with a satellite such as G07", first)
    while lines.left and lines.peek()[:1] == " ":
        lines.next("a record")
