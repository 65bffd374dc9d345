"""lat_k = atan2(z + e^2 N(lat_{k-1}) sin lat_{k-1}, rho): geodetic latitude by repeated aiming at the axis.  MAT 1.4.

The normal of the ellipsoid meets the axis at height -e^2 N sin lat.  Whoever knows that point looks from it to P and
reads the latitude; whoever does not aims at the centre first and improves the aim.  `core.geodesy.geodetic_from_ecef`
is faster and works everywhere; this is the method that one can watch.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.checks import finite
from core.geodesy import WGS84, Ellipsoid, prime_vertical_radius
from core.types import Array


class LatitudeIteration(NamedTuple):
    """Iterates 0..K, each (K+1, ...): latitude and height of each, and the point of the axis that it aimed from.

    lat_rad; h_m above the ellipsoid along the normal of that latitude; axis_z_m the height of the axis point, zero
    (the centre) for iterate 0, whose latitude is therefore the geocentric one.
    """

    lat_rad: Array
    h_m: Array
    axis_z_m: Array


def latitude_iteration(r_m: ArrayLike, iterations: int, ellipsoid: Ellipsoid = WGS84) -> LatitudeIteration:
    """lat_k = atan2(z - z_k, rho),  z_k = -e^2 N(lat_{k-1}) sin lat_{k-1},  z_0 = 0,  rho = sqrt(x^2 + y^2).

    r_m (..., 3) ECEF in metres -> iterates 0..iterations.  Near the solution each step multiplies the error by
    e^2 cos^2 lat / (1 - e^2 sin^2 lat) N / (N + h), below 1 for every point outside the ellipsoid (1/150 for WGS-84);
    deep inside, near the equator's plane, it may be slow or stay at a normal that is not the nearest.  ValueError for
    a negative number of iterations.  MAT 1.4, Fig 1.5.

    >>> found = latitude_iteration([4517590.87884893, 0.0, 4487348.40886592], 4)             # 45 degrees, height 0
    >>> np.degrees(found.lat_rad).round(6).tolist()
    [44.807577, 44.999353, 44.999998, 45.0, 45.0]
    """
    if iterations < 0:
        raise ValueError(f"iterations: expected at least 0, got {iterations}")
    r = finite("r_m", r_m, 3)
    rho, z = np.hypot(r[..., 0], r[..., 1]), r[..., 2] + 0.0
    lat, axis = [np.arctan2(z, rho)], [np.zeros_like(z)]
    for _ in range(iterations):
        axis.append(0.0 - ellipsoid.e2 * prime_vertical_radius(lat[-1], ellipsoid) * np.sin(lat[-1]))
        lat.append(np.arctan2(z - axis[-1], rho))
    lat_rad = np.stack(lat)
    sin = np.sin(lat_rad)
    h = rho * np.cos(lat_rad) + z * sin - ellipsoid.a_m * np.sqrt(1.0 - ellipsoid.e2 * np.square(sin))
    return LatitudeIteration(lat_rad, h, np.stack(axis))
