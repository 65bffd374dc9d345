"""N(mu, Sigma) in the plane: its density (1.8), the ellipse of any probability, and its linear forms.  MAT 1.3.1."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.forms import half_space_probability
from core.gaussian import chi_square_level, sample
from core.linalg import cholesky_psd, schur, sqrt_psd
from core.types import Array, Gaussian
from lessons.background._normal_view import view
from lessons.kit.lesson import Lesson, Progress
from lessons.kit.params import Point, choice, draggable, seed, slider, switch

FLAT = 1e-6                 # share of the larger variance below which a law counts as singular
EXAMPLE_7 = {"mean": (0.0, 0.0), "axis": (3.5777, 7.1554), "ratio": 0.25}
EXERCISE_1_11 = {"mean": (1.0, -1.0), "axis": (2.1213, -2.1213), "ratio": 0.3333, "direction_deg": 45.0,
                 "show": "form", "limit": 0.0}


@dataclass(frozen=True, slots=True)
class Params:
    """The law by its longer half-axis, and what is drawn of it."""

    show: str = choice("ellipse", ("ellipse", "surface", "form"))
    mean: Point = draggable((0.0, 0.0), low=-12.0, high=12.0, role="prior", group="law")
    axis: Point = draggable(EXAMPLE_7["axis"], low=-30.0, high=30.0, role="vector", group="law", about="mean")
    ratio: float = slider(0.25, low=0.0, high=1.0, step=0.01, group="law")
    probability: float = slider(0.68, low=0.01, high=0.999, step=0.001, group="law")
    samples: int = slider(100, low=10, high=5000, log=True, group="samples")
    root: str = choice("cholesky", ("cholesky", "symmetric"), group="samples")
    both: bool = switch(False, group="samples")
    seed: int = seed(2, group="samples")
    direction_deg: float = slider(150.0, low=0.0, high=180.0, step=1.0, unit="°", group="form")
    limit: float = slider(0.0, low=-30.0, high=30.0, step=0.5, unit="m", group="form")


class Result(NamedTuple):
    """The law; its eigenvalues (2,), falling, and eigenvectors (2, 2) in columns; rank: how many are not zero.

    level: the chi-square of the ellipse, with `rank` degrees of freedom; distance (N,): the samples' squared
    Mahalanobis distances in the line or plane of the law.

    x (N, 2): samples mean + root u with the chosen root, other: with the other one and the same u; inside (N,).  Along
    a: mean and standard deviation of a'x, P(a'x <= limit), and the share of the samples there.
    """

    law: Gaussian
    values: Array
    vectors: Array
    rank: int
    level: float
    x: Array
    other: Array
    distance: Array
    inside: Array
    a: Array
    form_mean: float
    form_sd: float
    form_probability: float
    form_share: float

    @property
    def singular(self) -> bool:
        return self.rank < 2


def compute(p: Params, progress: Progress) -> Result:
    """Covariance from its axes; samples by both roots from the same standard normal numbers."""
    cov = covariance(p)
    law = Gaussian(np.array(p.mean), cov)
    spectrum = schur(cov)
    standard = Gaussian(np.zeros(2), np.eye(2))
    u = sample(standard, p.samples, np.random.default_rng(p.seed))
    roots = {"cholesky": cholesky_psd(cov), "symmetric": sqrt_psd(cov)}
    x, other = (law.mean + np.matvec(roots[name], u) for name in sorted(roots, key=lambda name: name != p.root))
    rank = int((spectrum.values > FLAT * max(spectrum.values.max(), 1e-12)).sum())
    level = float(chi_square_level(p.probability, rank)) if rank else 0.0
    along = (x - law.mean) @ spectrum.Q[:, :rank]
    distance = (along**2 / spectrum.values[:rank]).sum(axis=1)
    inside = distance <= level
    angle = np.deg2rad(p.direction_deg)
    a = np.array([np.cos(angle), np.sin(angle)])
    variance = float(a @ cov @ a)
    sd = np.sqrt(variance) if variance > 1e-12 * spectrum.values.max() else 0.0         # else constant
    mean = float(a @ law.mean)
    below = float(half_space_probability(law, a, p.limit)) if sd > 0.0 else float(mean <= p.limit + 1e-9)
    return Result(law, spectrum.values, spectrum.Q, rank, level, x, other, distance, inside, a, mean, sd, below,
                  float((x @ a <= p.limit + 1e-9).mean()))


def covariance(p: Params) -> Array:
    """lambda_1 q_1 q_1' + lambda_2 q_2 q_2' with standard deviations |axis| and ratio |axis| along them."""
    axis = np.array(p.axis)
    length = float(np.sqrt(axis @ axis))
    q = axis / length if length > 1e-9 else np.array([1.0, 0.0])
    across = np.array([-q[1], q[0]])
    return length**2 * (np.outer(q, q) + p.ratio**2 * np.outer(across, across))


def unused(p: Params) -> Collection[str]:
    """The linear form has controls of its own; the surface draws no samples."""
    hidden = {"direction_deg", "limit"} if p.show != "form" else set()
    return hidden | ({"samples", "root", "both", "seed"} if p.show == "surface" else set())


LESSON = Lesson(
    Params, compute, view, unused=unused, budget_s=0.5,
    refs=("MAT 1.3.1", "MAT (1.8)", "MAT (1.9)", "MAT Examples 7, 8", "MAT Figures 1.1, 1.2",
          "MAT exercises 1.10, 1.11"),
    presets={
        "Example 7, Figure 1.1": {},
        "Figure 1.1 as a surface": {"show": "surface"},
        "Example 8: two roots": {"both": True, "samples": 30},
        "99.9 %": {"probability": 0.999, "samples": 1000},
        "every linear form is normal": {"show": "form", "samples": 1000},
        "exercise 1.11": {**EXERCISE_1_11, "samples": 1000},
        "the singular limit": {"ratio": 0.0},
        "the singular limit as a surface": {"show": "surface", "ratio": 0.1},
    },
)
