"""One second of the IMM under the magnifier: mixed starts, predictions, updates, probabilities, the combined law."""

import numpy as np

from core.levels import chi_square_level, ellipse
from core.mixture import Mixture
from core.types import Array, Gaussian
from lessons.filtering._cutting import cut
from lessons.filtering._models_roles import NAMES, ROLES
from lessons.filtering._models_world import Result
from lessons.kit.lesson import Moment
from lessons.kit.panels import Panel
from lessons.kit.scene import Item, Label, LevelEllipse, Points, Polyline, Segments

MIX, PREDICT, UPDATE, PROBABILITIES, COMBINE = range(5)
PROBABILITY = 0.68
LEVEL = float(chi_square_level(PROBABILITY, 2))
LINKED = 0.01                             # mixing probabilities below this are not drawn


def close_up(r: Result, at: Moment, glass: Panel, pixel: float, sigma_m: float) -> list[Item]:
    """This second's bank at this stage; 68 % ellipses whose width follows the probability of the model."""
    k, i, stage = at.step, at.step - 1, at.stage if at.step else MIX
    items: list[Item] = [Polyline("glass_track", glass.place(r.truth[:, :2]), role="truth", width=1.5, fade=0.4)]
    if k == 0:
        bank = r.initial
    else:
        before, mixed, prior, posterior = (Mixture(*(a[i] for a in m)) for m in (
            r.imm.before, r.imm.mixed, r.imm.update.prior, r.imm.posterior))
        match stage:
            case 0:                                          # MIX
                bank = mixed
                items += [*_bank("before", before, glass, faint=True), *_mixing(r.imm.mixing[i], before, mixed, glass)]
            case 1:                                          # PREDICT
                bank = prior
                items += [*_bank("before", mixed, glass, faint=True), *_moves(mixed, prior, glass)]
            case 2:                                          # UPDATE: moved, the probabilities are still the old ones
                bank = Mixture(prior.log_weights, *posterior[1:])
                items += [*_bank("before", prior, glass, faint=True), *_moves(prior, posterior, glass)]
            case _:
                bank = posterior
        if stage >= UPDATE:
            items += _measured(r.y[i], sigma_m, glass)
    items += [*_bank("bank", bank, glass), *_numbers(bank, glass, pixel)]
    if stage == COMBINE:
        law = glass.law(Gaussian(r.combined.mean[k, :2], r.combined.cov[k, :2, :2]))
        items.append(LevelEllipse("glass_imm", law, role="mixture", width=4, filled=True))
    items.append(Points("glass_truth", glass.place(r.truth[[k], :2]), role="truth", size=14, shape="diamond"))
    return cut(items, np.array([glass.corner, glass.corner + glass.size]))


def _rims(m: Mixture, glass: Panel) -> Array:
    """(3, points, 2) in the scene."""
    return glass.place(ellipse(Gaussian(m.means[:, :2], m.covs[:, :2, :2]), LEVEL, 61))


def _bank(name: str, m: Mixture, glass: Panel, faint: bool = False) -> list[Item]:
    """An ellipse and its centre for each model: thin before the stage, in the width of the probability after it."""
    centres = glass.place(m.means[:, :2])
    items: list[Item] = []
    for model, role, rim, centre, w in zip(NAMES, ROLES, _rims(m, glass), centres, m.weights, strict=True):
        width = 1.2 if faint else 1.0 + 5.0 * float(w)
        items.append(Polyline(f"{name}_{model}", rim, role=role, width=width, fade=0.5 if faint else 0.0))
        items.append(Points(f"{name}_{model}_centre", centre[None], role=role, size=6 if faint else 6 + 8 * float(w),
                            fade=0.5 if faint else 0.0))
    return items


def _mixing(mixing: Array, before: Mixture, mixed: Mixture, glass: Panel) -> list[Item]:
    """From each filter before to the starts that it has a share in, in the colour of where it comes from."""
    a, b = glass.place(before.means[:, :2]), glass.place(mixed.means[:, :2])
    return [Segments(f"mixing_{NAMES[i]}_{NAMES[j]}", np.stack([a[i], b[j]])[None], role=ROLES[i],
                     width=1.0 + 3.0 * float(mixing[i, j]))
            for i in range(3) for j in range(3) if mixing[i, j] > LINKED and not np.allclose(a[i], b[j])]


def _moves(before: Mixture, after: Mixture, glass: Panel) -> list[Item]:
    a, b = glass.place(before.means[:, :2]), glass.place(after.means[:, :2])
    return [Segments(f"move_{model}", np.stack([a[j], b[j]])[None], role=ROLES[j], width=2.0)
            for j, model in enumerate(NAMES) if not np.allclose(a[j], b[j])]


def _measured(y: Array, sigma_m: float, glass: Panel) -> list[Item]:
    """The measured position and the 68 % circle of its noise."""
    rim = ellipse(Gaussian(y, sigma_m**2 * np.eye(2)), LEVEL, 61)
    return [Polyline("glass_noise", glass.place(rim), role="measurement", width=1.5),
            Points("glass_measured", glass.place(y[None]), role="measurement", size=11)]


def _numbers(m: Mixture, glass: Panel, pixel: float) -> list[Item]:
    """The probabilities of the models, in the upper left corner."""
    x, top = float(glass.corner[0]) + 12 * pixel, float((glass.corner + glass.size)[1]) - 16 * pixel
    return [Label(f"probability_{model}", f"{model} {100 * w:.0f} %", (x, top - 24 * j * pixel), 1.0, "left")
            for j, (model, w) in enumerate(zip(NAMES, m.weights, strict=True))]
