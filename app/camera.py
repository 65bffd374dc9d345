"""Where the camera must stand so that a lesson fills the canvas, and whether the user has moved it."""

import math
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.draw.space import Space, space_for
from app.scenario import CameraPose
from lessons.kit.scene import Camera, Orbit, Plane

PLANE_FOV = math.radians(5.0)  # nearly parallel: a plane looks like a plot on paper
ORBIT_FOV = math.radians(32.0)
# Pixels kept free at left, right, top and bottom of a plane view, for the numbers on its axes and the caption.
MARGINS = (84.0, 28.0, 88.0, 66.0)
BARE_MARGINS = (8.0, 8.0, 62.0, 8.0)
LEGEND_ROW, LEGEND_FRAME = 20.3, 26.0  # pixels of the legend in the page
NARROW = 480  # below this width the legend lies at the top
MAY_SHRINK = 1.3  # how much smaller a scene may get for the sake of a legend


@dataclass(frozen=True, slots=True)
class Pose:
    """A complete camera: scene units, vertical field of view in radians."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    up: tuple[float, float, float]
    fov: float

    @property
    def distance(self) -> float:
        return math.dist(self.position, self.look_at)

    @property
    def visible_height(self) -> float:
        """Height of what is seen at the distance of `look_at`, in scene units."""
        return 2 * self.distance * math.tan(self.fov / 2)

    def placed(self, space: Space) -> "Pose":
        """The same pose in display units."""
        position, look_at = space.display(self.position), space.display(self.look_at)
        return Pose(tuple(position.tolist()), tuple(look_at.tolist()), self.up, self.fov)

    def wxyz(self) -> np.ndarray:
        """The orientation as a quaternion: looking along +z, down is +y (OpenCV)."""
        from core.rotation import quaternion_from_dcm

        forward = np.subtract(self.look_at, self.position) / self.distance
        right = np.cross(forward, self.up)
        right /= np.sqrt(right @ right)
        return quaternion_from_dcm(np.stack([right, np.cross(forward, right), forward], axis=1))


@dataclass(frozen=True, slots=True)
class Room:
    """Pixels of the canvas that other things want at its right or below: they get them if the scene stays large.

    text: enlargement of the text round a plane view.
    """

    right: float = 0.0
    below: float = 0.0
    text: float = 1.0


def fit(camera: Camera, width: float, height: float, room: Room = Room()) -> Pose:
    """The pose that shows all of `camera` on a canvas of this size in pixels.

    A plane view stands at the top of the canvas, so that what is left over is below it.
    """
    if isinstance(camera, Orbit):
        half = math.atan(math.tan(ORBIT_FOV / 2) * min(1.0, width / height))
        distance = camera.radius / math.sin(half)
        azimuth, elevation = math.radians(camera.azimuth_deg), math.radians(camera.elevation_deg)
        direction = (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth),
                     math.sin(elevation))
        position = tuple(c + distance * d for c, d in zip(camera.centre, direction, strict=True))
        return Pose(position, camera.centre, (0.0, 0.0, 1.0), ORBIT_FOV)  # type: ignore[arg-type]
    small = room.text * min(1.0, width / room.text / 560, height / room.text / 560)
    left, right, top, bottom = (m * small for m in (MARGINS if camera.axes else BARE_MARGINS))
    (x0, x1), (y0, y1) = camera.x, camera.y

    def scale(free_right: float, free_below: float) -> float:
        return max(min((width - left - free_right) / (x1 - x0), (height - top - free_below) / (y1 - y0)), 1e-12)

    best = scale(right, bottom)
    if scale(max(right, room.right), bottom) > best / MAY_SHRINK:
        right = max(right, room.right)
    if scale(right, bottom + room.below) > best / MAY_SHRINK:
        bottom += room.below
    final = scale(right, bottom)
    x = (x0 + x1) / 2 - (left - right) / 2 / final
    y = y1 - (height / 2 - top) / final
    distance = height / final / 2 / math.tan(PLANE_FOV / 2)
    return Pose((x, y, distance), (x, y, 0.0), (0.0, 1.0, 0.0), PLANE_FOV)


def moved(camera: Camera, where: CameraPose) -> Pose:
    """The pose that the user chose, with the lesson's upright and field of view."""
    plane = isinstance(camera, Plane)
    return Pose(where.position, where.look_at, (0.0, 1.0, 0.0) if plane else (0.0, 0.0, 1.0),
                PLANE_FOV if plane else ORBIT_FOV)


class CameraController:
    """Sets one client's camera, and notices when the user moves it."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._sent: Pose | None = None  # in display units
        self._space = Space((0.0, 0.0, 0.0), 1.0)
        self._room = Room()
        self._arrived = False  # a slow browser reports older poses for a while
        self._reported: tuple[np.ndarray, np.ndarray] | None = None
        self._lock = threading.Lock()

    @property
    def canvas(self) -> tuple[int, int]:
        """Width and height of the client's canvas in pixels."""
        camera = self._client.camera
        return max(int(camera.image_width), 1), max(int(camera.image_height), 1)

    def pose(self, camera: Camera, chosen: CameraPose | None) -> Pose:
        """Where the camera should be now."""
        return self._fitted(camera) if chosen is None else moved(camera, chosen)

    def show(self, camera: Camera, chosen: CameraPose | None, legend_rows: int = 0) -> None:
        """Move the client's camera there, unless it has been sent there before."""
        with self._lock:
            self._room = Room(below=LEGEND_ROW * legend_rows + LEGEND_FRAME if legend_rows else 0.0)
            self._space = space_for(camera)
            pose = self.pose(camera, chosen).placed(self._space)
            if pose == self._sent:
                return
            handle, distance = self._client.camera, self._fitted(camera).placed(self._space).distance
            handle.max_orbit_distance = 7 * distance
            handle.min_orbit_distance = 1e-3 * distance
            handle.near, handle.far = distance / 1000, distance * 10
            handle.fov = pose.fov
            handle.up_direction = pose.up
            handle.position = pose.position
            handle.look_at = pose.look_at
            self._sent, self._arrived = pose, False

    def report(self) -> None:
        """A message of the client has just set `client.camera`: note it, unless it makes no sense."""
        with self._lock:
            camera = self._client.camera
            try:
                position, look_at = (np.array(v, dtype=np.float64) for v in (camera.position, camera.look_at))
            except (TypeError, ValueError):
                return
            if position.shape != (3,) or look_at.shape != (3,) or not np.isfinite([position, look_at]).all():
                return
            self._reported = position, look_at
            self._arrived = self._arrived or self._at_sent()

    def user_pose(self) -> CameraPose | None:
        """The pose that the client last reported, if the user has moved the camera away from where we put it."""
        with self._lock:
            if self._reported is None or not self._arrived or self._at_sent():
                return None
            position, look_at = self._reported
            if np.abs(position - look_at).max() < 1e-9:
                return None
            return CameraPose(*(tuple(self._space.scene(v).tolist()) for v in (position, look_at))).rounded()

    def _at_sent(self) -> bool:
        if self._reported is None or self._sent is None:
            return False
        slack = 2e-3 * self._sent.distance
        return all(np.abs(v - w).max() < slack
                   for v, w in zip(self._reported, (self._sent.position, self._sent.look_at), strict=True))

    def _fitted(self, camera: Camera) -> Pose:
        width, height = self.canvas
        return fit(camera, width, height, self._room if width > NARROW else Room())

    def stale(self, camera: Camera) -> bool:
        """Whether the fitted pose is not the one that was sent, because the canvas has changed."""
        return self._sent is not None and self._fitted(camera).placed(self._space) != self._sent

    def accept(self, chosen: CameraPose, camera: Camera) -> None:
        """Remember that the client is at `chosen` already."""
        self._sent, self._arrived = moved(camera, chosen).placed(self._space), True
