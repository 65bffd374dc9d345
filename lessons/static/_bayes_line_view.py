"""Fig 2.3 as three panels over one axis: prior, likelihood, posterior; and the estimates taken from it."""

from typing import TYPE_CHECKING

import numpy as np

from core.grid import GridDensity
from core.types import Array
from lessons.kit.lesson import Moment, Target, View
from lessons.kit.panels import Panel
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, Plane, Points, Polygon, Polyline, Segments
from lessons.static._bayes_line import log_density_of
from lessons.static._bayes_line_figures import equations, figures, readouts

if TYPE_CHECKING:
    from lessons.static._bayes_line import Line, Step
    from lessons.static.bayes import Params

PRIOR, LIKELIHOOD, POSTERIOR, ESTIMATE = range(4)
WIDE, GAP = 12.0, 1.05                   # of the panels, in scene units
TALL = {"posterior": 3.2, "likelihood": 1.9, "prior": 1.9}
TOP = sum(TALL.values()) + 2 * GAP
UNIT = 1.8                               # height of the highest density; above it stand the names of the estimates
PIXEL = 0.0148
CURVE = 301
CLICKS = 61                              # clickable places along an axis


def view(p: "Params", r: "Line", at: Moment) -> View:
    """One update up to its stage; step 0 has nothing but the prior."""
    step = r.steps[at.step]
    stage = at.stage if at.step else PRIOR
    unit = "" if p.problem == "sign" else " m"
    scene, panels = _panels(p, r, step, at.step, stage)
    return View(
        scene=scene, camera=Plane((-58 * PIXEL, WIDE + 14 * PIXEL), (-58 * PIXEL, TOP + 34 * PIXEL), axes=False),
        figures=figures(p, r, at.step), readouts=readouts(p, r, at.step),
        equations=equations(p, step, at.step, stage), caption=_caption(step, at.step, stage, unit),
        note=_note(p, step, at.step), targets=_targets(p, panels, at.step))


def _caption(step: "Step", k: int, stage: int, unit: str) -> str:
    said = f"k = {k}" if k else "before any measurement"
    if k and stage >= LIKELIHOOD:
        said += f", y = {step.y:.3g}{unit}"
    if step.posterior is not None and (stage >= POSTERIOR or k == 0):
        said += f": x = {round(step.mean, 3) + 0.0:.3g} ± {np.sqrt(step.var):.3g}{unit} (1σ)"
    return said.replace("-", "−")


def _note(p: "Params", step: "Step", k: int) -> str:
    if not step.possible:
        return "The prior excludes this y: no posterior, and it is ignored."
    if step.prior is None and k <= 1:
        return "A flat prior on the whole line is no density: its area is infinite. Only that it is constant matters."
    return ""


def _panels(p: "Params", r: "Line", step: "Step", k: int, stage: int) -> tuple[list[Item], dict[str, Panel]]:
    low, high = r.shown
    x = np.linspace(low, high, CURVE)
    unit = "" if p.problem == "sign" else " (1/m)"
    before, after, flat = _on(step.prior, r.axis, x), _on(step.posterior, r.axis, x), step.prior is None
    likelihood = np.exp(log_density_of(p, step.y, x)) if k and step.y is not None else np.zeros(CURVE)
    # One scale for prior and posterior, so that the height shows how the probability contracts.
    density = max(float(before.max()), float(after.max()), 1e-9) / UNIT
    if flat:
        before = np.full(CURVE, 0.5 * TALL["prior"] * density)           # of no height in particular
    tops = {"posterior": TALL["posterior"] * density, "likelihood": 1.3 * max(float(likelihood.max()), 1e-9),
            "prior": TALL["prior"] * density}
    titles = {"prior": f"prior: the posterior of k = {k - 1}{unit}" if k > 1 else (
                  "prior: constant on the whole line" if flat else f"prior p(x){unit}"),
              "likelihood": f"likelihood p(y | x) as a function of x{unit}", "posterior": f"posterior p(x | y){unit}"}
    if not k:
        titles["likelihood"] = "likelihood: nothing is measured yet"
    feet = {"posterior": 0.0, "likelihood": TALL["posterior"] + GAP, "prior": TOP - TALL["prior"]}
    panels = {name: Panel(np.array([low, 0.0]), np.array([high, top]), np.array([0.0, feet[name]]),
                          np.array([WIDE, TALL[name]])) for name, top in tops.items()}
    numberless = {name for name, empty in (("likelihood", not k), ("prior", flat)) if empty}
    items: list[Item] = []
    for name, panel in panels.items():
        hidden = {f"{name}_title", f"{name}_y_title", *([] if name == "posterior" else [f"{name}_x_title"])}
        items += [i for i in panel.axes(name, ("", "x" if p.problem == "sign" else "x (m)", ""), PIXEL)
                  if i.name not in hidden and not (name in numberless and i.name.startswith(f"{name}_y"))]
        above = panel.corner + np.array([0.0, TALL[name] + 0.26])
        items.append(Label(f"{name}_name", titles[name], above, 0.95, "left"))
    items += _area(panels["prior"], "prior", x, before, "prior", dashed=flat)
    if k and stage >= LIKELIHOOD:
        items += _area(panels["likelihood"], "likelihood", x, likelihood, "likelihood")
        if p.problem == "line" and low <= float(step.y or 0.0) <= high:
            items += _marked(panels["likelihood"], "y", float(step.y or 0.0), "measurement", "y")
    if k and stage >= POSTERIOR and step.possible:
        items += _area(panels["posterior"], "posterior", x, after, "posterior")
        if not flat:
            joint = before * likelihood
            items.append(Polyline("joint", panels["posterior"].place(np.column_stack([x, joint])), role="reference",
                                  width=2.5, dashed=True))
    if k and stage >= ESTIMATE and step.possible:
        items += _estimates(p, r, step, panels["posterior"])
    return items, panels


def _on(density: GridDensity | None, axis: Array, x: Array) -> Array:
    """A grid density at the places x: constant in each cell, 0 outside and where there is none."""
    if density is None:
        return np.zeros(len(x))
    step = float(density.spacing[0])
    cell = np.round((x - axis[0]) / step).astype(int)
    inside = (cell >= 0) & (cell < len(axis))
    return np.where(inside, density.density[np.clip(cell, 0, len(axis) - 1)], 0.0)


def _area(panel: Panel, name: str, x: Array, f: Array, role: Role, dashed: bool = False) -> list[Item]:
    """A curve with its area filled."""
    top = float(panel.high[1])
    curve = np.column_stack([x, np.minimum(f, top)])
    found: list[Item] = [Polyline(name, panel.place(curve), role=role, width=4.0, dashed=dashed)]
    filled = np.flatnonzero(f > 2e-3 * max(float(f.max()), 1e-300))
    if len(filled) > 3 and not dashed:
        some = curve[filled[0]:filled[-1] + 1]
        corners = np.flatnonzero(np.abs(np.diff(some[:, 1], 2)) > 0.05 * some[:, 1].max()) + 1
        some = some[np.unique(np.append(np.linspace(0, len(some) - 1, 40).astype(int), corners))]
        rim = np.vstack([[some[0, 0], 0.0], some, [some[-1, 0], 0.0]])
        found.insert(0, Polygon(f"{name}_area", panel.place(rim), role=role, opacity=0.2))
    return found


def _marked(panel: Panel, name: str, x: float, role: Role, text: str, row: int = 0) -> list[Item]:
    """An upright at x with a dot on the axis, and its name in a row counted from the top."""
    foot = panel.place(np.array([x, 0.0]))
    tip = np.array([foot[0], panel.corner[1] + panel.size[1] - 0.42 * row])
    return [Segments(f"{name}_line", np.array([[foot, tip]]), role=role, width=2.5),
            Points(name, [foot], role=role, size=12.0),
            Label(f"{name}_label", text, tip + np.array([0.12, -0.21]), 0.9, "left")]


def _estimates(p: "Params", r: "Line", step: "Step", panel: Panel) -> list[Item]:
    """Mean with one standard deviation to each side, mode, and the user's own estimate."""
    low, high = r.shown
    mine = p.estimate if p.problem == "sign" else p.estimate_m
    found: list[Item] = []
    marks: list[tuple[str, float, Role, str]] = [("mean", step.mean, "innovation", "mean")]
    if p.problem == "line":
        marks.append(("mode", step.mode, "sigma", "MAP"))
    marks.append(("mine", mine, "handle", "x̂"))
    for row, (name, at, role, text) in enumerate(marks):
        if low <= at <= high:
            found += _marked(panel, name, at, role, text, row)
    sd = float(np.sqrt(step.var))
    ends = np.clip([step.mean - sd, step.mean + sd], low, high)
    y = 0.04 * panel.high[1]
    return [*found, Segments("spread", panel.place(np.array([[[ends[0], y], [ends[1], y]]])), role="innovation",
                             width=7.0)]


def _targets(p: "Params", panels: dict[str, Panel], k: int) -> list[Target]:
    """Clicks: on the likelihood's axis the measurement, on the posterior's the estimate."""
    if p.problem == "sign":
        return [Target(panels["posterior"].place(np.array([x, 0.0])), {"estimate": float(x)})
                for x in np.round(np.linspace(-1.0, 1.0, 41), 2)]
    from lessons.static.bayes import HIGH_M, LOW_M

    panel = panels["likelihood"]
    places = np.unique(np.round(np.linspace(panel.low[0], panel.high[0], CLICKS), 1))
    clicks = (("likelihood", f"y{max(k, 1)}"), ("posterior", "estimate_m"))
    return [Target(panels[name].place(np.array([x, 0.0])), {parameter: float(x)})
            for x in places if LOW_M <= x <= HIGH_M for name, parameter in clicks]
