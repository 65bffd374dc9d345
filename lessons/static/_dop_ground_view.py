"""The plane: DOP as a map or a surface, and a cloud of estimates in the ellipse that the linearisation promises."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import mahalanobis_squared
from core.level_lines import level_lines
from core.levels import chi_square_level
from core.types import Array, Gaussian
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import HeatMap, Item, Label, LevelEllipse, Orbit, Plane, Points, Segments, Stations, Surface
from lessons.static._dop_ground import AXIS, CUT, HIGH, LOW, Ground
from lessons.static._dop_ground_figures import equations, figures, readouts

if TYPE_CHECKING:
    from lessons.static.dilution_of_precision import Params

PROBABILITY = 0.95
LEVELS = np.array([1.5, 2.0, 3.0, 5.0])      # of DOP, drawn as lines
RISE = 9.0                                   # metres of the surface's height for a DOP of 1
WIDEST_M = 400.0                             # half the side of the largest picture of a cloud


def view(p: "Params", r: Ground, at: Moment, batch: int) -> View:
    """The experiments up to this step."""
    n = at.step * batch
    x = r.spread.x[:n][r.spread.found[:n]]
    law = None if r.V is None else Gaussian(np.array(p.user), r.V)
    if p.mode == "surface":
        scene, camera = _surface(p, r), Orbit((50.0, 50.0, 25.0), 150.0, azimuth_deg=-60.0, elevation_deg=38.0)
    elif p.mode == "map":
        scene, camera = _map(p, r, x, law), Plane((LOW, HIGH), (LOW, HIGH), "x, east (m)", "y, north (m)")
    else:
        scene, camera = _cloud(p, r, x, law)
    return View(scene=scene, camera=camera, figures=figures(p, r, x), readouts=readouts(p, r, n, x, share(law, x)),
                equations=equations(p, r, x), caption="" if p.mode == "surface" else f"{n:,} experiments",
                note=_note(p, r, n, len(x)))


def share(law: Gaussian | None, x: Array) -> float | None:
    """The share of the estimates in the promised 95 % ellipse."""
    if law is None or not len(x):
        return None
    return float((mahalanobis_squared(law, x) <= chi_square_level(PROBABILITY, 2)).mean())


def _note(p: "Params", r: Ground, n: int, found: int) -> str:
    if r.V is None:
        return "J'J is singular here: the user stands at a station or on the line through both. DOP is infinite."
    if found < n and p.mode != "surface":
        return f"{n - found} of {n:,} experiments are left out: Gauss-Newton does not converge (no circles meet)."
    return ""


def _map(p: "Params", r: Ground, x: Array, law: Gaussian | None) -> list[Item]:
    """DOP as colour with its level lines, and the experiments at the user."""
    colour = np.log(r.map.T)                              # the same colour for the same DOP whatever the map
    items: list[Item] = [
        HeatMap("dop", AXIS, AXIS, colour, role="warning", opacity=0.75 * float(colour.max()) / np.log(CUT)),
        *_level_lines(p, r),
    ]
    if len(x):
        items.append(Points("estimates", x, role="monte_carlo", size=3.5, fade=0.1))
    if law is not None and np.sqrt(np.trace(law.cov)) < HIGH - LOW:
        items.append(LevelEllipse("promised", law, role="posterior", probability=PROBABILITY, cross=False))
    return [*items, *_stations(r, np.array([[LOW, LOW], [HIGH, HIGH]]))]


def _level_lines(p: "Params", r: Ground) -> list[Item]:
    """Lines of equal DOP, each with its number where it is farthest from everything that already stands there."""
    taken = np.vstack([r.stations, [p.user]])
    lines, names = [], []
    for level in LEVELS:
        pairs = level_lines(AXIS, AXIS, r.map.T, float(level))
        lines.append(pairs)
        places = pairs[:, 0][((pairs[:, 0] > LOW + 12.0) & (pairs[:, 0] < HIGH - 12.0)).all(axis=1)]
        if len(places):
            distances = np.linalg.norm(places[:, None] - taken, axis=-1).min(axis=1)
            taken = np.vstack([taken, places[distances.argmax()]])
            names.append(Label(f"level_{level:g}", f"{level:g}", taken[-1], 0.85))
    drawn = np.concatenate(lines)
    return [Segments("levels", drawn, role="reference", width=1.5), *names] if len(drawn) else []


def _surface(p: "Params", r: Ground) -> list[Item]:
    """min(DOP, 10) over the plane, and a pole at the user."""
    rim = np.array([[LOW, LOW, 0.0], [HIGH, LOW, 0.0], [HIGH, HIGH, 0.0], [LOW, HIGH, 0.0], [LOW, LOW, 0.0]])
    scale = np.array([[[HIGH, LOW, 0.0], [HIGH, LOW, RISE * CUT]]])
    here = RISE * min(float(r.dop.gdop), CUT)
    return [
        Segments("rim", np.concatenate([np.stack([rim[:-1], rim[1:]], axis=1), scale]), role="muted", width=1.5),
        Surface("dop_surface", AXIS, AXIS, RISE * r.map.T, role="warning", opacity=0.6, contours=8),
        Segments("pole", np.array([[[*p.user, 0.0], [*p.user, here]]]), role="truth", width=4.0),
        Label("pole_name", f"DOP {_number(r)}", (*p.user, here + 14.0)),
        *(Label(f"height_{k}", f"{k}", (HIGH + 9.0, LOW, RISE * k), 0.8) for k in (2, 4, 6, 8)),
        Label("height_title", "DOP 10", (HIGH, LOW, RISE * CUT + 9.0), 0.85),
        Label("x_title", "x, east: −50 to 150 m", (50.0, LOW - 22.0, 0.0), 0.9),
        Label("y_title", "y, north: −50 to 150 m", (HIGH + 30.0, 50.0, 0.0), 0.9),
        *_stations(r, np.array([[-np.inf] * 2, [np.inf] * 2])),
    ]


def _number(r: Ground) -> str:
    dop = float(r.dop.gdop)
    return f"{dop:.2f}" if dop < CUT else "10 or more"


def _cloud(p: "Params", r: Ground, x: Array, law: Gaussian | None) -> tuple[list[Item], Plane]:
    """The surroundings of the user; the picture is as large as all experiments of this noise need."""
    user = np.array(p.user)
    every = r.spread.x[r.spread.found]
    half = 1.0
    if len(every):
        half = 1.25 * float(np.quantile(np.abs(every - user).max(axis=1), 0.985))
    laws = [V for V in ((r.V, r.unweighted) if p.third else (r.V,)) if V is not None]
    if laws:
        widest = max(float(np.diagonal(V).max()) for V in laws)
        half = max(half, 1.15 * float(np.sqrt(chi_square_level(PROBABILITY, 2) * widest)))
    half = min(max(half, 0.1), WIDEST_M)
    box = np.array([user - half, user + half])
    shown = x[((x >= box[0]) & (x <= box[1])).all(axis=1)]
    items: list[Item] = []
    if len(shown):
        items.append(Points("estimates", shown, role="monte_carlo", size=4.5, fade=0.1))
    if law is not None and np.sqrt(np.trace(law.cov)) < 2.0 * WIDEST_M:
        if p.third:
            items += [LevelEllipse("unweighted", Gaussian(user, r.unweighted), role="prior", probability=PROBABILITY,
                                   dashed=True, cross=False, width=3.0),
                      LevelEllipse("best", Gaussian(user, r.best), role="likelihood", probability=PROBABILITY,
                                   cross=False, width=3.0)]
        items.append(LevelEllipse("promised", law, role="posterior", probability=PROBABILITY, cross=False, width=4.0))
    if len(x) > 2:
        sampled = Gaussian(x.mean(axis=0), np.cov(x.T))
        if np.sqrt(np.trace(sampled.cov)) < 2.0 * WIDEST_M:
            items.append(LevelEllipse("sampled", sampled, role="measurement", probability=PROBABILITY, dashed=True))
    items.append(Points("truth", [user], role="truth", size=12, shape="diamond"))
    camera = Plane((float(box[0, 0]), float(box[1, 0])), (float(box[0, 1]), float(box[1, 1])), "x, east (m)",
                   "y, north (m)")
    return [*items, *_stations(r, box)], camera


def _stations(r: Ground, box: Array) -> list[Item]:
    inside = [k for k, s in enumerate(r.stations) if ((s >= box[0]) & (s <= box[1])).all()]
    if not inside:
        return []
    return [Stations("stations", r.stations[inside], tuple(f"S{k + 1}" for k in inside))]
