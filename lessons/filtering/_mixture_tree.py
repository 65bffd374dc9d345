"""The family tree of one step beside the map: a column for each stage, the height of a dot is its component's x2."""

import numpy as np

from core.mixture import Mixture, MixtureStep
from core.types import Array
from lessons.filtering._mixture_drawing import shown
from lessons.kit.scene import Item, Label, Particles, Points, Segments

HEADS = ("before", "predict", "split", "update", "weigh", "merge")
Generation = tuple[Mixture, Array]        # components, and the number of each one's parent in the generation before


def moved(step: MixtureStep) -> Mixture:
    """The components after their own updates, still with the weights from before the measurement."""
    return Mixture(step.division.after.log_weights, *step.update.posterior[1:])


def survivors(step: MixtureStep) -> Array:
    """For each component that was weighed the number of the one that goes on with it; -1: dropped."""
    return np.where(step.pruned.owner >= 0, step.merged.owner[step.pruned.owner], -1)


def tree(old: Mixture, step: MixtureStep, stage: int, x: tuple[float, float], y: tuple[float, float]) -> list[Item]:
    """Columns up to this stage between the x limits; what lies beyond the y limits is left out."""
    divided = step.division
    same = np.arange(len(divided.after.means))
    generations: list[Generation] = [
        (old, np.zeros(0, dtype=int)), (step.predicted, np.arange(len(old.means))), (divided.after, divided.parent),
        (moved(step), same), (step.update.posterior, same)]
    at = np.linspace(*x, len(HEADS))
    heights, weights, lines = [], [], []
    for column, (m, parent) in enumerate(generations[:stage + 2]):
        chosen = shown(m)
        heights.append(np.column_stack([np.full(len(chosen), at[column]), m.means[chosen, 1]]))
        weights.append(m.weights[chosen])
        if column:
            lines.append(_lines(at[column - 1:column + 1], generations[column - 1][0], parent[chosen], m, chosen))
    gone = np.zeros((0, 2))
    if stage + 2 > len(generations):
        m, after, owner = step.update.posterior, step.posterior, survivors(step)
        parents = shown(m)
        kept = parents[owner[parents] >= 0]
        heights.append(np.column_stack([np.full(len(after.means), at[-1]), after.means[:, 1]]))
        weights.append(after.weights)
        lines.append(_lines(at[-2:], m, kept, after, owner[kept]))
        lost = parents[owner[parents] < 0]
        gone = np.column_stack([np.full(len(lost), at[-2]), m.means[lost, 1]])
    dots, w = np.vstack(heights), np.concatenate(weights)
    inside = (dots[:, 1] >= y[0]) & (dots[:, 1] <= y[1])
    items: list[Item] = []
    for name, some, role, width in (("tree_past", lines[:-1], "reference", 1.2), ("tree_now", lines[-1:], "vector", 2)):
        pairs = np.vstack([np.zeros((0, 2, 2)), *some])
        pairs = pairs[((pairs[..., 1] >= y[0]) & (pairs[..., 1] <= y[1])).all(axis=1)]
        if len(pairs):
            items.append(Segments(name, pairs, role=role, width=width))
    gone = gone[(gone[:, 1] >= y[0]) & (gone[:, 1] <= y[1])]
    if len(gone):
        items.append(Points("tree_dropped", gone, role="warning", size=9))
    return [*items, Particles("tree", dots[inside], w[inside], role="mixture", size=7.0),
            *(Label(f"tree_{head}", head, (x, y[1] + 0.02 * (y[1] - y[0])), 0.85, "bottom")
              for x, head in zip(at, HEADS[:len(lines) + 1], strict=False))]


def _lines(x: Array, before: Mixture, parent: Array, after: Mixture, child: Array) -> Array:
    """Segments (n, 2, 2) from parents in one column to children in the next."""
    ends = np.stack([before.means[parent, 1], after.means[child, 1]], axis=1)
    return np.stack([np.broadcast_to(x, ends.shape), ends], axis=2)
