"""How resampling is drawn: weights as bars, their cumulative sum as a staircase or a wheel, points, and copies."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.resampling import Params, Result

SCHEMES = ("systematic", "stratified", "multinomial", "residual")
ROLES: dict[str, Role] = {"systematic": "posterior", "stratified": "likelihood", "multinomial": "measurement",
                          "residual": "sigma"}
POINT, SEARCH, COPY = range(3)
TALL = 6.0                               # height of the staircase in scene units
LEFT = -0.4                              # where its axis stands
SUBSCRIPTS = "₁₂₃₄₅₆₇₈"
COMBS = {
    "systematic": r"z_i = \frac{i - 1 + u}{N}", "stratified": r"z_i = \frac{i - 1 + u_i}{N}",
    "multinomial": r"z_i = u_i", "residual": r"z_i = u_i",
}


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Points up to this one, the last of them up to this stage."""
    base = _base(r)
    scene = [*_bars(r), *(_wheel(r, at, base) if p.shape == "wheel" else _staircase(p, r, at, base)),
             *_copies(r, at)]
    camera = Plane((-2.0, 10.4), (_floor(r) - 0.2, base + TALL + 1.0), axes=False)
    return View(scene=scene, camera=camera, figures=_figures(p, r), readouts=_readouts(p, r),
                equations=_equations(p, r, at), caption=_caption(p, r, at), note=_note(p, r, at))


def _caption(p: "Params", r: "Result", at: Moment) -> str:
    return f"{p.scheme}, N = {p.n}" + (f", i = {at.step}" if at.step else "")


def _note(p: "Params", r: "Result", at: Moment) -> str:
    lost = np.flatnonzero(r.copies < np.floor(p.n * r.w + 1e-12))
    wrong = _wrong(r)
    done = at.step == p.n and at.stage == COPY
    if wrong.any() and done:
        return f"Copied in place: {int(wrong.sum())} of {p.n} children come from a parent that was overwritten."
    if len(lost) and done:
        j = int(lost[0])
        return (f"Particle {j + 1} has ω = {r.w[j]:.3g} ≥ {int(p.n * r.w[j] + 1e-12)}/{p.n}, "
                f"and gets {int(r.copies[j])} copies.")
    return ""


def _base(r: "Result") -> float:
    """Where the staircase begins: above the tallest bar."""
    return max(4.0, float(r.parts.max())) + 1.1


def _floor(r: "Result") -> float:
    return -1.5 - 0.45 * float(np.unique(r.children, return_counts=True)[1].max())


def _used(r: "Result", at: Moment) -> tuple[int, int]:
    """How many children exist, and how many points have been set."""
    done = at.step if at.stage == COPY else max(at.step - 1, 0)
    outright = len(r.ancestors) - len(r.z)
    return done, max(at.step - outright, 0)


def _wrong(r: "Result") -> Array:
    return r.children != r.x[r.ancestors]


def _bars(r: "Result") -> list[Item]:
    """The particles: place on the axis, weight as height."""
    feet = np.column_stack([r.x, np.zeros(len(r.x))])
    tops = np.column_stack([r.x, r.parts])
    short = len(r.x) > 5
    return [
        Polyline("axis", [(-0.2, 0.0), (10.2, 0.0)], role="muted", width=1.8),
        Label("axis_title", "place x (m)", (10.2, -0.75), 0.85, "right"),
        Segments("weights", np.stack([feet, tops], axis=1), role="pf", width=11.0),
        *(Label(f"w{j}", f"{w:.2f}" if short else f"ω{SUBSCRIPTS[j]} = {w:.2f}", (x, -0.12), 0.85, "top")
          for j, (x, w) in enumerate(zip(r.x, r.w, strict=True))),
    ]


def _staircase(p: "Params", r: "Result", at: Moment, base: float) -> list[Item]:
    """Risers as long as the weights; a point runs level until it meets one."""
    steps = np.concatenate([[0.0], r.stairs]) * TALL + base
    ends = np.append(r.x[1:], 10.2)
    risers = np.stack([np.column_stack([r.x, steps[:-1]]), np.column_stack([r.x, steps[1:]])], axis=1)
    treads = np.stack([np.column_stack([r.x, steps[1:]]), np.column_stack([ends, steps[1:]])], axis=1)
    items: list[Item] = [
        Polyline("scale", [(LEFT, base), (LEFT, base + TALL)], role="muted", width=1.8),
        Label("scale_title", "cumulative weight c, points z", (LEFT - 0.9, base + TALL + 0.4), 0.9, "left"),
        Segments("treads", np.concatenate([treads, [[[LEFT, base], [r.x[0], base]]]]), role="pf", width=1.8, fade=0.35),
        Segments("stairs", risers, role="pf", width=9.0),
        Label("scale_0", "0", (LEFT - 0.15, base), 0.85, "right"),
        Label("scale_1", "1", (LEFT - 0.15, base + TALL), 0.85, "right"),
    ]
    if p.scheme in ("systematic", "stratified"):
        level = base + TALL * np.arange(1, p.n) / p.n
        items.append(Segments("strata", np.array([[(LEFT, y), (10.2, y)] for y in level]), role="muted", width=1.0,
                              fade=0.5))
    _, count = _used(r, at)
    if not count:
        return items
    height = base + TALL * r.z[:count]
    parents = r.ancestors[len(r.ancestors) - len(r.z):][:count]
    met = count if at.stage >= SEARCH else count - 1
    ends_at = np.column_stack([r.x[parents], height])
    starts = np.column_stack([np.full(count, LEFT), height])
    items.append(Points("points", starts, role="measurement", size=10, shape="diamond"))
    items += [Label(f"z{i}", f"z{SUBSCRIPTS[i]} {r.z[i]:.2f}", (LEFT - 0.15, y), 0.85, "right")
              for i, y in enumerate(height)]
    if met:
        items += [Segments("levels", np.stack([starts, ends_at], axis=1)[:met], role="measurement", width=1.6),
                  Points("met", ends_at[:met], role="measurement", size=10)]
    if at.stage >= SEARCH:
        j = parents[-1]
        items.append(Segments("fall", np.array([[ends_at[-1], (r.x[j], r.parts[j])]]), role="innovation", width=2.5))
    return items


def _wheel(r: "Result", at: Moment, base: float) -> list[Item]:
    """The staircase bent to a wheel, clockwise from the top: arcs as long as the weights, points as spokes."""
    centre, radius = np.array([5.0, base + 0.5 * TALL]), 0.5 * TALL - 0.25

    def rim(share: Array, reach: float = radius) -> Array:
        a = 2.0 * np.pi * np.asarray(share)
        return centre + reach * np.stack([np.sin(a), np.cos(a)], axis=-1)

    arcs, names = [], []
    for j, (low, high) in enumerate(zip(np.concatenate([[0.0], r.stairs[:-1]]), r.stairs, strict=True)):
        if high - low > 0.012:
            places = rim(np.linspace(low + 0.004, high - 0.004, max(2, int(80 * (high - low)))))
            arcs.append(np.stack([places[:-1], places[1:]], axis=1))
            names.append(Label(f"arc{j}", str(j + 1), rim(0.5 * (low + high), radius - 0.4), 1.0))
    bounds = np.stack([rim(r.stairs, radius - 0.35), rim(r.stairs, radius + 0.2)], axis=1)
    items: list[Item] = [Segments("bounds", bounds, role="truth", width=2.5), *names]
    if arcs:
        items.append(Segments("stairs", np.concatenate(arcs), role="pf", width=9.0))
    _, count = _used(r, at)
    if count:
        z = r.z[:count]
        items += [Segments("levels", np.stack([np.broadcast_to(centre, (count, 2)), rim(z)], axis=1),
                           role="measurement", width=1.8),
                  Points("points", rim(z), role="measurement", size=10, shape="diamond")]
        items += [Label(f"z{i}", f"z{SUBSCRIPTS[i]}", rim(one, radius + 0.45), 0.9) for i, one in enumerate(z)]
        if at.stage >= SEARCH:
            j = r.ancestors[at.step - 1]
            items.append(Segments("fall", np.array([[rim(z[-1]), (r.x[j], r.parts[j])]]), role="innovation", width=2.5))
    return items


def _copies(r: "Result", at: Moment) -> list[Item]:
    """The children under their parents, in the order in which they were made."""
    done, _ = _used(r, at)
    items: list[Item] = [Label("copies_title", "copies", (-1.9, -1.3), 0.9, "left")]
    if not done:
        return items
    x, wrong = r.children[:done], _wrong(r)[:done]
    rank = np.array([int((x[:i] == x[i]).sum()) for i in range(done)])
    places = np.column_stack([x, -1.3 - 0.45 * rank])
    if (~wrong).any():
        items.append(Points("copies", places[~wrong], role="posterior", size=13))
    if wrong.any():
        items.append(Points("wrong", places[wrong], role="warning", size=14, shape="diamond"))
    return items


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """Algorithm 6 with the numbers of point i."""
    start = Equation("sum", (r"\omega =", r.w[None], r",\quad c =", np.cumsum(r.w)[None]),
                     current=at.step == 0, digits=3)
    if at.step == 0:
        return [start]
    i = at.step - 1
    j = int(r.ancestors[i])
    outright = len(r.ancestors) - len(r.z)
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = []
    if p.scheme == "residual":
        lines.append(("outright", POINT, r"\lfloor N\omega^j \rfloor", ("=", r.outright[None])))
    if i >= outright:
        low = float(r.stairs[j - 1]) if j else 0.0
        lines += [
            ("point", POINT, COMBS[p.scheme], (r",\quad z_i =", float(r.z[i - outright]))),
            ("search", SEARCH, r"c_{j-1} < z_i \leq c_j",
             (r":\quad", low, "<", float(r.z[i - outright]), r"\leq", float(r.stairs[j]), rf",\quad j = {j + 1}")),
        ]
    lines += [
        ("copy", COPY, r"\mathbf{x}^{i}_{\mathrm{new}} = \mathbf{x}^{j}" if p.gather == "new"
         else r"\mathbf{x}^{i} := \mathbf{x}^{j}", ("=", float(r.children[i]), r"\,\mathrm{m}")),
        ("copies", COPY, r"n_j", ("=", np.bincount(r.ancestors[:at.step], minlength=p.n).astype(float)[None])),
        ("shares", COPY, r"N\omega^j", ("=", (p.n * r.w)[None])),
    ]
    def running(name: str, stage: int) -> bool:
        if name == "outright":                       # such a copy needs neither a point nor a search
            return i < outright and at.stage < COPY
        return stage == at.stage

    return [start, *(
        Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=running(name, stage),
                 digits=1 if name in ("outright", "copies") else 3) for name, stage, rule, numbers in lines)]


def _readouts(p: "Params", r: "Result") -> list[Readout]:
    s, j = SCHEMES.index(p.scheme), r.watched
    return [
        Readout("n_eff", r.n_eff, digits=3),
        Readout("expected", float(p.n * r.w[j]), digits=3),
        Readout("copies", float(r.copies[j]), digits=1),
        Readout("variance", float(r.many.variance[s, j]), digits=3),
        Readout("below", 100.0 * float(r.many.below[s]), "%", 3),
        Readout("mean_sd", float(r.many.mean_sd[s]), "m", 3),
        Readout("mean_sd_multinomial", float(r.many.mean_sd[2]), "m", 3),
    ]


def _figures(p: "Params", r: "Result") -> dict[str, "go.Figure"]:
    """Copies now; their variance, the watched particle's copies, and the mean's error over many repetitions."""
    j = np.arange(1, p.n + 1)
    counts = np.arange(p.n + 1)
    shown = counts[:max(3, int(np.flatnonzero(r.many.shares.max(axis=0) > 0.002).max()) + 2)]
    multinomial = p.n * r.w * (1.0 - r.w)
    return {
        "copies": fig.chart(fig.bars("copies", j, r.copies, "posterior", width=0.55),
                            fig.markers("expected", j, p.n * r.w, "pf", size=11, symbol="diamond"),
                            categories=True),
        "watched": fig.chart(*(fig.bars(name, shown, 100.0 * r.many.shares[s][shown], ROLES[name])
                               for s, name in enumerate(SCHEMES)), marks=[float(p.n * r.w[r.watched])]),
        "variance": fig.chart(*(fig.bars(name, j, r.many.variance[s], ROLES[name]) for s, name in enumerate(SCHEMES)),
                              fig.markers("theory", j, multinomial, "reference", size=9, symbol="diamond"),
                              categories=True),
        "mean": fig.chart(*(fig.bars(name, [s + 1], [float(r.many.mean_sd[s])], ROLES[name], width=0.7)
                            for s, name in enumerate(SCHEMES)), x_range=(0.4, 4.6)),
    }
