"""Records and protocols that every module of `core` shares."""

from typing import NamedTuple, Protocol, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.float64]]  # numpy.typing would cost every import 14 ms


class Gaussian(NamedTuple):
    """x ~ N(mean, cov).

    mean (..., n), cov (..., n, n) symmetric positive semidefinite, in the state's units.  MAT Definition 4, p. 7.
    """

    mean: Array
    cov: Array


class Sensor(Protocol):
    """y = h(x) + v with V(v) = R.  MAT (2.1), (3.2).

    All methods accept leading batch axes: x (..., n) gives y (..., m), jacobian (..., m, n).
    """

    @property
    def R(self) -> Array:
        """V(v), shape (m, m), in the squares of the measurement's units."""

    def h(self, x: Array) -> Array:
        """Noise-free measurement, shape (..., m)."""

    def jacobian(self, x: Array) -> Array:
        """dh/dx, shape (..., m, n)."""

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat, shape (..., m), angles wrapped to (-pi, pi]."""

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """log p(y | x), shape (...), normalised over y."""


class Motion(Protocol):
    """x_k = f(x_{k-1}) + w with V(w) = Q.  MAT (3.1)."""

    @property
    def Q(self) -> Array:
        """V(w), shape (n, n)."""

    def f(self, x: Array) -> Array:
        """Noise-free next state, shape (..., n)."""

    def jacobian(self, x: Array) -> Array:
        """df/dx, shape (..., n, n)."""

    def sample(self, x: Array, rng: "np.random.Generator") -> Array:
        """One draw of x_k for each x_{k-1}, shape (..., n)."""
