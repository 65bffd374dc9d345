"""Tracks and measurements drawn from models.  MAT (3.1)-(3.2)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core import checks
from core.gaussian import sample
from core.linalg import cholesky_psd
from core.recursion import each
from core.types import Array, Gaussian, Motion, Sensor


class Truth(NamedTuple):
    """initial (runs, n) one step before the first measurement; states (runs, T, n); ys (runs, T, m)."""

    initial: Array
    states: Array
    ys: Array


def simulate(
    initial: Gaussian | Array,
    motion: Motion | Sequence[Motion],
    sensor: Sensor | Sequence[Sensor],
    steps: int,
    runs: int,
    rng: "np.random.Generator",
) -> Truth:
    """x_0 ~ initial,  x_k ~ motion | x_{k-1},  y_k = h(x_k) + v,  v ~ N(0, R).

    initial: a Gaussian, or an exact start (n,) or (runs, n); motion and sensor: one model, or one per step, so that a
    track may stop, drive and turn.  ValueError for wrong shapes or numbers below 1.  MAT (3.1)-(3.2).
    """
    _whole("steps", steps)
    _whole("runs", runs)
    if isinstance(initial, Gaussian):
        x = sample(initial, runs, rng)
    else:
        x = checks.finite("initial", initial, None)
        x = np.broadcast_to(x, (runs, x.shape[-1]))
    start, states = x, []
    for model in each("motion", motion, steps, "f"):
        x = model.sample(x, rng)
        states.append(x)
    states = np.stack(states, axis=1)
    return Truth(start, states, observe(states, sensor, rng))


def observe(
    states: Array, sensor: Sensor | Sequence[Sensor], rng: "np.random.Generator", runs: int | None = None
) -> Array:
    """y_k = h(x_k) + v,  v ~ N(0, R), angles wrapped: ys (runs, T, m) for given tracks.

    states (runs, T, n), or one track (T, n) that all `runs` share; sensor: one, or one per step.  Noise is normal
    with the sensor's R whatever the sensor's likelihood says.
    """
    x = checks.finite("states", states, None, None)
    if x.ndim == 2:
        x = np.broadcast_to(x, (1 if runs is None else _whole("runs", runs), *x.shape))
    if x.ndim != 3 or runs not in (None, len(x)):
        raise ValueError(f"states: expected shape (runs, T, n) or (T, n), got {np.shape(states)} for runs = {runs}")
    ys = []
    for k, s in enumerate(each("sensor", sensor, x.shape[1], "h")):
        y_hat = s.h(x[:, k])
        v = rng.standard_normal(y_hat.shape) @ cholesky_psd(s.R).T
        ys.append(s.innovation(y_hat + v, np.zeros(y_hat.shape)))
    return np.stack(ys, axis=1)


def _whole(name: str, value: int) -> int:
    if value != int(value) or value < 1:
        raise ValueError(f"{name}: expected a whole number >= 1, got {value}")
    return int(value)
