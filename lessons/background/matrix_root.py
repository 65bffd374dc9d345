"""A = Q Lambda Q', A^(1/2) = Q diag(sqrt(lambda_i)) Q': rotate, scale, rotate back; and other roots.  MAT 1.1."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.linalg import cholesky_psd, schur, sqrt_psd
from core.types import Array
from lessons.background._matrix_root_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, slider

PER_STAGE = 8                # pictures of each of the three factors
ROOTS = ("symmetric", "cholesky", "turned", "signs")


@dataclass(frozen=True, slots=True)
class Params:
    """A symmetric positive semidefinite matrix, and which roots are shown; or an involution."""

    picture: str = choice("factors", ("factors", "roots", "involution"))
    a_11: float = slider(5.0, low=0.0, high=60.0, step=0.5, group="matrix")
    a_22: float = slider(5.0, low=0.0, high=60.0, step=0.5, group="matrix")
    a_12: float = slider(-4.0, low=-60.0, high=60.0, step=0.5, group="matrix")
    of_root: str = choice("matrix", ("matrix", "root"), group="matrix")
    other: str = choice("cholesky", ROOTS[1:], group="roots")
    turn_deg: float = slider(40.0, low=-180.0, high=180.0, step=0.5, unit="°", group="roots")
    arrow_deg: float = slider(30.0, low=0.0, high=360.0, step=5.0, unit="°", group="view")
    b_11: float = slider(0.6, low=-2.0, high=2.0, step=0.1, group="involution")
    b_12: float = slider(0.8, low=-2.0, high=2.0, step=0.1, group="involution")


class Result(NamedTuple):
    """A (2, 2) as used (the off-diagonal entry cut where it would be indefinite: `cut`), its eigenvalues (2,), falling,
    and Q with det 1; roots: the symmetric one and the other one, with the products that they must give; B (2, 2): the
    involution with b_11 and b_12.

    factors (3, 2, 2): Q', the scaling, Q of the chosen matrix (A or its root), in the order in which they act.
    """

    A: Array
    cut: bool
    values: Array
    Q: Array
    symmetric: Array
    other: Array
    product: Array
    factors: Array
    B: Array


def compute(p: Params, progress: Progress) -> Result:
    """Schur's decomposition, and roots made of it."""
    bound = float(np.sqrt(p.a_11 * p.a_22))
    off = float(np.clip(p.a_12, -bound, bound))
    A = np.array([[p.a_11, off], [off, p.a_22]])
    spectrum = schur(A)
    values, Q = np.maximum(spectrum.values, 0.0), spectrum.Q.copy()
    if np.linalg.det(Q) < 0.0:
        Q[:, 1] = -Q[:, 1]
    Q = Q if Q[0, 0] >= 0.0 else -Q                       # a turn of at most 90 degrees
    symmetric = sqrt_psd(A)
    other, product = _other(p, A, values, Q, symmetric)
    scale = np.diag(values if p.of_root == "matrix" else np.sqrt(values))
    return Result(A, off != p.a_12, values, Q, symmetric, other, product, np.array([Q.T, scale, Q]),
                  involution(p.b_11, p.b_12))


def _other(p: Params, A: Array, values: Array, Q: Array, symmetric: Array) -> tuple[Array, Array]:
    """Another root C, and C C' or C C, whichever is A."""
    if p.other == "signs":
        C = Q @ np.diag([1.0, -1.0] * np.sqrt(values)) @ Q.T
        return C, C @ C
    if p.other == "cholesky":
        C = cholesky_psd(A)
    else:
        angle = np.deg2rad(p.turn_deg)
        C = symmetric @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return C, C @ C.T


def involution(a: float, b: float) -> Array:
    """B = [a b; c -a] with a^2 + b c = 1; for b = 0 it is diag(1, -1).  MAT exercise 1.6."""
    if abs(b) < 1e-9:
        return np.diag([1.0, -1.0])
    return np.array([[a, b], [(1.0 - a * a) / b, -a]])


def timeline(p: Params) -> Timeline:
    """Each factor in PER_STAGE small steps; one picture where nothing is stepped."""
    return Timeline(3 * PER_STAGE, start=3 * PER_STAGE) if p.picture == "factors" else Timeline(0)


def unused(p: Params) -> Collection[str]:
    """Controls of the other pictures."""
    matrix, roots, reflection = {"a_11", "a_22", "a_12"}, {"other", "turn_deg"}, {"b_11", "b_12"}
    match p.picture:
        case "factors":
            return roots | reflection
        case "roots":
            return reflection | {"of_root"} | (set() if p.other == "turned" else {"turn_deg"})
        case _:
            return matrix | roots | {"of_root"}


EXAMPLE_7 = {"a_11": 16.0, "a_22": 52.0, "a_12": 24.0}

LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused, budget_s=0.2,
    refs=("MAT 1.1", "MAT (1.2)", "MAT Theorem 1", "MAT Definition 1", "MAT exercises 1.5, 1.6"),
    presets={
        "rotate, scale, rotate back": {},
        "halfway": {"step": 12},
        "exercise 1.5: the root": {"of_root": "root"},
        "two roots of exercise 1.5": {"picture": "roots"},
        "Example 7: two roots": {"picture": "roots", **EXAMPLE_7},
        "a root turned": {"picture": "roots", "other": "turned"},
        "another sign": {"picture": "roots", "other": "signs"},
        "a singular matrix": {"a_11": 4.0, "a_22": 4.0, "a_12": 4.0},
        "exercise 1.6: a reflection": {"picture": "involution"},
        "a slanting reflection": {"picture": "involution", "b_11": 2.0, "b_12": 2.0},
    },
)
