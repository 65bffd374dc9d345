"""Satellites over a street: which of them are seen, and the DOP numbers of those."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.dop import Dop, dop
from core.frames import azimuth_elevation
from core.sensors import Pseudorange
from core.types import Array

if TYPE_CHECKING:
    from lessons.static.dilution_of_precision import Params

FAR_M = 2.02e7                               # how far away a satellite is counts for nothing but must be far
NUMBERS = ("gdop", "pdop", "hdop", "vdop", "tdop")
MASKS_DEG = np.arange(0.0, 61.0, 2.0)
AROUND_DEG = np.linspace(0.0, 360.0, 181)
TOP = 8


class Sky(NamedTuple):
    """count satellites; a DOP number is infinite where fewer than four are seen, or their geometry is singular."""

    u: Array                     # (count, 3) unit vectors from the user, in East-North-Up; 0 for no direction
    azimuth_deg: Array           # (count,) clockwise from north
    elevation_deg: Array         # (count,)
    visible: Array               # (count,) truth values
    horizon_deg: Array           # (AROUND_DEG,) elevation below which nothing is seen
    growth: Array                # (count - 3, 5) DOP numbers of the first 4, 5, ... satellites that are seen
    open_sky: Array              # (5,) DOP numbers of all satellites above the horizon
    by_mask: Array               # (MASKS_DEG, 5) for other elevation masks, behind the same walls


def directions(azimuth_deg: Array | float, elevation_deg: Array | float) -> Array:
    """Unit vectors East-North-Up (..., 3) of directions."""
    a, e = np.broadcast_arrays(np.radians(azimuth_deg), np.radians(elevation_deg))
    return np.stack([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)], axis=-1)


def sky(p: "Params") -> Sky:
    """Who is seen, and what that is worth."""
    given = np.array([getattr(p, f"sat_{i + 1}") for i in range(p.count)])
    sizes = np.linalg.norm(given, axis=1)
    u = np.where(sizes[:, None] > 1e-6, given / np.maximum(sizes, 1e-6)[:, None], 0.0)
    azimuth, elevation = (np.degrees(angle) for angle in azimuth_elevation(u))

    def seen(mask_deg: float) -> Array:
        return (sizes > 1e-6) & (elevation > 0.0) & (elevation >= horizon(p, azimuth, mask_deg))

    visible = seen(p.mask_deg)
    return Sky(
        u, azimuth, elevation, visible, horizon(p, AROUND_DEG, p.mask_deg),
        np.array([numbers(u[:k][visible[:k]]) for k in range(4, p.count + 1)]),
        numbers(u[(sizes > 1e-6) & (elevation > 0.0)]),
        np.array([numbers(u[seen(mask)]) for mask in MASKS_DEG]),
    )


def horizon(p: "Params", azimuth_deg: Array, mask_deg: float) -> Array:
    """Elevation in degrees up to which the mask or the walls of a long straight street block the view.

    wall_deg is the elevation of the walls' upper edge straight across the street.
    """
    across = np.abs(np.sin(np.radians(azimuth_deg - p.street_deg)))
    walls = np.degrees(np.arctan(np.tan(np.radians(p.wall_deg)) * across))
    return np.maximum(walls, mask_deg)


def geometry(u: Array) -> Array:
    """J (k, 4): rows [-u_E, -u_N, -u_U, 1] of the pseudoranges, position in East-North-Up and clock bias in metres."""
    return Pseudorange(FAR_M * u, 1.0).jacobian(np.zeros(4))


def solved(u: Array) -> Dop | None:
    """The DOP numbers of satellites in these directions; None for fewer than four."""
    return dop(geometry(u), clock=True) if len(u) >= 4 else None


def numbers(u: Array) -> Array:
    """GDOP, PDOP, HDOP, VDOP, TDOP as (5,), infinite without a solution."""
    found = solved(u)
    return np.full(5, np.inf) if found is None else np.array([float(getattr(found, name)) for name in NUMBERS])
