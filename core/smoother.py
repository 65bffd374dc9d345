"""The Rauch-Tung-Striebel smoother: what all measurements say about every step."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core.kalman import Update
from core.recursion import check_sizes, each
from core.stacks import Law, apply, congruence, law, shared, solve_spd, symmetric, times
from core.types import Array, Gaussian, Motion


class Smoothed(NamedTuple):
    """posterior: the law of x_k given all measurements, mean (T, ..., n), cov (T, ..., n, n); gain (T - 1, ..., n, n).

    With an initial law both begin one step earlier.
    """

    posterior: Gaussian
    gain: Array


def smooth(steps: Update, motion: Motion | Sequence[Motion], initial: Gaussian | None = None) -> Smoothed:
    """x_k^s = x_k + G_k (x_{k+1}^s - x_{k+1}^-),  G_k = P_k F' (P_{k+1}^-)^-1,  F = f'(x_k).

    P_k^s = (I - G F) P_k (I - G F)' + G (Q + P_{k+1}^s) G', which is P_k + G (P_{k+1}^s - P_{k+1}^-) G' as a sum of
    squares.  steps: the record of `core.kalman.run` or `core.extended.run`, arrays (T, ..., .); motion as it was given
    there.  initial: the law from which that run started, to be smoothed as well.  ValueError if a predicted covariance
    is singular.  Rauch, Tung and Striebel 1965.
    """
    means, covs = steps.posterior
    T, n = means.shape[0], means.shape[-1]
    motions = each("motion", motion, T, "f")
    check_sizes(n, motions[0], 0, None)
    laws = [Law(means[k], covs[k]) for k in range(T)]
    if initial is None:
        motions, predicted = motions[1:], [Law(steps.prior.mean[k], steps.prior.cov[k]) for k in range(1, T)]
    else:
        start = law("initial", initial)
        start = Law(np.broadcast_to(start.mean, means.shape[1:]), np.broadcast_to(start.cov, covs.shape[1:]))
        laws.insert(0, start)
        predicted = [Law(steps.prior.mean[k], steps.prior.cov[k]) for k in range(T)]
    x, P = laws[-1]
    smoothed, gains = [laws[-1]], []
    for (x_k, P_k), (x_prior, P_prior), model in zip(laws[-2::-1], predicted[::-1], motions[::-1], strict=True):
        F = shared(model.jacobian(x_k))
        FP = times(F, P_k)
        try:
            G = solve_spd(P_prior, FP).mT
        except ValueError:
            raise ValueError("steps: expected positive definite predicted covariances, got a singular one; give "
                             "every state some variance") from None
        x = x_k + apply(G, x - x_prior)
        rest = P_k - times(G, FP)                         # (I - G F) P_k
        P = symmetric(rest - times(times(rest, F.mT), G.mT) + congruence(G, model.Q + P))
        smoothed.append(Gaussian(x, P))
        gains.append(G)
    smoothed.reverse()
    gains.reverse()
    posterior = Gaussian(np.stack([g.mean for g in smoothed]), np.stack([g.cov for g in smoothed]))
    return Smoothed(posterior, np.stack(gains) if gains else np.empty((0, *covs.shape[1:])))
