"""How the IMM is drawn: the map with the estimated track in the colour of the likeliest model, and a magnifier."""

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.types import Array, Gaussian
from lessons.filtering._cutting import cut
from lessons.filtering._models_figures import equations, figures, readouts
from lessons.filtering._models_magnifier import close_up
from lessons.filtering._models_roles import NAMES, ROLES
from lessons.filtering._models_world import CHANGES, STEPS, Result
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import Panel
from lessons.kit.scene import Item, Label, LevelEllipse, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    from lessons.filtering.multiple_models import Params

STAGES = ("mix", "predict", "update", "probabilities", "combine")
COMBINE = len(STAGES) - 1


class Place(NamedTuple):
    """box (2, 2): the corners of the map; the magnifier stands above it; pixel: its length in metres."""

    box: Array
    corner: Array
    size: Array
    reach: Array                 # half the magnified region, in metres
    pixel: float
    camera: Plane


def place(p: "Params", r: Result) -> Place:
    """Map and magnifier of one width, one above the other; the same for all moments."""
    margin = 2.2 * p.sigma_m + 0.08 * float(np.ptp(r.truth[:, :2], axis=0).max()) + 1.0
    low, high = r.truth[:, :2].min(axis=0) - margin, r.truth[:, :2].max(axis=0) + margin
    width = max(float(high[0] - low[0]), 1.1 * float(high[1] - low[1]))
    low[0], high[0] = (low[0] + high[0] - width) / 2, (low[0] + high[0] + width) / 2
    size = np.array([width, 0.62 * width])
    pixel = width / 620.0
    corner = np.array([low[0], high[1] + 105.0 * pixel])
    tall = 2.0 * p.sigma_m + p.speed_mps
    camera = Plane((float(low[0]) - 55.0 * pixel, float(high[0]) + 15.0 * pixel),
                   (float(low[1]) - 55.0 * pixel, float(corner[1] + size[1]) + 75.0 * pixel), axes=False)
    return Place(np.array([low, high]), corner, size, np.array([tall / 0.62, tall]), pixel, camera)


def view(p: "Params", r: Result, at: Moment) -> View:
    """The track up to this second, and this second's bank up to this stage."""
    k, here = at.step, place(p, r)
    return View(
        scene=_scene(p, r, at, here), camera=here.camera, figures=figures(r, k), readouts=readouts(r, k),
        equations=equations(r, at), caption=f"t = {k} s",
    )


def _scene(p: "Params", r: Result, at: Moment, here: Place) -> list[Item]:
    k = at.step
    known = k if at.stage == COMBINE or k == 0 else k - 1
    low, high = here.box
    centre = (r.combined.mean[k, :2] + r.combined.mean[max(k - 1, 0), :2]) / 2
    glass = Panel(centre - here.reach, centre + here.reach, here.corner, here.size)
    border = np.array([glass.low, (glass.high[0], glass.low[1]), glass.high, (glass.low[0], glass.high[1])])
    frame = Panel(low, high, low, high - low).axes("map", ("", "east (m)", "north (m)"), here.pixel)
    return [
        *(item for item in frame if item.name != "map_title"),
        *cut([*_map(p, r, k, known), Polyline("border", border, role="reference", width=1.5, closed=True)], here.box),
        *glass.axes("glass", ("magnified", "east (m)", "north (m)"), here.pixel),
        *close_up(r, at, glass, here.pixel, p.sigma_m),
    ]


def _map(p: "Params", r: Result, k: int, known: int) -> list[Item]:
    items: list[Item] = [Polyline("truth", r.truth[:, :2], role="truth", dashed=True), *_phases(p, r)]
    if k:
        items.append(Points("measured", r.y[:k], role="measurement", size=4.5, fade=0.45))
    if p.alone != "none":
        g = r.alone[("stand", "drive", "turn").index(p.alone)]
        items += [Polyline("alone", g.mean[:known + 1, :2], role="vector", width=1.8),
                  LevelEllipse("alone_now", Gaussian(g.mean[known], g.cov[known]), role="vector", width=2.5)]
    best = r.probabilities.argmax(axis=1)
    pairs = np.stack([r.combined.mean[:-1, :2], r.combined.mean[1:, :2]], axis=1)[:known]
    for j, name in enumerate(NAMES):
        mine = pairs[best[1:known + 1] == j]
        if len(mine):
            items.append(Segments(f"track_{name}", mine, role=ROLES[j], width=5))
    return [*items, LevelEllipse("imm_now", Gaussian(r.combined.mean[known], r.combined.cov[known]), role="mixture",
                                 width=3.5),
            Points("truth_now", r.truth[[k], :2], role="truth", size=13, shape="diamond")]


def _phases(p: "Params", r: Result) -> list[Item]:
    """What the truth does on each piece of the track, written at its right-hand side."""
    items: list[Item] = []
    for i, (a, b) in enumerate(itertools.pairwise((0, *CHANGES, STEPS))):
        middle = (a + b + 1) // 2
        ahead = r.truth[min(middle + 1, STEPS), :2] - r.truth[max(middle - 1, 0), :2]
        if not ahead.any():                                  # standing: as before, or as afterwards
            ahead = (r.truth[b + 2, :2] - r.truth[b, :2]) if i == 0 else (r.truth[a, :2] - r.truth[a - 2, :2])
        right = np.array([ahead[1], -ahead[0]]) / max(float(np.linalg.norm(ahead)), 1e-9)
        gap = 1.2 * p.sigma_m + 0.02 * float(np.ptp(r.truth[:, :2], axis=0).max())
        items.append(Label(f"phase_{i}", NAMES[r.model[middle]], r.truth[middle, :2] + gap * right, 0.95))
    return items
