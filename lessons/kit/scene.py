"""What a lesson can draw.  Positions are in the lesson's own units (usually metres); 2-D positions lie at z = 0.

Every item has a `name` (unique in the view, stable in time: the renderer updates by name) and a `role` (its colour).
Sizes and widths are in pixels of a 900 pixel high picture; lengths are in scene units.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from core.types import Array, Gaussian
from lessons.kit.roles import Role

Positions = Array | Sequence[Sequence[float]]


@dataclass(frozen=True, slots=True)
class Plane:
    """Look straight down at a rectangle of the plane, like a plot in a textbook, with axes, ticks and a grid.

    x, y: (low, high) that must be visible, equal scale on both axes.  x_label, y_label: with units.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    x_label: str = "x (m)"
    y_label: str = "y (m)"
    axes: bool = True


@dataclass(frozen=True, slots=True)
class Orbit:
    """Look at a sphere of `radius` round `centre` from azimuth and elevation (degrees); z is up.

    ground: half the side of a faint square grid at z = `ground_z`; 0 draws none.
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 1.5
    azimuth_deg: float = -50.0
    elevation_deg: float = 25.0
    ground: float = 0.0
    ground_z: float = 0.0


Camera = Plane | Orbit


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Dots of one colour.  fade: 0 (full colour) to 1 (invisible), a number or one per point."""

    name: str
    positions: Positions
    role: Role = "measurement"
    size: float = 9.0
    shape: Literal["circle", "square", "diamond"] = "circle"
    fade: float | Array = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Particles:
    """A weighted cloud: heavier particles are larger and stronger in colour.  weights None: equal.

    size: diameter of a particle of mean weight.
    """

    name: str
    positions: Positions
    weights: Array | None = None
    role: Role = "pf"
    size: float = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """A connected line through the points (n, 2) or (n, 3)."""

    name: str
    points: Positions
    role: Role = "truth"
    width: float = 2.5
    dashed: bool = False
    closed: bool = False
    fade: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Separate segments: (n, 2, 2) or (n, 2, 3)."""

    name: str
    pairs: Array
    role: Role = "muted"
    width: float = 1.5
    fade: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class LevelEllipse:
    """The ellipse of a 2-D Gaussian (first two components of a longer one) that holds `probability`.

    filled: a translucent inside.  cross: mark the mean.
    """

    name: str
    gaussian: Gaussian
    role: Role = "posterior"
    probability: float = 0.68
    width: float = 3.0
    filled: bool = False
    cross: bool = True
    dashed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoid:
    """The ellipsoid of a 3-D Gaussian (first three components of a longer one) that holds `probability`."""

    name: str
    gaussian: Gaussian
    role: Role = "posterior"
    probability: float = 0.68
    opacity: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class CovarianceAxes:
    """Principal axes of a 2-D or 3-D Gaussian, one standard deviation (times `scale`) to each side of the mean."""

    name: str
    gaussian: Gaussian
    role: Role = "posterior"
    scale: float = 1.0
    width: float = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """From start to end; width of the shaft in pixels."""

    name: str
    start: Sequence[float]
    end: Sequence[float]
    role: Role = "vector"
    width: float = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class RotationVector:
    """p drawn as an arrow from origin along the axis (length `length` times its angle in rad), with an arc.

    The arc turns round the axis by the angle (right-hand rule) at distance `arc_radius`; start: the direction where
    the arc begins (made perpendicular to p; default: any).
    """

    name: str
    p: Sequence[float]
    role: Role = "rotation"
    origin: Sequence[float] = (0.0, 0.0, 0.0)
    length: float = 0.5
    arc_radius: float = 0.4
    start: Sequence[float] | None = None
    width: float = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A right-handed triad.  dcm: columns are its axes in scene coordinates (C_frame^scene).

    labels: what stands at the tips; role None: red, green, blue axes, else all three in that colour.
    """

    name: str
    dcm: Array
    origin: Sequence[float] = (0.0, 0.0, 0.0)
    size: float = 1.0
    labels: tuple[str, str, str] = ("x", "y", "z")
    role: Role | None = None
    width: float = 5.0
    fade: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """Base stations as triangles with their names; `labels` empty: none."""

    name: str
    positions: Positions
    labels: tuple[str, ...] = ()
    role: Role = "station"
    size: float = 22.0


@dataclass(frozen=True, slots=True, eq=False)
class Satellites:
    """Satellites as small bodies with two panels, with their names."""

    name: str
    positions: Positions
    labels: tuple[str, ...] = ()
    role: Role = "satellite"
    size: float = 22.0


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """The height field z (len(y), len(x)) over the grid x, y, with `contours` level lines on it."""

    name: str
    x: Array
    y: Array
    z: Array
    role: Role = "posterior"
    opacity: float = 0.75
    contours: int = 8


@dataclass(frozen=True, slots=True, eq=False)
class HeatMap:
    """Nonnegative values (len(y), len(x)) over the plane grid x, y, as colour from nothing to full."""

    name: str
    x: Array
    y: Array
    values: Array
    role: Role = "likelihood"
    opacity: float = 0.8


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """A filled simple polygon in the plane: (n, 2), or (n, 3) with one common z."""

    name: str
    vertices: Positions
    role: Role = "muted"
    opacity: float = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Walls:
    """Vertical walls of `height` above the segments (n, 2, 2) or (n, 2, 3) of a floor plan."""

    name: str
    segments: Array
    height: float = 2.5
    role: Role = "muted"
    opacity: float = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class Globe:
    """An ellipsoid of revolution with meridians and parallels; semi-axes in scene units."""

    name: str
    equatorial: float = 1.0
    polar: float = 1.0
    dcm: Array | None = None
    role: Role = "reference"
    opacity: float = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """Text at a point.  `text` is plain Unicode ("x\u0302", "\u03c3\u2081"); size 1 is the ordinary size."""

    name: str
    text: str
    position: Sequence[float]
    size: float = 1.0
    anchor: Literal["center", "left", "right", "top", "bottom"] = "center"


Item = (
    Points | Particles | Polyline | Segments | LevelEllipse | Ellipsoid | CovarianceAxes | Arrow | RotationVector
    | Frame | Stations | Satellites | Surface | HeatMap | Polygon | Walls | Globe | Label
)


def points3(positions: Positions) -> Array:
    """positions as an (n, 3) array; two columns get z = 0."""
    p = np.asarray(positions, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] not in (2, 3):
        raise ValueError(f"positions: expected shape (n, 2) or (n, 3), got {p.shape}")
    return p if p.shape[1] == 3 else np.column_stack([p, np.zeros(len(p))])
