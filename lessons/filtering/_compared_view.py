"""How one update of three filters is drawn: circles, the straight lines that stand for them, what comes out."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import chi_square_level
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.roles import Role
from lessons.kit.scene import HeatMap, Item, LevelEllipse, Plane, Points, Polyline, Segments, Stations

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.nonlinear_compared import Params, Result

PREDICT, MEASURE, LINEARISE, UPDATE = range(4)
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 181)
NAMES: tuple[Role, ...] = ("ekf", "ukf", "grid")


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this step, and of this step everything up to this stage."""
    return View(
        scene=_scene(r, at), camera=_camera(p, r), figures=_figures(p, r, at.step), readouts=_readouts(r, at.step),
        equations=_equations(r, at), caption=f"t = {at.step} s", note=_note(r),
    )


def _note(r: "Result") -> str:
    """When the grid, the reference here, should not be trusted."""
    if r.exact.cell_m > r.sigma_m:
        return (f"The grid is coarse here: its cells of {r.exact.cell_m:.2g} m must show a measurement of "
                f"σ = {r.sigma_m:g} m.")
    if r.exact.lost > 0.02:
        return f"The moving grid cut off {r.exact.lost:.1%} of the probability in all."
    return ""


def _law(g: Gaussian, i: int) -> Gaussian:
    return Gaussian(g.mean[i, :2], g.cov[i, :2, :2])


def _scene(r: "Result", at: Moment) -> list[Item]:
    k, stage, i = at.step, at.stage, at.step - 1
    done = k if k == 0 or stage == UPDATE else k - 1
    x, y = r.exact.axes[k]
    weights = r.exact.posterior[k] if stage == UPDATE else r.exact.prior[k]
    items: list[Item] = [
        HeatMap("density", x, y, weights.T, role="grid", opacity=0.75),
        Stations("stations", r.stations, tuple(f"S{j + 1}" for j in range(len(r.stations)))),
        Polyline("truth", r.truth[:k + 1, :2], role="truth", dashed=True) if k else
        Points("truth_start", r.truth[[0], :2], role="truth", size=8),
        Points("truth_now", r.truth[[k], :2], role="truth", size=13, shape="diamond"),
    ]
    if k == 0:
        return [*items, LevelEllipse("prior", r.initial, role="prior", width=3)]
    if done > 1:
        items += [Polyline("ekf_track", r.ekf.posterior.mean[:done, :2], role="ekf", width=2.5),
                  Polyline("ukf_track", r.ukf.posterior.mean[:done, :2], role="ukf", width=2.5),
                  Polyline("grid_track", r.exact.law.mean[1:done + 1], role="grid", width=2.5)]
    if stage >= MEASURE:
        items += [Polyline(f"range_{j + 1}", s + distance * np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)]),
                           role="measurement", width=2.5)
                  for j, (s, distance) in enumerate(zip(r.stations, r.y[i], strict=True))]
    same = k == 1
    if stage < UPDATE or same:
        items.append(LevelEllipse("prior" if same else "ekf_prior", _law(r.ekf.prior, i),
                                  role="prior" if same else "ekf", width=3 if stage < UPDATE else 1.5, dashed=not same))
        if not same:
            items.append(LevelEllipse("ukf_prior", _law(r.ukf.prior, i), role="ukf", width=3, dashed=True))
    if stage >= LINEARISE:
        ekf, ukf = _lines(r, i)
        items += [Segments("ekf_lines", ekf, role="ekf", width=2.5),
                  Segments("ukf_lines", ukf, role="ukf", width=2.5)]
    if stage == LINEARISE:
        items.append(Points("sigma", r.ukf.points[i, :, :2], role="sigma", size=9))
    if stage == UPDATE:
        items += [LevelEllipse("grid_now", _law(r.exact.law, k), role="grid", width=3),
                  LevelEllipse("ukf_now", _law(r.ukf.posterior, i), role="ukf", width=4, filled=True),
                  LevelEllipse("ekf_now", _law(r.ekf.posterior, i), role="ekf", width=4, filled=True)]
    return items


def _lines(r: "Result", i: int) -> tuple[Array, Array]:
    """The straight lines y = y_hat + A (x - x_bar) that the two filters put in the place of the circles, (s, 2, 2).

    A is the derivative at the mean (EKF), or the slope of the regression through the sigma points (UKF).
    """
    u = r.ukf
    slope = np.linalg.solve(u.prior.cov[i, :2, :2], u.cross[i, :2]).T
    return (_through(r.ekf.jacobian[i, :, :2], r.ekf.innovation[i], _law(r.ekf.prior, i)),
            _through(slope, u.innovation[i], _law(u.prior, i)))


def _through(A: Array, nu: Array, prior: Gaussian) -> Array:
    """{x: A_j (x - x_bar) = nu_j} for each row j, 1.5 standard deviations of the prior to each side."""
    length = 1.5 * float(np.sqrt(np.trace(prior.cov) / 2.0))
    squares = np.maximum(np.square(A).sum(axis=1), 1e-12)[:, None]
    foot = prior.mean + A * nu[:, None] / squares
    along = length * np.column_stack([-A[:, 1], A[:, 0]]) / np.sqrt(squares)
    return np.stack([foot - along, foot + along], axis=1)


def _camera(p: "Params", r: "Result") -> Plane:
    """The track, the estimates, the prior, and the stations unless the track alone is wanted."""
    sigma = np.sqrt(np.diagonal(r.initial.cov))[:2]
    spread = r.initial.mean[:2] + 1.9 * np.array([-sigma, sigma])
    tracks = np.vstack([r.ekf.posterior.mean[:, :2], r.ukf.posterior.mean[:, :2], r.exact.law.mean])
    near = np.abs(tracks - r.truth[:, :2].mean(axis=0)).max(axis=1) < 300.0
    points = np.vstack([spread, r.truth[:, :2], tracks[near], r.stations if p.zoom == "stations" else spread])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.06 * float((high - low).max()) + 4.0
    (x0, y0), (x1, y1) = low - margin, high + margin + (0.0, margin)      # the caption stands at the top
    return Plane((float(x0), float(x1)), (float(y0), float(y1)), "x₁ (m)", "x₂ (m)")


def _equations(r: "Result", at: Moment) -> list[Equation]:
    """(3.15) twice: the two filters differ only in where y_bar, P_xy and P_yy come from."""
    k, i = at.step, at.step - 1
    if k == 0:
        return [Equation("start", (r"\hat{\mathbf{x}}_0 =", r.initial.mean[:2], r",\quad P_0 =",
                                   r.initial.cov[:2, :2]), current=True)]
    e, u = r.ekf, r.ukf
    rule = r"\hat{\mathbf{x}} = \bar{\mathbf{x}} + P_{xy}P_{yy}^{-1}(\mathbf{y} - \bar{\mathbf{y}})"
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("ekf_prior", PREDICT, r"\bar{\mathbf{x}}", ("=", e.prior.mean[i, :2])),
        ("ukf_prior", PREDICT, r"\bar{\mathbf{x}}", ("=", u.prior.mean[i, :2])),
        ("measured", MEASURE, r"\mathbf{y} = h(\mathbf{x}) + \mathbf{v}", ("=", r.y[i])),
        ("ekf_y", LINEARISE, r"\bar{\mathbf{y}} = h(\bar{\mathbf{x}})", ("=", e.y_hat[i])),
        ("ukf_y", LINEARISE, r"\bar{\mathbf{y}} = \sum_j w_j\,h(\chi_j)", ("=", u.y_hat[i])),
        ("ekf_cov", LINEARISE, r"P_{yy} = JP_{xx}J^T + R", ("=", e.innovation_cov[i])),
        ("ukf_cov", LINEARISE, r"P_{yy} = \sum_j w_j(h(\chi_j) - \bar{\mathbf{y}})(\cdot)^T + R",
         ("=", u.innovation_cov[i])),
        ("ekf_x", UPDATE, rule, ("=", e.posterior.mean[i, :2])),
        ("ukf_x", UPDATE, rule, ("=", u.posterior.mean[i, :2])),
        ("grid_x", UPDATE, r"E(\mathbf{x} \mid \mathbf{y}_{1:k}) = \sum_c p_c\,\mathbf{x}_c",
         ("=", r.exact.law.mean[k])),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _readouts(r: "Result", k: int) -> list[Readout]:
    i = k - 1
    found = [Readout(f"{name}_error", float(r.errors[j, i]) if k else None, "m", 3) for j, name in enumerate(NAMES)]
    found += [Readout(f"{name}_nees", float(r.nees[j, i]) if k else None, "", 3) for j, name in enumerate(NAMES)]
    means = r.first.mean_nees
    return [*found, Readout("first_nees", " / ".join(f"{v:.3g}" for v in means)),
            Readout("rmse", " / ".join(f"{v:.3g}" for v in np.sqrt(np.square(r.errors).mean(axis=1))), "m")]


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    from lessons.filtering.nonlinear_compared import KAPPAS

    t = np.arange(1.0, len(r.truth))
    whole, limit = t[[0, -1]], float(chi_square_level(0.95, 2))
    low, high = r.band
    return {
        "error": fig.chart(*(fig.line(name, t, r.errors[j], name) for j, name in enumerate(NAMES)), cursor=k),
        "nees": fig.chart(
            *(fig.line(name, t, np.maximum(r.nees[j], 1e-3), name) for j, name in enumerate(NAMES)),
            fig.line("limit", whole, np.full(2, limit), "reference", dash=True), log_y=True, cursor=k),
        "mean_nees": fig.chart(
            fig.band("band", t, np.full(len(t), low), np.full(len(t), high), "reference"),
            fig.line("ekf", t, r.mean_nees[0], "ekf"), fig.line("ukf", t, r.mean_nees[1], "ukf"),
            fig.markers("grid", t[:1], r.first.mean_nees[2:], "grid", size=11), log_y=True, cursor=k),
        "kappa": fig.chart(
            fig.line("ukf", KAPPAS, r.first.sweep[:, 0], "ukf"),
            fig.line("ekf", KAPPAS[[0, -1]], np.full(2, r.first.ekf[0]), "ekf", dash=True),
            cursor=p.kappa, marks=[3.0 - len(r.initial.mean)]),
        "size": fig.chart(
            fig.line("ukf", KAPPAS, 100.0 * r.first.sweep[:, 1], "ukf"),
            fig.line("ekf", KAPPAS[[0, -1]], np.full(2, 100.0 * r.first.ekf[1]), "ekf", dash=True),
            fig.line("exact", KAPPAS[[0, -1]], np.full(2, 100.0), "grid", dash=True),
            cursor=p.kappa, marks=[3.0 - len(r.initial.mean)]),
    }
