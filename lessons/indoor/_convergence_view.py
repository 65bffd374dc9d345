"""The cloud's density along the corridor against the exact one, and the error over N."""

from typing import TYPE_CHECKING

import numpy as np

from core.indoor import FloorGraph
from core.types import Array
from lessons.kit.equations import Equation
from lessons.kit.figures import chart, line, markers
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.panels import Panel
from lessons.kit.scene import Item, Label, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.indoor.convergence import Params, Result

WIDE, TALL, PIXEL = 54.0, 20.0, 0.055            # of the panel with the densities, in metres of the corridor


def view(p: "Params", r: "Result", at: Moment) -> View:
    t = at.step
    return View(scene=_scene(r, t), camera=Plane((-9.0, 54.0), (-4.5, 35.0), axes=False), figures=_figures(p, r, t),
                readouts=_readouts(p, r, t), equations=_equations(p, r, t),
                caption=f"t = {t} s: {r.shown.shape[1]} filters of {p.particles:,} particles")


def _scene(r: "Result", t: int) -> list[Item]:
    from lessons.indoor.convergence import BINS

    top = float(np.ceil(10.5 * r.density[t].max()) / 10.0)
    panel = Panel(np.array([BINS[0], 0.0]), np.array([BINS[-1], 100.0 * top]), np.array([BINS[0], 10.0]),
                  np.array([WIDE - 2.0, TALL]))
    items = panel.axes("panel", ("where along the corridor?", "x (m)", "probability in 2 m (%)"), PIXEL)
    for k, density in enumerate(r.shown[t]):
        items.append(Polyline(f"run_{k + 1}", panel.place(_steps(BINS, 100.0 * np.minimum(density, top))), role="pf",
                              width=1.5, fade=0.35))
    items.append(Polyline("exact", panel.place(_steps(BINS, 100.0 * r.density[t])), role="truth", width=4.0))
    items += _corridor(r.graph)
    items += [Points("means", np.column_stack([r.means[t], np.full(r.means.shape[1], -2.2)]), role="pf", size=8),
              Points("reference", [(r.reference[t], -2.2)], role="truth", size=12, shape="square"),
              Points("walker", [(r.truth[t], 0.0)], role="handle", size=14, shape="diamond"),
              Label("means_name", "means", (-2.5, -2.2), 0.9, "right")]
    return items


def _corridor(graph: FloorGraph) -> list[Item]:
    pairs = np.array([[graph.nodes[n][:2] for n in link.nodes] for link in graph.links.values()])
    return [Segments("links", pairs, role="link", width=3.5)]


def _steps(edges: Array, heights: Array) -> Array:
    """A histogram as a line."""
    return np.column_stack([np.repeat(edges, 2)[1:-1], np.repeat(heights, 2)])


def _figures(p: "Params", r: "Result", t: int) -> "dict[str, go.Figure]":
    from lessons.indoor.convergence import NUMBERS

    n = np.array(NUMBERS, dtype=float)
    time = np.arange(len(r.truth))
    at = {name: np.maximum(e[:, t], 1e-3) for name, e in r.errors.items()}
    slope = at["threshold"][2] * np.sqrt(n[2] / n)
    roles = (("never", "warning"), ("threshold", "pf"), ("always", "posterior"))
    rate = chart(line("slope", n, slope, "reference", dash=True),
                 *(line(name, n, at[name], role, markers=True) for name, role in roles), log_x=True, log_y=True)
    constant = chart(*(line(name, time, np.maximum(n[3] * np.square(r.errors[name][3]), 1e-2), role)
                       for name, role in roles), log_y=True, cursor=t)
    n_eff = chart(*(line(name, time, 100 * r.n_eff[name], role) for name, role in roles), log_y=True, cursor=t)
    order = np.argsort(r.by_crossings[:, 0])
    crossings = chart(line("c", *r.by_crossings[order].T, "pf"), markers("spacing", *r.by_crossings[order].T, "pf"))
    return {"rate": rate, "constant": constant, "n_eff": n_eff, "crossings": crossings}


def slope(r: "Result", name: str, t: int) -> float:
    """Exponent of N in the error, by a line through all N on logarithmic axes."""
    from lessons.indoor.convergence import NUMBERS

    return float(np.polyfit(np.log(NUMBERS), np.log(np.maximum(r.errors[name][:, t], 1e-6)), 1)[0])


def _readouts(p: "Params", r: "Result", t: int) -> list[Readout]:
    own = float(np.sqrt(np.square(r.means[t] - r.reference[t]).mean()))
    return [Readout("own", own, "m"), Readout("slope", slope(r, "threshold", t), digits=3),
            Readout("never", float(r.errors["never"][-1, t]), "m"),
            Readout("threshold", float(r.errors["threshold"][-1, t]), "m"),
            Readout("always", float(r.errors["always"][-1, t]), "m"),
            Readout("n_eff_never", 100.0 * float(r.n_eff["never"][t]), "%"),
            Readout("off_truth", abs(float(r.reference[t] - r.truth[t])), "m")]


def _equations(p: "Params", r: "Result", t: int) -> list[Equation]:
    from lessons.indoor.convergence import NUMBERS

    n = NUMBERS[3]
    error = float(r.errors["threshold"][3, t])
    return [Equation("bound", (r"\mathrm{E}\,|\hat\varphi_N - \mathrm{E}\varphi|^2 \leq c_t\,\|\varphi\|^2 / N",)),
            Equation("error", (rf"\sqrt{{\mathrm{{E}}\,|\hat x_N - \hat x|^2}}\;\;(N = {n}) =", error)),
            Equation("constant", (r"N\,\mathrm{E}\,|\hat x_N - \hat x|^2 =", n * error**2))]
