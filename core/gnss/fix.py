"""rho_i = |s_i - x| + b - c dt_i + ionosphere + troposphere + v: one epoch's position and clock.  MAT 2.2, 2.3."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.closed_form import ClosedForm, bancroft
from core.dop import Dop, dop, local_jacobian
from core.frames import azimuth_elevation, dcm_enu_from_ecef, enu_from_ecef, geodetic_from_ecef
from core.gauss_newton import Solution, gauss_newton
from core.gnss.atmosphere import klobuchar, saastamoinen
from core.gnss.ephemeris import ROTATION, SPEED_OF_LIGHT, Ephemerides, code_clock, satellite_state, usable
from core.sensors import Pseudorange
from core.types import Array

PASSES = 4                     # of the corrections that need the position
TALLEST_M = 1e5                # a receiver higher than this is not on the ground: its root is not the start


class NoFix(ValueError):
    """An epoch cannot be solved; the message says why."""


class Epoch(NamedTuple):
    """Code measurements at the receiver's time time_s: names (m,), pseudoranges_m (m,).

    position_m (m, 3): the satellites, in the Earth-fixed frame of the time of transmission, and pseudoranges free of
    the satellites' clocks, for those who have no ephemerides; else None.
    """

    time_s: float
    names: tuple[str, ...]
    pseudoranges_m: Array
    position_m: Array | None = None


@dataclass(frozen=True, slots=True)
class Corrections:
    """What is corrected and how rows count.

    satellite_clock, earth_rotation, ionosphere, troposphere: on or off.  mask_rad: satellites below are left out.
    weighted: rows times sin(elevation), else all alike.  sigma_m: standard deviation of a code measurement at the
    zenith.  alpha, beta: the broadcast ionosphere; None: none was broadcast.
    """

    satellite_clock: bool = True
    earth_rotation: bool = True
    ionosphere: bool = True
    troposphere: bool = True
    mask_rad: float = np.deg2rad(10.0)
    weighted: bool = True
    sigma_m: float = 1.0
    alpha: tuple[float, ...] | None = None
    beta: tuple[float, ...] | None = None


class Fix(NamedTuple):
    """One epoch, row by row for the n satellites that have an orbit; the used ones are `used` (n,).

    names; satellites_m (n, 3) in the Earth-fixed frame of the time of reception; azimuth_rad, elevation_rad, clock_m
    (c dt_i), ionosphere_m, troposphere_m, corrected_m (n,) pseudoranges without those.  start: Bancroft on the n
    corrected for satellite clock and rotation only; solution: the last Gauss-Newton, x (4,) = position and clock bias
    in metres.  residuals_m (n,) measured minus expected, NaN for satellites that were not used.  missing: names without
    an ephemeris.
    """

    names: tuple[str, ...]
    used: NDArray[np.bool_]
    satellites_m: Array
    azimuth_rad: Array
    elevation_rad: Array
    clock_m: Array
    ionosphere_m: Array
    troposphere_m: Array
    corrected_m: Array
    start: ClosedForm
    solution: Solution
    residuals_m: Array
    dop: Dop
    missing: tuple[str, ...]

    @property
    def x(self) -> Array:
        """Position and clock bias (4,) in metres."""
        return self.solution.x

    @property
    def start_m(self) -> Array:
        """The position (3,) of Bancroft's root near the Earth."""
        return _ground_root(self.start)[:3]


def fix(epoch: Epoch, ephemerides: Ephemerides | None, corrections: Corrections | None = None) -> Fix:
    """argmin_x sum_i (sin(el_i) (rho_i - |s_i - x| - b))^2 after all corrections.

    Bancroft gives the start, then Gauss-Newton and the corrections that depend on the position take turns.  Earth
    rotation: s_i turns by omega tau_i about z, tau_i the geometric time of travel.  NoFix for fewer than four
    satellites with an orbit and above the mask, or a geometry that does not determine a position.
    """
    c = corrections or Corrections()
    names, rho, at, clock, missing = _satellites(epoch, ephemerides)
    if len(names) < 4:
        raise NoFix(f"expected at least 4 satellites with an orbit, got {len(names)}"
                    + (f"; no healthy ephemeris within 2 h for {', '.join(missing)}" if missing else ""))
    clock_m = SPEED_OF_LIGHT * clock if c.satellite_clock else np.zeros(len(names))
    start = _closed(at, rho + clock_m, c.earth_rotation)
    x = _ground_root(start)
    used = np.ones(len(names), dtype=bool)
    iono, tropo = np.zeros((2, len(names)))
    for _ in range(PASSES):
        where = geodetic_from_ecef(x[:3])
        lat, lon, h = (float(v) for v in where)
        s = _turned(at, x[:3], c.earth_rotation)
        az, el = azimuth_elevation(enu_from_ecef(s, lat, lon, h))
        used = el >= c.mask_rad
        if used.sum() < 4:
            raise NoFix(f"expected at least 4 satellites above the mask of {np.rad2deg(c.mask_rad):.3g} degrees, got "
                        f"{int(used.sum())}")
        if c.ionosphere and c.alpha is not None and c.beta is not None:
            iono = klobuchar(c.alpha, c.beta, lat, lon, az, el, float(np.mod(epoch.time_s, 604_800.0)))
        if c.troposphere:
            tropo = saastamoinen(lat, h, el)
        y = rho + clock_m - iono - tropo
        sigma = c.sigma_m / np.sin(np.maximum(el, np.deg2rad(1.0))) if c.weighted else np.full(len(names), c.sigma_m)
        sensor = Pseudorange(s[used], sigma[used])
        try:
            solution = gauss_newton(sensor, y[used], x, tolerance=1e-4)
        except ValueError as error:
            raise NoFix(f"expected satellites that determine a position, but {error}") from None
        if not np.isfinite(solution.x).all() or not solution.converged:
            raise NoFix("expected pseudoranges that fit one position, but Gauss-Newton does not settle")
        x = solution.x
    residuals = np.full(len(names), np.nan)
    residuals[used] = y[used] - sensor.h(x)
    lat, lon, _ = (float(v) for v in geodetic_from_ecef(x[:3]))
    local = local_jacobian(sensor.jacobian(x), dcm_enu_from_ecef(lat, lon))
    return Fix(names, used, s, az, el, clock_m, iono, tropo, y, start, solution, residuals, dop(local), missing)


def _satellites(epoch: Epoch, ephemerides: Ephemerides | None
                ) -> tuple[tuple[str, ...], Array, Array, Array, tuple[str, ...]]:
    """Names, pseudoranges, positions and clocks of the satellites that have an orbit; names of the others."""
    rho = np.asarray(epoch.pseudoranges_m, dtype=np.float64)
    if epoch.position_m is not None:
        return epoch.names, rho, np.asarray(epoch.position_m, dtype=np.float64), np.zeros(len(rho)), ()
    if ephemerides is None:
        raise NoFix("expected ephemerides, as the measurements come without satellite positions")
    records = [usable(ephemerides, name, epoch.time_s) for name in epoch.names]
    have = [k for k, record in enumerate(records) if record is not None]
    missing = tuple(n for n, record in zip(epoch.names, records, strict=True) if record is None)
    some = np.array([records[k] for k in have], dtype=np.intp)
    t = epoch.time_s - rho[have] / SPEED_OF_LIGHT
    t = t - code_clock(ephemerides, some, t)
    state = satellite_state(ephemerides, some, t)
    return tuple(epoch.names[k] for k in have), rho[have], state.position_m, state.clock_s, missing


def _closed(at: Array, y: Array, rotation: bool) -> ClosedForm:
    """Bancroft with the travel times that the pseudoranges tell."""
    s = rotated(at, y / SPEED_OF_LIGHT) if rotation else at       # the receiver's clock is off by milliseconds at most
    try:
        return bancroft(s, y)
    except ValueError as error:
        raise NoFix(f"expected satellites that determine a position, but {error}") from None


def _ground_root(start: ClosedForm) -> Array:
    """The root nearest to the Earth's surface."""
    roots = np.asarray(start.roots, dtype=np.float64)
    if not np.isfinite(roots).all():
        raise NoFix("expected pseudoranges with a common point, but Bancroft's roots are not real")
    far = np.abs(np.sqrt(np.square(roots[:, :3]).sum(axis=1)) - 6_371_000.0)
    best = roots[int(far.argmin())]
    if far.min() > 50.0 * TALLEST_M:
        raise NoFix(f"expected a receiver near the Earth, but both roots lie at least {far.min() / 1e3:,.0f} km off")
    return best


def _turned(at: Array, x: Array, rotation: bool) -> Array:
    """The satellites in the frame of the time of reception at x."""
    return rotated(at, np.sqrt(np.square(at - x).sum(axis=1)) / SPEED_OF_LIGHT) if rotation else at


def rotated(at: Array, travel_s: Array) -> Array:
    """R_3(omega tau) s: the Earth turns under the signal while it travels."""
    angle = ROTATION * travel_s
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * at[:, 0] + sin * at[:, 1], -sin * at[:, 0] + cos * at[:, 1], at[:, 2]], axis=1)
