"""x'x ~ chi2(n, mu'mu) for x ~ N(mu, I), and x'Ax ~ chi2(rank A, mu'A mu) when A Sigma is idempotent.

MAT 1.3.2 (Definitions 5 and 6, Example 10, Theorem 6, Fig 1.3), exercise 1.12.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.forms import quadratic_form
from core.gaussian import sample
from core.levels import chi_square_density, chi_square_level, chi_square_probability
from core.types import Array, Gaussian
from lessons.background._chi_square_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

BATCHES, BATCH = 40, 50                    # samples: one batch per step of the timeline
CURVE = 400
FAMILY = (1, 2, 4, 8)                      # degrees of freedom in the gallery
EXAMPLE_7 = np.array([[16.0, 24.0], [24.0, 52.0]])


@dataclass(frozen=True, slots=True)
class Params:
    """Squared norms of n components, or a quadratic form of two."""

    picture: str = choice("norm", ("norm", "form"))
    n: int = slider(3, low=1, high=12, group="law")
    lam: float = slider(4.0, low=0.0, high=25.0, step=0.25, group="law")
    spread: str = choice("example7", ("example7", "identity"), group="law")
    form: str = choice("direction", ("direction", "inverse", "plain"), group="law")
    mean: Point = draggable((1.0, 2.0), low=-12.0, high=12.0, role="vector", group="law")
    a: Point = draggable((9.0, 9.0), low=-12.0, high=12.0, unit="", role="measurement", group="law")
    percent: float = slider(95.0, low=1.0, high=99.5, step=0.5, unit="%", group="set")
    seed: int = seed(1, group="set")


class Result(NamedTuple):
    """N = BATCHES * BATCH samples; those of `norm` are turned into the half-plane of their mean."""

    law: Gaussian                # of x
    A: Array                     # (n, n)
    is_chi_square: bool          # whether A Sigma is idempotent
    df: int                      # rank of A
    lam: float                   # mu' A mu
    x: Array                     # (N, n)
    z: Array                     # (N,) x' A x
    level: float                 # c with P(z <= c) as asked for, if the law is chi-square
    t: Array                     # (CURVE,) places of the curves, from above 0
    density: Array               # (CURVE,) of chi2(df, lam)
    central: Array               # (CURVE,) of chi2(df)
    probability: Array           # (CURVE,) P(z <= t)
    family: Array                # (len(FAMILY), CURVE) densities of chi2(n, lam)


def compute(p: Params, progress: Progress) -> Result:
    """Draws x, forms x'Ax, and its law by Theorem 6."""
    if p.picture == "norm":
        mean = np.zeros(p.n)
        mean[0] = np.sqrt(p.lam)
        law, A = Gaussian(mean, np.eye(p.n)), np.eye(p.n)
    else:
        law = Gaussian(np.array(p.mean), EXAMPLE_7 if p.spread == "example7" else np.eye(2))
        A = _form(p, law.cov)
    try:
        df, lam = quadratic_form(law, A)
        fits = True
    except ValueError:                                     # what the theorem would claim without its condition
        df, lam, fits = int(np.linalg.matrix_rank(A)), float(law.mean @ A @ law.mean), False
    x = sample(law, BATCHES * BATCH, np.random.default_rng(p.seed))
    progress(0.5)
    level = float(chi_square_level(p.percent / 100.0, df, lam))
    end = max(1.02 * level, float(chi_square_level(0.997, df, lam)))
    t = np.linspace(0.0, end, CURVE + 1)[1:]
    family = np.array([chi_square_density(t, n, lam) for n in FAMILY])
    return Result(law, A, fits, df, lam, x, np.vecdot(x, x @ A), level, t, chi_square_density(t, df, lam),
                  chi_square_density(t, df), chi_square_probability(t, df, lam), family)


def _form(p: Params, cov: Array) -> Array:
    """The A of the form: a projection once the spread is scaled away, the whole inverse, or a plain square."""
    if p.form == "inverse":
        return np.linalg.solve(cov, np.eye(2))             # Example 10
    if p.form == "direction":
        a = np.array(p.a) if np.hypot(*p.a) > 1e-9 else np.array([1.0, 0.0])
        return np.outer(a, a) / (a @ cov @ a)              # rank 1
    return 2.0 / np.trace(cov) * np.eye(2)                 # E x'Ax is right, A Sigma is not idempotent


def timeline(p: Params) -> Timeline:
    """Batches of samples."""
    return Timeline(BATCHES, ("draw", "square", "law"), start=BATCHES, scale=BATCH, unit_name="samples")


def unused(p: Params) -> set[str]:
    if p.picture == "norm":
        return {"spread", "form", "mean", "a"}
    return {"n", "lam"} | ({"a"} if p.form != "direction" else set())


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 1.3.2", "MAT Definition 5", "MAT Definition 6", "MAT Example 10", "MAT Theorem 6", "MAT Fig 1.3",
          "MAT exercise 1.12"),
    presets={
        "shifted: χ²(3, 4)": {},
        "centred: χ²(2)": {"n": 2, "lam": 0.0, "percent": 68.0},
        "one component": {"n": 1, "lam": 0.0},
        "far out: χ²(12)": {"n": 12, "lam": 0.0},
        "Example 10": {"picture": "form", "form": "inverse", "mean": (0.0, 0.0), "percent": 68.0},
        "Theorem 6, rank 1": {"picture": "form"},
        "any direction of μ: χ²(2, 5)": {"picture": "form", "spread": "identity", "form": "plain"},
        "AΣ is not idempotent": {"picture": "form", "form": "plain", "mean": (0.0, 0.0)},
    },
)
