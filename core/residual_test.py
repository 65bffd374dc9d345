"""Finding measurements that are garbage from the residuals.  MAT 2.3.2 note 1.

p = h(x) - y at the weighted least-squares solution x.  With only as many measurements as unknowns p vanishes and
nothing can be found; with one more garbage can be noticed, with two more (in general) also located.  `core.robust` has
an estimate that garbage hardly moves.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.gauss_newton import Solution, gauss_newton
from core.levels import chi_square_level, chi_square_probability
from core.linalg import cholesky_positive, solve_vectors
from core.orthogonal import factorise, inverse_gram
from core.types import Array, Sensor


class ResidualTest(NamedTuple):
    """The tests of one solution, or of many (...).

    residuals p (..., m); statistic p'R^-1 p (...) against level (chi-square with `freedom` = m - n degrees of
    freedom); p_value (...); passed (...).  cov (..., m, m): V(p) = R - J (J'R^-1 J)^-1 J'.  normalised (..., m): of
    variance 1 each; the garbage is the largest, `suspect` (...), if it exceeds each_level.  redundancy (..., m): the
    share of an error in y_i that shows in p_i; 0: nothing checks y_i.
    """

    residuals: Array
    statistic: Array
    level: float
    freedom: int
    p_value: Array
    passed: Array
    cov: Array
    normalised: Array
    each_level: float
    suspect: Array
    redundancy: Array


class LeaveOneOut(NamedTuple):
    """x (m, n): the solution without row i; statistics (m,): its p'R^-1 p; converged (m,)."""

    x: Array
    statistics: Array
    converged: Array


class Exclusion(NamedTuple):
    """kept (m,): the rows used; x (n,); passed: the last test; tests and excluded: one test, one row each round."""

    kept: Array
    x: Array
    passed: bool
    excluded: tuple[int, ...]
    tests: tuple[ResidualTest, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """y = h_keep(x) + v: some rows of a sensor.  keep (m,) of truth values.  ValueError if none is kept.

    >>> from core.sensors import Position
    >>> Rows(Position(2, [3.0, 4.0]), [False, True]).R.tolist()
    [[16.0]]
    """

    sensor: Sensor
    keep: Array
    R: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        keep = np.array(self.keep)
        if keep.dtype != bool or keep.shape != (len(self.sensor.R),) or not keep.any():
            raise ValueError(f"keep: expected {len(self.sensor.R)} truth values, not all false, got {self.keep}")
        keep.setflags(write=False)
        object.__setattr__(self, "keep", keep)
        R = np.array(self.sensor.R[np.ix_(keep, keep)])
        R.setflags(write=False)
        object.__setattr__(self, "R", R)

    def h(self, x: Array) -> Array:
        """The kept rows of h, shape (..., m)."""
        return self.sensor.h(x)[..., self.keep]

    def jacobian(self, x: Array) -> Array:
        """The kept rows of the Jacobian, shape (..., m, n)."""
        return self.sensor.jacobian(x)[..., self.keep, :]

    def innovation(self, y: Array, y_hat: Array) -> Array:
        """The sensor's own innovation of the kept rows, shape (..., m)."""
        y, y_hat = np.broadcast_arrays(y, y_hat)
        full, full_hat = np.zeros((2, *y.shape[:-1], len(self.keep)))
        full[..., self.keep], full_hat[..., self.keep] = y, y_hat
        return self.sensor.innovation(full, full_hat)[..., self.keep]

    def log_likelihood(self, y: Array, x: Array) -> Array:
        """log N(y; h(x), R), shape (...).  ValueError for a singular R."""
        L = cholesky_positive("R", self.R)
        z = solve_vectors(L, self.innovation(finite("y", y, len(self.R)), self.h(x)))
        return -np.log(np.sqrt(2.0 * np.pi) * np.diagonal(L)).sum() - 0.5 * np.square(z).sum(axis=-1)


def residual_test(sensor: Sensor, y: ArrayLike, x: ArrayLike, *, false_alarm: float = 0.01) -> ResidualTest:
    """p'R^-1 p ~ chi2(m - n);  w_i = e_i'R^-1 p / sqrt(e_i'R^-1 V(p) R^-1 e_i) ~ N(0, 1)  if nothing is garbage.

    y (..., m); x (..., n) the *weighted* least-squares solution for it; false_alarm: the probability that good
    measurements fail the first test, and at most that of the largest |w_i| exceeding its level.  For a diagonal R
    w_i = p_i / sqrt(V_ii).  w_i is 0 where nothing checks y_i.  ValueError for m <= n, a Jacobian with dependent
    columns, or a false alarm rate outside (0, 1).  MAT 2.3.2 note 1; Baarda 1968.

    >>> from core.sensors import Linear
    >>> test = residual_test(Linear([[1.0], [1.0], [1.0]], 1.0), [0.0, 0.0, 6.0], [2.0])
    >>> float(test.statistic.round(9)), bool(test.passed), int(test.suspect), test.normalised.round(3).tolist()
    (24.0, False, 2, [2.449, 2.449, -4.899])
    """
    x, m = finite("x", x, None), len(sensor.R)
    n = x.shape[-1]
    if m <= n:
        raise ValueError(f"y: expected more measurements than unknowns ({n}), else nothing is left to test, got {m}")
    _rate(false_alarm)
    L, R = cholesky_positive("R", sensor.R), sensor.R
    p = -sensor.innovation(finite("y", y, m), sensor.h(x))
    J = sensor.jacobian(x)
    factors = factorise(np.linalg.solve(L, J))
    if factors.singular.any():
        raise ValueError("x: expected a point where the measurements determine every component of the state, got a "
                         "Jacobian with dependent columns")
    statistic = np.square(solve_vectors(L, p)).sum(axis=-1)
    V = R - J @ inverse_gram(factors) @ J.mT
    Ri_V = np.linalg.solve(R, V)                          # its diagonal are the redundancy numbers, with sum m - n
    redundancy = np.diagonal(Ri_V, axis1=-2, axis2=-1)
    information = np.diagonal(np.linalg.solve(R, Ri_V.mT), axis1=-2, axis2=-1)         # of R^-1 V R^-1
    checked = information > 1e-10 * np.diagonal(np.linalg.solve(R, np.eye(m)))
    w = np.where(checked, solve_vectors(R, p) / np.sqrt(np.where(checked, information, 1.0)), 0.0)
    level = float(chi_square_level(1.0 - false_alarm, m - n))
    return ResidualTest(
        p, statistic, level, m - n, 1.0 - chi_square_probability(statistic, m - n), statistic <= level, V, w,
        float(np.sqrt(chi_square_level(1.0 - false_alarm / m, 1))), np.abs(w).argmax(axis=-1), redundancy,
    )


def smallest_detectable(
    sensor: Sensor, x: ArrayLike, *, false_alarm: float = 0.01, missed: float = 0.2
) -> Array:
    """b_i = (z(1 - false_alarm / 2) + z(1 - missed)) / sqrt(e_i'R^-1 V(p) R^-1 e_i).

    The error of y_i that |w_i| > z(1 - false_alarm / 2) finds with probability 1 - missed; infinite where nothing
    checks y_i.  x (..., n) -> (..., m) in the measurement's units.  Errors as in `residual_test`.  Baarda 1968.
    """
    _rate(false_alarm), _rate(missed)
    from scipy.special import ndtri

    test = residual_test(sensor, sensor.h(finite("x", x, None)), x, false_alarm=false_alarm)
    information = np.diagonal(np.linalg.solve(sensor.R, np.linalg.solve(sensor.R, test.cov).mT), axis1=-2, axis2=-1)
    checked = information > 1e-10 * np.diagonal(np.linalg.solve(sensor.R, np.eye(len(sensor.R))))
    size = ndtri(1.0 - 0.5 * false_alarm) + ndtri(1.0 - missed)
    return np.where(checked, size / np.sqrt(np.where(checked, information, 1.0)), np.inf)


def leave_one_out(sensor: Sensor, y: ArrayLike, x0: ArrayLike, **options: float | None) -> LeaveOneOut:
    """x_(i) = argmin sum_{j != i} ((h_j(x) - y_j) / sigma_j)^2  for every i: what happens without each measurement.

    y (m,), x0 (n,), m > n; options as in `core.gauss_newton.gauss_newton`.  Garbage is the row without which the
    statistic falls most; for a linear sensor it falls by w_i^2.  ValueError for m <= n and as there.
    """
    y = finite("y", y, len(sensor.R))
    if len(y) <= np.shape(x0)[-1]:
        raise ValueError(f"y: expected more measurements than unknowns ({np.shape(x0)[-1]}), got {len(y)}")
    fixes = [_solve(sensor, y, ~one, x0, options) for one in np.eye(len(y), dtype=bool)]
    return LeaveOneOut(np.array([f.x for f in fixes]), np.array([f.costs[-1] for f in fixes]),
                       np.array([f.converged for f in fixes]))


def exclude(
    sensor: Sensor, y: ArrayLike, x0: ArrayLike, *, false_alarm: float = 0.01, **options: float | None
) -> Exclusion:
    """Leaves out the row with the largest |w_i| and solves again, until the residuals pass or too few rows are left.

    y (m,), x0 (n,); options as in `core.gauss_newton.gauss_newton`.  passed is False if the rows ran out: m = n rows
    fit anything and prove nothing, so the last m = n + 1 are kept.  ValueError for m <= n and as there.

    >>> from core.sensors import Linear
    >>> exclude(Linear(np.ones((4, 1)), 1.0), [0.0, 0.5, 9.0, -0.5], [0.0]).kept.tolist()
    [True, True, False, True]
    """
    y = finite("y", y, len(sensor.R))
    kept, excluded, tests = np.ones(len(y), dtype=bool), [], []
    while True:
        fix = _solve(sensor, y, kept, x0, options)
        tests.append(residual_test(Rows(sensor, kept), y[kept], fix.x, false_alarm=false_alarm))
        if tests[-1].passed or tests[-1].freedom == 1:
            return Exclusion(kept, fix.x, bool(tests[-1].passed), tuple(excluded), tuple(tests))
        excluded.append(int(np.flatnonzero(kept)[tests[-1].suspect]))
        kept = kept.copy()
        kept[excluded[-1]] = False


def _solve(sensor: Sensor, y: Array, kept: Array, x0: ArrayLike, options: dict[str, float | None]) -> Solution:
    return gauss_newton(Rows(sensor, kept), y[kept], x0, **options)


def _rate(value: float) -> None:
    if not 0.0 < value < 1.0:
        raise ValueError(f"expected a probability between 0 and 1, got {value}")
