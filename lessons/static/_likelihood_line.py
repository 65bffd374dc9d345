"""Readings on a line whose errors are not a bell: rounded down, or bounded."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.likelihood import likelihood_map
from core.sensor_noise import NormalNoise, set_noise
from core.sensors_discrete import Quantised, UniformNoise
from core.types import Array, Sensor

if TYPE_CHECKING:
    from lessons.static.likelihood import Params

READINGS = 5
LOW, HIGH = -4.0, 4.0
X = np.linspace(LOW, HIGH, 801)


class Square(NormalNoise):
    """y = x^2 + v,  v ~ N(0, half_width^2 / 3), the variance of a uniform error within half_width."""

    def __init__(self, half_width: float) -> None:
        set_noise(self, "sigma", half_width / np.sqrt(3.0), 1)

    def h(self, x: Array) -> Array:
        """x^2, shape (..., 1)."""
        return np.square(x[..., :1])

    def jacobian(self, x: Array) -> Array:
        """2 x, shape (..., 1, 1)."""
        return 2.0 * x[..., :1, None]


class Line(NamedTuple):
    """Row k belongs to the first k + 1 readings."""

    sensor: Sensor
    y: Array                     # (k,)
    parts: Array                 # (k, X) p(y_i | x) of each reading
    products: Array              # (k, X) of all up to it, largest value 1; 0 where none is possible
    best: Array                  # (k,) where the product is largest, the middle if that is an interval; NaN if nowhere


def line(p: "Params") -> Line:
    """The likelihoods over x, reading by reading."""
    if p.world == "floor":
        sensor: Sensor = Quantised(p.sigma)
        y = np.array([p.y_1, p.y_2, p.y_3, p.y_4, p.y_5][:p.readings], dtype=np.float64)
    else:
        square = Square(p.half_width)
        sensor = UniformNoise(square, p.half_width) if p.noise == "uniform" else square
        y = np.array([p.y])
    logs = np.stack([likelihood_map(sensor, [v], [X]).log_likelihood for v in y])
    sums = np.cumsum(logs, axis=0)
    tops = sums.max(axis=1, keepdims=True)
    products = np.exp(sums - np.where(np.isfinite(tops), tops, 0.0))
    best = np.array([_middle(sensor, y[:k + 1], products[k]) for k in range(len(y))])
    return Line(sensor, y, np.exp(logs), products, best)


def _middle(sensor: Sensor, y: Array, product: Array) -> float:
    """The highest point, on a finer grid; the middle of a plateau; of two equal ones the right one."""
    if not product.any():
        return float("nan")
    top = np.flatnonzero(product >= 1.0 - 1e-9)
    last = top[np.flatnonzero(np.diff(top, prepend=-9) > 1)[-1]:]      # the rightmost run
    if len(last) > 2:
        return float(X[last].mean())
    step = X[1] - X[0]
    fine = np.linspace(X[last[0]] - step, X[last[-1]] + step, 2001)
    return float(likelihood_map(sensor, y[:, None], [fine]).peak[0])
