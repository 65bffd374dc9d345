"""Maps over 200 x 200 cells against a Python loop that treats one cell after the other."""

import numpy as np
import pytest

from core.dop import dop
from core.grid import cells
from core.likelihood import likelihood_map, states_on_grid
from core.sensors import Pseudorange, Range
from tests.bench import faster, medians

pytestmark = pytest.mark.bench

AXES = [cells(-500.0, 500.0, 200)] * 2
PART = 20                                                     # the loop does every 20th row: 10 of 200


def satellites():
    """8 satellites 20,000 km away, in local axes."""
    azimuth = 2 * np.pi * np.arange(8) / 8
    elevation = np.radians([15.0, 40.0, 65.0, 30.0, 50.0, 20.0, 80.0, 35.0])
    horizontal = np.cos(elevation)
    return 2e7 * np.stack([np.sin(azimuth) * horizontal, np.cos(azimuth) * horizontal, np.sin(elevation)], axis=-1)


def test_dop_map():
    s = satellites()
    points = states_on_grid(AXES, base=np.zeros(4))
    sensor = Pseudorange(s, 1.0)

    def one(x):
        d = x[:3] - s
        J = np.column_stack([d / np.sqrt((d * d).sum(axis=1))[:, None], np.ones(8)])
        v = np.diagonal(np.linalg.inv(J.T @ J))
        return np.sqrt([v.sum(), v[:3].sum(), v[:2].sum(), v[2], v[3]])

    def loop():
        return [[one(x) for x in row] for row in points[::PART]]

    def ours():
        return dop(sensor.jacobian(points))

    got = ours()
    stacked = np.stack([got.gdop, got.pdop, got.hdop, got.vdop, got.tdop], axis=-1)
    np.testing.assert_allclose(stacked[::PART], loop(), rtol=1e-6)
    t = medians(5, ours=ours, loop=loop)
    faster("DOP map, 200 x 200 cells, 8 satellites", t["ours"], PART * t["loop"], 20)


def test_likelihood_map():
    stations = np.array([[-300.0, -200.0], [400.0, -100.0], [100.0, 350.0]])
    sensor, y = Range(stations, 10.0), np.array([420.0, 380.0, 290.0])
    points = states_on_grid(AXES)
    constant = -3 * np.log(10.0 * np.sqrt(2 * np.pi))

    def one(x):
        z = (y - np.sqrt(np.square(x - stations).sum(axis=1))) / 10.0
        return constant - 0.5 * (z @ z)

    def loop():
        return [[one(x) for x in row] for row in points[::PART]]

    def ours():
        return likelihood_map(sensor, y, AXES)

    np.testing.assert_allclose(ours().log_likelihood[::PART], loop(), rtol=1e-9)
    t = medians(5, ours=ours, loop=loop)
    faster("likelihood map, 200 x 200 cells, 3 ranges", t["ours"], PART * t["loop"], 100)
