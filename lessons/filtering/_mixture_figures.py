"""Plots, readouts and formulas of the mixture filter on Example 22."""

from typing import TYPE_CHECKING

import numpy as np

from core.mixture import Mixture, MixtureStep
from core.types import Array
from lessons.filtering._mixture_drawing import shown
from lessons.filtering._mixture_model import EDGES, Track, side
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout

if TYPE_CHECKING:
    import plotly.graph_objects as go

PREDICT, SPLIT, UPDATE, REWEIGHT, REDUCE, ESTIMATE = range(6)
FINE = np.linspace(EDGES[0], EDGES[-1], 321)


def figures(r: Track, at: Moment) -> dict[str, "go.Figure"]:
    """The density of x2, weights as bars, the probability of the upper side, the standard deviation of x2."""
    k = at.step
    t = np.arange(float(len(r.truth)))
    return {
        "density": _density(r, k),
        "weights": _weights(r, at),
        "side": fig.chart(
            fig.line("pf", t, 100.0 * r.share_pf, "pf", width=5), fig.line("ekf", t, 100.0 * r.share_ekf, "ekf"),
            fig.line("mixture", t, 100.0 * r.share, "mixture"),
            fig.line("truth", t, np.where(r.truth[:, 1] > 0.0, 100.0, 0.0), "truth", dash=True, width=1.5),
            y_range=(-4.0, 104.0), cursor=k),
        "spread": fig.chart(*(fig.line(name, t, np.sqrt(law.cov[:, 1, 1]), name, width=5 if name == "pf" else 2.5)
                              for name, law in (("pf", r.pf), ("ekf", r.ekf), ("mixture", r.law))), cursor=k),
    }


def _weights(r: Track, at: Moment) -> "go.Figure":
    """One bar for each component of this stage, from low to high x2; in the middle of the step before and after."""
    if at.step == 0:
        return _bars(r.initial, "mixture")
    s = r.steps[at.step - 1]
    if at.stage == PREDICT:
        return _bars(s.predicted, "prior")
    if at.stage in (SPLIT, UPDATE):
        return _bars(s.division.after, "prior")
    if at.stage >= REDUCE:
        return _bars(s.posterior, "mixture")
    weighed = s.update.posterior
    chosen = shown(weighed)
    n = np.arange(1.0, len(chosen) + 1.0)
    return fig.chart(fig.bars("prior", n - 0.2, 100.0 * s.update.prior.weights[chosen], "prior", width=0.38),
                     fig.bars("mixture", n + 0.2, 100.0 * weighed.weights[chosen], "mixture", width=0.38),
                     x_range=(0.4, len(n) + 0.6))


def _bars(m: Mixture, role: str) -> "go.Figure":
    w = 100.0 * m.weights[shown(m)]
    n = np.arange(1.0, len(w) + 1.0)
    return fig.chart(fig.bars(role, n, w, role, width=0.7), x_range=(0.4, len(n) + 0.6))


def _density(r: Track, k: int) -> "go.Figure":
    """The law of x2 alone: a histogram of the particles, the mixture, the EKF."""
    m = r.posterior(k)
    mixed = m.weights @ _bells(m.means[:, 1], m.covs[:, 1, 1])
    ekf = _bells(r.ekf.mean[[k], 1], r.ekf.cov[[k], 1, 1])[0]
    top = 1.15 * max(float(mixed.max()), float(r.histogram[k].max()))
    return fig.chart(
        fig.bars("pf", (EDGES[1:] + EDGES[:-1]) / 2, r.histogram[k], "pf", width=EDGES[1] - EDGES[0]),
        fig.line("ekf", FINE, ekf, "ekf"), fig.line("mixture", FINE, mixed, "mixture", width=3.5),
        marks=[float(r.truth[k, 1])], y_range=(0.0, max(top, min(1.05 * float(ekf.max()), 2.5 * top))))


def _bells(mean: Array, variance: Array) -> Array:
    """N(FINE; mean, variance), one row for each."""
    v = np.maximum(variance, 1e-9)[:, None]
    return np.exp(-0.5 * np.square(FINE - mean[:, None]) / v) / np.sqrt(2.0 * np.pi * v)


def readouts(r: Track, k: int) -> list[Readout]:
    """Errors, the two sides, how far the means of mixture and cloud are apart, and the number of components."""
    m = r.posterior(k)
    half = side(m, bool(r.truth[k, 1] > 0.0))
    counts = str(len(m.means))
    if k:
        s = r.steps[k - 1]
        counts = " → ".join(str(len(x.means)) for x in (s.predicted, s.division.after, s.pruned.after, s.posterior))
    return [
        Readout("ekf_error", _distance(r.ekf.mean[k], r.truth[k]), "m", 3),
        Readout("side_error", None if half is None else _distance(half[1].mean, r.truth[k]), "m", 3),
        Readout("mean_error", _distance(r.law.mean[k], r.truth[k]), "m", 3),
        Readout("share", 100.0 * float(r.share[k]), "%", 3),
        Readout("share_pf", 100.0 * float(r.share_pf[k]), "%", 3),
        Readout("apart", _distance(r.law.mean[k], r.pf.mean[k]), "m", 3),
        Readout("counts", counts),
    ]


def _distance(x: Array, y: Array) -> float:
    return float(np.linalg.norm(x[:2] - y[:2]))


def equations(r: Track, at: Moment) -> list[Equation]:
    """The step with the numbers of the component i that is the heaviest in the end, and of its ancestors."""
    if at.step == 0:
        start = (r"\mathbf{x}_0 \sim N(\mu, P),\quad \mu =", r.law.mean[0])
        return [Equation("start", start, current=True)]
    s = r.steps[at.step - 1]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in _lines(r, s, at.step)]


def _lines(r: Track, s: MixtureStep, k: int) -> list[tuple[str, int, str, tuple[Piece, ...]]]:
    weighed, u = s.update.posterior, s.update
    i = int(weighed.log_weights.argmax())
    a = int(s.division.parent[i])
    parent, part = float(s.predicted.weights[a]), float(s.division.after.weights[i])
    return [
        ("predict", PREDICT, r"\mu^- = \Phi\mu,\quad P^- = \Phi P\Phi^T + Q",
         (r",\quad \mu^- =", s.predicted.means[a])),
        ("split", SPLIT, r"w_i^- = v_i\, w^-", ("=", part / parent, r"\cdot", parent, "=", part)),
        ("part", SPLIT, r"\mu_i^- = \mu^- + \sqrt{1 - \rho^2}\,s z_i\,q", ("=", s.division.after.means[i])),
        ("innovation", UPDATE, r"\nu_i = y - h(\mu_i^-)", ("=", r.y[k - 1], "-", u.step.y_hat[i], "=",
                                                           u.step.innovation[i])),
        ("update", UPDATE, r"\mu_i = \mu_i^- + K_i\nu_i", ("=", weighed.means[i])),
        ("evidence", REWEIGHT, r"N(\nu_i; 0, S_i)", ("=", float(np.exp(u.log_evidences[i])), r"\;1/\mathrm{m}^2")),
        ("reweight", REWEIGHT, r"w_i = w_i^- N(\nu_i; 0, S_i) \,/\, \sum_j w_j^- N(\nu_j; 0, S_j)",
         ("=", float(weighed.weights[i]))),
        ("prune", REDUCE, r"w_j < 10^{-4}\ \mathrm{or\ too\ many:\ dropped}",
         (r",\quad \mathrm{weight\ lost} =", float(s.pruned.lost))),
        ("merge", REDUCE, r"P = \sum_j \frac{w_j}{w}\left(P_j + (\mu_j - \mu)(\mu_j - \mu)^T\right)",
         (r",\quad \mathrm{lost} =", float(s.merged.lost), r"\mathrm{nat}")),
        ("estimate", ESTIMATE, r"\hat{\mathbf{x}} = \sum_i w_i\mu_i", ("=", r.law.mean[k])),
        ("side", ESTIMATE, r"P(x_2 > 0) = \sum_i w_i\,P(x_2 > 0 \mid i)", ("=", float(r.share[k]))),
    ]
