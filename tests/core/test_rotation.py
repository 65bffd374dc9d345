"""Skew matrices, rotation vectors, direction cosine matrices and quaternions: numbers, identities, limits."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from core import rotation as rot
from core.quaternion import sine_ratio
from tests.oracle import entry

PI = np.pi
ANGLES = [0.0, 1e-300, 1e-160, 1e-12, 1e-8, 9.9e-5, 1.01e-4, 1e-3, 0.399, 0.401, 1.0, 3.0, PI - 1e-3, PI - 1e-9, PI]
AXES = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, 1], [1, 2, 2], [-2, 1, 2], [3, -4, 0], [1, 1e-9, 0], [-1, -1, -1]])
AXES = AXES / np.linalg.norm(AXES, axis=-1, keepdims=True)
vectors = arrays(np.float64, array_shapes(max_dims=2, max_side=3).map(lambda s: (*s, 3)),
                 elements=st.floats(-6.0, 6.0, allow_subnormal=False))


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def same_rotation(p, q, atol=1e-14):
    np.testing.assert_allclose(rot.dcm_from_rotation_vector(p), rot.dcm_from_rotation_vector(q), rtol=0, atol=atol)


def test_oracle_C1_32_rotation_about_z():
    e = entry("C1-32")
    theta, a = np.radians(e["inputs"]["theta_deg"]), np.array(e["inputs"]["a_A1"], dtype=float)
    C_12 = np.array(e["expected"]["C_A1_A2"])
    np.testing.assert_allclose(rot.dcm_from_rotation_vector([0, 0, theta]), C_12.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rot.dcm_from_rotation_vector([0, 0, -theta]), C_12, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rot.dcm_from_rotation_vector([0, 0, theta]).T @ a, e["expected"]["a_A2"], atol=1e-12)


def test_oracle_C1_33_rodrigues_and_quaternion():
    e = entry("C1-33")
    p, expected = np.array(e["inputs"]["p"]), e["expected"]
    C, q = rot.dcm_from_rotation_vector(p), rot.quaternion_from_rotation_vector(p)
    np.testing.assert_allclose(C, expected["C"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(q, expected["q"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rot.dcm_from_quaternion(q), C, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rot.rotation_vector_from_dcm(C), p, rtol=0, atol=1e-14)
    assert float(rot.rotation_angle(p)) == pytest.approx(expected["norm"], abs=1e-12)
    assert np.trace(C) == pytest.approx(expected["trace"], abs=1e-12)
    assert np.linalg.det(C) == pytest.approx(1.0, abs=1e-14)


def test_oracle_C1_35_chain_rule():
    e = entry("C1-35")
    p1, p2, expected = e["inputs"]["p1"], e["inputs"]["p2"], e["expected"]
    C1, C2 = rot.dcm_from_rotation_vector(p1), rot.dcm_from_rotation_vector(p2)
    for got in (rot.rotation_vector_from_dcm(rot.chain(C1, C2)), rot.compose(p1, p2)):
        np.testing.assert_allclose(got, expected["rotvec_12"], rtol=0, atol=1e-11)
    for got in (rot.rotation_vector_from_dcm(rot.chain(C2, C1)), rot.compose(p2, p1)):
        np.testing.assert_allclose(got, expected["rotvec_21"], rtol=0, atol=1e-11)


def test_oracle_C1_38_derivative_of_the_dcm():
    e = entry("C1-38")
    u, omega, t = np.array(e["inputs"]["u"]), e["inputs"]["omega"], e["inputs"]["t"]
    C = rot.dcm_from_rotation_vector(omega * t * u)
    U, expected = rot.skew(u), np.array(e["expected"]["Cdot"])
    np.testing.assert_allclose(rot.dcm_rate(C, omega * u), expected, rtol=0, atol=1e-12)
    first = omega * np.cos(omega * t) * U + omega * np.sin(omega * t) * U @ U
    second = (np.eye(3) * np.cos(omega * t) + np.sin(omega * t) * U) @ rot.skew(omega * u)
    np.testing.assert_allclose(first, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(second, expected, rtol=0, atol=1e-12)
    h = 1e-5
    after, before = (rot.dcm_from_rotation_vector(omega * (t + s) * u) for s in (h, -h))
    np.testing.assert_allclose((after - before) / (2 * h), expected, rtol=0, atol=1e-9)


def test_oracle_C1_41_phone():
    e = entry("C1-41")
    axes, degrees = "".join(a for a, _ in e["inputs"]["sequence"]), [d for _, d in e["inputs"]["sequence"]]
    attitudes = rot.rotation_sequence(axes, np.radians(degrees))
    assert attitudes.shape == (4, 3, 3)
    np.testing.assert_allclose(attitudes[-1], e["expected"]["C_B_L"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(rot.rotation_vector_from_dcm(attitudes[-1]), e["expected"]["rotvec"], atol=1e-9)
    # the same turns about fixed axes are the intrinsic ones in reverse order
    fixed = rot.rotation_sequence(axes, np.radians(degrees), intrinsic=False)[-1]
    reverse = rot.rotation_sequence(axes[::-1], np.radians(degrees[::-1]))[-1]
    np.testing.assert_allclose(fixed, reverse, rtol=0, atol=1e-14)


def test_oracle_C1_45_the_axis_has_the_same_coordinates_in_both_frames():
    e = entry("C1-45")
    C = rot.dcm_from_rotation_vector(e["inputs"]["p"])
    np.testing.assert_allclose(C @ e["inputs"]["p"], e["expected"]["Cp"], rtol=0, atol=1e-12)
    angles = np.sort(np.angle(np.linalg.eigvals(C)))
    np.testing.assert_allclose(angles, e["expected"]["eig_angle"] * np.array([-1, 0, 1]), rtol=0, atol=1e-12)


@settings(deadline=None, max_examples=60)
@given(vectors, vectors.map(lambda v: v.reshape(-1, 3)[0]))
def test_skew_is_the_cross_product_and_its_square_the_footnote(a, b):
    A = rot.skew(a)
    np.testing.assert_allclose(np.matvec(A, b), np.cross(a, b), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(A.mT, -A)
    outer = a[..., :, None] * a[..., None, :]
    np.testing.assert_allclose(A @ A, outer - np.square(a).sum(-1)[..., None, None] * np.eye(3), rtol=0, atol=1e-13)


@settings(deadline=None, max_examples=60)
@given(vectors)
def test_every_rotation_vector_gives_a_rotation_and_batch_equals_loop(p):
    before = p.copy()
    C, q = rot.dcm_from_rotation_vector(p), rot.quaternion_from_rotation_vector(p)
    assert C.shape == (*p.shape[:-1], 3, 3) and q.shape == (*p.shape[:-1], 4)
    np.testing.assert_allclose(C.mT @ C, np.broadcast_to(np.eye(3), C.shape), rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(C), 1.0, atol=1e-13)
    np.testing.assert_allclose(rot.dcm_from_quaternion(q), C, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rot.dcm_from_rotation_vector(-p), C.mT, rtol=0, atol=1e-15)    # exercise 1.18
    for i in np.ndindex(p.shape[:-1]):
        np.testing.assert_array_equal(rot.dcm_from_rotation_vector(p[i]), C[i])
        np.testing.assert_array_equal(rot.quaternion_from_rotation_vector(p[i]), q[i])
        np.testing.assert_array_equal(rot.rotation_vector_from_dcm(C[i]), rot.rotation_vector_from_dcm(C)[i])
    np.testing.assert_array_equal(p, before)


@settings(deadline=None, max_examples=60)
@given(vectors)
def test_round_trips_give_the_principal_rotation_vector(p):
    short = rot.principal(p)
    assert rot.rotation_angle(short).max() <= PI + 1e-15
    same_rotation(short, p, 3e-14)
    back = rot.rotation_vector_from_quaternion(rot.quaternion_from_rotation_vector(p))
    through_dcm = rot.rotation_vector_from_dcm(rot.dcm_from_rotation_vector(p))
    far_from_pi = rot.rotation_angle(short) < PI - 1e-6         # at pi both signs are right
    np.testing.assert_allclose(back[far_from_pi], short[far_from_pi], rtol=0, atol=5e-14)
    np.testing.assert_allclose(through_dcm[far_from_pi], short[far_from_pi], rtol=0, atol=5e-14)
    same_rotation(back, p, 3e-14)
    same_rotation(through_dcm, p, 3e-14)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", AXES)
def test_round_trips_near_0_and_pi(angle, axis):
    p = angle * axis
    q, C = rot.quaternion_from_rotation_vector(p), rot.dcm_from_rotation_vector(p)
    sign = -1.0 if angle == PI and rot.rotation_vector_from_quaternion(q) @ p < 0 else 1.0
    scale = max(angle, 1e-300)
    np.testing.assert_allclose(rot.rotation_vector_from_quaternion(q) * sign, p, rtol=0, atol=4e-15 * scale)
    sign = -1.0 if angle > PI - 1e-8 and rot.rotation_vector_from_dcm(C) @ p < 0 else 1.0
    np.testing.assert_allclose(rot.rotation_vector_from_dcm(C) * sign, p, rtol=0, atol=4e-15 * scale)


@pytest.mark.parametrize("angle", [PI + 1e-9, PI + 1e-3, 4.0, 2 * PI - 1e-3, 2 * PI - 1e-9, 2 * PI, 2 * PI + 1e-9, 9.0])
@pytest.mark.parametrize("axis", AXES)
def test_beyond_pi_the_shadow_vector_is_the_same_rotation(angle, axis):
    p = angle * axis
    same_rotation(rot.shadow(p), p, 1e-14)
    same_rotation(rot.principal(p), p, 1e-14)
    assert float(rot.rotation_angle(rot.shadow(p))) == pytest.approx(abs(angle - 2 * PI), abs=3e-15)
    back = rot.rotation_vector_from_dcm(rot.dcm_from_rotation_vector(p))
    np.testing.assert_allclose(back, rot.principal(p), rtol=0, atol=4e-15)


@settings(deadline=None, max_examples=60)
@given(vectors)
def test_matrix_and_quaternion_products_agree(p):
    q = rot.quaternion_from_rotation_vector(p)
    r = rot.quaternion_from_rotation_vector(p[..., ::-1] * 0.7)
    C = rot.chain(rot.dcm_from_quaternion(q), rot.dcm_from_quaternion(r))
    np.testing.assert_allclose(rot.dcm_from_quaternion(rot.quaternion_product(q, r)), C, rtol=0, atol=1e-14)
    identity = rot.quaternion_product(q, rot.quaternion_conjugate(q))
    np.testing.assert_allclose(identity, np.broadcast_to([1.0, 0, 0, 0], q.shape), rtol=0, atol=1e-15)
    same_rotation(rot.compose(p, p[..., ::-1] * 0.7), rot.rotation_vector_from_dcm(C), 1e-13)


def test_quaternion_from_dcm_takes_each_of_the_four_largest_columns():
    for q in np.vstack([np.eye(4), np.eye(4)[[1, 2, 3, 0]] * 0.6 + np.eye(4) * 0.8]):
        got = rot.quaternion_from_dcm(rot.dcm_from_quaternion(q))
        np.testing.assert_allclose(got * np.sign(got @ q), q, rtol=0, atol=1e-15)
    assert rot.quaternion_from_dcm(rot.dcm_from_quaternion([-0.6, 0.8, 0, 0]))[0] > 0


def test_oracle_C1_43_bortz_coefficient():
    # The entry's number at 0.01 rad carries the cancellation of the closed form in double precision (2.9e-9 off); its
    # tolerance of 1e-10 holds everywhere else, and there the first terms of the series are the reference.
    for angle, expected in entry("C1-43")["expected"]["gamma"].items():
        tolerance = 3e-9 if angle == "0.01" else 1e-10
        assert float(rot.bortz_coefficient(float(angle))) == pytest.approx(expected, abs=tolerance)
    assert float(rot.bortz_coefficient(0.01)) == pytest.approx(1 / 12 + 1e-4 / 720 + 1e-8 / 30240, abs=1e-15)
    assert float(rot.bortz_coefficient(PI)) == pytest.approx(1 / PI**2, rel=1e-15)


def test_bortz_series_and_closed_form_meet():
    below, above = rot.GAMMA_SERIES_BELOW * (1 - 1e-12), rot.GAMMA_SERIES_BELOW * (1 + 1e-12)
    gap = rot.bortz_coefficient(above) - rot.bortz_coefficient(below)
    assert abs(gap) < 3e-15
    # both sides of the switch against the closed form in 60-digit arithmetic
    assert float(rot.bortz_coefficient(0.39)) == pytest.approx(0.0835453512803498418, rel=5e-16, abs=0)
    assert float(rot.bortz_coefficient(0.41)) == pytest.approx(0.0835677439440760208, rel=1e-14, abs=0)


def test_sine_ratio_series_and_quotient_meet():
    x = 1e-4 * np.array([1 - 1e-12, 1 + 1e-12])
    np.testing.assert_allclose(sine_ratio(x), 1 - x**2 / 6, rtol=0, atol=3e-16)
    assert sine_ratio(np.zeros(1))[0] == 1.0


@settings(deadline=None, max_examples=60)
@given(vectors, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_bortz_is_the_rate_of_the_rotation_vector(p, a, b):
    """Move p a little along (1.26): the matrix moves along (1.21)."""
    p = np.where(rot.rotation_angle(p)[..., None] > PI, rot.principal(p), p)
    w = np.array([a, b, 0.5])
    h = 1e-5
    ahead = rot.dcm_from_rotation_vector(p + h * rot.rotation_vector_rate(p, w))
    behind = rot.dcm_from_rotation_vector(p - h * rot.rotation_vector_rate(p, w))
    C = rot.dcm_from_rotation_vector(p)
    np.testing.assert_allclose((ahead - behind) / (2 * h), rot.dcm_rate(C, w), rtol=0, atol=1e-8)


def test_rates_of_a_fixed_axis_and_at_zero():
    w = np.array([0.3, -0.1, 0.2])
    np.testing.assert_array_equal(rot.rotation_vector_rate(np.zeros(3), w), w)
    for scale in (1e-9, 1e-3, 0.5, 5.0, 12.0):
        np.testing.assert_allclose(rot.rotation_vector_rate(scale * w, w), w, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: rot.skew([1.0, 2.0]), "expected shape (..., 3), got (2,)"),
    (lambda: rot.dcm_from_rotation_vector([np.nan, 0, 0]), "expected finite"),
    (lambda: rot.dcm_from_rotation_vector([1e200, 0, 0]), "at most 1e+08 rad, got 1e+200"),
    (lambda: rot.rotation_vector_from_dcm(2 * np.eye(3)), "got C'C different from I by 3"),
    (lambda: rot.rotation_vector_from_dcm(1e200 * np.eye(3)), "expected entries in [-1, 1]"),
    (lambda: rot.rotation_vector_from_dcm(-np.eye(3)), "expected determinant 1, got -1"),
    (lambda: rot.rotation_vector_from_dcm(np.eye(4)), "expected shape (..., 3, 3), got (4, 4)"),
    (lambda: rot.dcm_rate(np.ones((3, 3)), [0, 0, 1]), "expected orthonormal columns"),
    (lambda: rot.dcm_from_quaternion([1.0, 1.0, 0, 0]), "expected length 1, got 1.41421"),
    (lambda: rot.rotation_vector_from_quaternion([0.0, 0, 0, 0]), "expected length 1, got 0"),
    (lambda: rot.dcm_from_quaternion([1e300, 0, 0, 0]), "expected length 1, got 1e+300"),
    (lambda: rot.quaternion_product([1, 0, 0], [1, 0, 0, 0]), "q: expected shape (..., 4), got (3,)"),
    (lambda: rot.shadow([0.0, 0.0, 0.0]), "expected a nonzero vector"),
    (lambda: rot.rotation_vector_rate([2 * PI, 0, 0], [0, 1, 0]), "pole"),
    (lambda: rot.rotation_sequence("xw", [0.1, 0.2]), "expected letters x, y, z, got 'xw'"),
    (lambda: rot.rotation_sequence("xy", [0.1]), "expected shape (..., 2), got (1,)"),
])
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError) as error:
        call()
    assert words in str(error.value)
