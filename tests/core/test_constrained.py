"""Least squares with inequalities: against a general optimiser, against a grid, and its own conditions."""

import numpy as np
import pytest

from core.constrained import constrained_least_squares, sector
from core.gauss_newton import gauss_newton
from core.grid import cells, mesh
from core.likelihood import weighted_cost
from core.sensors import Bearing, Linear, Position, Range, Stack

STATIONS = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 90.0]])
SENSOR = Range(STATIONS, [2.0, 5.0, 4.0])
EDGES = sector([0.0, 0.0], np.radians(60.0), np.radians(40.0))                    # from 40 to 80 degrees


def test_a_sector_is_where_the_bearing_lies_in_it():
    points = mesh([cells(-50.0, 50.0, 41), cells(-50.0, 50.0, 41)]).reshape(-1, 2) + np.array([10.0, -20.0])
    for direction, width in ((0.3, 0.5), (4.0, 2.0), (-1.0, np.pi)):
        G, g = sector([10.0, -20.0], direction, width)
        east, north = (points - [10.0, -20.0]).T
        off = np.abs((np.arctan2(east, north) - direction + np.pi) % (2 * np.pi) - np.pi)
        inside = (points @ G.T <= g + 1e-12).all(axis=1)
        clear = np.abs(off - 0.5 * width) > 1e-6
        clear &= np.hypot(east, north) > 1e-6
        np.testing.assert_array_equal(inside[clear], (off < 0.5 * width)[clear])
        np.testing.assert_allclose(np.linalg.norm(G, axis=1), 1.0)


def test_linear_problems_are_those_of_a_general_optimiser():
    from scipy.optimize import minimize

    rng = np.random.default_rng(3)
    for _ in range(20):
        n = int(rng.integers(1, 4))
        H, R = rng.standard_normal((n + 2, n)), np.diag(rng.uniform(0.5, 2.0, n + 2))
        y, G = 3.0 * rng.standard_normal(n + 2), rng.standard_normal((4, n))
        g = G @ rng.standard_normal(n) + rng.uniform(0.0, 1.0, 4)                 # some point is feasible
        fix = constrained_least_squares(Linear(H, R), y, np.zeros(n), G, g, tolerance=1e-9)
        W = np.linalg.inv(R)
        other = minimize(lambda x, H=H, y=y, W=W: (y - H @ x) @ W @ (y - H @ x), np.zeros(n), method="SLSQP",
                         constraints={"type": "ineq", "fun": lambda x, G=G, g=g: g - G @ x}, options={"ftol": 1e-14})
        np.testing.assert_allclose(fix.x, other.x, atol=1e-4)
        assert fix.converged and (G @ fix.x <= g + 1e-8).all()
        gradient = H.T @ W @ (H @ fix.x - y)
        np.testing.assert_allclose(gradient + G.T @ fix.multipliers, 0.0, atol=1e-8)
        np.testing.assert_allclose(fix.multipliers * (G @ fix.x - g), 0.0, atol=1e-8)


def test_ranges_in_a_sector_are_best_on_its_edge():
    y = SENSOR.h(np.array([40.0, 45.0])) + np.array([3.0, 4.0, -6.0])
    free = gauss_newton(SENSOR, y, [50.0, 50.0])
    fix = constrained_least_squares(SENSOR, y, free.x, *EDGES, tolerance=1e-8)
    assert (EDGES[0] @ free.x > EDGES[1]).any() and fix.converged and fix.active.tolist() == [False, True]
    assert EDGES[0][1] @ fix.x == pytest.approx(EDGES[1][1], abs=1e-9)
    grid = mesh([cells(0.0, 100.0, 800), cells(0.0, 100.0, 800)])
    cost = np.where((grid @ EDGES[0].T <= EDGES[1]).all(axis=-1), weighted_cost(SENSOR, y, grid), np.inf)
    assert fix.cost <= cost.min() and np.linalg.norm(fix.x - grid.reshape(-1, 2)[cost.argmin()]) < 0.3
    J = SENSOR.jacobian(fix.x)
    gradient = J.T @ np.linalg.solve(SENSOR.R, SENSOR.h(fix.x) - y)
    np.testing.assert_allclose(gradient + EDGES[0].T @ fix.multipliers, 0.0, atol=1e-6)
    # the multiplier is the price of the edge
    wider = constrained_least_squares(SENSOR, y, free.x, EDGES[0], EDGES[1] + [0.0, 0.01], tolerance=1e-9)
    assert (fix.cost - wider.cost) / 2.0 == pytest.approx(0.01 * fix.multipliers[1], rel=0.02)


def test_without_need_the_edges_do_nothing():
    y = SENSOR.h(np.array([60.0, 35.0])) + np.array([0.5, -0.5, 1.0])
    free = gauss_newton(SENSOR, y, [50.0, 30.0], tolerance=1e-8)
    fix = constrained_least_squares(SENSOR, y, [50.0, 30.0], *EDGES, tolerance=1e-8)
    np.testing.assert_allclose(fix.x, free.x, atol=1e-7)
    assert not fix.active.any() and not fix.multipliers.any() and fix.cost == pytest.approx(free.costs[-1])


def test_behind_the_apex_both_edges_hold():
    fix = constrained_least_squares(Position(2, 3.0), [-30.0, -20.0], [50.0, 30.0], *EDGES)
    np.testing.assert_allclose(fix.x, [0.0, 0.0], atol=1e-9)
    assert fix.active.all()


def test_a_batch_is_a_loop_and_starts_may_be_infeasible():
    rng = np.random.default_rng(5)
    y = SENSOR.h(np.array([40.0, 45.0])) + rng.standard_normal((30, 3)) * [2.0, 5.0, 4.0]
    many = constrained_least_squares(SENSOR, y, [20.0, 70.0], *EDGES, tolerance=1e-9)
    assert many.converged.all() and many.iterates.shape[1:] == (30, 2)
    assert ((many.x @ EDGES[0].T - EDGES[1]) < 1e-9).all()
    for one, x, lam in zip(y, many.x, many.multipliers, strict=True):
        alone = constrained_least_squares(SENSOR, one, [20.0, 70.0], *EDGES, tolerance=1e-9)
        np.testing.assert_allclose(alone.x, x, atol=1e-7)
        np.testing.assert_allclose(alone.multipliers, lam, atol=1e-7)
    assert 0 < many.active.any(axis=1).sum() < 30


def test_other_sensors_have_inequalities_too():
    sensor = Stack((Range(STATIONS[:1], 5.0), Bearing(STATIONS[:1], 0.05)))
    y = sensor.h(np.array([-20.0, 50.0]))
    fix = constrained_least_squares(sensor, y, [10.0, 50.0], [[-1.0, 0.0], [0.0, 1.0]], [0.0, 80.0], tolerance=1e-8)
    assert fix.x[0] == pytest.approx(0.0, abs=1e-9) and fix.active.tolist() == [True, False]


@pytest.mark.parametrize(("changes", "message"), [
    ({"G": [[1.0, 0.0], [-1.0, 0.0]], "g": [0.0, -1.0]}, "some point"),
    ({"G": [[0.0, 0.0]], "g": [1.0]}, "not zero"), ({"G": [[1.0, 0.0, 0.0]], "g": [1.0]}, "rows"),
    ({"x0": [150.0, 0.0], "sensor": Range(STATIONS[:2], 1.0), "y": [100.0, 50.0]}, "dependent"),
    ({"sensor": Range(STATIONS[:1], 1.0), "y": [100.0]}, "m >= n"), ({"tolerance": 0.0}, "tolerance"),
])
def test_impossible_requests_say_what_is_wrong(changes, message):
    given = {"sensor": SENSOR, "y": [50.0, 60.0, 70.0], "x0": [50.0, 30.0], "G": EDGES[0], "g": EDGES[1], **changes}
    with pytest.raises(ValueError, match=message):
        constrained_least_squares(**given)
    for width in (0.0, 4.0):
        with pytest.raises(ValueError, match="width"):
            sector([0.0, 0.0], 0.0, width)
