"""Monte Carlo integration and importance sampling, each with the variance of its answer.  MAT 3.5.1."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.types import Array


class Estimate(NamedTuple):
    """mean (...) and the estimated variance of that mean (...), from n samples with the terms `values` (..., n)."""

    mean: Array
    variance: Array
    values: Array
    n: int


class Weighted(NamedTuple):
    """mean (...), variance of that mean (...), normalised weights (n,), n_eff = 1 / sum w^2.

    log_mean_weight = log (1/n) sum w estimates the logarithm of the normalising constant (the evidence).
    """

    mean: Array
    variance: Array
    weights: Array
    n_eff: float
    log_mean_weight: float


class Truncated(NamedTuple):
    """Law of a standard normal component given that it lies in an interval: mean, variance, and P of the interval."""

    mean: Array
    variance: Array
    probability: Array


def monte_carlo(values: ArrayLike) -> Estimate:
    """h_bar = 1/n sum h(z_i),  V(h_bar) = 1/n^2 sum (h(z_i) - h_bar)^2.

    values (..., n): h at n independent samples of f, *all* of them, zeros too: leaving out the samples where h = 0 is
    how the notes' Example 21 got a variance 2.04 times too small (erratum M20).  ValueError for fewer than 2 samples or
    non-finite values.  MAT (3.22)-(3.23), p. 50.

    >>> monte_carlo([1.0, 3.0, 2.0, 2.0])[:2]
    (np.float64(2.0), np.float64(0.125))
    """
    h = finite("values", values, None)
    n = h.shape[-1]
    if n < 2:
        raise ValueError(f"values: expected at least 2 samples on the last axis, got shape {h.shape}")
    mean = h.mean(axis=-1)                                                            # (3.22)
    return Estimate(mean, np.square(h - mean[..., None]).sum(axis=-1) / n**2, h, n)   # (3.23)


def integrate(g: Callable[[Array], Array], density: Callable[[Array], Array], z: ArrayLike) -> Estimate:
    """I = int g(z) dz = int h(z) f(z) dz,  h = g / f,  from samples z_i of f.

    g and density take z (n,) or (n, d) and return (n,), or (..., n) for several integrands; the density f must be
    positive at its own samples, and wherever g is not zero (which no sample can show).  Where g / f has no second
    moment the variance is meaningless: choose an f with wider tails than g.  ValueError for a density that is not
    positive.  MAT (3.21)-(3.23), p. 50.

    >>> float(integrate(lambda z: 2 * z, lambda z: np.ones_like(z), np.array([0.25, 0.75])).mean)
    1.0
    """
    z = finite("z", z)
    f = finite("density(z)", density(z), None)
    if not f.min(initial=np.inf) > 0.0:
        raise ValueError(f"density: expected positive values at its own samples, got {f.min()}")
    return monte_carlo(np.asarray(g(z)) / f)                                          # (3.21)


def running(values: ArrayLike) -> Estimate:
    """h_bar_k and V(h_bar_k) for k = 1..n: the convergence plot, error O(k^(-1/2)).

    values (..., n) -> mean, variance (..., n); the variance of the first is 0.  MAT Theorem 7, Fig 3.2.

    >>> running([1.0, 3.0, 2.0]).mean.tolist()
    [1.0, 2.0, 2.0]
    """
    h = finite("values", values, None)
    if not h.shape[-1]:
        raise ValueError("values: expected at least one sample, got none")
    k = np.arange(1, h.shape[-1] + 1)
    d = h - h[..., :1]                                    # moments about one sample: a large mean does not cancel
    first = np.cumsum(d, axis=-1) / k
    spread = np.maximum(np.cumsum(d * d, axis=-1) / k - first * first, 0.0)
    return Estimate(h[..., :1] + first, spread / k, h, h.shape[-1])


def importance_weights(
    weights: ArrayLike, log_likelihood: ArrayLike, log_transition: ArrayLike = 0.0, log_proposal: ArrayLike = 0.0
) -> Array:
    """w_k ~ w_{k-1} p(y | x_k) p(x_k | x_{k-1}) / g(x_k | x_{k-1}, y),  sum w_k = 1.

    weights (..., N) >= 0; the logarithms (..., N) at the drawn x_k; -inf means a factor 0 -> (..., N).  No underflow.
    ValueError for NaN, a negative weight, a proposal density 0, or when every weight becomes 0.
    MAT Algorithm 5, steps 2-3, p. 51.

    >>> importance_weights([0.5, 0.5], [-1e5, -1e5 - np.log(3)]).round(12).tolist()
    [0.75, 0.25]
    """
    w = finite("weights", weights, None)
    if w.min(initial=0.0) < 0.0:
        raise ValueError(f"weights: expected numbers >= 0, got {w.min()}")
    with np.errstate(divide="ignore", invalid="ignore"):
        log_w = np.log(w) + log_likelihood + log_transition - np.asarray(log_proposal)
    return _normalised(log_w)


def self_normalised(values: ArrayLike, log_w: ArrayLike) -> Weighted:
    """E(h) = sum w_i h(z_i) / sum w_i,  V = sum w_i^2 (h(z_i) - E)^2 / (sum w_i)^2.

    For a density known only up to a factor, such as a posterior: z_i ~ f, log w = log(p/f) + any constant; -inf
    leaves a sample out (rejection sampling: 0 or -inf).  values (..., n), log_w (n,).  The variance is the
    linearised one; the bias is of order 1/n.  ValueError for NaN or when every weight is 0.  MAT exercise 3.13.

    >>> float(self_normalised([1.0, 2.0, 9.0], [0.0, 0.0, -np.inf]).mean)
    1.5
    """
    h = finite("values", values, None)
    log_w = np.asarray(log_w, dtype=np.float64)
    if log_w.shape != h.shape[-1:]:
        raise ValueError(f"log_w: expected shape {h.shape[-1:]}, got {log_w.shape}")
    w = _normalised(log_w)
    mean = np.vecdot(h, w)
    variance = np.vecdot(np.square(h - mean[..., None]), np.square(w))
    top = log_w.max()
    log_mean = float(top + np.log(np.exp(log_w - top).mean()))
    return Weighted(mean, variance, w, float(1.0 / np.square(w).sum()), log_mean)


def truncated_normal(low: ArrayLike, high: ArrayLike) -> Truncated:
    """E(z | a < z < b) = (phi(a) - phi(b)) / (Phi(b) - Phi(a))  for z ~ N(0, 1).

    low < high, broadcast, infinite ends allowed -> mean, variance and probability (...).  A box has independent
    components.  ValueError for NaN or low >= high.  MAT exercise 3.13.

    >>> float(truncated_normal(0.0, 2.0).mean.round(6))
    0.72279
    """
    from scipy.special import ndtr

    a, b = np.broadcast_arrays(np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))
    if not (a < b).all():
        raise ValueError(f"low, high: expected low < high, got {low} and {high}")
    mirror = a > 0.0                                      # in the upper tail Phi(b) - Phi(a) would cancel
    a, b = np.where(mirror, -b, a), np.where(mirror, -a, b)
    P = ndtr(b) - ndtr(a)
    if not (P > 0.0).all():
        raise ValueError(f"low, high: expected an interval with positive probability, got {low} and {high}")
    phi_a, phi_b = (np.exp(-0.5 * t * t) / np.sqrt(2.0 * np.pi) for t in (a, b))
    mean = (phi_a - phi_b) / P
    edge = (np.where(np.isinf(a), 0.0, a) * phi_a - np.where(np.isinf(b), 0.0, b) * phi_b) / P
    return Truncated(np.where(mirror, -mean, mean), 1.0 + edge - mean * mean, P)


def _normalised(log_w: Array) -> Array:
    top = log_w.max(axis=-1, keepdims=True, initial=-np.inf)
    if np.isnan(top).any() or (top == np.inf).any():
        raise ValueError(f"log weights: expected numbers or -inf, got {top[~(top < np.inf)].flat[0]}")
    if (top == -np.inf).any():
        raise ValueError("weights: expected at least one positive weight, got none")
    w = np.exp(log_w - top)
    return w / w.sum(axis=-1, keepdims=True)
