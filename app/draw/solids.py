"""Things in space: frames, rotation vectors, ellipsoids, surfaces, walls, satellites, globes."""

import numpy as np

from app.draw import primitives as draw
from app.draw.primitives import Primitive, Style
from core.gaussian import chi_square_level
from core.level_lines import level_lines
from core.linalg import sqrt_psd
from core.rotation import dcm_from_rotation_vector
from core.types import Array
from lessons.kit import scene
from lessons.kit.scene import points3


def frame(item: scene.Frame, style: Style) -> list[Primitive]:
    origin = np.asarray(item.origin, dtype=np.float64)
    axes = np.asarray(item.dcm, dtype=np.float64).T * item.size
    roles = ("axis_x", "axis_y", "axis_z") if item.role is None else (item.role,) * 3
    colors = np.array([style.theme.color(role, item.fade) for role in roles], np.uint8)
    pairs = np.stack([np.broadcast_to(origin, (3, 3)), origin + axes], axis=1)
    found = [draw.arrows(item.name, pairs, colors, item.width, style)]
    found += [draw.label(f"{item.name}.{i}", name, origin + 1.1 * axis, style)
              for i, (name, axis) in enumerate(zip(item.labels, axes, strict=True)) if name]
    return found


def rotation_vector(item: scene.RotationVector, style: Style) -> list[Primitive]:
    """The arrow, and an arc round it that widens a little with every full turn."""
    p, origin = np.asarray(item.p, dtype=np.float64), np.asarray(item.origin, dtype=np.float64)
    angle = float(np.sqrt(p @ p))
    color = style.theme.color(item.role)
    if angle < 1e-9:
        return []
    axis = p / angle
    found = [draw.arrows(item.name, np.stack([origin, origin + p * item.length])[None], color, item.width, style)]
    begin = np.eye(3)[np.argmin(np.abs(axis))] if item.start is None else np.asarray(item.start, dtype=np.float64)
    begin = begin - (begin @ axis) * axis
    size = float(np.sqrt(begin @ begin))
    if size < 1e-9:
        return found
    turns = np.linspace(0.0, angle, max(8, int(angle * 16)))
    arc = dcm_from_rotation_vector(turns[:, None] * axis) @ (begin / size)
    arc = origin + arc * (item.arc_radius * (1 + 0.12 * turns / (2 * np.pi)))[:, None]
    found.append(draw.lines(f"{item.name}.arc", draw.chain(arc), color, 3.0, style))
    tip = np.stack([arc[-2], arc[-2] + 1.5 * (arc[-1] - arc[-2])])
    tip[0] = tip[1] - (tip[1] - tip[0]) / max(np.linalg.norm(tip[1] - tip[0]), 1e-12) * 26 * style.pixel
    found.append(draw.arrows(f"{item.name}.tip", tip[None], color, 4.0, style))
    return found


def ellipsoid(item: scene.Ellipsoid, style: Style) -> list[Primitive]:
    root = sqrt_psd(np.asarray(item.gaussian.cov)[:3, :3]) * np.sqrt(chi_square_level(item.probability, 3))
    mean = np.asarray(item.gaussian.mean)[:3]
    vertices, faces, rings = _sphere(16, 24)
    color = style.theme.color(item.role)
    return [draw.mesh(item.name, vertices @ root.T + mean, faces, color, item.opacity, flat=False),
            draw.lines(f"{item.name}.rings", rings @ root.T + mean, color, 1.5, style)]


def globe(item: scene.Globe, style: Style) -> list[Primitive]:
    """The ellipsoid with meridians every 30 degrees and parallels every 15."""
    scale = np.array([item.equatorial, item.equatorial, item.polar])
    turn = np.eye(3) if item.dcm is None else np.asarray(item.dcm, dtype=np.float64)
    vertices, faces, rings = _sphere(24, 48, meridians=12, parallels=12)
    color = style.theme.color(item.role)
    return [draw.mesh(item.name, (vertices * scale * 0.995) @ turn.T, faces, color, item.opacity, flat=False),
            draw.lines(f"{item.name}.graticule", (rings * scale) @ turn.T, style.theme.color(item.role, 0.45), 1.2,
                       style)]


def surface(item: scene.Surface, style: Style) -> list[Primitive]:
    x, y, z = (np.asarray(a, dtype=np.float64) for a in (item.x, item.y, item.z))
    if z.shape != (len(y), len(x)):
        raise ValueError(f"{item.name}: expected z of shape {(len(y), len(x))}, got {z.shape}")
    xx, yy = np.meshgrid(x, y)
    index = np.arange(z.size).reshape(z.shape)
    a, b, c, d = (v.ravel() for v in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    vertices = np.stack([xx, yy, z], axis=-1).reshape(-1, 3)
    found = [draw.mesh(item.name, vertices, faces, style.theme.color(item.role), item.opacity, flat=False)]
    pieces = []
    drawn = item.contours if np.isfinite(z).all() else 0
    for level in np.linspace(z.min(), z.max(), drawn + 2)[1:-1]:
        flat = level_lines(x, y, z, level)
        pieces.append(np.concatenate([flat, np.full((*flat.shape[:-1], 1), level)], axis=-1))
    pairs = np.concatenate(pieces) if pieces else np.zeros((0, 2, 3))
    if len(pairs):
        lift = np.array([0, 0, style.pixel])
        found.append(draw.lines(f"{item.name}.contours", pairs + lift, style.theme.text, 1.3, style))
    return found


def walls(item: scene.Walls, style: Style) -> list[Primitive]:
    feet = np.asarray(item.segments, dtype=np.float64)
    if feet.shape[-1] == 2:
        feet = np.concatenate([feet, np.zeros((*feet.shape[:-1], 1))], axis=-1)
    if len(feet) == 0:
        return []
    up = np.array([0.0, 0.0, item.height])
    quads = np.stack([feet[:, 0], feet[:, 1], feet[:, 1] + up, feet[:, 0] + up], axis=1)
    base = 4 * np.arange(len(feet))[:, None, None]
    faces = (np.array([[0, 1, 2], [0, 2, 3]]) + base).reshape(-1, 3)
    color = style.theme.color(item.role)
    return [draw.mesh(item.name, quads.reshape(-1, 3), faces, color, item.opacity),
            draw.lines(f"{item.name}.edges", np.concatenate([feet, feet + up]), color, 1.2, style)]


def satellites(item: scene.Satellites, style: Style) -> list[Primitive]:
    """A cube with two flat panels."""
    p = points3(item.positions)
    r = 0.5 * item.size * style.pixel
    boxes = [((0, 0, 0), (0.4, 0.4, 0.4)), ((-1.0, 0, 0), (0.5, 0.35, 0.05)), ((1.0, 0, 0), (0.5, 0.35, 0.05))]
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    body = np.concatenate([np.array(c) + signs * np.array(h) for c, h in boxes]) * r
    cube = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                     [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    one = np.concatenate([cube + 8 * k for k in range(3)])
    faces = (one + 24 * np.arange(len(p))[:, None, None]).reshape(-1, 3)
    found = [draw.mesh(item.name, (p[:, None] + body).reshape(-1, 3), faces, style.theme.color(item.role))]
    found += [draw.label(f"{item.name}.label{i}", name, at + np.array([0, 0, 2.2 * r]), style)
              for i, (name, at) in enumerate(zip(item.labels, p, strict=False))]
    return found


def _sphere(rows: int, columns: int, meridians: int = 4, parallels: int = 4) -> tuple[Array, Array, Array]:
    """Vertices, faces and graticule segments of the unit sphere."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rows + 1)
    longitude = np.linspace(-np.pi, np.pi, columns + 1)
    at = _direction(latitude[:, None], longitude)
    index = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = (v.ravel() for v in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    circle = np.linspace(-np.pi, np.pi, 49)
    rings = [draw.chain(_direction(np.linspace(-np.pi / 2, np.pi / 2, 33), lon))
             for lon in 2 * np.pi * np.arange(meridians) / meridians]
    rings += [draw.chain(_direction(lat, circle)) for lat in np.pi * (np.arange(1, parallels) / parallels - 0.5)]
    return at.reshape(-1, 3), faces, np.concatenate(rings)


def _direction(latitude: Array | float, longitude: Array | float) -> Array:
    latitude, longitude = np.broadcast_arrays(latitude, longitude)
    return np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], -1)
