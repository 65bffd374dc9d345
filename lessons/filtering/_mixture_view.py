"""How one step of the mixture filter is drawn: every component at every stage, and who descends from whom."""

from typing import TYPE_CHECKING

import numpy as np

from core.mixture import Mixture, MixtureStep
from core.types import Array, Gaussian
from lessons.filtering._cutting import cut
from lessons.filtering._mixture_drawing import MOST, PROBABILITY, heat, links, outlines, shown
from lessons.filtering._mixture_figures import equations, figures, readouts
from lessons.filtering._mixture_layout import layout
from lessons.filtering._mixture_model import Track, side
from lessons.filtering._mixture_tree import moved, survivors, tree
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import Item, Label, LevelEllipse, Particles, Points, Polyline

if TYPE_CHECKING:
    from lessons.filtering.mixture import Params

STAGES = ("predict", "split", "update", "reweight", "reduce", "estimate")
PREDICT, SPLIT, UPDATE, REWEIGHT, REDUCE, ESTIMATE = range(6)
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 241)
TIMES = (10, 20, 30)


def view(p: "Params", r: Track, at: Moment) -> View:
    """The track up to this step, and this step's components up to this stage."""
    return View(
        scene=_scene(p, r, at), camera=layout(p.zoom).camera, figures=figures(r, at), readouts=readouts(r, at.step),
        equations=equations(r, at), caption=f"t = {at.step} s", note=_note(p, r, at),
    )


def _note(p: "Params", r: Track, at: Moment) -> str:
    if not at.step:
        return ""
    box = layout(p.zoom).box
    if (r.truth[at.step] < box[0]).any() or (r.truth[at.step] > box[1]).any():
        return "The walk has left this picture; it crosses the line of the stations at t = 10 s."
    count = len(r.steps[at.step - 1].division.after.means)
    if count > MOST and SPLIT <= at.stage <= REDUCE:
        return f"The {MOST} heaviest of {count:,} components are drawn."
    if p.components == 1 and all(len(s.division.after.means) == 1 for s in r.steps):
        return "Nothing was ever split: this filter is the EKF, and their ellipses coincide."
    return ""


def _scene(p: "Params", r: Track, at: Moment) -> list[Item]:
    k, stage = at.step, at.stage if at.step else ESTIMATE
    place, step = layout(p.zoom), r.steps[at.step - 1] if at.step else None
    items: list[Item] = []
    if p.cloud:
        items.append(Particles("cloud", r.cloud[k], r.cloud_weights[k] if stage >= REWEIGHT else None, role="pf",
                               size=3.5))
    items += _density(r, step, stage)
    if k and UPDATE <= stage <= REWEIGHT:
        items += [Polyline(f"range_{i + 1}", s + d * np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)]),
                           role="measurement", width=2)
                  for i, (s, d) in enumerate(zip(r.stations, r.y[k - 1], strict=True))]
    if p.zoom != "crossing":
        items += _trail(r, k if stage >= ESTIMATE else k - 1)
    items += _surroundings(r, k)
    items += outlines("now", r.initial, "mixture") if step is None else _components(r, step, k, stage)
    if p.ekf:
        items += _ekf(r, k, k if stage >= UPDATE else k - 1)
    if stage == ESTIMATE:
        items += _shares(r, k, place.box)
    if place.tree is None:
        return [*items, *_signposts(place.box)]
    below, above = place.box[:, 1]
    grown = [] if step is None else tree(r.posterior(k - 1), step, stage, place.tree, (below, above))
    return [*place.frame(), *cut(items, place.box), *_signposts(place.box), *grown]


def _ekf(r: Track, k: int, known: int) -> list[Item]:
    """Track and ellipse after the last measurement that has been used."""
    now = LevelEllipse("ekf_now", Gaussian(r.ekf.mean[known], r.ekf.cov[known]), role="ekf", width=4,
                       probability=PROBABILITY, dashed=known < k)
    return [Polyline("ekf_track", r.ekf.mean[:known + 1, :2], role="ekf", width=2.5), now] if known > 0 else [now]


def _density(r: Track, step: MixtureStep | None, stage: int) -> list[Item]:
    """The whole law at this stage as a fill.  Moved but not yet weighed components are no law of interest."""
    if step is None:
        return [heat("density", r.initial, "mixture")]
    if stage <= SPLIT:
        return [heat("density_prior", step.predicted if stage == PREDICT else step.division.after, "prior")]
    return [] if stage == UPDATE else [heat("density", step.update.posterior if stage == REWEIGHT else step.posterior,
                                            "mixture")]


def _trail(r: Track, last: int) -> list[Item]:
    """Where the components of all earlier times were, the heavier the larger."""
    if last < 1:
        return []
    laws = [r.posterior(k) for k in range(last)]
    return [Particles("trail", np.vstack([m.means[:, :2] for m in laws]), np.concatenate([m.weights for m in laws]),
                      role="mixture", size=3.5)]


def _surroundings(r: Track, k: int) -> list[Item]:
    """The true track and its times."""
    items: list[Item] = [Polyline("truth", r.truth, role="truth", dashed=True),
                         Points("truth_now", r.truth[[k]], role="truth", size=13, shape="diamond")]
    passed = [t for t in TIMES if t < k]
    if passed:
        items += [Points("times", r.truth[passed], role="truth", size=6),
                  *(Label(f"time_{t}", f"{t} s", r.truth[t] + np.array([5.0, -3.0]), 0.85, "left") for t in passed)]
    return items


def _signposts(box: Array) -> list[Item]:
    """Where the stations are: left and right of the picture, on the line x2 = 0."""
    inset = 0.01 * (box[1, 0] - box[0, 0])
    return [Label("to_station_1", "← S1", (box[0, 0] + inset, 0.0), 1.0, "left"),
            Label("to_station_2", "S2 →", (box[1, 0] - inset, 0.0), 1.0, "right")]


def _components(r: Track, step: MixtureStep, k: int, stage: int) -> list[Item]:
    """Parents thin, children in widths by weight, and lines between them."""
    divided, updated = step.division, step.update
    match stage:
        case 0:                                               # PREDICT
            old = r.posterior(k - 1)
            return _family(old, step.predicted, np.arange(len(old.means)), "mixture", "prior")
        case 1:                                               # SPLIT
            return _family(step.predicted, divided.after, divided.parent, "reference", "prior")
        case 2:                                               # UPDATE: moved, the weights are still the old ones
            return _family(divided.after, moved(step), np.arange(len(divided.after.means)), "prior", "mixture")
        case 3:                                               # REWEIGHT
            return outlines("now", updated.posterior, "mixture")
        case 4:                                               # REDUCE
            return _merged(step)
        case _:
            return outlines("now", step.posterior, "mixture")


def _family(before: Mixture, after: Mixture, parent: Array, old_role: str, new_role: str) -> list[Item]:
    chosen = shown(after)
    return [*outlines("before", before, old_role, faint=True),
            *outlines("now", after, new_role),
            *links("links", before.means[parent[chosen], :2], after.means[chosen, :2], "vector")]


def _merged(step: MixtureStep) -> list[Item]:
    """What was dropped, and lines from the parents to the component that they became."""
    weighed = step.update.posterior
    survivor = survivors(step)
    chosen = shown(weighed)
    joined, gone = chosen[survivor[chosen] >= 0], chosen[survivor[chosen] < 0]
    items = outlines("before", weighed, "reference", faint=True)
    if len(gone):
        items.append(Points("dropped", weighed.means[gone, :2], role="warning", size=6))
    return [*items, *outlines("now", step.posterior, "mixture"),
            *links("links", weighed.means[joined, :2], step.posterior.means[survivor[joined], :2], "vector")]


def _shares(r: Track, k: int, box: Array) -> list[Item]:
    """The mean of everything, and how much of the probability is on each side of the stations' line."""
    mean = r.law.mean[k, :2]
    items: list[Item] = [Points("mean", mean[None], role="mixture", size=14, shape="square")]
    if np.sqrt(r.law.cov[k, 1, 1]) > 40.0:                    # far from both peaks
        items.append(Label("mean_name", "mean", mean + np.array([7.0, 0.0]), 0.9, "left"))
    posterior = r.posterior(k)
    for name, above, share in (("above", True, float(r.share[k])), ("below", False, 1.0 - float(r.share[k]))):
        half = side(posterior, above)
        if half is not None and share > 0.005:
            g = half[1]
            x, y, gap = float(g.mean[0]), float(g.mean[1]), 2.2 * float(np.sqrt(g.cov[0, 0])) + 6.0
            at, anchor = ((x - gap, y), "right") if x - gap > box[0, 0] + 20.0 else ((x + gap, y), "left")
            items.append(Label(f"share_{name}", f"{100 * share:.0f} %", at, 1.1, anchor))
    return items
