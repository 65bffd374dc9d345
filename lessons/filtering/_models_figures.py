"""Plots, readouts and formulas of the lesson on multiple models."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.filtering._models_roles import NAMES, ROLES
from lessons.filtering._models_world import CHANGES, DRIVE, NOISES, Result
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

MIX, PREDICT, UPDATE, PROBABILITIES, COMBINE = range(5)
LEAST_M = 0.1                             # less is drawn there, on a logarithmic axis


def figures(r: Result, k: int) -> dict[str, "go.Figure"]:
    """Probabilities of the models, errors, speed, and one straight model with any noise."""
    t = np.arange(float(len(r.truth)))
    ends = NOISES[[0, -1]]
    return {
        "probabilities": fig.chart(
            *(fig.line(name, t, 100.0 * r.probabilities[:, j], ROLES[j], width=3) for j, name in enumerate(NAMES)),
            marks=CHANGES, cursor=k, y_range=(-3.0, 103.0)),
        "error": fig.chart(
            *(fig.line(name, t, np.maximum(r.errors[name], LEAST_M), role, width=1.8)
              for name, role in zip(NAMES, ROLES, strict=True)),
            fig.line("imm", t, np.maximum(r.errors["imm"], LEAST_M), "mixture", width=3.5),
            marks=CHANGES, cursor=k, log_y=True),
        "speed": fig.chart(
            fig.line("truth", t, _speed(r.truth), "truth", dash=True, width=1.8),
            fig.line("drive", t, _speed(r.alone[DRIVE].mean), ROLES[DRIVE], width=1.8),
            fig.line("imm", t, _speed(r.combined.mean), "mixture", width=3), marks=CHANGES, cursor=k),
        "noise": fig.chart(
            fig.line("drive", NOISES, r.noise_rmse, ROLES[DRIVE], markers=True),
            fig.line("imm", ends, np.full(2, r.imm_rmse), "mixture", dash=True, width=3), log_x=True,
            y_range=(0.0, 1.1 * float(r.noise_rmse.max()))),
    }


def _speed(states: Array) -> Array:
    return np.linalg.norm(states[:, 2:], axis=1)


def readouts(r: Result, k: int) -> list[Readout]:
    """The models now, and errors over the whole track."""
    best = r.probabilities.argmax(axis=1)
    true = int(r.model[k])
    since = k - max((c for c in CHANGES if c < k), default=0)
    return [
        Readout("true_model", f"{NAMES[true]}, for {since} s"),
        Readout("true_probability", 100.0 * float(r.probabilities[k, true]), "%", 3),
        Readout("error", float(r.errors["imm"][k]), "m", 3),
        *(Readout(f"{name}_rmse", float(np.sqrt(np.square(r.errors[name][1:]).mean())), "m", 3)
          for name in ("imm", *NAMES)),
        Readout("right", 100.0 * float((best[1:] == r.model[1:]).mean()), "%", 3),
    ]


def equations(r: Result, at: Moment) -> list[Equation]:
    """One second; vectors of three are stand, drive, turn, and j is the model that is the likeliest afterwards."""
    if at.step == 0:
        return [Equation("start", (r"\mu_j =", r.initial.weights), current=True)]
    i = at.step - 1
    u = r.imm.update
    j = int(r.imm.probabilities[i].argmax())
    mixed, posterior, after = r.imm.mixed, r.imm.posterior, r.imm.probabilities[i]
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("predicted", MIX, r"c = \Pi^T\mu",
         ("=", r.transition.T, r.imm.before.weights[i], "=", mixed.weights[i])),
        ("mixing", MIX, r"\mu_{i|j} = \mu_i\Pi_{ij} / c_j", ("=", r.imm.mixing[i])),
        ("start_j", MIX, r"\hat{\mathbf{x}}_{0j} = \sum_i \mu_{i|j}\,\hat{\mathbf{x}}_i", ("=", mixed.means[i, j])),
        ("predict", PREDICT, r"\hat{\mathbf{x}}_j^- = \Phi_j\hat{\mathbf{x}}_{0j}", ("=", u.prior.means[i, j])),
        ("innovation", UPDATE, r"\nu_j = \mathbf{y} - H\hat{\mathbf{x}}_j^-",
         ("=", r.y[i], "-", u.step.y_hat[i, j], "=", u.step.innovation[i, j])),
        ("update", UPDATE, r"\hat{\mathbf{x}}_j = \hat{\mathbf{x}}_j^- + K_j\nu_j", ("=", posterior.means[i, j])),
        ("evidence", PROBABILITIES, r"\Lambda_j = N(\nu_j; 0, S_j)", ("=", np.exp(u.log_evidences[i]))),
        ("probability", PROBABILITIES, r"\mu_j = c_j\Lambda_j \,/\, \sum_i c_i\Lambda_i", ("=", after)),
        ("combine", COMBINE, r"\hat{\mathbf{x}} = \sum_j \mu_j\hat{\mathbf{x}}_j", ("=", r.combined.mean[at.step])),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]
