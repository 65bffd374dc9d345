"""How the normal law is drawn: the ellipse with samples, the density as a surface, a linear form beside the plane."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import ellipse, log_density
from core.types import Array
from lessons.background._normal_figures import equations, figures, readouts
from lessons.kit.curves import clipped
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import Arrow, Camera, Item, LevelEllipse, Orbit, Plane, Points, Polyline, Segments, Surface

if TYPE_CHECKING:
    from lessons.background.normal_distribution import Params, Result

CELLS, MOST = 61, 161         # of the surface's grid: at the least, and for a thin one
HILL = 0.55                  # height of the surface, as a share of the picture's half width
LINE = 0.5                   # longest bar of the histogram, likewise


def view(p: "Params", r: "Result", at: Moment) -> View:
    half = _half(r)
    scene, camera = _surface(r) if p.show == "surface" else _plane(p, r, half)
    note = "Singular: no density in the plane, all mass lies on a line (or in a point)." if r.singular else ""
    return View(scene=scene, camera=camera, figures=figures(p, r), readouts=readouts(p, r), equations=equations(p, r),
                caption=_caption(p, r), note=note)


def _caption(p: "Params", r: "Result") -> str:
    if p.show == "form":
        return f"a'x has mean {round(r.form_mean, 6) + 0.0:.3g} m and σ {r.form_sd:.3g} m"
    held = ("the point", "the part of the line", "the ellipse")[r.rank]
    return f"{held} that holds {100 * p.probability if r.rank else 100:.3g} %"


def _half(r: "Result") -> float:
    """Half the picture's width: 12 as in the source where that is enough."""
    reach = float(np.abs(r.law.mean).max()) + 2.6 * float(np.sqrt(max(r.values.max(), 0.0)))
    return max(12.0, 1.02 * reach)


def _plane(p: "Params", r: "Result", half: float) -> tuple[list[Item], Camera]:
    box = half * np.array([1.0, 1.0])

    def visible(x: Array) -> Array:
        return (np.abs(x) <= box).all(axis=1)

    items: list[Item] = []
    if r.rank == 1:
        reach = np.sqrt(r.level * r.values[0]) * r.vectors[:, 0]
        ends = np.array([[r.law.mean - reach, r.law.mean + reach]])
        items.append(Segments("part", ends, role="posterior", width=16.0))
    for name, chosen, role in (("outside", ~r.inside, "monte_carlo"), ("inside", r.inside, "measurement")):
        if (chosen & visible(r.x)).any():
            items.append(Points(name, r.x[chosen & visible(r.x)], role=role, size=6.5))
    if p.both:
        shown = visible(r.x) & visible(r.other)
        if shown.any():
            items += [Points("other", r.other[shown], role="likelihood", size=6.5, shape="square"),
                      Segments("pairs", np.stack([r.x[shown], r.other[shown]], axis=1), role="muted", width=1.2)]
    if not r.singular:
        items.append(LevelEllipse("level", r.law, role="posterior", probability=p.probability, width=4.0, cross=False))
    items += _axes(r)
    if p.show == "form":
        items += _form(p, r, half)
    return items, Plane((-half, half), (-half, half), "x₁ (m)", "x₂ (m)")


def _axes(r: "Result") -> list[Item]:
    """Eigenvectors as long as the standard deviations along them."""
    items: list[Item] = []
    for k, name in ((0, "long_axis"), (1, "short_axis")):
        half = np.sqrt(max(r.values[k], 0.0)) * r.vectors[:, k]
        if np.sqrt(half @ half) > 1e-6:
            items.append(Segments(name, np.array([[r.law.mean - half, r.law.mean + half]]), role="vector", width=3.0))
    return items


def _form(p: "Params", r: "Result", half: float) -> list[Item]:
    """The direction a, the line a'x = c, and the law of a'x as a curve along a below the samples."""
    box = half * np.array([[-1.0, -1.0], [1.0, 1.0]])
    across = np.array([-r.a[1], r.a[0]])
    up = across if across[1] >= 0 else -across
    base = -0.9 * half * up
    far = 2.0 * half
    items: list[Item] = [Arrow("a", -0.35 * half * r.a, 0.35 * half * r.a, role="reference", width=4.0)]
    lines = {"edge": (np.array([p.limit * r.a - far * across, p.limit * r.a + far * across]), "warning", 3.0),
             "ruler": (np.array([base - far * r.a, base + far * r.a]), "muted", 1.5)}
    if r.form_sd > 1e-9:
        t = np.linspace(r.form_mean - 4 * r.form_sd, r.form_mean + 4 * r.form_sd, 81)
        tall = LINE * half * np.exp(-0.5 * ((t - r.form_mean) / r.form_sd) ** 2)
        ground = base + t[:, None] * r.a
        bell = ground + tall[:, None] * up
        lines["bell"] = (bell, "posterior", 3.5)
        low = (t <= p.limit) & (np.abs(ground) <= half).all(axis=1) & (np.abs(bell) <= half).all(axis=1)
        if low.any():
            items.append(Segments("below", np.stack([ground[low], bell[low]], axis=1), role="warning", width=2.0))
    for name, (points, role, width) in lines.items():
        pieces = clipped(points, box)
        if len(pieces):
            items.append(Segments(name, pieces, role=role, width=width))
    return items


def _surface(r: "Result") -> tuple[list[Item], Camera]:
    half = 3.0 * max(float(np.sqrt(max(r.values.max(), 0.0))), 1.0)
    thin = float(np.sqrt(max(r.values.min(), 0.0)))
    x = np.linspace(-half, half, int(np.clip(4.0 * half / max(thin, 1e-9), CELLS, MOST)))
    items: list[Item] = [Segments("ground", r.law.mean + _frame(half), role="muted", width=1.5)]
    if not r.singular:
        xx, yy = np.meshgrid(x + r.law.mean[0], x + r.law.mean[1])
        z = np.exp(log_density(r.law, np.stack([xx, yy], axis=-1)) - log_density(r.law, r.law.mean))
        scale = HILL * half
        items.append(Surface("density", x + r.law.mean[0], x + r.law.mean[1], scale * z, role="posterior", opacity=0.7,
                             contours=6))
        level = ellipse(r.law, r.level)
        height = np.full((len(level), 1), scale * float(np.exp(-0.5 * r.level)) + 0.05)
        items += [Polyline("level", np.hstack([level, height]), role="measurement", width=5.0, closed=True),
                  Polyline("level_below", np.hstack([level, np.zeros_like(height)]), role="measurement", width=2.5,
                           closed=True)]
    centre = (*r.law.mean.tolist(), 0.25 * HILL * half)
    return items + _axes(r), Orbit(centre, 1.5 * half, -62.0, 28.0)


def _frame(half: float) -> Array:
    c = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    return np.stack([c, np.roll(c, -1, axis=0)], axis=1)
