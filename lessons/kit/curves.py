"""Curves in the plane: level lines of sensors, their tangents, and what of a line lies in a box."""

import numpy as np

from core.sensors import Bearing, RangeDifference
from core.types import Array, Sensor

POINTS = 361


def level_line(sensor: Sensor, row: int, value: float, reach: float) -> Array:
    """Points (POINTS, 2) with h_row(x) = value, up to about `reach` from the station; (0, 2) where there are none."""
    s = np.asarray(sensor.stations_m)
    if isinstance(sensor, Bearing):
        return s[row] + np.linspace(0.0, reach, POINTS)[:, None] * [np.sin(value), np.cos(value)]
    if isinstance(sensor, RangeDifference):
        return _hyperbola(s[0], s[row + 1], value, reach)
    if value <= 0.0:
        return np.zeros((0, 2))
    t = np.linspace(0.0, 2.0 * np.pi, POINTS)
    return s[row] + value * np.column_stack([np.cos(t), np.sin(t)])


def _hyperbola(s1: Array, s2: Array, difference: float, reach: float) -> Array:
    """|x - s1| - |x - s2| = difference: the branch (a cosh t, b sinh t) in axes along and across the baseline."""
    along = s2 - s1
    d = float(np.linalg.norm(along))
    a, c = 0.5 * difference, 0.5 * d
    if abs(a) >= c:
        return np.zeros((0, 2))
    b = np.sqrt(c * c - a * a)
    t = np.linspace(-1.0, 1.0, POINTS) * np.arcsinh(reach / b)
    e = along / d
    return 0.5 * (s1 + s2) + a * np.cosh(t)[:, None] * e + b * np.sinh(t)[:, None] * [-e[1], e[0]]


def tangent_line(x: Array, missing: float, slope: Array, reach: float) -> Array:
    """The straight line slope' (z - x) = missing as two points (2, 2); (0, 2) where the slope is zero."""
    size = float(slope @ slope)
    if size < 1e-18:
        return np.zeros((0, 2))
    foot = x + missing * slope / size
    along = np.array([-slope[1], slope[0]]) / np.sqrt(size)
    return np.array([foot - reach * along, foot + reach * along])


def square(centre: Array, half: float) -> Array:
    """The box (2, 2) of the points within `half` of the centre in both coordinates."""
    return np.array([centre - half, centre + half])


def clipped(points: Array, box: Array) -> Array:
    """The pieces (n, 2, 2) of a polyline that lie in the box (2, 2), cut at its walls."""
    if len(points) < 2:
        return np.zeros((0, 2, 2))
    start, step = points[:-1], np.diff(points, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        walls = np.sort((box[:, None] - start) / step, axis=0)                 # (2, n, 2) shares of the step
    inside = (start >= box[0]) & (start <= box[1])
    walls[0] = np.where(step == 0.0, np.where(inside, -np.inf, np.inf), walls[0])
    walls[1] = np.where(step == 0.0, np.where(inside, np.inf, -np.inf), walls[1])
    enter, leave = np.maximum(walls[0].max(axis=1), 0.0), np.minimum(walls[1].min(axis=1), 1.0)
    seen = enter < leave
    ends = np.stack([enter, leave], axis=1)[seen]
    return start[seen][:, None] + ends[..., None] * step[seen][:, None]
