"""Where the unscented transform's two plots stand in one scene: what goes into the map, and what comes out.

The panel that holds the plane of positions lies at its true coordinates, because handles are dragged there; the other
one is scaled to stand above it or at its right.  The flow is downwards or from left to right.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from core.types import Array, Gaussian
from lessons.kit.panels import Panel, nice_step
from lessons.kit.scene import Plane

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
    step = nice_step(max(float((high - low).max()), 1e-9) / 8.0)
    return np.array([np.floor(low / step - 0.2), np.ceil(high / step + 0.2)]) * step


def _at_least(low: Array, high: Array, share: float) -> tuple[Array, Array]:
    """Both sides at least `share` of the longer one, about the same centre."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    half = np.maximum(half, share * half.max())
    return middle - half, middle + half
