"""How the Bayes filter is drawn: panels on the line, surfaces in the plane, estimates, and the costs they minimise."""

from typing import TYPE_CHECKING

import numpy as np

from core import grid
from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.panels import Panel
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, Orbit, Plane, Points, Polyline, Segments, Stations, Surface

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.bayes_filter import Params, Result, Step

PREDICT, LIKELIHOOD, UPDATE, ESTIMATE = range(4)
COSTS: tuple[tuple[str, Role], ...] = (("squared", "innovation"), ("absolute", "reference"), ("miss", "sigma"))
WIDE, TALL, GAP = 12.0, 2.2, 0.9        # of the panels on the line, in scene units
NAMES = ("−π", "−π/2", "0", "π/2", "π", "3π/2", "2π", "5π/2", "3π")
TICKS = [((k - 2) * np.pi / 2, text) for k, text in enumerate(NAMES)]
SIDE, APART, HIGH = 400.0, 440.0, 150.0  # of the surfaces in the plane, in metres


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The step up to its stage; step 0 shows the prior alone."""
    step, stage = r.steps[at.step], at.stage
    scene, camera = _panels(p, r, step, stage) if p.space == "line" else _surfaces(p, step, stage, at.step)
    caption = f"k = {at.step}" + (
        f", y = {step.y:.3g}{' m' if p.space == 'plane' else ''}" if stage and at.step else "")
    return View(scene=scene, camera=camera, figures=_figures(p, step, stage), readouts=_readouts(p, step, stage),
                equations=_equations(p, step, at.step, stage), caption=caption, note=_note(p, step, stage))


def _note(p: "Params", step: "Step", stage: int) -> str:
    if stage >= LIKELIHOOD and not step.possible:
        return "This y is impossible under the prior: it is ignored."
    if stage == ESTIMATE and p.space == "line" and _density_at(step, step.law.mean) < 1e-6:
        return "The posterior is practically 0 at its mean."
    return ""


def _density_at(step: "Step", x: Array) -> float:
    p = step.update.posterior
    index = tuple(int(np.argmin(np.abs(a - v))) for a, v in zip(p.axes, x, strict=True))
    return float(p.density[index])


def _panels(p: "Params", r: "Result", step: "Step", stage: int) -> tuple[list[Item], Plane]:
    """From the top: prior, measurement, likelihood, posterior with the estimates."""
    x = step.update.prior.axes[0]
    likelihood = np.exp(step.update.log_likelihood)
    # One scale for what this step compares: where it begins, its prior and its posterior.
    density = 1.08 * float(max(d.density.max() for d in (step.before, step.update.prior, step.update.posterior)))
    measured = step is not r.steps[0]
    tops = {"posterior": density, "likelihood": 1.15 * max(float(likelihood.max()), 1e-9), "measured": 1.9,
            "prior": density}
    panels, items = {}, []
    titles = {"prior": "prior p(x | earlier y), 1/rad", "measured": "sin x, and the measurement y",
              "likelihood": "likelihood p(y | x)", "posterior": "posterior p(x | y), 1/rad"}
    if not measured:
        titles |= {"measured": "sin x: nothing is measured at k = 0", "likelihood": "likelihood: no measurement yet"}
    for row, (name, top) in enumerate(tops.items()):
        low = -top if name == "measured" else 0.0
        panel = Panel(np.array([x[0], low]), np.array([x[-1], top]), np.array([0.0, row * (TALL + GAP)]),
                      np.array([WIDE, TALL]))
        panels[name] = panel
        corners = np.array([[x[0], low], [x[-1], low], [x[-1], top], [x[0], top]])
        items += [Polyline(f"{name}_frame", panel.place(corners), role="muted", width=1.5, closed=True),
                  Label(f"{name}_title", titles[name], panel.corner + np.array([0.0, TALL + 0.32]), 0.95, "left")]
    ticks = [(v, text) for v, text in TICKS if x[0] <= v <= x[-1]]
    lines = [[panel.place(np.array([v, panel.low[1]])), panel.place(np.array([v, panel.high[1]]))]
             for panel in panels.values() for v, _ in ticks]
    items.append(Segments("grid", np.array(lines), role="muted", width=1.0, fade=0.6))
    items += [Label(f"tick{i}", text, panels["posterior"].place(np.array([v, 0.0])) - np.array([0.0, 0.12]), 0.9, "top")
              for i, (v, text) in enumerate(ticks)]
    items.append(Label("x_title", "x (rad)", (0.5 * WIDE, -0.75), 1.0, "top"))

    def curve(name: str, panel: str, values: Array, role: Role, width: float = 3.5, dashed: bool = False) -> Polyline:
        place = panels[panel]
        rows = np.column_stack([x, np.clip(values, place.low[1], place.high[1])])
        return Polyline(name, place.place(rows), role=role, width=width, dashed=dashed)

    if measured and step is not r.steps[1]:
        items.append(curve("before", "prior", step.before.density, "posterior", 2.0, True))
    items.append(curve("prior", "prior", step.update.prior.density, "prior"))
    if stage >= LIKELIHOOD and measured:
        ends = x[[0, -1]]
        place = panels["measured"]
        rails = np.array([[[x_end, min(step.y + s * p.width, 1.9)] for x_end in ends] for s in (-1.0, 1.0)])
        items += [curve("wave", "measured", np.sin(x), "truth", 2.5),
                  Polyline("y", place.place(np.column_stack([ends, [step.y] * 2])), role="measurement", width=3.0),
                  Segments("y_band", place.place(np.maximum(rails, [-np.inf, -1.9])), role="measurement", width=1.5),
                  curve("likelihood", "likelihood", likelihood, "likelihood")]
    if stage >= UPDATE:
        items.append(curve("posterior", "posterior", step.update.posterior.density, "posterior"))
    if stage >= ESTIMATE:
        place = panels["posterior"]
        top = float(place.high[1])
        for name, role, where in (("mean", "innovation", step.law.mean), ("median", "reference", step.middle),
                                  ("mode", "measurement", step.mode), ("hit", "sigma", step.hit.x)):
            pole = np.array([[where[0], 0.0], [where[0], top]])
            items.append(Polyline(name, place.place(pole), role=role, width=3.0, dashed=name in ("mode", "median")))
        reach = np.clip(step.hit.x[0] + p.delta * np.array([-1.0, 1.0]), x[0], x[-1])
        items.append(Polyline("hit_interval", place.place(np.column_stack([reach, [0.03 * top] * 2])), role="sigma",
                              width=7.0))
    return items, Plane((-0.3, WIDE + 0.3), (-1.5, 4 * TALL + 3 * GAP + 0.8), axes=False)


def _surfaces(p: "Params", step: "Step", stage: int, k: int) -> tuple[list[Item], Orbit]:
    """Prior at its true place, likelihood at its right, posterior in front; each as high as the others."""
    prior, post = step.update.prior, step.update.posterior
    x, y = prior.axes
    right, front = np.array([APART, 0.0]), np.array([0.5 * APART, -APART])
    stations = np.array([p.station_1, p.station_2])
    seen = stations[[0 if k % 2 == 1 or k == 0 else 1]]
    names = ("S1",) if k % 2 == 1 or k == 0 else ("S2",)

    def surface(name: str, values: Array, shift: Array, role: Role) -> list[Item]:
        top = max(float(values.max()), 1e-300)
        edge = 0.5 * SIDE
        # A little below the ground, so that handles and stations stay on top of the flat part.
        return [Surface(name, x + shift[0], y + shift[1], HIGH * values.T / top - 4.0, role=role, opacity=0.65),
                Label(f"{name}_name", TITLES[name], (shift[0] - 0.8 * edge, shift[1] - 1.12 * edge, 0.0), 1.0)]

    items: list[Item] = [*surface("prior", prior.density, np.zeros(2), "prior"),
                         Stations("stations", stations, ("S1", "S2"))]
    if stage >= LIKELIHOOD and k:
        ring = np.exp(step.update.log_likelihood - step.update.log_likelihood.max())
        items += [*surface("likelihood", ring, right, "likelihood"),
                  Stations("station_seen", seen + right, names)]
    if stage >= UPDATE:
        items += surface("posterior", post.density, front, "posterior")
    if stage >= ESTIMATE:
        for name, role, where in (("mean", "innovation", step.law.mean), ("mode", "measurement", step.mode),
                                  ("hit", "sigma", step.hit.x)):
            at = where + front
            items += [Segments(f"{name}_pole", np.array([[[*at, 0.0], [*at, 1.25 * HIGH]]]), role=role, width=4.0),
                      Points(name, np.array([[*at, 1.25 * HIGH]]), role=role, size=13)]
        items.append(Points("target", np.array([[*(np.array(p.target) + front), 0.0]]), role="truth", size=12,
                            shape="diamond"))
    return items, Orbit((0.5 * APART, -0.5 * APART, 0.0), 470.0, azimuth_deg=-78.0, elevation_deg=48.0)


TITLES = {"prior": "prior", "likelihood": "likelihood", "posterior": "posterior"}


def _pair(x: Array, unit: str) -> str:
    return ", ".join(f"{v:.3g}" for v in x).replace("-", "−") + f" {unit}"


def _equations(p: "Params", step: "Step", k: int, stage: int) -> list[Equation]:
    """The two lines of the filter and the three estimates, with this step's numbers."""
    def spread(density: grid.GridDensity) -> float:
        return float(np.sqrt(np.trace(grid.moments(density).cov)))

    first = k <= 1
    predict = (r"p(x_1)" if first else
               r"p(x_k \mid y_{1:k-1}) = \int p_w(x_k - x_{k-1})\,p(x_{k-1} \mid y_{1:k-1})\,dx_{k-1}")
    spreads: tuple[Piece, ...] = (r",\quad \sigma =", spread(step.update.prior)) if first else (
        r",\quad \sigma:", spread(step.before), r"\rightarrow", spread(step.update.prior))
    evidence = float(np.exp(step.update.log_evidence)) if step.possible else 0.0
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("predict", PREDICT, predict, spreads),
        ("likelihood", LIKELIHOOD, r"p(y_k \mid x_k) = p_v(y_k - h(x_k))", (r",\quad y_k =", step.y)),
        ("update", UPDATE,
         r"p(x_k \mid y_{1:k}) = \frac{p(y_k \mid x_k)\,p(x_k \mid y_{1:k-1})}{p(y_k \mid y_{1:k-1})}",
         (r",\quad p(y_k \mid y_{1:k-1}) =", evidence)),
        ("mean", ESTIMATE, r"\hat{x} = \mathrm{argmin}_z\,\mathrm{E}\,\|x - z\|^2 = \mathrm{E}(x \mid y_{1:k})",
         ("=", _piece(step.law.mean))),
        ("mode", ESTIMATE, r"\hat{x} = \mathrm{argmax}_z\,p(z \mid y_{1:k})", ("=", _piece(step.mode))),
        ("hit", ESTIMATE, r"\hat{x} = \mathrm{argmax}_z\,P(\|x - z\| \leq \delta)",
         ("=", _piece(step.hit.x), r",\quad P =", step.hit.probability)),
    ]
    if k == 0:                                            # nothing is measured: only the estimates are of interest
        lines = [one for one in lines if one[1] in (PREDICT, ESTIMATE)]
    running = PREDICT if k == 0 and stage < ESTIMATE else stage
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == running, digits=3)
            for name, at, rule, numbers in lines]


def _piece(x: Array) -> Piece:
    return float(x[0]) if len(x) == 1 else x


def _readouts(p: "Params", step: "Step", stage: int) -> list[Readout]:
    unit = "rad" if p.space == "line" else "m"
    at_mode = float(np.trace(grid.mean_square_error(step.law, step.mode)))
    shown = stage == ESTIMATE
    return [
        Readout("mean", _pair(step.law.mean, unit) if shown else None),
        Readout("median", _pair(step.middle, unit) if shown else None),
        Readout("mode", _pair(step.mode, unit) if shown else None),
        Readout("hit", _pair(step.hit.x, unit) if shown else None),
        Readout("rms_mean", float(np.sqrt(np.trace(step.law.cov))) if shown else None, unit, 3),
        Readout("rms_mode", float(np.sqrt(at_mode)) if shown else None, unit, 3),
        Readout("near_hit", 100.0 * step.hit.probability if shown else None, "%", 3),
        Readout("near_mean", 100.0 * _near(step, step.law.mean) if shown else None, "%", 3),
    ]


def _near(step: "Step", x: Array) -> float:
    """Posterior probability within delta of x."""
    index = tuple(int(np.argmin(np.abs(a - v))) for a, v in zip(step.update.posterior.axes, x, strict=True))
    return float(step.hit.hits[index])


def _figures(p: "Params", step: "Step", stage: int) -> dict[str, "go.Figure"]:
    """Marginals of the first coordinate, and the three costs with their minima."""
    prior, post = (grid.marginal(d, [0]) for d in (step.update.prior, step.update.posterior))
    x = prior.axes[0]
    curves = [fig.line("prior", x, prior.density, "prior")]
    if stage >= UPDATE:
        curves.append(fig.line("posterior", x, post.density, "posterior"))
    found = {"marginal": fig.chart(*curves, marks=[float(step.law.mean[0])] if stage == ESTIMATE else [])}
    for i, (name, role) in enumerate(COSTS):
        if stage < UPDATE:
            found[name] = fig.chart(fig.line("cost", step.places[:0], step.places[:0], role))
            continue
        least = [float(step.least[i, 0])]
        lowest = [float(np.interp(least[0], step.places, step.costs[i]))]
        traces = [fig.line("cost", step.places, step.costs[i], role)]
        if stage == ESTIMATE:
            traces.append(fig.markers("least", least, lowest, "warning", size=12, symbol="diamond"))
        found[name] = fig.chart(*traces)
    return found
