"""How confidence sets are drawn: ellipses in the plane, or a law with its intervals and a hundred of them in rows."""

from typing import TYPE_CHECKING

import numpy as np

from core.levels import ellipse
from core.types import Array, Gaussian
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import Panel
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, Plane, Points, Polygon, Polyline, Segments
from lessons.static._confidence_figures import equations, figures, readouts
from lessons.static._confidence_model import STRICT, density

if TYPE_CHECKING:
    from lessons.static.confidence import Params, Result

DRAW, SETS, CHECK = range(3)
OUTLINE = 37                             # points of each of the many ellipses
WIDE, TALL, ROWS, STRIP = 12.0, 3.0, 8.0, 3.4        # of the panels on the line, in scene units
PIXEL = 0.017


def view(p: "Params", r: "Result", at: Moment) -> View:
    """All experiments up to this one, the last of them up to this stage."""
    scene, camera = _plane(p, r, at) if p.space == "plane" else _line(p, r, at)
    name = "experiment" if p.reading == "repeated" else "possible truth"
    return View(scene=scene, camera=camera, figures=figures(p, r, at.step), readouts=readouts(p, r, at.step),
                equations=equations(p, r, at), note=_note(p, r),
                caption=f"{name} k = {at.step} of {len(r.far)}" if at.step else "nothing drawn yet")


def _note(p: "Params", r: "Result") -> str:
    if r.q.any():
        centre = "the truth is not the mean of the estimates" if p.reading == "repeated" else (
            "the sets are not centred at the mean of the posterior")
        return f"Nothing is promised here: {centre} (erratum M10)."
    far = int((np.abs(r.draws) > _half_width(p, r)).sum()) if p.space == "line" else 0
    if far:
        return f"{far} of the {len(r.far)} draws lie outside the picture."
    if r.exact_radius == 0.0:
        return "The exact set of this law is a single point: its mean."
    return ""


def _hits(r: "Result", k: int) -> Array:
    """Which of the first k lie in the normal set."""
    return r.far[:k] < STRICT * r.normal.radius


def _plane(p: "Params", r: "Result", at: Moment) -> tuple[list[Item], Plane]:
    k, repeated = at.step, p.reading == "repeated"
    done = k if at.stage == CHECK else max(k - 1, 0)
    items: list[Item] = [Points("law", r.cloud, role="monte_carlo", size=3.0, fade=0.35)]
    hits = _hits(r, done)
    if repeated and done:
        rings = _outlines(r, r.draws[:done])
        kinds: tuple[tuple[str, Array, Role, float], ...] = (
            ("covering", hits, "posterior", 0.75), ("missing", ~hits, "warning", 0.2))
        items += [Segments(name, rings[mask].reshape(-1, 2, 2), role=role, width=1.2, fade=fade)
                  for name, mask, role, fade in kinds if mask.any()]
    items += _dots(r, done, hits)
    # The sets: round the latest estimate, or round the one that was made.
    if repeated and k:
        items.append(Points("latest", r.draws[k - 1:k], role="measurement", size=15, shape="square"))
        if at.stage >= SETS:
            items += _sets(r, r.draws[k - 1])
    elif not repeated:
        if k:
            items.append(Points("latest", r.draws[k - 1:k], role="truth", size=13, shape="diamond"))
        if at.stage >= SETS or k > 1:
            items += _sets(r, r.q)
    reach = np.maximum(np.sqrt(np.diagonal(r.cov)) * r.chebyshev.radius, r.circle.radius)
    centres = np.abs(r.draws).max(axis=0) if repeated else np.abs(r.q)
    half = 1.04 * np.maximum(reach + centres, np.abs(r.q))
    return items, Plane((-float(half[0]), float(half[0])), (-float(half[1]), float(half[1])), "x₁ (m)", "x₂ (m)")


def _sets(r: "Result", centre: Array) -> list[Item]:
    law = Gaussian(centre, r.cov)
    t = np.linspace(0.0, 2.0 * np.pi, 121)[:-1]
    ring = centre + r.circle.radius * np.column_stack([np.cos(t), np.sin(t)])
    found: list[Item] = [
        Polyline("normal", ellipse(law, r.normal.radius**2)[:-1], role="posterior", width=4.0, closed=True),
        Polyline("chebyshev", ellipse(law, r.chebyshev.radius**2)[:-1], role="sigma", width=4.0, closed=True),
        Polyline("circle", ring, role="linearised", width=2.5, dashed=True, closed=True)]
    if r.exact_radius > 0.0:
        found.append(Polyline("exact", ellipse(law, r.exact_radius**2)[:-1], role="likelihood", width=2.5, dashed=True,
                              closed=True))
    return found


def _outlines(r: "Result", centres: Array) -> Array:
    """The normal sets round these centres as segments (k, OUTLINE - 1, 2, 2)."""
    ring = ellipse(Gaussian(np.zeros(2), r.cov), r.normal.radius**2, OUTLINE)
    return centres[:, None, None, :] + np.stack([ring[:-1], ring[1:]], axis=1)


def _dots(r: "Result", done: int, hits: Array) -> list[Item]:
    """Draws inside the normal set, outside it, and outside Chebyshev's too."""
    far = r.far[:done] >= STRICT * r.chebyshev.radius
    groups: list[tuple[str, Array, Role, float]] = [
        ("inside", hits, "posterior", 6.0), ("outside", ~hits & ~far, "warning", 7.0), ("beyond", far, "warning", 12.0)]
    return [Points(name, r.draws[:done][mask], role=role, size=size, shape="diamond" if name == "beyond" else "circle")
            for name, mask, role, size in groups if mask.any()]


def _line(p: "Params", r: "Result", at: Moment) -> tuple[list[Item], Plane]:
    """From the top: the law with the share in the normal interval, the intervals, and one row per experiment."""
    sd = float(r.axes.semi_axes[0])
    half = _half_width(p, r)
    rows = Panel(np.array([-half, 0.0]), np.array([half, len(r.far) + 1.0]), np.zeros(2), np.array([WIDE, ROWS]))
    repeated = p.reading == "repeated"
    titles = (f"{len(r.far)} intervals: thick normal, thin Chebyshev" if repeated else "possible truths",
              f"position, mean of the {'estimates' if repeated else 'posterior'} at 0 (m)", "k")
    items: list[Item] = [*rows.axes("rows", titles, PIXEL), *_law(p, r, half, sd), *_bars(r, half, sd)]
    items += _intervals(r, at, rows, sd) if repeated else _truths(r, at, rows, sd)
    return items, Plane((-1.0, WIDE + 0.5), (-3.0, ROWS + STRIP + TALL + 0.7), axes=False)


def _half_width(p: "Params", r: "Result") -> float:
    """Of the panels on the line, in m: the intervals, and the draws unless they are very far out."""
    sd = float(r.axes.semi_axes[0])
    half = 1.12 * sd * max(r.chebyshev.radius, r.exact_radius, p.lam if p.law == "extremal" else 0.0) + abs(r.q[0])
    return float(max(half, min(1.05 * np.abs(r.draws).max(), 1.6 * half)))


def _law(p: "Params", r: "Result", half: float, sd: float) -> list[Item]:
    """The density of the draws, or the masses; shaded is what the normal interval round q holds."""
    name = "law of the estimates" if p.reading == "repeated" else "posterior"
    low, high = r.q[0] - sd * r.normal.radius, r.q[0] + sd * r.normal.radius
    corner, size = np.array([0.0, ROWS + STRIP]), np.array([WIDE, TALL])
    frame = Panel(np.array([-half, 0.0]), np.array([half, 1.0]), corner, size)
    box = np.array([[-half, 0.0], [half, 0.0], [half, 1.0], [-half, 1.0]])
    items: list[Item] = [Polyline("law_frame", frame.place(box), role="muted", width=1.8, closed=True),
                         Label("law_title", f"{name}: {100 * r.normal.holds:.3g} % in the normal interval",
                               frame.place(np.array([0.0, 1.05])), 1.1, "bottom")]
    if r.e.law is None:                                  # three points with their probabilities
        x = sd * r.e.points[:, 0]
        kept = r.e.masses > 0.0
        tops = np.column_stack([x, 0.8 * r.e.masses])[kept]
        poles = np.stack([tops * [1.0, 0.0], tops], axis=1)
        return [*items, Segments("density", frame.place(poles), role="truth", width=7.0),
                *(Label(f"mass{i}", f"{m:.3g}", frame.place(top + np.array([0.0, 0.03])), 0.95, "bottom")
                  for i, (top, m) in enumerate(zip(tops, r.e.masses[kept], strict=True)))]
    x = np.linspace(-half, half, 601)
    f = density(r.e.law, x / sd)
    f = 0.92 * f / max(float(f.max()), 1e-12)
    items.append(Polyline("density", frame.place(np.column_stack([x, f])), role="truth", width=3.0))
    inner = x[(x > low) & (x < high) & (f > 1e-4)]        # where there is something to shade
    if len(inner) > 1:
        under = np.column_stack([inner, np.interp(inner, x, f)])
        area = np.vstack([under, [[inner[-1], 0.0], [inner[0], 0.0]]])
        items.append(Polygon("mass", frame.place(area), role="posterior", opacity=0.3))
    return items


def _bars(r: "Result", half: float, sd: float) -> list[Item]:
    """The three intervals round q, with their half-widths."""
    items: list[Item] = []
    kinds: tuple[tuple[str, str, float, Role], ...] = (
        ("exact", "exact", r.exact_radius, "likelihood"), ("normal", "normal", r.normal.radius, "posterior"),
        ("chebyshev", "Chebyshev", r.chebyshev.radius, "sigma"))
    for i, (name, title, radius, role) in enumerate(kinds):     # labelled here, so not in the legend
        y = ROWS + STRIP - 0.75 - 0.62 * i
        ends = (np.clip(r.q[0] + radius * sd * np.array([-1.0, 1.0]), -half, half) + half) * WIDE / (2.0 * half)
        middle = (r.q[0] + half) * WIDE / (2.0 * half)
        text = f"{title}: ± {radius:.3g} σ = ± {radius * sd:.3g} m"
        items.append(Label(f"{name}_text", text, (middle, y + 0.07), 0.9, "bottom"))
        if ends[1] > ends[0]:
            items.append(Polyline(f"{name}_bar", [(ends[0], y), (ends[1], y)], role=role, width=6.0))
        else:
            items.append(Points(f"{name}_bar", [(middle, y)], role=role, size=11))
    return items


def _intervals(r: "Result", at: Moment, rows: Panel, sd: float) -> list[Item]:
    """Row k: the normal interval round estimate k (thick) in Chebyshev's (thin), red where the truth is not in it."""
    k = at.step
    items: list[Item] = []
    done = k if at.stage >= SETS else max(k - 1, 0)
    checked = k if at.stage == CHECK else max(k - 1, 0)
    x, row = r.draws[:done, 0], np.arange(1, done + 1)
    judged = row <= checked
    for name, radius, width, role in (("chebyshev_rows", r.chebyshev.radius, 1.2, "sigma"),
                                      ("normal_rows", r.normal.radius, 2.6, "posterior")):
        ends = np.clip(x[:, None] + sd * radius * np.array([-1.0, 1.0]), rows.low[0], rows.high[0])
        pairs = rows.place(np.stack([ends, np.broadcast_to(row[:, None], ends.shape)], axis=-1))
        miss = judged & (r.far[:done] >= STRICT * radius)
        for key, mask, colour, fade in ((name, ~miss, role, 0.3), (f"{name}_miss", miss, "warning", 0.0)):
            if mask.any():
                items.append(Segments(key, pairs[mask], role=colour, width=width, fade=fade))
    items.append(_pole("pole_truth", r, rows, "truth"))
    if k:
        places = np.column_stack([r.draws[:k, 0], np.arange(1, k + 1)])
        items.append(Points("estimates", rows.place(places[rows.inside(places)]), role="measurement", size=4.0))
    return items


def _pole(name: str, r: "Result", rows: Panel, role: Role) -> Polyline:
    """The point q through all rows."""
    return Polyline(name, rows.place(np.array([[r.q[0], rows.low[1]], [r.q[0], rows.high[1]]])), role=role, width=3.0)


def _truths(r: "Result", at: Moment, rows: Panel, sd: float) -> list[Item]:
    """The intervals stand still; row k: possible truth k, red outside the normal interval."""
    k = at.step
    items: list[Item] = [_pole("pole_estimate", r, rows, "measurement")]
    for name, radius, role in (("chebyshev_band", r.chebyshev.radius, "sigma"),
                               ("normal_band", r.normal.radius, "posterior")):
        ends = np.clip(r.q[0] + sd * radius * np.array([-1.0, 1.0]), rows.low[0], rows.high[0])
        corners = [(ends[0], 0.0), (ends[1], 0.0), (ends[1], rows.high[1]), (ends[0], rows.high[1])]
        items.append(Polygon(name, rows.place(np.array(corners)), role=role, opacity=0.14))
    done = k if at.stage == CHECK else max(k - 1, 0)
    places = np.column_stack([r.draws[:, 0], np.arange(1, len(r.far) + 1)])
    shown, hits = rows.inside(places), _hits(r, done)
    kinds: tuple[tuple[str, Array, Role], ...] = (("inside", hits, "posterior"), ("outside", ~hits, "warning"))
    items += [Points(name, rows.place(places[:done][mask & shown[:done]]), role=role, size=7.0)
              for name, mask, role in kinds if (mask & shown[:done]).any()]
    if k > done and shown[k - 1]:
        items.append(Points("latest", rows.place(places[k - 1:k]), role="truth", size=11, shape="diamond"))
    return items
