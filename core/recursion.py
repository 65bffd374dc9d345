"""What every filter's `run` shares: checked inputs, one model per step, and one record with a leading time axis."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from core.stacks import law
from core.types import Array, Gaussian, Motion, Sensor

# Axes of one element without batch axes; what is not listed has none (a flag) or is a Gaussian.
_CORE_AXES = {
    "mean": 1, "cov": 2, "y_hat": 1, "jacobian": 2, "innovation": 1, "innovation_cov": 2, "gain": 2,
    "points": 2, "weights": 1, "images": 2, "cross": 2, "R": 2,
}  # fmt: skip


class Epoch(NamedTuple):
    """One step's models, its measurement y (..., m) and the mask of missing entries, None if nothing is missing."""

    motion: Motion
    sensor: Sensor
    y: Array
    missing: Array | None


class Plan(NamedTuple):
    """Where a run starts, its batch axes and its steps."""

    initial: Gaussian
    batch: tuple[int, ...]
    epochs: list[Epoch]


def plan(
    initial: Gaussian, ys: Array, motion: Motion | Sequence[Motion], sensor: Sensor | Sequence[Sensor]
) -> Plan:
    """Checks the inputs of a run.

    initial: mean (..., n), cov (..., n, n).  ys (T, ..., m); NaN entries were not measured.  motion and sensor are one
    model for all steps or one per step.  ValueError for anything that does not fit.
    """
    x, P = law("initial", initial)
    given = P.shape[:-2]
    if P.ndim > 2 and (first := P[(0,) * (P.ndim - 2)]).shape and (first == P).all():
        P = first                                         # one covariance for all runs, while the models allow it
    ys = np.asarray(ys, dtype=np.float64)
    if ys.ndim < 2 or not len(ys):
        raise ValueError(f"ys: expected shape (T, ..., m) with T >= 1, got {ys.shape}")
    if np.isinf(ys).any():
        raise ValueError("ys: expected finite numbers or NaN for a missing measurement, got an infinite one")
    motions, sensors = each("motion", motion, len(ys), "f"), each("sensor", sensor, len(ys), "h")
    n, m = x.shape[-1], ys.shape[-1]
    for k in range(len(ys)):
        check_sizes(n, motions[k], m, sensors[k])
    try:
        batch = np.broadcast_shapes(x.shape[:-1], given, ys.shape[1:-1])
    except ValueError:
        raise ValueError(f"expected batch axes of the initial mean {x.shape}, cov {P.shape} and ys {ys.shape} "
                         f"that fit") from None
    masks = np.isnan(ys)
    some = masks.any(axis=tuple(range(1, ys.ndim)))
    epochs = [Epoch(motions[k], sensors[k], ys[k], _mask(masks[k]) if some[k] else None) for k in range(len(ys))]
    if P.ndim > 2:
        P = np.broadcast_to(P, (*batch, n, n))
    start = law("initial", Gaussian(np.broadcast_to(x, (*batch, n)), P))
    return Plan(start, batch, epochs)


def check_sizes(n: int, motion: Motion | None, m: int, sensor: Sensor | None) -> None:
    """ValueError unless the models suit a state of n and a measurement of m components."""
    if motion is not None and motion.Q.shape != (n, n):
        raise ValueError(f"motion: expected a model of {n} states, got Q of shape {motion.Q.shape}")
    if sensor is not None and sensor.R.shape != (m, m):
        raise ValueError(f"y: expected shape (..., {len(sensor.R)}) for this sensor, got (..., {m})")


class Recorder:
    """Collects the records of T steps into one record whose arrays are (T, *batch, ...).

    Each step is copied into place as soon as it is there, which keeps the memory of the steps themselves small.  What
    all runs share is stored once and repeated without copying.
    """

    def __init__(self, T: int, batch: tuple[int, ...]) -> None:
        self._T, self._batch, self._k = T, batch, 0
        self._arrays: dict[tuple[str, ...], Array] = {}
        self._kind: Any = None

    def add(self, step: Any) -> None:
        self._kind = step
        self._put((), step)
        self._k += 1

    def result(self) -> Any:
        return self._take((), self._kind)

    def _put(self, path: tuple[str, ...], record: Any) -> None:
        for name, value in zip(record._fields, record, strict=True):
            if isinstance(value, tuple):
                self._put((*path, name), value)
                continue
            value = np.asarray(value)
            store = self._arrays.get((*path, name))
            if store is None or store.ndim - 1 < value.ndim:
                order = sorted(range(value.ndim), key=lambda i: -value.strides[i])      # the layout of the steps
                wider = np.empty((self._T, *(value.shape[i] for i in order)), dtype=value.dtype)
                wider = wider.transpose(0, *(1 + order.index(i) for i in range(value.ndim)))
                if store is not None:                     # the first step in which the runs differ
                    core = store.ndim - 1
                    old = store[:self._k]
                    wider[:self._k] = old.reshape(self._k, *(1,) * (value.ndim - core), *store.shape[1:])
                self._arrays[(*path, name)] = store = wider
            store[self._k] = value

    def _take(self, path: tuple[str, ...], record: Any) -> Any:
        fields = []
        for name, value in zip(record._fields, record, strict=True):
            if isinstance(value, tuple):
                fields.append(self._take((*path, name), value))
                continue
            a = self._arrays[(*path, name)]
            core = _CORE_AXES.get(name, 0)
            lead, tail = a.shape[1:a.ndim - core], a.shape[a.ndim - core:]
            if lead != self._batch:
                a = a.reshape(self._T, *(1,) * (len(self._batch) - len(lead)), *lead, *tail)
                a = np.broadcast_to(a, (self._T, *self._batch, *tail))
            fields.append(a)
        return type(record)(*fields)


def each(name: str, model: Any, T: int, method: str) -> list[Any]:
    """T models: one for all steps (it has the method of this name), or the given one for each."""
    if hasattr(model, method):
        return [model] * T
    try:
        models = list(model)
    except TypeError:
        raise ValueError(f"{name}: expected a model or one per step, got {type(model).__name__}") from None
    if len(models) != T:
        raise ValueError(f"{name}: expected one model or {T} of them, got {len(models)}")
    return models


def _mask(missing: Array) -> Array:
    """The mask, reduced to (m,) if all runs miss the same entries, so that they can keep sharing a covariance."""
    first = missing[(0,) * (missing.ndim - 1)]
    return first if (missing == first).all() else missing
