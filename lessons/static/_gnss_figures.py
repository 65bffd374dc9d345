"""Plots, numbers and formulas of one epoch's fix."""

from typing import TYPE_CHECKING

import numpy as np

from core.frames import geodetic_from_ecef
from core.gnss.ephemeris import SPEED_OF_LIGHT
from lessons.kit.equations import Equation
from lessons.kit.figures import bars, chart, line
from lessons.kit.lesson import Moment, Readout
from lessons.static._sky_plot import sky_plot

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.static.gnss_fix import Params, Result

SATELLITES, CORRECTIONS, BANCROFT, NEWTON = range(4)
MOST_ROWS = 8                        # of a live column of numbers


def figures(p: "Params", r: "Result", k: int) -> "dict[str, go.Figure]":
    f = r.fixes[k]
    epochs = np.arange(1, len(r.fixes) + 1)
    found = {"errors": chart(*(line(key, epochs, r.enu[:, i], role) for i, (key, role) in enumerate(
        (("east", "axis_x"), ("north", "axis_y"), ("up", "axis_z")))), cursor=k + 1)}
    if isinstance(f, str):
        return found
    low = np.column_stack([np.linspace(0.0, 360.0, 73), np.full(73, p.mask_deg)])
    groups = {"used": (np.flatnonzero(f.used), "measurement"), "masked": (np.flatnonzero(~f.used), "reference")}
    sky = sky_plot(np.rad2deg(f.azimuth_rad), np.rad2deg(f.elevation_rad), f.names, groups, low)
    order = np.argsort(-f.elevation_rad)
    x = np.arange(1, len(order) + 1)
    residual = chart(bars("residual", x, np.nan_to_num(f.residuals_m[order]), "innovation"))
    delay = chart(bars("ionosphere", x - 0.18, f.ionosphere_m[order], "likelihood", width=0.34),
                  bars("troposphere", x + 0.18, f.troposphere_m[order], "prior", width=0.34))
    for figure in (residual, delay):
        figure.layout.xaxis.tickvals, figure.layout.xaxis.ticktext = x.tolist(), [f.names[i] for i in order]
    return {"sky": sky, **found, "residuals": residual, "delays": delay}


def readouts(r: "Result", k: int) -> list[Readout]:
    f = r.fixes[k]
    if isinstance(f, str):
        return [Readout("used", 0)]
    lat, lon, h = (float(v) for v in geodetic_from_ecef(f.x[:3]))
    east, north, up = r.enu[k]
    good = r.enu[np.isfinite(r.enu).all(axis=1)]
    flat = np.sqrt(np.square(good[:, :2]).sum(axis=1))
    return [
        Readout("used", int(f.used.sum())), Readout("latitude", np.rad2deg(lat), "°", 8),
        Readout("longitude", np.rad2deg(lon), "°", 8), Readout("height", h, "m", 5), Readout("east", east, "m", 3),
        Readout("north", north, "m", 3), Readout("up", up, "m", 3),
        Readout("median_flat", float(np.median(flat)), "m", 3),
        Readout("median_all", float(np.median(np.sqrt(np.square(good).sum(axis=1)))), "m", 3),
        Readout("clock", 1e6 * float(f.x[3]) / SPEED_OF_LIGHT, "µs", 6), Readout("pdop", f.dop.pdop, "", 3),
        Readout("hdop", f.dop.hdop, "", 3), Readout("vdop", f.dop.vdop, "", 3),
    ]


def equations(r: "Result", at: Moment) -> list[Equation]:
    """The lines of the fix with the numbers of the first satellites."""
    f, stage = r.fixes[at.step], at.stage
    if isinstance(f, str):
        return []
    epoch = r.source.epochs[at.step]
    measured = dict(zip(epoch.names, epoch.pseudoranges_m, strict=True))
    few = slice(0, MOST_ROWS)
    rho = np.array([measured[n] for n in f.names])[few] / 1e3
    names = ",\\,".join(f.names[few])
    corrected = stage >= CORRECTIONS
    return [
        Equation("satellites", (r"\text{" + names.replace("\\,", " ") + r"}:\quad \rho =", rho), digits=8,
                 current=stage == SATELLITES),
        Equation("clock", (r"c\,dt =", *((f.clock_m[few] / 1e3,) if corrected else ())), digits=6,
                 current=stage == CORRECTIONS),
        Equation("ionosphere", (r"I =", *((f.ionosphere_m[few],) if corrected else ())), digits=3,
                 current=stage == CORRECTIONS),
        Equation("troposphere", (r"T =", *((f.troposphere_m[few],) if corrected else ())), digits=3,
                 current=stage == CORRECTIONS),
        Equation("bancroft", (r"[x;\, b] =", *((np.asarray(f.start.roots).T / 1e3,) if stage >= BANCROFT else ())),
                 digits=7, current=stage == BANCROFT),
        Equation("newton", (r"\hat x =", *((f.x[:3] / 1e3,) if stage >= NEWTON else ()), r"\quad \hat b =",
                            *((float(f.x[3]) / 1e3,) if stage >= NEWTON else ())), digits=8, current=stage == NEWTON),
        Equation("residuals", (r"\rho - |s - \hat x| - \hat b - \ldots =",
                               *((f.residuals_m[f.used][few],) if stage >= NEWTON else ())), digits=3,
                 current=stage == NEWTON),
    ]
