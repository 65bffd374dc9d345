"""The loop of Gauss-Newton and Levenberg-Marquardt for a batch of runs, and its single step.  MAT 2.3.

`core.gauss_newton` checks the arguments and fills the records.
"""

import numpy as np

from core.linalg import solve_vectors
from core.orthogonal import back_substitute, factorise
from core.types import Array, Sensor

_RANK = 1e-13                                             # a singular value this small counts as none
_LIMIT = 1e100                                            # an iterate beyond this has diverged


def iterate(
    sensor: Sensor, y: Array, x: Array, L: Array | None, tolerance: float, max_iterations: int,
    damping: float | None, path: list[tuple[Array, int, float]] | None,
) -> tuple[Array, Array, Array, Array]:
    """x (B, n) after the iterations, steps, converged, singular (B,); `path` collects the steps of a single run."""
    x = x.copy()
    steps = np.zeros(len(x), dtype=int)
    converged, singular = np.zeros(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
    mu = None if damping is None else np.full(len(x), damping)
    active = np.arange(len(x))
    for _ in range(max_iterations):
        if not len(active):
            break
        xa, ya = x[active], y[active]
        J = whiten(L, sensor.jacobian(xa), True)
        p = whiten(L, -sensor.innovation(ya, sensor.h(xa)), False)
        dx, ranks = step(J, p, None if mu is None else mu[active])
        bad = (ranks < x.shape[-1]) & (steps[active] == 0)
        sound = ~bad & (np.abs(dx) < _LIMIT).all(axis=-1) & (np.abs(xa) < _LIMIT).all(axis=-1)
        dx = np.where(sound[:, None], dx, 0.0)
        short = (np.sqrt(np.square(dx).sum(axis=-1)) < tolerance) & (ranks == x.shape[-1])
        taken, done = sound, sound & short
        if mu is not None:
            p_new = whiten(L, -sensor.innovation(ya, sensor.h(xa + dx)), False)
            taken = sound & (np.square(p_new).sum(axis=-1) <= np.square(p).sum(axis=-1))
            done &= ~taken | (mu[active] <= 1.0)          # a short step proves little while the damping is strong
        x[active] = np.where(taken[:, None], xa + dx, xa)
        steps[active] += taken
        converged[active] = done
        singular[active] = bad
        if path is not None and taken[0]:
            path.append((x[0].copy(), int(ranks[0]), 0.0 if mu is None else float(mu[0])))
        if mu is not None:
            mu[active] = np.clip(np.where(taken, mu[active] / 10.0, mu[active] * 10.0), 1e-15, 1e15)
        active = active[sound & ~done]
    return x, steps, converged, singular


def step(J: Array, p: Array, mu: Array | None) -> tuple[Array, Array]:
    """argmin |J dx + p|^2 + mu |D dx|^2 with D^2 = diag(J'J), the shortest if there are several; rank: (B, n), (B,)."""
    n = J.shape[-1]
    if mu is not None:
        sizes = np.sqrt(np.square(J).sum(axis=-2))
        sizes = np.where(sizes > 0.0, sizes, 1.0)         # a state that nothing measures stays where it is
        rows = (np.sqrt(mu)[:, None] * sizes)[..., None] * np.eye(n)
        J = np.concatenate([J, rows], axis=-2)
        p = np.concatenate([p, np.zeros((len(p), n))], axis=-1)
    factors = factorise(J, -p)
    dx, ranks = back_substitute(factors), np.full(len(p), n)
    bad = factors.singular
    if bad.any():
        U, s, Vt = np.linalg.svd(J[bad], full_matrices=False)
        keep = s > _RANK * s[:, :1]
        keep[:, -1] = False
        z = np.where(keep, np.vecmat(-p[bad], U) / np.where(keep, s, 1.0), 0.0)
        dx[bad], ranks[bad] = np.vecmat(z, Vt), keep.sum(axis=-1)
    return dx, ranks


def whiten(L: Array | None, a: Array, matrix: bool) -> Array:
    """R^(-1/2) a for a matrix (..., m, n) or a vector (..., m), R = L L'; a itself if not weighted.  Alg 2."""
    if L is None:
        return a
    scale = np.diagonal(L)
    if not np.tril(L, -1).any():
        return a / (scale[:, None] if matrix else scale)
    return np.linalg.solve(L, a) if matrix else solve_vectors(L, a)
