"""The points with the sets in which z is small, and beside them the histogram of z with its law."""

from typing import TYPE_CHECKING

import numpy as np

from core.levels import ellipse
from core.types import Array, Gaussian
from lessons.background._chi_square_figures import equations, figures, readouts
from lessons.background._framed import framed
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import Panel
from lessons.kit.scene import Arrow, Item, Label, Plane, Points, Polygon, Polyline, Segments

if TYPE_CHECKING:
    from lessons.background.chi_square import Params, Result

DRAW, SQUARE, LAW = range(3)
BINS = 32
WIDE, TALL = 12.0, 5.4                   # of the panel of the histogram below the half-plane, in scene units
HALVES = {"example7": np.array([13.0, 18.0]), "identity": np.array([5.0, 5.0])}        # m, of the plane of x


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The samples of all batches up to this step; those of the last one up to this stage."""
    k = _count(at.step)
    scene, camera = _norm(p, r, k, at.stage) if p.picture == "norm" else _form(p, r, k, at.stage)
    name = f"χ²({r.df}, {r.lam:.3g})" if r.lam > 1e-12 else f"χ²({r.df})"
    note = "" if r.is_chi_square else (
        f"AΣ is not idempotent: xᵀAx has the mean 2 + λ, but not the law {name} that is drawn.")
    return View(scene=scene, camera=camera, figures=figures(p, r, k), readouts=readouts(p, r, k),
                equations=equations(p, r, k, at.stage), caption=f"{name}, {k} samples", note=note)


def _count(step: int) -> int:
    from lessons.background.chi_square import BATCH

    return step * BATCH


def _norm(p: "Params", r: "Result", k: int, stage: int) -> tuple[list[Item], Plane]:
    """Each point turned about the axis of mu into one half-plane: its distance from the origin stays."""
    reach = 1.03 * float(np.sqrt(r.t[-1]))
    half = Panel(np.array([-reach, 0.0]), np.array([reach, reach]), np.array([0.0, TALL + 1.9]),
                 np.array([WIDE, 0.5 * WIDE]))
    pixel = 14.6 / 760.0
    place = np.column_stack([r.x[:k, 0], np.sqrt(np.square(r.x[:k, 1:]).sum(axis=1))])
    items = framed(half, "half", "x along μ", "distance of x from the axis of μ", pixel)
    items += _dots(half, r, place, k, stage)
    angle = np.linspace(0.0, np.pi, 91)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    if stage >= LAW:
        items += [Polyline("level", half.place(np.sqrt(r.level) * ring), role="posterior", width=4.0),
                  Polyline("mean_level", half.place(np.sqrt(r.df + r.lam) * ring), role="vector", width=2.5,
                           dashed=True)]
    origin = half.place(np.zeros(2))
    items.append(Points("origin", [origin], role="reference", size=9.0))
    if k:
        items += [Segments("radius", np.array([[origin, half.place(place[-1])]]), role="innovation", width=3.0),
                  Points("last", [half.place(place[-1])], role="innovation", size=9.0)]
    if r.lam > 0.0:
        tip = half.place(np.array([np.sqrt(r.lam), 0.0]))
        items += [Arrow("mu", origin, tip, role="vector", width=5.0),
                  Label("mu_name", "μ", tip + np.array([0.0, 16.0 * pixel]), 1.0)]
    items += _histogram(Panel(np.zeros(2), np.array([r.t[-1], _top(r)]), np.zeros(2), np.array([WIDE, TALL])), r, k,
                        stage, pixel, "z = |x|²")
    return items, Plane((-58 * pixel, WIDE + 12 * pixel), (-62 * pixel, TALL + 1.9 + 0.5 * WIDE + 30 * pixel),
                        axes=False)


def _form(p: "Params", r: "Result", k: int, stage: int) -> tuple[list[Item], Plane]:
    """Left the plane of x with the sets x'Ax <= c, right the histogram."""
    half = HALVES[p.spread]
    tips = np.abs([p.mean, 0.8 * np.array(p.a) if p.form == "direction" else p.mean]).max(axis=0)
    zoom = next(z for z in (1.0, 1.5, 2.0, 3.0, 4.0) if z == 4.0 or (tips < 0.7 * z * half).all())
    hx, hy = (float(v) for v in zoom * half)
    plane = Panel(np.array([-hx, -hy]), np.array([hx, hy]), np.array([-hx, -hy]), 2.0 * np.array([hx, hy]))
    pixel = (2.0 * hx + 2.1 * hy) / 1000.0
    items = framed(plane, "plane", "x₁ (m)", "x₂ (m)", pixel)
    items += _dots(plane, r, r.x[:k], k, stage)
    if stage >= LAW:
        items += _level_set(plane, r)
    items += [Points("origin", [(0.0, 0.0)], role="reference", size=9.0),
              Arrow("mu", (0.0, 0.0), p.mean, role="vector", width=5.0),
              Label("mu_name", "μ", np.array(p.mean) + np.array([0.0, 22.0 * pixel]), 1.0)]
    if p.form == "direction":
        items += [Arrow("a", (0.0, 0.0), p.a, role="measurement", width=5.0),
                  Label("a_name", "a", np.array(p.a) * (1.0 + 0.07 * hy / max(float(np.hypot(*p.a)), 1e-6)), 1.0)]
    if k:
        items.append(Points("last", r.x[k - 1:k][plane.inside(r.x[k - 1:k])], role="innovation", size=9.0))
    panel = Panel(np.zeros(2), np.array([r.t[-1], _top(r)]), np.array([hx + 0.42 * hy, -hy]),
                  np.array([1.7 * hy, 1.9 * hy]))
    items += _histogram(panel, r, k, stage, pixel, "z = xᵀAx")
    right = float(panel.corner[0] + panel.size[0])
    return items, Plane((-hx - 58 * pixel, right + 14 * pixel), (-hy - 62 * pixel, hy + 12 * pixel), axes=False)


def _dots(panel: Panel, r: "Result", place: Array, k: int, stage: int) -> list[Item]:
    """Points in the set z <= c and beyond; before the law is known they are all alike."""
    seen = panel.inside(place)
    out = (r.z[:k] > r.level) & (stage >= LAW)
    return [Points("inside", panel.place(place[seen & ~out]), role="monte_carlo", size=3.0),
            Points("outside", panel.place(place[seen & out]), role="measurement", size=4.0)]


def _level_set(plane: Panel, r: "Result") -> list[Item]:
    """Where x'Ax = c: an ellipse, or two lines."""
    if r.df == 2:
        rim = ellipse(Gaussian(np.zeros(2), np.linalg.solve(r.A, np.eye(2))), r.level)
        inside = plane.inside(rim)
        pairs = np.stack([rim[:-1], rim[1:]], axis=1)[inside[:-1] & inside[1:]]
        return [Segments("level", pairs, role="posterior", width=4.0)]
    values, vectors = np.linalg.eigh(r.A)
    normal, along = vectors[:, 1] / np.sqrt(values[1]), vectors[:, 0]
    feet = np.sqrt(r.level) * np.array([normal, -normal])
    ends = [[plane.exit(f, f + 200.0 * along), plane.exit(f, f - 200.0 * along)] for f in feet if plane.inside(f)]
    return [Segments("level", np.array(ends), role="posterior", width=4.0)] if ends else []


def _top(r: "Result") -> float:
    """Height of the panel: the density of one degree of freedom has no largest value."""
    return 1.18 * float(r.density[len(r.t) // 60:].max())


def _histogram(panel: Panel, r: "Result", k: int, stage: int, pixel: float, x_title: str) -> list[Item]:
    """Steps of the sample; the density with the asked probability shaded; the balance point below the axis."""
    end, top = panel.high
    items = framed(panel, "law", x_title, "density of z", pixel)
    if stage >= LAW:
        below = r.t <= r.level
        for name, mask, role in (("accepted", below, "posterior"), ("rejected", ~below, "measurement")):
            if mask.sum() > 1:
                t, f = r.t[mask][::8], np.minimum(r.density[mask], top)[::8]
                rim = np.vstack([[t[0], 0.0], np.column_stack([t, f]), [t[-1], 0.0]])
                items.append(Polygon(name, panel.place(rim), role=role, opacity=0.22))  # type: ignore[arg-type]
    if stage >= SQUARE and k:
        counts, edges = np.histogram(r.z[:k], BINS, (0.0, end))
        heights = np.minimum(counts / (k * (edges[1] - edges[0])), top)
        steps = np.column_stack([np.repeat(edges, 2)[1:-1], np.repeat(heights, 2)])
        items.append(Polyline("histogram", panel.place(steps), role="monte_carlo", width=3.0))
        last = min(float(r.z[k - 1]), float(end))
        items.append(Segments("last_square", panel.place(np.array([[[last, 0.0], [last, 0.16 * top]]])),
                              role="innovation", width=5.0))
    if stage >= LAW:
        curve = np.column_stack([r.t, np.minimum(r.density, top)])
        fits = r.is_chi_square
        items.append(Polyline("density", panel.place(curve), role="posterior" if fits else "warning", width=4.0,
                              dashed=not fits))
        if r.lam > 0.3:                                   # else it would lie on the other curve
            above = np.flatnonzero(r.central >= top)
            central = np.column_stack([r.t, r.central])[above[-1] + 1 if len(above) else 0:]
            items.append(Polyline("central", panel.place(central), role="reference", width=2.5, dashed=True))
        balance = panel.place(np.array([r.df + r.lam, 0.0]))
        size = 10.0 * pixel
        foot = balance + np.array([[-size, -size], [size, -size], [0.0, 0.0]])
        items += [Polygon("balance", foot, role="vector", opacity=0.9),
                  Segments("quantile", panel.place(np.array([[[r.level, 0.0], [r.level, 0.82 * top]]])),
                           role="posterior", width=2.5),
                  Label("quantile_name", f"c = {r.level:.2f}", panel.place(np.array([r.level, 0.88 * top])), 1.0,
                        "right" if r.level > 0.6 * end else "left")]
    return items
