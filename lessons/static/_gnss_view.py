"""How a fix is drawn: the cloud of all epochs in local axes, or the satellites round the globe."""

from typing import TYPE_CHECKING

import numpy as np

from core.frames import dcm_enu_from_ecef, ecef_from_geodetic
from core.gnss import Fix
from core.types import Array, Gaussian
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import Panel
from lessons.kit.scene import Camera, Frame, Globe, Item, Label, LevelEllipse, Orbit, Plane, Points, Segments
from lessons.static._gnss_figures import equations, figures, readouts

if TYPE_CHECKING:
    from lessons.static.gnss_fix import Params, Result

SATELLITES, CORRECTIONS, BANCROFT, NEWTON = range(4)
MEGAMETRE = 1e6                     # the globe's scene unit
SMALL = 1e-9


def view(p: "Params", r: "Result", at: Moment) -> View:
    f = r.fixes[at.step]
    found = f if isinstance(f, Fix) else None
    note = r.source.note or (f if isinstance(f, str) else _note(p, r, f))
    scene, camera = _globe(r, found, at.stage) if p.picture == "globe" else _cloud(p, r, found, at)
    return View(scene=scene, camera=camera, figures=figures(p, r, at.step), readouts=readouts(r, at.step),
                equations=equations(r, at), note=note,
                caption=f"{r.source.name}: epoch {at.step + 1} of {len(r.fixes)}")


def _note(p: "Params", r: "Result", f: Fix) -> str:
    missing = [f"{', '.join(f.missing)} without an ephemeris"] if f.missing else []
    if p.ionosphere and r.source.alpha is None:
        missing.append("no broadcast ionosphere: that correction is zero")
    return "; ".join(missing)


def _cloud(p: "Params", r: "Result", f: Fix | None, at: Moment) -> tuple[list[Item], Camera]:
    """East and north as a map in metres, up beside it on the same scale."""
    points = [r.enu, r.enu_all, np.zeros((1, 3))]
    some = np.concatenate([a[np.isfinite(a).all(axis=1)] for a in points])
    low, high = np.quantile(some, 0.01, axis=0), np.quantile(some, 0.99, axis=0)
    low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    side = 1.25 * max(float((high - low).max()), 1.5)
    middle = 0.5 * (low + high)
    plan = Panel(middle[:2] - side / 2, middle[:2] + side / 2, middle[:2] - side / 2, np.array([side, side]))
    t = np.array([0.0, max(len(r.fixes) - 1.0, 1.0)])
    corner = np.array([middle[0] + 0.72 * side, middle[1] - side / 2])
    tall = Panel(np.array([t[0], middle[2] - side / 2]), np.array([t[1], middle[2] + side / 2]), corner,
                 np.array([0.5 * side, side]))
    pixel = side / 560.0
    items = plan.axes("plan", ("seen from above", "east (m)", "north (m)"), pixel)
    items += tall.axes("tall", ("height", "epoch", "up (m)"), pixel)
    items += _clouds(r, plan, tall)
    if f is not None:
        items += _now(r, at, plan, tall)
    zero = plan.place(np.zeros(2))
    items.append(Points("marker", [zero], role="truth", size=15, shape="diamond"))
    level = tall.place(np.array([[t[0], 0.0], [t[1], 0.0]]))
    items.append(Segments("marker_height", level[None], role="truth", width=2.0))
    top = plan.corner + plan.size
    camera = Plane((float(plan.corner[0] - 70 * pixel), float(tall.corner[0] + tall.size[0] + 20 * pixel)),
                   (float(plan.corner[1] - 62 * pixel), float(top[1] + 72 * pixel)), axes=False)
    return items, camera


def _clouds(r: "Result", plan: Panel, tall: Panel) -> list[Item]:
    items: list[Item] = []
    epochs = np.arange(len(r.fixes), dtype=float)
    for name, enu, law, role in (("all", r.enu_all, r.law_all, "muted"), ("fixes", r.enu, r.law, "posterior")):
        good = np.isfinite(enu).all(axis=1)
        inside = good & plan.inside(enu[:, :2])
        if name == "all" and np.array_equal(r.enu, r.enu_all, equal_nan=True):
            continue
        if inside.any():
            items.append(Points(name, plan.place(enu[inside, :2]), role=role, size=6.5))
        flat = Gaussian(law.mean[:2], law.cov[:2, :2])
        if plan.inside(flat.mean) and np.trace(flat.cov) > SMALL:
            items.append(LevelEllipse(f"{name}_law", plan.law(flat), role=role, probability=0.95, width=3.0))
        up = np.column_stack([epochs, enu[:, 2]])[good]
        up = up[tall.inside(up)]
        if len(up):
            items.append(Points(f"{name}_up", tall.place(up), role=role, size=6.5))
    return items


def _now(r: "Result", at: Moment, plan: Panel, tall: Panel) -> list[Item]:
    """Bancroft's and the last solution of this epoch."""
    items: list[Item] = []
    for name, enu, role, stage, size in (("bancroft", r.enu_start, "linearised", BANCROFT, 13),
                                         ("now", r.enu, "measurement", NEWTON, 13)):
        here = enu[at.step]
        if at.stage >= stage and np.isfinite(here).all():
            spots = [panel.place(where) for panel, where in ((plan, here[:2]), (tall, np.array([at.step, here[2]])))
                     if panel.inside(where)]
            if spots:
                items.append(Points(name, np.array(spots), role=role, size=size))
    return items


def _globe(r: "Result", f: Fix | None, stage: int) -> tuple[list[Item], Camera]:
    lat, lon, h = r.origin
    x = ecef_from_geodetic(lat, lon, h) / MEGAMETRE
    axes = dcm_enu_from_ecef(lat, lon).T
    items: list[Item] = [Globe("earth", 6.378137, 6.356752), Points("receiver", [1.002 * x], role="truth", size=14),
                         Frame("enu", axes, 1.002 * x, 4.5, ("E", "N", "U"))]
    if f is not None:
        s = f.satellites_m / MEGAMETRE
        out = 1.06
        for name, chosen, role in (("used", f.used, "measurement"), ("masked", ~f.used, "muted")):
            if chosen.any():
                items.append(Points(name, s[chosen], role=role, size=13, shape="square"))
                lines = np.stack([np.broadcast_to(x, s[chosen].shape), s[chosen]], axis=1)
                items.append(Segments(f"{name}_lines", lines, role=role, width=1.8, fade=0.3))
        items += [Label(f"name_{n}", n, out * at, 0.95) for n, at in zip(f.names, s, strict=True)]
        if stage == BANCROFT:
            items += _roots(f, x)
    centre = 0.55 * x * 1.6
    azimuth = float(np.degrees(lon)) + 35.0
    return items, Orbit(tuple(centre.tolist()), 28.0, azimuth, 22.0)


def _roots(f: Fix, x: Array) -> list[Item]:
    """The direction of Bancroft's other root, which lies in space."""
    roots = np.asarray(f.start.roots)[:, :3] / MEGAMETRE
    other = roots[int(np.square(roots - x).sum(axis=1).argmax())]
    far = float(np.sqrt(other @ other))
    shown = other * min(1.0, 20.0 / max(far, 1e-9))
    return [Points("other_root", [shown], role="warning", size=15, shape="diamond"),
            Label("other_root_name", f"other root, {1e3 * far:,.0f} km from the centre", 1.12 * shown, 0.9)]


