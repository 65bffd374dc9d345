"""The sky as a dome over the user, the sky plot, and the DOP numbers of the satellites that are seen."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import chi_square_level
from core.types import Array, Gaussian
from lessons.kit import figures as fig
from lessons.kit.equations import Equation
from lessons.kit.lesson import Moment, Readout, View
from lessons.kit.scene import Ellipsoid, Item, Label, Orbit, Points, Polyline, Segments, Walls
from lessons.static._dop_sky import AROUND_DEG, MASKS_DEG, NUMBERS, Sky, directions, geometry, numbers, solved
from lessons.static._sky_plot import sky_plot

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.dilution_of_precision import Params

ERRORS_M = 75.0                              # of error are drawn as long as the radius of the dome
STREET = 0.3                                 # half the street's width
PROBABILITY = 0.68
HUGE = 1e4                                   # as good as singular
CAP = 20.0                                   # larger DOP numbers are cut in the plots
NAMES = ("GDOP", "PDOP", "HDOP", "VDOP", "TDOP")


def view(p: "Params", r: Sky, at: Moment) -> View:
    """The first 4 + step satellites; only those above mask and walls are measured."""
    used = r.visible & (np.arange(p.count) < 4 + at.step)
    dops = numbers(r.u[used])
    return View(
        scene=[*_dome(), *_blocked(p, r), *_satellites(r, used, 4 + at.step), *_error(p, r.u[used], dops[0] < HUGE)],
        camera=Orbit((0.0, 0.0, 0.33), 1.25, azimuth_deg=-62.0, elevation_deg=24.0),
        figures=_figures(p, r, at, used, dops), readouts=_readouts(p, r, used, dops),
        equations=_equations(r.u[used], dops),
        caption=f"{used.sum()} of {min(p.count, 4 + at.step)} satellites are seen" + (
            f", GDOP = {dops[0]:.3g}" if dops[0] < HUGE else ""),
        note=_note(r, used, dops),
    )


def _note(r: Sky, used: Array, dops: Array) -> str:
    if used.sum() < 4:
        return f"{used.sum()} satellites are seen: four are needed for three coordinates and the clock."
    if not dops[0] < HUGE:
        return "J'J is singular: the satellites lie on one cone, and J has dependent columns. No solution."
    return ""


def _ring(elevation_deg: Array | float) -> Array:
    """The circle, or the curve, of these elevations all round."""
    return directions(AROUND_DEG, elevation_deg)


@cache
def _dome() -> tuple[Item, ...]:
    """The dome of radius 1 and the compass."""
    spokes = [directions(a, np.linspace(0.0, 90.0, 31)) for a in range(0, 360, 45)]
    pairs = np.concatenate([np.stack([s[:-1], s[1:]], axis=1) for s in spokes])
    return (
        Polyline("horizon", _ring(0.0), role="reference", width=2.5),
        *(Polyline(f"ring_{e}", _ring(e), role="muted", width=1.3, fade=0.3) for e in (30, 60)),
        Segments("spokes", pairs, role="muted", width=1.0, fade=0.5),
        *(Label(f"{e}_degrees", f"{e}°", directions(135.0, e), 0.8) for e in (30, 60)),
        *(Label(name, name, 1.09 * directions(a, 0.0), 1.1)
          for name, a in (("North", 0.0), ("East", 90.0), ("South", 180.0), ("West", 270.0))),
    )


def _blocked(p: "Params", r: Sky) -> list[Item]:
    """A curtain up to the elevation from which satellites are seen, and the walls that make it."""
    items: list[Item] = []
    if r.horizon_deg.max() > 0.0:
        edge = _ring(r.horizon_deg)
        items.append(Polyline("mask", edge, role="warning", width=2.5))
        if p.wall_deg == 0.0:
            pairs = np.stack([_ring(0.0), edge], axis=1)[::3]
            items.append(Segments("curtain", pairs, role="warning", width=1.0, fade=0.6))
    if p.wall_deg > 0.0:
        along = directions(p.street_deg, 0.0)[:2]
        across = np.array([along[1], -along[0]])
        feet = np.array([[s * STREET * across - 0.9 * along, s * STREET * across + 0.9 * along] for s in (-1, 1)])
        items.append(Walls("walls", feet, height=min(STREET * float(np.tan(np.radians(p.wall_deg))), 0.95)))
    return items


def _satellites(r: Sky, used: Array, shown: int) -> list[Item]:
    """Lines of sight: full to those that are measured, dashed to the others."""
    items: list[Item] = []
    if used.any():
        pairs = np.stack([np.zeros_like(r.u[used]), r.u[used]], axis=1)
        items.append(Segments("sight", pairs, role="measurement", width=3.0))
    for i, u in enumerate(r.u[:shown]):
        if not used[i] and u.any():
            items.append(Polyline(f"blocked_{i + 1}", [np.zeros(3), u], role="muted", width=2.0, dashed=True))
    state = ["" if used[i] else ", not seen" if i < shown else ", later" for i in range(len(r.u))]
    items += [Label(f"name_{i + 1}", f"{i + 1}{state[i]}", 1.1 * u) for i, u in enumerate(r.u) if u.any()]
    return items


def _error(p: "Params", u: Array, solvable: bool) -> list[Item]:
    """The user, and the ellipsoid of the position error if it fits under the dome."""
    items: list[Item] = [Points("user", [[0.0, 0.0, 0.0]], role="truth", size=12, shape="diamond")]
    law = _law(p, u) if solvable else None
    if law is not None:
        items.append(Ellipsoid("error", law, role="posterior", probability=PROBABILITY, opacity=0.45))
    return items


def _law(p: "Params", u: Array) -> Gaussian | None:
    """The law of the position error in scene units; None if its 68 % ellipsoid would be larger than the dome."""
    found = solved(u)
    assert found is not None
    cov = found.cofactor[:3, :3] * (p.sigma_m / ERRORS_M)**2
    longest = np.sqrt(float(np.linalg.eigvalsh(cov)[-1]) * float(chi_square_level(PROBABILITY, 3)))
    return Gaussian(np.zeros(3), cov) if longest < 1.2 else None


def _figures(p: "Params", r: Sky, at: Moment, used: Array, dops: Array) -> dict[str, "go.Figure"]:
    place = np.arange(5.0)
    bars = fig.chart(fig.bars("open", place - 0.2, _cut(r.open_sky), "muted", width=0.36),
                     fig.bars("now", place + 0.2, _cut(dops), "posterior", width=0.36))
    bars.layout.xaxis.update(tickvals=place, ticktext=NAMES)
    many = np.arange(4, p.count + 1)
    return {
        "sky": _sky_plot(r, used, 4 + at.step), "bars": bars,
        "growth": _curves(many, r.growth, float(4 + at.step), True),
        "mask": _curves(MASKS_DEG, r.by_mask, p.mask_deg, False),
    }


def _curves(x: Array, values: Array, cursor: float, markers: bool) -> "go.Figure":
    """PDOP, HDOP and VDOP where there is a solution."""
    traces = []
    for name, role in (("pdop", "posterior"), ("hdop", "likelihood"), ("vdop", "innovation")):
        column = values[:, NUMBERS.index(name)]
        good = np.isfinite(column)
        traces.append(fig.line(name, x[good], np.minimum(column[good], CAP), role, markers=markers))
    return fig.chart(*traces, cursor=cursor, x_range=(float(x[0]) - 0.3, max(float(x[-1]), cursor) + 0.3),
                     y_range=(0.0, _top(values)))


def _top(values: Array) -> float:
    """As far as the largest of the usual DOP numbers; lines of larger ones leave the plot."""
    shown = values[:, 1:4][values[:, 1:4] < 10.0]
    return 1.1 * float(shown.max()) if len(shown) else CAP


def _cut(dops: Array) -> Array:
    return np.where(dops < CAP, dops, 0.0)


def _sky_plot(r: Sky, used: Array, shown: int) -> "go.Figure":
    """The satellites seen, those that are hidden, and what hides them."""
    hidden = [i for i in range(min(shown, len(r.u))) if not used[i] and r.elevation_deg[i] > 0.0]
    return sky_plot(r.azimuth_deg, r.elevation_deg, [str(i + 1) for i in range(len(r.u))],
                    {"seen": (np.flatnonzero(used), "measurement"), "hidden": (hidden, "reference")},
                    np.column_stack([AROUND_DEG, r.horizon_deg]))


def _readouts(p: "Params", r: Sky, used: Array, dops: Array) -> list[Readout]:
    known = {name: float(v) if dops[0] < HUGE else None for name, v in zip(NUMBERS, dops, strict=True)}
    h, v = known["hdop"], known["vdop"]
    return [
        *(Readout(name, known[name]) for name in NUMBERS),
        Readout("seen", f"{used.sum()} of {len(r.u)}"),
        Readout("rms_h", None if h is None else p.sigma_m * h, "m", 3),
        Readout("sigma_v", None if v is None else p.sigma_m * v, "m", 3),
    ]


def _equations(u: Array, dops: Array) -> list[Equation]:
    J = r"J_i = [\,-u_E,\ -u_N,\ -u_U,\ 1\,],\quad J"
    rules = (("gdop", r"\mathrm{GDOP} = \sqrt{\mathrm{tr}\,(J^TJ)^{-1}}"),
             ("pdop", r"\mathrm{PDOP} = \sqrt{\mathrm{tr}\,[(J^TJ)^{-1}]_{1:3,1:3}}"),
             ("hdop", r"\mathrm{HDOP} = \sqrt{\mathrm{tr}\,[(J^TJ)^{-1}]_{1:2,1:2}}"),
             ("vdop", r"\mathrm{VDOP} = \sqrt{[(J^TJ)^{-1}]_{3,3}}"),
             ("tdop", r"\mathrm{TDOP} = \sqrt{[(J^TJ)^{-1}]_{4,4}}"))
    found = solved(u)
    if found is None or not dops[0] < HUGE:
        return [Equation("jacobian", (J, "=", geometry(u)) if len(u) else (J,)),
                Equation("cofactor", (r"(J^TJ)^{-1}",)), *(Equation(name, (rule,)) for name, rule in rules)]
    return [Equation("jacobian", (J, "=", geometry(u)), digits=3),
            Equation("cofactor", (r"(J^TJ)^{-1} =", found.cofactor), digits=3),
            *(Equation(name, (rule, "=", float(v))) for (name, rule), v in zip(rules, dops, strict=True))]
