"""Example 19 drawn: ring by ring to the exact posterior, then the linearised ellipse and the user's own estimate."""

from typing import TYPE_CHECKING

import numpy as np

from core.grid import GridDensity
from core.types import Array, Gaussian
from lessons.kit.lesson import Moment, View
from lessons.kit.roles import Role
from lessons.kit.scene import Arrow, HeatMap, Item, Label, LevelEllipse, Plane, Points, Segments, Stations
from lessons.static._bayes_plane import PROBABILITY
from lessons.static._bayes_plane_figures import equations, figures, readouts

if TYPE_CHECKING:
    from lessons.static._bayes_plane import Plane2D
    from lessons.static.bayes import Params

PRIOR, LIKELIHOOD, POSTERIOR, ESTIMATE = range(4)


def view(p: "Params", r: "Plane2D", at: Moment) -> View:
    """The update by range k, up to its stage; step 0 has only the flat prior."""
    k, stage = at.step, at.stage if at.step else PRIOR
    (x0, y0), (x1, y1) = r.box
    caption = "before any measurement" if not k else f"range {k} of 3: y = {r.steps[k - 1].y[-1]:.1f} m"
    if stage == ESTIMATE and r.steps[k - 1].linear is not None:
        exact, linear = (float(np.sqrt(np.trace(g.cov))) for g in (r.steps[k - 1].law, r.steps[k - 1].linear))
        caption = f"{k} ranges: ± {exact:.2f} m rms, linearised ± {linear:.2f} m"
    return View(scene=_scene(p, r, k, stage), camera=Plane((float(x0), float(x1)), (float(y0), float(y1))),
                figures=figures(p, r, k), readouts=readouts(p, r, k), equations=equations(p, r, k, stage),
                caption=caption, note=_note(r, k, stage))


def _note(r: "Plane2D", k: int, stage: int) -> str:
    if not k or (k == 1 and stage == PRIOR):
        return "The flat prior says nothing: every point of the plane is as good as any other."
    step = r.steps[k - 1]
    if stage == ESTIMATE and step.linear is None:
        return "JᵀJ is singular here: linearised, these ranges leave a whole line of positions."
    if stage == ESTIMATE and step.inside < 0.55:
        return f"The linearised 68 % ellipse holds {100 * step.inside:.0f} % of the exact posterior."
    return ""


def _scene(p: "Params", r: "Plane2D", k: int, stage: int) -> list[Item]:
    items: list[Item] = []
    if k > 1 and stage < POSTERIOR:
        items += _map("prior", r.steps[k - 2].exact, "prior", r.box)
    if k and stage == LIKELIHOOD:
        items.append(HeatMap("likelihood", *r.axes, r.steps[k - 1].ring.T, role="likelihood", opacity=0.6))
    if k and stage >= POSTERIOR:
        items += _map("posterior", r.steps[k - 1].exact, "posterior", r.box)
    items += _known(p, r)
    if not k or stage < POSTERIOR:
        return items
    step = r.steps[k - 1]
    if (np.sqrt(np.diagonal(step.law.cov)) < 0.5 * (r.box[1] - r.box[0])).all():
        items.append(LevelEllipse("mean", step.law, role="posterior", probability=PROBABILITY, width=3.5))
    if stage >= ESTIMATE:
        if step.linear is not None:
            unshifted = Gaussian(np.array(p.truth), step.linear.cov)
            items += [LevelEllipse("unshifted", unshifted, role="reference", probability=PROBABILITY, width=2.0,
                                   dashed=True, cross=False),
                      LevelEllipse("linear", step.linear, role="linearised", probability=PROBABILITY, width=4.0,
                                   dashed=True),
                      Arrow("shift", p.truth, step.linear.mean, role="linearised", width=3.0)]
        items.append(Segments("mine", np.array([[step.law.mean, p.guess]]), role="handle", width=2.5))
    return items


def _map(name: str, density: GridDensity, role: Role, box: Array) -> list[Item]:
    """What lies in the box, in blocks of 2 x 2 cells if there are many: enough for the eye."""
    inside = [np.flatnonzero((axis >= low) & (axis <= high)) for axis, (low, high) in
              zip(density.axes, box.T, strict=True)]
    if min(map(len, inside)) < 4:
        return []
    (i, j), block = inside, 2 if min(map(len, inside)) > 60 else 1
    i, j = i[:len(i) // block * block], j[:len(j) // block * block]
    x, y = (axis[index].reshape(-1, block).mean(axis=1) for axis, index in zip(density.axes, (i, j), strict=True))
    values = density.weights[np.ix_(i, j)].reshape(len(x), block, len(y), block).sum(axis=(1, 3))
    return [HeatMap(name, x, y, values.T, role=role, opacity=0.85)]


def _known(p: "Params", r: "Plane2D") -> list[Item]:
    """The truth, and the stations that are in the picture."""
    stations = np.array([p.station_1, p.station_2, p.station_3])
    seen = [i for i, s in enumerate(stations) if ((s >= r.box[0]) & (s <= r.box[1])).all()]
    side = 0.02 * float(r.box[1, 0] - r.box[0, 0])
    items: list[Item] = [Points("truth", [p.truth], role="truth", size=13, shape="diamond"),
                         Label("truth_name", "truth", np.array(p.truth) - np.array([side, 0.0]), 0.9, "right")]
    if seen:
        items.append(Stations("stations", stations[seen], tuple(f"S{i + 1}" for i in seen)))
    return items
