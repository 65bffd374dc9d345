"""Ranges in the plane (exercise 2.8): two circles, the straight line through their meeting points, and both roots."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit.curves import clipped, level_line
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import nice_step
from lessons.kit.scene import Item, Label, Plane, Points, Segments, Stations
from lessons.static._closed_form_figures import figures
from lessons.static._closed_form_numbers import LINE, ROOTS, SQUARE, TESTS, equations, lambdas, readouts

if TYPE_CHECKING:
    from lessons.static.closed_form import Params, Result

MARKS = 6                                    # values of lambda that are written along the line
EAST = np.array([1.0, 0.0])


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this stage of this experiment, and the estimates of the earlier ones."""
    box = _box(r)
    (x0, y0), (x1, y1) = box.tolist()
    k = at.step
    return View(
        scene=_scene(p, r, at, box), camera=Plane((x0, x1), (y0, y1), "x₁ (m)", "x₂ (m)"), figures=figures(p, r, at),
        readouts=readouts(p, r, at), equations=equations(p, r, at),
        caption="as measured" if k == 0 else f"experiment {k}: σ = {p.sigma_m:.3g} m", note=_note(r, k))


def _box(r: "Result") -> Array:
    """Round the stations, the true place, and the roots of the given measurements."""
    points = [*r.problem.stations_m, r.problem.truth]
    if r.fix is not None:
        points += [x for x in r.fix.roots[0] if np.isfinite(x).all() and np.abs(x).max() < 500.0]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    middle, half = 0.5 * (low + high), 0.5 * float((high - low).max()) + 45.0
    return np.array([middle - half, middle + half])


def _note(r: "Result", k: int) -> str:
    if r.fix is None:
        return "No closed form: the stations coincide. Drag them apart."
    if not np.isfinite(r.fix.roots[k]).all():
        return "The circles do not meet: the discriminant is negative and both roots are complex."
    if r.fix.origin[k].any():
        return "The stations lie on a line through the origin: λ is reckoned from another point."
    return ""


def _scene(p: "Params", r: "Result", at: Moment, box: Array) -> list[Item]:
    reach = float(np.linalg.norm(box[1] - box[0]))
    items: list[Item] = []
    for i, y in enumerate(r.y[at.step]):
        pieces = clipped(level_line(r.problem.sensor, i, float(y), reach), box)
        if len(pieces):
            items.append(Segments(f"circle_{i + 1}", pieces, role="measurement", width=2.5))
    if at.stage >= (SQUARE if len(r.y[0]) == 2 else LINE):
        items += _line(r, at, box, reach)
    if r.fix is not None and at.stage >= ROOTS:
        items += _definition(r, at.step, box, reach)
    items += _clouds(r, at.step, box)
    if r.fix is not None and at.stage >= ROOTS:
        items += _roots(r, at, box)
    stations = r.problem.stations_m
    return [*items, Stations("stations", stations, tuple(f"S{i + 1}" for i in range(len(stations))))]


def _line(r: "Result", at: Moment, box: Array, reach: float) -> list[Item]:
    """The places p lambda + q, and some lambdas along it."""
    if r.fix is None:
        return []
    k = at.step
    d, e = r.fix.p[k], r.fix.q[k] + r.fix.origin[k]
    size = float(np.linalg.norm(d))
    if size == 0.0:
        return []
    foot = e + ((box.mean(axis=0) - e) @ d) / size**2 * d
    pieces = clipped(np.array([foot - reach * d / size, foot + reach * d / size]), box)
    if not len(pieces):
        return []
    items: list[Item] = [Segments("line", pieces, role="linearised", width=3.0)]
    if at.stage >= LINE:
        low, high = np.sort((pieces[0] - e) @ d / size**2)
        step = nice_step((high - low) / MARKS)
        marks = step * np.arange(np.ceil(low / step + 0.3), np.floor(high / step - 0.3) + 1) + 0.0
        places = e + marks[:, None] * d
        side = np.array([-d[1], d[0]]) / size * 0.02 * reach
        items.append(Points("marks", places, role="linearised", size=8))
        items += [Label(f"mark_{i}", f"λ = {m:.0f}".replace("-", "−"), at_, 0.8, "left")
                  for i, (m, at_) in enumerate(zip(marks, places - np.sign(side[0]) * -side, strict=True))]
    return items


def _definition(r: "Result", k: int, box: Array, reach: float) -> list[Item]:
    """The circles |x|^2 = lambda of both roots: there the line's lambda is what it was defined to be."""
    t = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    items: list[Item] = []
    for i, value in enumerate(lambdas(r, k)):
        if np.isfinite(value) and 0.0 < value < (3.0 * reach)**2:
            pieces = clipped(r.fix.origin[k] + np.sqrt(value) * circle, box)
            if len(pieces):
                items.append(Segments(f"definition_{i + 1}", pieces, role="reference", width=1.5))
    return items


def _clouds(r: "Result", k: int, box: Array) -> list[Item]:
    """The estimates of both methods in the experiments so far."""
    items: list[Item] = []
    for name, x, role, size in (("iterated", r.gauss_newton, "vector", 8), ("closed", r.chosen, "posterior", 5)):
        x = x[1:k + 1]
        x = x[np.isfinite(x).all(axis=1)]
        x = x[((x >= box[0]) & (x <= box[1])).all(axis=1)]
        if len(x):
            items.append(Points(name, x, role=role, size=size))
    return items


def _roots(r: "Result", at: Moment, box: Array) -> list[Item]:
    """Both roots; with complex ones the place half-way between them."""
    k = at.step
    gap = 0.03 * float((box[1] - box[0]).max())
    items: list[Item] = []
    for i, root in enumerate(r.fix.roots[k]):
        if np.isfinite(root).all() and ((root >= box[0]) & (root <= box[1])).all():
            taken = at.stage >= TESTS and np.array_equal(root, r.chosen[k])
            misfit = float(r.fix.residual_norms[k, i])
            text = f"root {i + 1}" + (f": misfit {misfit if misfit > 1e-6 else 0.0:.2g} m" if at.stage >= TESTS else "")
            items += [Points(f"root_{i + 1}", [root], role="posterior" if taken else "linearised", size=15,
                             shape="diamond"),
                      Label(f"name_{i + 1}", text, root - gap * EAST, 1.0, "right")]
    middle = r.fix.middle[k]
    if not np.isfinite(r.fix.roots[k]).all() and np.isfinite(middle).all():
        items.append(Points("middle", [middle], role="warning", size=15, shape="diamond"))
    return items
