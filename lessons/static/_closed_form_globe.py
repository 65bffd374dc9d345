"""Bancroft's method round the globe: spheres that meet, a straight line in space, and its two points."""

from typing import TYPE_CHECKING

import numpy as np

from core.geodesy import WGS84
from core.types import Array
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import Globe, Item, Label, Orbit, Points, Polyline, Satellites, Segments
from lessons.static._closed_form_figures import figures
from lessons.static._closed_form_model import MEGAMETRE
from lessons.static._closed_form_numbers import LINE, ROOTS, TESTS, equations, readouts, reasons

if TYPE_CHECKING:
    from lessons.static.closed_form import Params, Result

LARGEST = 58.0                               # 1000 km; roots farther out are only pointed at
AZIMUTH_DEG = -62.0


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this stage of this experiment, in 1000 km."""
    k = at.step
    roots = _roots(r, k)
    near = [x for x in roots if np.isfinite(x).all() and np.linalg.norm(x) < LARGEST]
    reach = max(np.linalg.norm(x) for x in [*_satellites(r), np.array(p.user), *near])
    return View(
        scene=_scene(p, r, at, roots, 1.25 * reach), camera=Orbit((0.0, 0.0, 0.0), 1.12 * reach, AZIMUTH_DEG, 14.0),
        figures=figures(p, r, at), readouts=readouts(p, r, at), equations=equations(p, r, at),
        caption="as measured" if k == 0 else f"experiment {k}: σ = {p.sigma_m:.3g} m", note=_note(r, k))


def _satellites(r: "Result") -> Array:
    return r.problem.stations_m / MEGAMETRE


def _roots(r: "Result", k: int) -> Array:
    """Positions (2, 3) in 1000 km."""
    return np.full((2, 3), np.nan) if r.fix is None else r.fix.roots[k, :, :3] / MEGAMETRE


def _note(r: "Result", k: int) -> str:
    if r.fix is None:
        return "No closed form: these satellites coincide, or lie on one line or cone with the user. Drag them apart."
    if not np.isfinite(r.fix.roots[k]).any():
        return "The quadratic has no real roots."
    if not r.fix.admissible[k].any():
        return "No root is admissible."
    if r.fix.admissible[k].all():
        return "Both roots pass both tests."
    if r.fix.origin[k].any():
        return "The satellites' plane passes through the Earth's centre: λ is reckoned from another point."
    return ""


def _scene(p: "Params", r: "Result", at: Moment, roots: Array, reach: float) -> list[Item]:
    satellites, user = _satellites(r), np.array(p.user)
    items: list[Item] = [
        Globe("earth", WGS84.a_m / MEGAMETRE, WGS84.b_m / MEGAMETRE, opacity=0.35),
        Satellites("satellites", satellites, tuple(f"S{i + 1}" for i in range(len(satellites)))),
        Segments("sight", np.stack([satellites, np.broadcast_to(user, satellites.shape)], axis=1), role="measurement",
                 width=1.5, fade=0.3),
    ]
    for i, (s, y) in enumerate(zip(satellites, r.y[at.step], strict=True)):
        circle = _circle(s, user, float(y) / MEGAMETRE)
        if len(circle):
            items.append(Polyline(f"sphere_{i + 1}", circle, role="measurement", width=3.0 if at.stage < LINE else 1.8))
    if r.fix is None:
        return items
    if at.stage >= LINE:
        items += _line(r, at.step, reach)
    if at.stage >= ROOTS:
        items += _both(r, at, roots, reach)
    if at.stage >= TESTS:
        items += _tests(r, at.step, roots, satellites)
    return items


def _circle(satellite: Array, user: Array, radius: float) -> Array:
    """Where the sphere with this radius round the satellite cuts the sphere round the Earth's centre through the user.

    Points (n, 3), none if it does not.  At the user's height all places that fit one pseudorange lie there.
    """
    s, u = float(np.linalg.norm(satellite)), float(np.linalg.norm(user))
    along = (s**2 + u**2 - radius**2) / (2.0 * s) if s > 0.0 else np.inf
    if abs(along) >= u:
        return np.empty((0, 3))
    axis = satellite / s
    e1 = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    e1 /= np.linalg.norm(e1)
    t = np.linspace(0.0, 2.0 * np.pi, 121)[:, None]
    return 1.006 * (along * axis + np.sqrt(u**2 - along**2) * (np.cos(t) * e1 + np.sin(t) * np.cross(axis, e1)))


def _line(r: "Result", k: int, reach: float) -> list[Item]:
    """The positions d lambda + e for all lambda, as far as the sphere of radius `reach`."""
    d, e = r.fix.p[k, :3], (r.fix.q[k, :3] + r.fix.origin[k]) / MEGAMETRE
    size = float(np.linalg.norm(d))
    if size == 0.0:
        return []
    d = d / size
    foot = e - (e @ d) * d
    half = np.sqrt(max(reach**2 - float(foot @ foot), 1.0))
    return [Polyline("line", np.array([foot - half * d, foot + half * d]), role="linearised", width=3.5)]


def _both(r: "Result", at: Moment, roots: Array, reach: float) -> list[Item]:
    """Both roots; their colours are decided by the tests."""
    items: list[Item] = []
    for i, root in enumerate(roots):
        if not np.isfinite(root).all():
            continue
        tested = at.stage >= TESTS
        role = "linearised" if not tested else "posterior" if r.fix.admissible[at.step, i] else "warning"
        distance = float(np.linalg.norm(root))
        place = root if distance < LARGEST else 0.72 * reach * root / distance
        text = f"root {i + 1}" + (f", {reasons(r, at.step, i)}" if tested else "")
        if distance >= LARGEST:
            text += f" ({1000.0 * distance:,.0f} km that way)"
        else:
            items.append(Points(f"root_{i + 1}", [root], role=role, size=22, shape="diamond"))
        items.append(Label(f"name_{i + 1}", text, place + np.array([0.0, 0.0, -0.07 * reach])))
    return items


def _tests(r: "Result", k: int, roots: Array, satellites: Array) -> list[Item]:
    """The sphere through the nearest satellite, and the distances that a rejected root would need."""
    nearest = float(np.linalg.norm(satellites, axis=1).min())
    t = np.linspace(0.0, 2.0 * np.pi, 73)
    zero = np.zeros_like(t)
    rings = [nearest * np.column_stack(c) for c in ((np.cos(t), np.sin(t), zero), (np.cos(t), zero, np.sin(t)),
                                                    (zero, np.cos(t), np.sin(t)))]
    items: list[Item] = [Segments("radius_limit", np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in rings]),
                                  role="reference", width=1.2, fade=0.35)]
    for i, root in enumerate(roots):
        if np.isfinite(root).all() and not r.fix.sign_ok[k, i] and np.linalg.norm(root) < LARGEST:
            items.append(Segments(f"impossible_{i + 1}", np.stack([satellites, np.broadcast_to(root, satellites.shape)],
                                                                  axis=1), role="warning", width=1.2, fade=0.45))
    return items
