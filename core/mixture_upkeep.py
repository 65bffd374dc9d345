"""When to split, prune and merge the components of a filter."""

from dataclasses import dataclass

import numpy as np

from core.mixture_law import Mixture, checked
from core.mixture_reduction import Reduction, check_limits, merge, prune
from core.mixture_split import Division, check_parts, longest_axis, split


@dataclass(frozen=True, slots=True)
class Upkeep:
    """How a filter keeps its mixture in order: split before each measurement, prune and merge after it.

    split_beyond: components whose longest semi-axis (1 sigma, among the state's `entries`, None: all) exceeds this
    length are split into `parts` of `ratio` times the length (see `split`), up to three times (None: never).
    prune_below: a weight.  merge_below: nats, see `merge`.  max_components: a prune leaves the 2 max_components
    heaviest, and the cheapest merges bring them down to this number.  ValueError for limits outside their ranges.
    """

    split_beyond: float | None = None
    entries: tuple[int, ...] | None = None
    parts: int = 3
    ratio: float | None = None
    prune_below: float = 1e-4
    merge_below: float = 1e-3
    max_components: int = 16

    def __post_init__(self) -> None:
        if self.split_beyond is not None and not 0.0 < self.split_beyond < np.inf:
            raise ValueError(f"split_beyond: expected a positive length or None, got {self.split_beyond}")
        check_parts(self.parts, self.ratio)
        check_limits("prune_below", self.prune_below, self.max_components)
        check_limits("merge_below", self.merge_below, self.max_components)

    def divide(self, m: Mixture) -> Division:
        """m with its wide components split; `parent` counts in m."""
        m = checked("m", m)
        parent, after = np.broadcast_to(np.arange(m.means.shape[-2]), m.log_weights.shape), m
        for _ in range(3 if self.split_beyond is not None else 0):
            wide = longest_axis(after, self.entries) > self.split_beyond
            if not (wide & after.alive).any():
                break
            part = split(after, wide, parts=self.parts, ratio=self.ratio, entries=self.entries)
            parent, after = np.take_along_axis(parent, part.parent, axis=-1), part.after
        return Division(m, after, parent)

    def reduce(self, m: Mixture) -> tuple[Reduction, Reduction]:
        """m pruned, and the rest merged."""
        pruned = prune(m, self.prune_below, 2 * self.max_components)
        return pruned, merge(pruned.after, self.merge_below, self.max_components)


DEFAULT = Upkeep()
