"""Rotations as unit quaternions, scalar first: q = [cos(p/2); sin(p/2) u] for an angle p about the unit axis u.

q and -q are the same rotation.  `core.rotation` re-exports everything here beside the other representations.
"""

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.types import Array

_LARGEST_ANGLE = 1e8            # rad; a double keeps an angle beyond this to no better than 1e-8 rad
_TINY = 1e-4                    # rad; below it sin(x)/x = 1 - x^2/6 to 1e-18


def rotation_angle(p: ArrayLike) -> Array:
    """|p| of a rotation vector.

    p (..., 3) in rad -> (...) in rad.  ValueError for a wrong shape, a non-finite entry or an angle above 1e8 rad.

    >>> float(rotation_angle([0.0, 3.0, 4.0]))
    5.0
    """
    p = finite("rotation vector", p, 3)
    if np.abs(p).max(initial=0.0) > _LARGEST_ANGLE:
        raise ValueError(f"rotation vector: expected at most {_LARGEST_ANGLE:g} rad, got {np.abs(p).max():.3g}")
    return np.sqrt(np.square(p).sum(axis=-1))


def sine_ratio(angle: Array) -> Array:
    """sin(x) / x, with the value 1 at x = 0.

    angle (...) >= 0 in rad.  Two terms of the series below 1e-4 rad, so that x = 0 divides nothing by zero.
    """
    near_zero = angle < _TINY
    safe = np.where(near_zero, 1.0, angle)
    return np.where(near_zero, 1.0 - np.square(angle) / 6.0, np.sin(safe) / safe)


def quaternion_from_rotation_vector(p: ArrayLike) -> Array:
    """q = [cos(p/2); sin(p/2) p/|p|].

    p (..., 3) in rad -> q (..., 4), scalar first, unit length; q_{A2}^{A1} belongs to the matrix C_{A2}^{A1} of
    (1.17).  The scalar part is negative for pi < |p| < 3 pi.  ValueError for a wrong shape or a non-finite entry.
    MAT (1.18).

    >>> quaternion_from_rotation_vector([0.0, 0.0, 0.0])
    array([1., 0., 0., 0.])
    """
    half = 0.5 * rotation_angle(p)
    p = np.asarray(p, dtype=np.float64)
    return np.concatenate([np.cos(half)[..., None], 0.5 * sine_ratio(half)[..., None] * p], axis=-1)   # (1.18)


def rotation_vector_from_quaternion(q: ArrayLike) -> Array:
    """p = 2 atan2(|v|, s) v/|v|  for q = [s; v], s >= 0.

    q (..., 4), scalar first, sign free -> p (..., 3) in rad with |p| <= pi.  At |p| = pi both p and -p are right; the
    sign of v decides.  ValueError unless |q| = 1 within 1e-6.  Inverse of MAT (1.18).

    >>> rotation_vector_from_quaternion([-1.0, 0.0, 0.0, 0.0]).tolist()
    [0.0, 0.0, 0.0]
    """
    q = unit_quaternion(q)
    q = np.where(q[..., :1] < 0.0, -q, q)
    s, v = q[..., 0], q[..., 1:]
    length = np.sqrt(np.square(v).sum(axis=-1))
    near_zero = length < 1e-150                           # squares underflow; there 2 atan2(v, s) = 2 v
    ratio = np.where(near_zero, 2.0, 2.0 * np.arctan2(length, s) / np.where(near_zero, 1.0, length))
    return ratio[..., None] * v + 0.0                     # + 0.0: no negative zeros


def dcm_from_quaternion(q: ArrayLike) -> Array:
    """C = (s^2 - v'v) I + 2 v v' + 2 s (v x)  for q = [s; v].

    q (..., 4), scalar first -> C_{A2}^{A1} (..., 3, 3), which maps A2 coordinates to A1 coordinates.  ValueError
    unless |q| = 1 within 1e-6.  MAT (1.17) with (1.18).

    >>> dcm_from_quaternion([1.0, 0.0, 0.0, 0.0]).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    q = unit_quaternion(q)
    s, (x, y, z) = q[..., 0], np.moveaxis(q[..., 1:], -1, 0)
    C = np.empty((*q.shape[:-1], 3, 3))
    C[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    C[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    C[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    C[..., 0, 1], C[..., 1, 0] = 2.0 * (x * y - s * z), 2.0 * (x * y + s * z)
    C[..., 0, 2], C[..., 2, 0] = 2.0 * (x * z + s * y), 2.0 * (x * z - s * y)
    C[..., 1, 2], C[..., 2, 1] = 2.0 * (y * z - s * x), 2.0 * (y * z + s * x)
    return C


def quaternion_from_dcm(C: ArrayLike) -> Array:
    """4 q q' read off from C; q is its column with the largest diagonal entry, made unit length, s >= 0.

    C (..., 3, 3) a rotation matrix -> q (..., 4), scalar first.  Taking the largest column avoids every division by a
    small number, at 0 and at pi alike.  ValueError unless C'C = I within 1e-6 and det C > 0.

    >>> quaternion_from_dcm([[-1, 0, 0], [0, -1, 0], [0, 0, 1]]).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """
    C = rotation_matrix(C)
    c = {(i, j): C[..., i, j] for i in range(3) for j in range(3)}
    sums = [c[2, 1] - c[1, 2], c[0, 2] - c[2, 0], c[1, 0] - c[0, 1]]              # 4 s v
    outer = np.empty((*C.shape[:-2], 4, 4))
    trace = c[0, 0] + c[1, 1] + c[2, 2]
    outer[..., 0, 0] = 1.0 + trace
    for i in range(3):
        outer[..., 0, i + 1] = outer[..., i + 1, 0] = sums[i]
        for j in range(3):
            outer[..., i + 1, j + 1] = 1.0 - trace + 2.0 * c[i, i] if i == j else c[i, j] + c[j, i]
    largest = np.diagonal(outer, axis1=-2, axis2=-1).argmax(axis=-1)
    q = np.take_along_axis(outer, largest[..., None, None], axis=-1)[..., 0]
    q = q / np.sqrt(np.square(q).sum(axis=-1, keepdims=True))
    return np.where(q[..., :1] < 0.0, -q, q) + 0.0


def quaternion_product(q: ArrayLike, r: ArrayLike) -> Array:
    """q r = [s t - v'w; s w + t v + v x w]  for q = [s; v], r = [t; w].

    q, r (..., 4), scalar first, broadcast against each other.  q_{A3}^{A1} = q_{A2}^{A1} q_{A3}^{A2}, in the same
    order as the matrices of the chain rule.  ValueError for a wrong shape or a non-finite entry.  MAT (1.14).

    >>> quaternion_product([0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]).tolist()     # i j = k
    [0.0, 0.0, 0.0, 1.0]
    """
    q, r = finite("q", q, 4), finite("r", r, 4)
    s, v, t, w = q[..., :1], q[..., 1:], r[..., :1], r[..., 1:]
    return np.concatenate([s * t - (v * w).sum(axis=-1, keepdims=True), s * w + t * v + np.cross(v, w)], axis=-1)


def quaternion_conjugate(q: ArrayLike) -> Array:
    """q* = [s; -v], the inverse of a unit quaternion.

    q (..., 4), scalar first.  q_{A1}^{A2} from q_{A2}^{A1}.  ValueError for a wrong shape or a non-finite entry.

    >>> quaternion_conjugate([0.6, 0.8, 0.0, 0.0]).tolist()
    [0.6, -0.8, 0.0, 0.0]
    """
    return finite("q", q, 4) * np.array([1.0, -1.0, -1.0, -1.0]) + 0.0


def unit_quaternion(q: ArrayLike) -> Array:
    """q / |q|, ValueError unless |q| = 1 within 1e-6: rounding is repaired, a wrong number is not.  q (..., 4)."""
    q = finite("quaternion", q, 4)
    size = np.abs(q).max(initial=0.0)
    norm = np.sqrt(np.square(q).sum(axis=-1, keepdims=True)) if size < 2.0 else np.full((1,), size)
    if np.abs(norm - 1.0).max(initial=0.0) > 1e-6:
        raise ValueError(f"quaternion: expected length 1, got {norm.flat[np.abs(norm - 1.0).argmax()]:.6g}")
    return q / norm


def rotation_matrix(C: ArrayLike) -> Array:
    """C, after checking that C'C = I within 1e-6 and det C > 0.  C (..., 3, 3); ValueError otherwise."""
    C = finite("rotation matrix", C, 3, 3)
    if np.abs(C).max(initial=0.0) > 2.0:
        raise ValueError(f"rotation matrix: expected entries in [-1, 1], got one of size {np.abs(C).max():.3g}")
    error = np.abs(C.mT @ C - np.eye(3)).max(initial=0.0)
    if error > 1e-6:
        raise ValueError(f"rotation matrix: expected orthonormal columns, got C'C different from I by {error:.3g}")
    if np.linalg.det(C).min(initial=1.0) < 0.0:
        raise ValueError("rotation matrix: expected determinant 1, got -1 (a reflection)")
    return C
