"""p(y | x = p_i) ~ exp(-|y - a_i|^2 / 2 sigma^2): positioning by a radio map that was surveyed.  MAT exercise 2.9."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.types import Array
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, Points, choice, draggable, points, seed, slider, switch
from lessons.static._fingerprint_model import (
    LIMIT,
    METHODS,
    SIDE_M,
    Field,
    Performance,
    RadioMap,
    estimates,
    field_of,
    grid_points,
    performance,
    surveyed,
)
from lessons.static._fingerprint_view import view

CELLS = 50                               # per axis of the hall
SCANS = 20                               # at the true position
TESTS = 400                              # all over the hall
PER_AXIS = np.array([2, 3, 4, 5, 7, 10, 12])         # survey points along a side, of the curve over the spacing
SAMPLES = np.array([1, 2, 4, 8, 16, 32, 64])


def _access_point(x: float, y: float) -> Point:
    return draggable((x, y), low=0.0, high=SIDE_M, role="station", group="radio")


@dataclass(frozen=True, slots=True)
class Params:
    """The survey, the scan and what is made of it, and how radio waves behave in this hall."""

    grid: bool = switch(True, group="survey")
    spacing_m: float = slider(10.0, low=4.0, high=25.0, step=0.5, unit="m", group="survey")
    by_hand: Points = points((), limit=LIMIT, low=0.0, high=SIDE_M, role="measurement", group="survey")
    samples: int = slider(4, low=1, high=64, log=True, group="survey")
    truth: Point = draggable((24.0, 12.0), low=0.0, high=SIDE_M, role="truth", group="scan")
    neighbours: int = slider(3, low=1, high=8, group="scan")
    assumed_db: float = slider(4.5, low=0.5, high=12.0, step=0.5, unit="dB", group="scan")
    show: str = choice("stages", ("stages", "learned", "field", "surface"), group="scan")
    chosen: int = slider(1, low=1, high=4, group="scan")
    count: int = slider(4, low=1, high=4, group="radio")
    noise_db: float = slider(3.0, low=0.5, high=10.0, step=0.5, unit="dB", group="radio")
    shadow_db: float = slider(4.0, low=0.0, high=10.0, step=0.5, unit="dB", group="radio")
    length_m: float = slider(8.0, low=2.0, high=30.0, step=0.5, unit="m", group="radio")
    exponent: float = slider(3.0, low=1.5, high=5.0, step=0.1, group="radio")
    ap_1: Point = _access_point(3.0, 4.0)
    ap_2: Point = _access_point(47.0, 8.0)
    ap_3: Point = _access_point(43.0, 46.0)
    ap_4: Point = _access_point(6.0, 41.0)
    seed: int = seed(1, group="radio")


class Result(NamedTuple):
    """map is None as long as there is no survey point, and everything after `scans` with it."""

    field: Field
    map: RadioMap | None
    scans: Array                         # (SCANS + 1, m) dBm; the first one is not shown
    found: Array                         # (SCANS + 1, METHODS, 2) m
    tests: Performance | None
    by_spacing: Array                    # (PER_AXIS, METHODS) rms errors of grid surveys, m
    by_samples: Array                    # (SAMPLES, METHODS) of the present points


def compute(p: Params, progress: Progress) -> Result:
    """Surveys, scans at the true position, and tries all methods all over the hall, also with other surveys."""
    field = field_of(p)
    by_hand = np.array(p.by_hand).reshape(-1, 2)
    grid = grid_points(p.spacing_m) if p.grid else np.zeros((0, 2))
    m = surveyed(p, field, grid, by_hand, p.samples, CELLS)
    noise = p.noise_db * np.random.default_rng([p.seed, 4]).standard_normal((SCANS + 1, 4))[:, :p.count]
    scans = field.power(np.array(p.truth)) + noise
    rng = np.random.default_rng([p.seed, 5])
    places = rng.uniform(0.0, SIDE_M, (TESTS, 2))
    ys = field.power(places) + p.noise_db * rng.standard_normal((TESTS, 4))[:, :p.count]
    progress(0.2)

    def rms(some: Array, own: Array, samples: int) -> Array:
        other = surveyed(p, field, some, own, samples, CELLS)
        return np.full(len(METHODS), np.nan) if other is None else performance(other, places, ys, p.neighbours).rms

    by_spacing = np.array([rms(grid_points(SIDE_M / n), np.zeros((0, 2)), p.samples) for n in PER_AXIS])
    progress(0.6)
    by_samples = np.array([rms(grid, by_hand, int(n)) for n in SAMPLES])
    if m is None:
        return Result(field, None, scans, np.zeros((0, len(METHODS), 2)), None, by_spacing, by_samples)
    return Result(field, m, scans, estimates(m, scans, p.neighbours), performance(m, places, ys, p.neighbours),
                  by_spacing, by_samples)


def timeline(p: Params) -> Timeline:
    """Scans at the same place, one after the other."""
    return Timeline(SCANS, ("survey", "scan", "neighbours", "posterior"), start=1, unit_name="scan")


def unused(p: Params) -> set[str]:
    """Access points that are switched off; the spacing of no grid."""
    return {f"ap_{i}" for i in range(p.count + 1, 5)} | (set() if p.grid else {"spacing_m"})


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, refs=("MAT exercise 2.9", "MAT 2.5", "MAT (2.7)"),
    presets={
        "a survey every 10 m": {},
        "every 5 m": {"spacing_m": 5.0},
        "one measurement per point": {"samples": 1},
        "survey it yourself": {"grid": False, "by_hand": ((12.0, 12.0), (38.0, 12.0), (25.0, 25.0), (12.0, 38.0)),
                               "stage": "survey"},
        "one access point: a ring": {"count": 1, "shadow_db": 0.0, "spacing_m": 4.0, "samples": 64,
                                     "ap_1": (25.0, 25.0), "truth": (38.0, 32.0)},
        "too sure of itself": {"assumed_db": 1.5},
        "shadows tell places apart": {"shadow_db": 10.0, "length_m": 12.0, "spacing_m": 5.0, "samples": 16},
        "radio map of access point 1": {"show": "surface", "spacing_m": 5.0},
    },
)
