"""How good an estimate is, how honest its covariance is, and how good it could be."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core import checks
from core.gaussian import chi_square_level, mahalanobis_squared
from core.innovation import nis
from core.recursion import each
from core.stacks import congruence, law, lower_root, shared, solve_spd, symmetric, times
from core.types import Array, Gaussian, Motion, Sensor

__all__ = [
    "ErrorSummary", "consistency_band", "coverage", "cramer_rao", "error_summary", "nees", "nis",
    "posterior_cramer_rao", "rmse",
]  # fmt: skip


class ErrorSummary(NamedTuple):
    """Mean, median, 95 % quantile, root mean square and largest of the errors, in their unit."""

    mean: float
    median: float
    p95: float
    rmse: float
    max: float


def rmse(estimate: Array, truth: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """sqrt(mean |x_hat - x|^2).

    estimate, truth (..., n), broadcast; the norm is over the last axis and the mean over `axis` of the others (None:
    all).  ValueError for shapes that do not fit or NaN.

    >>> float(rmse([[3.0, 4.0], [0.0, 0.0]], [0.0, 0.0]).round(6))
    3.535534
    """
    e = _error(estimate, truth)
    squares = np.square(e).sum(axis=-1)
    return np.sqrt(squares.mean(axis=axis))


def nees(estimate: Gaussian, truth: Array) -> Array:
    """(x - x_hat)' P^-1 (x - x_hat), shape (...): chi-square with n degrees of freedom for an honest filter.

    estimate: mean (..., n), cov (..., n, n) positive definite; truth (..., n).  ValueError otherwise.
    """
    x, P = law("estimate", estimate)
    e = _error(truth, x)
    try:
        return mahalanobis_squared(Gaussian(np.zeros(x.shape[-1]), np.asarray(P)), e)
    except ValueError as error:
        raise ValueError(f"estimate: {error}") from None


def coverage(estimate: Gaussian, truth: Array, probability: Array | float, axis: int | tuple[int, ...] | None = None):
    """Share of the truths inside the ellipsoid that claims `probability`:  nees <= chi2_n(probability).

    estimate: mean (..., n), cov (..., n, n); truth (..., n); probability a number or (k,); the share is taken over
    `axis` of the batch axes (None: all), shape (...) or (..., k).

    >>> float(coverage(Gaussian(np.zeros((4, 1)), np.eye(1)), [[0.1], [0.5], [0.9], [3.0]], 0.68))
    0.75
    """
    value = nees(estimate, truth)
    level = chi_square_level(probability, np.shape(estimate[0])[-1])
    inside = value[..., None] <= np.atleast_1d(level)
    if axis is not None:
        axis = tuple(a if a >= 0 else a - 1 for a in np.atleast_1d(axis).tolist())
    share = inside.mean(axis=tuple(range(inside.ndim - 1)) if axis is None else axis)
    return share if np.ndim(level) else share[..., 0]


def consistency_band(probability: float, n: int, count: int) -> tuple[float, float]:
    """[a, b] that holds the mean of `count` independent chi-square(n) values with this probability, equal tails.

    For the average NEES (n states) or NIS (n measurements) over `count` runs.  ValueError outside (0, 1) or for
    count < 1.

    >>> [round(v, 3) for v in consistency_band(0.95, 4, 50)]
    [3.255, 4.821]
    """
    if not 0 < probability < 1 or count != int(count) or count < 1:
        raise ValueError(f"expected a probability in (0, 1) and count >= 1, got {probability} and {count}")
    tail = (1 - probability) / 2
    low, high = chi_square_level([tail, 1 - tail], int(n) * int(count)) / count
    return float(low), float(high)


def cramer_rao(sensor: Sensor, x: Array, prior_cov: Array | None = None) -> Array:
    """(H' R^-1 H + P^-1)^-1,  H = h'(x): no unbiased estimator from one measurement has a smaller covariance.

    x (..., n) the true state; prior_cov (n, n) or (..., n, n) of prior knowledge, which makes it a bound on the mean
    square error of any estimator.  Shape (..., n, n).  ValueError if the measurement alone does not determine x.
    MAT (2.6) with the best weights; van Trees 1968.

    >>> from core.sensors import Position
    >>> cramer_rao(Position(2, [3.0, 4.0]), np.zeros(2)).round(6)
    array([[ 9.,  0.],
           [ 0., 16.]])
    """
    information = _information(sensor, checks.finite("x", x, None))
    if prior_cov is not None:
        return _add_information(checks.covariance("prior_cov", prior_cov, information.shape[-1]), information)
    try:
        return symmetric(solve_spd(information, np.broadcast_to(np.eye(information.shape[-1]), information.shape)))
    except ValueError:
        raise ValueError("x: expected measurements that determine every component, got a singular information "
                         "matrix; give a prior_cov or a smaller state") from None


def posterior_cramer_rao(
    initial_cov: Array, truths: Array, motion: Motion | Sequence[Motion], sensor: Sensor | Sequence[Sensor]
) -> Array:
    """C_k = ((F C_{k-1} F' + Q)^-1 + E H' R^-1 H)^-1: the bound on the mean square error of any filter, (T, n, n).

    initial_cov (n, n) of the state one step before truths[0]; truths (T, ..., n): the mean over the batch axes stands
    for the expectation over tracks.  motion, linear or linearised at the mean truth, and sensor: one model or one per
    step.  Q may be singular.  Tichavsky, Muravchik and Nehorai 1998.
    """
    truths = checks.finite("truths", truths, None)
    if truths.ndim < 2 or not len(truths):
        raise ValueError(f"truths: expected shape (T, ..., n) with T >= 1, got {truths.shape}")
    T, n = len(truths), truths.shape[-1]
    C = checks.covariance("initial_cov", initial_cov, n)
    motions, sensors = each("motion", motion, T, "f"), each("sensor", sensor, T, "h")
    runs = tuple(range(truths.ndim - 2))
    bounds = np.empty((T, n, n))
    for k in range(T):
        F = motions[k].jacobian(truths[max(k - 1, 0)].mean(axis=runs))
        C = symmetric(congruence(F, C) + motions[k].Q)
        C = _add_information(C, _information(sensors[k], truths[k]).mean(axis=runs))
        bounds[k] = C
    return bounds


def error_summary(errors: Array) -> ErrorSummary:
    """Mean, median, 95 % quantile (linear between ranks), root mean square and maximum of errors (N,).

    ValueError for an empty or non-finite array.
    """
    e = checks.finite("errors", errors, None)
    if not e.size:
        raise ValueError("errors: expected at least one, got none")
    median, p95 = np.quantile(e, [0.5, 0.95])
    return ErrorSummary(*map(float, (e.mean(), median, p95, np.sqrt(np.square(e).mean()), e.max())))


def _error(a: Array, b: Array) -> Array:
    a, b = checks.finite("estimate", a, None), checks.finite("truth", b, None)
    if a.shape[-1] != b.shape[-1]:
        raise ValueError(f"expected estimate and truth of the same dimension, got {a.shape} and {b.shape}")
    return a - b


def _information(sensor: Sensor, x: Array) -> Array:
    H = sensor.jacobian(x)
    R = np.broadcast_to(sensor.R, (*H.shape[:-2], *sensor.R.shape))
    return symmetric(times(H.mT, solve_spd(R, H)))


def _add_information(C: Array, information: Array) -> Array:
    """(C^-1 + W' W)^-1 = C - C W' (I + W C W')^-1 W C for W' W = information; C may be singular."""
    W = lower_root(shared(information)).mT
    WC = times(W, C)
    S = times(WC, W.mT) + np.eye(W.shape[-1])
    return symmetric(C - times(WC.mT, solve_spd(S, WC)))
