"""Two little plots side by side in one scene: what goes into the map, and what comes out.

The panel that holds the plane of positions lies at its true coordinates, because handles are dragged there; the other
one is scaled to stand above it or at its right.  The flow is downwards or from left to right.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import affine
from core.types import Array, Gaussian
from lessons.kit.scene import Item, Label, Plane, Polyline, Segments

if TYPE_CHECKING:
    from lessons.filtering.unscented import Params, Result

RADIUS_68 = 1.51         # half-axes of the 68 % ellipse in standard deviations
SIDES = 3.6              # standard deviations that the panel of the polar prior shows to each side

TITLES = {               # title, x axis, y axis of the input and of the image
    "polar": (("prior: range and bearing", "range r (m)", "bearing θ (°)"), ("image: position", "x (m)", "y (m)")),
    "two_ranges": (("prior: position", "x (m)", "y (m)"),
                   ("image: two ranges", "to station 1 (m)", "to station 2 (m)")),
    "polynomial": (("prior", "x₁ (m)", "x₂ (m)"), ("image: powers", "y₁ (m)", "y₂ (m)")),
}


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


@dataclass(frozen=True, slots=True)
class Layout:
    """Both panels, the length of a pixel in scene units, and the camera that shows it all."""

    source: Panel
    image: Panel
    pixel: float
    camera: Plane


def layout(p: "Params", r: "Result") -> Layout:
    """The plane of positions keeps its place: it is the image, below the prior (polar), or the prior, at the left."""
    prior_box = _box(r.prior, SIDES)
    images = _hull(np.quantile(r.cloud_images, (0.04, 0.96), axis=0), r.ut.images,
                   *(_box(g, RADIUS_68) for g in (r.linear, r.sampled, Gaussian(r.ut.mean, r.ut.cov))))
    if p.map == "polar":
        low, high = _at_least(*_rounded(*images), 0.4)
        side = max(high[0] - low[0], 1.1 * (high[1] - low[1]))
        size = side * np.array([0.56, 0.44])
        image = Panel(low, high, low, high - low)
        source = Panel(*prior_box, np.array([0.5 * (low[0] + high[0] - size[0]), high[1] + 0.22 * side]), size)
    else:
        stations = [p.station_1, p.station_2] if p.map == "two_ranges" else []
        low, high = _at_least(*_rounded(*_hull(prior_box, stations)), 0.45)
        side = max(high[1] - low[1], 0.75 * (high[0] - low[0]))
        spread = 0.06 * (images[1] - images[0])
        inner = images[0] - spread, images[1] + spread
        if p.map == "two_ranges":                         # both axes are ranges: one scale
            inner = _at_least(*inner, 1.0)
        source = Panel(low, high, low, high - low)
        image = Panel(*inner, np.array([high[0] + 0.24 * side, low[1] + 0.5 * (high[1] - low[1] - side)]),
                      np.array([side, side]))
    (x0, y0), (x1, y1) = _hull(*((panel.corner, panel.corner + panel.size) for panel in (source, image)))
    pixel = max((y1 - y0) / 760.0, (x1 - x0) / 1100.0)
    camera = Plane((x0 - 62.0 * pixel, x1 + 20.0 * pixel), (y0 - 60.0 * pixel, y1 + 72.0 * pixel), axes=False)
    return Layout(source, image, pixel, camera)


def ticks(low: float, high: float) -> Array:
    """Two to four round numbers (1, 2 or 5 times a power of ten apart) from low to high.

    >>> ticks(-60.0, 60.0)
    array([-50.,   0.,  50.])
    """
    step = _nice((high - low) / 4.0)
    found = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step + 0.0
    return found if len(found) else np.array([0.5 * (low + high)])


def _nice(length: float) -> float:
    power = 10.0 ** math.floor(math.log10(length))
    return next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= 0.999 * length)


def _numbers(values: Array) -> list[str]:
    step = abs(values[1] - values[0]) if len(values) > 1 else 1.0
    size = np.abs(values).max()
    if size >= 1e5 or step < 1e-3:
        return [f"{v:.3g}".replace("-", "−") for v in values]
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return [f"{v:.{digits}f}".replace("-", "−") for v in values]


def _box(g: Gaussian, radius: float) -> Array:
    """Corners (2, 2) of the box that reaches `radius` standard deviations to each side of the mean."""
    half = radius * np.sqrt(np.maximum(np.diagonal(g.cov), 0.0))
    return np.array([g.mean - half, g.mean + half])


def _hull(*boxes: Iterable) -> Array:
    """Corners (2, 2) of the smallest box round all points."""
    points = np.concatenate([np.reshape(np.asarray(b, dtype=np.float64), (-1, 2)) for b in boxes if len(b)])
    return np.array([points.min(axis=0), points.max(axis=0)])


def _rounded(low: Array, high: Array) -> Array:
    """Outwards to round numbers, so that the picture stands still during small moves."""
    step = _nice(max(float((high - low).max()), 1e-9) / 8.0)
    return np.array([np.floor(low / step - 0.2), np.ceil(high / step + 0.2)]) * step


def _at_least(low: Array, high: Array, share: float) -> tuple[Array, Array]:
    """Both sides at least `share` of the longer one, about the same centre."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    half = np.maximum(half, share * half.max())
    return middle - half, middle + half
