"""Formulas, readouts and plots of the lesson on measurement surfaces."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as plot
from lessons.kit.equations import Equation, Piece
from lessons.kit.lesson import Moment, Readout
from lessons.static._surfaces_model import RATE_ROLE, Row, truth_of, velocity_of

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.measurement_surfaces import Params, Result

TRUTH, MEASURE, SURFACE, MEET = range(4)
SUBSCRIPT = "₁₂₃₄"


def shown(row: Row, value: float) -> float:
    """Angles in degrees, everything else as it is."""
    return float(np.degrees(value)) if row.kind == "bearing" else value


def unit(row: Row) -> str:
    return {"bearing": "°", "rate": "m/s"}.get(row.kind, "m")


def caption(p: "Params", assumed_m: float, time_s: float) -> str:
    """Where the timeline stands, in words."""
    if p.first == "radar":
        return f"t = {time_s:.1f} s"
    if "pseudorange" in (p.first, p.second, p.third):
        return f"assumed clock bias {assumed_m:.0f} m, true {p.bias_m:g} m"
    return ""


def note(p: "Params", rows: list[Row], assumed_m: float) -> str:
    """What cannot be drawn, or measures nothing."""
    if "height" in (p.first, p.second, p.third) and p.space == "plane":
        return "A height measures nothing in the plane: choose the picture in space."
    for i, row in enumerate(rows):
        value = row.target(assumed_m)
        if row.kind in ("range", "pseudorange") and value <= 0.0:
            return f"y{SUBSCRIPT[i]} would be a negative distance: no place fits it."
        if row.kind == "difference" and abs(value) >= float(np.linalg.norm(row.stations[1] - row.stations[0])):
            return f"y{SUBSCRIPT[i]} is as large as the distance of both stations, or larger: no hyperbola fits it."
        if row.kind == "rate" and not _moves(row, value):
            return "The antenna and the user do not move fast enough against each other for this range rate."
    return ""


def _moves(row: Row, value: float) -> bool:
    speed = float(np.linalg.norm(row.sensor.velocity_mps - row.sensor.rate.velocities_mps[0]))
    return speed > 0.0 and abs(value) <= speed * (1.0 + 1e-12)


def readouts(p: "Params", r: "Result", rows: list[Row], assumed_m: float, common: Array) -> list[Readout]:
    """The measurements, how many equations and unknowns there are, and where the curves meet."""
    from lessons.static.measurement_surfaces import BIASES_M

    x = truth_of(p)
    found = [Readout(f"y_{i + 1}", shown(row, row.y), unit(row)) for i, row in enumerate(rows)]
    unknown = ["x₁", "x₂", "x₃"][:len(x)] + (["b"] if any(row.kind == "pseudorange" for row in rows) else [])
    found.append(Readout("count", f"{len(rows)} for {len(unknown)} unknowns ({', '.join(unknown)})"))
    if len(rows) >= len(x):
        near = float(np.linalg.norm(common - x, axis=-1).min()) if len(common) else None
        found += [Readout("common", str(len(common)) if len(common) else "none"),
                  Readout("near", None if near is None else round(near, 6), "m", 3)]
    if r.misfit_m is not None:
        found.append(Readout("misfit", round(float(np.interp(assumed_m, BIASES_M, r.misfit_m)), 9), "m", 3))
    return found


def equations(p: "Params", rows: list[Row], stage: int) -> list[Equation]:
    """y_i = h_i(x) + v_i with numbers, and the derivative of all rows at the true place."""
    found = []
    for i, row in enumerate(rows):
        k = i + 1
        exact, error = shown(row, row.exact), shown(row, row.y - row.exact)
        bias: tuple[Piece, ...] = ()
        if row.kind == "pseudorange":
            exact, bias = exact - p.bias_m, ("+", p.bias_m)
        name = r"\mathrm{" + {"m": "m", "m/s": "m/s"}.get(unit(row), "deg") + "}"
        numbers: tuple[Piece, ...] = ("=", exact, *bias, "+", error, "=", shown(row, row.y), rf"\ {name}")
        if stage < MEASURE:
            numbers = ("=", exact, *bias, rf"+\, v_{k}\ {name}")
        found.append(Equation(f"row_{k}", (rf"y_{k} = {_rule(row)} + v_{k}", *numbers),
                              current=stage in (TRUTH, MEASURE)))
    if rows:
        found.append(Equation("jacobian", (r"h'(\mathbf{x}) =", jacobian(p, rows)), current=stage == SURFACE))
    return found


def _rule(row: Row) -> str:
    """h of this row in LaTeX."""
    i = row.slot + 1
    s = rf"\mathbf{{s}}_{i}"
    match row.kind:
        case "x1" | "x2" | "height":
            return f"x_{('x1', 'x2', 'height').index(row.kind) + 1}"
        case "range":
            return rf"\|{s} - \mathbf{{x}}\|"
        case "pseudorange":
            return rf"\|{s} - \mathbf{{x}}\| + b"
        case "difference":
            return rf"\|{s} - \mathbf{{x}}\| - \|\mathbf{{s}}_{i % 3 + 1} - \mathbf{{x}}\|"
        case "bearing":
            return rf"\mathrm{{atan2}}(x_1 - s_{{{i}1}},\, x_2 - s_{{{i}2}})"
        case _:
            relative = rf"(\mathbf{{v}} - \dot{{\mathbf{{s}}}}_{i})"
            return rf"\frac{{(\mathbf{{x}} - {s})^T{relative}}}{{\|{s} - \mathbf{{x}}\|}}"


def jacobian(p: "Params", rows: list[Row]) -> Array:
    """Rows of h'(x) at the truth: position, then the clock bias or the velocity if something depends on it."""
    x = truth_of(p)
    J = np.vstack([row.sensor.jacobian(x) for row in rows])
    J = np.array([np.degrees(j) if row.kind == "bearing" else j for row, j in zip(rows, J, strict=True)])
    if any(row.kind == "pseudorange" for row in rows):
        J = np.column_stack([J, [1.0 * (row.kind == "pseudorange") for row in rows]])
    if any(row.kind == "rate" for row in rows):
        full = [row.sensor.rate.jacobian(np.concatenate([x, velocity_of(p, len(x))]))[0, len(x):]
                if row.kind == "rate" else np.zeros(len(x)) for row in rows]
        J = np.column_stack([J, full])
    return J


def figures(p: "Params", r: "Result", rows: list[Row], at: Moment, assumed_m: float,
            time_s: float) -> "dict[str, go.Figure]":
    """The first row along a line to the east; the misfit over the clock bias; what a radar sees while it turns."""
    from lessons.static.measurement_surfaces import BIASES_M, TIMES_S

    found = {}
    if r.misfit_m is not None:
        found["misfit"] = plot.chart(plot.line("misfit", BIASES_M, r.misfit_m, "posterior"), cursor=assumed_m,
                                     marks=(p.bias_m,))
    if r.radar is not None:
        for k, (name, role) in enumerate((("range_time", "measurement"), ("rate_time", RATE_ROLE))):
            found[name] = plot.chart(plot.line(name, TIMES_S, r.radar[:, k], role), cursor=time_s)
        found["velocity"] = _velocity(p, rows)
    if rows and rows[0].kind != "height":
        found["profile"] = _profile(p, rows[0], assumed_m)
    return found


def _profile(p: "Params", row: Row, assumed_m: float) -> "go.Figure":
    """h of the first measurement along the line through the user: east, or north where that changes nothing."""
    x = truth_of(p)
    axis = 1 if row.kind == "x2" else 0
    reach = 1.5 * max(*(float(np.linalg.norm(s - x)) for s in row.stations), 5.0) if len(row.stations) else 60.0
    along = np.linspace(x[axis] - reach, x[axis] + reach, 241)
    points = np.repeat(x[None], len(along), axis=0)
    points[:, axis] = along
    h, y = (shown(row, v) for v in (1.0, row.target(assumed_m)))
    values = np.asarray(row.sensor.h(points)[:, 0]) * h
    sigma, ends = shown(row, row.sigma), along[[0, -1]]
    return plot.chart(plot.band("band", ends, np.full(2, y - sigma), np.full(2, y + sigma), row.role),
                      plot.line("y", ends, np.full(2, y), row.role, dash=True),
                      plot.line("h", along, values, "truth"), cursor=float(x[axis]))


def _velocity(p: "Params", rows: list[Row]) -> "go.Figure":
    """The velocities that fit the first range rate at the true place: a straight line, with one sigma to each side."""
    row = next(row for row in rows if row.kind == "rate")
    x, v = truth_of(p), velocity_of(p, 2)
    away = (x - row.stations[0])[:2]
    size = float(np.linalg.norm(away))
    traces = [plot.markers("true", [v[0]], [v[1]], "truth", size=11, symbol="diamond")]
    if size > 0.0:
        g = row.sensor.rate.jacobian(np.concatenate([x, velocity_of(p, len(x))]))[0, len(x):][:2]
        speed = float(np.linalg.norm(g))
        if speed > 1e-9:
            across = np.array([-g[1], g[0]]) / speed
            foot = v + (row.y - row.exact) * g / speed**2
            for key, off, dash in (("low", -row.sigma, True), ("fits", 0.0, False), ("high", row.sigma, True)):
                ends = foot + off * g / speed**2 + np.array([[-6.0], [6.0]]) * across
                traces.append(plot.line(key, ends[:, 0], ends[:, 1], RATE_ROLE, dash=dash, width=1.5 if dash else 2.5))
    return plot.chart(*traces, equal=True)

