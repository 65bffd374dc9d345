"""A view's items in order become primitives with unique names."""

from collections.abc import Callable, Iterable
from typing import Any

from app.draw import curves, solids
from app.draw.axes import ground_grid, plane_axes
from app.draw.primitives import Primitive, Style
from lessons.kit import scene
from lessons.kit.lesson import View

DRAW: dict[type, Callable[[Any, Style], list[Primitive]]] = {
    scene.Points: curves.points,
    scene.Particles: curves.particles,
    scene.Polyline: curves.polyline,
    scene.Segments: curves.segments,
    scene.LevelEllipse: curves.level_ellipse,
    scene.CovarianceAxes: curves.covariance_axes,
    scene.Arrow: curves.arrow,
    scene.Label: curves.text,
    scene.Stations: curves.stations,
    scene.Polygon: curves.polygon,
    scene.HeatMap: curves.heat_map,
    scene.Frame: solids.frame,
    scene.RotationVector: solids.rotation_vector,
    scene.Ellipsoid: solids.ellipsoid,
    scene.Globe: solids.globe,
    scene.Surface: solids.surface,
    scene.Walls: solids.walls,
    scene.Satellites: solids.satellites,
}


def lower(view: View, style: Style) -> list[Primitive]:
    """The primitives of a view, axes and grid included.

    In a plane view later items lie a hair above earlier ones, so that they cover them.  ValueError for two items
    of one name, or one with the name of another's part.
    """
    found = backdrop(view.camera, style)
    seen = {p.name for p in found}
    for layer, item in enumerate(view.scene):
        made = DRAW[type(item)](item, style)
        names = {item.name, *(p.name for p in made)}
        if taken := names & seen:
            raise ValueError(f"two things in the scene are called {min(taken)!r}; names must differ")
        seen |= names
        found += raised(made, 0.5 * layer * style.pixel) if style.layered else made
    return found


def backdrop(camera: scene.Camera, style: Style) -> list[Primitive]:
    """Axes or ground grid."""
    if isinstance(camera, scene.Orbit):
        return ground_grid(camera, style)
    return plane_axes(camera, style) if camera.axes else []


def raised(made: Iterable[Primitive], height: float) -> list[Primitive]:
    """The primitives, shifted up."""
    return [Primitive(p.name, p.kind, p.props, (p.position[0], p.position[1], p.position[2] + height)) for p in made]
