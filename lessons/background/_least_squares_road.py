"""The straight road y = a x + b through fixes: vertical residuals, their squares, and the total least squares line."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.linalg import least_squares_fit
from core.types import Array
from lessons.kit.curves import clipped
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Readout, View
from lessons.kit.scene import Item, Plane, Points, Polygon, Segments

if TYPE_CHECKING:
    from lessons.background.least_squares import Params

HALF = 4.0


class Road(NamedTuple):
    """coefficients (2,) a and b, None where the fixes determine no line; residuals (n,); A'A and A'y; and the total
    least squares line as a point and a direction."""

    coefficients: Array | None
    residuals: Array
    gram: Array
    right: Array
    centre: Array
    direction: Array


def compute(p: "Params") -> Road:
    """Rows (x_i, 1) and right sides y_i."""
    xy = np.array(p.fixes, dtype=np.float64).reshape(-1, 2)
    A = np.column_stack([xy[:, 0], np.ones(len(xy))])
    centre = xy.mean(axis=0) if len(xy) else np.zeros(2)
    _, _, V = np.linalg.svd(xy - centre) if len(xy) > 1 else (None, None, np.eye(2))
    gram, right = A.T @ A, A.T @ xy[:, 1]
    if len(xy) < 2 or np.ptp(xy[:, 0]) < 1e-9:
        return Road(None, np.zeros(len(xy)), gram, right, centre, V[0])
    fit = least_squares_fit(A, xy[:, 1])
    return Road(fit.x, fit.residual, gram, right, centre, V[0])


def view(p: "Params", r: Road) -> View:
    xy = np.array(p.fixes, dtype=np.float64).reshape(-1, 2)
    box = HALF * np.array([[-1.0, -1.0], [1.0, 1.0]])
    items: list[Item] = []
    note = ""
    if r.coefficients is None:
        note = "Two fixes with different x are needed to determine a and b." if len(xy) else "Click to add fixes."
    else:
        a, b = r.coefficients
        on_line = np.column_stack([xy[:, 0], a * xy[:, 0] + b])
        if p.squares:
            items += [Polygon(f"square_{k + 1}", _square(foot, e), role="innovation", opacity=0.2)
                      for k, (foot, e) in enumerate(zip(on_line, r.residuals, strict=True)) if abs(e) > 1e-6]
        items.append(Segments("residuals", np.stack([xy, on_line], axis=1), role="innovation", width=3.0))
        items += _line("road", np.array([0.0, b]), np.array([1.0, a]), box, "posterior", 4.5)
    if p.total and len(xy) > 1:
        items += _line("total", r.centre, r.direction, box, "likelihood", 3.0)
        t = (xy - r.centre) @ r.direction
        feet = r.centre + t[:, None] * r.direction
        items.append(Segments("total_residuals", np.stack([xy, feet], axis=1), role="likelihood", width=2.0))
    if len(xy):
        items.append(Points("fixes", xy, role="measurement", size=8))
    return View(scene=items, camera=Plane((-HALF, HALF), (-HALF, HALF), "x (km)", "y (km)"), figures=_figures(p, r, xy),
                readouts=_readouts(r), equations=_equations(r), caption="the road y = a x + b", note=note)


def _square(foot: Array, e: float) -> Array:
    """The square over a vertical residual, at its right."""
    return foot + np.array([[0.0, 0.0], [abs(e), 0.0], [abs(e), e], [0.0, e]])


def _line(name: str, point: Array, direction: Array, box: Array, role: str, width: float) -> list[Item]:
    ends = point + np.array([[-100.0], [100.0]]) * direction / np.sqrt(direction @ direction)
    pieces = clipped(ends, box)
    return [Segments(name, pieces, role=role, width=width)] if len(pieces) else []  # type: ignore[arg-type]


def _figures(p: "Params", r: Road, xy: Array) -> dict:
    n = np.arange(1, max(len(xy), 1) + 1)
    residuals = r.residuals if len(xy) else np.zeros(1)
    slopes = np.linspace(-3.0, 3.0, 121)
    shift = xy - xy.mean(axis=0) if len(xy) else np.zeros((1, 2))
    cost = np.square(shift[:, 1] - slopes[:, None] * shift[:, 0]).sum(axis=1)
    cursor = None if r.coefficients is None else float(np.clip(r.coefficients[0], -3.0, 3.0))
    return {"residuals": chart(bars("residual", n, residuals, "innovation")),
            "slope": chart(line("cost", slopes, cost, "posterior"), cursor=cursor)}


def _readouts(r: Road) -> list[Readout]:
    a, b = (None, None) if r.coefficients is None else map(float, r.coefficients)
    return [Readout("a", a), Readout("b", b, "km"), Readout("cost", float(np.square(r.residuals).sum()), "km²"),
            Readout("rms", float(np.sqrt(np.square(r.residuals).mean())) if len(r.residuals) else None, "km")]


def _equations(r: Road) -> list[Equation]:
    found = [Equation("normal", (r"A^TA =", r.gram, r"A^Ty =", r.right))]
    return found if r.coefficients is None else [*found, Equation("solution", (r"[a;\, b] =", r.coefficients))]
