"""The likelihood as a function of the state: maps, weighted least-squares cost, the linearised posterior.

MAT 2.4, 2.5.2, Fig 2.2, exercise 2.16 (the surface of the residual norm).  The likelihood p(y | x) is a density in y;
as a function of x it need not have an integral (erratum M9).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.grid_density import GridDensity, checked_axes, mesh
from core.grid_estimates import mode
from core.linalg import cholesky_positive, solve_vectors
from core.orthogonal import back_substitute, factorise, inverse_gram
from core.sensors_linear import Stack
from core.types import Array, Gaussian, Sensor


class LikelihoodMap(NamedTuple):
    """log p(y | x) on a grid.

    axes: the grid's; points (n_1, ..., n_d, n): the states; parts (k, n_1, ..., n_d): log p(y_j | x) of each sensor
    of a stack (k = 1 for another sensor); log_likelihood (n_1, ..., n_d): their sum.
    """

    axes: tuple[Array, ...]
    points: Array
    parts: Array
    log_likelihood: Array

    @property
    def relative(self) -> Array:
        """p(y | x) / max p(y | x), shape (n_1, ..., n_d): a picture without units; 0 if y is possible nowhere."""
        top = self.log_likelihood.max()
        return np.exp(self.log_likelihood - top) if top > -np.inf else np.zeros(self.log_likelihood.shape)

    @property
    def posterior(self) -> GridDensity:
        """The posterior for a flat prior on the grid's box: the likelihood, normalised.  ValueError if 0 everywhere."""
        return GridDensity.from_log_weights(self.axes, self.log_likelihood)

    @property
    def peak(self) -> Array:
        """argmax p(y | x), the maximum likelihood estimate on the grid, (d,).  MAT 2.4."""
        return mode(self.posterior)


def states_on_grid(axes: Sequence[ArrayLike], base: ArrayLike | None = None, components: Sequence[int] = ()) -> Array:
    """The states whose `components` lie on the axes and whose other entries are those of `base`.

    axes: d arrays of cell centres; base (n,), components d different indices (the first d if not given) -> states
    (n_1, ..., n_d, n), each component contiguous in memory.  Without base the grid points themselves.  For maps of
    likelihoods and of DOP numbers.  ValueError for indices that do not fit.

    >>> states_on_grid([[0.0, 1.0], [5.0, 6.0]], base=[0.0, 0.0, 9.0])[1, 0].tolist()
    [1.0, 5.0, 9.0]
    """
    points = mesh(axes)
    if base is None:
        return points
    base = finite("base", base, None)
    c = list(components) or list(range(len(axes)))
    if base.ndim != 1 or len(c) != len(axes) or len(set(c)) != len(c) or min(c) < 0 or max(c) >= len(base):
        raise ValueError(f"components: expected {len(axes)} different indices below {base.shape[-1]}, got {c}")
    rows = np.empty((len(base), *points.shape[:-1]))
    rows[:] = base.reshape(-1, *(1,) * len(axes))
    for i, j in enumerate(c):
        rows[j] = points[..., i]
    return np.moveaxis(rows, 0, -1)


def likelihood_map(
    sensor: Sensor, y: ArrayLike, axes: Sequence[ArrayLike], *, base: ArrayLike | None = None,
    components: Sequence[int] = (),
) -> LikelihoodMap:
    """log p(y | x) = sum_j log p(y_j | x) for all x on a grid.

    y (m,) in the sensor's units, or (r, m): r independent readings, whose logarithms are added.  axes, base and
    components as in `states_on_grid` (a base for the states that the grid leaves alone, such as a clock bias).
    ValueError for a wrong shape.  MAT 2.4, Fig 2.2; exercise 2.11 (several readings).

    >>> from core.sensors import Range
    >>> ring = likelihood_map(Range([[0.0, 0.0]], 1.0), [5.0], [np.arange(-8.0, 9.0)] * 2)
    >>> float(ring.relative[8 + 3, 8 + 4])
    1.0
    """
    axes = checked_axes(axes)
    points = states_on_grid(axes, base, components)
    y = finite("y", y, len(sensor.R))
    if y.ndim > 2:
        raise ValueError(f"y: expected shape (m,) or (r, m), got {y.shape}")
    pairs = [(sensor, slice(None))]
    if isinstance(sensor, Stack):
        pairs = list(zip(sensor.sensors, sensor.rows, strict=True))
    readings = np.atleast_2d(y)
    parts = np.stack([sum(s.log_likelihood(one[rows], points) for one in readings) for s, rows in pairs])
    return LikelihoodMap(axes, points, parts, parts.sum(axis=0))


def weighted_cost(sensor: Sensor, y: ArrayLike, x: ArrayLike) -> Array:
    """(y - h(x))' R^-1 (y - h(x)) = -2 log p(y | x) + const  for normal errors.

    y (m,) or (..., m), x (..., n) -> (...), without a unit: the cost of weighted least squares, so maximum likelihood
    and weighted least squares are one.  ValueError for a singular R.  MAT (2.5), Example 17.

    >>> from core.sensors import Range
    >>> float(weighted_cost(Range([[0.0, 0.0]], 2.0), [5.0], [3.0, 0.0]))
    1.0
    """
    L = cholesky_positive("R", sensor.R)
    return np.square(solve_vectors(L, _residuals(sensor, y, x))).sum(axis=-1)


def residual_norm(sensor: Sensor, y: ArrayLike, x: ArrayLike) -> Array:
    """|h(x) - y|, in the measurement's unit, angles wrapped.

    y (m,) or (..., m), x (..., n) -> (...).  MAT (2.3), exercise 2.16(c).

    >>> from core.sensors import Range
    >>> float(residual_norm(Range([[100.0, 0.0], [0.0, 50.0]], 1.0), [108.0, 46.0], [0.0, 0.0]).round(6))
    8.944272
    """
    return np.sqrt(np.square(_residuals(sensor, y, x)).sum(axis=-1))


def linearised_posterior(sensor: Sensor, y: ArrayLike, x_bar: ArrayLike) -> Gaussian:
    """x | y ~ N(x_bar + (J'R^-1 J)^-1 J'R^-1 dy, (J'R^-1 J)^-1),  dy = y - h(x_bar),  J = h'(x_bar).

    The posterior for a flat prior and normal errors if h were linear around x_bar: its covariance does not depend on
    dy.  y (..., m), x_bar (..., n), broadcast -> a Gaussian of batch (...).  ValueError where J has dependent
    columns.  MAT Example 19, with h(x) = h(x_bar) + J (x - x_bar) (erratum M8).

    >>> from core.sensors import Position
    >>> linearised_posterior(Position(1, 3.0), [5.0], [1.0]).mean.round(9).tolist()
    [5.0]
    """
    x = finite("x_bar", x_bar, None)
    L = cholesky_positive("R", sensor.R)
    J = np.linalg.solve(L, sensor.jacobian(x))
    factors = factorise(J, solve_vectors(L, _residuals(sensor, y, x)))
    if factors.singular.any():
        raise ValueError("x_bar: expected a point where the measurements determine every component of the state, got "
                         "a Jacobian with dependent columns")
    return Gaussian(x + back_substitute(factors), inverse_gram(factors))


def _residuals(sensor: Sensor, y: ArrayLike, x: ArrayLike) -> Array:
    """y - h(x), angles wrapped."""
    return sensor.innovation(finite("y", y, len(sensor.R)), sensor.h(finite("x", x, None)))
