"""A rectangle of a plane scene with axes of its own: several little plots, or plots beside a picture, in one scene."""

import math
from dataclasses import dataclass

import numpy as np

from core.gaussian import affine
from core.types import Array, Gaussian
from lessons.kit.scene import Item, Label, Polyline, Segments


@dataclass(frozen=True, slots=True)
class Panel:
    """A rectangle of the scene with axes of its own: low and high are data, corner and size are scene units."""

    low: Array
    high: Array
    corner: Array
    size: Array

    @property
    def scale(self) -> Array:
        """Scene units per unit of the data."""
        return self.size / (self.high - self.low)

    def place(self, points: Array) -> Array:
        """Data (..., 2) to the scene."""
        return self.corner + (points - self.low) * self.scale

    def law(self, g: Gaussian) -> Gaussian:
        """A law of the data as a law in the scene."""
        return affine(g, np.diag(self.scale), self.corner - self.low * self.scale)

    def inside(self, points: Array) -> Array:
        """Which data points (..., 2) lie in the panel."""
        return ((points >= self.low) & (points <= self.high)).all(axis=-1)

    def exit(self, start: Array, end: Array) -> Array:
        """Where the segment from `start`, inside, to `end` leaves the panel; `end` if it does not."""
        d = np.asarray(end, dtype=np.float64) - start
        walls = np.where(d > 0, self.high, self.low)
        shares = np.divide(walls - start, d, out=np.ones(2), where=d != 0)
        return start + min(1.0, float(shares.min())) * d

    def axes(self, name: str, titles: tuple[str, str, str], pixel: float) -> list[Item]:
        """Frame, grid, numbers and titles."""
        (x0, y0), (x1, y1) = self.corner, self.corner + self.size
        tx, ty = (ticks(low, high) for low, high in zip(self.low, self.high, strict=True))
        at_x = self.place(np.column_stack([tx, np.full(len(tx), self.low[1])]))[:, 0]
        at_y = self.place(np.column_stack([np.full(len(ty), self.low[0]), ty]))[:, 1]
        grid = [((x, y0), (x, y1)) for x in at_x] + [((x0, y), (x1, y)) for y in at_y]
        pad = 9.0 * pixel
        return [
            Segments(f"{name}_grid", np.array(grid), role="muted", width=1.0, fade=0.65),
            Polyline(f"{name}_frame", [(x0, y0), (x1, y0), (x1, y1), (x0, y1)], role="muted", width=1.8, closed=True),
            *(Label(f"{name}_x{i}", text, (x, y0 - pad), 0.9, "top")
              for i, (x, text) in enumerate(zip(at_x, _numbers(tx), strict=True))),
            *(Label(f"{name}_y{i}", text, (x0 - pad, y), 0.9, "right")
              for i, (y, text) in enumerate(zip(at_y, _numbers(ty), strict=True))),
            Label(f"{name}_x_title", titles[1], (0.5 * (x0 + x1), y0 - 3.6 * pad), 1.0, "top"),
            Label(f"{name}_y_title", titles[2], (x0, y1 + pad), 1.0, "bottom"),
            Label(f"{name}_title", titles[0], (0.5 * (x0 + x1), y1 + 4.2 * pad), 1.1, "bottom"),
        ]


def ticks(low: float, high: float) -> Array:
    """Two to four round numbers (1, 2 or 5 times a power of ten apart) from low to high.

    >>> ticks(-60.0, 60.0)
    array([-50.,   0.,  50.])
    """
    step = nice_step((high - low) / 4.0)
    found = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step + 0.0
    return found if len(found) else np.array([0.5 * (low + high)])


def nice_step(length: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below `length`."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= 0.999 * length)


def _numbers(values: Array) -> list[str]:
    step = abs(values[1] - values[0]) if len(values) > 1 else 1.0
    size = np.abs(values).max()
    if size >= 1e5 or step < 1e-3:
        return [f"{v:.3g}".replace("-", "−") for v in values]
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return [f"{v:.{digits}f}".replace("-", "−") for v in values]
