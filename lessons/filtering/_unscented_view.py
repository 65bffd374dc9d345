"""What the lesson of the unscented transform shows at one stage."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import chi_square_level, ellipse
from core.types import Array, Gaussian
from lessons.filtering._unscented_figures import equations, figures, readouts
from lessons.filtering._unscented_layout import TITLES, Layout, layout
from lessons.filtering._unscented_maps import map_of
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import Panel
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, LevelEllipse, Points, Polyline, Segments, Stations

if TYPE_CHECKING:
    from lessons.filtering.unscented import Params, Result

PRIOR, SIGMA, IMAGES, MOMENTS = range(4)
PROBABILITY = 0.68
SUBSCRIPTS = "₀₁₂₃₄"


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Both panels with everything up to this stage."""
    place = layout(p, r)
    scene = [*place.source.axes("source", TITLES[p.map][0], place.pixel),
             *place.image.axes("image", TITLES[p.map][1], place.pixel),
             *_prior(p, r, place)]
    if at.stage >= IMAGES:
        scene += _images(p, r, place)
    if at.stage >= MOMENTS:
        scene += _moments(r, place.image)
    if at.stage >= SIGMA:
        scene += _sigma_points(p, r, place, at.stage >= IMAGES)
    return View(
        scene=scene, camera=place.camera, figures=figures(p, r), readouts=readouts(p, r),
        equations=equations(r, p.kappa, at.stage), caption=_caption(p, r), note=_note(p, r, at),
    )


def _prior(p: "Params", r: "Result", place: Layout) -> list[Item]:
    """The prior, points drawn from it, and what the map is measured from."""
    items: list[Item] = [
        Points("cloud", place.source.place(r.cloud[place.source.inside(r.cloud)]), role="monte_carlo", size=2.0,
               fade=0.45),
        LevelEllipse("prior", place.source.law(r.prior), role="prior", probability=PROBABILITY, filled=True),
    ]
    if p.map == "polar":
        items += _sight(p, place)
    elif p.map == "two_ranges":
        items += [Segments("sight", np.array([[p.station_1, p.mean], [p.station_2, p.mean]]), role="muted", width=1.5),
                  Stations("stations", [p.station_1, p.station_2], ("station 1", "station 2"))]
    return items


def _sight(p: "Params", place: Layout) -> list[Item]:
    """The line to the station that measures range and bearing; the station itself only where it is in the panel."""
    end = place.image.exit(np.array(p.mean), np.array(p.station_1))
    items: list[Item] = [Segments("sight", np.array([[p.mean, end]]), role="muted", width=1.5)]
    if np.allclose(end, p.station_1):
        return [*items, Stations("stations", [p.station_1], ("station 1",))]
    distance = f"{float(np.linalg.norm(np.subtract(p.station_1, p.mean))):.0f} m"
    return [*items, Label("sight_name", f"to station 1, {distance}", 0.75 * end + 0.25 * np.array(p.mean), 0.8, "left")]


def _images(p: "Params", r: "Result", place: Layout) -> list[Item]:
    """The cloud and the 68 % ellipse after the map."""
    rim = map_of(p).f(ellipse(r.prior, chi_square_level(PROBABILITY, 2)))
    items: list[Item] = [
        Points("cloud_images", place.image.place(r.cloud_images[place.image.inside(r.cloud_images)]),
               role="monte_carlo", size=2.0, fade=0.45),
        Polyline("rim", place.image.place(rim), role="prior", width=2.5, closed=True),
    ]
    if p.map == "two_ranges":
        items.append(_triangle_inequality(p, place.image))
    return items


def _triangle_inequality(p: "Params", panel: Panel) -> Item:
    """The border of the pairs of ranges that exist: r1 + r2 = d and |r1 - r2| = d for stations d apart."""
    d = float(np.hypot(*np.subtract(p.station_1, p.station_2)))
    far = np.linspace(panel.high.max(), 0.0, 200)
    between = np.linspace(0.0, d, 200)
    border = np.concatenate([np.column_stack([far, far + d]), np.column_stack([between, d - between]),
                             np.column_stack([d + far[::-1], far[::-1]])])
    pairs = np.stack([border[:-1], border[1:]], axis=1)
    return Segments("border", panel.place(pairs[panel.inside(pairs).all(axis=1)]), role="reference", width=2.0)


def _moments(r: "Result", panel: Panel) -> list[Item]:
    """Three ellipses: of the samples, of the tangent, of the sigma points."""
    definite = bool(r.ut.definite)
    return [
        LevelEllipse("sampled", panel.law(r.sampled), role="monte_carlo", probability=PROBABILITY, width=7.0),
        LevelEllipse("linear", panel.law(r.linear), role="linearised", probability=PROBABILITY, width=3.5),
        LevelEllipse("ut" if definite else "ut_modified", panel.law(Gaussian(r.ut.mean, r.ut.cov)), role="ukf",
                     probability=PROBABILITY, width=3.5, dashed=not definite),
    ]


def _sigma_points(p: "Params", r: "Result", place: Layout, mapped: bool) -> list[Item]:
    """The points with their weights, and their images under the same numbers."""
    inputs = place.source.place(r.ut.points)
    items: list[Item] = [Segments("arms", np.stack([np.tile(inputs[0], (4, 1)), inputs[1:]], axis=1), role="sigma",
                                  width=2.0, fade=0.3)]
    items += _dots("sigma", inputs, r.ut.weights)
    items += _names("sigma", "χ", inputs, r.ut.weights, place.pixel)
    if mapped:
        outputs = place.image.place(r.ut.images)
        items.append(Segments("links", np.stack([inputs, outputs], axis=1), role="sigma", width=1.0, fade=0.6))
        items += _dots("sigma_images", outputs, r.ut.weights)
        items += _names("image", "f", outputs, None, place.pixel)
    return items


def _dots(name: str, at: Array, weights: Array) -> list[Item]:
    """Larger for a larger weight; a negative one is a diamond in the colour of warnings."""
    def dot(suffix: str, positions: Array, weight: float) -> Points:
        role: Role = "sigma" if weight >= 0 else "warning"
        return Points(f"{name}_{suffix}", positions, role=role, size=6.0 + 6.0 * min(abs(weight), 1.0)**0.5,
                      shape="circle" if weight >= 0 else "diamond")

    return [dot("centre", at[:1], weights[0]), dot("others", at[1:], weights[1])]


def _names(name: str, letter: str, at: Array, weights: Array | None, pixel: float) -> list[Item]:
    """A name beside every point, away from the centre; with the weight where there is room or a negative one."""
    near = np.linalg.norm(at[1:] - at[0], axis=1).min() < 42.0 * pixel
    if near and weights is not None and weights[0] >= 0:
        weights = None
    items: list[Item] = []
    for i, (x, y) in enumerate(at):
        text = letter + SUBSCRIPTS[i] + ("" if weights is None else f": {weights[i]:.2f}".replace("-", "−"))
        dx, dy = np.subtract((x, y), at[0])
        if i == 0:
            items.append(Label(f"{name}_0", text, (x + 10.0 * pixel, y - 20.0 * pixel), 1.0, "left"))
        elif abs(dx) > abs(dy):
            items.append(Label(f"{name}_{i}", text, (x + np.copysign(13.0 * pixel, dx), y), 1.0,
                               "left" if dx > 0 else "right"))
        else:
            items.append(Label(f"{name}_{i}", text, (x, y + np.copysign(12.0 * pixel, dy)), 1.0,
                               "bottom" if dy > 0 else "top"))
    return items


def _caption(p: "Params", r: "Result") -> str:
    w = r.ut.weights
    return f"κ = {p.kappa:.1f}, n + κ = {2 + p.kappa:.1f}, weights {w[0]:.2f} and 4 × {w[1]:.2f}".replace("-", "−")


def _note(p: "Params", r: "Result", at: Moment) -> str:
    found = []
    if at.stage >= MOMENTS and not r.ut.definite:
        found.append("The covariance of (3.16) is not positive semidefinite: no ellipse. "
                     "Dashed: deviations from f(χ₀) instead.")
    elif r.ut.weights[0] < 0:
        found.append("The centre has a negative weight.")
    found.append(f"{len(r.cloud):,} of {p.samples:,} Monte Carlo points are drawn.")
    return " ".join(found)
