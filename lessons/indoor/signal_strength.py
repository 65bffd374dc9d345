"""RSS_a = A_a - 10 n_a log10(max(d_a, 1 m)) - loss |floors| + w,  and p(y | x) of one scan.  GBPF 5.2."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.indoor import AccessPoints, radio_map
from core.indoor.simulate import heard
from core.types import Array
from lessons.indoor._building import MAP, Building, building
from lessons.indoor._signal_model import Shadows, changed, likelihoods, shadows
from lessons.indoor._signal_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Names, Point, choice, datafile, draggable, names, seed, slider

USED_MOST = 12                       # transmitters whose likelihoods are multiplied one by one, the strongest first
CELL_M = 1.5


@dataclass(frozen=True, slots=True)
class Params:
    """The transmitters, where the user stands, and what is drawn."""

    show: str = choice("likelihood", ("likelihood", "field"))
    technology: str = choice("wlan", ("wlan", "ble"))
    map: str = datafile(MAP)
    truth: Point = draggable((48.0, 38.0), low=-200.0, high=400.0, role="truth", group="user")
    floor: int = slider(0, low=0, high=4, group="user")
    seed: int = seed(3, group="user")
    power_db: float = slider(0.0, low=-20.0, high=20.0, step=1.0, unit="dB", group="law")
    exponent: float = slider(0.0, low=-1.0, high=1.5, step=0.1, group="law")
    sigma_db: float = slider(6.0, low=1.0, high=12.0, step=0.5, unit="dB", group="law")
    floor_loss_db: float = slider(12.0, low=0.0, high=30.0, step=1.0, unit="dB", group="law")
    shadow_db: float = slider(0.0, low=0.0, high=10.0, step=0.5, unit="dB", group="law")
    unheard: str = choice("ignore", ("ignore", "censored"), group="law")
    transmitter: Names = names((), limit=1, group="one")
    place: Point = draggable((0.0, 0.0), low=-200.0, high=400.0, role="station", group="one")


class Result(NamedTuple):
    """The transmitters, one scan y (m,) in dBm with NaN for what was not heard, and what it says.

    order: the transmitters heard, strongest first.  axes: x (nx,), y (ny,) of the grid; maps (K + 1, floors, ny, nx):
    posterior probabilities of the cells after 0, 1, ... K transmitters from a flat prior over all floors.  field
    (ny, nx): mean strength of the chosen transmitter on the user's floor, with its shadows.  best (K + 1, 3): x, y and
    floor of the likeliest cell; mean (K + 1, 2) and spread (K + 1,) of the law on the likeliest floor; right (K + 1,):
    probability of the user's floor.
    """

    building: Building
    points: AccessPoints
    names: tuple[str, ...]
    floor: int
    chosen: int
    y: Array
    expected: Array
    order: Array
    axes: tuple[Array, Array]
    maps: Array
    field: Array
    best: Array
    mean: Array
    spread: Array
    right: Array
    note: str


def compute(p: Params, progress: Progress) -> Result:
    """One scan at the user's place, and the likelihoods of its transmitters multiplied one by one."""
    b = building(p.map)
    g, ids = b.graph, b.transmitter_names[p.technology]
    floor = g.floors[min(p.floor, len(g.floors) - 1)]
    chosen = ids.index(p.transmitter[0]) if p.transmitter and p.transmitter[0] in ids else -1
    points = changed(b.transmitters[p.technology], chosen, p.place, p.power_db, p.exponent, p.sigma_db, p.floor_loss_db,
                     p.unheard)
    rng = np.random.default_rng(p.seed)
    at = np.array([*p.truth, g.floor_height_m * floor])
    expected = points.expected(at, floor)
    shade: Shadows = shadows(len(points), p.shadow_db, rng)
    y = heard(points, expected + shade.at(at[:2]), rng)
    order = np.argsort(-np.where(np.isnan(y), -np.inf, y), kind="stable")[:int((~np.isnan(y)).sum())]
    progress(0.1)
    shown = radio_map(g, points, floor, cell_m=CELL_M)
    axes = shown.x_m, shown.y_m
    maps = likelihoods(g, points, y, order[:USED_MOST], axes, progress)
    one = chosen if chosen >= 0 else int(order[0]) if len(order) else 0
    xx, yy = np.meshgrid(*axes)
    field = shown.rss_dbm[one] + shade.at(np.stack([xx, yy], axis=-1))[..., one]
    note = "" if not p.transmitter or chosen >= 0 else f"There is no transmitter {p.transmitter[0]} here."
    return Result(b, points, ids, floor, one, y, expected, order, axes, maps, field, *_summaries(g.floors, axes, maps),
                  maps[:, g.floors.index(floor)].sum(axis=(1, 2)), note)


def _summaries(floors: tuple[int, ...], axes: tuple[Array, Array], maps: Array) -> tuple[Array, Array, Array]:
    """best, mean and spread, as in Result."""
    x, y = axes
    best, mean, spread = np.empty((len(maps), 3)), np.empty((len(maps), 2)), np.empty(len(maps))
    for k, law in enumerate(maps):
        f, j, i = np.unravel_index(int(law.argmax()), law.shape)
        best[k] = x[i], y[j], floors[f]
        here = law[int(law.sum(axis=(1, 2)).argmax())]
        w = here / here.sum()
        mean[k] = w.sum(axis=0) @ x, w.sum(axis=1) @ y
        spread[k] = np.sqrt(w.sum(axis=0) @ (x - mean[k, 0]) ** 2 + w.sum(axis=1) @ (y - mean[k, 1]) ** 2)
    return best, mean, spread


def timeline(p: Params) -> Timeline:
    """How many of the transmitters heard are used, the strongest first."""
    return Timeline(USED_MOST, start=USED_MOST, unit_name="transmitters")


def unused(p: Params) -> Collection[str]:
    """The handle of a transmitter is there when one has been clicked."""
    return set() if p.transmitter else {"place"}


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=1.0,
    refs=("GBPF ch. 1", "GBPF 5.2", "MAT 2.4"),
    presets={
        "one scan, WLAN": {},
        "the strongest alone": {"step": 1},
        "BLE": {"technology": "ble", "sigma_db": 5.0},
        "radio map of one access point": {"show": "field"},
        "with shadows": {"show": "field", "shadow_db": 6.0},
        "shadows the model does not know": {"shadow_db": 8.0, "sigma_db": 3.0},
        "what was not heard counts too": {"technology": "ble", "sigma_db": 5.0, "unheard": "censored"},
        "floors of glass": {"floor_loss_db": 0.0},
    },
)
