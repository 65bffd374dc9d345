"""The most probable state is the bottom of a bowl, and also the mean.  KF thesis (3.1)-(3.10)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core import kalman
from core.gaussian import mahalanobis_squared, sample
from core.linear_update import Information, information_update
from core.sensors import Linear
from core.types import Array, Gaussian
from lessons.bayes_kalman._map_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

BATCHES, BATCH = 40, 2500                # imagined worlds: one batch per step of the timeline
MEASURED = {
    "T-04": np.array([[1.0, 0.0], [1.0, 1.0]]),
    "both": np.eye(2),
    "first": np.array([[1.0, 0.0]]),
    "sum": np.array([[1.0, 1.0]]),
}
P_UNIT = np.array([[4.0, 1.0], [1.0, 3.0]])              # m²; the thesis has no numbers in chapter 3, these are ours
R_UNIT = np.array([[2.0, 0.5], [0.5, 1.0]])


@dataclass(frozen=True, slots=True)
class Params:
    """A prior, a measurement and how good they are; both whole matrices are scaled with their first entry."""

    prior: Point = draggable((2.0, -1.0), low=-10.0, high=10.0, role="prior", group="law")
    told: Point = draggable((3.0, -1.0), low=-10.0, high=10.0, role="measurement", group="law")
    P_m2: float = slider(4.0, low=0.1, high=20.0, unit="m²", log=True, group="law")
    R_m2: float = slider(2.0, low=0.1, high=20.0, unit="m²", log=True, group="law")
    measured: str = choice("T-04", tuple(MEASURED), group="law")
    surface: str = choice("cost", ("cost", "density"), group="view")
    nearness: float = slider(0.3, low=0.1, high=1.0, step=0.05, group="worlds")
    seed: int = seed(1, group="worlds")


class Result(NamedTuple):
    """Three ways to one point."""

    told: Array                  # (2,) a state that the measurement speaks for: y = H told
    y: Array                     # (m,)
    sensor: Linear
    gain_form: kalman.Update     # (3.10) and the gain
    info: Information            # (3.7)-(3.9)
    gap_m: float                 # distance of the two, by rounding only
    x: Array                     # (kept, 2) imagined worlds whose measurement came out close to y
    counts: Array                # (BATCHES + 1,) how many of them after each batch
    means: Array                 # (BATCHES + 1, 2) their mean; NaN before the first


def compute(p: Params, progress: Progress) -> Result:
    """The minimum by both formulas; the mean by imagining worlds and keeping those that fit the measurement."""
    H = MEASURED[p.measured]
    R = (R_UNIT if len(H) == 2 else R_UNIT[:1, :1]) * (p.R_m2 / R_UNIT[0, 0])
    prior, sensor = Gaussian(np.array(p.prior), P_UNIT * (p.P_m2 / P_UNIT[0, 0])), Linear(H, R)
    y = H @ np.array(p.told)
    step = kalman.update(prior, y, sensor)
    info = information_update(prior, y, sensor)

    draw, measure = np.random.default_rng(p.seed).spawn(2)
    imagined = Gaussian(y, step.innovation_cov)           # how far off is a lot: in units of the innovation
    kept, counts = [np.empty((0, 2))], [0]
    for i in range(BATCHES):
        progress(i / BATCHES)
        x = sample(prior, BATCH, draw)
        fits = mahalanobis_squared(imagined, sample(Gaussian(np.zeros(len(H)), R), BATCH, measure) + x @ H.T)
        kept.append(x[fits < p.nearness**2])
        counts.append(counts[-1] + len(kept[-1]))
    x = np.concatenate(kept)
    sums = np.vstack([np.zeros(2), np.cumsum(x, axis=0)])[counts]
    with np.errstate(invalid="ignore"):
        means = sums / np.array(counts, dtype=float)[:, None]
    gap = float(np.abs(step.posterior.mean - info.posterior.mean).max())
    return Result(np.array(p.told), y, sensor, step, info, gap, x, np.array(counts), means)


def timeline(p: Params) -> Timeline:
    """Batches of imagined worlds; the derivation as stages."""
    return Timeline(BATCHES, ("prior", "measurement", "sum", "minimum", "mean"), start=BATCHES, scale=BATCH,
                    unit_name="n")


LESSON = Lesson(
    Params, compute, view, timeline=timeline,
    refs=("KF thesis 3.1", "KF thesis (3.1)-(3.10)", "KF thesis (2.16)-(2.18)"),
    presets={
        "two measurements": {},
        "they disagree": {"prior": (-2.0, 2.0), "told": (4.0, -2.0), "R_m2": 4.0},
        "one measurement only: a valley": {"measured": "first", "told": (5.0, 1.0), "R_m2": 1.0, "step": 40,
                                           "stage": "measurement"},
        "the sum is measured": {"measured": "sum", "told": (4.0, 2.0), "R_m2": 0.5},
        "a vague prior: least squares": {"P_m2": 20.0, "prior": (-3.0, 3.0), "R_m2": 0.5},
        "the posterior density": {"surface": "density"},
    },
)
