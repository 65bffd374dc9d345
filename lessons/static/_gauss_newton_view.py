"""What the Gauss-Newton lesson draws: the residual norm as a map, straight lines for circles, the iterates."""

from typing import TYPE_CHECKING

import numpy as np

from core.gauss_newton import Solution
from core.level_lines import level_lines
from core.types import Array, Gaussian
from lessons.kit.curves import clipped, level_line, tangent_line
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import nice_step
from lessons.kit.roles import Role
from lessons.kit.scene import Arrow, HeatMap, Item, Label, LevelEllipse, Plane, Points, Segments, Stations
from lessons.static._gauss_newton_figures import equations, figures, readouts
from lessons.static._gauss_newton_model import LIMIT
from lessons.static._gauss_newton_surface import surface

if TYPE_CHECKING:
    from lessons.static.gauss_newton import Params, Result

LINEARISE, SOLVE, STEP, TEST = range(4)
ROW_M = 22.0                                 # drawn length of a row of J, which is a unit vector
ENDS: tuple[Role, ...] = ("posterior", "likelihood", "mixture")
PROBABILITY = 0.68


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this stage of iteration k, over the chosen picture."""
    done = np.zeros((0, 2)) if r.fix is None else r.fix.iterates[:at.step + 1 + (at.stage >= STEP)]
    if p.show == "surface":
        scene, camera = surface(p, r, at, done)
    else:
        (x0, y0), (x1, y1) = r.box.tolist()
        scene, camera = _scene(p, r, at, done), Plane((x0, x1), (y0, y1), "x₁, east (m)", "x₂, north (m)")
    return View(scene=scene, camera=camera, figures=figures(p, r, at), readouts=readouts(p, r, at),
                equations=equations(p, r, at), caption=_caption(p, r, at), note=_note(p, r, at))


def _caption(p: "Params", r: "Result", at: Moment) -> str:
    if r.fix is None:
        return "no step possible"
    if at.stage < TEST:
        return f"iteration {at.step + 1} of {len(r.fix.steps)}"
    length = float(np.linalg.norm(r.fix.steps[at.step]))
    verdict = "go on" if length >= p.tolerance_m else "stop" if r.fix.converged else "but the step is not complete"
    sign = "≥" if length >= p.tolerance_m else "<"
    return f"‖Δx‖ = {length:.3g} m {sign} δ: {verdict}"


def _note(p: "Params", r: "Result", at: Moment) -> str:
    if r.fix is None:
        return ("J is singular at this start: it lies at a station or on the line through both. Click elsewhere, or "
                "switch the damping on.")
    if at.step == len(r.fix.steps) - 1 and not r.fix.converged:
        return f"No convergence in {LIMIT} iterations: these circles, or this start, are not for this method."
    gone = r.fix.iterates[min(at.step + (at.stage >= STEP), len(r.fix.steps))]
    if ((gone < r.box[0]) | (gone > r.box[1])).any():
        return f"The iterate ({gone[0]:.4g}, {gone[1]:.4g}) m lies outside the picture."
    return ""


def _scene(p: "Params", r: "Result", at: Moment, done: Array) -> list[Item]:
    items = _basins(r) if p.show == "basins" else _valleys(r)
    items += _circles(r)
    if r.fix is not None:
        items += _iteration(r, r.fix, at)
        items += _path(r, done)
    items += _ends(r)
    if r.fix is not None and r.fix.converged and at.step == len(r.fix.steps) - 1 and at.stage >= STEP:
        items += _error(p, r)
    stations = np.asarray(r.sensor.stations_m)
    return [*items, Stations("stations", stations, tuple(f"S{k + 1}" for k in range(len(stations))))]


def _valleys(r: "Result") -> list[Item]:
    """The deeper the residual norm, the stronger the colour; level lines at round numbers."""
    top = float(np.quantile(r.norms, 0.9))
    step = nice_step(top / 8.0)
    levels = step * np.arange(1, int(top / step) + 1)
    lines = [level_lines(*r.axes, r.norms, float(level)) for level in levels]
    found: list[Item] = [HeatMap("valleys", *r.axes, np.clip(1.0 - r.norms / top, 0.0, 1.0) ** 2, role="prior",
                                 opacity=0.75)]
    if any(len(line) for line in lines):
        found.append(Segments("levels", np.concatenate(lines), role="muted", width=1.2, fade=0.2))
    return found


def _basins(r: "Result") -> list[Item]:
    """Each start in the colour of its end, paler the more steps it takes; red where it leads nowhere."""
    speed = np.clip(1.12 - 0.07 * r.starts.steps, 0.2, 1.0)
    found: list[Item] = []
    for i, role in ((*enumerate(ENDS[:len(r.ends)]), (-1, "warning"))):
        here = r.where == i
        if here.any():
            name = "lost" if i < 0 else f"basin_{'abc'[i]}"
            found.append(HeatMap(name, *r.axes, np.where(here, 0.6 if i < 0 else speed, 0.0), role=role,
                                 opacity=0.6 * float(0.6 if i < 0 else speed[here].max())))
    return found


def _circles(r: "Result") -> list[Item]:
    """Where each range alone would be fulfilled."""
    reach = float(np.linalg.norm(r.box[1] - r.box[0])) + 200.0
    items: list[Item] = []
    for i, y in enumerate(r.y):
        pieces = clipped(level_line(r.sensor, i, float(y), reach), r.box)
        if len(pieces):
            items.append(Segments(f"circle_{i + 1}", pieces, role="measurement", width=2.5))
    return items


def _iteration(r: "Result", fix: Solution, at: Moment) -> list[Item]:
    """The rows of J at x_k, the straight line that stands for each circle, and where they say to go."""
    k = at.step
    x, J, residual = fix.iterates[k], fix.jacobians[k], fix.residuals[k]
    if ((x < r.box[0]) | (x > r.box[1])).any():
        return []
    reach = float(np.linalg.norm(r.box[1] - r.box[0])) + float(np.abs(residual).max())
    items: list[Item] = []
    for i, (row, missing) in enumerate(zip(J, -residual, strict=True)):
        pieces = clipped(tangent_line(x, float(missing), row, reach), r.box)
        if len(pieces):
            items.append(Segments(f"line_{i + 1}", pieces, role="linearised", width=3.0))
        items.append(Arrow(f"row_{i + 1}", x, x + ROW_M * row, role="linearised", width=5.0))
    target = x + fix.steps[k]
    if at.stage >= SOLVE and ((target >= r.box[0]) & (target <= r.box[1])).all():
        items.append(Points("crossing", [target], role="linearised", size=16, shape="square"))
    return items


def _path(r: "Result", done: Array) -> list[Item]:
    """The iterates so far; the last step as an arrow if it ends in the picture."""
    seen = done[((done >= r.box[0]) & (done <= r.box[1])).all(axis=1)]
    items: list[Item] = [Points("iterates", seen, role="vector", size=9)] if len(seen) else []
    pieces = clipped(done, r.box)
    if len(pieces):
        items.insert(0, Segments("path", pieces, role="vector", width=3.0))
    return items


def _ends(r: "Result") -> list[Item]:
    """What most starts lead to, with letters."""
    items: list[Item] = []
    for i, end in enumerate(r.ends):
        if ((end >= r.box[0]) & (end <= r.box[1])).all():
            letter, gap = "ABC"[i], 0.03 * float((r.box[1] - r.box[0]).max())
            items += [Points(f"end_{letter.lower()}", [end], role=ENDS[i], size=14, shape="diamond"),
                      Label(f"name_{letter.lower()}", letter, end + gap, 1.1)]
    return items


def _error(p: "Params", r: "Result") -> list[Item]:
    """The law of the error by linearisation at the solution, and the other method's."""
    items: list[Item] = []
    for name, fix, role in (("other", r.other, "muted"), ("error", r.fix, "posterior")):
        if fix is None or not fix.converged or not np.isfinite(fix.cov).all() or (name == "other" and p.count == 2):
            continue
        if np.sqrt(np.trace(fix.cov)) < float((r.box[1] - r.box[0]).max()):
            items.append(LevelEllipse(name, Gaussian(fix.x, fix.cov), role=role, probability=PROBABILITY,
                                      dashed=name == "other", cross=name == "other", width=3.0))
    return items
