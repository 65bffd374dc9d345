"""Least squares with inequalities: a position known to lie in a sector, a room, a half-plane.  MAT 2.3.2 note 3."""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.gauss_newton_steps import whiten
from core.linalg import cholesky_positive
from core.orthogonal import back_substitute, factorise, inverse_gram
from core.types import Array, Sensor

_ROOM = 1e-9                                              # by which a constraint may be missed, relative


class Constrained(NamedTuple):
    """One run, or many (...).

    x (..., n), feasible unless no step was possible.  active (..., k): the constraints that hold x back.  multipliers
    (..., k) >= 0: half the cost falls by this much when the bound is moved outwards by one unit.  cost (...):
    p'R^-1 p.  iterates (j + 1, ..., n) with the start first; a run that has ended stays where it is.  converged (...).
    """

    x: Array
    active: Array
    multipliers: Array
    cost: Array
    iterates: Array
    converged: Array


def sector(apex_m: ArrayLike, direction_rad: float, width_rad: float) -> tuple[Array, Array]:
    """G (2, 2) and g (2,) such that G x <= g is the sector: everything within width / 2 of the direction.

    apex_m (2,), east and north; direction_rad clockwise from north; width_rad the full opening, 0 < width <= pi (a
    wider one is not convex).  First the clockwise edge.  The rows of G are unit vectors, so G x - g is a distance.

    >>> G, g = sector([0.0, 0.0], 0.0, np.pi / 2)
    >>> (G @ [1.0, 1.0] - g).round(12).tolist(), bool((G @ [0.2, 1.0] < g).all())
    ([0.0, -1.414213562373], True)
    """
    apex = finite("apex_m", apex_m, 2)
    if not 0.0 < width_rad <= np.pi or not np.isfinite(direction_rad):
        raise ValueError(f"expected a direction and a width in (0, pi], got {direction_rad} and {width_rad}")
    right, left = direction_rad + 0.5 * width_rad, direction_rad - 0.5 * width_rad
    G = np.array([[np.cos(right), -np.sin(right)], [-np.cos(left), np.sin(left)]])
    return G, G @ apex


def constrained_least_squares(
    sensor: Sensor, y: ArrayLike, x0: ArrayLike, G: ArrayLike, g: ArrayLike, *, tolerance: float = 1e-3,
    max_iterations: int = 50,
) -> Constrained:
    """argmin (h(x) - y)' R^-1 (h(x) - y)  subject to  G x <= g.

    Gauss-Newton: x_{j+1} minimises the cost with h linearised at x_j among the feasible points (exactly: the best of
    the minima over all sets of at most n active constraints), with the step halved while the true cost rises.
    y (..., m), x0 (..., n) broadcast; G (k, n), g (k,) with rows of G not zero.  At a solution J'R^-1 p + G'lambda = 0.
    ValueError where no point is feasible, for a Jacobian with dependent columns, fewer measurements than unknowns, or
    a wrong shape.  MAT 2.3.2 note 3; Nocedal and Wright, Numerical Optimization, 12.3 and 16.1.

    >>> from core.sensors import Position
    >>> fix = constrained_least_squares(Position(2, 2.0), [3.0, 1.0], [0.0, 0.0], [[1.0, 0.0]], [2.0])
    >>> fix.x.tolist(), fix.multipliers.tolist()
    ([2.0, 1.0], [0.25])
    """
    y, x, G, g = finite("y", y, len(sensor.R)), finite("x0", x0, None), finite("G", G, None, None), finite("g", g, None)
    n, L = x.shape[-1], cholesky_positive("R", sensor.R)
    if G.ndim != 2 or G.shape[1] != n or g.shape != G.shape[:1] or not np.any(G, axis=1).all():
        raise ValueError(f"G, g: expected rows (k, {n}) that are not zero and bounds (k,), got {G.shape} and {g.shape}")
    if y.shape[-1] < n or not tolerance > 0.0 or max_iterations < 1:
        raise ValueError(f"expected m >= n = {n}, tolerance > 0 and max_iterations >= 1, got m = {y.shape[-1]}, "
                         f"{tolerance} and {max_iterations}")
    batch = np.broadcast_shapes(y.shape[:-1], x.shape[:-1])
    y, x = np.broadcast_to(y, (*batch, y.shape[-1])), np.broadcast_to(x, (*batch, n)).copy()

    def residuals(at: Array) -> Array:
        return whiten(L, -sensor.innovation(y, sensor.h(at)), False)

    iterates, converged = [x], np.zeros(batch, dtype=bool)
    while True:
        p = residuals(x)
        cost = np.square(p).sum(axis=-1)
        best, multipliers = _step(whiten(L, sensor.jacobian(x), True), p, x, G, g)
        if converged.all() or len(iterates) > max_iterations:
            return Constrained(x, multipliers > 0.0, multipliers, cost, np.stack(iterates), converged)
        dx, share = best - x, np.ones(batch)
        feasible = _feasible(x, G, g)
        for _ in range(10):
            worse = feasible & (np.square(residuals(x + share[..., None] * dx)).sum(axis=-1) > cost * (1.0 + 1e-12))
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        moved = np.where(converged[..., None], 0.0, share[..., None] * dx)
        x = x + moved
        iterates.append(x)
        converged = converged | (np.sqrt(np.square(dx).sum(axis=-1)) < tolerance)


def _step(J: Array, p: Array, x: Array, G: Array, g: Array) -> tuple[Array, Array]:
    """argmin |J (z - x) + p|^2 subject to G z <= g, and the multipliers of half of it: (..., n), (..., k)."""
    factors = factorise(J, -p)
    if factors.singular.any():
        raise ValueError("x0: expected points where the measurements determine every component of the state, got a "
                         "Jacobian with dependent columns")
    free, C = x + back_substitute(factors), inverse_gram(factors)                # the minimum without constraints
    best, least = np.full_like(free, np.nan), np.full(free.shape[:-1], np.inf)
    multipliers = np.zeros((*free.shape[:-1], len(g)))
    for rows in _active_sets(G):
        A = G[rows]
        lam = np.linalg.solve(A @ C @ A.T, (free @ A.T - g[rows])[..., None])[..., 0] if rows else free[..., :0]
        back = (C @ A.T @ lam[..., None])[..., 0]
        z, rise = free - back, np.square((J @ back[..., None])[..., 0]).sum(axis=-1)
        better = _feasible(z, G, g) & (rise < least)
        best, least = np.where(better[..., None], z, best), np.where(better, rise, least)
        full = np.zeros_like(multipliers)
        full[..., rows] = np.maximum(lam, 0.0)
        multipliers = np.where(better[..., None], full, multipliers)
    if np.isinf(least).any():
        raise ValueError("G, g: expected inequalities that some point fulfils, got none that does")
    return best, multipliers


def _active_sets(G: Array) -> Iterator[list[int]]:
    """All sets of at most n independent rows."""
    for size in range(min(G.shape) + 1):
        for rows in combinations(range(len(G)), size):
            if size == 0 or np.linalg.matrix_rank(G[list(rows)]) == size:
                yield list(rows)


def _feasible(x: Array, G: Array, g: Array) -> Array:
    return (x @ G.T - g <= _ROOM * (1.0 + np.abs(g) + np.abs(x) @ np.abs(G.T))).all(axis=-1)
