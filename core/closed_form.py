"""Positions in closed form: every solution at once, without an initial guess.  MAT 2.2, Example 15, exercise 2.8."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.types import Array

_EPS = np.finfo(np.float64).eps
_SINGULAR = 1e-8                                          # a column this nearly dependent asks for another origin
_FAR = 1e10                                               # a root this many station distances away is at infinity
_OUTER_SPACE_M = 1e7                                      # satellites beyond this are taken to circle the Earth


class ClosedForm(NamedTuple):
    """Both solutions of a lambda^2 + b lambda + c = 0 and what became of them.

    roots (..., 2, k): x = p lambda + q for both lambda, the smaller |lambda| first; NaN where there is no such root.
    admissible (..., 2): the root exists and passes both tests.  residual_norms (..., 2): |h(x) - y| of the unsquared
    equations.  residuals (..., 2, m).  sign_ok and radius_ok (..., 2): the two tests.  lambdas (..., 2); p, q
    (..., k); quadratic (..., 3): a, b, c.  middle (..., k): p lambda + q at lambda = -b / 2a, half-way between the
    roots, also where they are complex: a start for iterations.  origin (..., n): the point from which lambda, p, q
    are reckoned, zero unless the stations' plane passes through zero.
    """

    roots: Array
    admissible: Array
    residual_norms: Array
    residuals: Array
    sign_ok: Array
    radius_ok: Array
    lambdas: Array
    p: Array
    q: Array
    quadratic: Array
    middle: Array
    origin: Array

    @property
    def best(self) -> Array:
        """The admissible root with the smaller residual norm, (..., k); NaN where none is admissible."""
        norms = np.where(self.admissible, self.residual_norms, np.inf)
        index = norms.argmin(axis=-1)[..., None, None]
        chosen = np.take_along_axis(self.roots, index, axis=-2)[..., 0, :]
        return np.where(self.admissible.any(axis=-1, keepdims=True), chosen, np.nan)


def bancroft(satellites_m: ArrayLike, pseudoranges_m: ArrayLike, *, max_radius_m: float | None = None) -> ClosedForm:
    """|s_i - x| + b = y_i:  2 s_i'x - 2 y_i b = lambda + |s_i|^2 - y_i^2,  lambda = |x|^2 - b^2.

    satellites_m (..., m, n) and pseudoranges_m (..., m), m >= n + 1, in any one frame, broadcast -> roots (..., 2,
    n + 1): position and clock bias, in metres.  [x; b] = p lambda + q with p = A^+ 1, q = A^+ (|s|^2 - y^2) by least
    squares, and one quadratic for lambda.  A root is admissible if y_i - b >= 0 for all i (else it solves only the
    squared equations) and |x| <= max_radius_m.  That limit is, if not given, the nearest satellite's distance from
    the origin when all satellites of space are beyond 10,000 km (Earth-centred axes), and infinite otherwise.
    Complex roots (noise): NaN and not admissible.  ValueError for fewer than n + 1 satellites, satellites in one
    point or (n > 2) on one line, or NaN.  MAT Example 15, (2.2); both tests are needed (erratum M29).

    >>> stations = [[0.0, 0.0], [0.0, 50.0], [80.0, 0.0], [70.0, 90.0]]
    >>> y = np.hypot(*(np.array(stations) - [30.0, 40.0]).T) + 5.0
    >>> bancroft(stations, y).best.round(6)
    array([30., 40.,  5.])
    """
    s, y = _checked("satellites", satellites_m, "pseudoranges_m", pseudoranges_m, 1)
    n = s.shape[-1]
    limit = _radius(s) if max_radius_m is None else _limit(max_radius_m)
    return _solve(s, y, np.append(np.ones(n), -1.0), limit)


def multilaterate(stations_m: ArrayLike, ranges_m: ArrayLike, *, max_radius_m: float | None = None) -> ClosedForm:
    """|s_i - x| = y_i:  2 s_i'x = lambda + |s_i|^2 - y_i^2,  lambda = |x|^2.

    stations_m (..., m, n) and ranges_m (..., m), m >= n, broadcast -> roots (..., 2, n) in metres.  With m = n the
    roots are mirror images in the stations' line or plane, and both solve the equations if no range is negative;
    with more ranges choose by the residual norms (`best`).  max_radius_m: largest |x| of an admissible root, no limit
    if not given.  Circles that do not meet: complex roots, NaN and not admissible.  ValueError for fewer than n
    stations, stations in one point or (n > 2) on one line, or NaN.  MAT exercise 2.8.

    >>> multilaterate([[100.0, 0.0], [0.0, 50.0]], [108.0, 46.0]).roots.round(6)
    array([[-7.898415,  4.68317 ],
           [31.514415, 83.50883 ]])
    """
    s, y = _checked("stations", stations_m, "ranges_m", ranges_m, 0)
    limit = np.array(np.inf) if max_radius_m is None else _limit(max_radius_m)
    return _solve(s, y, np.ones(s.shape[-1]), limit)


def _solve(s: Array, y: Array, signature: Array, limit: Array) -> ClosedForm:
    """s (..., m, n), y (..., m), broadcast; signature (k,): the signs in lambda = sum sign_j x_j^2."""
    n, clock = s.shape[-1], len(signature) > s.shape[-1]
    size = np.abs(s).max(axis=(-2, -1))
    size = np.where(size > 0.0, size, 1.0)[..., None]     # unit of length: numbers near 1 keep the columns alike
    s1, y1 = s / size[..., None], y / size
    Q, R, bad = _factor(s1, y1, clock)
    origin = np.zeros((*bad.shape, n))
    if bad.any():                                         # a line or plane through the origin: step off it
        center = s1.mean(axis=-2)
        spread, normals = np.linalg.svd(s1 - center[..., None, :], full_matrices=True)[1:]
        height = np.sqrt(np.square(spread).sum(axis=-1, keepdims=True))
        off = center + np.where(height > 0.0, height, 1.0) * normals[..., -1, :]
        origin = np.where(bad[..., None], off, origin)
        s1 = s1 - origin[..., None, :]
        Q, R, bad = _factor(s1, y1, clock)
        if bad.any():
            raise ValueError(
                f"expected stations that are not in one point{' or on one line' if n > 2 else ''}, got positions and "
                f"measurements whose equations have a rank below {len(signature)}"
            )
    squares = np.square(s1).sum(axis=-1) - np.square(y1)
    right = np.stack([np.ones(squares.shape), squares], axis=-1)
    p, q = np.moveaxis(np.linalg.solve(R, Q.mT @ right), -1, 0)                       # p = A^+ 1, q = A^+ (...)
    a = np.vecdot(signature * p, p)
    b = 2.0 * np.vecdot(signature * p, q) - 1.0
    c = np.vecdot(signature * q, q)
    lambdas = _quadratic(a, b, c, np.abs(p).max(axis=-1))                             # (2.2)
    solutions = p[..., None, :] * lambdas[..., None] + q[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = p * (-0.5 * b / a)[..., None] + q
    origin = np.broadcast_to(origin, (*b.shape, n))
    shift = np.concatenate([origin, np.zeros((*b.shape, len(signature) - n))], axis=-1)
    roots = (solutions + shift[..., None, :]) * size[..., None]
    x, bias = roots[..., :n], roots[..., n:] if clock else 0.0
    distances = np.sqrt(np.square(s[..., None, :, :] - x[..., None, :]).sum(axis=-1))
    residuals = distances + bias - y[..., None, :]
    exists = np.isfinite(roots).all(axis=-1)
    sign_ok = exists & (y[..., None, :] >= bias).all(axis=-1)
    radius_ok = exists & (np.sqrt(np.square(x).sum(axis=-1)) <= limit[..., None])
    unit, p = size[..., 0], np.broadcast_to(p, q.shape)
    return ClosedForm(
        roots, sign_ok & radius_ok, np.sqrt(np.square(residuals).sum(axis=-1)), residuals, sign_ok, radius_ok,
        lambdas * size**2, p / size, q * size, np.stack(np.broadcast_arrays(a / unit**2, b, c * unit**2), axis=-1),
        np.where(np.isfinite(middle), middle + shift, np.nan) * size, origin * size,
    )


def _factor(s: Array, y: Array, clock: bool) -> tuple[Array, Array, Array]:
    """A = Q R for the rows [2 s_i', -2 y_i], and where its columns are (nearly) dependent."""
    A = 2.0 * s
    if clock:
        batch = np.broadcast_shapes(s.shape[:-2], y.shape[:-1])
        parts = [np.broadcast_to(a, (*batch, *a.shape[-2:])) for a in (A, -2.0 * y[..., None])]
        A = np.concatenate(parts, axis=-1)
    Q, R = np.linalg.qr(A)
    new = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    bad = (new <= _SINGULAR * np.sqrt(np.square(A).sum(axis=-2))).any(axis=-1)
    return Q, np.where(bad[..., None, None], np.eye(R.shape[-1]), R), bad


def _quadratic(a: Array, b: Array, c: Array, p: Array) -> Array:
    """The real roots (..., 2) of a l^2 + b l + c, the smaller first and without cancellation; NaN for the others."""
    discriminant = b * b - 4.0 * a * c
    rounding = 64.0 * _EPS * (b * b + 4.0 * np.abs(a * c))
    real = discriminant >= -rounding
    t = -0.5 * (b + np.where(b < 0.0, -1.0, 1.0) * np.sqrt(np.maximum(discriminant, 0.0)))
    near_exists = real & ((t != 0.0) | ((a != 0.0) & (c == 0.0)))
    far_exists = real & (np.abs(t) * p < _FAR * np.abs(a))
    near = np.where(t != 0.0, c / np.where(t != 0.0, t, 1.0), 0.0)
    far = t / np.where(far_exists, a, 1.0)
    return np.stack([np.where(near_exists, near, np.nan), np.where(far_exists, far, np.nan)], axis=-1)


def _checked(kind: str, stations: ArrayLike, name: str, measured: ArrayLike, extra: int) -> tuple[Array, Array]:
    s = finite(f"{kind}_m", stations, None, None)
    m, n = s.shape[-2:]
    if n < 1 or m < n + extra:
        raise ValueError(f"{kind}_m: expected at least {n + extra} {kind} in {n} dimensions, got {m}")
    y = finite(name, measured, m)
    try:
        np.broadcast_shapes(s.shape[:-2], y.shape[:-1])
    except ValueError:
        raise ValueError(f"{name}: expected batch axes that fit {s.shape}, got {y.shape}") from None
    return s, y


def _limit(max_radius_m: float) -> Array:
    if not max_radius_m > 0.0:
        raise ValueError(f"max_radius_m: expected a positive number, got {max_radius_m}")
    return np.array(float(max_radius_m))


def _radius(s: Array) -> Array:
    """The nearest satellite's distance from the origin if the satellites surround the Earth, else infinity."""
    nearest = np.sqrt(np.square(s).sum(axis=-1).min(axis=-1))
    return np.where(nearest > _OUTER_SPACE_M, nearest, np.inf) if s.shape[-1] == 3 else np.full(s.shape[:-2], np.inf)
