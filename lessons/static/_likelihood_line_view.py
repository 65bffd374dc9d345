"""Panels over one axis x: what is read, the likelihood of each reading, and their product."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.panels import Panel
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, Plane, Points, Polyline, Segments
from lessons.static._likelihood_line import HIGH, LOW, Line, X

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.likelihood import Params

FACTOR, PRODUCT = range(2)
WIDE, TALL, GAP, PIXEL = 9.0, 1.8, 1.95, 0.0155
INTEGERS = np.arange(-7, 7)
FLOOR_RULE = r"P(y_i \mid x) = \Phi\left(\frac{y_i + 1 - x}{\sigma}\right) - \Phi\left(\frac{y_i - x}{\sigma}\right)"
RULES = {"uniform": r"p(y \mid x) = \frac{1}{2w}\ \text{if}\ |y - x^2| \leq w,\ \text{else}\ 0",
         "normal": r"p(y \mid x) = \frac{1}{\sigma\sqrt{2\pi}}\,e^{-(y - x^2)^2/2\sigma^2},\ \sigma = w/\sqrt{3}"}


def view(p: "Params", r: Line, at: Moment) -> View:
    """Reading k alone, or the product of all up to it."""
    floor, k = p.world == "floor", at.step
    rows = 3 if floor else 2
    bounds = {"above": (-5.0, 5.0) if floor else (-2.0, 8.0), "middle": (0.0, 1.12 * max(float(r.parts.max()), 1e-6)),
              "below": (0.0, 1.05)}
    panels = {name: Panel(np.array([LOW, low]), np.array([HIGH, high]),
                          np.array([0.0, (rows - 1 - i) * (TALL + GAP)]), np.array([WIDE, TALL]))
              for i, (name, (low, high)) in enumerate(list(bounds.items())[:rows])}
    scene = _curves(p, r, k, at.stage, panels)
    height = rows * TALL + (rows - 1) * GAP
    name = f"reading {k + 1}: y = {r.y[k]:g}".replace("-", "−") if floor else f"y = {r.y[0]:g}".replace("-", "−")
    return View(
        scene=scene, camera=Plane((-1.0, WIDE + 0.4), (-1.4, height + 1.0), axes=False),
        figures=_figures(p, r, k), readouts=_readouts(p, r, k, at.stage), equations=_equations(p, r, k, at.stage),
        caption=f"product of {k + 1} readings" if floor and k and at.stage == PRODUCT else name, note=_note(r, k),
    )


def _note(r: Line, k: int) -> str:
    return "" if r.products[k].any() else "No x explains this reading: its likelihood is 0 everywhere."


def _curves(p: "Params", r: Line, k: int, stage: int, panels: dict[str, Panel]) -> list[Item]:
    floor = p.world == "floor"
    titles = {"above": ("floor(x), and the reading y" if floor else "x², and y ± w", "y"),
              "middle": ("likelihood of each reading, P(y | x)" if floor else "likelihood p(y | x)", ""),
              "below": ("product of the readings so far, largest value 1", "")}
    items: list[Item] = []
    for name, panel in panels.items():
        made = panel.axes(name, (titles[name][0], "x", titles[name][1]), PIXEL)
        items += [item for item in made if not (isinstance(item, Label) and not item.text)]

    def curve(name: str, where: str, y: Array, role: Role, width: float = 3.5, fade: float = 0.0) -> Polyline:
        place = panels[where]
        points = np.column_stack([X, y])
        return Polyline(name, place.place(points[place.inside(points)]), role=role, width=width, fade=fade)

    h = np.floor(np.minimum(X, HIGH - 1e-9)) if floor else np.square(X)      # no step at the very end
    items += [curve("truth_curve", "above", h, "truth"), *_reading(p, r, k, panels["above"])]
    for i in range(k):
        items.append(curve(f"earlier_{i + 1}", "middle", r.parts[i], "measurement", 2.0, 0.65))
    items.append(curve("this_reading", "middle", r.parts[k], "measurement"))
    if floor and stage == PRODUCT:
        items.append(curve("product_curve", "below", r.products[k], "likelihood", 4.0))
    lowest = panels["below" if floor else "middle"]
    if stage == PRODUCT:
        items += _estimates(r, k, floor, lowest)
    for name, panel in panels.items():
        pole = panel.place(np.array([[p.x, panel.low[1]], [p.x, panel.high[1]]]))
        items.append(Polyline(f"chosen_{name}", pole, role="reference", width=1.8, dashed=True))
    return items


def _reading(p: "Params", r: Line, k: int, panel: Panel) -> list[Item]:
    """This reading, and how far a bounded error may have moved it."""
    levels = r.y[k] + np.array([0.0] if p.world == "floor" else [-p.half_width, 0.0, p.half_width])
    lines = [[[LOW, v], [HIGH, v]] for v in levels if panel.low[1] <= v <= panel.high[1]]
    return [Segments("reading", panel.place(np.array(lines)), role="measurement", width=2.5)] if lines else []


def _estimates(r: Line, k: int, floor: bool, panel: Panel) -> list[Item]:
    """Where the product is largest; of readings also their mean, as it is and half a step higher."""
    items: list[Item] = []
    for i, (low, high) in enumerate(pieces(r.products[k])):
        name = f"ml_{i + 1}" if i else "ml"
        if high - low > 0.2:                              # an interval, all of it
            rail = np.array([[[low, 0.03 * panel.high[1]], [high, 0.03 * panel.high[1]]]])
            items.append(Segments(name, panel.place(rail), role="posterior", width=8.0))
        else:
            items += _pole(name, "posterior", float(r.best[k]) if floor else 0.5 * (low + high), panel)
    if floor:
        mean = float(r.y[:k + 1].mean())
        items += _pole("mean", "warning", mean, panel)
        items += _pole("middle_mean", "sigma", mean + 0.5, panel, dashed=True)
    return items


def _pole(name: str, role: Role, x: float, panel: Panel, dashed: bool = False) -> list[Item]:
    if not LOW <= x <= HIGH:
        return []
    pole = panel.place(np.array([[x, 0.0], [x, panel.high[1]]]))
    return [Polyline(name, pole, role=role, width=3.0, dashed=dashed),
            Points(f"{name}_top", pole[1:], role=role, size=11, shape="diamond")]


def _figures(p: "Params", r: Line, k: int) -> dict[str, "go.Figure"]:
    """p(y | x) as a function of y, at the chosen x; and the estimates reading by reading."""
    if p.world == "square":
        y = np.linspace(-2.0, 18.0, 401)
        density = np.exp(r.sensor.log_likelihood(y[:, None], np.array([p.x])))
        return {"of_y": fig.chart(fig.line("mass", y, density, "measurement"), marks=[float(r.y[0])])}
    mass = np.array([float(np.exp(r.sensor.log_likelihood(np.array([float(y)]), np.array([p.x])))) for y in INTEGERS])
    n = np.arange(1, len(r.y) + 1)
    means = np.cumsum(r.y) / n
    return {
        "of_y": fig.chart(fig.bars("mass", INTEGERS, mass, "measurement"), marks=[float(r.y[k])], y_range=(0.0, 1.02)),
        "estimates": fig.chart(fig.line("ml", n, r.best, "posterior", markers=True),
                               fig.line("mean", n, means, "warning", markers=True),
                               fig.line("middle_mean", n, means + 0.5, "sigma", dash=True), cursor=float(k + 1)),
    }


def _readouts(p: "Params", r: Line, k: int, stage: int) -> list[Readout]:
    here = np.array([p.x])
    each = [float(np.exp(r.sensor.log_likelihood(np.array([v]), here))) for v in r.y[:k + 1]]
    shown = stage == PRODUCT and bool(np.isfinite(r.best[k]))
    found = [Readout("measured", f"{r.y[k]:g}".replace("-", "−")), Readout("at_x", each[k])]
    if p.world == "square":
        where = ", ".join(f"{low:.2f} … {high:.2f}" for low, high in pieces(r.parts[0])).replace("-", "−")
        return [*found, Readout("where", where if shown else None)]
    mean = float(r.y[:k + 1].mean())
    return [*found, Readout("product_at_x", float(np.prod(each)) if stage == PRODUCT else None),
            Readout("ml_x", float(r.best[k]) if shown else None), Readout("mean", mean),
            Readout("middle_mean", mean + 0.5)]


def pieces(likelihood: Array) -> Array:
    """The intervals (k, 2) of the axis where it is at least 99.9 % of its largest value; none if it is 0."""
    good = (likelihood >= 0.999 * likelihood.max()) & (likelihood > 0.0)
    ends = np.flatnonzero(np.diff(good.astype(int), prepend=0, append=0)).reshape(-1, 2)
    return np.column_stack([X[ends[:, 0]], X[ends[:, 1] - 1]])


def _equations(p: "Params", r: Line, k: int, stage: int) -> list[Equation]:
    floor, here = p.world == "floor", np.array([p.x])
    logs = [float(r.sensor.log_likelihood(np.array([v]), here)) for v in r.y[:k + 1]]
    best: tuple[Piece, ...] = ("=", float(r.best[k])) if np.isfinite(r.best[k]) else ()
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("here", FACTOR, "x", ("=", p.x)),
        ("factor", FACTOR, FLOOR_RULE if floor else RULES[p.noise], ("=", float(np.exp(logs[k])))),
    ]
    if floor:
        both = float(np.exp(sum(logs)))
        lines += [("product", PRODUCT, r"P(\mathbf{y} \mid x) = \prod_i P(y_i \mid x)", ("=", both)),
                  ("ml", PRODUCT, r"\hat{x} = \mathrm{argmax}\ P(\mathbf{y} \mid x)", best),
                  ("mean_of", PRODUCT, r"\bar{y}", ("=", float(r.y[:k + 1].mean())))]
    else:
        lines.append(("ml", PRODUCT, r"\hat{x} = \mathrm{argmax}\ p(y \mid x)\ \text{(one of them)}", best))
    return [Equation(name, (rule, *numbers) if at <= stage else (rule,), current=at == stage)
            for name, at, rule, numbers in lines]
