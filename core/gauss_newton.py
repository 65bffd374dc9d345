"""Iterative least squares: Gauss-Newton and Levenberg-Marquardt, one run with all its steps or thousands at once.

MAT 2.3, Algorithms 1 and 2.  With as many measurements as unknowns a step is Newton's step for the equations
h(x) = y, not Newton's method for the minimisation (erratum M6).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.gauss_newton_steps import iterate, whiten
from core.linalg import cholesky_positive
from core.orthogonal import factorise, inverse_gram
from core.types import Array, Sensor


class Solution(NamedTuple):
    """One run.  Row j of an array belongs to the iterate x_j; x_0 is the start, and k steps were taken.

    x (n,), the last iterate.  iterates (k + 1, n).  residuals (k + 1, m): h(x_j) - y, angles wrapped; their norms
    residual_norms (k + 1,).  costs (k + 1,): p'R^-1 p if weighted, else p'p.  jacobians (k + 1, m, n).  steps (k, n).
    ranks (k,): n, or less where a step had to do without some directions.  dampings (k,): the mu of each step, 0
    without damping.  converged: the last step was complete and shorter than the tolerance.  cov (n, n): the error
    covariance of x by linearisation there; NaN if the Jacobian is singular at x.
    """

    x: Array
    iterates: Array
    residual_norms: Array
    converged: bool
    cov: Array
    residuals: Array
    costs: Array
    jacobians: Array
    steps: Array
    ranks: Array
    dampings: Array


class Solutions(NamedTuple):
    """Many runs.  x (..., n), the last iterates; steps (...), whole numbers; converged, singular (...): flags.

    singular: the Jacobian was singular at the start and no step was taken.  A run that neither converged nor was
    singular used up its iterations or went to infinity.  residual_norms (...); costs (...); cov (..., n, n) as in
    `Solution`, NaN where not converged.
    """

    x: Array
    steps: Array
    converged: Array
    singular: Array
    residual_norms: Array
    costs: Array
    cov: Array


def gauss_newton(
    sensor: Sensor,
    y: ArrayLike,
    x0: ArrayLike,
    *,
    weighted: bool = True,
    tolerance: float = 1e-3,
    max_iterations: int = 50,
    damping: float | None = None,
) -> Solution:
    """x_{k+1} = x_k - (J'WJ)^-1 J'W (h(x_k) - y),  W = R^-1 or I,  until |x_{k+1} - x_k| < tolerance.

    y (m,), x0 (n,), m >= n; tolerance in the state's units.  A step is counted when it is taken, and the test comes
    after it.  `damping` mu > 0 gives Levenberg-Marquardt: J'WJ + mu diag(J'WJ), mu divided by 10 after a step that
    lowers the cost and multiplied by 10 (and the step not taken) otherwise; `max_iterations` counts the trials.
    A later iterate with a singular Jacobian (far away all stations lie in one direction) is left by the shortest
    step, which moves only in the directions that are measured; `ranks` tells, and it never counts as convergence.
    ValueError for a singular Jacobian at the start (without damping), fewer measurements than unknowns, a singular R
    (if weighted), a wrong shape or NaN.  Running out of iterations is no error: see `converged`.
    MAT (2.4)-(2.6), Algorithms 1 and 2, 2.3.2 note 2.

    >>> from core.sensors import Range
    >>> fix = gauss_newton(Range([[100, 0], [0, 50]], 10.0), [108, 46], [0, 0])
    >>> fix.x.round(4), len(fix.steps), fix.converged
    (array([-7.8984,  4.6832]), 4, True)
    """
    y, x0, L = _checked(sensor, y, x0, weighted, tolerance, max_iterations, damping)
    if y.ndim != 1 or x0.ndim != 1:
        raise ValueError(f"expected one y (m,) and one x0 (n,), got {y.shape} and {x0.shape}; see gauss_newton_batch")
    path: list[tuple[Array, int, float]] = [(x0, 0, 0.0)]
    x, _, converged, singular = iterate(sensor, y[None], x0[None], L, tolerance, max_iterations, damping, path)
    iterates = np.stack([point for point, _, _ in path])
    jacobians = np.array(sensor.jacobian(iterates))
    if singular[0]:
        raise ValueError(_advice(jacobians[0]))
    residuals = -sensor.innovation(y, sensor.h(iterates))
    norms, costs = _sizes(residuals, L)
    return Solution(
        x[0], iterates, norms, bool(converged[0]), _covariance(jacobians[-1], sensor.R, L, weighted), residuals,
        costs, jacobians, np.diff(iterates, axis=0), np.array([rank for _, rank, _ in path[1:]], dtype=int),
        np.array([mu for _, _, mu in path[1:]]),
    )


def gauss_newton_batch(
    sensor: Sensor,
    y: ArrayLike,
    x0: ArrayLike,
    *,
    weighted: bool = True,
    tolerance: float = 1e-3,
    max_iterations: int = 50,
    damping: float | None = None,
) -> Solutions:
    """`gauss_newton` from every start x0 (..., n) and for every y (..., m), broadcast against each other.

    For basins of attraction (many starts) and repeated experiments (many y).  A singular Jacobian or divergence stops
    only its own run and is told by the flags: count those runs and leave them out of averages (erratum M12).
    ValueError for fewer measurements than unknowns, a wrong shape or NaN.  MAT exercises 2.16(c), 2.17(a).

    >>> from core.sensors import Range
    >>> runs = gauss_newton_batch(Range([[100, 0], [0, 50]], 10.0), [108, 46], [[0, 0], [0, 50], [150, 150]])
    >>> runs.steps.tolist(), runs.converged.tolist(), runs.singular.tolist()
    ([4, 0, 6], [True, False, True], [False, True, False])
    """
    y, x0, L = _checked(sensor, y, x0, weighted, tolerance, max_iterations, damping)
    m, n = y.shape[-1], x0.shape[-1]
    try:
        batch = np.broadcast_shapes(y.shape[:-1], x0.shape[:-1])
    except ValueError:
        raise ValueError(f"x0: expected batch axes that fit y {y.shape}, got {x0.shape}") from None
    ys = np.broadcast_to(y, (*batch, m)).reshape(-1, m)
    starts = np.broadcast_to(x0, (*batch, n)).reshape(-1, n)
    x, steps, converged, singular = iterate(sensor, ys, starts, L, tolerance, max_iterations, damping, None)
    norms, costs = _sizes(-sensor.innovation(ys, sensor.h(x)), L)
    cov = _covariance(sensor.jacobian(x), sensor.R, L, weighted)
    cov = np.where(converged[:, None, None], cov, np.nan)
    return Solutions(
        x.reshape(*batch, n), steps.reshape(batch), converged.reshape(batch), singular.reshape(batch),
        norms.reshape(batch), costs.reshape(batch), cov.reshape(*batch, n, n),
    )


def basins(runs: Solutions, solutions: ArrayLike, radius: float = 1.0) -> Array:
    """The number of the solution that each run ended at: argmin_i |x - s_i| if below `radius`, else -1.

    solutions (k, n), for instance the roots of `core.closed_form.multilaterate` -> whole numbers (...); -1 also for
    runs that did not converge.  MAT exercise 2.16(c).
    """
    s = finite("solutions", solutions, None, runs.x.shape[-1])
    distances = np.sqrt(np.square(runs.x[..., None, :] - s).sum(axis=-1))
    reached = runs.converged & (distances.min(axis=-1) < radius)
    return np.where(reached, distances.argmin(axis=-1), -1)


def _sizes(residuals: Array, L: Array | None) -> tuple[Array, Array]:
    """|p| in the measurement's units, and the cost."""
    white = whiten(L, residuals, False)
    return np.sqrt(np.square(residuals).sum(axis=-1)), np.square(white).sum(axis=-1)


def _covariance(J: Array, R: Array, L: Array | None, weighted: bool) -> Array:
    """V(x) (..., n, n) by linearisation: (J'R^-1 J)^-1 or, not weighted, (2.6); NaN for a singular J."""
    G = inverse_gram(factorise(whiten(L, J, True)))
    if weighted:
        return G
    K = G @ J.mT
    P = K @ R @ K.mT                                      # (2.6)
    return 0.5 * (P + P.mT)


def _checked(
    sensor: Sensor, y: ArrayLike, x0: ArrayLike, weighted: bool, tolerance: float, max_iterations: int,
    damping: float | None,
) -> tuple[Array, Array, Array | None]:
    m = len(sensor.R)
    y, x0 = finite("y", y, m), finite("x0", x0, None)
    n = x0.shape[-1]
    if m < n:
        raise ValueError(
            f"y: expected at least as many measurements as unknowns ({n}), got {m}; measure more, fix some of the "
            f"unknowns, or add a prior as a `Position` or `Linear` sensor"
        )
    if not tolerance > 0.0 or max_iterations < 1:
        raise ValueError(f"expected tolerance > 0 and max_iterations >= 1, got {tolerance} and {max_iterations}")
    if damping is not None and not 0.0 < damping < np.inf:
        raise ValueError(f"damping: expected a positive number or None, got {damping}")
    return y, x0, cholesky_positive("R", sensor.R) if weighted else None


def _advice(J: Array) -> str:
    empty = np.flatnonzero(~J.any(axis=0)).tolist()
    why = f"nothing measures the components {empty} of the state" if empty else "its columns are dependent there"
    return (
        f"x0: expected a start with a regular Jacobian, got a singular one ({why}); start elsewhere (not at a station "
        f"or on the line through the stations), measure more, or give damping, e.g. 1e-3"
    )
