"""How one step of the three filters is drawn: ranges, weighted cloud, ellipses, the numbers, and four plots."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Item, Label, LevelEllipse, Particles, Plane, Points, Polyline, Segments, Stations

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.filtering.particle_vs_ekf import Params, Result

PREDICT, WEIGH, ESTIMATE, RESAMPLE = range(4)
SNAPSHOTS = (0, 10, 20, 30, 40)
SNAPSHOT_PARTICLES = 100
PATHS = 60
CARRIER = 0.002                           # a particle with more of the weight than this is drawn in any case
ARROWS = "→↗↑↖←↙↓↘"
COMBS = {
    "systematic": r"z_j = \frac{j - 1 + u}{N}", "stratified": r"z_j = \frac{j - 1 + u_j}{N}",
    "multinomial": r"z_j = u_j", "residual": r"n_i \geq \lfloor N\omega_k^i \rfloor",
}
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 121)


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The picture of Figure 3.3 up to this step, and this step's cloud up to this stage."""
    camera = _camera(p, r)
    return View(
        scene=[*_scene(r, at), *_outside(r, camera)], camera=camera, figures=_figures(p, r, at.step),
        readouts=_readouts(p, r, at.step), equations=_equations(p, r, at), caption=f"t = {at.step} s",
        note=_note(p, r, at.step),
    )


def _note(p: "Params", r: "Result", k: int) -> str:
    drawn, carriers = len(r.run.index), len(r.carried[k - 1]) if k else 0
    if drawn == p.n_particles:
        return ""
    others = f", and {carriers} more that each carry over {CARRIER:.1%} of the weight" if carriers else ""
    return f"{drawn:,} of {p.n_particles:,} particles are drawn{others}."


def _law(g: Gaussian, k: int) -> Gaussian:
    return Gaussian(g.mean[k], g.cov[k])


def _scene(r: "Result", at: Moment) -> list[Item]:
    k = at.step
    known = k if k == 0 or at.stage >= WEIGH else k - 1      # the last measurement that has been used
    truth = r.truth[:, :2]
    items: list[Item] = [
        Segments("baseline", r.stations[None, :2], role="muted", width=1.5),
        Stations("stations", r.stations, tuple(f"S{i + 1}" for i in range(len(r.stations)))),
        *_cloud(r, at),
        Polyline("truth", truth, role="truth", dashed=True),
        Points("truth_now", truth[[k]], role="truth", size=12, shape="diamond"),
    ]
    if known > 0:
        items += [Polyline("ekf_track", r.ekf.mean[:known + 1, :2], role="ekf", width=3),
                  Polyline("ukf_track", r.ukf.mean[:known + 1, :2], role="ukf", width=2.5)]
    if k > 0 and at.stage == WEIGH:
        items += [Polyline(f"range_{i + 1}", s + distance * np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)]),
                           role="measurement", width=2) for i, (s, distance) in enumerate(zip(r.stations, r.y[k - 1],
                                                                                              strict=True))]
    for t in SNAPSHOTS:
        if t <= known and t != k:
            items += [LevelEllipse(f"ekf_{t}", _law(r.ekf, t), role="ekf", width=2, cross=False),
                      Label(f"label_{t}", f"{t} s", _above(r, t), size=0.9)]
    items.append(LevelEllipse("ekf_now", _law(r.ekf, known), role="ekf", width=5.5, dashed=known < k))
    items.append(LevelEllipse("ukf_now", _law(r.ukf, known), role="ukf", width=2.5, dashed=known < k))
    if k == 0 or at.stage >= ESTIMATE:
        items.append(Points("pf_mean", r.pf.mean[[k], :2], role="pf", size=14, shape="square"))
    return items


def _cloud(r: "Result", at: Moment) -> list[Item]:
    """The drawn particles as they are at this stage, and those of Figure 3.3's earlier moments."""
    run, k = r.run, at.step
    items: list[Item] = []
    before = [t for t in SNAPSHOTS if t < k]
    if before:
        some = np.linspace(0, len(run.index) - 1, min(len(run.index), SNAPSHOT_PARTICLES)).astype(int)
        clouds = [run.initial[some] if t == 0 else _comb(*_weighted(r, t - 1), len(some)) for t in before]
        items.append(Points("snapshots", np.vstack(clouds)[:, :2], role="pf", size=4, fade=0.45))
    if k == 0:
        return [*items, Particles("cloud", run.initial[:, :2], role="pf")]
    i = k - 1
    predicted = run.predicted[i, :, :2]
    if at.stage == PREDICT:
        old = (run.initial if i == 0 else run.particles[i - 1])[:, :2]
        old_weights = None if i == 0 else run.weights[i - 1]
        some = np.linspace(0, len(old) - 1, min(len(old), PATHS)).astype(int)
        return [*items, Segments("paths", np.stack([old[some], predicted[some]], axis=1), role="muted", width=1),
                Particles("cloud", predicted, _visible(old_weights), role="prior")]
    if at.stage < RESAMPLE or not run.resampled[i]:
        x, weights = _weighted(r, i)
        return [*items, Particles("cloud", x[:, :2], _visible(weights), role="pf")]
    lost = r.children[i] == 0
    if lost.any():
        items.append(Points("lost", predicted[lost], role="muted", size=4, fade=0.3))
    return [*items, Particles("cloud", predicted[~lost], _visible(r.children[i][~lost].astype(float)), role="pf")]


def _weighted(r: "Result", i: int) -> tuple[Array, Array]:
    """The drawn particles after step i + 1's measurement, and the others that carry much weight; their weights."""
    w = r.run.weights_before[i]
    scale = r.heaviest[i] / max(float(w.max()), 1e-300)
    return np.vstack([r.run.predicted[i], r.carriers[i]]), np.append(w * scale, r.carried[i])


def _comb(x: Array, w: Array, count: int) -> Array:
    """count points of a weighted cloud, chosen by a comb over its weights, so that the picture does not flicker."""
    total = np.cumsum(w)
    if total[-1] <= 0.0:
        return x[:count]
    return x[np.searchsorted(total / total[-1], (np.arange(count) + 0.5) / count).clip(0, len(x) - 1)]


def _visible(w: Array | None) -> Array | None:
    """Weights for drawing; equal ones when all weight is on particles that are not drawn."""
    return w if w is not None and w.sum() > 0.0 else None


def _above(r: "Result", t: int) -> Array:
    """The top of the EKF's ellipse at time t, for its label."""
    return r.ekf.mean[t, :2] + np.array([0.0, 1.51 * np.sqrt(r.ekf.cov[t, 1, 1]) + 6.0])


def _camera(p: "Params", r: "Result") -> Plane:
    """The track, the mirrored track (where a second peak may be), and one station or all of them."""
    mirrored = r.truth[:, :2] - 2.0 * r.side.distance(r.truth)[:, None] * r.side.normal
    nearest = np.square(r.stations - r.truth[:, :2].mean(axis=0)).sum(axis=1).argmin()
    points = np.vstack([r.stations if p.zoom == "stations" else r.stations[[nearest]], r.truth[:, :2], mirrored])
    margin = 0.06 * np.ptp(points, axis=0).max() + 15.0
    (x0, y0), (x1, y1) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return Plane((float(x0), float(x1)), (float(y0), float(y1)), "x₁ (m)", "x₂ (m)")


def _outside(r: "Result", camera: Plane) -> list[Item]:
    """At the border, an arrow towards each station that is out of sight."""
    low, high = np.array([camera.x, camera.y]).T
    centre, reach = (low + high) / 2, 0.93 * (high - low) / 2
    found: list[Item] = []
    for i, s in enumerate(r.stations):
        share = np.abs((s - centre) / (high - low) * 2).max()
        if share > 1.0:
            direction = s - centre
            sign = ARROWS[round(np.arctan2(direction[1], direction[0]) / (np.pi / 4)) % 8]
            scale = np.min(reach / np.maximum(np.abs(direction), 1e-9))
            found.append(Label(f"to_S{i + 1}", f"S{i + 1} {sign}", centre + scale * direction))
    return found


def _equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """Algorithm 5 with the numbers of the heaviest particle that is drawn."""
    if at.step == 0:
        return [Equation("start", (r"\mathbf{x}_0^i \,\sim\, N(\hat{\mathbf{x}}_0, P_0),\quad \hat{\mathbf{x}}_0 =",
                                   r.ekf.mean[0]), current=True)]
    k = at.step - 1
    i = int(r.run.weights_before[k].argmax())
    rule = (r"\mathbf{x}_k^i \,\sim\, p(\mathbf{x}_k \mid \mathbf{x}_{k-1}^i)" if p.proposal == "prior"
            else r"\mathbf{x}_k^i \,\sim\, g(\mathbf{x}_k \mid \mathbf{x}_{k-1}^i, \mathbf{y}_k)")
    factor = "" if p.proposal == "prior" else r"\frac{p(\mathbf{x}_k^i \mid \mathbf{x}_{k-1}^i)}{g(\mathbf{x}_k^i)}"
    copies: tuple[Piece, ...] = ((r",\quad n_i =", float(r.children[k, i])) if r.run.resampled[k]
                                 else (r",\quad \mathrm{none\ drawn}",))
    n_eff = float(r.run.n_eff[k])
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("predict", PREDICT, rule, (r",\quad \mathbf{x}_k^i =", r.run.predicted[k, i])),
        ("compare", WEIGH, r"\mathbf{y}_k - h(\mathbf{x}_k^i)",
         ("=", r.y[k], "-", r.range_at_drawn[k, i], "=", r.y[k] - r.range_at_drawn[k, i])),
        ("weigh", WEIGH, r"\omega_k^i \propto \omega_{k-1}^i\,p(\mathbf{y}_k \mid \mathbf{x}_k^i)" + factor,
         (r",\quad N\omega_k^i =", p.n_particles * float(r.heaviest[k]))),
        ("estimate", ESTIMATE, r"\hat{\mathbf{x}}_k = \sum_i \omega_k^i\,\mathbf{x}_k^i", ("=", r.pf.mean[at.step])),
        ("n_eff", ESTIMATE, r"N_{\mathrm{eff}} = 1 \,/ \sum_i (\omega_k^i)^2",
         ("=", n_eff, r",\quad N_{\mathrm{eff}}/N =", n_eff / p.n_particles)),
        ("resample", RESAMPLE, COMBS[p.resampler], copies),
    ]
    return [Equation(name, (rule, *numbers) if stage <= at.stage else (rule,), current=stage == at.stage)
            for name, stage, rule, numbers in lines]


def _errors(g: Gaussian, truth: Array) -> Array:
    return np.sqrt(np.square(g.mean[:, :2] - truth[:, :2]).sum(axis=1))


def _readouts(p: "Params", r: "Result", k: int) -> list[Readout]:
    found = [Readout(f"{name}_error", float(_errors(g, r.truth)[k]), "m", 3)
             for name, g in (("ekf", r.ekf), ("ukf", r.ukf), ("pf", r.pf))]
    n = r.side.normal
    return [
        *found,
        Readout("ekf_sigma", float(np.sqrt(n @ r.ekf.cov[k, :2, :2] @ n)), "m", 3),
        Readout("share", 100.0 * float(r.share[k]), "%", 3),
        Readout("n_eff", float(r.run.n_eff[k - 1]) if k else float(p.n_particles), "", 3),
    ]


def _figures(p: "Params", r: "Result", k: int) -> dict[str, "go.Figure"]:
    t = np.arange(len(r.truth), dtype=np.float64)
    side = r.side.distance(r.truth)
    centres, width = (r.edges[1:] + r.edges[:-1]) / 2, r.edges[1] - r.edges[0]
    fine = np.linspace(r.edges[0], r.edges[-1], 241)
    peak = 1.15 * max(float(r.density[k].max()), 1e-9)
    n_eff = np.append(float(p.n_particles), r.run.n_eff)
    return {
        "histogram": fig.chart(
            fig.bars("pf", centres, r.density[k], "pf", width=width),
            fig.line("ekf", fine, _normal_curve(r, r.ekf, k, fine), "ekf", width=5),
            fig.line("ukf", fine, _normal_curve(r, r.ukf, k, fine), "ukf", width=2),
            # A confident normal curve is far higher than two modes that share the mass: give it room up to a limit.
            marks=[float(side[k])], y_range=(0.0, max(peak, min(_height(r, r.ekf, k) * 1.05, 4.0 * peak)))),
        "error": fig.chart(*(fig.line(name, t, _errors(g, r.truth), name) for name, g in
                             (("ekf", r.ekf), ("ukf", r.ukf), ("pf", r.pf))), cursor=k),
        "n_eff": fig.chart(
            fig.line("n_eff", t, n_eff, "pf"),
            fig.line("all", t[[0, -1]], np.full(2, float(p.n_particles)), "reference", dash=True),
            *([fig.line("threshold", t[[0, -1]], np.full(2, p.threshold * p.n_particles), "warning", dash=True)]
              if p.sampling == "adaptive" else []),
            log_y=True, y_range=(0.8, 1.5 * p.n_particles), cursor=k),
        "side": fig.chart(
            fig.line("pf", t, 100.0 * r.share, "pf"), fig.line("ekf", t, 100.0 * r.side.probability(r.ekf), "ekf"),
            fig.line("ukf", t, 100.0 * r.side.probability(r.ukf), "ukf", width=2),
            fig.line("truth", t, np.where(side > 0.0, 100.0, 0.0), "truth", dash=True, width=1.5),
            y_range=(-4.0, 104.0), cursor=k),
    }


def _spread(r: "Result", g: Gaussian, k: int) -> tuple[float, float]:
    """Mean and standard deviation of the distance from the line of the stations, by a normal law of the state."""
    n = r.side.normal
    return float(r.side.distance(g.mean[k])), float(np.sqrt(max(n @ g.cov[k, :2, :2] @ n, 1e-12)))


def _height(r: "Result", g: Gaussian, k: int) -> float:
    return 1.0 / (_spread(r, g, k)[1] * np.sqrt(2.0 * np.pi))


def _normal_curve(r: "Result", g: Gaussian, k: int, d: Array) -> Array:
    mean, sigma = _spread(r, g, k)
    return _height(r, g, k) * np.exp(-0.5 * np.square((d - mean) / sigma))
