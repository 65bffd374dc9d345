"""Plots, readouts and formulas of the lesson on fingerprints."""

from typing import TYPE_CHECKING

import numpy as np

from core.confidence import highest_density
from core.grid import GridDensity
from lessons.kit import figures as fig
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout
from lessons.kit.roles import Role
from lessons.static._fingerprint_model import METHODS, PROBABILITY, SIDE_M

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.fingerprint import Params, Result

SURVEY, SCAN, NEIGHBOURS, POSTERIOR = range(4)
ROLES: dict[str, Role] = {"nn": "innovation", "knn": "linearised", "wknn": "sigma", "mean": "posterior"}
CURVES = ("nn", "wknn", "mean")          # of the plots over the survey's effort


def figures(p: "Params", r: "Result", step: int) -> dict[str, "go.Figure"]:
    """Errors all over the hall, how they depend on the survey, and the scan among the fingerprints."""
    from lessons.static.fingerprint import PER_AXIS, SAMPLES

    share = np.linspace(0.0, 100.0, 101)
    errors = np.percentile(r.tests.errors, share, axis=0) if r.tests is not None else np.zeros((0, len(METHODS)))
    spacing = SIDE_M / PER_AXIS
    return {
        "cdf": fig.chart(*(fig.line(name, errors[:, i], share[:len(errors)], ROLES[name])
                           for i, name in enumerate(METHODS)), y_range=(0.0, 100.0)),
        "spacing": fig.chart(*(_curve(name, spacing, r.by_spacing) for name in CURVES),
                             cursor=p.spacing_m if p.grid else None),
        "samples": fig.chart(*(_curve(name, SAMPLES, r.by_samples) for name in CURVES), cursor=p.samples, log_x=True),
        "likeness": _likeness(p, r, step),
    }


def _curve(name: str, x: np.ndarray, rms: np.ndarray) -> "go.Scatter":
    y = rms[:, METHODS.index(name)]
    known = np.isfinite(y)
    return fig.line(name, x[known], y[known], ROLES[name], markers=True)


def _likeness(p: "Params", r: "Result", step: int) -> "go.Figure":
    """Every survey point: how far away it is, and how unlike its fingerprint is to the scan."""
    if r.map is None:
        return fig.chart(fig.markers("points", [], [], "measurement"))
    sensor = r.map.sensor
    away = np.linalg.norm(sensor.points_m - np.array(p.truth), axis=1)
    unlike = np.sqrt(sensor.squared_distances(r.scans[step]))
    best = np.argsort(unlike, kind="stable")[:p.neighbours]
    return fig.chart(fig.markers("points", away, unlike, "measurement", size=6),
                     fig.markers("neighbours", away[best], unlike[best], "sigma", size=10, symbol="square"))


def readouts(p: "Params", r: "Result", at: Moment, law: GridDensity | None) -> list[Readout]:
    """Errors of this scan, and those of many scans all over the hall."""
    error = np.linalg.norm(r.found[at.step] - np.array(p.truth), axis=-1) if r.map is not None else None

    def own(name: str, stage: int) -> float | None:
        return float(error[METHODS.index(name)]) if error is not None and at.stage >= stage else None

    def many(name: str) -> float | None:
        return float(r.tests.rms[METHODS.index(name)]) if r.tests is not None else None

    region = highest_density(law, PROBABILITY).volume if law is not None and at.stage >= POSTERIOR else None
    return [
        Readout("points", float(len(r.map.share)) if r.map is not None else 0.0, digits=4),
        Readout("error_nn", own("nn", NEIGHBOURS), "m", 3),
        Readout("error_wknn", own("wknn", NEIGHBOURS), "m", 3),
        Readout("error_mean", own("mean", POSTERIOR), "m", 3),
        Readout("region", region, "m²", 4),
        Readout("rms_nn", many("nn"), "m", 3),
        Readout("rms_mean", many("mean"), "m", 3),
        Readout("covered", 100 * r.tests.covered if r.tests is not None else None, "%", 3),
    ]


def equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """The model of exercise 2.9 and its solutions, with the numbers of this scan."""
    lines: list[tuple[str, int, str, tuple[Piece, ...]]] = [
        ("survey", SURVEY, r"\mathbf{a}_i = \frac{1}{n}\sum_{j=1}^{n}\mathbf{y}_{ij},\quad\frac{\sigma_v}{\sqrt{n}} =",
         (p.noise_db / float(np.sqrt(p.samples)),)),
        ("scan", SCAN, r"\mathbf{y} = \mathbf{a}_i + \mathbf{v},\quad\mathbf{y} =", (r.scans[at.step],))]
    rules = [
        ("distance", NEIGHBOURS, r"\min_i\|\mathbf{y} - \mathbf{a}_i\| ="),
        ("nn", NEIGHBOURS, r"\hat{\mathbf{x}}_{1} = \mathbf{p}_i ="),
        ("knn", NEIGHBOURS, r"\hat{\mathbf{x}}_{k} = \frac{1}{k}\sum_{i}\mathbf{p}_i ="),
        ("wknn", NEIGHBOURS, r"\frac{\sum_{i}\mathbf{p}_i/\|\mathbf{y} - \mathbf{a}_i\|}"
                             r"{\sum_{i}1/\|\mathbf{y} - \mathbf{a}_i\|} ="),
        ("posterior", POSTERIOR, r"p(\mathbf{x}\mid\mathbf{y}) \propto e^{-\|\mathbf{y} - \mathbf{a}_i\|^2/2\sigma^2},"
                                 r"\quad\max_i P(\mathbf{x}\in A_i\mid\mathbf{y}) ="),
        ("mean", POSTERIOR, r"\mathrm{E}(\mathbf{x}\mid\mathbf{y}) ="),
    ]
    numbers: dict[str, tuple[Piece, ...]] = {}
    if r.map is not None:
        y, sensor = r.scans[at.step], r.map.sensor
        numbers = {name: (r.found[at.step, i],) for i, name in enumerate(METHODS)}
        numbers["distance"] = (float(np.sqrt(sensor.squared_distances(y).min())),)
        numbers["posterior"] = (float(sensor.posterior(y, r.map.share).max()),)
    lines += [(name, stage, rule, numbers.get(name, ())) for name, stage, rule in rules]
    return [Equation(name, (rule, *values) if stage <= at.stage else (rule,), current=stage == at.stage, digits=3)
            for name, stage, rule, values in lines]
