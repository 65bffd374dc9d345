"""Linear sensors, and several sensors read as one."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from core import checks
from core.sensor_noise import NormalNoise, derived, set_fields, set_noise, state
from core.stacks import apply, frozen, vector
from core.types import Array, Sensor


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """y = H x + v,  v ~ N(0, R).

    H (m, n); R (m, m) positive semidefinite, or a number or (m,) variances of independent rows.  A singular R (a
    perfect measurement) serves the Kalman filter but has no density.  MAT (3.5).

    >>> Linear([[2.0]], [[16.0]]).h(np.array([6.0]))
    array([12.])
    """

    H: Array
    R: Array
    root: Array | None = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        H = checks.finite("H", self.H, None, None)
        if H.ndim != 2 or H.size == 0:
            raise ValueError(f"H: expected a matrix (m, n), got shape {H.shape}")
        m = len(H)
        R = checks.finite("R", self.R)
        if R.shape in ((), (m,)):
            R = np.diag(np.broadcast_to(R, (m,)))
        R = checks.covariance("R", R, m)
        if R.ndim != 2:
            raise ValueError(f"R: expected one matrix ({m}, {m}), got shape {R.shape}")
        try:
            L = np.linalg.cholesky(R)
            constant = -math.fsum(math.log(v * math.sqrt(2 * math.pi)) for v in L.diagonal())
        except np.linalg.LinAlgError:
            L, constant = None, math.nan
        set_fields(self, H=frozen(H), R=frozen(R), root=None if L is None else frozen(L), log_constant=constant)

    def matrix(self, n: int) -> Array:
        """H for a state of n components; ValueError if it has another width."""
        if self.H.shape[1] != n:
            raise ValueError(f"x: expected shape (..., {self.H.shape[1]}), got (..., {n})")
        return self.H

    def _state(self, x: Array) -> Array:
        x = state(x, self.H.shape[1])
        self.matrix(x.shape[-1])
        return x

    def h(self, x: Array) -> Array:
        """H x, shape (..., m)."""
        return apply(self.H, self._state(x))

    def jacobian(self, x: Array) -> Array:
        """H for every x: (..., m, n), one matrix repeated without copying."""
        x = self._state(x)
        return self.H if x.ndim == 1 else np.broadcast_to(self.H, x.shape[:-1] + self.H.shape)

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat, shape (..., m)."""
        return np.subtract(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """-1/2 (y - H x)' R^-1 (y - H x) - 1/2 log det(2 pi R), shape (...).  ValueError if R is singular."""
        if self.root is None:
            raise ValueError("R: expected a positive definite matrix for a density, got a singular one")
        # Rows first and forward substitution by hand: H and the factor of R are small and often sparse, x is long.
        x = self._state(x)
        y = vector("y", y, len(self.H))
        total, solved = 0.0, []
        for i, row in enumerate(self.H):
            z = np.array(y[..., i])
            for j in np.flatnonzero(row):
                z = z - row[j] * x[..., j]
            for j in np.flatnonzero(self.root[i, :i]):
                z = z - self.root[i, j] * solved[j]
            z = z / self.root[i, i]
            solved.append(z)
            total = total + z * z
        return self.log_constant - 0.5 * total


@cache
def _selector(m: int, n: int) -> Array:
    return frozen(np.eye(m, n))


@dataclass(frozen=True, slots=True, eq=False)
class Position(NormalNoise):
    """y = x_{1:dim} + v.

    A position fix: the first `dim` components of the state, sigma_m a number or (dim,).  MAT (3.14).

    >>> Position(2, [30.0, 50.0]).h(np.array([1.0, 2.0, 3.0, 4.0]))
    array([1., 2.])
    """

    dim: int
    sigma_m: float | Array
    R: Array = derived()
    precision: Array = derived()
    log_constant: float = derived()

    def __post_init__(self) -> None:
        if self.dim != int(self.dim) or self.dim < 1:
            raise ValueError(f"dim: expected a positive integer, got {self.dim}")
        set_noise(self, "sigma_m", self.sigma_m, self.dim)

    def matrix(self, n: int) -> Array:
        """[I, 0], shape (dim, n); ValueError for n < dim."""
        if n < self.dim:
            raise ValueError(f"x: expected shape (..., n) with n >= {self.dim}, got (..., {n})")
        return _selector(self.dim, n)

    def h(self, x: Array) -> Array:
        """The position, shape (..., dim), in metres; a copy."""
        return state(x, self.dim)[..., :self.dim].copy(order="K")

    def jacobian(self, x: Array) -> Array:
        """[I, 0] for every x: (..., dim, n), one matrix repeated without copying."""
        x = state(x, self.dim)
        H = self.matrix(x.shape[-1])
        return H if x.ndim == 1 else np.broadcast_to(H, x.shape[:-1] + H.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """y = [y_1; y_2; ...]: several independent sensors of the same state read at once.  MAT (2.1).

    >>> Stack([Position(1, 3.0), Position(1, 4.0)]).R.diagonal()
    array([ 9., 16.])
    """

    sensors: tuple[Sensor, ...]
    R: Array = derived()
    rows: tuple[slice, ...] = derived()

    def __post_init__(self) -> None:
        sensors = tuple(self.sensors)
        if not sensors:
            raise ValueError("sensors: expected at least one sensor, got none")
        sizes = [len(s.R) for s in sensors]
        ends = np.cumsum(sizes).tolist()
        rows = tuple(slice(end - m, end) for end, m in zip(ends, sizes, strict=True))
        R = np.zeros((ends[-1], ends[-1]))
        for s, r in zip(sensors, rows, strict=True):
            R[r, r] = s.R
        set_fields(self, sensors=sensors, R=frozen(R), rows=rows)

    def h(self, x: Array) -> Array:
        """All measurements, shape (..., m)."""
        return np.concatenate([s.h(x) for s in self.sensors], axis=-1)

    def jacobian(self, x: Array) -> Array:
        """All rows, shape (..., m, n)."""
        return np.concatenate([s.jacobian(x) for s in self.sensors], axis=-2)

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """Each sensor's own innovation, shape (..., m)."""
        y, y_hat = np.broadcast_arrays(y, y_hat)
        parts = [s.innovation(y[..., r], y_hat[..., r]) for s, r in zip(self.sensors, self.rows, strict=True)]
        return np.concatenate(parts, axis=-1)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """Sum of the sensors' log-likelihoods, shape (...)."""
        y = np.asarray(y, dtype=np.float64)
        if y.ndim == 0 or y.shape[-1] != len(self.R):
            raise ValueError(f"y: expected shape (..., {len(self.R)}), got {y.shape}")
        first, *rest = (s.log_likelihood(y[..., r], x) for s, r in zip(self.sensors, self.rows, strict=True))
        return sum(rest, first)
