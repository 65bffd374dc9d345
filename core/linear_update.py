"""Two other ways to the Kalman update, and what any other gain would give.  KF thesis chapter 3, (3.1)-(3.19).

`core.kalman.update` is the gain form with the best gain; here are the cost that its mean minimises, the information
form of the same mean, and the covariance of the error for a gain of one's own.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.gaussian import mahalanobis_squared
from core.likelihood import weighted_cost
from core.linalg import cholesky_positive, solve_vectors
from core.stacks import law, vector
from core.types import Array, Gaussian, Sensor


class Information(NamedTuple):
    """measured H' R^-1 H and known P^-1 (n, n): what the two terms of the cost say; vector H' R^-1 y + P^-1 x- (n,).

    hessian: 2 (H' R^-1 H + P^-1), the curvature of the cost (3.7); posterior: the law at its minimum.
    """

    measured: Array
    known: Array
    vector: Array
    hessian: Array
    posterior: Gaussian


def map_cost(prior: Gaussian, y: ArrayLike, sensor: Sensor, x: ArrayLike) -> tuple[Array, Array]:
    """(y - h(x))' R^-1 (y - h(x))  and  (x - x-)' P^-1 (x - x-): minus twice the log posterior is their sum + const.

    prior: mean (n,), cov (n, n) positive definite; y (m,); x (..., n) -> two arrays (...).  ValueError for a singular
    P or R.  KF thesis (3.4) with erratum K2.

    >>> from core.sensors import Position
    >>> [float(c) for c in map_cost(Gaussian(np.zeros(1), 4 * np.eye(1)), [3.0], Position(1, 1.0), [2.0])]
    [1.0, 1.0]
    """
    return weighted_cost(sensor, y, x), mahalanobis_squared(prior, finite("x", x, None))


def information_update(prior: Gaussian, y: ArrayLike, sensor: Sensor) -> Information:
    """x+ = (H' R^-1 H + P^-1)^-1 (H' R^-1 y + P^-1 x-),  P+ = (H' R^-1 H + P^-1)^-1.

    prior: mean (n,), cov (n, n) positive definite; y (m,), linear sensor.  H' R^-1 H alone may be singular (m < n),
    the sum is not (erratum K5).  ValueError for a singular P or R.  KF thesis (3.7)-(3.9).

    >>> from core.sensors import Position
    >>> information_update(Gaussian(np.zeros(1), 4 * np.eye(1)), [5.0], Position(1, 1.0)).posterior.mean.round(9)
    array([4.])
    """
    x, P = law("prior", prior)
    H, y = sensor.jacobian(x), vector("y", y, len(sensor.R))
    W = solve_vectors(cholesky_positive("R", sensor.R), H.T).T        # W' W = H' R^-1 H
    z = solve_vectors(cholesky_positive("R", sensor.R), y)
    root = np.linalg.solve(cholesky_positive("prior.cov", P), np.eye(len(x)))
    measured, known = W.T @ W, root.T @ root
    total = measured + known
    vector_sum = W.T @ z + known @ x                                  # (3.9)
    cov = np.linalg.solve(total, np.eye(len(x)))
    return Information(measured, known, vector_sum, 2.0 * total,
                       Gaussian(np.linalg.solve(total, vector_sum), (cov + cov.T) / 2))


def joseph_form(P: ArrayLike, H: ArrayLike, R: ArrayLike, K: ArrayLike) -> Array:
    """(I - K H) P (I - K H)' + K R K': the covariance of x - x+ for any gain K.

    P (n, n), H (m, n), R (m, m), K (..., n, m) -> (..., n, n).  ValueError for a wrong shape or an indefinite P or R.
    KF thesis (3.14).

    >>> joseph_form([[4.0]], [[1.0]], [[2.0]], [[[0.0]], [[1.0]]]).ravel().tolist()
    [4.0, 2.0]
    """
    P, H, R, K = _checked(P, H, R, K)
    A = np.eye(len(P)) - K @ H
    return A @ P @ A.mT + K @ R @ K.mT


def short_form(P: ArrayLike, H: ArrayLike, K: ArrayLike) -> Array:
    """(I - K H) P: equal to the Joseph form only if (K S - P H') K' = 0, as for the best gain K = P H' S^-1.

    Shapes as in `joseph_form`; for other gains it is not even symmetric and may have a negative trace.  KF thesis
    (3.16).

    >>> short_form([[4.0]], [[1.0]], [[1.5]]).tolist()
    [[-2.0]]
    """
    P, H, _, K = _checked(P, H, None, K)
    return P - K @ H @ P


def trace_gradient(P: ArrayLike, H: ArrayLike, R: ArrayLike, K: ArrayLike) -> Array:
    """d tr P+ / dK = -2 P H' + 2 K (H P H' + R), zero at the best gain; P+ in Joseph form.

    Shapes as in `joseph_form` -> (..., n, m).  KF thesis (3.17)-(3.18).

    >>> trace_gradient([[4.0]], [[1.0]], [[2.0]], [[0.5]]).tolist()
    [[-2.0]]
    """
    P, H, R, K = _checked(P, H, R, K)
    return -2.0 * P @ H.T + 2.0 * K @ (H @ P @ H.T + R)


def _checked(P: ArrayLike, H: ArrayLike, R: ArrayLike | None, K: ArrayLike) -> tuple[Array, Array, Array, Array]:
    P = covariance("P", P)
    H = finite("H", H, None, len(P))
    m = len(H)
    return P, H, np.zeros((m, m)) if R is None else covariance("R", R, m), finite("K", K, len(P), m)
