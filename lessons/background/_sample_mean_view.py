"""How the shrinking law of the mean is drawn: draws, repeated means, and both ellipses."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Gaussian
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import LevelEllipse, Plane, Points

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.background.sample_mean import Params, Result

REACH = 3.2           # standard deviations of one draw that the picture shows to each side
SHOWN = 300           # of the draws of the first experiment


def view(p: "Params", r: "Result", at: Moment) -> View:
    from lessons.background.sample_mean import DRAWN, NUMBERS

    n = int(NUMBERS[at.step])
    half = REACH * max(p.sigma_x_m, p.sigma_y_m)
    x, y = p.truth
    box = np.array([[x - half, y - half], [x + half, y + half]])
    mean_law = Gaussian(r.law.mean, r.law.cov / n)
    draws = r.draws[:min(n, SHOWN)]
    means = r.means[at.step, :DRAWN]
    inside = [((a >= box[0]) & (a <= box[1])).all(axis=1) for a in (draws, means)]
    lost = int((~inside[1]).sum())
    note = "The Cauchy law has no mean and no covariance: the ellipses are those of a normal law of the same scale."
    scene = [
        Points("draws", draws[inside[0]], role="monte_carlo", size=6.0),
        LevelEllipse("one", r.law, role="prior", probability=0.68, width=3.0, cross=False),
        Points("means", means[inside[1]], role="measurement", size=5.0),
        LevelEllipse("mean_law", mean_law, role="posterior", probability=0.68, width=4.5, cross=False),
        Points("mean", [np.clip(r.means[at.step, 0], *box)], role="warning", size=12),
    ]
    return View(
        scene=[item for item in scene if not isinstance(item, Points) or len(item.positions)],
        camera=Plane((x - half, x + half), (y - half, y + half)), figures=_figures(r, at.step),
        readouts=_readouts(r, at.step, n), equations=_equations(r, at.step, n),
        caption=f"means of n = {n:,} draws" + (f" ({lost} outside)" if lost else ""),
        note=note if p.law == "cauchy" else "")


def _figures(r: "Result", k: int) -> "dict[str, go.Figure]":
    from lessons.background.sample_mean import NUMBERS

    theory = float(np.sqrt(np.trace(r.law.cov))) / np.sqrt(NUMBERS)
    noise = theory / np.sqrt(r.means.shape[1])
    error = chart(line("theory", NUMBERS, theory, "posterior", dash=True),
                  line("rms", NUMBERS, r.rms, "measurement", markers=True),
                  line("bias", NUMBERS, np.maximum(r.bias, 1e-4), "warning", markers=True),
                  line("bias_theory", NUMBERS, noise, "reference", dash=True),
                  log_x=True, log_y=True, cursor=float(NUMBERS[k]))
    sigma = float(np.sqrt(r.law.cov[0, 0]))
    edges = np.linspace(r.law.mean[0] - 3 * sigma, r.law.mean[0] + 3 * sigma, 61)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]
    share = np.histogram(r.means[k, :, 0], edges)[0] / (r.means.shape[1] * width)
    s = sigma / np.sqrt(NUMBERS[k])
    x = np.unique(np.concatenate([np.linspace(edges[0], edges[-1], 121),
                                  np.linspace(r.law.mean[0] - 4 * s, r.law.mean[0] + 4 * s, 121)]))
    density = np.exp(-0.5 * ((x - r.law.mean[0]) / s) ** 2) / (s * np.sqrt(2 * np.pi))
    histogram = chart(bars("means", middle, share, "measurement"), line("law", x, density, "posterior"),
                      x_range=(float(edges[0]), float(edges[-1])))
    one = r.draws[:, 0]
    track = np.cumsum(one) / np.arange(1, len(one) + 1)
    n = np.arange(1, len(one) + 1)
    some = np.unique(np.round(np.geomspace(1, len(one), 200)).astype(int)) - 1
    running = chart(line("truth", n[[0, -1]], [r.law.mean[0]] * 2, "truth"),
                    line("band_low", n[some], r.law.mean[0] - 2 * sigma / np.sqrt(n[some]), "posterior", dash=True),
                    line("band_high", n[some], r.law.mean[0] + 2 * sigma / np.sqrt(n[some]), "posterior", dash=True),
                    line("running", n[some], track[some], "measurement"), log_x=True, cursor=float(NUMBERS[k]),
                    y_range=(float(r.law.mean[0] - 2.2 * sigma), float(r.law.mean[0] + 2.2 * sigma)))
    return {"error": error, "histogram": histogram, "running": running}


def _readouts(r: "Result", k: int, n: int) -> list[Readout]:
    sd = np.sqrt(np.diag(r.law.cov) / n)
    slope = float(np.polyfit(np.log(_numbers()), np.log(r.rms), 1)[0])
    return [Readout("n", n), Readout("sd_x", float(sd[0]), "m"), Readout("sd_y", float(sd[1]), "m"),
            Readout("rms", float(r.rms[k]), "m"), Readout("bias", float(r.bias[k]), "m", 3),
            Readout("inside", 100.0 * float(r.inside[k]), "%", 3), Readout("slope", slope, "", 3)]


def _numbers() -> np.ndarray:
    from lessons.background.sample_mean import NUMBERS

    return NUMBERS


def _equations(r: "Result", k: int, n: int) -> list[Equation]:
    return [Equation("mean", (rf"\bar x = \frac{{1}}{{{n}}}\sum_{{i=1}}^{{{n}}} x_i =", r.means[k, 0])),
            Equation("expectation", (r"\mathrm{E}(\bar x) = \mu =", r.law.mean)),
            Equation("variance", (rf"\mathrm{{V}}(\bar x) = \Sigma / {n} =", r.law.cov / n), digits=3)]
