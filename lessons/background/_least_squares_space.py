"""y, the column space and the right angle in space: |y - A z|^2 = |A (x - z)|^2 + |y - A x|^2.  MAT (1.5)."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.linalg import LeastSquares, least_squares_fit
from core.types import Array
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Readout, View
from lessons.kit.scene import Arrow, Item, Label, Orbit, Points, Polyline, Segments, Surface

if TYPE_CHECKING:
    from lessons.background.least_squares import Params

SIDE = 2.6                  # of the part of the column space that is drawn
CORNER = 0.22               # of the little square of the right angle


class Space(NamedTuple):
    """A (3, 2), the fit of y, and another point A z with the terms of (1.5): |A (x - z)|^2 and |y - A x|^2."""

    A: Array
    fit: LeastSquares
    z: Array
    inside: float
    across: float


def compute(p: "Params") -> Space:
    """Columns (1, 0, slope_1) and (0, 1, slope_2): always independent."""
    A = np.array([[1.0, 0.0], [0.0, 1.0], [p.slope_1, p.slope_2]])
    fit = least_squares_fit(A, p.y)
    z = np.array(p.other)
    return Space(A, fit, z, float(np.square(A @ (fit.x - z)).sum()), float(fit.cost))


def view(p: "Params", r: Space) -> View:
    y, foot, other = np.array(p.y), r.fit.y_hat, r.A @ r.z
    ends = np.array([-SIDE, SIDE])
    plane = np.add.outer(p.slope_2 * ends, p.slope_1 * ends)
    zero = np.zeros(3)
    items: list[Item] = [Surface("columns", ends, ends, plane, role="prior", opacity=0.35, contours=0)]
    items += [Arrow(f"column_{k + 1}", zero, r.A[:, k], role="reference", width=4.0) for k in range(2)]
    items += [Label(f"column_name_{k + 1}", f"a{'₁₂'[k]}", 1.12 * r.A[:, k]) for k in range(2)]
    items += [Arrow("y_arrow", zero, y, role="measurement", width=5.0), Label("y_name", "y", 1.06 * y)]
    if np.square(foot).sum() > 1e-9:
        items += [Arrow("foot", zero, foot, role="posterior", width=5.0), Label("foot_name", "A x\u0302", 1.1 * foot)]
    gap = y - foot
    if np.square(gap).sum() > 1e-6:
        items.append(Arrow("residual", foot, y, role="innovation", width=5.0))
        items += _right_angle(foot, gap)
    items += [Points("other_point", [other], role="warning", size=12),
              Segments("other_drop", np.array([[other, [*r.z, 0.0]]]), role="muted", width=1.5),
              Segments("other_sides", np.array([[other, y], [other, foot]]), role="warning", width=2.5),
              Label("other_name", "A z", other + np.array([0.0, 0.0, -0.25]))]
    return View(scene=items, camera=Orbit((0.0, 0.0, 0.6), 3.6, -58.0, 20.0, SIDE), figures=_figures(r),
                readouts=_readouts(r), equations=_equations(p, r), caption="y, its foot A x\u0302, and the right angle")


def _right_angle(foot: Array, gap: Array) -> list[Item]:
    up = gap / np.sqrt(gap @ gap)
    back = -foot if np.square(foot).sum() > 1e-6 else np.cross(up, [1.0, 0.0, 0.0])
    back = back / np.sqrt(back @ back)
    size = min(CORNER, 0.5 * float(np.sqrt(gap @ gap)))
    return [Polyline("right_angle", foot + size * np.array([back, back + up, up]), role="innovation", width=2.5)]


def _figures(r: Space) -> dict:
    total = r.inside + r.across
    split = chart(bars("inside", [1.0], [r.inside], "posterior", width=0.5),
                  bars("across", [2.0], [r.across], "innovation", width=0.5),
                  bars("total", [3.0], [total], "warning", width=0.5))
    split.layout.xaxis.tickvals = [1, 2, 3]
    split.layout.xaxis.ticktext = ["within", "across", "|y − Az|²"]
    t = np.linspace(-1.0, 2.0, 61)
    along = chart(line("cost", t, r.across + r.inside * (1.0 - t) ** 2, "warning"), marks=(1.0,), cursor=0.0)
    return {"split": split, "along": along}


def _readouts(r: Space) -> list[Readout]:
    return [Readout("x_1", float(r.fit.x[0])), Readout("x_2", float(r.fit.x[1])), Readout("cost", r.across),
            Readout("inside", r.inside), Readout("total", r.inside + r.across),
            Readout("angle", float(np.max(np.abs(r.A.T @ r.fit.residual))), "", 2)]


def _equations(p: "Params", r: Space) -> list[Equation]:
    return [Equation("normal", (r"A^TA\,\hat x = A^Ty:\quad", r.A.T @ r.A, r"\hat x =", r.A.T @ np.array(p.y))),
            Equation("solution", (r"\hat x =", r.fit.x)),
            Equation("orthogonal", (r"A^T(y - A\hat x) =", r.A.T @ r.fit.residual))]
