"""An estimate that garbage hardly moves: Huber's, by reweighted least squares.  MAT 2.3.2 note 1."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.orthogonal import back_substitute, factorise
from core.types import Array, Sensor


class Robust(NamedTuple):
    """x (n,); weights (m,) from 0 to 1, of the last step; residuals h(x) - y (m,); iterates (k + 1, n); converged."""

    x: Array
    weights: Array
    residuals: Array
    iterates: Array
    converged: bool


def huber(
    sensor: Sensor, y: ArrayLike, x0: ArrayLike, *, threshold: float = 1.345, tolerance: float = 1e-3,
    max_iterations: int = 100,
) -> Robust:
    """argmin sum rho(p_i / sigma_i),  rho(z) = z^2 / 2 up to |z| = c and c |z| - c^2 / 2 beyond.

    Gauss-Newton steps with the weights min(1, c / |z_i|) (reweighted least squares): a row with large residuals pulls
    no harder than one at the threshold c.  y (m,), x0 (n,), R diagonal.  c = 1.345 loses 5 % of the efficiency for
    normal errors.  ValueError for correlated errors, fewer measurements than unknowns, a singular Jacobian, c <= 0.
    Huber 1964.

    >>> from core.sensors import Linear
    >>> huber(Linear(np.ones((5, 1)), 1.0), [0.0, 0.1, -0.1, 0.2, 50.0], [0.0]).x.round(2).tolist()
    [0.39]
    """
    y, x, R = finite("y", y, len(sensor.R)), finite("x0", x0, None), sensor.R
    if y.ndim != 1 or x.ndim != 1 or len(y) < len(x):
        raise ValueError(f"expected y (m,) and x0 (n,) with m >= n, got shapes {y.shape} and {x.shape}")
    if np.any(R - np.diag(np.diagonal(R))) or not (np.diagonal(R) > 0.0).all():
        raise ValueError("R: expected a diagonal matrix with positive entries (independent errors), got another")
    if not threshold > 0.0 or not tolerance > 0.0 or max_iterations < 1:
        raise ValueError(f"expected threshold, tolerance > 0, max_iterations >= 1, got {threshold}, {tolerance}, "
                         f"{max_iterations}")
    sigma = np.sqrt(np.diagonal(R))
    iterates, converged = [x], False
    while True:
        p = -sensor.innovation(y, sensor.h(x))
        z = p / sigma
        weights = threshold / np.maximum(np.abs(z), threshold)
        if converged or len(iterates) > max_iterations:
            return Robust(x, weights, p, np.stack(iterates), converged)
        root = np.sqrt(weights)
        factors = factorise(sensor.jacobian(x) * (root / sigma)[:, None], -root * z)
        if factors.singular:
            raise ValueError("x0: expected a start from which the Jacobian stays regular, got a singular one at "
                             f"iterate {len(iterates) - 1}; start elsewhere or measure more")
        dx = back_substitute(factors)
        x = x + dx
        iterates.append(x)
        converged = bool(np.sqrt(np.square(dx).sum()) < tolerance)
