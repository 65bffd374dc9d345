"""`paikka study indoor`: the comparison of filters over many walks, as files that an interrupted study goes on from.

runs.csv gets a line for each filter of each run as soon as it is done; table.csv and table.md are made of it.
"""

import csv
import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import NamedTuple

import numpy as np

from core.indoor.comparison import FILTERS, candidates, compare, fix_law, random_walk_through
from core.metrics import error_summary
from lessons.indoor._building import TECHNOLOGIES, Building

RUNS, TABLE_CSV, TABLE_MD, SETTINGS = "runs.csv", "table.csv", "table.md", "settings.json"
FILTER_NAMES = {"tll": "graph, total link length", "equal": "graph, equal choice",
                "cvkf": "Kalman, constant velocity", "cpkf": "Kalman, constant position"}
COLUMNS = ("mean", "median", "95 %", "RMSE", "right floor", "time per step")


@dataclass(frozen=True, slots=True)
class Settings:
    """What decides the numbers: two studies with the same settings have the same runs."""

    routes: int = 10
    seeds: int = 20
    technologies: tuple[str, ...] = TECHNOLOGIES
    intervals_s: tuple[float, ...] = (1.0, 10.0)
    particles: int = 1000
    stops: int = 4
    map: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """One filter in one run: errors in metres over the walk's epochs, share of right floors, time in ms."""

    technology: str
    interval_s: float
    route: int
    seed: int
    filter: str
    mean_m: float
    median_m: float
    p95_m: float
    rmse_m: float
    right_floor: float
    ms_per_step: float


class Line(NamedTuple):
    """One line of the table: means over the runs, and the standard error of the first."""

    technology: str
    interval_s: float
    filter: str
    runs: int
    values: tuple[float, ...]
    mean_error_m: float


def fingerprint(building: Building) -> str:
    """Digits that tell one map from another."""
    content = json.dumps(building.graph.to_dict(), sort_keys=True)
    for points in building.transmitters.values():
        content += str([a.tolist() for a in (points.xy_m, points.floor, points.power_dbm, points.exponent,
                                             points.sigma_db)])
    return hashlib.sha256(content.encode()).hexdigest()[:12]


def run(building: Building, settings: Settings, folder: Path, progress: Callable[[int, int], None]) -> list[Line]:
    """Do what is missing, write the table, and return it.

    progress(done, all) is called before each run and at the end.  ValueError when the folder holds a study with
    other settings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _same_settings(folder / SETTINGS, settings)
    rows = _read(folder / RUNS)
    done = {(r.technology, r.interval_s, r.route, r.seed) for r in rows}
    jobs = list(itertools.product(settings.technologies, settings.intervals_s, range(settings.routes),
                                  range(settings.seeds)))
    grid = candidates(building.graph)
    R = {t: fix_law(building.graph, building.transmitters[t], grid).R for t in settings.technologies}
    with (folder / RUNS).open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if not rows:
            writer.writerow(f.name for f in fields(Row))
        for k, (technology, interval_s, route, seed) in enumerate(jobs):
            if (technology, interval_s, route, seed) in done:
                continue
            progress(k, len(jobs))
            walk = random_walk_through(building.graph, settings.stops, np.random.default_rng([2015, route]))
            rng = np.random.default_rng([2015, route, seed, TECHNOLOGIES.index(technology), round(1000 * interval_s)])
            outcomes = compare(building.graph, building.transmitters[technology], walk, rng, interval_s=interval_s,
                               n_particles=settings.particles, grid=grid, R=R[technology])
            for name, o in outcomes.items():
                e = error_summary(o.errors_m)
                row = Row(technology, interval_s, route, seed, name, e.mean, e.median, e.p95, e.rmse,
                          float(o.right_floor.mean()), 1e3 * o.seconds_per_step)
                rows.append(row)
                writer.writerow(_written(row))
            file.flush()
    progress(len(jobs), len(jobs))
    lines = list(table(rows, settings))
    (folder / TABLE_CSV).write_text(as_csv(lines), encoding="utf-8")
    (folder / TABLE_MD).write_text(as_markdown(lines), encoding="utf-8")
    return lines


def table(rows: Sequence[Row], settings: Settings) -> Iterator[Line]:
    """Means over the runs of these settings."""
    for technology, interval_s, name in itertools.product(settings.technologies, settings.intervals_s, FILTERS):
        found = [r for r in rows if (r.technology, r.interval_s, r.filter) == (technology, interval_s, name)
                 and r.route < settings.routes and r.seed < settings.seeds]
        if not found:
            continue
        a = np.array([[r.mean_m, r.median_m, r.p95_m, r.rmse_m, r.right_floor, r.ms_per_step] for r in found])
        error = float(a[:, 0].std(ddof=1) / np.sqrt(len(a))) if len(a) > 1 else float("nan")
        yield Line(technology, interval_s, name, len(a), tuple(a.mean(axis=0).tolist()), error)


def as_csv(lines: Sequence[Line]) -> str:
    head = "technology,interval_s,filter,runs,mean_m,standard_error_m,median_m,p95_m,rmse_m,right_floor,ms_per_step"
    rows = [",".join([x.technology, f"{x.interval_s:g}", x.filter, str(x.runs), f"{x.values[0]:.4g}",
                      f"{x.mean_error_m:.2g}", *(f"{v:.4g}" for v in x.values[1:])]) for x in lines]
    return "\n".join([head, *rows]) + "\n"


def as_markdown(lines: Sequence[Line]) -> str:
    """One table for people: errors in metres, horizontal, means over the runs and the standard error of the mean."""
    head = ("| signals | scan every | filter | mean error (m) | median (m) | 95 % (m) | RMSE (m) | right floor (%) | "
            "time per step (ms) | runs |\n|---|---|---|---|---|---|---|---|---|---|")
    rows = []
    for x in lines:
        mean, median, p95, rmse, floor, ms = x.values
        error = f" \u00b1 {x.mean_error_m:.2f}" if np.isfinite(x.mean_error_m) else ""
        rows.append(f"| {x.technology.upper()} | {x.interval_s:g} s | {FILTER_NAMES[x.filter]} | {mean:.2f}{error} | "
                    f"{median:.2f} | {p95:.2f} | {rmse:.2f} | {100 * floor:.1f} | {ms:.2f} | {x.runs} |")
    return "\n".join([head, *rows]) + "\n"


def _same_settings(path: Path, settings: Settings) -> None:
    """More routes or seeds go on with a study; anything else needs a folder of its own."""
    wanted = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(settings).items()}
    grows = {"routes", "seeds", "technologies", "intervals_s"}
    if path.exists():
        try:
            old = json.loads(path.read_text(encoding="utf-8"))
            differing = [k for k in wanted if k not in grows and old[k] != wanted[k]]
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{path}: expected the settings of a study; choose another folder with --to") from None
        if differing:
            k = differing[0]
            raise ValueError(f"{path.parent} holds a study with {k} = {old[k]!r}, not {wanted[k]!r}; "
                             "choose another folder with --to")
    path.write_text(json.dumps(wanted, indent=1) + "\n", encoding="utf-8")


def _read(path: Path) -> list[Row]:
    """The complete runs of an earlier study; a line that was cut off and runs without all filters are dropped."""
    if not path.exists():
        return []
    kinds = {f.name: f.type for f in fields(Row)}
    found: dict[tuple[str, float, int, int], list[Row]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            try:
                row = Row(**{k: kind(line[k]) for k, kind in kinds.items()})  # type: ignore[operator]
            except (KeyError, TypeError, ValueError):
                continue
            if None not in line and row.filter in FILTERS:
                found.setdefault((row.technology, row.interval_s, row.route, row.seed), []).append(row)
    rows = [row for run in found.values() if {r.filter for r in run} == set(FILTERS) for row in run]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(kinds)
        writer.writerows(map(_written, rows))
    return rows


def _written(row: Row) -> list[str]:
    return [str(v) if isinstance(v, str | int) else f"{v:.6g}" for v in asdict(row).values()]
