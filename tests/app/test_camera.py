"""The camera shows what a lesson asks for on any canvas, and tells the user's moves from our own."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.camera import CameraController, Pose, fit
from app.handles import where_ray_meets as target
from app.scenario import CameraPose
from lessons.kit.scene import Camera, Orbit, Plane

properties = settings(deadline=None, max_examples=80)
sizes = st.tuples(st.integers(280, 3840), st.integers(280, 2160))
spans = st.tuples(st.floats(-1e6, 1e6), st.floats(1e-2, 1e6)).map(lambda at: (at[0], at[0] + at[1]))


def on_canvas(pose: Pose, width: float, height: float, points: np.ndarray) -> np.ndarray:
    """Pixels (n, 2) from the canvas's top left corner, and the depth in front of the camera."""
    forward = np.subtract(pose.look_at, pose.position) / pose.distance
    right = np.cross(forward, pose.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    d = points - pose.position
    depth = d @ forward
    scale = height / 2 / math.tan(pose.fov / 2) / depth
    return np.column_stack([width / 2 + scale * (d @ right), height / 2 - scale * (d @ up), depth])


@properties
@given(spans, spans, sizes, st.booleans())
def test_a_plane_view_shows_its_rectangle_with_room_for_the_numbers(x, y, size, axes):
    width, height = size
    pose = fit(Plane(x, y, axes=axes), width, height)
    corners = np.array([(a, b, 0.0) for a in x for b in y])
    at = on_canvas(pose, width, height, corners)
    margin = 20.0 if axes and min(size) > 560 else 0.0
    assert (at[:, 0] > margin - 1).all() and (at[:, 0] < width + 1).all()
    assert (at[:, 1] > -1).all() and (at[:, 1] < height - margin + 1).all() and (at[:, 2] > 0).all()
    np.testing.assert_allclose(np.ptp(at[:, 0]) / np.ptp(at[:, 1]), (x[1] - x[0]) / (y[1] - y[0]), rtol=1e-4)


@properties
@given(st.floats(0.1, 1e5), st.floats(-180, 180), st.floats(-85, 85), sizes)
def test_an_orbit_shows_its_whole_sphere(radius, azimuth, elevation, size):
    centre = (10.0, -20.0, 5.0)
    pose = fit(Orbit(centre, radius, azimuth, elevation), *size)
    rng = np.random.default_rng(1)
    v = rng.standard_normal((300, 3))
    at = on_canvas(pose, *size, np.array(centre) + radius * v / np.linalg.norm(v, axis=1, keepdims=True))
    assert (at[:, 2] > 0).all()
    assert at[:, 0].min() > -1 and at[:, 0].max() < size[0] + 1 and at[:, 1].min() > -1 and at[:, 1].max() < size[1] + 1
    np.testing.assert_allclose(on_canvas(pose, *size, np.array([centre]))[0, :2], np.array(size) / 2, atol=1e-6)


@properties
@given(st.floats(-180, 180), st.floats(-85, 85))
def test_the_quaternion_looks_along_the_view(azimuth, elevation):
    from core.rotation import dcm_from_quaternion

    pose = fit(Orbit((1.0, 2.0, 3.0), 2.0, azimuth, elevation), 1000, 700)
    C = dcm_from_quaternion(pose.wxyz())
    np.testing.assert_allclose(C[:, 2], np.subtract(pose.look_at, pose.position) / pose.distance, atol=1e-9)
    assert C[2, 1] < 0                           # down in the picture is down in the world


class Client:
    """A client's camera as viser holds it."""

    def __init__(self) -> None:
        self.camera: Any = SimpleNamespace(image_width=1000, image_height=700, position=np.zeros(3), look_at=np.ones(3))

    def report(self, position: Any, look_at: Any) -> None:
        self.camera.position, self.camera.look_at = np.array(position, float), np.array(look_at, float)


CAMERA: Camera = Plane((0.0, 100.0), (0.0, 50.0))


@pytest.fixture
def client() -> Client:
    return Client()


@pytest.fixture
def controller(client: Client) -> CameraController:
    made = CameraController(client)
    made.show(CAMERA, None)
    return made


def test_our_own_pose_is_not_the_user_s(controller):
    controller.report()
    assert controller.user_pose() is None


def test_old_poses_that_arrive_late_are_not_the_user_s(controller, client):
    """A slow browser still reports where it was before it followed us."""
    sent = client.camera.position, client.camera.look_at
    client.report((9.0, 9.0, 9.0), (0.0, 0.0, 0.0))
    controller.report()
    assert controller.user_pose() is None
    client.report(*sent)
    controller.report()
    assert controller.user_pose() is None
    client.report((9.0, 9.0, 9.0), (0.0, 0.0, 0.0))
    controller.report()
    assert controller.user_pose() is not None


def test_the_user_s_pose_is_in_scene_units_and_short(controller, client):
    controller.report()
    client.report((1.0, 2.0, 100.0 / 3), (1.0, 2.0, 0.0))
    controller.report()
    pose = controller.user_pose()
    scale = 100.0 / 1.4 / 10.0                   # the rectangle is ten display units high, or its width over 1.4
    np.testing.assert_allclose(pose.look_at, (50 + scale, 25 + 2 * scale, 0.0), rtol=1e-4)
    assert len(pose.format()) < 60 and CameraPose.parse(pose.format()) == pose


@pytest.mark.parametrize("position", [(math.nan,) * 3, (math.inf, 0.0, 0.0), (1.0, 2.0), (5.0, 5.0, 5.0)], ids=str)
def test_nonsense_is_nobody_s_pose(controller, client, position):
    controller.report()
    client.report(position, (5.0, 5.0, 5.0))
    controller.report()
    assert controller.user_pose() is None


def test_the_same_pose_is_sent_once_and_another_canvas_needs_another(controller, client):
    client.camera.position = "untouched"
    controller.show(CAMERA, None)
    assert client.camera.position == "untouched" and not controller.stale(CAMERA)
    client.camera.image_width = 400
    assert controller.stale(CAMERA)
    controller.show(CAMERA, None)
    assert client.camera.position != "untouched" and not controller.stale(CAMERA)


# -- dragging -------------------------------------------------------------------------------------------------------

vectors = st.tuples(*[st.floats(-10, 10)] * 3).map(np.array)


@properties
@given(vectors, vectors, vectors)
def test_a_dragged_point_stays_on_what_it_may_move_on(start, origin, through):
    flat = target("xy", start, origin, through)
    if flat is not None:
        assert flat[2] == pytest.approx(start[2], abs=1e-4 + 1e-6 * np.abs(flat).max())
    ball = target("sphere", start, origin, through)
    if ball is not None:
        assert np.linalg.norm(ball) == pytest.approx(np.linalg.norm(start), abs=1e-6)
    free = target("free", start, origin, through)
    assert free is None or (free == through).all()


def test_where_the_pointer_s_ray_meets_the_plane_and_the_sphere():
    up = np.array([0.0, 0.0, 10.0])
    np.testing.assert_allclose(target("xy", np.array([5.0, 5.0, 2.0]), up, np.array([1.0, 2.0, 6.0])), (2.0, 4.0, 2.0))
    np.testing.assert_allclose(target("sphere", np.array([0.0, 3.0, 0.0]), up, np.array([0.0, 0.0, 9.0])), (0, 0, 3.0))
    beside = target("sphere", np.array([0.0, 3.0, 0.0]), up, np.array([8.0, 0.0, 10.0]))     # the ray passes by
    np.testing.assert_allclose(beside, (0.0, 0.0, 3.0), atol=1e-9)
    for plane in ("xy", "sphere", "free"):
        assert target(plane, np.ones(3), up, up) is None                                     # no ray
    assert target("xy", np.zeros(3), up, up + np.eye(3)[0]) is None                       # along the plane
    assert target("xy", np.zeros(3), up, up + np.eye(3)[2]) is None                       # away from it
