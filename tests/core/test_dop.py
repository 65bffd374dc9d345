"""DOP numbers and error covariances: the notes' numbers, the axes trap, singular geometry, maps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.dop import dop, local_jacobian, position_covariance
from core.frames import dcm_enu_from_ecef
from core.sensors import Pseudorange, Range
from tests.oracle import entry

properties = settings(deadline=None, max_examples=40)
THREE = [[10.0, 5.0], [120.0, 0.0], [40.0, 90.0]]


def test_oracle_C2_08_five_satellites():
    e = entry("C2-08")
    lat, lon, _ = e["inputs"]["user_geo"]
    J = Pseudorange(e["inputs"]["satellites"], 1.0).jacobian(np.array([*e["inputs"]["user"], 0.0]))
    C = dcm_enu_from_ecef(np.radians(lat), np.radians(lon))
    d = dop(local_jacobian(J, C))
    for name, value in e["expected"].items():
        assert float(getattr(d, name.lower())) == pytest.approx(value, rel=1e-6), name
    assert d.gdop**2 == pytest.approx(d.pdop**2 + d.tdop**2, rel=1e-12)
    assert d.pdop**2 == pytest.approx(d.hdop**2 + d.vdop**2, rel=1e-12)
    raw = dop(J)                                           # erratum M7: in ECEF axes only GDOP, PDOP, TDOP are right
    assert [float(raw.gdop), float(raw.pdop), float(raw.tdop)] == pytest.approx(
        [e["expected"][k] for k in ("GDOP", "PDOP", "TDOP")], rel=1e-6)
    assert float(raw.hdop) == pytest.approx(1.7608, abs=1e-4)


def test_oracle_C2_16_general_weights():
    e = entry("C2-16")
    J = Range(e["inputs"]["stations"], 1.0).jacobian(np.array(e["inputs"]["x"], dtype=float))
    np.testing.assert_allclose(J, e["expected"]["J"], rtol=1e-9)
    Sigma = np.array(e["inputs"]["Sigma"])
    plain, best = position_covariance(J, np.eye(3), Sigma), position_covariance(J, np.linalg.inv(Sigma), Sigma)
    np.testing.assert_allclose(plain, e["expected"]["cov_W_I"], rtol=1e-9)
    np.testing.assert_allclose(best, e["expected"]["cov_optimal"], rtol=1e-9)
    assert np.linalg.eigvalsh(plain - best).min() > -1e-9
    np.testing.assert_allclose(position_covariance(J, 1.0, np.diag(Sigma)), plain, rtol=1e-12)
    np.testing.assert_allclose(position_covariance(J, 1.0, 25.0), 25.0 * dop(J).cofactor, rtol=1e-12)  # (2.6)


def test_oracle_C2_21_map_of_two_stations():
    e = entry("C2-21")
    sensor = Range(e["inputs"]["stations"], 1.0)
    d = dop(sensor.jacobian(np.array(e["inputs"]["points"], dtype=float)))
    np.testing.assert_allclose(d.gdop, e["expected"]["DOP"], rtol=1e-9)
    np.testing.assert_array_equal(d.hdop, d.pdop)
    assert d.vdop is None and d.tdop is None
    x = np.array([37.0, -11.0])
    u, v = sensor.jacobian(x)
    assert float(dop([u, v]).gdop) == pytest.approx(np.sqrt(2) / abs(u[0] * v[1] - u[1] * v[0]), rel=1e-12)
    on_the_line = sensor.jacobian(np.array([[50.0, 25.0], [-100.0, 100.0], [100.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_array_equal(np.isinf(dop(on_the_line).gdop), [True, True, True, False])
    assert np.isnan(dop(on_the_line).cofactor[0]).all()


def test_error_cloud_has_the_stated_covariance():
    """3000 linearised errors; each entry within 5 standard errors: false alarm rate below 1e-5."""
    rng = np.random.default_rng(1)
    J, W, Sigma = rng.normal(size=(5, 2)), np.array([1.0, 2.0, 0.5, 1.0, 3.0]), np.diag([1.0, 4.0, 0.2, 9.0, 1.0])
    P = position_covariance(J, W, Sigma)
    v = rng.normal(size=(3000, 5)) * np.sqrt(np.diag(Sigma))
    u = np.linalg.solve(J.T @ np.diag(W) @ J, J.T @ (W[:, None] * v.T)).T
    bound = 5 * np.sqrt((np.outer(np.diag(P), np.diag(P)) + P**2) / 3000)
    assert np.all(np.abs(np.cov(u.T) - P) < bound)


def test_which_numbers_there_are():
    unit = np.array([[0.6, 0.0, -0.8], [-0.6, 0.0, -0.8], [0.0, 0.6, -0.8], [0.0, -0.8, -0.6], [0.0, 0.0, -1.0]])
    three = dop(unit)
    assert three.tdop is None and three.vdop is not None
    four = dop(np.column_stack([unit, np.ones(5)]))
    assert four.tdop is not None and four.gdop > four.pdop
    flat = dop(np.column_stack([unit[:, :2], np.ones(5)]))             # recognised by the column of ones
    assert flat.vdop is None and flat.tdop is not None and flat.hdop is not None
    assert flat.gdop**2 == pytest.approx(flat.pdop**2 + flat.tdop**2)
    scaled = np.column_stack([unit[:, :2], np.ones(5)]) * [[1.0], [2.0], [1.0], [1.0], [1.0]]
    assert dop(scaled).tdop is None and dop(scaled, clock=True).tdop is not None
    one = dop([[1.0], [-1.0]])
    assert one.hdop is None and float(one.pdop) == pytest.approx(np.sqrt(0.5))
    line = dop([[1.0, 1.0], [-1.0, 1.0]])                  # one position and the clock
    assert line.tdop is not None and line.hdop is None


@properties
@given(st.integers(0, 10_000), st.integers(2, 4), st.sampled_from([(2,), (2, 3)]))
def test_batch_equals_loop_and_inputs_stay(seed, n, batch):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(*batch, 6, n))
    W, before = rng.uniform(0.5, 2, size=6), J.copy()
    many, covs = dop(J), position_covariance(J, W, 2.0)
    for index in np.ndindex(batch):
        one = dop(J[index])
        for name in one._fields:
            if getattr(one, name) is not None:
                np.testing.assert_allclose(getattr(many, name)[index], getattr(one, name), rtol=1e-9)
        np.testing.assert_allclose(one.cofactor, np.linalg.inv(J[index].T @ J[index]), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(covs[index], position_covariance(J[index], W, 2.0), rtol=1e-9)
    np.testing.assert_array_equal(J, before)


@properties
@given(st.integers(0, 10_000))
def test_gdop_does_not_depend_on_the_axes(seed):
    rng = np.random.default_rng(seed)
    J = np.column_stack([rng.normal(size=(6, 3)), np.ones(6)])
    C = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turned, back = local_jacobian(J, C), local_jacobian(local_jacobian(J, C), C.T)
    assert float(dop(turned).gdop) == pytest.approx(float(dop(J).gdop), rel=1e-9)
    assert float(dop(turned).tdop) == pytest.approx(float(dop(J).tdop), rel=1e-9)
    np.testing.assert_allclose(back, J, atol=1e-12)


@pytest.mark.parametrize(("call", "message"), [
    (lambda: dop(np.ones((2, 3))), "at least as many rows"),
    (lambda: dop(np.ones((6, 5))), "1 to 3 position columns"),
    (lambda: dop(np.ones((6, 4)), clock=False), "1 to 3 position columns"),
    (lambda: dop([1.0, 2.0]), "shape"),
    (lambda: dop([[1.0, np.inf], [0.0, 1.0]]), "finite"),
    (lambda: local_jacobian(np.ones((4, 2)), np.eye(3)), "3 columns"),
    (lambda: position_covariance(np.ones((3, 2)), 1.0, 1.0), "independent columns"),
    (lambda: position_covariance(np.ones((1, 2)), 1.0, 1.0), "at least as many rows"),
    (lambda: position_covariance(np.eye(2), [1.0, 2.0, 3.0], 1.0), "W"),
    (lambda: position_covariance(np.eye(2), 1.0, np.diag([1.0, -1.0])), "semidefinite"),
    (lambda: position_covariance(np.eye(2), [1.0, 0.0], 1.0), "independent columns"),
])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
