"""Joint laws of two coordinates: a flat density on a convex set, and the normal law."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from core.forms import correlation
from core.gaussian import affine, log_density, marginal, regression_gain, sample
from core.types import Array, Gaussian

if TYPE_CHECKING:
    from lessons.background.independence import Params

EXAMPLE_7 = np.array([[16.0, 24.0], [24.0, 52.0]])         # m²
SIGMAS_M = np.sqrt(np.diagonal(EXAMPLE_7))
STEPS = 40                                                 # in which Example 9's coefficient grows
CELLS = 161                                                # per axis, for the distance to the product
LINE = 2000                                                # points of one-dimensional integrals


class Joint(Protocol):
    """half: half the side of the square that is shown; reach: where the marginals are positive."""

    half: float
    reach: tuple[float, float]

    def density(self, x: Array) -> Array: ...
    def marginal(self, i: int, t: Array) -> Array: ...
    def given(self, c: Array) -> tuple[Array, Array]: ...
    def draw(self, n: int, rng: np.random.Generator) -> Array: ...


Chord = Callable[[int, Array], tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class Flat:
    """f = 1 / area on a convex set; chord(i, t): ends of the range of x_i where the other coordinate is t."""

    chord: Chord
    area: float
    half: float
    reach: tuple[float, float]

    def density(self, x: Array) -> Array:
        low, high = self.chord(0, x[..., 1])
        return np.where((low <= x[..., 0]) & (x[..., 0] <= high), 1.0 / self.area, 0.0)

    def marginal(self, i: int, t: Array) -> Array:
        """f_i(t): the length of the set over x_i = t, divided by the area."""
        low, high = self.chord(1 - i, np.asarray(t))
        return np.maximum(high - low, 0.0) / self.area

    def given(self, c: Array) -> tuple[Array, Array]:
        """Mean and standard deviation of x_1 given x_2 = c: uniform on the chord; 0 and 0 outside."""
        low, high = self.chord(0, np.asarray(c))
        some = high >= low
        return np.where(some, 0.5 * (low + high), 0.0), np.where(some, (high - low) / np.sqrt(12.0), 0.0)

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Points of the bounding rectangle, those outside thrown away."""
        kept: list[Array] = []
        while sum(map(len, kept)) < n:
            x = rng.uniform(-1.0, 1.0, (2 * n, 2)) * self.reach
            kept.append(x[self.density(x) > 0.0])
        return np.concatenate(kept)[:n]


@dataclass(frozen=True, slots=True)
class Normal:
    """N(0, P) of two components."""

    g: Gaussian
    half: float

    @property
    def reach(self) -> tuple[float, float]:
        return self.half, self.half

    def density(self, x: Array) -> Array:
        return np.exp(log_density(self.g, x))

    def marginal(self, i: int, t: Array) -> Array:
        return np.exp(log_density(marginal(self.g, [i]), np.asarray(t)[..., None]))

    def given(self, c: Array) -> tuple[Array, Array]:
        K = float(regression_gain(self.g, 1)[0, 0])
        P = np.asarray(self.g.cov)
        return K * np.asarray(c), np.full(np.shape(c), np.sqrt(max(P[0, 0] - K * P[1, 0], 0.0)))

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        return sample(self.g, n, rng)


def disc() -> Flat:
    """f = 1/pi inside the unit circle.  MAT Example 5."""
    def chord(i: int, t: Array) -> tuple[Array, Array]:
        half = np.sqrt(np.maximum(1.0 - np.square(t), 0.0))
        return np.where(np.abs(t) <= 1.0, -half, 1.0), np.where(np.abs(t) <= 1.0, half, -1.0)

    return Flat(chord, np.pi, 1.2, (1.0, 1.0))


def square(turn_rad: float) -> Flat:
    """f = 1/4 inside the square of side 2, turned by an angle: |u' x| <= 1 and |v' x| <= 1 with orthonormal u, v."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    N = np.array([[c, s], [-s, c]])

    def chord(i: int, t: Array) -> tuple[Array, Array]:
        low, high = np.full(np.shape(t), -np.inf), np.full(np.shape(t), np.inf)
        for along, across in zip(N[:, i], N[:, 1 - i], strict=True):
            if abs(along) < 1e-12:                         # the side is parallel to the line: all of it or nothing
                low = np.where(np.abs(across * t) <= 1.0 + 1e-12, low, np.inf)
                high = np.where(np.abs(across * t) <= 1.0 + 1e-12, high, -np.inf)
                continue
            ends = np.sort([(-1.0 - across * t) / along, (1.0 - across * t) / along], axis=0)
            low, high = np.maximum(low, ends[0]), np.minimum(high, ends[1])
        return low, high

    reach = float(abs(c) + abs(s))
    return Flat(chord, 4.0, 1.55, (reach, reach))


def covariance(rho: float) -> Array:
    """The standard deviations of Example 7 with this correlation."""
    return np.outer(SIGMAS_M, SIGMAS_M) * np.array([[1.0, rho], [rho, 1.0]])


def normal(P: Array) -> Normal:
    return Normal(Gaussian(np.zeros(2), P), 18.0)


def remainder(P: Array, k: float) -> Gaussian:
    """Law of (z, y) with z = x - k y.  MAT Example 9."""
    return affine(Gaussian(np.zeros(2), P), [[1.0, -k], [0.0, 1.0]])


def coefficient(p: "Params", step: int) -> float:
    """k at this step: in Example 9 it grows from 0 to its value, elsewhere it is 0."""
    return p.k * step / STEPS if p.picture == "remainder" else 0.0


def law_of(p: "Params", step: int = STEPS) -> Joint:
    """The joint law of the picture at this step."""
    if p.picture == "disc":
        return disc()
    if p.picture == "square":
        return square(np.radians(p.turn_deg))
    return normal(remainder(covariance(p.correlation), coefficient(p, step)).cov)


def probe_of(p: "Params") -> Array:
    """Where the law is cut: x_1 on the slice, and x_2 of the slice."""
    return np.array(p.probe if p.picture in ("disc", "square") else p.probe_m)


def difference(law: Joint, cells: int = CELLS) -> tuple[Array, Array]:
    """Places (cells,) of both axes, and f - f1 f2 on them, (x_2, x_1)."""
    edges = np.linspace(-law.half, law.half, cells + 1)
    t = 0.5 * (edges[:-1] + edges[1:])
    x = np.stack(np.meshgrid(t, t), axis=-1)
    return t, law.density(x) - law.marginal(1, t)[:, None] * law.marginal(0, t)


def total_variation(law: Joint, cells: int = CELLS) -> float:
    """1/2 int |f - f1 f2|: 0 if and only if the coordinates are independent, at most 1.

    A normal law is first scaled to standard deviations of 1, which changes nothing.
    """
    if isinstance(law, Normal):
        law = Normal(Gaussian(np.zeros(2), correlation(law.g.cov)), 6.0)
    t, gap = difference(law, cells)
    return 0.5 * float(np.abs(gap).sum()) * (t[1] - t[0]) ** 2


class Facts(NamedTuple):
    """Correlation of the coordinates and of their squares, standard deviation of the first one."""

    correlation: float
    squares: float
    sd: float


def facts(law: Joint) -> Facts:
    """By one-dimensional integrals over x_2; for a normal law exactly."""
    if isinstance(law, Normal):
        rho = float(correlation(law.g.cov)[0, 1])
        return Facts(rho, rho**2, float(np.sqrt(law.g.cov[0, 0])))
    c = (np.arange(LINE) + 0.5) / LINE * 2.0 * law.reach[1] - law.reach[1]
    w = law.marginal(1, c)
    w = w / w.sum()
    mean, sd = law.given(c)
    second = mean**2 + sd**2                               # E(x_1^2 | x_2)
    fourth = mean**4 + 6.0 * mean**2 * sd**2 + 1.8 * sd**4  # of a uniform law
    a, b = w @ second, w @ c**2
    plain = (w @ (mean * c)) / np.sqrt(a * b)
    squares = (w @ (second * c**2) - a * b) / np.sqrt((w @ fourth - a**2) * (w @ c**4 - b**2))
    return Facts(float(plain), float(squares), float(np.sqrt(a)))
