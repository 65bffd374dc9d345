"""Bayes' rule for one number: a place on a line with normal errors, or a number of which only the sign is measured."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core import grid
from core.gaussian import product
from core.importance import truncated_normal
from core.sensors import Position
from core.types import Array, Gaussian

if TYPE_CHECKING:
    from lessons.static.bayes import Params

CELLS = 500                               # of a bounded prior; its ends lie on edges
OPEN_CELLS = 4000                         # of an unbounded one
SPREADS_M = np.geomspace(0.3, 100.0, 60)  # of the prior, in the plots of the way to a flat one


class Step(NamedTuple):
    """One update.  prior None: flat on the whole line, which is no law; posterior None: nothing measured yet."""

    prior: grid.GridDensity | None
    log_likelihood: Array        # (n,) at the cells
    posterior: grid.GridDensity | None
    evidence: float | None       # p(y); None without a proper prior
    y: float | None
    possible: bool               # False: the prior excludes y, which is then ignored
    mean: float
    var: float
    mode: float


class Wide(NamedTuple):
    """Posterior mean and standard deviation after y1, (2, SPREADS), for wider and wider priors about one centre."""

    uniform: Array
    normal: Array
    spread_m: float | None       # of the prior shown


class Line(NamedTuple):
    """Step 0 is the prior; shown: the piece of the line in the picture."""

    axis: Array
    steps: tuple[Step, ...]
    shown: tuple[float, float]
    wide: Wide | None


def line(p: "Params") -> Line:
    """Three updates, each from the posterior of the one before."""
    prior, axis, shown = _sign_prior() if p.problem == "sign" else _prior(p)
    ys = (p.s1, p.s2, p.s3) if p.problem == "sign" else (p.y1, p.y2, p.y3)
    steps = [_described(Step(prior, np.zeros(len(axis)), prior, None, None, True, 0.0, 0.0, 0.0))]
    for y in ys:
        before = steps[-1].posterior
        log_likelihood = log_density_of(p, y, axis)
        flat = before is None
        try:
            done = grid.multiply(grid.uniform(axis) if before is None else before, log_likelihood)
        except ValueError:                # no x is left that allows this y
            steps.append(steps[-1]._replace(prior=before, log_likelihood=log_likelihood, y=y, evidence=0.0,
                                            possible=False))
            continue
        steps.append(_described(Step(before, log_likelihood, done.posterior, None if flat else done.evidence, y, True,
                                     0.0, 0.0, 0.0)))
    return Line(axis, tuple(steps), shown, _wide(p) if p.problem == "line" else None)


def log_density_of(p: "Params", y: float, x: Array) -> Array:
    """log p(y | x) at the places x."""
    if p.problem == "sign":               # exercise 2.14
        with np.errstate(divide="ignore"):
            return np.log(0.5 * (1.0 + np.where(x >= 0.0, y, -y)))
    return Position(1, p.sigma_m).log_likelihood(np.array([y]), x[:, None])


def _described(step: Step) -> Step:
    """The step with mean, variance and mode of its posterior."""
    if step.posterior is None:
        return step
    law = grid.moments(step.posterior)
    return step._replace(mean=float(law.mean[0]), var=float(law.cov[0, 0]), mode=float(grid.mode(step.posterior)[0]))


def _bounded(low: float, high: float) -> Array:
    """Cells of [low, high], and one more at each end, in which the density is 0."""
    step = (high - low) / CELLS
    return grid.cells(low - step, high + step, CELLS + 2)


def _sign_prior() -> tuple[grid.GridDensity, Array, tuple[float, float]]:
    axis = _bounded(-1.0, 1.0)
    return grid.GridDensity(axis, (np.abs(axis) < 1.0).astype(float)), axis, (-1.3, 1.3)


def _prior(p: "Params") -> tuple[grid.GridDensity | None, Array, tuple[float, float]]:
    ys, L = np.array([p.y1, p.y2, p.y3]), p.length_m
    law = Gaussian(np.array([p.mean_m]), np.array([[p.prior_sigma_m**2]]))
    if p.prior in ("uniform", "rough"):
        axis = _bounded(0.0, L)
        inside = (axis > 0.0) & (axis < L)
        logs = -0.5 * np.square((axis - p.mean_m) / p.prior_sigma_m) if p.prior == "rough" else np.zeros(len(axis))
        prior = grid.GridDensity.from_log_weights(axis, np.where(inside, logs, -np.inf))
        return prior, axis, (-0.25 * L, 1.25 * L)
    low, high = ys.min() - 8.0 * p.sigma_m, ys.max() + 8.0 * p.sigma_m
    shown = ys[0] - 4.0 * p.sigma_m, ys[0] + 4.0 * p.sigma_m
    if p.prior == "flat":
        return None, grid.cells(low, high, OPEN_CELLS), (float(shown[0]), float(shown[1]))
    low, high = min(low, p.mean_m - 8.0 * p.prior_sigma_m), max(high, p.mean_m + 8.0 * p.prior_sigma_m)
    axis = grid.cells(low, high, OPEN_CELLS)
    ends = p.mean_m - 3.5 * p.prior_sigma_m, p.mean_m + 3.5 * p.prior_sigma_m
    return grid.from_gaussian(law, (axis,)), axis, (float(min(shown[0], ends[0])), float(max(shown[1], ends[1])))


def _wide(p: "Params") -> Wide:
    """The posterior after y1 for a uniform and a normal prior of the same centre and standard deviation."""
    centre = 0.5 * p.length_m if p.prior == "uniform" else p.mean_m
    half = np.sqrt(3.0) * SPREADS_M
    low, high = (centre - half - p.y1) / p.sigma_m, (centre + half - p.y1) / p.sigma_m
    far = (low > 30.0) | (high < -30.0)   # all probability sits at the nearer end
    t = truncated_normal(np.where(far, -1.0, low), np.where(far, 1.0, high))
    mean = np.where(far, np.clip(p.y1, centre - half, centre + half), p.y1 + p.sigma_m * t.mean)
    sd = np.where(far, 0.0, p.sigma_m * np.sqrt(t.variance))
    normal = product(Gaussian(np.full((len(half), 1), centre), SPREADS_M[:, None, None] ** 2),
                     Gaussian(np.array([p.y1]), np.array([[p.sigma_m**2]]))).gaussian      # exercise 2.13
    spread = {"uniform": p.length_m / np.sqrt(12.0), "normal": p.prior_sigma_m}.get(p.prior)
    return Wide(np.array([mean, sd]), np.array([normal.mean[:, 0], np.sqrt(normal.cov[:, 0, 0])]), spread)
