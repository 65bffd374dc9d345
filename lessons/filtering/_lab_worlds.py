"""The scenarios of the filter laboratory: what is known at the start, how the state moves, what is measured."""

from typing import NamedTuple

import numpy as np

from core.motion import LinearMotion, constant_velocity, constant_velocity_with_clock
from core.sensors import Bearing, Position, Pseudorange, Range
from core.types import Array, Gaussian, Sensor

STEPS = 40
ORBIT_M = 2.0e7                          # distance of the satellites, which lie in the plane
AZIMUTHS_DEG = np.array([20.0, 75.0, 150.0, -110.0, -35.0])


class World(NamedTuple):
    """One scenario.  The first two components of the state are the position."""

    initial: Gaussian
    motion: LinearMotion
    sensor: Sensor
    stations: Array              # (s, 2) what is drawn; none for GNSS
    directions: Array            # (s, 2) unit vectors to satellites; none otherwise
    fix_dim: int                 # components that one measurement determines, for the Kalman filter on fixes
    split_m: float               # the mixture splits components that are longer than this
    cells: tuple[int, ...]       # of the grid; none: too many dimensions
    lost_beyond_m: float


def world(name: str) -> World:
    """The scenario of this name."""
    return _MAKERS[name]()


def _start(mean: tuple[float, ...], sigma: tuple[float, ...]) -> Gaussian:
    return Gaussian(np.array(mean), np.diag(np.square(sigma)))


def _example_20() -> World:
    return World(_start((0.0, 0.0, 5.0, 0.0), (10.0, 10.0, 3.0, 3.0)), constant_velocity(1.0, 1.0, 2),
                 Position(2, [30.0, 50.0]), np.empty((0, 2)), np.empty((0, 2)), 2, 60.0, (20, 20, 14, 14), 100.0)


def _ranges(stations: list[list[float]], cells: tuple[int, ...]) -> World:
    s = np.array(stations)
    return World(_start((-150.0, -30.0, 3.0, 3.0), (20.0, 20.0, 5.0, 5.0)), constant_velocity(1.0, 1.0, 2),
                 Range(s, 10.0), s, np.empty((0, 2)), 2, 12.0, cells, 60.0)


def _bearings() -> World:
    s = np.array([[-60.0, 0.0], [60.0, 0.0]])
    return World(_start((-150.0, 170.0, 6.0, 1.0), (50.0, 50.0, 3.0, 3.0)), constant_velocity(1.0, 0.5, 2),
                 Bearing(s, np.radians(3.0)), s, np.empty((0, 2)), 2, 25.0, (28, 28, 14, 14), 60.0)


def _gnss() -> World:
    a = np.radians(AZIMUTHS_DEG)
    unit = np.column_stack([np.sin(a), np.cos(a)])
    # State: position, clock bias (m), velocity, clock drift (m/s).
    return World(_start((0.0, 0.0, 0.0, 5.0, 2.0, 0.0), (30.0, 30.0, 60.0, 3.0, 3.0, 1.0)),
                 constant_velocity_with_clock(1.0, 1.0, 2, 0.5, 0.2), Pseudorange(ORBIT_M * unit, 5.0),
                 np.empty((0, 2)), unit, 3, 60.0, (), 60.0)


_MAKERS = {
    "example_22": lambda: _ranges([[-250.0, 0.0], [250.0, 0.0]], (16, 48, 12, 16)),
    "example_20": _example_20,
    "three_stations": lambda: _ranges([[-250.0, 0.0], [250.0, 0.0], [0.0, 200.0]], (24, 24, 12, 12)),
    "bearings": _bearings,
    "gnss": _gnss,
}
NAMES = tuple(_MAKERS)
