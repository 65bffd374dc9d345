"""Rotations against scipy.spatial.transform.Rotation.

scipy's `as_matrix` of a rotation vector is our C_{A2}^{A1} (it turns vectors actively), its quaternions are scalar
last unless asked, and its rotation vectors have lengths up to pi, with their own choice of sign at pi.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from core import rotation as rot

Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
vectors = arrays(np.float64, (4, 3), elements=st.floats(-10.0, 10.0, allow_subnormal=False))
properties = settings(deadline=None, max_examples=60)


@properties
@given(vectors)
def test_every_representation_is_the_same(p):
    peer = Rotation.from_rotvec(p)
    C, q = rot.dcm_from_rotation_vector(p), rot.quaternion_from_rotation_vector(p)
    np.testing.assert_allclose(C, peer.as_matrix(), rtol=0, atol=2e-14)
    theirs = peer.as_quat(scalar_first=True)
    sign = np.sign(np.vecdot(q, theirs))[:, None]
    np.testing.assert_allclose(q * sign, theirs, rtol=0, atol=5e-15)
    back = rot.rotation_vector_from_dcm(C)
    np.testing.assert_allclose(Rotation.from_rotvec(back).as_matrix(), peer.as_matrix(), rtol=0, atol=3e-14)
    clear = rot.rotation_angle(back) < np.pi - 1e-6
    np.testing.assert_allclose(back[clear], peer.as_rotvec()[clear], rtol=0, atol=3e-13)


@properties
@given(vectors, vectors)
def test_products_are_the_same(p1, p2):
    peer = Rotation.from_rotvec(p1) * Rotation.from_rotvec(p2)
    C = rot.dcm_from_rotation_vector(rot.compose(p1, p2))
    np.testing.assert_allclose(C, peer.as_matrix(), rtol=0, atol=5e-14)


@pytest.mark.parametrize("axes", ["yxy", "zyx", "xzx", "zzz", "xyz"])
def test_sequences_are_the_same(axes):
    """scipy writes turned axes in capitals and fixed axes in small letters."""
    angles = np.array([0.3, -1.2, 2.5])
    intrinsic, extrinsic = np.eye(3), np.eye(3)
    for k, axis in enumerate(axes):
        turn = Rotation.from_euler(axis, angles[k]).as_matrix()
        intrinsic, extrinsic = intrinsic @ turn, turn @ extrinsic
    np.testing.assert_allclose(rot.rotation_sequence(axes, angles)[-1], intrinsic, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rot.rotation_sequence(axes, angles, intrinsic=False)[-1], extrinsic, rtol=0, atol=1e-15)
    if axes not in ("zzz",):                                # scipy refuses repeated neighbours
        np.testing.assert_allclose(intrinsic, Rotation.from_euler(axes.upper(), angles).as_matrix(), rtol=0, atol=1e-15)
        np.testing.assert_allclose(extrinsic, Rotation.from_euler(axes, angles).as_matrix(), rtol=0, atol=1e-15)


def test_rotation_matrix_from_the_matrix_exponential():
    from scipy.linalg import expm
    for p in np.random.default_rng(1).normal(size=(20, 3)) * 2.0:
        np.testing.assert_allclose(rot.dcm_from_rotation_vector(p), expm(rot.skew(p)), rtol=0, atol=1e-13)
