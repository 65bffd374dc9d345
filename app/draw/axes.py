"""Axes, ticks and grid of a plane view; the faint ground grid of a 3-D view."""

import math

import numpy as np

from app.draw.primitives import Primitive, Style, label, lines
from lessons.kit.scene import Orbit, Plane


def ticks(low: float, high: float, count: int = 7) -> np.ndarray:
    """About `count` round numbers (1, 2 or 5 times a power of ten apart) from low to high.

    >>> ticks(-10.0, 103.0)
    array([  0.,  20.,  40.,  60.,  80., 100.])
    """
    raw = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * m for m in (1, 2, 5, 10) if power * m >= raw * 0.999)
    return np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step + 0.0


def plane_axes(camera: Plane, style: Style) -> list[Primitive]:
    """Grid lines at the ticks, a frame, numbers below and at the left, titles with units."""
    (x0, x1), (y0, y1) = camera.x, camera.y
    span = max(x1 - x0, 1.4 * (y1 - y0))
    tx = ticks(x0, x1, max(2, round(8 * (x1 - x0) / span)))
    ty = ticks(y0, y1, max(2, round(8 * (y1 - y0) / span)))
    depth = -2 * style.pixel
    grid = [((x, y0), (x, y1)) for x in tx] + [((x0, y), (x1, y)) for y in ty]
    frame = [((x0, y0), (x1, y0)), ((x0, y0), (x0, y1))]

    def flat(pairs: list) -> np.ndarray:
        found = np.full((len(pairs), 2, 3), depth)
        found[..., :2] = pairs
        return found

    pad = 8 * style.pixel
    found = [
        lines("axes.grid", flat(grid), style.theme.grid, 1.2, style),
        lines("axes.frame", flat(frame), style.theme.color("muted"), 1.8, style),
    ]
    digits = _digits(tx), _digits(ty)
    found += [label(f"axes.x{i}", _number(x, digits[0]), (x, y0 - pad, 0.0), style, 0.85, "top")
              for i, x in enumerate(tx)]
    found += [label(f"axes.y{i}", _number(y, digits[1]), (x0 - pad, y, 0.0), style, 0.85, "right")
              for i, y in enumerate(ty)]
    found.append(label("axes.x_title", camera.x_label, (0.5 * (x0 + x1), y0 - 4.6 * pad, 0.0), style, 1.0, "top"))
    found.append(label("axes.y_title", camera.y_label, (x0, y1 + 1.5 * pad, 0.0), style, 1.0, "bottom"))
    return found


def ground_grid(camera: Orbit, style: Style) -> list[Primitive]:
    """A faint square grid under the scene."""
    if camera.ground <= 0:
        return []
    half, z = camera.ground, camera.ground_z
    cx, cy, _ = camera.centre
    at = np.linspace(-half, half, 11)
    pairs = np.empty((22, 2, 3))
    pairs[..., 2] = z
    pairs[:11, 0, 0] = pairs[:11, 1, 0] = cx + at
    pairs[:11, 0, 1], pairs[:11, 1, 1] = cy - half, cy + half
    pairs[11:, 0, 1] = pairs[11:, 1, 1] = cy + at
    pairs[11:, 0, 0], pairs[11:, 1, 0] = cx - half, cx + half
    return [lines("ground", pairs, style.theme.grid, 1.2, style)]


def _digits(values: np.ndarray) -> int:
    if len(values) < 2:
        return 2
    return max(0, -math.floor(math.log10(abs(values[1] - values[0])) + 1e-9))


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "\u2212")
