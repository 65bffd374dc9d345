"""Where h(x) has a given value: curves in the plane, patches S(u, v) of surfaces in space."""

from collections.abc import Callable

import numpy as np

from core.types import Array
from lessons.kit.curves import level_line
from lessons.static._surfaces_model import Row

CURVE = 361
U, V = 33, 65                                # grid of a patch
Patch = Callable[[Array, Array], Array]      # shares u, v in [0, 1] -> points (..., 3)


def curve(row: Row, value: float, box: Array) -> list[Array]:
    """Pieces (k, 2) of {h = value} in the plane, a little beyond the box (2, 2); none where there is no such place."""
    reach = 2.0 * float(np.linalg.norm(np.ptp(np.vstack([box, row.stations]), axis=0)))
    match row.kind:
        case "x1":
            return [np.array([(value, box[0, 1]), (value, box[1, 1])])]
        case "x2":
            return [np.array([(box[0, 0], value), (box[1, 0], value)])]
        case "rate":
            return [row.stations[0] + np.linspace(0.0, reach, CURVE)[:, None] * way for way in _ways(row, value)]
        case _:
            line = level_line(row.sensor, 0, value, reach)
            return [line] if len(line) else []


def _ways(row: Row, value: float) -> list[Array]:
    """Unit vectors from the antenna along which the rate has this value: at equal angles to the relative velocity."""
    w = row.sensor.velocity_mps - row.sensor.rate.velocities_mps[0]
    speed = float(np.linalg.norm(w))
    if abs(value) > speed or speed == 0.0:
        return []
    c = value / speed
    s = np.sqrt(1.0 - c * c)
    e = w / speed
    side = np.array([-e[1], e[0]])
    return [c * e + s * side, c * e - s * side]


def patch(row: Row, value: float, box: Array) -> Patch | None:
    """The part of {h = value} that is drawn in the box (2, 3); None where there is no such place."""
    low, high = box
    reach = float(np.linalg.norm(high - low))
    s = row.stations[0] if len(row.stations) else low
    match row.kind:
        case "x1" | "x2" | "height":
            return _plane(("x1", "x2", "height").index(row.kind), value, low, high)
        case "bearing":
            return _half_plane(s, value, low, high)
        case "difference":
            return _hyperboloid(row.stations, value, reach)
        case "rate":
            return _cone(row, value, reach)
    if value <= 0.0:
        return None

    def sphere(u: Array, v: Array) -> Array:
        up, round_ = np.pi * (u - 0.5), 2.0 * np.pi * v
        return s + value * np.stack([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)], -1)

    return sphere


def _mix(a: float, b: float, share: Array) -> Array:
    return a + (b - a) * share


def _plane(axis: int, value: float, low: Array, high: Array) -> Patch:
    """x_axis = value."""
    i, j = (k for k in range(3) if k != axis)

    def flat(u: Array, v: Array) -> Array:
        x = np.full((*u.shape, 3), value)
        x[..., i], x[..., j] = _mix(low[i], high[i], u), _mix(low[j], high[j], v)
        return x

    return flat


def _half_plane(s: Array, bearing: float, low: Array, high: Array) -> Patch:
    """Upright, from the station in this direction as far as the box reaches."""
    way = np.array([np.sin(bearing), np.cos(bearing)])
    walls = np.where(way > 0.0, high[:2], low[:2]) - s[:2]
    shares = np.divide(walls, way, out=np.full(2, np.inf), where=np.abs(way) > 1e-12)
    length = max(float(shares.min()), 0.1 * float(np.linalg.norm(high - low)))

    def wall(u: Array, v: Array) -> Array:
        return np.stack([s[0] + length * u * way[0], s[1] + length * u * way[1], _mix(low[2], high[2], v)], -1)

    return wall


def _hyperboloid(stations: Array, value: float, reach: float) -> Patch | None:
    """|x - s1| - |x - s2| = value: a cosh t along the baseline, b sinh t away from it, turned about it."""
    along = stations[1] - stations[0]
    length = float(np.linalg.norm(along))
    a, c = 0.5 * value, 0.5 * length
    if abs(a) >= c:
        return None
    b = np.sqrt(c * c - a * a)
    e, e1, e2 = _triad(along / length)
    top = np.arcsinh(0.5 * reach / b)

    def sheet(u: Array, v: Array) -> Array:
        t, turn = top * u, 2.0 * np.pi * v
        away = b * np.sinh(t)
        return (stations.mean(axis=0) + (a * np.cosh(t))[..., None] * e
                + (away * np.cos(turn))[..., None] * e1 + (away * np.sin(turn))[..., None] * e2)

    return sheet


def _cone(row: Row, value: float, reach: float) -> Patch | None:
    """All directions from the antenna at the same angle to the relative velocity."""
    w = row.sensor.velocity_mps - row.sensor.rate.velocities_mps[0]
    speed = float(np.linalg.norm(w))
    if abs(value) > speed or speed == 0.0:
        return None
    c = value / speed
    e, e1, e2 = _triad(w / speed)

    def cone(u: Array, v: Array) -> Array:
        turn = (2.0 * np.pi * v)[..., None]
        return row.stations[0] + 0.5 * reach * u[..., None] * (
            c * e + np.sqrt(1.0 - c * c) * (np.cos(turn) * e1 + np.sin(turn) * e2))

    return cone


def _triad(e: Array) -> tuple[Array, Array, Array]:
    """e and two unit vectors perpendicular to it and to each other."""
    e1 = np.cross(e, np.eye(3)[np.abs(e).argmin()])
    e1 /= np.linalg.norm(e1)
    return e, e1, np.cross(e, e1)


def grid() -> tuple[Array, Array, Array, Array]:
    """Axes u (U,), v (V,) and the mesh (U, V) of both; rows are u."""
    u, v = np.linspace(0.0, 1.0, U), np.linspace(0.0, 1.0, V)
    uu, vv = np.meshgrid(u, v, indexing="ij")
    return u, v, uu, vv
