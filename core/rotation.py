"""Attitude as a direction cosine matrix, a rotation vector or a quaternion, and how each changes in time.

C_{A2}^{A1} maps A2 coordinates to A1 coordinates; A2 is A1 turned right-handedly by the rotation vector p.  Seen the
other way, C turns a vector actively by p within A1.  Angles in radians, rates in rad/s, quaternions scalar first.
"""

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.quaternion import (
    dcm_from_quaternion,
    quaternion_conjugate,
    quaternion_from_dcm,
    quaternion_from_rotation_vector,
    quaternion_product,
    rotation_angle,
    rotation_matrix,
    rotation_vector_from_quaternion,
    sine_ratio,
)
from core.types import Array

__all__ = [
    "GAMMA_SERIES_BELOW",
    "bortz_coefficient",
    "chain",
    "compose",
    "dcm_from_quaternion",
    "dcm_from_rotation_vector",
    "dcm_rate",
    "principal",
    "quaternion_conjugate",
    "quaternion_from_dcm",
    "quaternion_from_rotation_vector",
    "quaternion_product",
    "rotation_angle",
    "rotation_sequence",
    "rotation_vector_from_dcm",
    "rotation_vector_from_quaternion",
    "rotation_vector_rate",
    "shadow",
    "skew",
]

GAMMA_SERIES_BELOW = 0.4        # rad; there seven terms of the series and the closed form agree to 1e-15
_GAMMA_SERIES = (1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000, 1 / 74724249600)


def skew(a: ArrayLike) -> Array:
    """(a x) = [[0, -a_z, a_y], [a_z, 0, -a_x], [-a_y, a_x, 0]], so that (a x) b = a x b.

    a (..., 3) -> (..., 3, 3) in the units of a.  ValueError for a wrong shape or a non-finite entry.  MAT (1.16).

    >>> skew([1, 2, 3]).tolist()
    [[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]]
    """
    a = finite("a", a, 3)
    S = np.zeros((*a.shape, 3))
    S[..., 2, 1], S[..., 0, 2], S[..., 1, 0] = a[..., 0], a[..., 1], a[..., 2]
    S[..., 1, 2], S[..., 2, 0], S[..., 0, 1] = 0.0 - a[..., 0], 0.0 - a[..., 1], 0.0 - a[..., 2]
    return S


def dcm_from_rotation_vector(p: ArrayLike) -> Array:
    """C = I + sin p / p (p x) + (1 - cos p) / p^2 (p x)(p x).

    p (..., 3) in rad, the same coordinates in A1 and A2 -> C_{A2}^{A1} (..., 3, 3), which maps A2 coordinates to A1
    coordinates.  The transpose belongs to -p.  Exact limit I at p = 0.  ValueError for a wrong shape or a non-finite
    entry.  MAT (1.17).

    >>> dcm_from_rotation_vector([0.0, 0.0, np.pi / 2]).round(12).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    angle = rotation_angle(p)
    S = skew(p)
    first = sine_ratio(angle)
    second = 0.5 * np.square(sine_ratio(0.5 * angle))     # = (1 - cos p) / p^2 without its cancellation
    return np.eye(3) + first[..., None, None] * S + second[..., None, None] * (S @ S)      # (1.17)


def rotation_vector_from_dcm(C: ArrayLike) -> Array:
    """p with |p| <= pi and C_{A2}^{A1}(p) = C, through the quaternion.

    C (..., 3, 3) a rotation matrix -> p (..., 3) in rad; relative accuracy near 0, absolute 1e-15 near pi, where p
    and -p are the same rotation.  ValueError unless C'C = I within 1e-6 and det C > 0.  Inverse of MAT (1.17).

    >>> rotation_vector_from_dcm(dcm_from_rotation_vector([0.3, -0.2, 0.5])).round(12).tolist()
    [0.3, -0.2, 0.5]
    """
    return rotation_vector_from_quaternion(quaternion_from_dcm(C))


def chain(*matrices: ArrayLike) -> Array:
    """C_A^D = C_B^D C_A^B, for any number of links.

    matrices (..., 3, 3), outermost frame first, broadcast against each other.  Rotating frame by frame:
    chain(C_{A2}^{A1}, C_{A3}^{A2}) is C_{A3}^{A1}.  ValueError unless each is a rotation matrix.  MAT (1.14).

    >>> half_turn = dcm_from_rotation_vector([0.0, np.pi, 0.0])
    >>> bool(np.allclose(chain(half_turn, half_turn), np.eye(3)))
    True
    """
    C = np.eye(3)
    for matrix in matrices:
        C = C @ rotation_matrix(matrix)
    return C


def compose(p1: ArrayLike, p2: ArrayLike) -> Array:
    """Rotation vector of C(p1) C(p2): first p1, then p2 about the axes already turned.

    p1, p2 (..., 3) in rad, broadcast -> (..., 3) with length at most pi.  Not p1 + p2, unless the axes are parallel.
    ValueError for a wrong shape or a non-finite entry.  MAT (1.14), exercise 1.16.

    >>> compose([0.0, 0.0, 0.1], [0.0, 0.0, 0.2]).round(12).tolist()
    [0.0, 0.0, 0.3]
    """
    product = quaternion_product(quaternion_from_rotation_vector(p1), quaternion_from_rotation_vector(p2))
    return rotation_vector_from_quaternion(product)


def rotation_sequence(axes: str, angles_rad: ArrayLike, *, intrinsic: bool = True) -> Array:
    """C_0 = I,  C_k = C_{k-1} R_k about the turned axes (intrinsic),  C_k = R_k C_{k-1} about the fixed axes.

    axes: k letters of "xyz"; angles_rad (..., k) -> (..., k+1, 3, 3), the attitude before the first and after every
    turn, each mapping body to original coordinates.  ValueError for an unknown letter or a wrong number of angles.
    MAT exercise 1.20.

    >>> phone = rotation_sequence("yxy", np.radians([-90.0, 90.0, 90.0]))
    >>> phone[-1].round(12).astype(int).tolist()
    [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    """
    if not set(axes) <= set("xyz"):
        raise ValueError(f"axes: expected letters x, y, z, got {axes!r}")
    angles = finite("angles_rad", angles_rad, len(axes))
    attitudes = [np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))]
    for k, axis in enumerate(axes):
        R = dcm_from_rotation_vector(angles[..., k, None] * np.eye(3)["xyz".index(axis)])
        attitudes.append(attitudes[-1] @ R if intrinsic else R @ attitudes[-1])
    return np.stack(attitudes, axis=-3)


def dcm_rate(C: ArrayLike, w: ArrayLike) -> Array:
    """dC/dt = C (w x).

    C = C_{A2}^{A1} (..., 3, 3); w (..., 3) the angular velocity of A2 relative to A1 in A2 coordinates (what a gyro
    triad fixed to A2 measures), rad/s -> (..., 3, 3) in 1/s.  ValueError unless C is a rotation matrix.  MAT (1.21).

    >>> dcm_rate(np.eye(3), [0.0, 0.0, 2.0]).tolist()
    [[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """
    return rotation_matrix(C) @ skew(w)


def bortz_coefficient(angle_rad: ArrayLike) -> Array:
    """gamma(p) = (1 - p sin p / (2 (1 - cos p))) / p^2 = (1 - (p/2) cot(p/2)) / p^2.

    angle_rad (...) in rad -> (...), in 1/rad^2.  gamma(0) = 1/12, gamma(pi) = 1/pi^2, poles at 2 pi, 4 pi, ...  Below
    0.4 rad its series 1/12 + p^2/720 + p^4/30240 + ... avoids the cancellation.  ValueError within 1e-9 rad of a
    pole.  MAT (1.26).

    >>> float(bortz_coefficient(0.0)) == 1 / 12
    True
    """
    p = np.abs(finite("angle_rad", angle_rad))
    series = p < GAMMA_SERIES_BELOW
    half = 0.5 * np.where(series, 1.0, p)
    sine = np.sin(half)
    if np.abs(sine).min(initial=1.0) < 5e-10:
        raise ValueError("angle_rad: expected no multiple of 2 pi other than 0, where (1.26) has a pole; use shadow(p)")
    small = np.where(series, p, 0.0)
    near = np.polynomial.polynomial.polyval(np.square(small), _GAMMA_SERIES)
    return np.where(series, near, (1.0 - half * np.cos(half) / sine) / np.square(2.0 * half))


def rotation_vector_rate(p: ArrayLike, w: ArrayLike) -> Array:
    """dp/dt = w + p x w / 2 + gamma(p) p x (p x w),  gamma(p) = (1 - p sin p / (2 (1 - cos p))) / p^2.

    p (..., 3) the rotation vector of the body in rad, w (..., 3) its angular velocity in body coordinates in rad/s,
    broadcast -> (..., 3) in rad/s.  Bortz equation; for p parallel to w it is dp/dt = w.  ValueError at |p| = 2 pi,
    4 pi, ..., where it has a pole: change to the shadow vector beyond pi.  MAT (1.26).

    >>> rotation_vector_rate([0.0, 0.0, 3.0], [0.0, 0.0, 0.5]).tolist()
    [0.0, 0.0, 0.5]
    """
    gamma = bortz_coefficient(rotation_angle(p))
    P, w = skew(p), finite("w", w, 3)
    pw = np.matvec(P, w)
    return w + 0.5 * pw + gamma[..., None] * np.matvec(P, pw)                              # (1.26)


def shadow(p: ArrayLike) -> Array:
    """p (1 - 2 pi / |p|): the same rotation, the other way round.

    p (..., 3) in rad, not zero -> (..., 3) of length | |p| - 2 pi |.  Its rate is again (1.26).  ValueError at p = 0,
    which has a whole sphere of shadows.

    >>> (shadow([0.0, 0.0, 1.5 * np.pi]) / np.pi).round(12).tolist()
    [0.0, 0.0, -0.5]
    """
    angle = rotation_angle(p)
    if np.any(angle == 0.0):
        raise ValueError("rotation vector: expected a nonzero vector, got 0, whose shadow has no direction")
    factor = (angle - 2.0 * np.pi) / angle                # the difference first: exact near 2 pi
    return factor[..., None] * np.asarray(p, dtype=np.float64) + 0.0


def principal(p: ArrayLike) -> Array:
    """p (1 - 2 pi k / |p|) with the whole number k that makes it shortest: length at most pi.

    p (..., 3) in rad -> (..., 3).  Unchanged up to |p| = pi, the shadow vector from there to 3 pi.  ValueError for a
    wrong shape or a non-finite entry.

    >>> principal([0.0, 0.0, 0.5]).tolist()
    [0.0, 0.0, 0.5]
    """
    angle = rotation_angle(p)
    turns = np.ceil(angle / (2.0 * np.pi) - 0.5)
    factor = np.where(turns > 0.0, (angle - 2.0 * np.pi * turns) / np.where(turns > 0.0, angle, 1.0), 1.0)
    return factor[..., None] * np.asarray(p, dtype=np.float64)
