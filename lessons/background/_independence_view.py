"""The joint law with its marginals at two sides, cut where the user likes; or two directions and what they see."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import affine
from core.types import Array, Gaussian
from lessons.background._framed import framed
from lessons.background._independence_figures import equations, figures, readouts
from lessons.background._independence_model import Joint, coefficient, difference, facts, law_of, probe_of
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import Panel
from lessons.kit.scene import Arrow, HeatMap, Item, Label, LevelEllipse, Plane, Points, Polygon, Polyline, Segments

if TYPE_CHECKING:
    from lessons.background.independence import Params, Result

JOINT, MARGINALS, SLICE, DIFFERENCE = range(4)
CURVE = 301
MAP = 81                                 # cells per axis of the drawn difference
STRIP = 0.05                             # half width of the highlighted strip, in half sides
BESIDE, GAP = 0.62, 0.12                 # depth and distance of the marginals, in half sides
EDGE = 18.0                              # half the side of the square of the two directions, in m


def view(p: "Params", r: "Result", at: Moment) -> View:
    """One of the two kinds of picture, up to this stage."""
    if p.picture == "directions":
        scene, camera, note = _directions(p, r, at.stage)
        caption = f"A = ({r.a[0]:.2f}, {r.a[1]:.2f}), B = ({r.b[0]:.2f}, {r.b[1]:.2f})".replace("-", "−")
        return View(scene=scene, camera=camera, figures=figures(p, r, at), readouts=readouts(p, r, at),
                    equations=equations(p, r, at), caption=caption, note=note)
    law, k = law_of(p, at.step), coefficient(p, at.step)
    scene, camera = _slices(p, r, law, k, at.stage)
    return View(scene=scene, camera=camera, figures=figures(p, r, at), readouts=readouts(p, r, at),
                equations=equations(p, r, at), caption=_caption(p, law, at.stage), note=_note(p, law, k, at.stage))


def _caption(p: "Params", law: Joint, stage: int) -> str:
    """What the slice says of the first coordinate, and what is known without it."""
    first, second, unit = _names(p)
    unit = "" if unit == "no unit" else f" {unit}"
    alone = facts(law).sd
    if stage < SLICE or float(law.marginal(1, probe_of(p)[1])) == 0.0:
        return f"{first} alone: 0 ± {alone:.2f}{unit} (1σ)"
    mean, sd = (float(v) for v in law.given(probe_of(p)[1]))
    return (f"{first} | {second} = {probe_of(p)[1]:.3g}: {round(mean, 2) + 0.0:.2f} ± {sd:.2f}{unit}; "
            f"alone ± {alone:.2f}{unit} (1σ)").replace("-", "−")


def _note(p: "Params", law: Joint, k: float, stage: int) -> str:
    if stage >= SLICE and float(law.marginal(1, probe_of(p)[1])) == 0.0:
        return "The slice misses the set: f₂ = 0 there, and nothing is conditioned on it."
    if p.picture == "remainder":
        return f"z = x − {k:.3f} y" if k >= 0.0 else f"z = x + {-k:.3f} y"
    return ""


def _names(p: "Params") -> tuple[str, str, str]:
    """First and second coordinate, and their unit."""
    return {"normal": ("x", "y", "m"), "remainder": ("z", "y", "m")}.get(p.picture, ("x₁", "x₂", "no unit"))


def _slices(p: "Params", r: "Result", law: Joint, k: float, stage: int) -> tuple[list[Item], Plane]:
    """The square of the joint law; f_1 and the conditional law above it, f_2 at its right."""
    h = law.half
    first, second, unit = _names(p)
    per = "" if unit == "no unit" else f" (1/{unit})"
    pixel = 2.75 * h / 760.0
    square = Panel(np.array([-h, -h]), np.array([h, h]), np.array([-h, -h]), np.array([2 * h, 2 * h]))
    c = float(probe_of(p)[1])
    t = np.linspace(-h, h, CURVE)
    marginals = law.marginal(0, t), law.marginal(1, t)
    top = 1.12 * max(float(marginals[0].max()), min(_peak(law, c, t), 3.5 * float(marginals[0].max())))
    above = Panel(np.array([-h, 0.0]), np.array([h, top]), np.array([-h, h * (1 + GAP)]), np.array([2 * h, BESIDE * h]))
    right = Panel(np.array([0.0, -h]), np.array([1.12 * float(marginals[1].max()), h]),
                  np.array([h * (1 + GAP), -h]), np.array([BESIDE * h, 2 * h]))
    items = framed(square, "joint", f"{first} ({unit})", f"{second} ({unit})", pixel)
    cloud = r.cloud @ np.array([[1.0, 0.0], [-k, 1.0]])
    if stage == DIFFERENCE:
        items += _map(law)
    near = np.abs(cloud[:, 1] - c) < STRIP * h if stage >= SLICE else np.zeros(len(cloud), dtype=bool)
    shown = square.inside(cloud)
    items.append(Points("cloud", cloud[shown & ~near], role="monte_carlo", size=3.0,
                        fade=0.55 if stage == DIFFERENCE else 0.15))
    if stage >= MARGINALS:
        items += _marginals(above, right, t, marginals, f"f({first}){per}", f"f({second}){per}", pixel)
    if stage >= SLICE and float(law.marginal(1, c)) > 0.0:
        items += _slice(p, law, above, right, t, cloud[near & shown], pixel)
    if stage >= SLICE:
        c2 = np.linspace(-1.0, 1.0, 121) * 0.9999 * law.reach[1]
        means, _ = law.given(c2)
        path = np.column_stack([means, c2])
        items.append(Polyline("means", path[square.inside(path)], role="vector", width=3.0, dashed=True))
    end = h * (1 + GAP + BESIDE)
    return items, Plane((-h - 58 * pixel, end + 8 * pixel), (-h - 58 * pixel, end + 28 * pixel), axes=False)


def _peak(law: Joint, c: float, t: Array) -> float:
    base = float(law.marginal(1, c))
    return float(law.density(np.column_stack([t, np.full(len(t), c)])).max()) / base if base > 0.0 else 0.0


def _map(law: Joint) -> list[Item]:
    """f - f1 f2 in two colours of one scale; nothing where it is zero everywhere."""
    t, gap = difference(law, MAP)
    most, least = float(gap.max()), float(gap.min())
    scale = max(most, -least)
    if scale < 1e-9:
        return []
    return [HeatMap(name, t, t, np.maximum(sign * gap, 0.0), role=role, opacity=0.9 * peak / scale)
            for name, sign, role, peak in (("more", 1.0, "likelihood", most), ("less", -1.0, "measurement", -least))
            if peak > 1e-9]


def _marginals(above: Panel, right: Panel, t: Array, marginals: tuple[Array, Array], first: str, second: str,
               pixel: float) -> list[Item]:
    """Both curves with their frames; the numbers of the density stand at the side."""
    return [*framed(above, "first", "", first, pixel, "x"), *framed(right, "second", second, "", pixel, "y"),
            Polyline("f1", above.place(np.column_stack([t, marginals[0]])), role="prior", width=4.0),
            Polyline("f2", right.place(np.column_stack([marginals[1], t])), role="prior", width=4.0)]


def _slice(p: "Params", law: Joint, above: Panel, right: Panel, t: Array, near: Array, pixel: float) -> list[Item]:
    """The strip, the points in it, one standard deviation to each side of their mean, and the conditional law."""
    h, (x, c) = law.half, probe_of(p)
    base = float(law.marginal(1, c))
    conditional = law.density(np.column_stack([t, np.full(len(t), c)])) / base
    mean, sd = (float(v) for v in law.given(np.array(c)))
    inside = np.column_stack([t, np.minimum(conditional, above.high[1])])
    strip = np.array([[-h, c - STRIP * h], [h, c - STRIP * h], [h, c + STRIP * h], [-h, c + STRIP * h]])
    across = right.place(np.array([base, c]))
    here = above.place(np.array([x, min(float(law.density(np.array([x, c]))) / base, above.high[1])]))
    return [
        Polygon("strip", strip, role="posterior", opacity=0.1),
        Points("near", near, role="posterior", size=4.0),
        Segments("spread", np.array([[[mean - sd, c], [mean + sd, c]]]), role="posterior", width=8.0),
        Polyline("conditional", above.place(inside), role="posterior", width=4.0),
        Segments("probe_lines", np.array([[[x, c], here], [[h, c], across]]), role="muted", width=1.2),
        Points("probe_marks", np.array([here, across]), role="posterior", size=10.0),
    ]


def _directions(p: "Params", r: "Result", stage: int) -> tuple[list[Item], Plane, str]:
    """Left the law of x with both directions, right the law of (a'x, b'x)."""
    P, e = r.P, EDGE
    side = np.array([2 * e, 2 * e])
    pixel = 4.6 * e / 1000.0
    left = Panel(np.array([-e, -e]), np.array([e, e]), np.array([-e, -e]), side)
    right = Panel(np.array([-e, -e]), np.array([e, e]), np.array([1.45 * e, -e]), side)
    law = Gaussian(np.zeros(2), P)
    T = np.array([r.a, r.b])
    images = r.cloud @ T.T
    sd_b = float(np.sqrt(r.b @ P @ r.b))
    near = (np.abs(images[:, 1] - 1.2 * sd_b) < 0.2 * sd_b) & (stage >= SLICE)
    items: list[Item] = [
        *left.axes("left", ("x ~ N(0, Σ)", "x₁ (m)", "x₂ (m)"), pixel),
        Points("cloud", r.cloud[left.inside(r.cloud) & ~near], role="monte_carlo", size=3.0, fade=0.3),
        LevelEllipse("joint", law, role="prior", probability=0.68, width=3.5, cross=False)]
    image = affine(law, T)
    if stage >= MARGINALS:
        items += [Arrow("a", (0.0, 0.0), p.a, role="measurement", width=5.0),
                  Arrow("b", (0.0, 0.0), p.b, role="posterior", width=5.0),
                  Label("a_name", "A", _beside(p.a), 1.0), Label("b_name", "B", _beside(p.b), 1.0),
                  *right.axes("right", ("what A and B see", "Ax (m)", "Bx (m)"), pixel),
                  Points("images", right.place(images[right.inside(images) & ~near]), role="monte_carlo", size=3.0,
                         fade=0.3),
                  LevelEllipse("image", right.law(image), role="prior", probability=0.68, width=3.5, cross=False)]
    if stage >= SLICE:
        end = left.exit(np.zeros(2), 100.0 * P @ r.b / sd_b)     # the way of the mean of x as Bx grows
        slope = image.cov[0, 1] / image.cov[1, 1]
        exits = [right.exit(np.zeros(2), sign * e * np.array([slope, 1.0])) for sign in (-1.0, 1.0)]
        items += [Points("near", r.cloud[left.inside(r.cloud) & near], role="posterior", size=5.0),
                  Points("images_near", right.place(images[right.inside(images) & near]), role="posterior", size=5.0),
                  Polyline("conjugate", np.array([-end, end]), role="vector", width=3.0, dashed=True),
                  Label("conjugate_name", "ΣBᵀ", 0.88 * end + np.array([0.12 * e, 0.0]), 1.0),
                  Polyline("means", right.place(np.array(exits)), role="vector", width=3.0, dashed=True)]
    cross = abs(float(r.a @ P @ r.b)) / (sd_b * float(np.sqrt(r.a @ P @ r.a)))
    note = "A and B are (nearly) parallel: Ax and Bx are the same number." if cross > 0.999 else (
        "AΣBᵀ = 0: Ax and Bx are independent." if cross < 5e-4 else "")
    camera = Plane((-e - 62 * pixel, 3.45 * e + 14 * pixel), (-e - 60 * pixel, e + 70 * pixel), axes=False)
    return items, camera, note


def _beside(v: tuple[float, ...]) -> Array:
    """A little beyond the tip."""
    size = max(float(np.hypot(*v)), 1e-9)
    return np.array(v) * (1.0 + 0.09 * EDGE / size) if size > 1e-6 else np.array([0.09 * EDGE, 0.0])
