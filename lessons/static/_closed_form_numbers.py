"""Formulas and readouts of the closed-form lesson; lengths in its unit, 1000 km or 1 m."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout

if TYPE_CHECKING:
    from lessons.static.closed_form import Params, Result

MEASURE, SQUARE, LINE, ROOTS, TESTS = range(5)


def quadratic(r: "Result", k: int) -> tuple[float, float, float]:
    """a (per unit squared), b, c (unit squared) of experiment k."""
    a, b, c = (float(v) for v in r.fix.quadratic[k])
    return a * r.problem.unit_m**2, b, c / r.problem.unit_m**2


def lambdas(r: "Result", k: int) -> Array:
    """Both solutions (2,) in units squared; NaN where there is none."""
    return r.fix.lambdas[k] / r.problem.unit_m**2


def reasons(r: "Result", k: int, i: int) -> str:
    """What the tests say of root i of experiment k."""
    if not np.isfinite(r.fix.roots[k, i]).all():
        return "does not exist"
    if not r.fix.sign_ok[k, i]:
        return "rejected: yᵢ − b < 0" if r.fix.radius_ok[k, i] else "rejected by both tests"
    return "admissible" if r.fix.radius_ok[k, i] else "rejected: too far out"


def equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    """The derivation of Example 15, or of exercise 2.8, with the numbers of this experiment."""
    globe, unit, k = p.mode == "globe", r.problem.unit_m, at.step
    y = r.y[k] / unit
    lines: list[tuple[str, int, tuple[Piece, ...], tuple[Piece, ...]]] = [
        ("measured", MEASURE, (r"\|\mathbf{s}_i - \mathbf{x}\| + b = y_i" if globe else
                               r"\|\mathbf{s}_i - \mathbf{x}\| = y_i",), (r",\quad \mathbf{y} =", y))]
    rules = _rules(globe)
    if r.fix is None:
        return [Equation(*lines[0][:1], (*lines[0][2], *lines[0][3]), current=at.stage == MEASURE),
                *(Equation(name, (rule,)) for name, (_, rule) in rules.items())]
    s = r.problem.stations_m / unit - r.fix.origin[k] / unit
    A = np.column_stack([2.0 * s, -2.0 * y]) if globe else 2.0 * s
    a, b, c = quadratic(r, k)
    first, second = lambdas(r, k)
    n = s.shape[1]
    numbers: dict[str, tuple[Piece, ...]] = {
        "square": (), "quadratic": (),
        "matrix": ("=", A),
        "right": ("=", np.square(s).sum(axis=1) - np.square(y)),
        "p": ("=", r.fix.p[k] * unit),
        "q": ("=", r.fix.q[k] / unit),
        "alpha": ("=", a), "beta": ("=", b), "gamma": ("=", c),
        "discriminant": ("=", b * b - 4.0 * a * c),
        "lambdas": (r",\quad \lambda_1 =", first, r",\ \lambda_2 =", second) if np.isfinite([first, second]).all()
        else (),
    }
    for i in (0, 1):
        root = r.fix.roots[k, i] / unit
        exists = np.isfinite(root).all()
        numbers[f"root_{i + 1}"] = ("=", root) if exists else ()
        if globe:
            numbers[f"sign_{i + 1}"] = ("=", y - root[n]) if exists else ()
            numbers[f"radius_{i + 1}"] = ("=", float(np.linalg.norm(root[:n]))) if exists else ()
        else:
            numbers[f"residual_{i + 1}"] = ("=", r.fix.residuals[k, i]) if exists else ()
    lines += [(name, stage, (rule,), numbers[name]) for name, (stage, rule) in rules.items()]
    return [Equation(name, (*formula, *value) if stage <= at.stage else formula, current=stage == at.stage)
            for name, stage, formula, value in lines]


def _rules(globe: bool) -> dict[str, tuple[int, str]]:
    """Stage and LaTeX of every line after the first."""
    z = r"[\mathbf{x};\,b]" if globe else r"\mathbf{x}"
    D = "D" if globe else ""
    row = r"2\mathbf{s}_i^T,\ -2y_i" if globe else r"2\mathbf{s}_i^T"
    found = {
        "square": (SQUARE, rf"A{z} = \mathbf{{1}}\lambda + \mathbf{{r}}"),
        "matrix": (SQUARE, rf"A = [\,{row}\,]"),
        "right": (SQUARE, r"r_i = \|\mathbf{s}_i\|^2 - y_i^2"),
        "p": (LINE, r"\mathbf{p} = A^\dagger\mathbf{1}"),
        "q": (LINE, r"\mathbf{q} = A^\dagger\mathbf{r}"),
        "quadratic": (ROOTS, r"\alpha\lambda^2 + \beta\lambda + \gamma = 0"),
        "alpha": (ROOTS, rf"\alpha = \mathbf{{p}}^T{D}\mathbf{{p}}"),
        "beta": (ROOTS, rf"\beta = 2\mathbf{{p}}^T{D}\mathbf{{q}} - 1"),
        "gamma": (ROOTS, rf"\gamma = \mathbf{{q}}^T{D}\mathbf{{q}}"),
        "discriminant": (ROOTS, r"\beta^2 - 4\alpha\gamma"),
        "lambdas": (ROOTS, r"\lambda = \frac{-\beta \pm \sqrt{\beta^2 - 4\alpha\gamma}}{2\alpha}"),
        "root_1": (ROOTS, rf"{z}_1 = \mathbf{{p}}\lambda_1 + \mathbf{{q}}"),
        "root_2": (ROOTS, rf"{z}_2 = \mathbf{{p}}\lambda_2 + \mathbf{{q}}"),
    }
    for i in (1, 2):
        if globe:
            found[f"sign_{i}"] = (TESTS, rf"y_i - b_{i}")
            found[f"radius_{i}"] = (TESTS, rf"\|\mathbf{{x}}_{i}\|")
        else:
            found[f"residual_{i}"] = (TESTS, rf"\|\mathbf{{s}}_i - \mathbf{{x}}_{i}\| - y_i")
    return found


def readouts(p: "Params", r: "Result", at: Moment) -> list[Readout]:
    """Both roots, what becomes of them, and the errors of both methods."""
    k, n = at.step, r.problem.stations_m.shape[1]
    unit2 = "Mm²" if p.mode == "globe" else "m²"
    truth = r.problem.truth[:n]
    off = _finite(np.linalg.norm(r.chosen[k] - truth))
    other = _finite(np.linalg.norm(r.gauss_newton[k] - truth))
    found: list[Readout] = []
    if r.fix is not None:
        first, second = (_finite(v) for v in lambdas(r, k))
        found += [Readout("lambda_1", first, unit2), Readout("lambda_2", second, unit2),
                  Readout("verdict_1", reasons(r, k, 0)), Readout("verdict_2", reasons(r, k, 1))]
    found += [Readout("closed", off, "m", 3), Readout("iterated", other, "m", 3)]
    if k:
        both = np.isfinite(r.chosen[1:k + 1]).all(axis=1) & np.isfinite(r.gauss_newton[1:k + 1]).all(axis=1)
        for name, x in (("rms_closed", r.chosen), ("rms_iterated", r.gauss_newton)):
            e = np.linalg.norm(x[1:k + 1][both] - truth, axis=1)
            found.append(Readout(name, float(np.sqrt(np.mean(np.square(e)))) if both.any() else None, "m", 4))
        lacking = int(np.isnan(r.fix.roots[1:k + 1]).any(axis=(-1, -2)).sum()) if r.fix is not None else k
        found.append(Readout("without", f"{lacking} of {k}"))
    return found


def _finite(value: float | np.floating) -> float | None:
    return float(value) if np.isfinite(value) else None
