"""How the constant-velocity model is drawn: paths, a cloud, the fan of ellipses, and what Q does to one axis."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import chi_square_level, ellipse
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Item, Label, LevelEllipse, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.constant_velocity import Params, Result

MOVE, NOISE = range(2)
PROBABILITY = 0.68
RADIUS = float(np.sqrt(chi_square_level(PROBABILITY, 2)))    # half-axes of the ellipses in standard deviations
FAN = 8                                                      # ellipses that are drawn at most, besides the present one
EVERY = 8                                                    # fine steps between two drawn points of a path
AXIS = np.ix_([0, 2], [0, 2])                                # (x, velocity of x) in the four-dimensional state
LENGTHS = np.array([0.1, 100.0])                             # s, step lengths of the plot of Q
RIVAL_Q = {
    "euler": r"Q_E = \Delta t\,GQ_cG^T =",
    "acceleration": r"Q_A = \Delta t\,WQ_cW^T,\ W = \left[\matrix{\Delta t/2 \cr 1}\right] :",
}


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Paths up to this moment, ellipses up to this step and stage."""
    return View(
        scene=_scene(p, r, at), camera=_camera(r), figures=_figures(p, r, at), readouts=_readouts(p, r, at.step),
        equations=_equations(p, r, at),
        caption=f"t = {at.step * _dt(p, r):.4g} s, Δt = {_dt(p, r):.4g} s",
    )


def _dt(p: "Params", r: "Result") -> float:
    return p.horizon_s / (len(r.cloud) - 1)


def _law(laws: Gaussian, k: int) -> Gaussian:
    return Gaussian(laws.mean[k], laws.cov[k])


def _scene(p: "Params", r: "Result", at: Moment) -> list[Item]:
    k, K = at.step, len(r.cloud) - 1
    done = k if at.stage == NOISE or k == 0 else k - 1        # up to here the noise has acted
    fine = done * ((len(r.t) - 1) // K)
    shown = r.paths[np.unique(np.append(np.arange(0, fine, EVERY), fine)), :, :2]
    items: list[Item] = []
    if fine:
        items.append(Segments("paths", np.stack([shown[:-1, 1:], shown[1:, 1:]], axis=2).reshape(-1, 2, 2),
                              role="monte_carlo", width=1.5, fade=0.2))
    cloud = r.cloud[done, :, :2] if done == k else r.cloud[done, :, :2] + _dt(p, r) * r.cloud[done, :, 2:]
    items.append(Points("cloud", cloud, role="monte_carlo", size=4.5))
    every = max(1, K // FAN)
    for j in range(every, done + (done < k), every):
        items.append(LevelEllipse(f"fan_{j}", _law(r.laws, j), role="prior", width=2.5, cross=False))
    if fine:
        items += [Polyline("one_path", shown[:, 0], role="truth", width=4),
                  Polyline("rival_path", r.rival_path[:done + 1], role="linearised", width=3),
                  Points("rival_points", r.rival_path[:done + 1], role="linearised", size=9, shape="square")]
    if k and at.stage == MOVE:
        items += [Arrow("motion", r.laws.mean[k - 1, :2], r.laws.mean[k, :2], role="vector", width=3),
                  LevelEllipse("moved", _law(r.moved, k - 1), role="vector", width=3, dashed=True)]
    else:
        items += [LevelEllipse("law", _law(r.laws, k), role="posterior", width=4, filled=True),
                  LevelEllipse("rival", _law(r.rival_laws, k), role="linearised", width=3.5, dashed=True)]
    return [*items, *_times(p, r, range(every, done + 1, every))]


def _times(p: "Params", r: "Result", steps: range) -> list[Label]:
    """The time over each ellipse, the last one first, where there is room for it."""
    found: list[Label] = []
    for j in reversed(steps):
        top = r.laws.mean[j, :2] + [0.0, RADIUS * np.sqrt(r.laws.cov[j, 1, 1]) + 0.012 * _height(r)]
        if all(np.abs(np.subtract(top, other.position)).max() > 0.07 * _height(r) for other in found):
            found.append(Label(f"time_{j}", f"{j * _dt(p, r):.4g} s", top, anchor="bottom"))
    return found


def _height(r: "Result") -> float:
    camera = _camera(r)
    return camera.y[1] - camera.y[0]


def _camera(r: "Result") -> Plane:
    """The first and the last ellipse that hold 95 % of the paths, and the start."""
    reach = 2.45 * np.sqrt(r.laws.cov[[0, -1], 0, 0])[:, None]
    low = np.vstack([r.laws.mean[[0, -1], :2] - reach, r.rival_path]).min(axis=0)
    high = np.vstack([r.laws.mean[[0, -1], :2] + reach, r.rival_path]).max(axis=0)
    margin = 0.04 * max(float((high - low).max()), 1e-3)
    (x0, y0), (x1, y1) = low - margin, high + margin
    return Plane((float(x0), float(x1)), (float(y0), float(y1)))


def _readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    exact, rival = np.sqrt(r.laws.cov[k, 0, 0]), np.sqrt(r.rival_laws.cov[k, 0, 0])
    return [
        Readout("sigma_x", float(exact), "m"),
        Readout("sigma_x_rival", float(rival), "m"),
        Readout("sigma_v", float(np.sqrt(r.laws.cov[k, 2, 2])), "m/s"),
        Readout("inside", 100.0 * float(r.inside[k]) if k else None, "%", 3),
        Readout("inside_rival", 100.0 * float(r.rival_inside[k]) if k else None, "%", 3),
    ]


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """One step of the prediction; the covariances are those of one axis, rows and columns (x, velocity of x)."""
    k = at.step
    if k == 0:
        return [Equation("start", (r"\hat{\mathbf{x}}_0 =", r.laws.mean[0], r",\quad P_0 =", r.laws.cov[0][AXIS]),
                         current=True)]
    Phi, Q = r.half.Phi[AXIS], r.half.Q[AXIS]
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("mean", MOVE, r"\hat{\mathbf{x}}_k = \Phi\hat{\mathbf{x}}_{k-1}", ("=", r.laws.mean[k])),
        ("moved", MOVE, r"\Phi P_{k-1}\Phi^T", ("=", r.moved.cov[k - 1][AXIS])),
        ("noise", NOISE, r"Q = \sigma_c^2\left[\matrix{\Delta t^3/3 & \Delta t^2/2 \cr \Delta t^2/2 & \Delta t}\right]",
         ("=", r.motion.Q[AXIS])),
        ("law", NOISE, r"P_k = \Phi P_{k-1}\Phi^T + Q", ("=", r.laws.cov[k][AXIS])),
        ("halves", NOISE, r"\Phi_{\Delta t/2}Q_{\Delta t/2}\Phi_{\Delta t/2}^T + Q_{\Delta t/2}",
         ("=", Phi @ Q @ Phi.T + Q)),
        ("rival", NOISE, RIVAL_Q[p.scheme], (r.rival.Q[AXIS],)),
        ("rival_law", NOISE, r"P_k =", (r.rival_laws.cov[k][AXIS],)),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _figures(p: "Params", r: "Result", at: Moment) -> dict[str, "go.Figure"]:
    """Velocity over time, spread over time, Q over the step length, and the law of (x, velocity of x)."""
    K = len(r.cloud) - 1
    now, moments = at.step * _dt(p, r), r.t[::(len(r.t) - 1) // K]
    band = 2 * np.sqrt(p.start_sigma_mps**2 + p.sigma_c**2 * r.t)
    variance = p.sigma_c**2
    return {
        "velocity": fig.chart(
            fig.band("band", r.t, p.speed_mps - band, p.speed_mps + band, "prior"),
            fig.line("second", r.t, r.paths[:, 1, 2], "monte_carlo", width=1.5),
            fig.line("third", r.t, r.paths[:, 2, 2], "muted", width=1.5),
            fig.line("one", r.t, r.paths[:, 0, 2], "truth", width=2), cursor=now),
        "spread": fig.chart(
            fig.line("exact", r.t, r.curve, "posterior"),
            fig.line("rival", moments, np.sqrt(r.rival_laws.cov[:, 0, 0]), "linearised", dash=True, markers=True),
            fig.markers("sample", moments, r.spread, "monte_carlo", size=8), cursor=now),
        "blocks": fig.chart(
            fig.line("position", LENGTHS, variance * LENGTHS**3 / 3, "posterior"),
            fig.line("cross", LENGTHS, variance * LENGTHS**2 / 2, "vector", dash=True),
            fig.line("velocity", LENGTHS, variance * LENGTHS, "likelihood"),
            cursor=_dt(p, r), log_x=True, log_y=True, x_range=(0.1, 100.0), y_range=(1e-5, 1e6)),
        "phase": _phase(r, at),
    }


def _phase(r: "Result", at: Moment) -> "go.Figure":
    """Phi shears the ellipse of (x, velocity of x), Q widens it."""
    k = at.step
    reach_x, reach_v = 1.15 * RADIUS * np.sqrt(np.diagonal(r.laws.cov[-1])[[0, 2]])

    def rim(key: str, cov: Array, role: str, dash: bool = False) -> "go.Scatter":
        points = ellipse(Gaussian(np.zeros(2), cov[AXIS]), RADIUS**2)
        return fig.line(key, points[:, 0], points[:, 1], role, dash=dash)

    traces = []
    if k:
        traces += [rim("previous", r.laws.cov[k - 1], "prior"), rim("moved", r.moved.cov[k - 1], "vector", True)]
    if k == 0 or at.stage == NOISE:
        traces += [rim("law", r.laws.cov[k], "posterior"), rim("rival", r.rival_laws.cov[k], "linearised", True)]
    return fig.chart(*traces, x_range=(-reach_x, reach_x), y_range=(-reach_v, reach_v))
