"""What a walker's telephone hears on the way.  GBPF 6.1 (ours)."""

import numpy as np

from core.checks import finite
from core.indoor.routes import Truth
from core.indoor.signal import AccessPoints
from core.types import Array


def simulate_scans(
    truth: Truth, points: AccessPoints, rng: "np.random.Generator", *, interval_s: float = 1.0
) -> Array:
    """y_a = mu_a(x) + w,  w ~ N(0, sigma_a^2), every interval_s from t = 0 on; NaN between scans and below threshold.

    -> (T, m) in dBm, one row for each epoch of the truth: a scan belongs to the first epoch at or after its time.  With
    `points.freedom` the noise is Student t.  What is weaker than points.threshold_dbm is not heard.  ValueError for an
    interval that is not positive.
    """
    if not float(finite("interval_s", interval_s)) > 0.0:
        raise ValueError(f"interval_s: expected a positive number of seconds, got {interval_s}")
    count = np.floor(truth.time_s / interval_s + 1e-9)
    scanned = np.diff(count, prepend=-1.0) > 0.0
    shape = (len(truth.time_s), len(points))
    noise = rng.standard_normal(shape) if points.freedom is None else rng.standard_t(points.freedom, shape)
    y = points.expected(truth.position_m, truth.floor) + points.sigma_db * noise
    return np.where(scanned[:, None] & (y >= points.threshold_dbm), y, np.nan)
