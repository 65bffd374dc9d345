"""A place from straight lines h_i'x = y_i in the plane: with a guess of weight mu (Example 3), and in a triangle."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.linalg import least_squares_fit, regularized_least_squares, subspaces
from core.types import Array
from lessons.kit.curves import clipped, tangent_line
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Readout, View
from lessons.kit.scene import Item, Label, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    from lessons.background.least_squares import Params

H_GUESS = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 2.0]])         # of the oracle's example
WEIGHTS = np.geomspace(1e-3, 1e3, 121)
SIDE = 6.0                                                       # of the triangle, in units of l
HEIGHT = SIDE * np.sqrt(3.0) / 2.0
CORNERS = np.array([[0.0, 0.0], [SIDE, 0.0], [SIDE / 2.0, HEIGHT]])


class Lines(NamedTuple):
    """Rows H (m, 2) with right sides y (m,): x (2,) the estimate; plain (2,) without the guess, None where it is not
    unique; path (WEIGHTS, 2) over the weight of the guess; residuals (m,) y - H x."""

    H: Array
    y: Array
    x: Array
    plain: Array | None
    path: Array
    residuals: Array


def compute(p: "Params") -> Lines:
    if p.picture == "triangle":
        H, y = triangle(np.array([p.d_1, p.d_2, p.d_3]))
        fit = least_squares_fit(H, y)
        return Lines(H, y, fit.x, fit.x, np.zeros((0, 2)), fit.residual)
    H, y = H_GUESS[:p.rows], np.array([p.y_1, p.y_2, p.y_3])[:p.rows]
    path = np.array([regularized_least_squares(H, y, p.x0, weight=float(w)) for w in WEIGHTS])
    x = regularized_least_squares(H, y, p.x0, weight=p.mu)
    plain = least_squares_fit(H, y).x if subspaces(H).rank == 2 else None
    return Lines(H, y, x, plain, path, y - H @ x)


def triangle(distances: Array) -> tuple[Array, Array]:
    """Distance to each wall as n'x + c: inward unit normals and right sides distance - c."""
    a, b = CORNERS, np.roll(CORNERS, -1, axis=0)
    along = (b - a) / SIDE
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    return normal, distances + (normal * a).sum(axis=1)


def view(p: "Params", r: Lines) -> View:
    return _triangle(p, r) if p.picture == "triangle" else _guess(p, r)


def _guess(p: "Params", r: Lines) -> View:
    box = np.array([[-1.5, -1.0], [3.5, 3.5]])
    items: list[Item] = []
    for k, (h, y) in enumerate(zip(r.H, r.y, strict=True)):
        pieces = clipped(tangent_line(np.zeros(2), float(y), h, 20.0), box)
        if len(pieces):
            items.append(Segments(f"line_{k + 1}", pieces, role="measurement", width=3.0))
    feet = r.x + r.residuals[:, None] * r.H / np.square(r.H).sum(axis=1, keepdims=True)
    items += [_misfits(r, feet, 3.0),
              Segments("guess_line", np.array([[r.x, p.x0]]), role="prior", width=2.5),
              Polyline("path", r.path, role="posterior", width=2.5, dashed=True)]
    if r.plain is not None:
        items += [Points("plain", [r.plain], role="likelihood", size=12, shape="square")]
    items.append(Points("estimate", [r.x], role="posterior", size=15))
    note = "" if r.plain is not None else "One line alone has no single best point: only the guess makes it unique."
    cost = np.square(r.y[None] - r.path @ r.H.T).sum(axis=1), np.square(r.path - p.x0).sum(axis=1)
    figures = {"weight": chart(line("misfit", WEIGHTS, cost[0], "innovation"),
                               line("distance", WEIGHTS, cost[1], "prior"), log_x=True, cursor=p.mu)}
    return View(scene=items, camera=Plane((-1.5, 3.5), (-1.0, 3.5), "x₁ (m)", "x₂ (m)"), figures=figures, note=note,
                readouts=_readouts(r, "m", float(np.square(r.x - p.x0).sum())), equations=_equations(p, r),
                caption=f"a guess with the weight μ = {p.mu:.3g}")


def _triangle(p: "Params", r: Lines) -> View:
    box = np.array([[-1.0, -1.5], [7.0, 6.5]])
    items: list[Item] = [Polyline("walls", CORNERS, role="truth", width=4.0, closed=True)]
    for k, (h, y) in enumerate(zip(r.H, r.y, strict=True)):
        pieces = clipped(tangent_line(np.zeros(2), float(y), h, 40.0), box)
        if len(pieces):
            items.append(Segments(f"line_{k + 1}", pieces, role="measurement", width=2.5))
        middle = 0.5 * (CORNERS[k] + CORNERS[(k + 1) % 3]) - 0.35 * h
        items.append(Label(f"wall_{k + 1}", f"wall {k + 1}", middle, 0.9))
    feet = r.x + r.residuals[:, None] * r.H
    items += [_misfits(r, feet, 4.0), Points("estimate", [r.x], role="posterior", size=15)]
    total = p.d_1 + p.d_2 + p.d_3
    note = "" if abs(total - HEIGHT) < 0.05 else (
        f"The distances add up to {total:.3g} l; in an equilateral triangle it is always the height, {HEIGHT:.3g} l.")
    n = np.arange(1, 4)
    figures = {"residuals": chart(bars("residual", n, r.residuals, "innovation"))}
    return View(scene=items, camera=Plane((-1.0, 7.0), (-1.5, 6.5), "x₁ (l)", "x₂ (l)"), figures=figures, note=note,
                readouts=_readouts(r, "l", None), equations=_equations(p, r), caption="distances to three walls")


def _misfits(r: Lines, feet: Array, width: float) -> Segments:
    """From the estimate to the nearest point of each line."""
    pairs = np.stack([np.broadcast_to(r.x, feet.shape), feet], axis=1)
    return Segments("misfits", pairs, role="innovation", width=width)


def _readouts(r: Lines, unit: str, guess: float | None) -> list[Readout]:
    found = [Readout("x_1", float(r.x[0]), unit), Readout("x_2", float(r.x[1]), unit),
             Readout("cost", float(np.square(r.residuals).sum()), f"{unit}²")]
    return found if guess is None else [*found, Readout("guess_cost", guess, f"{unit}²")]


def _equations(p: "Params", r: Lines) -> list[Equation]:
    found = [Equation("system", (r"H =", r.H, r"y =", r.y))]
    if p.picture == "guess":
        found.append(Equation("regularised", (r"(H^TH + \mu I)^{-1}(H^Ty + \mu x_0) =", r.x)))
    else:
        found.append(Equation("solution", (r"\hat x =", r.x)))
    return [*found, Equation("residuals", (r"y - H\hat x =", r.residuals))]
