"""How the test of the innovation is drawn: the gate as an ellipse, what is rejected, and the statistics."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import chi_square_level
from core.metrics import consistency_band
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Arrow, Item, Label, LevelEllipse, Plane, Points, Polyline

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.innovation import Filtered, Params, Result

PREDICT, INNOVATION, TEST, UPDATE = range(4)
LAGS = 12
FLOOR = 0.01                                             # a smaller NIS is drawn here, on a logarithmic axis


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this step, and of this step everything up to this stage."""
    camera = _camera(p, r)
    return View(
        scene=_scene(p, r, at, camera), camera=camera, figures=_figures(p, r, at.step), readouts=_readouts(r),
        equations=_equations(p, r, at), caption=_caption(r, at), note=_note(r, at.step, camera),
    )


def _caption(r: "Result", at: Moment) -> str:
    text = f"t = {at.step} s"
    if at.step == 0 or at.stage < TEST:
        return text
    i = at.step - 1
    verdict = "" if r.used.accepted[i] else ": rejected"
    sign = "≤" if r.used.nis[i] <= r.level else ">"
    return f"{text}, NIS {r.used.nis[i]:.3g} {sign} {r.level:.3g}{verdict}"


def _note(r: "Result", k: int, camera: Plane) -> str:
    (x0, x1), (y0, y1) = camera.x, camera.y
    y = r.y[:k]
    outside = int(((y[:, 0] < x0) | (y[:, 0] > x1) | (y[:, 1] < y0) | (y[:, 1] > y1)).sum())
    return f"{outside} of the {k} measurements so far lie outside the picture." if outside else ""


def _estimates(r: "Result", f: "Filtered") -> Array:
    """Posterior means (STEPS + 1, 2) of the position, the start included."""
    return np.vstack([r.initial.mean[:2], f.step.posterior.mean[:, :2]])


def _scene(p: "Params", r: "Result", at: Moment, camera: Plane) -> list[Item]:
    k, stage = at.step, at.stage
    done = k if stage == UPDATE or k == 0 else k - 1         # the last step whose estimate is known
    seen = k if stage >= INNOVATION else max(k - 1, 0)       # the last measurement that has come in
    judged = k if stage >= TEST else max(k - 1, 0)
    garbage, rejected = r.garbage[:seen], ~r.used.accepted[:judged]
    items: list[Item] = [Polyline("truth", r.truth[:, :2], role="truth", dashed=True, width=2.5),
                         Points("truth_now", r.truth[[k], :2], role="truth", size=11, shape="diamond")]
    if rejected.any():
        items.append(Points("rejected", r.y[:judged][rejected], role="innovation", size=19, shape="square", fade=0.55))
    if seen and (~garbage).any():
        items.append(Points("measurements", r.y[:seen][~garbage], role="measurement", size=8))
    if garbage.any():
        items.append(Points("garbage", r.y[:seen][garbage], role="measurement", size=13, shape="diamond"))
    if done:
        if p.treatment != "plain":
            items.append(Polyline("plain", _estimates(r, r.plain)[:done + 1], role="vector", width=2.5))
        items.append(Polyline("estimate", _estimates(r, r.used)[:done + 1], role="kf", width=4))
    if k == 0:
        return [*items, LevelEllipse("posterior", r.initial, role="posterior", filled=True)]

    u, i = r.used.step, k - 1
    expected = Gaussian(u.y_hat[i], u.innovation_cov[i])
    items += [LevelEllipse("prior", Gaussian(u.prior.mean[i], u.prior.cov[i]), role="prior", filled=stage == PREDICT),
              LevelEllipse("gate", expected, role="innovation", probability=p.gate_percent / 100.0, width=3.5,
                           dashed=True, cross=False)]
    if stage >= INNOVATION:
        out = stage >= TEST and not r.used.accepted[i]
        items.append(Arrow("innovation", u.y_hat[i], r.y[i], role="warning" if out else "innovation", width=4))
    if stage >= TEST:
        items.append(Label("nis", f"NIS {r.used.nis[i]:.3g}", _beside(camera, r.y[i], r.y[i] - u.y_hat[i])))
    if stage == UPDATE:
        items.append(LevelEllipse("posterior", Gaussian(u.posterior.mean[i], u.posterior.cov[i]), role="posterior",
                                  filled=True))
    return items


def _beside(camera: Plane, at: Array, direction: Array) -> Array:
    """A place for a label a little further along `direction`."""
    shift = 0.045 * max(camera.x[1] - camera.x[0], camera.y[1] - camera.y[0])
    return at + shift * direction / max(float(np.linalg.norm(direction)), 1e-9)


def _camera(p: "Params", r: "Result") -> Plane:
    """The true track, both estimates, the good measurements and the user's garbage; other garbage if it is near."""
    parts = [r.truth[:, :2], r.y[~r.garbage], _estimates(r, r.used), _estimates(r, r.plain)]
    if p.garbage_step:
        parts.append(np.array([p.garbage]))
    low, high = np.vstack(parts).min(axis=0), np.vstack(parts).max(axis=0)
    reach = 0.25 * float((high - low).max())
    near = r.y[((r.y > low - reach) & (r.y < high + reach)).all(axis=1)]
    low, high = np.vstack([low, near]).min(axis=0), np.vstack([high, near]).max(axis=0)
    margin = 0.1 * float((high - low).max())
    (x0, y0), (x1, y1) = low - margin, high + margin
    return Plane((float(x0), float(x1)), (float(y0), float(y1)))


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """The lines of the step that the test is about, with their numbers."""
    k, u, i = at.step, r.used.step, at.step - 1
    if k == 0:
        start = r.initial
        return [Equation("start", (r"\hat{\mathbf{x}}_0 =", start.mean, r",\quad P_{0,1:2} =", start.cov[:2, :2]),
                         current=True)]
    value, accepted = float(r.used.nis[i]), bool(r.used.accepted[i])
    verdict = r"\leq\chi^2_2 =" if value <= r.level else r">\chi^2_2 ="
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("expected", PREDICT, r"\hat{\mathbf{y}}_k = H\hat{\mathbf{x}}_k^-", ("=", u.y_hat[i])),
        ("innovation_cov", PREDICT, r"S_k = HP_k^-H^T + R", ("=", u.innovation_cov[i])),
        ("innovation", INNOVATION, r"\nu_k = \mathbf{y}_k - \hat{\mathbf{y}}_k", ("=", r.y[i], "-", u.y_hat[i], "=",
                                                                                  u.innovation[i])),
        ("nis", TEST, r"\nu_k^TS_k^{-1}\nu_k", ("=", value, verdict, r.level)),
        ("update", UPDATE, r"\hat{\mathbf{x}}_k = \hat{\mathbf{x}}_k^- + K_k\nu_k" if accepted else
         r"\hat{\mathbf{x}}_k = \hat{\mathbf{x}}_k^-,\ P_k = P_k^-", ("=" if accepted else ":", u.posterior.mean[i])),
    ]
    if p.treatment == "adaptive":
        lines.append(("learn", UPDATE, r"R_k = aR_{k-1} + (1-a)(\mathbf{e}\mathbf{e}^T + HP_kH^T)",
                      ("=", r.used.R[i])))
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _readouts(r: "Result") -> list[Readout]:
    def error(f: "Filtered") -> float:
        return float(np.sqrt(np.square(f.step.posterior.mean[:, :2] - r.truth[1:, :2]).sum(axis=1).mean()))

    ok, bad = r.used.accepted, r.garbage
    count = int(ok.sum())
    low, high = consistency_band(0.95, 2, max(count, 1))
    return [
        Readout("rmse", error(r.used), "m", 3),
        Readout("rmse_plain", error(r.plain), "m", 3),
        Readout("garbage_rejected", f"{int((bad & ~ok).sum())} of {int(bad.sum())}"),
        Readout("good_rejected", f"{int((~bad & ~ok).sum())} of {int((~bad).sum())}"),
        Readout("mean_nis", f"{r.used.nis[ok].mean():.2f} ({low:.2f} … {high:.2f})" if count else None),
        Readout("many_nis", r.many_nis, digits=3),
        Readout("many_correlation", round(float(r.many_correlation[0]), 3), digits=2),
    ]


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    """NIS, innovation of the chosen axis, its correlation with later ones, errors, and the noise if it is learnt."""
    axis = ("x", "y").index(p.axis)
    u, t = r.used.step, np.arange(1, len(r.truth))
    ends = np.array([0.0, t[-1]])
    nis = np.maximum(r.used.nis, FLOOR)
    above = r.used.nis > r.level
    spread = np.sqrt(u.innovation_cov[:, axis, axis])
    limit = 1.96 / np.sqrt(2 * max(int(r.used.accepted.sum()), 1))
    lags = np.arange(1, LAGS + 1)
    found = {
        "nis": fig.chart(
            fig.band("band", ends, *(np.full(2, chi_square_level(q, 2)) for q in (0.025, 0.975)), "prior"),
            fig.line("level", ends, np.full(2, r.level), "innovation", dash=True),
            fig.markers("inside", t[~above], nis[~above], "kf"),
            fig.markers("above", t[above], nis[above], "warning", symbol="diamond", size=9),
            cursor=k, log_y=True, y_range=(FLOOR / 1.5, max(100.0, 2.0 * float(nis.max())))),
        "innovation": fig.chart(
            fig.band("band", t, -2 * spread, 2 * spread, "innovation"),
            fig.line("innovation", t, u.innovation[:, axis], "innovation", markers=True, width=1.5), cursor=k),
        "correlation": fig.chart(
            fig.band("band", np.array([0.5, LAGS + 0.5]), np.full(2, -limit), np.full(2, limit), "prior"),
            fig.bars("track", lags, r.correlation, "innovation"),
            fig.line("many", lags, r.many_correlation, "truth", markers=True)),
        "error": fig.chart(
            fig.markers("raw", t, _distance(r.y, r), "measurement", size=5),
            fig.line("plain", t, _distance(r.plain.step.posterior.mean, r), "vector"),
            fig.line("used", t, _distance(u.posterior.mean, r), "kf"),
            cursor=k, y_range=(0.0, 1.15 * _largest_error(r))),
    }
    if p.treatment == "adaptive":
        true, assumed = (np.full(2, s) for s in ((p.sigma_x_m, p.sigma_y_m)[axis],
                                                 p.r_ratio * (p.sigma_x_m, p.sigma_y_m)[axis]))
        found["noise"] = fig.chart(
            fig.line("real", ends, true, "truth", dash=True), fig.line("assumed", ends, assumed, "vector", dash=True),
            fig.line("learnt", t, np.sqrt(r.used.R[:, axis, axis]), "kf"), cursor=k)
    return found


def _distance(x: Array, r: "Result") -> Array:
    return np.sqrt(np.square(x[:, :2] - r.truth[1:, :2]).sum(axis=1))


def _largest_error(r: "Result") -> float:
    """Of the filters and of the good measurements: garbage is allowed to leave the plot."""
    return max(float(_distance(f.step.posterior.mean, r).max()) for f in (r.used, r.plain)) + float(
        np.where(r.garbage, 0.0, _distance(r.y, r)).mean())
