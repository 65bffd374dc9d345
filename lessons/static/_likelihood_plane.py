"""Measurements of a position in the plane, each with its likelihood; their products and what is largest there."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.gauss_newton import gauss_newton
from core.grid import cells
from core.likelihood import likelihood_map
from core.sensors import Bearing, Range, RangeDifference, SignalStrength, Stack
from core.sensors_discrete import BinarySector, UniformNoise
from core.types import Array, Sensor
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.static.likelihood import Params

BOX = np.array([[-80.0, -70.0], [120.0, 100.0]])
AXES = (cells(BOX[0, 0], BOX[1, 0], 100), cells(BOX[0, 1], BOX[1, 1], 85))
POWER_DBM, EXPONENT = -40.0, 3.0             # of the signal at 1 m, and of its decay
ALIKE = 0.01                                 # of the logarithm below the maximum: as good as the maximum
APART_M = 3.0                                # two maxima that are farther apart are two
TRIED = 6                                    # other maxima that are looked at


class Factor(NamedTuple):
    """One measurement."""

    kind: str                    # range, bearing, difference, strength, inside
    name: str                    # as it is shown
    sensor: Sensor
    normal: Sensor | None        # with normal errors of the same variance; None where there is nothing to square
    y: Array                     # (1,)


class Plane2D(NamedTuple):
    """Row k belongs to the first k + 1 measurements."""

    factors: tuple[Factor, ...]
    parts: Array                 # (k, 100, 85) relative likelihood of each alone
    products: Array              # (k, 100, 85) and of the product of all up to it, largest value 1
    possible: Array              # (k,) False: no point of the picture explains them all
    best: Array                  # (k, 2) where the product is largest
    single: Array                # (k,) whether that is one place
    squares: Array               # (k, 2) weighted least squares from there; NaN where it has no solution


def count_of(p: "Params") -> int:
    return p.ranges + p.bearings + p.difference + p.strength + (p.inside != "off")


def factors(p: "Params") -> list[Factor]:
    """The measurements in the order in which they are multiplied."""
    stations, truth = np.array([p.station_1, p.station_2, p.station_3]), np.array(p.truth)
    rng = np.random.default_rng(p.seed)
    errors = {"normal": rng.standard_normal(8), "uniform": np.sqrt(3.0) * rng.uniform(-1.0, 1.0, 8)}[p.noise]
    found: list[Factor] = []

    def add(place: int, kind: str, name: str, sensor: Sensor) -> None:
        sigma = np.sqrt(np.diagonal(sensor.R))
        y = sensor.h(truth) + (sigma * errors[place] if p.wrong else 0.0)
        noisy = sensor if p.noise == "normal" else UniformNoise(sensor, np.sqrt(3.0) * sigma)
        found.append(Factor(kind, name, noisy, sensor, np.maximum(y, 0.0) if kind == "range" else y))

    for i in range(3):
        if i < p.ranges:
            add(i, "range", f"range to S{i + 1}", Range(stations[[i]], p.sigma_m))
        if i < p.bearings:
            add(3 + i, "bearing", f"bearing from S{i + 1}", Bearing(stations[[i]], np.radians(p.sigma_deg)))
    if p.difference:
        add(5, "difference", "distance to S1 minus S2", RangeDifference(stations[:2], p.sigma_m))
    if p.strength:
        add(6, "strength", "power from S2", SignalStrength(stations[[1]], POWER_DBM, EXPONENT, p.sigma_db))
    if p.inside != "off":
        sensor = BinarySector(stations[[2]], p.radius_m, p.edge_m)
        name = f"{'within' if p.inside == 'yes' else 'not within'} {p.radius_m:g} m of S3"
        found.append(Factor("inside", name, sensor, None, np.array([float(p.inside == "yes")])))
    return found


def top(f: Factor) -> float:
    """The logarithm of the largest density that the errors of this measurement have; 0 of a binary one."""
    if f.kind == "inside":
        return 0.0
    anywhere = np.zeros(2)
    return float(f.sensor.log_likelihood(f.sensor.h(anywhere), anywhere))


def relative(f: Factor, x: Array) -> Array:
    """p(y | x) divided by the largest density of the error; the probability itself of a binary measurement."""
    return np.exp(f.sensor.log_likelihood(f.y, x) - top(f))


def plane(p: "Params", progress: Progress) -> Plane2D:
    """Maps, products, the largest values and the least squares."""
    found = factors(p)
    empty = np.zeros((0, *(len(a) for a in AXES)))
    if not found:
        return Plane2D((), empty, empty, np.zeros(0, dtype=bool), np.zeros((0, 2)), np.zeros(0, dtype=bool),
                       np.zeros((0, 2)))
    y = np.concatenate([f.y for f in found])
    logs = likelihood_map(Stack(tuple(f.sensor for f in found)), y, AXES).parts
    sums = np.cumsum(logs, axis=0)
    tops = sums.max(axis=(1, 2), keepdims=True)
    possible = np.isfinite(tops[:, 0, 0])
    products = np.exp(sums - np.where(np.isfinite(tops), tops, 0.0))
    progress(0.4)
    best, squares = np.full((2, len(found), 2), np.nan)
    single = possible.copy()
    for k in np.flatnonzero(possible):
        sensor = Stack(tuple(f.sensor for f in found[:k + 1]))
        best[k], top_log = _climb(sensor, y[:k + 1], likelihood_map(sensor, y[:k + 1], AXES).peak)
        single[k] = not _others(sensor, y[:k + 1], products[k], best[k], top_log)
        squares[k] = _least_squares(found[:k + 1], best[k])
        progress(0.4 + 0.6 * (k + 1) / len(found))
    parts = np.exp(logs - np.array([top(f) for f in found])[:, None, None])
    return Plane2D(tuple(found), parts, products, possible, best, single, squares)


def _climb(sensor: Stack, y: Array, x: Array) -> tuple[Array, float]:
    """The largest value near a cell of the grid, to a centimetre, and its logarithm."""
    steps = np.array([axis[1] - axis[0] for axis in AXES])
    while steps.max() > 0.01:
        axes = [np.linspace(v - 1.5 * step, v + 1.5 * step, 31) for v, step in zip(x, steps, strict=True)]
        found = likelihood_map(sensor, y, axes)
        x, steps = found.peak, 0.1 * steps
    return x, float(found.log_likelihood.max())


def _others(sensor: Stack, y: Array, product: Array, best: Array, top_log: float) -> bool:
    """Whether there are other maxima as high as the best: a mirror image, a ring, a plateau."""
    z = np.pad(product, 1, constant_values=-1.0)
    rows, columns = (slice(1, n + 1) for n in product.shape)
    around = np.max([z[rows.start + i:rows.stop + i, columns.start + j:columns.stop + j]
                     for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j], axis=0)
    i, j = np.nonzero((product >= around) & (product > 0.5))
    places = np.column_stack([AXES[0][i], AXES[1][j]])
    away = np.linalg.norm(places - best, axis=1)
    order = np.argsort(-away, kind="stable")[:: max(1, len(away) // TRIED)][:TRIED]
    for place in places[order[away[order] > APART_M]]:
        x, log = _climb(sensor, y, place)
        if log > top_log - ALIKE and np.linalg.norm(x - best) > APART_M:
            return True
    return False


def _least_squares(found: list[Factor], start: Array) -> Array:
    """argmin of the weighted squares, without the binary measurements; NaN where they do not determine a point."""
    used = [f for f in found if f.normal is not None]
    if len(used) < 2:
        return np.full(2, np.nan)
    try:
        fix = gauss_newton(Stack(tuple(f.normal for f in used)), np.concatenate([f.y for f in used]), start)
    except ValueError:
        return np.full(2, np.nan)
    return fix.x if fix.converged and (np.abs(fix.x) < 1e3).all() else np.full(2, np.nan)
