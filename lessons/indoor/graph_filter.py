"""x_t ~ P_x(x_t | x_{t-1}), w_t ~ w_{t-1} P_y(y_t | x_t) on the floor graph.  GBPF 4.4, 5.3, 5.4, ch. 6."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from core.indoor import Truth, Walk, floor_rate
from core.metrics import ErrorSummary, error_summary
from core.types import Array
from lessons.indoor._building import MAP, Building, building
from lessons.indoor._graph_filter_model import (
    ESTIMATES,
    GraphTrack,
    KalmanTrack,
    fix_error,
    graph_filter,
    kalman_tracks,
    route_of,
    scanned,
    walked,
)
from lessons.indoor._graph_filter_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Names, choice, datafile, names, seed, slider, switch

Q_CV, Q_CP = 0.1, 30.0                    # near the best for the Kalman filters on our building
START = 60                                # seconds: the moment shown first


@dataclass(frozen=True, slots=True)
class Params:
    """The walk, the scans, the filters, and what is drawn."""

    walk: str = choice("corridors", ("corridors", "hall", "outdoors", "floors", "own"), group="walk")
    route: Names = names((), limit=12, group="walk")
    speed_mps: float = slider(1.2, low=0.4, high=2.0, step=0.1, unit="m/s", group="walk")
    pause_s: float = slider(8.0, low=0.0, high=30.0, step=1.0, unit="s", group="walk")
    technology: str = choice("wlan", ("wlan", "ble"), group="scans")
    interval_s: int = slider(10, low=1, high=30, unit="s", group="scans")
    sigma_db: float = slider(6.0, low=1.0, high=12.0, step=0.5, unit="dB", group="scans")
    seed: int = seed(2, group="scans")
    particles: int = slider(1000, low=100, high=100_000, log=True, group="filter")
    threshold: float = slider(0.5, low=0.0, high=1.0, step=0.05, group="filter")
    l_max_m: float = slider(100.0, low=10.0, high=1000.0, unit="m", log=True, group="filter")
    turn_hz: float = slider(0.005, low=0.0, high=0.1, step=0.005, unit="1/s", group="filter")
    heading_deg: float = slider(25.0, low=0.0, high=90.0, step=5.0, unit="°/√s", group="filter")
    others: bool = switch(True, group="filter")
    estimate: str = choice("projected", ESTIMATES, group="view")
    picture: str = choice("house", ("house", "plans"), group="view")
    map: str = datafile(MAP, group="view")


class Result(NamedTuple):
    """The walk, the scans, and what each filter made of them; filters without `others`: "tll" alone.

    scans (T, m).  tracks: filter -> (T, 2); floors: filter -> (T,); errors: filter -> horizontal (T,) in metres;
    summary and right: of these over the walk.
    """

    building: Building
    truth: Truth
    nodes: tuple[str, ...]
    scans: Array
    tll: GraphTrack
    kalman: Mapping[str, KalmanTrack]
    tracks: Mapping[str, Array]
    floors: Mapping[str, Array]
    errors: Mapping[str, Array]
    summary: Mapping[str, ErrorSummary]
    right: Mapping[str, float]
    note: str


def compute(p: Params, progress: Progress) -> Result:
    """The same truth and the same scans for every filter."""
    b = building(p.map)
    g = b.graph
    points = replace(b.transmitters[p.technology], sigma_db=p.sigma_db)
    nodes, note = route_of(g, b.routes, p.walk, p.route, p.seed)
    truth = walked(g, nodes, p.speed_mps, p.pause_s)
    scans = scanned(truth, points, float(p.interval_s), p.seed)
    walk = Walk(l_max_m=p.l_max_m, turn_rate_hz=p.turn_hz, sigma_heading_rad=math.radians(p.heading_deg))
    share = 0.5 if p.others else 1.0
    tll = graph_filter(g, scans, points, walk, p.particles, p.threshold, p.estimate, p.seed,
                       lambda f: progress(share * f))
    tracks, floors = {"tll": tll.xy_m}, {"tll": tll.floor}
    kalman: dict[str, KalmanTrack] = {}
    if p.others:
        equal = graph_filter(g, scans, points, replace(walk, rule="equal"), p.particles, p.threshold, p.estimate,
                             p.seed, lambda f: progress(0.5 + 0.48 * f))
        R = fix_error(p.map, p.technology, p.sigma_db)
        kalman = kalman_tracks(g, scans, points, R, Q_CV, Q_CP)
        tracks |= {"equal": equal.xy_m, **{name: k.xy_m for name, k in kalman.items()}}
        floors |= {"equal": equal.floor, **{name: k.floor for name, k in kalman.items()}}
    errors = {name: np.sqrt(np.square(xy - truth.position_m[:, :2]).sum(axis=1)) for name, xy in tracks.items()}
    return Result(b, truth, tuple(nodes), scans, tll, kalman, tracks, floors, errors,
                  {name: error_summary(e) for name, e in errors.items()},
                  {name: floor_rate(f, truth.floor) for name, f in floors.items()}, note)


def timeline(p: Params) -> Timeline:
    """Seconds of the walk."""
    b = building(p.map)
    nodes, _ = route_of(b.graph, b.routes, p.walk, p.route, p.seed)
    steps = len(walked(b.graph, nodes, p.speed_mps, p.pause_s).time_s) - 1
    return Timeline(steps, ("move", "weigh", "estimate", "resample"), start=min(START, steps), unit="s")


def unused(p: Params) -> Collection[str]:
    """A drawn route only for a walk of one's own."""
    return () if p.walk == "own" else ("route",)


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=4.0,
    refs=("GBPF 4.4", "GBPF 5.3", "GBPF 5.4", "GBPF ch. 6"),
    presets={
        "corridors, scans every 10 s": {},
        "scans every second": {"interval_s": 1},
        "through the halls": {"walk": "hall", "step": 90},
        "out and in again": {"walk": "outdoors", "step": 100},
        "another floor": {"walk": "floors", "step": 120},
        "BLE beacons": {"technology": "ble", "sigma_db": 5.0},
        "the first seconds": {"step": 1},
        "floor plans": {"picture": "plans"},
        "few particles": {"particles": 100},
    },
)
