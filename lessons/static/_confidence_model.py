"""P(sum_i a_i^2 (z_i - q_i)^2 < r^2): what a set really holds, for errors z of several laws.  MAT 2.6.

z has mean 0 and covariance I.  On the line it has one of the laws of `core.confidence`; in the plane its two
components, along the axes of the error ellipse, are independent and have that law.  The extremal law is different:
z = sqrt(n) s u with s extremal and u of any direction, so that it attains the bound (2.9) in n dimensions.
"""

from typing import NamedTuple

import numpy as np

from core import confidence
from core.confidence import Law
from core.types import Array

SLICES = 120                 # of a set in the plane, across the first component
SHELL = 720                  # points of the extremal law's ellipse
STRICT = 1.0 - 1e-9          # a point on the edge of a set is not in it, whatever the rounding


class ErrorLaw(NamedTuple):
    """The law of z (n,).  law: of one component; None for the extremal one, which sits at `points` with `masses`."""

    n: int
    law: Law | None
    lam: float
    points: Array            # (k, n); (0, n) for a continuous law
    masses: Array            # (k,)


def error_law(name: str, n: int, lam: float, nu: float) -> ErrorLaw:
    """One of the laws by its name: normal, laplace, uniform, student (nu), extremal (lam)."""
    if name != "extremal":
        law = confidence.student(nu) if name == "student" else confidence.LAWS[name]()
        return ErrorLaw(n, law, lam, np.zeros((0, n)), np.zeros(0))
    points, masses = confidence.extremal_masses(lam)
    if n == 1:
        return ErrorLaw(1, None, lam, points[:, None], masses)
    t = 2.0 * np.pi * np.arange(SHELL) / SHELL
    shell = np.sqrt(2.0) * lam * np.column_stack([np.cos(t), np.sin(t)])
    return ErrorLaw(2, None, lam, np.vstack([np.zeros(2), shell]),
                    np.append(masses[1], np.full(SHELL, (masses[0] + masses[2]) / SHELL)))


def draw(e: ErrorLaw, count: int, rng: np.random.Generator) -> Array:
    """Errors z (count, n)."""
    if e.law is not None:
        return e.law.sample(rng, (count, e.n))
    s = confidence.extremal(e.lam).sample(rng, count)
    if e.n == 1:
        return s[:, None]
    t = rng.uniform(0.0, np.pi, count)
    return np.sqrt(2.0) * s[:, None] * np.column_stack([np.cos(t), np.sin(t)])


def inside(e: ErrorLaw, a: Array, q: Array, r: Array) -> Array:
    """P(sum a_i^2 (z_i - q_i)^2 < r^2) for radii r (...) -> (...).  a (n,) > 0: ones for the Mahalanobis distance."""
    r = np.asarray(r, dtype=np.float64)
    if e.law is None:
        far = np.sqrt(np.square(a * (e.points - q)).sum(axis=1))
        return np.minimum((far < STRICT * r[..., None]) @ e.masses, 1.0)
    if e.n == 1:
        return _between(e.law, q[0] - r / a[0], q[0] + r / a[0])
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * SLICES + 1)
    edges, middles = angles[::2], angles[1::2]            # the slices get thin where the set ends
    slices = np.diff(_below(e.law, q[0] + r[..., None] / a[0] * np.sin(edges)), axis=-1)
    half = r[..., None] / a[1] * np.cos(middles)
    return (slices * _between(e.law, q[1] - half, q[1] + half)).sum(axis=-1)


def exact_radius(e: ErrorLaw, q: Array, probability: Array) -> Array:
    """The least Mahalanobis radius about q that holds `probability` (...) of this law: an exact confidence set."""
    p, one = np.asarray(probability, dtype=np.float64), np.ones(e.n)
    if e.law is None:
        far = np.sqrt(np.square(e.points - q).sum(axis=1))
        order = np.argsort(far)
        index = np.searchsorted(np.cumsum(e.masses[order]), p - 1e-9)
        return far[order][np.minimum(index, len(far) - 1)]
    low = np.zeros(p.shape)
    high = np.sqrt(e.n / (1.0 - p)) + np.linalg.norm(q)   # Chebyshev's radius round the mean is always enough
    for _ in range(28):
        middle = 0.5 * (low + high)
        enough = inside(e, one, q, middle) >= p
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return high


def density(law: Law, z: Array) -> Array:
    """f(z) of one component, from differences of its tail on the rising grid z."""
    return np.gradient(_below(law, z), z)


def _between(law: Law, low: Array, high: Array) -> Array:
    return _below(law, high) - _below(law, low)


def _below(law: Law, z: Array) -> Array:
    """P(one component <= z), by symmetry from P(|.| >= |z|)."""
    tail = 0.5 * law.tail(np.abs(z))
    return np.where(z >= 0.0, 1.0 - tail, tail)
