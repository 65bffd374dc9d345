"""A position fix from GPS code measurements: broadcast orbits and clocks, the atmosphere, the fix, a simulator.

In the order of reading: `ephemeris` (where a satellite was, and how wrong its clock), `atmosphere` (what delays the
signal), `fix` (Bancroft, then Gauss-Newton with all corrections), `constellation` (satellites and measurements of our
own).  Times are GPS seconds from the start of one week; lengths are metres in the Earth-fixed frame (ECEF, WGS-84).
"""

from core.gnss.atmosphere import klobuchar, saastamoinen
from core.gnss.constellation import Simulated, constellation, simulate
from core.gnss.ephemeris import Ephemerides, SatelliteState, satellite_state, usable
from core.gnss.fix import Corrections, Epoch, Fix, NoFix, fix

__all__ = ["Corrections", "Ephemerides", "Epoch", "Fix", "NoFix", "SatelliteState", "Simulated", "constellation", "fix",
           "klobuchar", "saastamoinen", "satellite_state", "simulate", "usable"]
