"""rho = |s - x| + b - c dt + ionosphere + troposphere + v: a fix from real or simulated files.  MAT 2.2, 2.3, 1.4."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from core.frames import enu_from_ecef, geodetic_from_ecef
from core.gnss import Corrections, Ephemerides, Epoch, Fix, NoFix, fix, simulate
from core.types import Array, Gaussian
from lessons.kit import files
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, datafile, seed, slider, switch
from lessons.static._gnss_files import NAVIGATION, OBSERVATIONS, Measured, broadcast, in_week, measurements
from lessons.static._gnss_view import view

SIMULATED, STEP_S = 60, 120.0            # epochs, and seconds between them
START_S = 4 * 86_400.0 + 6 * 3_600.0     # of the simulated week: Thursday 6:00
MOST = 720                               # epochs that are solved of a longer file


@dataclass(frozen=True, slots=True)
class Params:
    """The files, the corrections, and where the simulated receiver stands."""

    picture: str = choice("cloud", ("cloud", "globe"))
    satellite_clock: bool = switch(True, group="corrections")
    earth_rotation: bool = switch(True, group="corrections")
    ionosphere: bool = switch(True, group="corrections")
    troposphere: bool = switch(True, group="corrections")
    weighted: bool = switch(True, group="corrections")
    mask_deg: float = slider(10.0, low=0.0, high=40.0, step=1.0, unit="°", group="corrections")
    observations: str = datafile(OBSERVATIONS, group="data")
    navigation: str = datafile(NAVIGATION, group="data")
    latitude_deg: float = slider(61.45, low=-85.0, high=85.0, step=0.05, unit="°", group="simulated")
    longitude_deg: float = slider(23.86, low=-180.0, high=180.0, step=0.02, unit="°", group="simulated")
    height_m: float = slider(120.0, low=0.0, high=3000.0, step=10.0, unit="m", group="simulated")
    sigma_m: float = slider(0.7, low=0.1, high=10.0, unit="m", log=True, group="simulated")
    seed: int = seed(5, group="simulated")


class Source(NamedTuple):
    """What there is to solve: epochs, orbits, ionosphere, and the place that everything is compared with, if known."""

    epochs: tuple[Epoch, ...]
    ephemerides: Ephemerides | None
    alpha: tuple[float, ...] | None
    beta: tuple[float, ...] | None
    marker: Array | None
    note: str
    name: str


class Result(NamedTuple):
    """Fixes of T epochs, with the chosen corrections and with all of them.

    fixes: a Fix, or the reason why there is none.  origin (3,): latitude, longitude (rad), height (m) of the local
    axes: the marker's, or the mean's where no marker is known.  enu, enu_all, enu_start (T, 3): fixes, fixes with all
    corrections, and Bancroft's roots near the Earth, in metres east, north, up of the origin, NaN without a fix.
    law, law_all: mean and covariance of the clouds.
    """

    source: Source
    fixes: tuple[Fix | str, ...]
    origin: tuple[float, float, float]
    enu: Array
    enu_all: Array
    enu_start: Array
    law: Gaussian
    law_all: Gaussian


def corrections(p: Params, source: Source) -> Corrections:
    """The switches as core wants them."""
    return Corrections(p.satellite_clock, p.earth_rotation, p.ionosphere, p.troposphere, np.deg2rad(p.mask_deg),
                       p.weighted, 1.0, source.alpha, source.beta)


def source_of(p: Params) -> Source:
    """The files that were given, else a simulated morning."""
    note = ""
    if p.observations:
        given = measurements(files.get(p.observations).content)
        name = files.get(p.observations).name
        if given.epochs[0].position_m is not None:
            return Source(_some(given), None, None, None, given.marker, "", name)
        if p.navigation:
            orbits = broadcast(files.get(p.navigation).content)
            ephemerides = in_week(orbits, given.week if given.week is not None else orbits.week)
            return Source(_some(given), ephemerides, orbits.alpha, orbits.beta, given.marker, "", name)
        note = f"{name} is loaded; now load the navigation file of the same day. Until then: simulated data."
    elif p.navigation:
        note = f"{files.get(p.navigation).name} is loaded; now load observations. Until then: simulated data."
    s = simulate(np.deg2rad(p.latitude_deg), np.deg2rad(p.longitude_deg), p.height_m,
                 START_S + STEP_S * np.arange(SIMULATED), p.sigma_m, np.random.default_rng(p.seed))
    return Source(s.epochs, s.ephemerides, s.alpha, s.beta, s.truth_m, note, "simulated")


def _some(given: Measured) -> tuple[Epoch, ...]:
    return given.epochs[::-(-len(given.epochs) // MOST)]


def compute(p: Params, progress: Progress) -> Result:
    """Every epoch by itself, twice: as asked, and with all corrections."""
    source = source_of(p)
    chosen = corrections(p, source)
    complete = replace(chosen, satellite_clock=True, earth_rotation=True, ionosphere=True, troposphere=True)
    fixes, best = [], []
    for k, epoch in enumerate(source.epochs):
        fixes.append(_solved(epoch, source.ephemerides, chosen))
        best.append(fixes[-1] if chosen == complete else _solved(epoch, source.ephemerides, complete))
        progress((k + 1) / len(source.epochs))
    origin = _origin(source, fixes, best)
    enu, enu_all, enu_start = (np.array([_local(f, origin, which) for f in found])
                               for found, which in ((fixes, "x"), (best, "x"), (fixes, "start")))
    return Result(source, tuple(fixes), origin, enu, enu_all, enu_start, _law(enu), _law(enu_all))


def _solved(epoch: Epoch, ephemerides: Ephemerides | None, chosen: Corrections) -> Fix | str:
    try:
        return fix(epoch, ephemerides, chosen)
    except NoFix as error:
        return str(error)


def _origin(source: Source, fixes: list[Fix | str], best: list[Fix | str]) -> tuple[float, float, float]:
    at = source.marker
    if at is None:
        found = [f.x[:3] for f in (*best, *fixes) if isinstance(f, Fix)]
        if not found:
            reason = next(f for f in fixes if isinstance(f, str))
            raise ValueError(f"no epoch of {source.name} gives a position: {reason}")
        at = np.median(found, axis=0)
    return tuple(float(v) for v in geodetic_from_ecef(at))  # type: ignore[return-value]


def _local(f: Fix | str, origin: tuple[float, float, float], which: str) -> Array:
    if isinstance(f, str):
        return np.full(3, np.nan)
    return enu_from_ecef(f.x[:3] if which == "x" else f.start_m, *origin)


def _law(enu: Array) -> Gaussian:
    """Mean and covariance of the fixes that there are."""
    found = enu[np.isfinite(enu).all(axis=1)]
    if not len(found):
        return Gaussian(np.zeros(3), np.eye(3))
    return Gaussian(found.mean(axis=0), np.cov(found.T) if len(found) > 1 else np.zeros((3, 3)))


def timeline(p: Params) -> Timeline:
    """The epochs; each opens into the stages of its fix."""
    n = len(source_of(p).epochs) if p.observations else SIMULATED
    return Timeline(n - 1, ("satellites", "corrections", "bancroft", "newton"), unit_name="epoch")


def unused(p: Params) -> Collection[str]:
    """The simulated receiver's controls, where measurements come from files."""
    complete = p.observations and (p.navigation or measurements(files.get(p.observations).content).week is None)
    return ("latitude_deg", "longitude_deg", "height_m", "sigma_m", "seed") if complete else ()


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=2.0,
    refs=("MAT 2.2", "MAT Example 15", "MAT 2.3", "MAT 2.3.2", "MAT 1.4", "IS-GPS-200"),
    presets={
        "all corrections": {},
        "no atmosphere": {"ionosphere": False, "troposphere": False},
        "no ionosphere": {"ionosphere": False},
        "the Earth stands still": {"earth_rotation": False},
        "satellite clocks as they are": {"satellite_clock": False},
        "low satellites, all alike": {"mask_deg": 5.0, "weighted": False},
        "a high mask": {"mask_deg": 30.0},
        "the globe": {"picture": "globe"},
        "at the equator": {"latitude_deg": 0.0, "longitude_deg": 37.0, "ionosphere": False},
    },
)
