"""Splitting a wide component, so that a linearisation at each part sees only a small piece of a curved function."""

from typing import NamedTuple

import numpy as np

from core.mixture_law import Mixture, checked, pack
from core.stacks import symmetric
from core.types import Array


class Division(NamedTuple):
    """before (c components) -> after (c' components); parent (..., c'): the number of the component it came from."""

    before: Mixture
    after: Mixture
    parent: Array


def longest_axis(m: Mixture, entries: tuple[int, ...] | None = None) -> Array:
    """sqrt(lambda_max(P_i)), shape (..., c): the longest 1-sigma semi-axis, in the units of the chosen state entries.
    """
    m = checked("m", m)
    return np.sqrt(np.maximum(_longest(m.covs, entries)[0], 0.0))


def split(
    m: Mixture,
    wide: Array | None = None,
    *,
    parts: int = 3,
    ratio: float | None = None,
    entries: tuple[int, ...] | None = None,
) -> Division:
    """N(t; t0, s^2) = sum_k v_k N(t; t0 + sqrt(1 - ratio^2) s z_k, (ratio s)^2),  t = q'x along the longest axis q.

    The marked components, wide (c,) or (..., c), None: all, are each replaced by `parts` of `ratio` times the length;
    z_k and v_k are the nodes and weights of the Gauss-Hermite rule, so that all moments up to degree 2 parts - 1 stay
    as they are.  ratio None: neighbours in the middle are two of their own deviations apart (0.65 for 3 parts, 0.56
    for 5); with a smaller ratio the density gets bumps.  The longest axis is that of P_i, or of its block for the
    chosen `entries` of the state (positions, so that metres are not compared with metres per second); the other
    entries move along as their correlation says.

    >>> from core.mixture_law import mixture, moments
    >>> halves = split(mixture([1.0], [[0.0]], [[[16.0]]]), parts=2, ratio=0.5).after
    >>> halves.means.ravel().round(4), moments(halves).cov.round(9)
    (array([-3.4641,  3.4641]), array([[16.]]))
    """
    m = checked("m", m)
    check_parts(parts, ratio)
    c, n = m.means.shape[-2:]
    wide = m.alive & np.broadcast_to(True if wide is None else np.asarray(wide, dtype=bool), m.log_weights.shape)
    s2, q, chosen = _longest(m.covs, entries)
    wide = wide & (s2 > 0)
    safe = np.where(s2 > 0, s2, 1.0)
    g = np.einsum("...ij,...j->...i", m.covs[..., chosen], q) / safe[..., None]          # dx / dt
    z, v = _hermite(parts)
    if ratio is None:
        gap = np.diff(z).min()
        ratio = gap / np.sqrt(4 + gap**2)
    s = np.sqrt(safe)
    shift = (np.sqrt(1 - ratio**2) * s)[..., None, None] * z[:, None] * g[..., None, :]
    narrow = symmetric(m.covs - ((1 - ratio**2) * safe)[..., None, None] * g[..., :, None] * g[..., None, :])
    # A component that stays is the first of its parts; its others have weight 0.
    first = np.where(np.arange(parts) == 0, 0.0, -np.inf)
    log_v = np.where(wide[..., None], np.log(v), first)
    means = m.means[..., None, :] + np.where(wide[..., None, None], shift, 0.0)
    covs = np.where(wide[..., None, None], narrow, m.covs)
    batch = m.log_weights.shape[:-1]
    after, place = pack((m.log_weights[..., None] + log_v).reshape(*batch, c * parts),
                         means.reshape(*batch, c * parts, n), np.repeat(covs, parts, axis=-3))
    origin = np.broadcast_to(np.repeat(np.arange(c), parts), place.shape)
    parent = np.empty(place.shape, dtype=int)
    np.put_along_axis(parent, place, origin, axis=-1)
    return Division(m, after, parent[..., :after.means.shape[-2]])


def _longest(P: Array, entries: tuple[int, ...] | None) -> tuple[Array, Array, list[int]]:
    """Largest eigenvalue (...) and its eigenvector (..., k) of the block of P for the k entries."""
    n = P.shape[-1]
    chosen = list(range(n)) if entries is None else [int(e) for e in entries]
    if not chosen or len(set(chosen)) != len(chosen) or min(chosen) < 0 or max(chosen) >= n:
        raise ValueError(f"entries: expected different indices from 0 to {n - 1}, got {list(chosen)}")
    values, Q = np.linalg.eigh(P[..., chosen, :][..., chosen])
    q = Q[..., -1]
    largest = np.take_along_axis(q, np.abs(q).argmax(axis=-1)[..., None], axis=-1)       # one sign for each axis
    return values[..., -1], q * np.sign(largest), chosen


def _hermite(k: int) -> tuple[Array, Array]:
    """Nodes and weights of the k-point rule that is exact for N(0, 1) up to degree 2k - 1 (Golub and Welsch 1969)."""
    off = np.sqrt(np.arange(1.0, k))
    z, V = np.linalg.eigh(np.diag(off, 1) + np.diag(off, -1))
    z, v = (z - z[::-1]) / 2, V[0] ** 2
    return z, (v + v[::-1]) / 2


def check_parts(parts: int, ratio: float | None) -> None:
    """ValueError unless parts is a whole number >= 2 and ratio None or within (0, 1)."""
    if parts != int(parts) or parts < 2 or (ratio is not None and not 0.0 < ratio < 1.0):
        raise ValueError(f"expected at least 2 parts and a ratio in (0, 1), got {parts} and {ratio}")
