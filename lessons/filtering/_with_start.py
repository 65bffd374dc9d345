"""A filtered track over time 0..T: the posteriors of 1..T with the start in front."""

import numpy as np

from core.types import Gaussian


def with_start(start: Gaussian, g: Gaussian) -> Gaussian:
    """start with mean (n,), g with mean (T, n) -> mean (T + 1, n), cov (T + 1, n, n)."""
    return Gaussian(np.vstack([start.mean, g.mean]), np.concatenate([start.cov[None], g.cov]))
