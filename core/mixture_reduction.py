"""Keeping a mixture small: prune and merge.

Both return the mixture before and after, and which component went where.  In a batch the numbers of components that
are left may differ: the arrays are as long as the longest, and the places left over have weight 0.
"""

from typing import NamedTuple

import numpy as np

from core.mixture_law import Components, Mixture, checked, log_sum, pack
from core.stacks import batch_last, cholesky, symmetric
from core.types import Array


class Reduction(NamedTuple):
    """before (c components) -> after (c' components).

    owner (..., c): the number of the component of `after` that holds each one of `before`, -1 if it was dropped or
    its weight was 0.  lost (...): what it cost; the weight that was dropped, or nats of the merges.
    """

    before: Mixture
    after: Mixture
    owner: Array
    lost: Array


def prune(m: Mixture, below: float, max_components: int | None = None) -> Reduction:
    """w_i = 0 where w_i < below or more than max_components are heavier;  then sum w_i = 1 again.

    The heaviest component always stays; the order is kept.  `lost` is the weight that was dropped.

    >>> from core.mixture_law import mixture
    >>> prune(mixture([0.001, 0.999], [[0.0], [9.0]], np.ones((2, 1, 1))), 0.01).after.means.tolist()
    [[9.0]]
    """
    m = checked("m", m)
    check_limits("below", below, max_components)
    rank = np.argsort(np.argsort(-m.log_weights, axis=-1, kind="stable"), axis=-1, kind="stable")
    keep = m.alive & ((m.weights >= below) | (rank == 0))
    if max_components is not None:
        keep &= rank < max_components
    log_weights = np.where(keep, m.log_weights, -np.inf)
    left = log_sum(log_weights)
    after, place = pack(log_weights - left[..., None], m.means, m.covs)
    owner = np.where(keep, place, -1)
    return Reduction(m, after, owner, -np.expm1(np.minimum(left, 0.0)))


def merge(m: Mixture, below: float, max_components: int | None = None) -> Reduction:
    """w = w_i + w_j,  mu = (w_i mu_i + w_j mu_j) / w,  P = sum w_k / w (P_k + (mu_k - mu)(mu_k - mu)').

    The two cheapest become one, as long as that costs less than `below` or there are more than max_components.  The
    mean and covariance of the whole stay as they are.  The distance of two components is
    (w log det P - w_i log det P_i - w_j log det P_j) / 2 >= 0, in nats: no merge loses more information
    (Kullback-Leibler) than this.  `lost` is the sum over the merges.  ValueError for a singular covariance.
    Runnalls 2007.

    >>> from core.mixture_law import mixture
    >>> merge(mixture([0.5, 0.5], [[-1.0], [1.0]], np.ones((2, 1, 1))), 1.0).after.covs.tolist()
    [[[2.0]]]
    """
    m = checked("m", m)
    check_limits("below", below, max_components)
    *batch, c, n = m.means.shape
    most = c if max_components is None else max_components
    if c == 1 or (below == 0.0 and c <= most):
        return Reduction(m, m, np.where(m.alive, np.broadcast_to(np.arange(c), m.alive.shape), -1), np.zeros(batch))
    w, x, P = m.weights.reshape(-1, c), m.means.reshape(-1, c, n).copy(), m.covs.reshape(-1, c, n, n).copy()
    alive = m.alive.reshape(-1, c).copy()
    owner, lost = np.tile(np.arange(c), (len(w), 1)), np.zeros(len(w))
    log_det = _log_det(P)
    cost = np.full((len(w), c, c), np.inf)
    i, j = np.triu_indices(c, 1)
    pairs = _cost(*(a[:, i] for a in (w, x, P, log_det)), *(a[:, j] for a in (w, x, P, log_det)))
    cost[:, i, j] = np.where(alive[:, i] & alive[:, j], pairs, np.inf)
    rows = np.arange(len(w))
    while len(rows):
        nearest = cost[rows].reshape(len(rows), -1).argmin(axis=1)
        i, j = np.divmod(nearest, c)
        price = cost[rows, i, j]
        go = (price < below) | ((alive[rows].sum(axis=1) > most) & (price < np.inf))
        rows, i, j, price = rows[go], i[go], j[go], price[go]
        if not len(rows):
            break
        w[rows, i], x[rows, i], P[rows, i] = _union(w, x, P, rows, i, j)
        log_det[rows, i] = _log_det(P[rows, i])
        w[rows, j], alive[rows, j] = 0.0, False
        lost[rows] += price
        owner[rows] = np.where(owner[rows] == j[:, None], i[:, None], owner[rows])
        cost[rows, j, :] = cost[rows, :, j] = np.inf
        renewed = _cost(*(a[rows, i][:, None] for a in (w, x, P, log_det)), *(a[rows] for a in (w, x, P, log_det)))
        other = np.arange(c) - i[:, None]
        renewed = np.where(alive[rows] & (other != 0), renewed, np.inf)
        cost[rows, i, :] = np.where(other > 0, renewed, np.inf)
        cost[rows, :, i] = np.where(other < 0, renewed, np.inf)
    with np.errstate(divide="ignore"):
        log_weights = np.where(alive, np.log(w), -np.inf)
    after, place = pack(log_weights - log_sum(log_weights)[:, None], x, P)
    owner = np.where(m.alive.reshape(-1, c), np.take_along_axis(place, owner, axis=1), -1)
    after = Components(*(a.reshape(*batch, *a.shape[1:]) for a in after))
    return Reduction(m, after, owner.reshape(*batch, c), lost.reshape(batch))


def _log_det(P: Array) -> Array:
    """log det P, shape (...), for P (..., n, n)."""
    L = cholesky(batch_last(P, 2))
    if L is None:
        raise ValueError("m: expected positive definite covariances to merge, got a singular one")
    return 2.0 * sum(np.log(L[..., k, k]) for k in range(P.shape[-1]))


def _cost(
    w1: Array, x1: Array, P1: Array, log_det1: Array, w2: Array, x2: Array, P2: Array, log_det2: Array
) -> Array:
    """Runnalls' cost of joining two components, shape (...)."""
    w = w1 + w2
    share = np.divide(w2, w, out=np.zeros_like(w), where=w > 0)
    a, b = (1 - share)[..., None, None], share[..., None, None]
    d = x2 - x1
    P = a * P1 + b * P2 + a * b * d[..., :, None] * d[..., None, :]
    return np.maximum(0.5 * (w * _log_det(P) - w1 * log_det1 - w2 * log_det2), 0.0)


def _union(w: Array, x: Array, P: Array, rows: Array, i: Array, j: Array) -> tuple[Array, Array, Array]:
    """Components i and j of each row as one with their moments."""
    total = w[rows, i] + w[rows, j]
    share = np.where(total > 0, w[rows, j] / np.where(total > 0, total, 1.0), 0.5)
    a, b = (1 - share)[:, None], share[:, None]
    d = x[rows, j] - x[rows, i]
    spread = (a * b)[..., None] * d[:, :, None] * d[:, None, :]
    return total, x[rows, i] + b * d, symmetric(a[..., None] * P[rows, i] + b[..., None] * P[rows, j] + spread)


def check_limits(name: str, below: float, max_components: int | None) -> None:
    """ValueError unless the limit is a number >= 0 and max_components None or a whole number >= 1."""
    if not 0.0 <= below < np.inf:
        raise ValueError(f"{name}: expected a number >= 0, got {below}")
    if max_components is not None and (max_components != int(max_components) or max_components < 1):
        raise ValueError(f"max_components: expected a whole number >= 1, got {max_components}")
