"""Laws that are weighted sums of normal laws: density, moments, component and point of the highest density.  MAT 3.5.

A weight can be 0 (its logarithm -inf): in a batch the laws may have different numbers of components.
"""

from typing import NamedTuple

import numpy as np

from core import checks, gaussian
from core.stacks import Law, cholesky, solve_spd, symmetric, times
from core.types import Array, Gaussian

_LOG_2PI = float(np.log(2.0 * np.pi))


class Mixture(NamedTuple):
    """p(x) = sum_i w_i N(x; mu_i, P_i),  sum w_i = 1.

    log_weights (..., c), natural logarithms, -inf for a weight 0; means (..., c, n); covs (..., c, n, n).
    `mixture` makes one from weights, `one` from a Gaussian.  MAT 3.5.
    """

    log_weights: Array
    means: Array
    covs: Array

    @property
    def weights(self) -> Array:
        """w (..., c) >= 0, sum 1."""
        return np.exp(self.log_weights)

    @property
    def alive(self) -> Array:
        """True (..., c) where the weight is not 0."""
        return self.log_weights > -np.inf


class Components(Mixture):
    """A mixture that has been checked, or computed from one, and need not be checked again."""

    __slots__ = ()


def mixture(weights: Array, means: Array, covs: Array) -> Mixture:
    """p(x) = sum_i w_i N(x; mu_i, P_i).

    weights (..., c) >= 0 with sum 1; means (..., c, n); covs (c, n, n) or (..., c, n, n) positive semidefinite.
    ValueError otherwise.  MAT 3.5.

    >>> mixture([0.25, 0.75], [[0.0], [4.0]], np.ones((2, 1, 1))).weights
    array([0.25, 0.75])
    """
    w, m = checks.finite("weights", weights, None), checks.finite("means", means, None, None)
    if (w < 0).any() or (np.abs(w.sum(axis=-1) - 1.0) > 1e-9).any():
        raise ValueError(f"weights: expected numbers >= 0 with sum 1, got {w.min():g} and the sum {w.sum(axis=-1)}")
    with np.errstate(divide="ignore"):
        return checked("means", Mixture(np.log(w), m, checks.finite("covs", covs, None, None, None)))


def one(g: Gaussian) -> Mixture:
    """p(x) = N(x; mu, P): a mixture of one component, from mean (..., n), cov (n, n) or (..., n, n)."""
    x, P = gaussian.checked(g)
    batch = np.broadcast_shapes(x.shape[:-1], P.shape[:-2])
    n = x.shape[-1]
    return Components(np.zeros((*batch, 1)), np.broadcast_to(x, (*batch, n))[..., None, :],
                      np.broadcast_to(P, (*batch, n, n))[..., None, :, :])


def checked(name: str, m: Mixture) -> Components:
    """m with all batch axes spelled out.  ValueError for wrong shapes, an indefinite covariance or other weights."""
    if type(m) is Components:
        return m
    try:
        w, x, P = m
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected a mixture (log_weights, means, covs), got {type(m).__name__}") from None
    x = checks.finite(name, x, None, None)
    c, n = x.shape[-2:]
    P = checks.covariance(f"{name} covariances", checks.finite(f"{name} covariances", P, c, n, n))
    w = np.asarray(w, dtype=np.float64)
    if w.ndim == 0 or w.shape[-1] != c or not c:
        raise ValueError(f"{name}: expected {max(c, 1)} logarithms of weights, got shape {w.shape}")
    if np.isnan(w).any() or (np.abs(np.exp(np.minimum(w, 1.0)).sum(axis=-1) - 1.0) > 1e-9).any():
        raise ValueError(f"{name}: expected logarithms of weights with sum 1, got {w}")
    try:
        batch = np.broadcast_shapes(w.shape[:-1], x.shape[:-2], P.shape[:-3])
    except ValueError:
        raise ValueError(f"{name}: expected batch axes that fit, got weights {w.shape}, means {x.shape} and "
                         f"covariances {P.shape}") from None
    return Components(np.broadcast_to(w, (*batch, c)), np.broadcast_to(x, (*batch, c, n)),
                      np.broadcast_to(P, (*batch, c, n, n)))


def moments(m: Mixture) -> Gaussian:
    """mu = sum w_i mu_i,  P = sum w_i (P_i + (mu_i - mu)(mu_i - mu)').

    -> mean (..., n), cov (..., n, n): the mean square estimate and its error covariance.  MAT (3.18), exercise 3.11.

    >>> moments(mixture([0.5, 0.5], [[-3.0], [3.0]], np.ones((2, 1, 1)))).cov.tolist()
    [[10.0]]
    """
    m = checked("m", m)
    return combine(m.weights, m.means, m.covs)


def combine(w: Array, means: Array, covs: Array) -> Law:
    """`moments` of checked parts: w (..., c), means (..., c, n), covs (..., c, n, n)."""
    x = np.einsum("...c,...ci->...i", w, means)
    d = means - x[..., None, :]
    spread = times(np.moveaxis(w[..., None] * d, -1, -2), d)
    return Law(x, symmetric(np.einsum("...c,...cij->...ij", w, covs) + spread))


def log_density(m: Mixture, x: Array) -> Array:
    """log sum_i w_i N(x; mu_i, P_i).

    m with positive definite covariances, x (..., n), broadcast over m's batch axes -> (...).  Exercise 3.11 (b).

    >>> two = mixture([0.5, 0.5], [[-3.0], [3.0]], np.ones((2, 1, 1)))
    >>> float(np.exp(log_density(two, [0.0])).round(6))
    0.004432
    """
    m = checked("m", m)
    x = checks.finite("x", x, m.means.shape[-1])
    return log_sum(_joint(m, x))


def responsibilities(m: Mixture, x: Array) -> Array:
    """r_i = w_i N(x; mu_i, P_i) / p(x): the probability that x belongs to component i, shape (..., c)."""
    m = checked("m", m)
    joint = _joint(m, checks.finite("x", x, m.means.shape[-1]))
    return np.exp(joint - log_sum(joint)[..., None])


def heaviest(m: Mixture) -> Gaussian:
    """(mu_i, P_i) of i = argmax w_i: the most probable component, mean (..., n) and cov (..., n, n)."""
    m = checked("m", m)
    i = m.log_weights.argmax(axis=-1)[..., None, None]
    return Law(np.take_along_axis(m.means, i, axis=-2)[..., 0, :],
               np.take_along_axis(m.covs, i[..., None], axis=-3)[..., 0, :, :])


def peaks(m: Mixture, *, tolerance: float = 1e-10, max_iterations: int = 2000) -> Array:
    """x = (sum r_i P_i^-1)^-1 sum r_i P_i^-1 mu_i,  r_i = w_i N(x; mu_i, P_i) / p(x): where the density is stationary.

    -> (..., c, n): the point to which this iteration climbs from each mean (the density grows in every step), until a
    step is shorter than `tolerance` standard deviations of the narrowest component.  Several means may share a peak.
    A component of weight 0 starts at its mean like the others.  Carreira-Perpinan 2000; MAT (3.20).
    """
    m = checked("m", m)
    n = m.means.shape[-1]
    try:
        W = np.linalg.solve(m.covs, np.broadcast_to(np.eye(n), m.covs.shape))             # precisions
    except np.linalg.LinAlgError:
        raise ValueError("m: expected positive definite covariances for a density, got a singular one") from None
    Wm = np.matvec(W, m.means)
    whole = Components(m.log_weights[..., None, :], m.means[..., None, :, :], m.covs[..., None, :, :, :])
    x = m.means
    for _ in range(max_iterations):
        r = responsibilities(whole, x)                    # (..., start, component)
        A = np.einsum("...sc,...cij->...sij", r, W)
        step = np.linalg.solve(A, np.einsum("...sc,...ci->...si", r, Wm)[..., None])[..., 0] - x
        x = x + step
        if (np.einsum("...si,...sij,...sj->...s", step, A, step) < tolerance**2).all():
            break
    return x


def mode(m: Mixture) -> Array:
    """argmax_x p(x), shape (..., n): the highest of the `peaks`, the maximum a posteriori estimate.  MAT (3.20).

    >>> two = mixture([0.6, 0.4], [[0.0], [5.0]], [[[1.0]], [[0.25]]])          # the lighter one is sharper
    >>> mode(two).round(4)
    array([5.])
    """
    m = checked("m", m)
    x = peaks(m)
    whole = Components(m.log_weights[..., None, :], m.means[..., None, :, :], m.covs[..., None, :, :, :])
    best = log_density(whole, x).argmax(axis=-1)
    return np.take_along_axis(x, best[..., None, None], axis=-2)[..., 0, :]


def log_evidence(nu: Array, S: Array) -> Array:
    """log N(nu; 0, S) = -(m log 2 pi + log det S + nu' S^-1 nu) / 2.

    nu (..., m), S (..., m, m) positive definite -> (...).  Entries NaN (not measured) are left out, and m counts the
    others.

    >>> float(log_evidence(np.array([3.0, np.nan]), np.eye(2)).round(6))
    -5.418939
    """
    missing = np.isnan(nu)
    if missing.any():
        apart = missing[..., :, None] | missing[..., None, :]
        S, nu = np.where(apart, np.eye(nu.shape[-1]), S), np.where(missing, 0.0, nu)
    L = cholesky(S)
    if L is None:
        raise ValueError("S: expected a positive definite innovation covariance, got a singular one")
    log_det = 2.0 * np.log(np.diagonal(L, axis1=-2, axis2=-1)).sum(axis=-1)
    squares = (nu * solve_spd(S, nu[..., None])[..., 0]).sum(axis=-1)
    return -0.5 * ((~missing).sum(axis=-1) * _LOG_2PI + log_det + squares)


def log_sum(a: Array, axis: int = -1) -> Array:
    """log sum exp(a) along an axis, -inf for nothing but -inf; no underflow."""
    top = a.max(axis=axis, keepdims=True)
    top = np.where(top > -np.inf, top, 0.0)
    with np.errstate(divide="ignore"):
        return (np.log(np.exp(a - top).sum(axis=axis, keepdims=True)) + top).squeeze(axis)


def pack(log_weights: Array, means: Array, covs: Array) -> tuple[Components, Array]:
    """The components with a weight first, in their order, and no more places than needed; the new places (..., c)."""
    dead = log_weights == -np.inf
    order = np.argsort(dead, axis=-1, kind="stable")
    place = np.argsort(order, axis=-1, kind="stable")
    count = int((~dead).sum(axis=-1).max(initial=1))
    order = order[..., :count]
    return Components(np.take_along_axis(log_weights, order, axis=-1),
                      np.take_along_axis(means, order[..., None], axis=-2),
                      np.take_along_axis(covs, order[..., None, None], axis=-3)), place


def _joint(m: Components, x: Array) -> Array:
    """log w_i + log N(x; mu_i, P_i), shape (..., c)."""
    if m.means.ndim > 2:
        return m.log_weights + gaussian.log_density(Gaussian(m.means, m.covs), x[..., None, :])
    parts = [w + gaussian.log_density(Gaussian(mean, cov), x) for w, mean, cov in zip(*m, strict=True)]
    return np.stack(parts, axis=-1)                       # one factorisation for each component, however many x
