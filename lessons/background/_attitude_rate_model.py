"""Two motions whose attitude is known exactly, and four ways to integrate their gyro readings."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.attitude import coning, integrate_bortz, integrate_rates
from core.rotation import dcm_from_rotation_vector, dcm_rate, principal, rotation_angle, rotation_vector_from_dcm
from core.types import Array
from lessons.kit.lesson import Progress, no_progress

if TYPE_CHECKING:
    from lessons.background.attitude_rate import Params

METHODS = ("naive", "start", "middle", "bortz")


@dataclass(frozen=True)
class Motion:
    """p(t) and w(t) of the body; one turn takes turn_s."""

    turn_s: float
    p: Callable[[Array | float], Array]
    w: Callable[[Array | float], Array]

    def C(self, t_s: Array | float) -> Array:
        """The true C_B^I."""
        return dcm_from_rotation_vector(self.p(t_s))


class Track(NamedTuple):
    """What became of the samples: attitudes by method, the vectors integrated, and angles to the truth."""

    t_s: Array                   # (n+1,)
    C: dict[str, Array]          # (n+1, 3, 3)
    naive: Array                 # (n+1, 3) p(0) and the integral of w
    bortz: Array                 # (n+1, 3)
    error_deg: dict[str, Array]  # (n+1,)


def motion_of(p: "Params") -> Motion:
    """Coning about z, or a constant rate about a fixed axis, (1.19)."""
    if p.motion == "coning":
        half, rate = float(np.radians(p.half_angle_deg)), 2.0 * np.pi * p.rate_hz
        return Motion(1.0 / p.rate_hz, lambda t: coning(half, rate, t).p, lambda t: coning(half, rate, t).w)
    axis = np.array(p.axis)
    length = float(np.linalg.norm(axis))
    w = p.spin_rad_s * (axis / length if length > 1e-6 else np.array([0.0, 0.0, 1.0]))
    return Motion(2.0 * np.pi / p.spin_rad_s, lambda t: principal(np.multiply.outer(np.asarray(t), w)),
                  lambda t: np.broadcast_to(w, (*np.shape(t), 3)))


def track(motion: Motion, dt_s: float, steps: int, progress: Progress = no_progress, share: float = 1.0) -> Track:
    """All methods, from the true attitude at t = 0."""
    t = dt_s * np.arange(steps + 1)
    true = motion.C(t)
    run = integrate_bortz(motion.p(0.0), motion.w, dt_s, steps)                             # (1.26)
    progress(0.8 * share)
    naive = motion.p(0.0) + run.naive                                                       # (1.20)
    C = {
        "naive": dcm_from_rotation_vector(naive),
        "start": integrate_rates(true[0], motion.w(t[:-1]), dt_s),
        "middle": integrate_rates(true[0], motion.w(t[:-1] + 0.5 * dt_s), dt_s),
        "bortz": dcm_from_rotation_vector(run.p),
    }
    progress(share)
    return Track(t, C, naive, run.p, {name: angle_deg(true, found) for name, found in C.items()})


def angle_deg(C: Array, D: Array) -> Array:
    """Angle of the rotation between two attitudes, in degrees."""
    return np.degrees(rotation_angle(rotation_vector_from_dcm(C.mT @ D)))


def largest_errors(motion: Motion, steps: int) -> dict[str, float]:
    """The largest error in the first turn, in degrees."""
    return {name: float(e.max()) for name, e in track(motion, motion.turn_s / steps, steps).error_deg.items()}


def difference_errors(motion: Motion, t_s: float) -> tuple[Array, Array]:
    """Steps h (m,) and how far difference quotients are from C (w x), relative to it, (2, m): forward, central."""
    h = motion.turn_s * np.logspace(-9.0, -1.0, 33)
    C, rate = motion.C(t_s), dcm_rate(motion.C(t_s), motion.w(t_s))                         # (1.21)
    forward = (motion.C(t_s + h) - C) / h[:, None, None]
    central = (motion.C(t_s + h) - motion.C(t_s - h)) / (2.0 * h[:, None, None])
    size = np.linalg.norm(rate)
    return h, np.stack([np.linalg.norm(q - rate, axis=(1, 2)) / size for q in (forward, central)])
