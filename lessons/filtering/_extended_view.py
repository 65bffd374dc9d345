"""How one update of the extended filter is drawn: the curve, its tangent, the true posterior and the ellipse."""

from typing import TYPE_CHECKING

import numpy as np

from core.grid import GridDensity
from core.types import Gaussian
from lessons.filtering._extended_figures import equations, figures, readouts
from lessons.filtering._extended_model import PROBABILITY
from lessons.kit.curves import clipped, level_line, tangent_line
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import HeatMap, Item, LevelEllipse, Plane, Points, Polyline, Segments, Stations

if TYPE_CHECKING:
    from lessons.filtering.extended import Params, Result

PRIOR, LIKELIHOOD, POSTERIOR, TANGENT, UPDATE = range(5)


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this stage of linearisation i; the estimates of earlier ones."""
    i = at.step
    name = "tangent at x₀: the EKF" if i == 0 else f"tangent at x{_subscript(i)}: iterated"
    (x0, y0), (x1, y1) = r.box
    return View(
        scene=_scene(p, r, at), camera=Plane((float(x0), float(x1)), (float(y0), float(y1))),
        figures=figures(p, r, i), readouts=readouts(p, r, i), equations=equations(p, r, i, at.stage), caption=name,
        note=_note(r, at),
    )


def _subscript(i: int) -> str:
    return str(i).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))


def _note(r: "Result", at: Moment) -> str:
    moved = float(np.linalg.norm(r.points[-1] - r.points[-2]))
    if at.step > 0 and moved > 1.0:
        return f"The iterations do not settle: the last one still moves the estimate by {moved:.3g} m."
    if at.stage >= TANGENT and not np.asarray(r.updates[at.step].jacobian).any():
        return "The tangent is flat here: the measurement is ignored."
    return ""


def _scene(p: "Params", r: "Result", at: Moment) -> list[Item]:
    i, stage = at.step, at.stage
    items: list[Item] = []
    if stage == LIKELIHOOD:
        items.append(HeatMap("likelihood", *r.map_axes, r.likelihood.T, role="likelihood", opacity=0.75))
    if stage >= POSTERIOR:
        items.append(_true_posterior(r.exact))
    items += _known(p, r)
    if stage >= LIKELIHOOD:
        items += _measured(r)
    if stage >= TANGENT:
        items += _straightened(r, i)
    if stage >= POSTERIOR:
        items.append(LevelEllipse("moments", r.moments, role="posterior", probability=PROBABILITY, width=3))
    done = i + (stage == UPDATE)                             # estimates that have been computed
    if done:
        items.append(LevelEllipse("ekf", r.updates[0].posterior, role="ekf", probability=PROBABILITY,
                                  width=4.5 if done == 1 else 2.5, filled=done == 1))
    if done > 1:
        latest: Gaussian = r.updates[done - 1].posterior
        items += [Polyline("iterates", r.points[1:done + 1], role="vector", width=2),
                  Points("iterate_points", r.points[1:done + 1], role="vector", size=7),
                  LevelEllipse("iterated", latest, role="vector", probability=PROBABILITY, width=4.5, filled=True)]
    return items


def _true_posterior(exact: GridDensity) -> HeatMap:
    """The probabilities of blocks of 2 x 2 cells: enough for the eye, and a quarter of the data."""
    x, y = (axis.reshape(-1, 2).mean(axis=1) for axis in exact.axes)
    return HeatMap("exact", x, y, exact.weights.reshape(len(x), 2, len(y), 2).sum(axis=(1, 3)).T, role="posterior",
                   opacity=0.85)


def _known(p: "Params", r: "Result") -> list[Item]:
    stations = np.asarray(r.sensor.stations_m)
    shown = [k for k, s in enumerate(stations) if ((s >= r.box[0]) & (s <= r.box[1])).all()]
    items: list[Item] = [LevelEllipse("prior", r.prior, role="prior", probability=PROBABILITY, width=3.5),
                         Points("truth", [p.truth], role="truth", size=13, shape="diamond")]
    if shown:
        items.append(Stations("stations", stations[shown], tuple(f"S{k + 1}" for k in shown)))
    return items


def _measured(r: "Result") -> list[Item]:
    """The curves on which h is what was measured, and one sigma to each side."""
    items: list[Item] = []
    sigma, reach = np.sqrt(np.diagonal(r.sensor.R)), _reach(r)
    for k, (y, s) in enumerate(zip(r.y, sigma, strict=True)):
        for name, value, width, fade in (("curve", y, 2.5, 0.0), ("low", y - s, 1.0, 0.4), ("high", y + s, 1.0, 0.4)):
            pieces = clipped(level_line(r.sensor, k, float(value), reach), r.box)
            if len(pieces):
                items.append(Segments(f"{name}_{k + 1}", pieces, role="measurement", width=width, fade=fade))
    return items


def _straightened(r: "Result", i: int) -> list[Item]:
    """The same lines for h(x_i) + H (x - x_i), and the point where the tangent touches."""
    H = r.updates[i].jacobian
    missing = r.sensor.innovation(r.y, r.sensor.h(r.points[i]))
    items: list[Item] = []
    for k, (slope, gap, s) in enumerate(zip(H, missing, np.sqrt(np.diagonal(r.sensor.R)), strict=True)):
        for name, value, width in (("straight", gap, 3.0), ("straight_low", gap - s, 1.5),
                                   ("straight_high", gap + s, 1.5)):
            pieces = clipped(tangent_line(r.points[i], float(value), slope, _reach(r)), r.box)
            if len(pieces):
                items.append(Segments(f"{name}_{k + 1}", pieces, role="linearised", width=width))
    items.append(Points("touch", r.points[[i]], role="linearised", size=14, shape="square"))
    return items


def _reach(r: "Result") -> float:
    """A length beyond every corner of the picture, as seen from the stations and the estimates."""
    corners = np.concatenate([r.box, np.asarray(r.sensor.stations_m), r.points])
    return 1.5 * float(np.linalg.norm(np.ptp(corners, axis=0)))
