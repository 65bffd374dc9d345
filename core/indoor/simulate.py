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
    y = heard(points, points.expected(truth.position_m, truth.floor), rng)
    return np.where(scanned[:, None], y, np.nan)


def heard(points: AccessPoints, mean_dbm: Array, rng: "np.random.Generator") -> Array:
    """y_a = mu_a + w,  w ~ N(0, sigma_a^2), or Student t with `points.freedom`; NaN below points.threshold_dbm.

    mean_dbm (..., m): what is expected where the scans are made -> (..., m).
    """
    freedom, shape = points.freedom, mean_dbm.shape
    y = mean_dbm + points.sigma_db * (rng.standard_normal(shape) if freedom is None else rng.standard_t(freedom, shape))
    return np.where(y >= points.threshold_dbm, y, np.nan)
