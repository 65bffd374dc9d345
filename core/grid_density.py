"""Densities on regular grids: a probability for every cell.  MAT 3.5, 2.5.

A density is a set of point masses at the centres of equal cells, and at the same time constant within each cell: the
weights sum to 1, and the density is weight / cell volume (erratum M19).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.gaussian import log_density
from core.types import Array, Gaussian


@dataclass(frozen=True, slots=True, eq=False)
class GridDensity:
    """p(x) = sum_i w_i 1(x in cell i) / |cell|,  sum w_i = 1.

    axes: one array of cell centres per state component, equally spaced and rising, at least 2 cells each (for one
    component the array alone will do).  weights (n_1, ..., n_d) >= 0, proportional to the cells' probabilities; they
    are normalised and stored read-only.  ValueError for anything else.  MAT 3.5 with erratum M19.

    >>> p = GridDensity([0.25, 0.75], [1.0, 3.0])
    >>> p.weights, p.density
    (array([0.25, 0.75]), array([0.5, 1.5]))
    """

    axes: tuple[Array, ...]
    weights: Array
    _log_weights: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        axes = checked_axes(self.axes)
        shape = tuple(len(a) for a in axes)
        w = np.array(self.weights, dtype=np.float64)
        if w.shape != shape:
            raise ValueError(f"weights: expected shape {shape} as the axes say, got {w.shape}")
        total = float(w.sum())
        if not 0.0 < total < np.inf or w.min() < 0.0:
            raise ValueError(f"weights: expected finite numbers >= 0 that do not all vanish, got the least {w.min()} "
                             f"and the sum {total}")
        w /= total
        w.setflags(write=False)
        object.__setattr__(self, "axes", axes)
        object.__setattr__(self, "weights", w)

    @classmethod
    def from_log_weights(cls, axes: Sequence[ArrayLike], log_weights: ArrayLike) -> "GridDensity":
        """w_i ~ exp(l_i), without underflow; -inf is a cell of probability 0.  ValueError for NaN or no cell at all.

        The logarithms are kept, so that later measurements can bring back cells whose weight has underflowed to 0.
        """
        logs = np.asarray(log_weights, dtype=np.float64)
        top = logs.max(initial=-np.inf)
        if np.isnan(top) or top == np.inf:
            raise ValueError(f"log_weights: expected numbers or -inf, got {top}")
        if top == -np.inf:
            raise ValueError("log_weights: expected at least one cell with a positive probability, got none")
        logs = logs - top
        w = np.exp(logs)
        logs -= np.log(w.sum())
        logs.setflags(write=False)
        return cls(axes, w, logs)

    @property
    def dim(self) -> int:
        """Number of state components."""
        return len(self.axes)

    @property
    def spacing(self) -> Array:
        """Cell sizes (d,) in the state's units."""
        return np.array([(a[-1] - a[0]) / (len(a) - 1) for a in self.axes])

    @property
    def cell_volume(self) -> float:
        """|cell|, the product of the spacings."""
        return float(np.prod(self.spacing))

    @property
    def density(self) -> Array:
        """p at the cell centres, shape (n_1, ..., n_d), per unit of volume."""
        return self.weights / self.cell_volume

    @property
    def log_weights(self) -> Array:
        """log w, shape (n_1, ..., n_d); -inf where the probability is 0."""
        if self._log_weights is not None:
            return self._log_weights
        with np.errstate(divide="ignore"):
            return np.log(self.weights)

    @property
    def points(self) -> Array:
        """The cell centres, shape (n_1, ..., n_d, d)."""
        return mesh(self.axes)


def cells(low: float, high: float, count: int) -> Array:
    """Centres of `count` equal cells that fill [low, high]: low + (i + 1/2) (high - low) / count.

    ValueError unless low < high are finite and count >= 2.

    >>> cells(0.0, 10.0, 5).tolist()
    [1.0, 3.0, 5.0, 7.0, 9.0]
    """
    if not (np.isfinite([low, high]).all() and low < high) or count < 2:
        raise ValueError(f"expected finite low < high and at least 2 cells, got {low}, {high} and {count}")
    return low + (np.arange(count) + 0.5) * ((high - low) / count)


def mesh(axes: Sequence[ArrayLike]) -> Array:
    """All points with coordinates from the axes: shape (n_1, ..., n_d, d), each component contiguous in memory.

    >>> mesh([[0.0, 1.0], [5.0, 6.0]])[1, 0].tolist()
    [1.0, 5.0]
    """
    vectors = [finite("axes", a, None) for a in axes]
    points = np.empty((len(vectors), *(len(a) for a in vectors)))
    for i, a in enumerate(vectors):
        points[i] = a.reshape(-1, *(1,) * (len(vectors) - 1 - i))
    return np.moveaxis(points, 0, -1)


def uniform(axes: Sequence[ArrayLike]) -> GridDensity:
    """p(x) = const on the box of the cells: the flat prior of MAT 2.5.

    >>> uniform([cells(0.0, 10.0, 5)]).density.tolist()
    [0.1, 0.1, 0.1, 0.1, 0.1]
    """
    axes = checked_axes(axes)
    return GridDensity(axes, np.ones([len(a) for a in axes]))


def from_log_density(axes: Sequence[ArrayLike], log_p: Callable[[Array], Array]) -> GridDensity:
    """w_i ~ p(x_i): any density by its logarithm, known up to a constant, at the points (..., d) of the cells.

    >>> float(from_log_density([cells(0.0, 1.0, 2)], lambda x: np.log(x[..., 0])).weights[1].round(9))
    0.75
    """
    axes = checked_axes(axes)
    return GridDensity.from_log_weights(axes, np.broadcast_to(log_p(mesh(axes)), [len(a) for a in axes]))


def from_gaussian(g: Gaussian, axes: Sequence[ArrayLike]) -> GridDensity:
    """w_i ~ N(x_i; mu, P).  g with mean (d,) and cov (d, d) positive definite, see `gaussian_axes` for axes that fit.

    >>> float(from_gaussian(Gaussian(np.zeros(1), np.eye(1)), [cells(-5.0, 5.0, 50)]).density.max().round(2))
    0.4
    """
    return from_log_density(axes, lambda x: log_density(g, x))


def gaussian_axes(g: Gaussian, counts: int | Sequence[int], width: float = 5.0) -> tuple[Array, ...]:
    """mu_i - width sd_i <= x_i <= mu_i + width sd_i, in counts (a number or one per component) cells.

    g: mean (d,), cov (d, d); width in standard deviations.  ValueError for a zero variance.
    """
    mean = finite("mean", g.mean, None)
    sd = np.sqrt(np.diagonal(finite("cov", g.cov, len(mean), len(mean))))
    if not (sd > 0.0).all() or not width > 0.0:
        raise ValueError(f"expected positive variances and width > 0, got standard deviations {sd} and {width}")
    counts = [counts] * len(mean) if isinstance(counts, int | np.integer) else list(counts)
    return tuple(cells(m - width * s, m + width * s, n) for m, s, n in zip(mean, sd, counts, strict=True))


def checked_axes(axes: Sequence[ArrayLike]) -> tuple[Array, ...]:
    """axes as read-only arrays; ValueError unless each is rising and equally spaced, with at least 2 cells."""
    if not len(axes):
        raise ValueError("axes: expected at least one axis, got none")
    if np.ndim(axes[0]) == 0:                             # one axis, not in a list
        axes = [axes]
    out = []
    for i, axis in enumerate(axes):
        a = np.array(finite(f"axes[{i}]", axis, None))
        steps = np.diff(a)
        if a.ndim != 1 or len(a) < 2 or steps.min() <= 0.0:
            raise ValueError(f"axes[{i}]: expected at least 2 rising cell centres, got {a}")
        if np.ptp(steps) > 1e-6 * steps.max() + 64 * np.finfo(float).eps * np.abs(a).max():
            raise ValueError(f"axes[{i}]: expected equal spacing, got steps from {steps.min()} to {steps.max()}")
        a.setflags(write=False)
        out.append(a)
    return tuple(out)
