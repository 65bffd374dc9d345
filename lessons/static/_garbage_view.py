"""Circles of the ranges, the estimate that the bad one pulls away, and what repairs it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from core.dop import position_covariance
from core.sensors import Range
from core.types import Array, Gaussian
from lessons.kit.lesson import Moment, View
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, LevelEllipse, Plane, Points, Polyline, Segments, Stations
from lessons.static._garbage_figures import equations, figures, readouts, suspect
from lessons.static._garbage_model import Garbage

if TYPE_CHECKING:
    from lessons.static.garbage_measurements import Params

MEASURE, SOLVE, TEST, REPAIR, REPEAT = range(5)
PROBABILITY = 0.95
EMPTY = "These stations determine no position: they lie in one point or on one line with the user."


def view(p: "Params", r: Garbage | None, at: Moment, steps: int) -> View:
    """The ranges, least squares, the test, leaving out, and Huber's weights up to this round."""
    if r is None:
        stations = np.array([getattr(p, f"station_{i + 1}") for i in range(p.count)])
        return View(scene=stations_in(stations, [f"S{i + 1}" for i in range(p.count)]),
                    camera=camera(picture(p, stations, np.zeros((0, 2)))), note=EMPTY)
    box = picture(p, r.stations, np.vstack([r.fix.x, r.single.x[r.single.converged], r.cleaned.x]))
    k = iterate(at.step, steps, len(r.robust.iterates) - 1)
    return View(scene=_scene(p, r, at.stage, k, box), camera=camera(box), figures=figures(p, r, k),
                readouts=readouts(p, r, at.stage, k), equations=equations(p, r, at.stage, k),
                caption=_caption(p, r, at.stage, k), note=_note(p, r, at.stage))


def _caption(p: "Params", r: Garbage, stage: int, k: int) -> str:
    if stage == TEST:
        found = suspect(r)
        if r.test.passed:
            return "The residuals are as small as they should be"
        return "Too large residuals: something is wrong" + ("" if found is None else f", probably range {found + 1}")
    if stage == REPAIR:
        return "Left out: range " + ", ".join(str(i + 1) for i in r.cleaned.excluded) if r.cleaned.excluded else (
            "Nothing is left out")
    return f"Huber's weights, round {k}" if stage == REPEAT else ""


def _note(p: "Params", r: Garbage, stage: int) -> str:
    if stage < TEST:
        return ""
    if r.test.freedom == 1:
        return "Only one range more than unknowns: garbage can be noticed, but all |w| are equal, so not located."
    if r.test.redundancy[r.bad] < 0.05:
        return f"The other ranges hardly check range {r.bad + 1}: its error goes into the position, not the residuals."
    if not r.test.passed and stage >= REPAIR and not r.cleaned.passed:
        return "The test still fails with three ranges left: no more can be left out."
    return ""


def iterate(step: int, steps: int, last: int) -> int:
    """Which iterate a step of the timeline shows; its end shows the last one."""
    return last if step == steps else min(step, last)


def picture(p: "Params", stations: Array, estimates: Array) -> Array:
    """Corners (2, 2) of a square round the stations, user and estimates (k, 2) that are not too far away.

    From near without the stations.
    """
    user = np.array(p.user)
    points = np.vstack([stations, user])
    reach = 1.5 * max(float(np.ptp(points, axis=0).max()), 60.0)
    near = estimates[(np.abs(estimates - user) < reach).all(axis=1)]
    if p.zoom == "near":
        half = 1.3 * max(float(np.abs(near - user).max(initial=0.0)), 3.0 * p.sigma_m)
        return np.array([user - half, user + half])
    points = np.vstack([points, near])
    centre, half = 0.5 * (points.min(axis=0) + points.max(axis=0)), 0.6 * float(np.ptp(points, axis=0).max())
    return np.array([centre - max(half, 20.0), centre + max(half, 20.0)])


def camera(box: Array) -> Plane:
    return Plane((float(box[0, 0]), float(box[1, 0])), (float(box[0, 1]), float(box[1, 1])), "x, east (m)",
                 "y, north (m)")


def circles(stations: Array, y: Array, box: Array, roles: list[Role], fades: Array) -> list[Item]:
    """Where each range alone would put the user, as far as it lies in the picture."""
    t = np.linspace(0.0, 2.0 * np.pi, 361)
    unit = np.column_stack([np.sin(t), np.cos(t)])
    items: list[Item] = []
    for i, (s, radius, role, fade) in enumerate(zip(stations, y, roles, fades, strict=True)):
        line = s + radius * unit
        inside = ((line >= box[0]) & (line <= box[1])).all(axis=1)
        pairs = np.stack([line[:-1], line[1:]], axis=1)[inside[:-1] & inside[1:]]
        if len(pairs):
            first = i == roles.index(role)                # the legend explains one of each
            name = ("bad_range" if role == "warning" else "range") if first else f"range_{i + 1}"
            items.append(Segments(name, pairs, role=role, width=2.5, fade=float(fade)))
    return items


def stations_in(stations: Array, names: Sequence[str]) -> list[Item]:
    return [Stations("stations", stations, tuple(names))] if len(stations) else []


def _scene(p: "Params", r: Garbage, stage: int, k: int, box: Array) -> list[Item]:
    m = len(r.y)
    roles: list[Role] = ["warning" if i == r.bad and p.error_m else "measurement" for i in range(m)]
    fades = 0.9 * (1.0 - r.robust.weights[k]) if stage == REPEAT else np.zeros(m)
    names = tuple(f"S{i + 1}" for i in range(m))
    if stage == TEST:
        names = tuple(f"S{i + 1}: |w| = {abs(w):.1f}" for i, w in enumerate(r.test.normalised))
    elif stage == REPEAT:
        names = tuple(f"S{i + 1}: weight {w:.2f}" for i, w in enumerate(r.robust.weights[k]))
    items = circles(r.stations, r.y, box, roles, fades)
    if stage >= SOLVE:
        items.append(LevelEllipse("least_squares", Gaussian(r.fix.x, r.fix.cov), role="posterior",
                                  probability=PROBABILITY, filled=stage == SOLVE, width=3.5))
    if stage in (SOLVE, TEST):
        items.append(_residuals(r))
    if stage >= REPAIR:
        items += _left_out(p, r, 0.017 * float(np.ptp(box[:, 0])))
    if stage == REPEAT:
        path = r.robust.iterates[:k + 1]
        items += [Polyline("huber", path, role="innovation", width=2.5),
                  Points("huber_points", path, role="innovation", size=7),
                  Points("huber_now", path[-1:], role="innovation", size=14, shape="square")]
    items.append(Points("truth", [p.user], role="truth", size=10, shape="diamond"))
    seen = ((r.stations >= box[0]) & (r.stations <= box[1])).all(axis=1)
    return [*items, *stations_in(r.stations[seen], [n for n, here in zip(names, seen, strict=True) if here])]


def _residuals(r: Garbage) -> Segments:
    """From the estimate towards or away from each station, as far as its range would have it."""
    x = r.fix.x
    J = r.fix.jacobians[-1]
    return Segments("residuals", np.stack([np.tile(x, (len(J), 1)), x - r.test.residuals[:, None] * J], axis=1),
                    role="reference", width=4.0)


def _left_out(p: "Params", r: Garbage, gap: float) -> list[Item]:
    """Estimates without each range in turn, named at a gap, and what is left when the test is content."""
    good = r.single.converged & np.isfinite(r.single.x).all(axis=1)
    shown = np.flatnonzero(good)
    items: list[Item] = []
    if len(shown):
        items.append(Points("without_one", r.single.x[shown], role="sigma", size=9, shape="diamond"))
        beside = r.single.x + np.array([gap, 0.0])
        items += [Label(f"without_{i + 1}", f"−{i + 1}", beside[i], 0.85, "left") for i in shown]
    if r.cleaned.excluded:
        J = Range(r.stations, p.sigma_m).jacobian(r.cleaned.x)[r.cleaned.kept]
        law = Gaussian(r.cleaned.x, position_covariance(J, 1.0, p.sigma_m**2))
        items.append(LevelEllipse("cleaned", law, role="likelihood", probability=PROBABILITY, width=3.5, filled=True))
    return items
