"""Sets that hold the state with a stated probability: exact for a law, or for every law (Chebyshev).  MAT 2.6.

Level sets of normal laws are in `core.levels`; here are intervals for several laws, the bounds that need only the
mean and the covariance (both about the mean: erratum M10), and sets of cells on a grid.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import covariance, finite
from core.grid_density import GridDensity
from core.grid_estimates import quantile
from core.levels import Axes, chebyshev_level, chi_square_level, ellipsoid
from core.linalg import cholesky_positive
from core.types import Array, Gaussian


class Law(NamedTuple):
    """A symmetric law with mean 0 and variance 1.

    tail(lam): P(|z| >= lam).  level(p): the least lam with P(|z| <= lam) >= p.  sample(rng, size).
    """

    tail: Callable[[Array], Array]
    level: Callable[[Array], Array]
    sample: Callable[["np.random.Generator", int | tuple[int, ...]], Array]


class Coverage(NamedTuple):
    """inside (...): which experiments hold the truth; rate, their share; standard_error of the share."""

    inside: Array
    rate: float
    standard_error: float


class HighestDensity(NamedTuple):
    """inside (n_1, ..., n_d): the cells of the set; threshold, the least density in it; its probability and volume."""

    inside: Array
    threshold: float
    probability: float
    volume: float


def normal() -> Law:
    """z ~ N(0, 1): P(|z| >= lam) = erfc(lam / sqrt 2)."""
    from scipy.special import erfc
    return Law(lambda lam: erfc(np.asarray(lam) / np.sqrt(2.0)), lambda p: np.sqrt(chi_square_level(p, 1)),
               lambda rng, size: rng.standard_normal(size))


def laplace() -> Law:
    """f(z) = exp(-sqrt 2 |z|) / sqrt 2: P(|z| >= lam) = exp(-sqrt 2 lam).  MAT exercise 2.15(a) has sd sqrt 2."""
    root = np.sqrt(2.0)
    return Law(lambda lam: np.exp(-root * lam), lambda p: -np.log1p(-p) / root,
               lambda rng, size: rng.laplace(0.0, 1.0 / root, size))


def uniform() -> Law:
    """z ~ U(-sqrt 3, sqrt 3): P(|z| >= lam) = max(0, 1 - lam / sqrt 3)."""
    root = np.sqrt(3.0)
    return Law(lambda lam: np.maximum(0.0, 1.0 - lam / root), lambda p: root * p,
               lambda rng, size: rng.uniform(-root, root, size))


def student(nu: float = 3.0) -> Law:
    """z = t sqrt((nu - 2) / nu),  t Student with nu > 2 degrees of freedom: heavy tails.  ValueError for nu <= 2."""
    if not 2.0 < nu < np.inf:
        raise ValueError(f"nu: expected more than 2 degrees of freedom, so that there is a variance, got {nu}")
    from scipy.special import stdtr, stdtrit
    scale = np.sqrt((nu - 2.0) / nu)
    return Law(lambda lam: 2.0 * stdtr(nu, -np.asarray(lam) / scale), lambda p: scale * stdtrit(nu, 0.5 + 0.5 * p),
               lambda rng, size: scale * rng.standard_t(nu, size))


def extremal(lam: float) -> Law:
    """P(z = -lam) = P(z = lam) = 1 / (2 lam^2), else z = 0: the law for which Chebyshev's bound at lam is attained.

    lam >= 1; lam = 1 is the two-point law with P(|z| >= 1) = 1.  ValueError for lam < 1.  MAT exercise 2.15(b).
    """
    points, masses = extremal_masses(lam)
    outer = masses[0] + masses[2]
    return Law(lambda t: np.where(t <= 0.0, 1.0, np.where(t <= lam, outer, 0.0)),
               lambda p: np.where(p <= 1.0 - outer, 0.0, float(lam)),
               lambda rng, size: rng.choice(points, size=size, p=masses))


def extremal_masses(lam: float) -> tuple[Array, Array]:
    """Points -lam, 0, lam and their probabilities 1 / (2 lam^2), 1 - 1 / lam^2, 1 / (2 lam^2).  MAT exercise 2.15(b).

    >>> extremal_masses(2.0)[1].tolist()
    [0.125, 0.75, 0.125]
    """
    if not 1.0 <= lam < np.inf:
        raise ValueError(f"lam: expected at least 1, got {lam}")
    outer = 0.5 / lam**2
    return np.array([-lam, 0.0, lam]), np.array([outer, 1.0 - 2.0 * outer, outer])


LAWS: dict[str, Callable[[], Law]] = {"normal": normal, "laplace": laplace, "uniform": uniform, "student": student}


def interval(mean: ArrayLike, sd: ArrayLike, probability: ArrayLike, law: Law | None = None) -> Array:
    """mu -+ lam sd with P(|x - mu| <= lam sd) = probability.

    mean, sd, probability broadcast to (...) -> (..., 2); law: normal if not given.  ValueError for sd < 0 or a
    probability outside [0, 1).  MAT 2.6.

    >>> interval(0.0, 1.0, 0.95).round(3).tolist()
    [-1.96, 1.96]
    """
    p = _probability(probability)
    return _around(mean, sd, (law or normal()).level(p))


def chebyshev_interval(mean: ArrayLike, sd: ArrayLike, probability: ArrayLike) -> Array:
    """mu -+ sd / sqrt(1 - probability): holds x with at least this probability, whatever its law.

    As `interval`.  mean must be the law's mean, not any estimate (erratum M10).  MAT (2.8).

    >>> chebyshev_interval(0.0, 1.0, 0.75).tolist()
    [-2.0, 2.0]
    """
    return _around(mean, sd, 1.0 / np.sqrt(1.0 - _probability(probability)))


def chebyshev_tail(lam: ArrayLike) -> Array:
    """P(|x - mu| >= lam sd) <= min(1, 1 / lam^2).

    lam (...) > 0 -> (...).  Also the bound on P(|x - mu| >= lam sqrt(tr P)) and on P(d >= lam sqrt n), d the
    Mahalanobis distance, in n dimensions.  ValueError for lam <= 0.  MAT (2.8), (2.9).

    >>> chebyshev_tail([1.0, 2.0]).tolist()
    [1.0, 0.25]
    """
    lam = finite("lam", lam)
    if np.any(lam <= 0.0):
        raise ValueError(f"lam: expected positive numbers, got {lam.min()}")
    return 1.0 / np.square(np.maximum(lam, 1.0))


def chebyshev_radius(P: ArrayLike, probability: ArrayLike) -> Array:
    """r = sqrt(tr P / (1 - probability)):  P(|x - mu| < r) >= probability for every law with covariance P.

    P (..., n, n), probability (...) -> (...), in the state's unit.  MAT 2.6 (n-dimensional bound).

    >>> float(chebyshev_radius([[16.0, 24.0], [24.0, 52.0]], 0.75).round(3))
    16.492
    """
    return np.sqrt(np.trace(covariance("P", P), axis1=-2, axis2=-1) / (1.0 - _probability(probability)))


def normal_radius_tail(P: ArrayLike, radius: ArrayLike, points: int = 720) -> Array:
    """P(|x| >= r) = 1/2pi int (u'P^-1 u)^-1 det(P)^-1/2 exp(-r^2 u'P^-1 u / 2) dt,  u = (cos t, sin t).

    The exact probability outside a circle for x ~ N(0, P) in the plane, to compare with the bound.  P (2, 2) positive
    definite, radius (...) >= 0 -> (...).  The trapezoidal rule with `points` points converges exponentially.
    ValueError for another dimension or a singular P.  MAT 2.6.

    >>> float(normal_radius_tail(np.eye(2), 2.0).round(9)) == round(float(np.exp(-2.0)), 9)
    True
    """
    P, r = finite("P", P, 2, 2), finite("radius", radius)
    if P.ndim != 2 or np.any(r < 0.0):
        raise ValueError(f"expected one matrix (2, 2) and radii >= 0, got shape {P.shape} and {r}")
    L = cholesky_positive("P", P)
    t = 2.0 * np.pi * np.arange(points) / points
    a = np.square(np.linalg.solve(L, np.stack([np.cos(t), np.sin(t)]))).sum(axis=0)
    weights = 1.0 / (a * np.prod(np.diagonal(L)) * points)
    return np.exp(-0.5 * np.square(r)[..., None] * a) @ weights


def confidence_ellipsoid(g: Gaussian, probability: ArrayLike, *, any_law: bool = False) -> Axes:
    """(x - mu)' P^-1 (x - mu) <= c,  c = chi2_n(probability), or n / (1 - probability) for `any_law`.

    g with mean (..., n), cov (..., n, n) -> center, semi-axes, directions (see `core.levels.ellipsoid`).
    MAT (2.9), 2.6.

    >>> confidence_ellipsoid(Gaussian(np.zeros(2), np.eye(2)), 0.95, any_law=True).semi_axes.round(4).tolist()
    [6.3246, 6.3246]
    """
    n = np.shape(g.mean)[-1]
    return ellipsoid(g, (chebyshev_level if any_law else chi_square_level)(probability, n))


def repeated(low: ArrayLike, high: ArrayLike, truth: ArrayLike) -> Coverage:
    """Share of the repeated experiments whose interval [low, high] holds the truth; its standard error sqrt(r(1-r)/N).

    low, high, truth broadcast to (...).  The frequentist's reading of a confidence interval.  MAT 2.6, footnote p. 34.

    >>> repeated([0.0, 1.0], [2.0, 3.0], 0.5).rate
    0.5
    """
    inside = (finite("low", low) <= finite("truth", truth)) & (truth <= finite("high", high))
    rate = float(inside.mean())
    return Coverage(inside, rate, float(np.sqrt(rate * (1.0 - rate) / inside.size)))


def grid_interval(p: GridDensity, probability: float, component: int = 0) -> Array:
    """[a, b] with P(x_c < a) = P(x_c > b) = (1 - probability) / 2: the interval with equal tails, (2,).

    MAT 2.6: P(a <= x <= b | y) = int_a^b p(x | y) dx.

    >>> grid_interval(GridDensity([0.5, 1.5], [1.0, 1.0]), 0.5).tolist()
    [0.5, 1.5]
    """
    tail = 0.5 * (1.0 - float(_probability(probability)))
    return quantile(p, [tail, 1.0 - tail], component)


def highest_density(p: GridDensity, probability: float) -> HighestDensity:
    """{x: p(x) >= t}, the smallest set of cells with at least this probability.

    Cells of one density come in together.  The set of several peaks has several parts, where an interval with equal
    tails may hold a stretch of density 0.  ValueError for a probability outside [0, 1).  MAT 2.6.

    >>> highest_density(GridDensity([0.0, 1.0, 2.0], [4.0, 1.0, 5.0]), 0.8).inside.tolist()
    [True, False, True]
    """
    wanted = float(_probability(probability))
    w = np.sort(p.weights, axis=None)[::-1]
    total = np.cumsum(w)
    last = w[min(int(np.searchsorted(total, wanted * total[-1] - 1e-13)), len(w) - 1)]
    inside = p.weights >= last * (1.0 - 1e-12)
    count = int(inside.sum())
    return HighestDensity(inside, float(last) / p.cell_volume, float(p.weights[inside].sum()), count * p.cell_volume)


def _around(mean: ArrayLike, sd: ArrayLike, lam: ArrayLike) -> Array:
    mean, sd = finite("mean", mean), finite("sd", sd)
    if np.any(sd < 0.0):
        raise ValueError(f"sd: expected numbers >= 0, got {sd.min()}")
    half = sd * lam
    return np.stack(np.broadcast_arrays(mean - half, mean + half), axis=-1)


def _probability(probability: ArrayLike) -> Array:
    p = finite("probability", probability)
    if np.any((p < 0.0) | (p >= 1.0)):
        raise ValueError(f"probability: expected at least 0 and below 1, got {p}")
    return p
