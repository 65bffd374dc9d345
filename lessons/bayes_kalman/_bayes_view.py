"""Bayes' theorem drawn: areas in a unit square for three hypotheses, curves over a line for a continuum."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, Plane, Points, Polygon, Polyline, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.bayes_kalman.bayes_theorem import Params, Result

PRIOR, LIKELIHOOD, EVIDENCE, POSTERIOR = range(4)
NAMES = "ABC"
COLOURS: tuple[Role, ...] = ("kf", "ekf", "ukf")
UPPER, LOWER = 1.0, 0.45                 # heights of the two boxes of areas
GAP = 0.34
VISIBLE_M = 14.0


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The belief before this step's datum, and stage by stage what the datum makes of it."""
    scene, camera = _areas(r, at) if p.case == "cells" else _curves(p, r, at)
    caption = "before any datum" if at.step == 0 else f"datum {at.step}: {_datum(p, r, at.step)}"
    note = ""
    if at.step and r.evidence[at.step - 1] == 0.0:
        note = "This datum is impossible under this prior: the evidence is 0 and there is no posterior."
    return View(scene=scene, camera=camera, figures=_figures(p, r, at.step), readouts=_readouts(p, r, at.step),
                equations=_equations(p, r, at), caption=caption, note=note)


def _datum(p: "Params", r: "Result", k: int) -> str:
    y = r.y[k - 1]
    return {"cells": "rings" if y else "silent", "coin": "heads" if y else "tails"}.get(p.case, f"y = {y:.2f} m")


# Three hypotheses: probability is area.

def _areas(r: "Result", at: Moment) -> tuple[list[Item], Plane]:
    k = at.step
    before = r.mine[max(k - 1, 0)]
    stage = at.stage if k else PRIOR
    low = LOWER + GAP
    edges = np.append(0.0, np.cumsum(before))
    title = "prior (widths)" if stage == PRIOR else "prior (widths) × likelihood (heights)"
    items: list[Item] = [Polyline("square", _box(0.0, low, 1.0, low + UPPER), role="reference", width=2, closed=True),
                         Label("square_title", title, (0.5, low + UPPER + 0.06))]
    if stage >= POSTERIOR:
        items.append(Polyline("strip", _box(0.0, 0.0, 1.0, LOWER), role="reference", width=2, closed=True))
        items.append(Label("strip_title", "posterior: the full areas alone, stretched to width 1", (0.5, LOWER + 0.06)))
    after = np.append(0.0, np.cumsum(r.mine[k]))
    for i, (name, role) in enumerate(zip(NAMES, COLOURS, strict=True)):
        left, right = edges[i], edges[i + 1]
        if right - left > 1e-4:
            items += [Polygon(f"prior_{name}", _box(left, low, right, low + UPPER), role=role, opacity=0.22),
                      Label(f"name_{name}", f"{name} {before[i]:.3f}", ((left + right) / 2, low - 0.05), size=0.9)]
            if stage >= LIKELIHOOD:
                height = UPPER * r.likelihood[k - 1, i]
                if height > 1e-4:
                    full = _box(left, low, right, low + height)
                    items.append(Polygon(f"joint_{name}", full, role=role, opacity=0.85))
                if right - left > 0.03:
                    items.append(Label(f"likelihood_{name}", f"{r.likelihood[k - 1, i]:.2f}",
                                       ((left + right) / 2, low + height + 0.04), size=0.9))
        left, right = after[i], after[i + 1]
        if stage >= POSTERIOR and right - left > 1e-4:
            items += [Polygon(f"posterior_{name}", _box(left, 0.0, right, LOWER), role=role, opacity=0.85),
                      Label(f"after_{name}", f"{name} {r.mine[k, i]:.3f}", ((left + right) / 2, -0.05), size=0.9)]
    if stage >= EVIDENCE:
        level = low + UPPER * float(r.evidence[k - 1])
        items += [Segments("evidence", np.array([[[0.0, level], [1.0, level]]]), role="warning", width=3),
                  Label("evidence_label", f"p(h) = {r.evidence[k - 1]:.3f}", (1.02, level), anchor="left")]
    return items, Plane((-0.06, 1.3), (-0.12, low + UPPER + 0.12), axes=False)


def _box(left: float, low: float, right: float, high: float) -> Array:
    return np.array([[left, low], [right, low], [right, high], [left, high]])


# A continuum: probability is area under a curve.

def _curves(p: "Params", r: "Result", at: Moment) -> tuple[list[Item], Plane]:
    k = at.step
    stage = at.stage if k else PRIOR
    coin = p.case == "coin"
    low, high = (0.0, 1.0) if coin else (-VISIBLE_M, VISIBLE_M)
    wide = high - low
    seen = (r.axis >= low) & (r.axis <= high)
    x = r.axis[seen]
    before, after, theirs = r.mine[max(k - 1, 0)], r.mine[k], r.theirs[k]
    peak = float(max(before.max(), after.max(), theirs.max()))
    scale = 0.72 * wide / peak                            # so that the tallest curve of the moment fills the height

    def curve(values: Array) -> Array:
        return np.column_stack([x, scale * values[seen]])

    items: list[Item] = _ruler(low, high, 0.2 if coin else 5.0, "probability of heads" if coin else "position (m)")
    items += [Segments("truth", np.array([[[r.truth, 0.0], [r.truth, 0.76 * wide]]]), role="truth", width=1.5),
              Label("truth_label", "truth", (r.truth, 0.79 * wide)),
              Polyline("prior", curve(before), role="prior", width=4)]
    if stage >= LIKELIHOOD:
        L = r.likelihood[k - 1]
        items.append(Polyline("likelihood", curve(L / L.sum()), role="likelihood", width=3))
        if not coin:
            items.append(Points("y", [(float(np.clip(r.y[k - 1], low, high)), 0.0)], role="measurement", size=13))
    if stage >= EVIDENCE:
        product = curve(before * r.likelihood[k - 1] / r.likelihood[k - 1].max())
        high_enough = np.flatnonzero(product[:, 1] > 1e-3 * product[:, 1].max())
        if len(high_enough) > 2:
            product = product[high_enough[0]:high_enough[-1] + 1][::max(1, len(high_enough) // 80)]
            rim = np.vstack([[product[0, 0], 0.0], product, [product[-1, 0], 0.0]])
            items.append(Polygon("joint", rim, role="warning", opacity=0.35))
    if stage >= POSTERIOR:
        items += [Polyline("theirs", curve(theirs), role="mixture", width=2.5, dashed=True),
                  Polyline("posterior", curve(after), role="posterior", width=5)]
    return items, Plane((low - 0.04 * wide, high + 0.04 * wide), (-0.16 * wide, 0.84 * wide), axes=False)


def _ruler(low: float, high: float, step: float, title: str) -> list[Item]:
    wide = high - low
    ticks = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step + 0.0
    lines = [[[low, 0.0], [high, 0.0]]] + [[[t, 0.0], [t, -0.015 * wide]] for t in ticks]
    return [Segments("ruler", np.array(lines), role="reference", width=1.5),
            *(Label(f"tick_{i}", f"{t:g}", (t, -0.045 * wide), size=0.85) for i, t in enumerate(ticks)),
            Label("ruler_title", title, ((low + high) / 2, -0.11 * wide))]


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """(2.1) term by term with the numbers of this datum."""
    k, cells = at.step, p.case == "cells"
    if k == 0:
        prior: tuple[Piece, ...] = ("p(e) =", r.mine[0]) if cells else _law(r, 0)
        return [Equation("prior", prior, current=True)]
    L, Z = r.likelihood[k - 1], float(r.evidence[k - 1])
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("prior", PRIOR, r"p(e)", (":\\;", *_law(r, k - 1)) if not cells else ("=", r.mine[k - 1])),
        ("likelihood", LIKELIHOOD, r"p(h\,|\,e)", ("=", L) if cells else (r",\quad h =", float(r.y[k - 1]))),
        ("evidence", EVIDENCE, r"p(h) = \sum_e p(h\,|\,e)\,p(e)" if cells else r"p(h) = \int p(h\,|\,e)\,p(e)\,de",
         ("=", Z)),
        ("posterior", POSTERIOR, r"p(e\,|\,h) = \frac{p(h\,|\,e)\,p(e)}{p(h)}",
         ("=", r.mine[k]) if cells else (":\\;", *_law(r, k))),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _law(r: "Result", k: int) -> tuple[Piece, ...]:
    return (r"\mathrm{E} =", float(r.laws[k, 0]), r",\;\sigma =", float(r.laws[k, 1]))


def _apart(r: "Result") -> Array:
    """Total variation between the two beliefs after each datum: 0 equal, 1 nothing in common."""
    return 0.5 * np.abs(r.mine - r.theirs).sum(axis=1)


def _factor(r: "Result") -> Array:
    """log10 of the Bayes factor of my prior against the flat one, as long as both allow the data."""
    allowed = np.cumprod((r.evidence > 0) & (r.evidence_theirs > 0)).astype(bool)
    return np.cumsum(np.log10(r.evidence[allowed]) - np.log10(r.evidence_theirs[allowed]))


def _readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    unit = "m" if p.case == "normal" else ""
    factor = _factor(r)
    if p.case == "cells":
        i = int(r.truth)
        said = [Readout("truth_mine", float(r.mine[k, i]), digits=4), Readout("truth_theirs", float(r.theirs[k, i]))]
    else:
        said = [Readout("mean", float(r.laws[k, 0]), unit), Readout("sd", float(r.laws[k, 1]), unit, 3),
                Readout("mean_theirs", float(r.theirs[k] @ r.axis), unit)]
    return [Readout("datum", _datum(p, r, k) if k else None),
            Readout("evidence", float(r.evidence[k - 1]) if k else None), *said,
            Readout("apart", float(_apart(r)[k]), digits=3),
            Readout("factor", float(factor[k - 1]) if 0 < k <= len(factor) else None, digits=3)]


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """What is believed after each datum; how far apart the two people are; whose prior foresaw the data."""
    n = np.arange(len(r.mine))
    if p.case == "cells":
        i = int(r.truth)
        mine = [fig.line(NAMES[j], n, r.mine[:, j], COLOURS[j]) for j in range(3)]
        belief = fig.chart(*mine, fig.line("theirs", n, r.theirs[:, i], "mixture", dash=True), cursor=k,
                           y_range=(0.0, 1.02))
    else:
        mean, sd = r.laws.T
        belief = fig.chart(fig.band("band", n, mean - 2 * sd, mean + 2 * sd, "posterior"),
                           fig.line("mean", n, mean, "posterior"),
                           fig.line("theirs", n, r.theirs @ r.axis, "mixture", dash=True),
                           fig.line("truth", n[[0, -1]], [r.truth, r.truth], "truth", dash=True, width=1.5), cursor=k)
    factor = _factor(r)
    return {
        "belief" if p.case == "cells" else "estimate": belief,
        "apart": fig.chart(fig.line("apart", n, _apart(r), "vector"), cursor=k, y_range=(0.0, 1.02)),
        "factor": fig.chart(fig.line("factor", n[:len(factor) + 1], np.append(0.0, factor), "innovation"), cursor=k),
    }
