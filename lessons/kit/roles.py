"""What a thing in a picture stands for: one role has one colour everywhere, in 3-D, in plots and in the legend."""

from typing import Literal, get_args

Role = Literal[
    "truth", "measurement", "prior", "likelihood", "posterior", "innovation", "linearised", "monte_carlo", "sigma",
    "kf", "ekf", "ukf", "pf", "grid", "mixture", "station", "satellite", "handle", "axis_x", "axis_y", "axis_z",
    "frame_a1", "frame_a2", "rotation", "vector", "reference", "muted", "warning",
    "link", "area", "accessor",
]

ROLES: tuple[str, ...] = get_args(Role)

ROLE_NAMES: dict[str, dict[str, str]] = {
    "en": {
        "truth": "truth", "measurement": "measurement", "prior": "prior", "likelihood": "likelihood",
        "posterior": "posterior", "innovation": "innovation", "linearised": "linearised",
        "monte_carlo": "Monte Carlo", "sigma": "sigma points", "kf": "Kalman filter", "ekf": "EKF", "ukf": "UKF",
        "pf": "particle filter", "grid": "grid filter", "mixture": "Gaussian mixture", "station": "station",
        "satellite": "satellite", "handle": "drag me", "axis_x": "x axis", "axis_y": "y axis", "axis_z": "z axis",
        "frame_a1": "frame A1", "frame_a2": "frame A2", "rotation": "rotation vector", "vector": "vector",
        "reference": "reference", "muted": "other", "warning": "warning", "link": "link", "area": "open area",
        "accessor": "accessor node",
    },
}
