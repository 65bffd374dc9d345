"""Files with real measurements: RINEX through RTKLIB's reader, or a CSV table of satellites and pseudoranges."""

import csv
import io
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from core.gnss import Ephemerides, Epoch
from core.types import Array
from lessons.kit.parameter import FileKind
from lessons.static import _rinex

GPS_EPOCH, WEEK_S = 315_964_800, 604_800           # of RTKLIB's time (since 1970, without leap seconds)
GPS_SATELLITES = 32
COLUMNS = ("t_s", "satellite", "x_m", "y_m", "z_m", "pseudorange_m")
MOST_EPOCHS = 3000
READER = 'this needs the reader for RINEX: pip install "paikka[gnss]"'


class Measured(NamedTuple):
    """epochs; week: the GPS week in which their times count (None: the file does not say); marker: (3,) or None."""

    epochs: tuple[Epoch, ...]
    week: int | None
    marker: Array | None


class Broadcast(NamedTuple):
    """records of orbits and clocks, times in the week `week`; alpha, beta of the ionosphere or None."""

    ephemerides: Ephemerides
    week: int
    alpha: tuple[float, ...] | None
    beta: tuple[float, ...] | None


@lru_cache(maxsize=4)
def measurements(content: bytes) -> Measured:
    """Epochs with code measurements of GPS satellites.  ValueError with line and expectation."""
    if not _rinex.kind_of(content):
        return _csv(content)
    shape = _rinex.check_observations(content)
    observed, _, _ = _read(content, "o")
    rows: dict[float, list[tuple[str, float]]] = {}
    count, week = 0, None
    for k in range(observed.n):
        o = observed.data[k]
        if not 1 <= o.sat <= GPS_SATELLITES:
            continue
        count += 1
        if week is None:
            week = int(o.time.time - GPS_EPOCH) // WEEK_S
        if o.P[0] > 0.0:
            rows.setdefault(_seconds(o.time, week), []).append((f"G{o.sat:02d}", o.P[0]))
    if count != shape.measured:
        raise ValueError(f"expected {shape.measured} measurements of GPS satellites as in the file, but the reader "
                         f"understood {count}")
    if not rows:
        raise ValueError("expected code measurements (C1) of GPS satellites, got none")
    epochs = [Epoch(t, tuple(n for n, _ in row), np.array([v for _, v in row])) for t, row in sorted(rows.items())]
    return Measured(_few(epochs), week, None if shape.marker is None else np.array(shape.marker))


@lru_cache(maxsize=4)
def broadcast(content: bytes) -> Broadcast:
    """Orbits and clocks of GPS satellites.  ValueError with line and expectation."""
    shape = _rinex.check_navigation(content)
    _, nav, _ = _read(content, "n")
    records = [nav.eph[k] for k in range(nav.n) if 1 <= nav.eph[k].sat <= GPS_SATELLITES]
    if len(records) != shape.records:
        raise ValueError(f"expected {shape.records} records of GPS satellites as in the file, but the reader "
                         f"understood {len(records)}")
    week = int(records[0].toe.time - GPS_EPOCH) // WEEK_S
    columns = zip(*(_row(e, week) for e in records), strict=True)
    ephemerides = Ephemerides(*(np.array(column) for column in columns))
    odd = [n for n, *numbers in zip(*ephemerides, strict=True) if not _is_orbit(numbers)]
    if odd:
        raise ValueError(f"expected the orbit of a GPS satellite for {odd[0]}, got numbers that cannot be one")
    ion = tuple(float(nav.ion_gps[k]) for k in range(8))
    known = any(ion)
    return Broadcast(ephemerides, week, ion[:4] if known else None, ion[4:] if known else None)


def in_week(b: Broadcast, week: int) -> Ephemerides:
    """The ephemerides with their times counted in another week."""
    shift = float((b.week - week) * WEEK_S)
    return b.ephemerides._replace(toe_s=b.ephemerides.toe_s + shift, toc_s=b.ephemerides.toc_s + shift)


def _is_orbit(numbers: list[Any]) -> bool:
    """toe, toc, sqrt(A), e, ... of something that goes round the Earth twice a day."""
    return all(np.isfinite(float(v)) for v in numbers) and 5000.0 < numbers[2] < 5300.0 and 0.0 <= numbers[3] < 0.1


def _row(e: Any, week: int) -> tuple[Any, ...]:
    return (f"G{e.sat:02d}", _seconds(e.toe, week), _seconds(e.toc, week), float(np.sqrt(max(e.A, 0.0))), e.e, e.i0,
            e.OMG0, e.omg, e.M0, e.deln, e.idot, e.OMGd, e.cuc, e.cus, e.crc, e.crs, e.cic, e.cis, e.f0, e.f1, e.f2,
            e.tgd[0], e.svh == 0)


def _seconds(time: Any, week: int) -> float:
    """RTKLIB's time as seconds of the week."""
    return float(time.time - GPS_EPOCH - week * WEEK_S) + float(time.sec)


def _read(content: bytes, ending: str) -> tuple[Any, Any, Any]:
    """RTKLIB's records of one file; its reader wants the name of a file."""
    try:
        import pyrtklib
    except ImportError:
        raise ValueError(READER) from None
    found = pyrtklib.obs_t(), pyrtklib.nav_t(), pyrtklib.sta_t()
    with tempfile.TemporaryDirectory(prefix="paikka-") as folder:
        path = Path(folder) / f"given.{ending}"
        path.write_bytes(content)
        if pyrtklib.readrnx(str(path), 1, "", *found) != 1:
            raise ValueError("expected a RINEX file that RTKLIB can read")
    return found


def _csv(content: bytes) -> Measured:
    """t_s,satellite,x_m,y_m,z_m,pseudorange_m: satellites in ECEF at the time of transmission."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[:error.start].count(b"\n") + 1
        raise ValueError(f"line {line}: expected text in UTF-8, got the byte {content[error.start]:#04x}") from None
    if not text.endswith("\n"):
        raise ValueError(f"line {text.count(chr(10)) + 1}: expected a line break at the end; is the file complete?")
    rows = csv.reader(io.StringIO(text))
    head = tuple(name.strip() for name in next(rows, []))
    if head != COLUMNS:
        raise ValueError(f"line 1: expected {','.join(COLUMNS)}, got {','.join(head)[:60]!r}")
    found: dict[float, dict[str, list[float]]] = {}
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        where = f"line {rows.line_num}"
        if len(row) != len(COLUMNS):
            raise ValueError(f"{where}: expected {len(COLUMNS)} values, got {len(row)}")
        name = row[1].strip()
        try:
            t, *numbers = (float(row[k]) for k in (0, 2, 3, 4, 5))
        except ValueError:
            raise ValueError(f"{where}: expected numbers, got {','.join(row)[:60]!r}") from None
        if not np.isfinite([t, *numbers]).all() or not name or len(name) > 8:
            raise ValueError(f"{where}: expected finite numbers and a satellite's name, got {','.join(row)[:60]!r}")
        if not 6.5e6 < float(np.sqrt(np.square(numbers[:3]).sum())) < 1e9:
            raise ValueError(f"{where}: expected the position of a satellite in ECEF metres, got {numbers[:3]}")
        if name in found.setdefault(t, {}):
            raise ValueError(f"{where}: expected each satellite once at t = {t:g} s, got {name} twice")
        found[t][name] = numbers
    if not found:
        raise ValueError("line 2: expected at least one row of measurements, got none")
    epochs = []
    for t, satellites in sorted(found.items()):
        numbers = np.array(list(satellites.values()))
        epochs.append(Epoch(t, tuple(satellites), numbers[:, 3], numbers[:, :3]))
    return Measured(_few(epochs), None, None)


def _few(epochs: list[Epoch]) -> tuple[Epoch, ...]:
    """At most MOST_EPOCHS, evenly spread."""
    step = -(-len(epochs) // MOST_EPOCHS)
    return tuple(epochs[::step])


def _looks_like(kind: str) -> Callable[[bytes], bool]:
    def recognise(content: bytes) -> bool:
        found = _rinex.kind_of(content)
        return found == kind or (kind == "O" and not found and content[:7].removeprefix(b"\xef\xbb\xbf")[:4] == b"t_s,")

    return recognise


OBSERVATIONS = FileKind("observations (RINEX 2 or 3, or CSV)", (".obs", ".rnx", ".csv", ".o", ".05o", ".txt"),
                        _looks_like("O"), measurements)
NAVIGATION = FileKind("a GPS navigation file (RINEX 2 or 3)", (".nav", ".rnx", ".n", ".05n", ".txt"),
                      _looks_like("N"), broadcast)
