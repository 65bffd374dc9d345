"""How one step of the Kalman filter is drawn: ellipses, arrows, the numbers in the formulas, and four plots."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Item, Label, LevelEllipse, Plane, Points, Polyline

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.kalman import Params, Result

PREDICT, INNOVATION, GAIN, UPDATE = range(4)


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this step, and of this step everything up to this stage."""
    return View(
        scene=_scene(r, at), camera=_camera(r), figures=_figures(p, r, at.step), readouts=_readouts(r, at.step),
        equations=_equations(r, at), caption=f"t = {at.step * p.dt_s:.4g} s",
    )


def _estimates(r: "Result") -> Array:
    """Posterior means (STEPS + 1, 4), the start included."""
    return np.vstack([r.initial.mean, r.updates.posterior.mean])


def _posterior(r: "Result", k: int) -> Gaussian:
    return r.initial if k == 0 else Gaussian(r.updates.posterior.mean[k - 1], r.updates.posterior.cov[k - 1])


def _scene(r: "Result", at: Moment) -> list[Item]:
    k, stage = at.step, at.stage
    done = k if stage == UPDATE or k == 0 else k - 1          # the last step whose estimate is known
    seen = k if stage >= INNOVATION else k - 1                # the last measurement that has come in
    estimates = _estimates(r)[:done + 1, :2]
    items: list[Item] = [Polyline("truth", r.truth[:, :2], role="truth", dashed=True, width=2.5),
                         Points("truth_now", r.truth[[k], :2], role="truth", size=11, shape="diamond")]
    if seen > 0:
        items += [Polyline("measured_line", r.y[:seen], role="measurement", width=1.0, fade=0.45),
                  Points("measurements", r.y[:seen], role="measurement", size=7)]
    if len(estimates) > 1:
        items.append(Polyline("estimate", estimates, role="kf", width=4))
    if k == 0:
        return [*items, LevelEllipse("posterior", r.initial, role="posterior", filled=True)]

    u, i = r.updates, k - 1
    prior = Gaussian(u.prior.mean[i], u.prior.cov[i])
    correction = prior.mean[:2] + (u.gain[i] @ u.innovation[i])[:2]
    items.append(LevelEllipse("prior", prior, role="prior", filled=stage == PREDICT))
    if stage == PREDICT:
        items += [LevelEllipse("previous", _posterior(r, k - 1), role="posterior", dashed=True, width=2),
                  Arrow("motion", estimates[-1], prior.mean[:2], role="prior", width=3)]
    if stage >= INNOVATION:
        items += [LevelEllipse("expected_measurement", Gaussian(u.y_hat[i], u.innovation_cov[i]), role="innovation",
                               dashed=True, width=2, cross=False),
                  Arrow("innovation", u.y_hat[i], r.y[i], role="innovation", width=4),
                  Points("measurement_now", r.y[[i]], role="measurement", size=13),
                  Label("y_label", "y", _beside(r, r.y[i], r.y[i] - u.y_hat[i]))]
    if stage >= GAIN:
        items.append(Arrow("correction", prior.mean[:2], correction, role="vector", width=5))
    if stage == UPDATE:
        items.append(LevelEllipse("posterior", _posterior(r, k), role="posterior", filled=True))
    return items


def _beside(r: "Result", at: Array, direction: Array) -> Array:
    """A place for a label a little further along `direction`."""
    shift = 0.03 * np.ptp(_extent(r), axis=0).max()
    return at + shift * direction / max(float(np.linalg.norm(direction)), 1e-9)


def _extent(r: "Result") -> Array:
    """The corners of what must be visible: track, measurements, estimates.  (2, 2)"""
    everything = np.vstack([r.truth[:, :2], r.y, _estimates(r)[:, :2]])
    return np.array([everything.min(axis=0), everything.max(axis=0)])


def _camera(r: "Result") -> Plane:
    low, high = _extent(r)
    margin = 0.06 * (high - low).max()
    (x0, y0), (x1, y1) = low - margin, high + margin
    return Plane((float(x0), float(x1)), (float(y0), float(y1)))


def _equations(r: "Result", at: Moment) -> list[Equation]:
    """Algorithm 3 with this step's numbers; the rules of later stages stand there without them."""
    k, u, i = at.step, r.updates, at.step - 1
    if k == 0:
        return [Equation("start", (r"\hat{\mathbf{x}}_0 =", r.initial.mean, r",\quad P_{0,1:2} =",
                                   r.initial.cov[:2, :2]), current=True)]
    before, after = _posterior(r, k - 1), _posterior(r, k)
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("predict_mean", PREDICT, r"\hat{\mathbf{x}}_k^- = \Phi\hat{\mathbf{x}}_{k-1}",
         (r"= \Phi", before.mean, "=", u.prior.mean[i])),
        ("predict_cov", PREDICT, r"P_k^- = \Phi P_{k-1}\Phi^T + Q", (r",\quad P_{k,1:2}^- =", u.prior.cov[i, :2, :2])),
        ("innovation", INNOVATION, r"\nu_k = \mathbf{y}_k - H\hat{\mathbf{x}}_k^-",
         ("=", r.y[i], "-", u.y_hat[i], "=", u.innovation[i])),
        ("innovation_cov", INNOVATION, r"S_k = HP_k^-H^T + R", ("=", u.innovation_cov[i])),
        ("gain", GAIN, r"K_k = P_k^-H^TS_k^{-1}", ("=", u.gain[i])),
        ("update_mean", UPDATE, r"\hat{\mathbf{x}}_k = \hat{\mathbf{x}}_k^- + K_k\nu_k", ("=", after.mean)),
        ("update_cov", UPDATE, r"P_k = (I - K_kH)P_k^-", (r",\quad P_{k,1:2} =", after.cov[:2, :2])),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _readouts(r: "Result", k: int) -> list[Readout]:
    errors = np.square(r.updates.posterior.mean[:, :2] - r.truth[1:, :2]).sum(axis=1)
    raw = np.square(r.y - r.truth[1:, :2]).sum(axis=1)
    low, high = r.nees_band
    return [
        Readout("rmse_filter", float(np.sqrt(errors.mean())), "m", 3),
        Readout("rmse_raw", float(np.sqrt(raw.mean())), "m", 3),
        Readout("nis", float(r.nis[k - 1]) if k else None, digits=3),
        Readout("mean_nees", float(r.mean_nees[k - 1]) if k else None, digits=3),
        Readout("nees_band", f"{low:.2f} … {high:.2f}"),
    ]


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """Error, innovation, gain and variance of the chosen coordinate."""
    axis = ("x", "y").index(p.axis)
    u = r.updates
    t = np.arange(len(r.truth)) * p.dt_s
    later, now, whole = t[1:], k * p.dt_s, np.array([0.0, t[-1]])
    error = _estimates(r)[:, axis] - r.truth[:, axis]
    after = np.concatenate([r.initial.cov[None, axis, axis], u.posterior.cov[:, axis, axis]])
    before = u.prior.cov[:, axis, axis]
    sigma, spread = np.sqrt(after), np.sqrt(u.innovation_cov[:, axis, axis])
    steady_gain = r.steady.gain[[axis, axis + 2], axis]
    steady_variance = r.steady.posterior.cov[axis, axis]
    return {
        "error": fig.chart(
            fig.band("band", t, -2 * sigma, 2 * sigma, "posterior"),
            fig.markers("raw", later, r.y[:, axis] - r.truth[1:, axis], "measurement", size=5),
            fig.line("error", t, error, "kf"), cursor=now),
        "innovation": fig.chart(
            fig.band("band", later, -2 * spread, 2 * spread, "innovation"),
            fig.line("innovation", later, u.innovation[:, axis], "innovation", markers=True, width=1.5), cursor=now),
        "gain": fig.chart(
            fig.line("position", later, u.gain[:, axis, axis], "kf"),
            fig.line("steady_position", whole, np.full(2, steady_gain[0]), "reference", dash=True),
            fig.line("velocity", later, u.gain[:, axis + 2, axis], "vector"),
            fig.line("steady_velocity", whole, np.full(2, steady_gain[1]), "muted", dash=True), cursor=now),
        "variance": fig.chart(
            # Each step is a tooth: prediction raises the variance, the measurement lowers it.
            fig.line("teeth", np.append(0.0, np.repeat(later, 2)),
                     np.append(after[0], np.column_stack([before, after[1:]]).ravel()), "muted", width=1),
            fig.markers("prior", later, before, "prior", size=5),
            fig.markers("posterior", t, after, "posterior", size=5),
            fig.line("steady", whole, np.full(2, steady_variance), "reference", dash=True), cursor=now),
    }
