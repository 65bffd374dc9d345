"""Plots, numbers and formulas of the graph filter."""

from typing import TYPE_CHECKING

import numpy as np

from lessons.kit.equations import Equation
from lessons.kit.figures import chart, line, markers
from lessons.kit.lesson import Moment, Readout
from lessons.kit.roles import Role

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from lessons.indoor.graph_filter import Params, Result

ROLES: dict[str, Role] = {"tll": "pf", "equal": "mixture", "cvkf": "ekf", "cpkf": "grid"}
MOVE, WEIGH, ESTIMATE, RESAMPLE = range(4)


def figures(p: "Params", r: "Result", t: int) -> "dict[str, go.Figure]":
    time = r.truth.time_s
    scans = time[~np.isnan(r.scans).all(axis=1)]
    error = chart(*(line(name, time, e, ROLES[name], width=2.5 if name == "tll" else 1.6)
                    for name, e in r.errors.items()), cursor=t, marks=scans if len(scans) < 40 else ())
    share = 100.0 * (np.arange(len(time)) + 0.5) / len(time)
    law = chart(*(line(name, np.sort(e), share, ROLES[name]) for name, e in r.errors.items()), y_range=(0.0, 101.0))
    n_eff = chart(line("n_eff", time, r.tll.n_eff, "pf"),
                  line("limit", time[[0, -1]], [p.threshold * p.particles] * 2, "warning", dash=True),
                  markers("resampled", time[r.tll.resampled], r.tll.n_eff[r.tll.resampled], "vector"),
                  cursor=t, log_y=True)
    spread = chart(line("error", time, r.errors["tll"], "pf"), line("spread", time, r.tll.spread, "likelihood"),
                   cursor=t)
    return {"error": error, "law": law, "n_eff": n_eff, "spread": spread}


def readouts(p: "Params", r: "Result", t: int) -> list[Readout]:
    found = [Readout("error_now", float(r.errors["tll"][t]), "m"), Readout("n_eff", float(r.tll.n_eff[t]))]
    found += [Readout(f"mean_{name}", s.mean, "m") for name, s in r.summary.items()]
    s = r.summary["tll"]
    return [*found, Readout("median", s.median, "m"), Readout("p95", s.p95, "m"),
            Readout("right_floor", 100.0 * r.right["tll"], "%")]


def equations(p: "Params", r: "Result", at: Moment) -> list[Equation]:
    t, tll, stage = at.step, r.tll, at.stage
    heard = int((~np.isnan(r.scans[t])).sum())
    estimate = tll.xy_m[t]
    limit = p.threshold * p.particles
    sign = r"\geq" if tll.n_eff[t] >= limit else "<"
    return [
        Equation("move", (r"x_t^i \sim P_x(x_t\,|\,x_{t-1}^i)",), current=stage == MOVE),
        Equation("weigh", (r"w_t^i \propto w_{t-1}^i\,P_y(y_t\,|\,x_t^i),\quad \text{transmitters heard:}\;",
                           *((float(heard),) if stage >= WEIGH else ())), current=stage == WEIGH, digits=2),
        Equation("n_eff", (r"N_{eff} = 1/\sum (w_t^i)^2 =", *((float(tll.n_eff[t]),) if stage >= WEIGH else ())),
                 current=stage == WEIGH),
        Equation("estimate", (r"\hat x_t =", *((estimate,) if stage >= ESTIMATE else ())), current=stage == ESTIMATE),
        Equation("truth", (r"x_t =", r.truth.position_m[t, :2])),
        Equation("resample", ((rf"N_{{eff}} {sign}", float(limit), r":\;\text{resampled}" if tll.resampled[t] else
                               r":\;\text{kept}") if stage >= RESAMPLE else (r"N_{eff} < N_{limit}\,?",)),
                 current=stage == RESAMPLE),
    ]
