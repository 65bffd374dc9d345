"""Sensors of a position, with their derivatives and likelihoods.  MAT 2.1, 2.4, exercises 2.1, 2.6, 2.9-2.11.

The state x (..., n) begins with the position in metres; what follows (clock bias, velocities) is ignored unless a
sensor says otherwise and has zero columns in its Jacobian.  Where a direction is undefined (the user stands at the
station) the Jacobian's row is zero.
"""

from core.sensor_noise import wrap_angle
from core.sensors_discrete import BinarySector, Quantised, SquaredRange, UniformNoise
from core.sensors_geometry import Bearing, Pseudorange, Range, RangeDifference, RangeRate
from core.sensors_linear import Linear, Position, Stack
from core.sensors_radio import Fingerprint, SignalStrength

__all__ = [
    "Bearing",
    "BinarySector",
    "Fingerprint",
    "Linear",
    "Position",
    "Pseudorange",
    "Quantised",
    "Range",
    "RangeDifference",
    "RangeRate",
    "SignalStrength",
    "SquaredRange",
    "Stack",
    "UniformNoise",
    "wrap_angle",
]
