"""Manoeuvres as motion models: turning at a known or unknown rate, and standing still.  MAT 3.1.

State: east and north position (m), east and north velocity (m/s), so that the models can be mixed with
`core.motion.constant_velocity`.  A turn rate is in rad/s, positive to the left (anticlockwise seen from above).
"""

import math
from dataclasses import dataclass

import numpy as np

from core import checks
from core.linalg import cholesky_psd
from core.motion import LinearMotion, constant_velocity
from core.sensor_noise import derived, set_fields
from core.stacks import empty_like, frozen, vector, zero_stack
from core.types import Array

_LEFT = np.array([[0.0, -1.0], [1.0, 0.0]])               # a quarter turn to the left
_NEAR = 0.1                                               # below this angle the series are exact to 16 digits


def known_turn(dt_s: float, sigma: float, rate_rad_s: float) -> LinearMotion:
    """dp = v dt,  dv = omega J v dt + dbeta,  J = [[0, -1], [1, 0]]: a turn at the rate omega, discretised exactly.

    sigma (m/s per square root of a second): the velocity's variance grows by sigma^2 each second, as in
    `constant_velocity`, which this is for omega = 0.  ValueError for dt_s <= 0, sigma < 0 or a rate that is not
    finite.  MAT (3.3) with F = [[0, I], [0, omega J]].

    >>> known_turn(1.0, 0.0, np.pi / 2).f(np.array([0.0, 0.0, 1.0, 0.0])).round(4)
    array([0.6366, 0.6366, 0.    , 1.    ])
    """
    dt = constant_velocity(dt_s, sigma, 2).Phi[0, 2]      # checks dt_s and sigma
    a = float(checks.finite("rate_rad_s", rate_rad_s)) * dt
    I, g = np.eye(2), _sine_gap(a)
    Phi = np.block([[I, dt * (_sine_ratio(a) * I + _cosine_ratio(a) * _LEFT)],
                    [np.zeros((2, 2)), math.cos(a) * I + math.sin(a) * _LEFT]])
    cross = dt**2 * (0.5 * _sine_ratio(a / 2) ** 2 * I - a * g * _LEFT)
    Q = float(sigma) ** 2 * np.block([[2 * g * dt**3 * I, cross], [cross.T, dt * I]])
    return LinearMotion(Phi, Q)


def standing(dt_s: float, sigma: float, velocity_sigma_mps: float) -> LinearMotion:
    """p_k = p_{k-1} + w_p,  v_k = w_v:  standing still, whatever the velocity was.

    sigma (m per square root of a second): drift of the position; velocity_sigma_mps: how well the velocity is known to
    be 0, which also says how fast a filter may start again.  ValueError for dt_s <= 0 or negative deviations.
    """
    drift = constant_velocity(dt_s, sigma, 2).Q[2, 2]     # sigma^2 dt
    s = float(checks.finite("velocity_sigma_mps", velocity_sigma_mps))
    if s < 0:
        raise ValueError(f"velocity_sigma_mps: expected a number >= 0, got {s}")
    return LinearMotion(np.diag([1.0, 1.0, 0.0, 0.0]), np.diag([drift, drift, s * s, s * s]))


@dataclass(frozen=True, slots=True, eq=False)
class CoordinatedTurn:
    """A turn at a rate omega that is part of the state: p, v as in `known_turn`, omega a random walk.

    State: east, north (m), their velocities (m/s), omega (rad/s).  sigma as in `known_turn`; turn_sigma (rad/s per
    square root of a second).  Q is that of constant velocity, with turn_sigma^2 dt for omega.  ValueError for
    dt_s <= 0 or negative deviations.

    >>> CoordinatedTurn(1.0, 0.1, 0.01).f(np.array([0.0, 0.0, 1.0, 0.0, np.pi / 2])).round(4)
    array([0.6366, 0.6366, 0.    , 1.    , 1.5708])
    """

    dt_s: float
    sigma: float
    turn_sigma: float
    Q: Array = derived()
    root: Array = derived()

    def __post_init__(self) -> None:
        Q = np.zeros((5, 5))
        Q[:4, :4] = constant_velocity(self.dt_s, self.sigma, 2).Q
        s = float(checks.finite("turn_sigma", self.turn_sigma))
        if s < 0:
            raise ValueError(f"turn_sigma: expected a number >= 0, got {s}")
        Q[4, 4] = s * s * self.dt_s
        set_fields(self, Q=frozen(Q), root=frozen(cholesky_psd(Q)))

    def f(self, x: Array) -> Array:
        """The state after dt_s, shape (..., 5)."""
        x = vector("x", x, 5)
        u, v, a, S, C = self._parts(x)
        cos, sin = np.cos(a), np.sin(a)
        out = empty_like(x, 5)
        out[..., 0] = x[..., 0] + self.dt_s * (S * u - C * v)
        out[..., 1] = x[..., 1] + self.dt_s * (C * u + S * v)
        out[..., 2] = cos * u - sin * v
        out[..., 3] = sin * u + cos * v
        out[..., 4] = x[..., 4]
        return out

    def jacobian(self, x: Array) -> Array:
        """df/dx, shape (..., 5, 5)."""
        x = vector("x", x, 5)
        u, v, a, S, C = self._parts(x)
        dt, cos, sin = self.dt_s, np.cos(a), np.sin(a)
        dS, dC = _sine_ratio_slope(a), S - 0.5 * _sine_ratio(a / 2) ** 2
        F = zero_stack(x.shape[:-1], 5, 5)
        F[..., 0, 0] = F[..., 1, 1] = F[..., 4, 4] = 1.0
        F[..., 0, 2] = F[..., 1, 3] = dt * S
        F[..., 0, 3] = -dt * C
        F[..., 1, 2] = dt * C
        F[..., 2, 2] = F[..., 3, 3] = cos
        F[..., 2, 3] = -sin
        F[..., 3, 2] = sin
        F[..., 0, 4] = dt**2 * (dS * u - dC * v)
        F[..., 1, 4] = dt**2 * (dC * u + dS * v)
        F[..., 2, 4] = dt * (-sin * u - cos * v)
        F[..., 3, 4] = dt * (cos * u - sin * v)
        return F

    def sample(self, x: Array, rng: "np.random.Generator") -> Array:
        """f(x) + L u,  u ~ N(0, I): one draw for each x (..., 5)."""
        x = self.f(x)
        return x + rng.standard_normal(x.shape) @ self.root.T

    def _parts(self, x: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Velocity, angle a = omega dt, sin a / a and (1 - cos a) / a."""
        a = x[..., 4] * self.dt_s
        return x[..., 2], x[..., 3], a, _sine_ratio(a), _cosine_ratio(a)


def _sine_ratio(a: Array) -> Array:
    """sin a / a."""
    return np.sinc(np.asarray(a) / np.pi)


def _cosine_ratio(a: Array) -> Array:
    """(1 - cos a) / a = sin^2(a / 2) / (a / 2)."""
    return 0.5 * a * _sine_ratio(np.asarray(a) / 2) ** 2


def _sine_gap(a: Array) -> Array:
    """(a - sin a) / a^3, 1/6 at 0."""
    a = np.asarray(a, dtype=np.float64)
    b, far = a * a, np.where(np.abs(a) < _NEAR, 1.0, a)
    series = 1 / 6 - b / 120 * (1 - b / 42 * (1 - b / 72 * (1 - b / 110)))
    return np.where(np.abs(a) < _NEAR, series, (far - np.sin(far)) / far**3)


def _sine_ratio_slope(a: Array) -> Array:
    """d/da (sin a / a) = (cos a - sin a / a) / a, 0 at 0."""
    a = np.asarray(a, dtype=np.float64)
    b, far = a * a, np.where(np.abs(a) < _NEAR, 1.0, a)
    series = -a / 3 * (1 - b / 10 * (1 - b / 28 * (1 - b / 54 * (1 - b / 88))))
    return np.where(np.abs(a) < _NEAR, series, (np.cos(far) - np.sin(far) / far) / far)
