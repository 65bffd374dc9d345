"""How a gain is judged: bells on a line or a bowl over the gain's row, the numbers in the formulas, and three plots."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import log_density
from core.linear_update import joseph_form, short_form
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Camera, Item, Label, Orbit, Plane, Points, Polyline, Segments, Surface

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.bayes_kalman.gain import Params, Result

GAIN, JOSEPH, SHORT, SLOPE = range(4)
MESH = 33
SHOWN = 60                               # perturbed gains drawn on the bowl


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The gain of this step and, stage by stage, what is said about it."""
    one = p.model == "one"
    scene, camera, note = _bells(r, at) if one else _bowl(p, r, at)
    return View(scene=scene, camera=camera, figures=_figures(p, r, at.step), readouts=_readouts(r, at.step),
                equations=_equations(r, at), caption=f"gain {r.sweep.scale[at.step]:.2f} × K", note=note)


# One coordinate: the estimate slides from the prediction to the measurement.

def _bells(r: "Result", at: Moment) -> tuple[list[Item], Camera, str]:
    k = at.step
    x, P, y, R = float(r.step.prior.mean[0]), r.step.prior.cov, float((r.step.y_hat + r.step.innovation)[0]), r.R
    used = float(r.sweep.scale[k] * r.step.gain[0, 0])
    estimate = x + used * float(r.step.innovation[0])
    reach = 2.6 * float(np.sqrt(max(P[0, 0], R[0, 0], r.sweep.joseph[:, 0, 0].max())))
    low, high = min(x, y) - reach, max(x, y) + reach
    tallest = 1.0 / np.sqrt(2 * np.pi * min(P[0, 0], R[0, 0], r.sweep.joseph[:, 0, 0].min()))
    factor = 0.6 * (high - low) / tallest
    line = np.linspace(low, high, 241)

    def bell(mean: float, variance: float) -> Array:
        law = Gaussian(np.array([mean]), np.array([[variance]]))
        return np.column_stack([line, factor * np.exp(log_density(law, line[:, None]))])

    foot, top = 0.02 * (high - low), 0.95 * (high - low)
    items: list[Item] = [
        Polyline("prior", bell(x, P[0, 0]), role="prior", width=3),
        Polyline("likelihood", bell(y, R[0, 0]), role="measurement", width=3),
        Points("prior_mean", [(x, 0.0)], role="prior", size=12), Points("y", [(y, 0.0)], role="measurement", size=12),
        Label("prior_label", "x\u0302⁻", (x, -2.2 * foot)), Label("y_label", "y", (y, -2.2 * foot)),
        Arrow("correction", (x, -5.5 * foot), (estimate, -5.5 * foot), role="vector", width=4),
        Points("estimate", [(estimate, -5.5 * foot)], role="vector", size=12),
        Label("estimate_label", f"x\u0302 = x\u0302⁻ + {used:.3f} (y − x\u0302⁻)", (estimate, -8.5 * foot)),
    ]
    if at.stage >= JOSEPH:
        items.append(Polyline("joseph", bell(estimate, r.sweep.joseph[k, 0, 0]), role="posterior", width=5))
    said = float(r.sweep.short[k, 0, 0])
    note = ""
    if at.stage >= SHORT:
        if said > 1e-9:
            curve = bell(estimate, max(said, 1e-4 * P[0, 0]))
            pairs = np.stack([curve[:-1], curve[1:]], axis=1)     # a narrow bell is left open at the upper edge
            items.append(Segments("short", pairs[(pairs[..., 1] < top).all(axis=1)], role="warning", width=3))
        else:
            note = f"The short form says {said:.2f} m²: no law has such a variance, nothing can be drawn."
    camera = Plane((low, high), (-11.0 * foot, top), "position (m)", f"density × {factor:.2g} (1/m)")
    return items, camera, note


# Two coordinates: row i of the gain decides the variance of coordinate i alone, and makes it a paraboloid.

def _bowl(p: "Params", r: "Result", at: Moment) -> tuple[list[Item], Camera, str]:
    i, k = int(p.row) - 1, at.step
    P, H = float(r.step.prior.cov[i, i]), r.step.jacobian
    best = r.step.gain[i]
    half = 1.15 * max(float(np.abs(best).max()), 0.05)
    high = P * 1.8
    z = 2.2 * half / high                                 # scene units for one square metre

    def heights(rows: Array) -> tuple[Array, Array]:
        """P_ii for gains with these rows i (..., m): in Joseph form, and as the short form says."""
        gains = np.broadcast_to(r.step.gain, (*rows.shape[:-1], *r.step.gain.shape)).copy()
        gains[..., i, :] = rows
        both = joseph_form(r.step.prior.cov, H, r.R, gains), short_form(r.step.prior.cov, H, gains)
        return both[0][..., i, i], both[1][..., i, i]

    axis = np.linspace(-half, half, MESH)
    grid = np.stack(np.meshgrid(best[0] + axis, best[1] + axis), axis=-1)
    bowl, plane = heights(grid)
    used = r.sweep.scale[k] * best
    real, said = heights(used)
    at_best = heights(best)[0]

    def spot(row: Array, height: float) -> Array:
        return np.array([row[0], row[1], z * height])

    name = f"P{'₁₁' if i == 0 else '₂₂'}"
    corner = best - half
    sweep = r.sweep.scale[:, None] * best
    items: list[Item] = [
        *_frame(corner, half, z, P, name, i),
        Points("best", [spot(best, at_best)], role="reference", size=13, shape="diamond"),
        Segments("best_drop", np.array([[spot(best, 0.0), spot(best, at_best)]]), role="reference", width=2),
        Label("best_label", "K", spot(best, 0.0) - [0.0, 0.0, 0.1 * half]),
        Polyline("multiples", np.column_stack([sweep, z * heights(sweep)[0]]), role="muted", width=2),
        Points("used_floor", [spot(used, 0.0)], role="vector", size=11),
    ]
    if at.stage >= JOSEPH:
        some = r.perturbed.gains[:SHOWN, i]
        some = some[(np.abs(some - best) < half).all(axis=-1)]
        some = some[heights(some)[0] < high]
        items += [
            Surface("joseph", best[0] + axis, best[1] + axis, z * np.minimum(bowl, high), role="posterior",
                    opacity=0.55, contours=10),
            Points("used", [spot(used, float(real))], role="vector", size=14),
            Segments("used_drop", np.array([[spot(used, 0.0), spot(used, float(real))]]), role="vector", width=2),
        ]
        if len(some):
            items.append(Points("perturbed", np.column_stack([some, z * heights(some)[0]]), role="monte_carlo", size=5))
    if at.stage >= SHORT:
        items += [Surface("short", best[0] + axis[::4], best[1] + axis[::4], z * plane[::4, ::4], role="warning",
                          opacity=0.35, contours=0),
                  Points("used_short", [spot(used, float(said))], role="warning", size=13, shape="square")]
    if at.stage >= SLOPE:
        down = -r.sweep.gradient[k, i]
        length = float(np.linalg.norm(down))
        if length > 1e-9:
            # Newton's step would end at the best gain; the arrow shows the direction at the size of that step.
            tip = used + down / length * float(np.linalg.norm(best - used))
            items.append(Arrow("slope", spot(used, 0.0), spot(tip, 0.0), role="innovation", width=4))
    middle = np.array([best[0], best[1], z * 0.42 * high])
    return items, Orbit(tuple(float(v) for v in middle), 1.75 * half, -62.0, 20.0), ""


def _frame(corner: Array, half: float, z: float, P: float, name: str, i: int) -> list[Item]:
    """The floor (variance 0), its axes with numbers, and the height of the prior variance."""
    x0, y0 = corner
    side = 2 * half
    floor = np.array([[x0, y0, 0], [x0 + side, y0, 0], [x0 + side, y0 + side, 0], [x0, y0 + side, 0]])
    step = max((s for s in (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0) if side / s >= 4), default=0.01)
    xs, ys = (np.arange(np.ceil(v / step), np.floor((v + side) / step) + 1) * step + 0.0 for v in corner)
    lines = [[[x, y0, 0], [x, y0 + side, 0]] for x in xs] + [[[x0, y, 0], [x0 + side, y, 0]] for y in ys]
    post = np.array([[[x0, y0 + side, 0.0], [x0, y0 + side, z * 1.5 * P]]])
    row = "₁" if i == 0 else "₂"
    return [Polyline("floor", floor, role="reference", width=1.5, closed=True),
            Segments("grid", np.array(lines), role="muted", width=0.8, fade=0.5),
            Segments("post", post, role="reference", width=2),
            *(Label(f"x_{j}", f"{x:.2g}", (x, y0 - 0.09 * side, 0.0), size=0.75) for j, x in enumerate(xs)),
            *(Label(f"y_{j}", f"{y:.2g}", (x0 + 1.07 * side, y, 0.0), size=0.75) for j, y in enumerate(ys)),
            Label("x_title", f"gain K{row}₁", (x0 + half, y0 - 0.22 * side, 0.0)),
            Label("y_title", f"gain K{row}₂", (x0 + 1.22 * side, y0 + half, 0.0)),
            Points("prior_height", [(x0, y0 + side, z * P)], role="prior", size=9),
            Label("prior_label", f"{name}⁻ = {P:.3g} m²", (x0, y0 + side, z * P), size=0.85, anchor="left"),
            Label("z_title", f"{name} (m²)", (x0, y0 + side, z * 1.6 * P), size=0.95)]


def _equations(r: "Result", at: Moment) -> list[Equation]:
    """The chain from the gain to its slope with the numbers of the gain used."""
    k = at.step
    K = r.sweep.scale[k] * r.step.gain
    lines: list[tuple[str, int, tuple[Piece, ...], tuple[Piece, ...]]] = [
        ("best", GAIN, (r"K^\ast = P^-H^TS^{-1}",), ("=", r.step.gain)),
        ("used", GAIN, (r"K = c\,K^\ast",), ("=", float(r.sweep.scale[k]), r"\cdot K^\ast =", K)),
        ("joseph", JOSEPH, (r"P = (I - KH)P^-(I - KH)^T + KRK^T",), ("=", r.sweep.joseph[k])),
        ("joseph_trace", JOSEPH, (r"\mathrm{tr}\,P",), ("=", float(np.trace(r.sweep.joseph[k])))),
        ("short", SHORT, (r"(I - KH)P^-",), ("=", r.sweep.short[k])),
        ("short_trace", SHORT, (r"\mathrm{tr}\,(I - KH)P^-",), ("=", float(np.trace(r.sweep.short[k])))),
        ("slope", SLOPE, (r"\frac{\partial\,\mathrm{tr}\,P}{\partial K} = -2P^-H^T + 2KS",),
         ("=", r.sweep.gradient[k])),
    ]
    return [Equation(name, (*rule, *numbers) if stage <= at.stage else rule, current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _readouts(r: "Result", k: int) -> list[Readout]:
    eigenvalues = np.sort(np.linalg.eigvals(r.step.gain @ r.step.jacobian).real)
    return [
        Readout("real", float(r.sweep.real[k].sum()), "m²", 3),
        Readout("joseph", float(np.trace(r.sweep.joseph[k])), "m²", 4),
        Readout("short", float(np.trace(r.sweep.short[k])), "m²", 4),
        Readout("least", float(np.trace(r.step.posterior.cov)), "m²", 4),
        Readout("prior", float(np.trace(r.step.prior.cov)), "m²", 4),
        Readout("trust", ", ".join(f"{v:.3f}" for v in eigenvalues)),
    ]


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """Trace against the size of the gain, against a random change of it, and trust against the noise."""
    from lessons.bayes_kalman.gain import RATIOS

    s, o = r.sweep, r.perturbed
    joseph, short = np.trace(s.joseph, axis1=1, axis2=2), np.trace(s.short, axis1=1, axis2=2)
    order = np.argsort(o.price)
    trust = [fig.line(f"trust_{j}", RATIOS, r.trust[:, j], role)
             for j, role in zip(range(r.trust.shape[1]), ("kf", "vector"), strict=False)]
    return {
        "trace": fig.chart(
            fig.line("joseph", s.scale, joseph, "posterior"), fig.line("short", s.scale, short, "warning", dash=True),
            fig.markers("real", s.scale[::2], s.real[::2].sum(axis=1), "monte_carlo", size=6),
            cursor=float(s.scale[k]), marks=[1.0]),
        "perturbed": fig.chart(
            fig.markers("short", o.price, o.short, "warning", size=4, symbol="square"),
            fig.line("joseph", o.price[order], o.joseph[order], "posterior"),
            fig.markers("real", o.price[order[::3]], o.real[order[::3]], "monte_carlo", size=6)),
        "trust": fig.chart(*trust, cursor=1.0, log_x=True, y_range=(0.0, 1.0)),
    }
