"""The kinds of node that the renderer knows, and the style that items are drawn in."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from app.theme import Rgb, Theme
from core.types import Array
from lessons.kit.scene import Camera, Plane

PICTURE_HEIGHT = 900.0  # sizes in the kit are pixels of a picture this high
TEXT_SIZE = 1.2  # of viser's own size, so that the last row of a lecture hall can read it

Kind = Literal["lines", "points", "arrows", "mesh", "label", "image"]


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """One node of the scene: `props` are viser's own names of the properties."""

    name: str
    kind: Kind
    props: dict[str, Any]
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Style:
    """How items are drawn: colours, the length of a pixel in scene units, enlargement for a saved picture.

    lines, text and dots: factors for a saved picture on what viser does not enlarge by itself.
    """

    theme: Theme
    pixel: float
    lines: float = 1.0
    text: float = 1.0
    dots: float = 1.0
    layered: bool = False


def style_for(camera: Camera, theme: Theme, lines: float = 1.0, text: float = 1.0,
              dots: float = 1.0) -> Style:
    """The style of a view: a pixel is 1/900 of the height that the camera must show."""
    if isinstance(camera, Plane):
        height = max(camera.y[1] - camera.y[0], (camera.x[1] - camera.x[0]) / 1.4)
    else:
        height = 2.2 * camera.radius
    return Style(theme, height / PICTURE_HEIGHT, lines, text, dots, isinstance(camera, Plane))


def lines(name: str, pairs: Array, color: Rgb, width: float, style: Style) -> Primitive:
    """Segments (n, 2, 3) with a width in screen pixels."""
    return Primitive(name, "lines", {
        "points": np.asarray(pairs, np.float64), "colors": np.array(color, np.uint8),
        "thickness": width * style.lines, "thickness_units": "screen",
    })


def points(name: str, positions: Array, color: Rgb | Array, size: float, style: Style,
           shape: str = "circle") -> Primitive:
    """Dots (n, 3); size is their diameter in pixels of the standard picture."""
    return Primitive(name, "points", {
        "points": np.asarray(positions, np.float64), "colors": np.asarray(color, np.uint8),
        "point_size": size * style.pixel * style.dots, "point_shape": shape, "precision": "float32",
        "point_shading": "flat",
    })


def arrows(name: str, pairs: Array, colors: Rgb | Array, width: float, style: Style) -> Primitive:
    """Arrows (n, 2, 3) with a shaft `width` pixels wide; the head shrinks for short ones.

    viser takes the colours of arrows as linear light, those of everything else as sRGB.
    """
    pairs = np.asarray(pairs, np.float64)
    radius = 0.5 * width * style.pixel
    lengths = np.sqrt(((pairs[:, 1] - pairs[:, 0]) ** 2).sum(axis=-1))
    head = min(7.0 * radius, 0.5 * float(lengths.max(initial=0.0)))
    return Primitive(name, "arrows", {
        "points": pairs, "colors": _linear(colors), "shaft_radius": radius,
        "head_radius": min(2.6 * radius, 0.45 * head) if head > 0 else radius, "head_length": head,
    })


def _linear(colors: Rgb | Array) -> Array:
    return np.rint(255 * (np.asarray(colors) / 255) ** 2.2).astype(np.uint8)


def mesh(name: str, vertices: Array, faces: Array, color: Rgb, opacity: float | None = None,
         flat: bool = True) -> Primitive:
    """A triangle mesh seen from both sides; opacity None is opaque."""
    return Primitive(name, "mesh", {
        "vertices": np.asarray(vertices, np.float64), "faces": np.asarray(faces, np.uint32), "color": color,
        "opacity": opacity, "flat_shading": flat, "side": "double", "cast_shadow": False, "receive_shadow": False,
    })


ANCHORS = {"center": "center-center", "left": "center-left", "right": "center-right", "top": "top-center",
           "bottom": "bottom-center"}


def label(name: str, text: str, position: Sequence[float], style: Style, size: float = 1.0,
          anchor: str = "center") -> Primitive:
    """Text of constant size on the screen."""
    x, y, z = (float(v) for v in position)
    return Primitive(name, "label", {
        "text": text, "font_size_mode": "screen", "font_screen_scale": TEXT_SIZE * size * style.text,
        "depth_test": False, "anchor": ANCHORS[anchor],
    }, (x, y, z))


def chain(p: Array, closed: bool = False) -> Array:
    """The segments (n-1, 2, 3) that join the points in order."""
    if closed and len(p) > 1:
        p = np.concatenate([p, p[:1]])
    return np.stack([p[:-1], p[1:]], axis=1)


def dashes(p: Array, length: float) -> Array:
    """Every other piece of `length` along the polyline, as segments; at most 400 dashes."""
    steps = np.sqrt(((p[1:] - p[:-1]) ** 2).sum(axis=-1))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    total = along[-1]
    if total <= 0:
        return np.zeros((0, 2, 3))
    length = max(length, total / 800)
    starts = np.arange(0.0, total, 2 * length)
    ends = np.minimum(starts + length, total)
    at = np.stack([starts, ends], axis=1)
    return np.stack([np.interp(at, along, p[:, i]) for i in range(3)], axis=-1)
