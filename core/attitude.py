"""Integrating an angular velocity to an attitude: exactly over steps of constant rate, by Bortz, and naively.

The naive integral of the gyros is right only for a fixed axis; coning is the classical motion on which it fails.
Conventions of `core.rotation`: attitudes are C_B^I or the rotation vector p of the body B, rates w_IB^B in rad/s.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.quaternion import rotation_matrix
from core.rotation import dcm_from_rotation_vector, principal, rotation_angle, rotation_vector_rate
from core.types import Array


class BortzRun(NamedTuple):
    """Rotation vectors p(t_k) along an integration of MAT (1.26).

    t_s (k+1,); p (k+1, ..., 3) in rad with |p| <= pi; switched (k+1, ...) True where the step ended on the shadow
    vector; naive (k+1, ..., 3) the integral of w alone, MAT (1.20), for comparison.
    """

    t_s: Array
    p: Array
    switched: np.ndarray
    naive: Array


class Coning(NamedTuple):
    """A rotation vector that runs round a cone: p (..., 3) rad, body rate w (..., 3) rad/s, dp/dt (..., 3) rad/s."""

    p: Array
    w: Array
    p_rate: Array


def rotate(C: ArrayLike, w: ArrayLike, dt_s: ArrayLike) -> Array:
    """C(t + dt) = C(t) C_{B(t+dt)}^{B(t)}  with the rotation vector w dt of (1.19).

    C = C_B^I (..., 3, 3); w (..., 3) constant over the step, body coordinates, rad/s; dt_s (...) -> (..., 3, 3).
    Exact, whatever the length of the step.  ValueError unless C is a rotation matrix.  MAT (1.14), (1.19), (1.21).

    >>> rotate(np.eye(3), [0.0, 0.0, np.pi], 0.5).round(12).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    step = finite("w", w, 3) * finite("dt_s", dt_s)[..., None]
    return rotation_matrix(C) @ dcm_from_rotation_vector(step)


def integrate_rates(C: ArrayLike, w: ArrayLike, dt_s: float) -> Array:
    """C_k = C_{k-1} C(w_k dt)  for k = 1, ..., K.

    C = C_B^I (..., 3, 3) at the start; w (K, ..., 3) the rate of each step in body coordinates, rad/s ->
    (K+1, ..., 3, 3).  Exact for rates that are constant over each step.  ValueError for wrong shapes.
    MAT (1.14), (1.19).

    >>> turns = integrate_rates(np.eye(3), np.tile([0.0, 0.0, np.pi], (4, 1)), 0.5)
    >>> turns.shape, bool(np.allclose(turns[-1], np.eye(3)))
    ((5, 3, 3), True)
    """
    w = finite("w", w, 3)
    if w.ndim < 2:
        raise ValueError(f"w: expected shape (steps, ..., 3), got {w.shape}")
    steps = dcm_from_rotation_vector(w * _step(dt_s))
    C = rotation_matrix(C)
    out = np.empty((len(steps) + 1, *np.broadcast_shapes(C.shape, steps.shape[1:])))
    out[0] = C
    for k, step in enumerate(steps):
        out[k + 1] = out[k] @ step
    return out


def integrate_bortz(p: ArrayLike, w: Callable[[float], ArrayLike], dt_s: float, steps: int) -> BortzRun:
    """dp/dt = rotation_vector_rate(p, w(t)) by the classical Runge-Kutta method, t = 0, dt, ..., steps dt.

    p (..., 3) in rad at t = 0; w(t) -> (..., 3) in body coordinates, rad/s.  After every step p changes to its shadow
    vector if it is longer than pi, so that the pole at 2 pi is never met while |w| dt < 1 rad.  The naive integral
    uses the same four evaluations (Simpson's rule).  ValueError for a step that is not positive or reaches the pole.
    MAT (1.26), (1.20).

    >>> run = integrate_bortz(np.zeros(3), lambda t: [0.0, 0.0, 1.0], 0.1, 40)          # 4 rad about z
    >>> run.p[-1].round(6).tolist(), run.naive[-1].round(6).tolist()
    ([0.0, 0.0, -2.283185], [0.0, 0.0, 4.0])
    """
    dt = _step(dt_s)
    if steps < 1:
        raise ValueError(f"steps: expected at least 1, got {steps}")
    t = dt * np.arange(steps + 1)
    w_right = finite("w(t)", w(0.0), 3)
    p = principal(np.broadcast_to(finite("p", p, 3), np.broadcast_shapes(np.shape(p), w_right.shape)))
    P, naive = np.empty((steps + 1, *p.shape)), np.zeros((steps + 1, *p.shape))
    switched = np.zeros((steps + 1, *p.shape[:-1]), dtype=bool)
    P[0] = p
    for k in range(steps):
        w_left, w_middle, w_right = w_right, finite("w(t)", w(t[k] + 0.5 * dt), 3), finite("w(t)", w(t[k + 1]), 3)
        k1 = rotation_vector_rate(p, w_left)
        k2 = rotation_vector_rate(p + 0.5 * dt * k1, w_middle)
        k3 = rotation_vector_rate(p + 0.5 * dt * k2, w_middle)
        k4 = rotation_vector_rate(p + dt * k3, w_right)
        p = p + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        switched[k + 1] = rotation_angle(p) > np.pi
        P[k + 1] = p = principal(p)
        naive[k + 1] = naive[k] + dt / 6.0 * (w_left + 4.0 * w_middle + w_right)
    return BortzRun(t, P, switched, naive)


def coning(half_angle_rad: float, rate_rad_s: float, t_s: ArrayLike) -> Coning:
    """p = a [cos Wt, sin Wt, 0],  w = W sin a [-sin Wt, cos Wt, 0] - W (1 - cos a) [0, 0, 1].

    half_angle_rad a, rate_rad_s W, t_s (...) -> p, w and dp/dt, each (..., 3).  The body returns to its attitude
    every 2 pi / W, yet the integral of w drifts by -2 pi (1 - cos a) about z: minus the solid angle of the cone.
    ValueError for a non-finite number.  Solves MAT (1.26).

    >>> float(coning(0.2, 2 * np.pi, 0.0).w[2].round(6))
    -0.125245
    """
    a, W, t = finite("half_angle_rad", half_angle_rad), finite("rate_rad_s", rate_rad_s), finite("t_s", t_s)
    cos, sin, zero = np.cos(W * t), np.sin(W * t), np.zeros(np.broadcast_shapes(a.shape, W.shape, t.shape))
    along = np.stack([cos + zero, sin + zero, zero], axis=-1)
    across = np.stack([-sin + zero, cos + zero, zero], axis=-1)
    spin = np.stack([zero, zero, W * (1.0 - np.cos(a)) + zero], axis=-1)
    return Coning(a[..., None] * along, (W * np.sin(a))[..., None] * across - spin, (a * W)[..., None] * across)


def _step(dt_s: float) -> float:
    dt = float(finite("dt_s", dt_s))
    if dt <= 0.0:
        raise ValueError(f"dt_s: expected a positive step, got {dt}")
    return dt
