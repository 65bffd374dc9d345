"""What sensors share: R, innovation and log-likelihood of normal noise, and the checks of x and y."""

import math
from dataclasses import field

import numpy as np

from core import checks
from core.stacks import frozen, is_finite, vector, zero_stack
from core.types import Array

TWO_PI = 2 * math.pi


class NormalNoise:
    """y = h(x) + v,  v ~ N(0, diag(sigma^2)), rows independent.

    A sensor that inherits from this has the fields R, precision and log_constant and sets them with `set_noise`.
    """

    __slots__ = ()
    circular = False

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat, shape (..., m)."""
        return np.subtract(y, y_hat)

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """-1/2 sum ((y - h(x)) / sigma)^2 - sum log(sigma sqrt(2 pi)).

        y (m,) or (..., m), x (..., n); shape (...).  MAT Example 17.
        """
        y, y_hat = vector("y", y, len(self.R)), self.h(x)
        if y.ndim == 1 < y_hat.ndim and not self.circular:
            z = np.subtract(y, y_hat, out=y_hat)          # y_hat is ours: a large cloud needs no further memory
        else:
            z = self.innovation(y, y_hat)
        z *= self.precision
        z *= z
        total = z.sum(axis=-1)
        total *= -0.5
        total += self.log_constant
        return total


class StepFunction:
    """A sensor with steps: no slope, and a difference as innovation."""

    __slots__ = ()

    def jacobian(self, x: Array) -> Array:
        """0, shape (..., m, n): the derivative almost everywhere."""
        x = state(x, 1)
        return zero_stack(x.shape[:-1], len(self.R), x.shape[-1])

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """y - y_hat, shape (..., m)."""
        return np.subtract(y, y_hat)


def derived() -> Array:
    """A field that is computed from the others."""
    return field(init=False, repr=False)


def set_noise(sensor: NormalNoise, name: str, sigma: float | Array, m: int) -> None:
    """Sets R = diag(sigma^2) and the constants of the log-likelihood; sigma is a number or one per row, positive.

    The density of a circular sensor lives on (-pi, pi] and is normalised there.
    """
    s = per_row(name, sigma, m)
    if (s <= 0).any():
        raise ValueError(f"{name}: expected positive numbers, got {s.min()}")
    constant = -math.fsum(math.log(v * math.sqrt(TWO_PI)) for v in s)
    if sensor.circular:
        constant -= math.fsum(math.log(math.erf(math.pi / (v * math.sqrt(2)))) for v in s)
    set_fields(sensor, R=frozen(np.diag(s * s)), precision=frozen(1 / s), log_constant=constant)
    object.__setattr__(sensor, name, float(s[0]) if np.ndim(sigma) == 0 else frozen(s))


def set_fields(sensor: object, **values: object) -> None:
    """Assigns fields of a frozen record while it is being made."""
    for name, value in values.items():
        object.__setattr__(sensor, name, value)


def per_row(name: str, value: float | Array, m: int) -> Array:
    """value as (m,): a number or one per row."""
    v = checks.finite(name, value)
    if v.shape not in ((), (m,)):
        raise ValueError(f"{name}: expected a number or {m} of them, got shape {v.shape}")
    return np.broadcast_to(v, (m,))


def positions(name: str, value: Array) -> Array:
    """value as points (m, d)."""
    s = checks.finite(name, value, None, None)
    if s.ndim != 2 or s.size == 0:
        raise ValueError(f"{name}: expected points (m, d), got shape {s.shape}")
    return frozen(s)


def state(x: Array, n: int) -> Array:
    """x (..., >= n) as finite float64; its first n components are what the sensor looks at."""
    x = np.asarray(x, np.float64)
    if x.ndim == 0 or x.shape[-1] < n:
        raise ValueError(f"x: expected shape (..., n) with n >= {n}, got {x.shape}")
    if not is_finite(x[..., :n]):
        checks.finite("x", x)
    return x


def wrap_angle(a: Array) -> Array:
    """The angle in (-pi, pi] that equals a modulo 2 pi; an angle already there is returned exactly.

    >>> wrap_angle(np.array([3.0, 4.0, -np.pi])).round(6)
    array([ 3.      , -2.283185,  3.141593])
    """
    return a - TWO_PI * np.ceil((a - math.pi) / TWO_PI)
