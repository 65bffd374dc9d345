"""The point-mass filter on a grid, also for static Bayes: multiply by the likelihood, convolve with the motion.

MAT 2.5 (2.7), 3.4, 3.5.  The record and its makers are in `core.grid_density`, estimates in `core.grid_estimates`,
prediction in `core.grid_motion`; their names can be imported from here.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.grid_density import (
    GridDensity,
    cells,
    from_gaussian,
    from_log_density,
    gaussian_axes,
    mesh,
    uniform,
)
from core.grid_estimates import (
    HitOrMiss,
    expected_loss,
    hit_or_miss,
    marginal,
    mean_square_error,
    median,
    mode,
    moments,
    quantile,
)
from core.grid_motion import Prediction, blur, deposit, follow, predict, prediction, regrid, transport
from core.types import Array, Motion, Sensor

__all__ = [
    "GridDensity",
    "GridRun",
    "GridUpdate",
    "HitOrMiss",
    "Prediction",
    "blur",
    "cells",
    "deposit",
    "expected_loss",
    "follow",
    "from_gaussian",
    "from_log_density",
    "gaussian_axes",
    "hit_or_miss",
    "marginal",
    "mean_square_error",
    "median",
    "mesh",
    "mode",
    "moments",
    "multiply",
    "predict",
    "prediction",
    "quantile",
    "regrid",
    "run",
    "transport",
    "uniform",
    "update",
]


class GridUpdate(NamedTuple):
    """prior; log_likelihood log p(y | x) at the cells (broadcast over the axes it does not depend on); posterior.

    log_evidence: log p(y) = log int p(y | x) p(x) dx.
    """

    prior: GridDensity
    log_likelihood: Array
    posterior: GridDensity
    log_evidence: float

    @property
    def evidence(self) -> float:
        """p(y), the normaliser of (2.7)."""
        return float(np.exp(self.log_evidence))


class GridRun(NamedTuple):
    """means (T, d), covs (T, d, d), log_evidences (T,), lost (T,): mass cut off; updates: one record per step."""

    means: Array
    covs: Array
    log_evidences: Array
    lost: Array
    updates: tuple[GridUpdate, ...]


def update(prior: GridDensity, y: ArrayLike, sensor: Sensor, *, components: Sequence[int] | None = None) -> GridUpdate:
    """p(x | y) = p(x) p(y | x) / int p(x) p(y | x) dx.

    y (m,) in the sensor's units.  components: those of the state that the sensor looks at, rising, if not all; the
    likelihood is then computed on their axes only (a range in a four-dimensional grid: positions).  In logarithms, so
    nothing underflows.  ValueError for a wrong shape, or a y that is impossible everywhere.  MAT (2.7), 3.4.

    >>> from core.sensors import Position
    >>> step = update(uniform(cells(0.0, 10.0, 1000)), [8.0], Position(1, 3.0))          # MAT Example 18
    >>> moments(step.posterior).mean.round(2).tolist(), round(step.evidence, 4)
    ([6.76], 0.0744)
    """
    axes = list(prior.axes)
    if components is not None:
        c = list(components)
        if not c or c != sorted(set(c)) or c[0] < 0 or c[-1] >= prior.dim:
            raise ValueError(f"components: expected rising indices from 0 to {prior.dim - 1}, got {c}")
        axes = [a if i in c else a[len(a) // 2:len(a) // 2 + 1] for i, a in enumerate(axes)]
    return multiply(prior, sensor.log_likelihood(np.asarray(y, dtype=np.float64), mesh(axes)))


def multiply(prior: GridDensity, log_likelihood: ArrayLike) -> GridUpdate:
    """p(x) L(x) / int p(x) L(x) dx for any likelihood.

    log_likelihood: an array that broadcasts to the prior's (n_1, ..., n_d); -inf is impossible -> as `update`.
    ValueError for NaN, another shape, or a likelihood 0 wherever the prior is positive.  MAT (2.7).

    >>> multiply(GridDensity([0.0, 1.0], [0.5, 0.5]), np.log([0.2, 0.6])).posterior.weights.round(9).tolist()
    [0.25, 0.75]
    """
    ll = np.asarray(log_likelihood, dtype=np.float64)
    shape = prior.weights.shape
    if np.isnan(ll).any() or (ll == np.inf).any():
        raise ValueError("log_likelihood: expected numbers or -inf, got NaN or infinity")
    try:
        logs = prior.log_weights + np.broadcast_to(ll, shape)
    except ValueError:
        raise ValueError(f"log_likelihood: expected a shape that broadcasts to {shape}, got {ll.shape}") from None
    top = logs.max()
    if top == -np.inf:
        raise ValueError("log_likelihood: expected a measurement that is possible somewhere under the prior, got 0")
    return GridUpdate(prior, ll, GridDensity.from_log_weights(prior.axes, logs),
                      float(top + np.log(np.exp(logs - top).sum())))


def run(
    initial: GridDensity, ys: ArrayLike, motion: Motion, sensor: Sensor, *, moving: bool = True, width: float = 5.0,
    components: Sequence[int] | None = None,
) -> GridRun:
    """predict and update for y_1, ..., y_T, starting one step before y_1; by default on a grid that follows.

    initial: the density of x_0; ys (T, m).  With `moving` the grid is laid anew around the posterior before each
    prediction and around the prior after it, `width` standard deviations to each side.  MAT 3.4, 3.5.
    """
    ys = np.asarray(ys, dtype=np.float64)
    if ys.ndim != 2:
        raise ValueError(f"ys: expected shape (T, m), got {ys.shape}")
    p, updates, lost = initial, [], []
    for y in ys:
        gone = 0.0
        if moving:
            p, gone = regrid(p, follow(p, initial.weights.shape, width))
        step = prediction(p, motion, moving=moving, width=width)
        updates.append(update(step.prior, y, sensor, components=components))
        lost.append(gone + step.lost)
        p = updates[-1].posterior
    laws = [moments(u.posterior) for u in updates]
    return GridRun(
        np.array([g.mean for g in laws]).reshape(len(ys), initial.dim),
        np.array([g.cov for g in laws]).reshape(len(ys), initial.dim, initial.dim),
        np.array([u.log_evidence for u in updates]), np.array(lost), tuple(updates),
    )
