"""The numbers of one step of both filters, and five plots after Figures 4.2-4.4."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.bayes_kalman._random_walk_scene import GAIN, PREDICT, ROLES, UPDATE, camera, scene
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.bayes_kalman.random_walk import Params, Result


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Both filters up to this step; the step itself up to this stage."""
    return View(
        scene=scene(r, at), camera=camera(r), figures=_figures(p, r, at.step), readouts=_readouts(r),
        equations=_equations(r, at), caption=f"k = {at.step} of {len(r.stiff.errors)}", note=_note(p),
    )


def _note(p: "Params") -> str:
    """What does not fit together in this setting."""
    said = []
    if (p.R_x_m, p.R_y_m) != (p.noise_x_m, p.noise_y_m):
        said.append(f"Noise drawn with σ = ({p.noise_x_m:g}, {p.noise_y_m:g}) m, assumed ({p.R_x_m:g}, {p.R_y_m:g}) m "
                    "(K9).")
    if p.start_twice:
        said.append("First sample used twice (K10).")
    return " ".join(said)


def _equations(r: "Result", at: Moment) -> list[Equation]:
    """Algorithm 1 for both filters; their positions only, the gain's and covariance's rows for x and y."""
    k, i = at.step, at.step - 1
    pair = (("stiff", r.stiff), ("flexible", r.flexible))
    if k == 0:
        return [Equation(f"start_{name}", (r"\hat{\mathbf{x}}_0 = [\mathbf{p};\,\mathbf{v}],\quad \mathbf{p} =",
                                           t.start.mean[:2], r",\quad \mathbf{v} =", t.start.mean[3:5]), current=True)
                for name, t in pair]
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = []
    for name, t in pair:
        lines.append((f"predict_{name}", PREDICT, r"\hat{\mathbf{x}}_k^- = A\hat{\mathbf{x}}_{k-1},\quad \mathbf{p}^-",
                      ("=", t.steps.prior.mean[i, :2], r",\quad \sqrt{P_{ii}^-} =",
                       np.sqrt(t.steps.prior.cov[i, [0, 1], [0, 1]]))))
    for name, t in pair:
        lines.append((f"gain_{name}", GAIN, r"K_k = P_k^-H^TS_k^{-1},\; K_{ii}",
                      ("=", t.steps.gain[i, [0, 1], [0, 1]], r",\; \tilde{\mathbf{y}}_k =", t.steps.innovation[i])))
    for name, t in pair:
        lines.append((f"update_{name}", UPDATE, r"\hat{\mathbf{x}}_k = \hat{\mathbf{x}}_k^- + K_k\tilde{\mathbf{y}}_k,"
                      r"\quad \mathbf{p}", ("=", t.steps.posterior.mean[i, :2], r",\quad \sqrt{P_{ii}} =",
                                            np.sqrt(t.steps.posterior.cov[i, [0, 1], [0, 1]]))))
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _readouts(r: "Result") -> list[Readout]:
    return [
        Readout("rmse_stiff", r.stiff.rmse, "m", 3),
        Readout("rmse_flexible", r.flexible.rmse, "m", 3),
        Readout("mean_stiff", _with_axes(r.stiff.mean_rmse), "m"),
        Readout("mean_flexible", _with_axes(r.flexible.mean_rmse), "m"),
        Readout("mean_raw", _with_axes(r.raw_rmse), "m"),
        Readout("world_sigma", r.world_sigma, "m/s/√s", 3),
    ]


def _with_axes(values: Array) -> str:
    return f"{values[0]:.2f} ({values[1]:.2f}, {values[2]:.2f})"


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """Figures 4.2, 4.3 and 4.4 for the chosen coordinate, and two that average over the walks."""
    from lessons.bayes_kalman.random_walk import SIGMAS, TURNS_DEG

    axis = ("x", "y").index(p.axis)
    steps = np.arange(1, len(r.stiff.errors) + 1)
    whole = np.array([0.0, steps[-1]])
    pair = (("stiff", r.stiff), ("flexible", r.flexible))
    errors = [fig.line(name, steps, np.abs(t.errors[:, axis]), ROLES[name]) for name, t in pair]
    gains, sds = [], []
    for name, t in pair:
        gains += [fig.line(name, steps, t.steps.gain[:, axis, axis], ROLES[name]),
                  fig.line(f"{name}_steady", whole, np.full(2, t.steady_gain[axis]), ROLES[name], dash=True, width=1.2)]
        sds += [fig.line(name, steps, np.sqrt(t.steps.posterior.cov[:, axis, axis]), ROLES[name]),
                fig.line(f"{name}_real", steps, t.spread[:, axis], ROLES[name], dash=True, width=1.5)]
    turns = (TURNS_DEG[1:] + TURNS_DEG[:-1]) / 2
    known = np.isfinite(r.stiff.by_turn)
    seen = (SIGMAS[0] * 0.8, SIGMAS[-1] * 1.25)
    marks = [r.world_sigma] if seen[0] < r.world_sigma < seen[1] else []
    chosen = [fig.markers(name, [t.setting.sigma_xy], [t.mean_rmse[0]], ROLES[name], size=13, symbol="diamond")
              for name, t in pair]
    return {
        "error": fig.chart(*errors, cursor=k),
        "gain": fig.chart(*gains, cursor=k, y_range=(0.0, 1.02)),
        "sd": fig.chart(*sds, cursor=k),
        "sigma": fig.chart(
            fig.line("position", SIGMAS, r.curve[:, 0], "reference", width=3),
            fig.line("x", SIGMAS, r.curve[:, 1], "axis_x", width=1.5),
            fig.line("y", SIGMAS, r.curve[:, 2], "axis_y", width=1.5), *chosen, log_x=True, log_y=True, marks=marks,
            x_range=seen),
        "turns": fig.chart(*(fig.line(name, turns[known], t.by_turn[known], ROLES[name], markers=True)
                             for name, t in pair)),
    }
