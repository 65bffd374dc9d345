"""How a matrix is drawn: the unit circle and its images, with points that show what goes where."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line, markers
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Item, Label, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.matrix_root import Params, Result

CIRCLE = np.linspace(0.0, 2.0 * np.pi, 121)[:-1]
DOTS = 12
NAMES = ("Qᵀ turns", "Λ stretches", "Q turns back")


def view(p: "Params", r: "Result", at: Moment) -> View:
    cut = r.cut and p.picture != "involution"
    note = "Positive semidefinite needs |a₁₂| ≤ √(a₁₁ a₂₂): the entry was cut." if cut else ""
    if p.picture == "factors":
        partial, names = _partial(r, at.step)
        caption = names or "the unit circle"
        scene = _factors(p, r, partial, at.step)
        half = 1.15 * max(1.0, float(r.factors[1].max()))
    elif p.picture == "roots":
        scene, caption = _roots(p, r), "the same ellipse, different points"
        half = 1.15 * max(1.0, float(np.sqrt(r.values.max())))
    else:
        scene, caption = _involution(p, r), "B B = I: twice is nothing"
        half = 1.1 * max(2.0, float(np.linalg.norm(r.B, 2)))
    return View(scene=scene, camera=Plane((-half, half), (-half, half), "x₁", "x₂"), figures=_figures(p, r),
                readouts=_readouts(p, r), equations=_equations(p, r, at.step), caption=caption, note=note)


def _unit() -> Array:
    return np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)])


def _dots() -> Array:
    t = np.arange(DOTS) * 2.0 * np.pi / DOTS
    return np.column_stack([np.cos(t), np.sin(t)])


def _partial(r: "Result", step: int) -> tuple[Array, str]:
    """The product of the factors that have acted so far, the last one in part."""
    from lessons.background.matrix_root import PER_STAGE

    done = np.eye(2)
    stage, rest = divmod(step, PER_STAGE)
    for k in range(min(stage, 3)):
        done = r.factors[k] @ done
    if rest and stage < 3:
        share = rest / PER_STAGE
        done = _part(r.factors[stage], share, stage) @ done
    name = NAMES[min(stage, 2)] if step else ""
    return done, name if rest or step == 0 else f"{NAMES[max(stage - 1, 0)]}: done"


def _part(factor: Array, share: float, stage: int) -> Array:
    """A share of a rotation or of a stretch."""
    if stage == 1:
        return np.eye(2) + share * (factor - np.eye(2))
    angle = share * np.arctan2(factor[1, 0], factor[0, 0])
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _factors(p: "Params", r: "Result", partial: Array, step: int) -> list[Item]:
    items: list[Item] = [Polyline("circle", _unit(), role="muted", width=2.0, closed=True),
                         Polyline("image", _unit() @ partial.T, role="posterior", width=4.5, closed=True),
                         Points("dots", _dots() @ partial.T, role="posterior", size=8)]
    for k, name in enumerate(("first", "second")):           # an eigenvector keeps its direction in the end
        q = partial @ r.Q[:, k]
        if np.sqrt(q @ q) > 1e-6:
            items.append(Arrow(f"{name}_axis", np.zeros(2), q, role="vector", width=4.5))
        line_ends = np.outer([-1.0, 1.0], r.Q[:, k]) * (1.15 * max(1.0, float(r.factors[1].max())))
        items.append(Segments(f"{name}_line", line_ends[None], role="muted", width=1.5))
    x = _arrow(p)
    items += [Arrow("x", np.zeros(2), x, role="measurement", width=3.5)]
    if step and np.square(partial @ x).sum() > 1e-9:
        items.append(Arrow("Ax", np.zeros(2), partial @ x, role="innovation", width=5.0))
    return items


def _arrow(p: "Params") -> Array:
    angle = np.deg2rad(p.arrow_deg)
    return np.array([np.cos(angle), np.sin(angle)])


def _roots(p: "Params", r: "Result") -> list[Item]:
    items: list[Item] = [Polyline("circle", _unit(), role="muted", width=2.0, closed=True),
                         Polyline("image", _unit() @ r.symmetric.T, role="posterior", width=4.0, closed=True)]
    dots = _dots()
    first, second = dots @ r.symmetric.T, dots @ r.other.T
    items += [Segments("pairs", np.stack([first, second], axis=1), role="muted", width=1.2),
              Points("dots", first, role="posterior", size=10),
              Points("other_dots", second, role="measurement", size=10, shape="square")]
    for name, root, role in (("columns", r.symmetric, "posterior"), ("other_columns", r.other, "measurement")):
        for k in range(2):
            if np.square(root[:, k]).sum() > 1e-9:
                items.append(Arrow(f"{name}_{k + 1}", np.zeros(2), root[:, k], role=role, width=4.5))
    return items


def _involution(p: "Params", r: "Result") -> list[Item]:
    x = _arrow(p)
    image = r.B @ x
    half = 1.1 * max(2.0, float(np.linalg.norm(r.B, 2)))
    items: list[Item] = [Polyline("circle", _unit(), role="muted", width=2.0, closed=True),
                         Polyline("image", _unit() @ r.B.T, role="posterior", width=4.0, closed=True)]
    for name, sign, role in (("kept", 1.0, "likelihood"), ("flipped", -1.0, "warning")):
        q = _direction(r.B, sign)
        items.append(Segments(f"{name}_line", np.outer([-half, half], q)[None], role=role, width=3.0))
    items += [Arrow("x", np.zeros(2), x, role="measurement", width=5.0),
              Arrow("Bx", np.zeros(2), image, role="innovation", width=5.0),
              Segments("path", np.array([[x, image]]), role="muted", width=2.0),
              Label("x_name", "x = B B x", 1.15 * x), Label("Bx_name", "B x", image * (1 + 0.15 / max(1.0, half)))]
    return items


def _direction(B: Array, eigenvalue: float) -> Array:
    """The eigenvector of a 2 x 2 involution: a column of B + eigenvalue I."""
    M = B + eigenvalue * np.eye(2)
    q = M[:, int(np.square(M).sum(axis=0).argmax())]
    return q / np.sqrt(q @ q)


def _figures(p: "Params", r: "Result") -> "dict[str, go.Figure]":
    t = np.linspace(0.0, 360.0, 121)
    u = np.column_stack([np.cos(np.deg2rad(t)), np.sin(np.deg2rad(t))])
    M = r.B if p.picture == "involution" else r.A
    form = np.einsum("ni,ij,nj->n", u, M, u)
    at = float(np.einsum("i,ij,j", _arrow(p), M, _arrow(p)))
    quadratic = chart(line("form", t, form, "posterior"), markers("here", [p.arrow_deg], [at], "measurement", size=11),
                      line("zero", [0.0, 360.0], [0.0, 0.0], "muted", dash=True))
    values = np.array([1.0, -1.0]) if p.picture == "involution" else r.values
    spectrum = chart(bars("values", np.array([1.0, 2.0]), values, "vector", width=0.5))
    spectrum.layout.xaxis.tickvals, spectrum.layout.xaxis.ticktext = [1, 2], ["λ₁", "λ₂"]
    return {"form": quadratic, "spectrum": spectrum}


def _readouts(p: "Params", r: "Result") -> list[Readout]:
    if p.picture == "involution":
        wrong = float(np.abs(r.B @ r.B - np.eye(2)).max())
        return [Readout("c", float(r.B[1, 0])), Readout("wrong", wrong, "", 2),
                Readout("det", float(np.linalg.det(r.B))),
                Readout("kind", "symmetric" if abs(r.B[0, 1] - r.B[1, 0]) < 1e-9 else "not symmetric")]
    angle = float(np.rad2deg(np.arctan2(r.Q[1, 0], r.Q[0, 0])))
    found = [Readout("lambda_1", float(r.values[0])), Readout("lambda_2", float(r.values[1])),
             Readout("angle", angle, "°"), Readout("det", float(np.linalg.det(r.A)))]
    if p.picture == "roots":
        found.append(Readout("wrong", float(np.abs(r.product - r.A).max()), "", 2))
    return found


def _equations(p: "Params", r: "Result", step: int) -> list[Equation]:
    from lessons.background.matrix_root import PER_STAGE

    if p.picture == "involution":
        return [Equation("involution", (r"B =", r.B, r"\quad BB =", r.B @ r.B))]
    stage = min((step - 1) // PER_STAGE, 2) if step else -1
    stepped = p.picture == "factors"
    found = [Equation("matrix", (r"A =", r.A)),
             Equation("turn", (r"Q^T =", r.Q.T), current=stepped and stage == 0),
             Equation("scale", (r"\Lambda^{1/2} =" if p.of_root == "root" else r"\Lambda =", r.factors[1]),
                      current=stepped and stage == 1),
             Equation("back", (r"Q =", r.Q), current=stepped and stage == 2),
             Equation("root", (r"A^{1/2} = Q\Lambda^{1/2}Q^T =", r.symmetric))]
    if p.picture == "roots":
        product = r"C C =" if p.other == "signs" else r"C C^T ="
        found.append(Equation("other", (r"C =", r.other, r"\quad " + product, r.product)))
    return found
