"""Flat things: points, clouds, lines, ellipses, arrows, labels, stations, polygons, heat maps."""

import numpy as np

from app.draw import primitives as draw
from app.draw.primitives import Primitive, Style
from app.draw.triangulate import triangulate
from core.gaussian import chi_square_level, ellipse
from core.types import Array, Gaussian
from lessons.kit import scene
from lessons.kit.scene import points3

CLOUD_SIZES = (0.55, 1.0, 1.7, 2.8, 4.5)  # diameters of the weight classes, relative to a particle of mean weight


def points(item: scene.Points, style: Style) -> list[Primitive]:
    p = points3(item.positions)
    if np.ndim(item.fade) == 0:
        color = style.theme.color(item.role, float(item.fade))
        return [draw.points(item.name, p, color, item.size, style, item.shape)]
    fade = np.clip(np.asarray(item.fade, dtype=np.float64), 0, 1)[:, None]
    full, back = np.array(style.theme.roles[item.role]), np.array(style.theme.background)
    return [draw.points(item.name, p, np.rint(full + (back - full) * fade), item.size, style, item.shape)]


def particles(item: scene.Particles, style: Style) -> list[Primitive]:
    """One node per class of weight, since a point cloud has one size; area grows with the weight."""
    p = points3(item.positions)
    if item.weights is None or len(p) == 0:
        return [draw.points(item.name, p, style.theme.color(item.role, 0.15), item.size, style)]
    w = np.asarray(item.weights, dtype=np.float64)
    relative = np.sqrt(w / max(w.mean(), 1e-300))
    edges = np.sqrt(np.array(CLOUD_SIZES[:-1]) * np.array(CLOUD_SIZES[1:]))
    kind = np.digitize(relative, edges)
    fades = (0.72, 0.35, 0.12, 0.0, 0.0)
    return [
        draw.points(f"{item.name}.{k}", p[kind == k], style.theme.color(item.role, fades[k]), item.size * size, style)
        for k, size in enumerate(CLOUD_SIZES) if (kind == k).any()
    ]


def polyline(item: scene.Polyline, style: Style) -> list[Primitive]:
    p = points3(item.points)
    if item.closed and len(p) > 1:
        p = np.concatenate([p, p[:1]])
    pairs = draw.dashes(p, 11 * style.pixel) if item.dashed else draw.chain(p)
    return _lines(item.name, pairs, style.theme.color(item.role, item.fade), item.width, style)


def segments(item: scene.Segments, style: Style) -> list[Primitive]:
    pairs = np.asarray(item.pairs, dtype=np.float64)
    if pairs.shape[-1] == 2:
        pairs = np.concatenate([pairs, np.zeros((*pairs.shape[:-1], 1))], axis=-1)
    return _lines(item.name, pairs, style.theme.color(item.role, item.fade), item.width, style)


def level_ellipse(item: scene.LevelEllipse, style: Style) -> list[Primitive]:
    g = Gaussian(np.asarray(item.gaussian.mean)[:2], np.asarray(item.gaussian.cov)[:2, :2])
    rim = points3(ellipse(g, chi_square_level(item.probability, 2)))
    color = style.theme.color(item.role)
    pairs = draw.dashes(rim, 11 * style.pixel) if item.dashed else draw.chain(rim)
    found = _lines(item.name, pairs, color, item.width, style)
    centre = np.array([*g.mean, 0.0])
    if item.cross:
        arm = 7 * style.pixel
        cross = centre + arm * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
        found.append(draw.lines(f"{item.name}.mean", cross, color, item.width, style))
    if item.filled:
        n = len(rim)
        fan = np.stack([np.full(n - 1, n), np.arange(n - 1), np.arange(1, n)], axis=1)
        found.insert(0, draw.mesh(f"{item.name}.inside", np.concatenate([rim, centre[None]]), fan, color, 0.16))
    return found


def covariance_axes(item: scene.CovarianceAxes, style: Style) -> list[Primitive]:
    mean, cov = np.asarray(item.gaussian.mean), np.asarray(item.gaussian.cov)
    n = 3 if mean.shape[-1] >= 3 else 2
    variances, vectors = np.linalg.eigh(cov[:n, :n])
    half = np.zeros((n, 3))
    half[:, :n] = (vectors * np.sqrt(np.maximum(variances, 0)) * item.scale).T
    centre = np.zeros(3)
    centre[:n] = mean[:n]
    pairs = np.stack([centre - half, centre + half], axis=1)
    return _lines(item.name, pairs, style.theme.color(item.role), item.width, style)


def arrow(item: scene.Arrow, style: Style) -> list[Primitive]:
    pair = points3([item.start, item.end])
    if np.allclose(pair[0], pair[1], rtol=0, atol=0.5 * style.pixel):
        return []
    return [draw.arrows(item.name, pair[None], style.theme.color(item.role), item.width, style)]


def text(item: scene.Label, style: Style) -> list[Primitive]:
    at = points3([item.position])[0]
    return [draw.label(item.name, item.text, at, style, item.size, item.anchor)]


def stations(item: scene.Stations, style: Style) -> list[Primitive]:
    """Triangles standing on their point, tall enough to be seen from the side too."""
    p = points3(item.positions)
    r = 0.5 * item.size * style.pixel
    angles = np.deg2rad([90, 210, 330])
    foot = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)]) * r * 1.15
    body = np.concatenate([foot, [[0.0, 0.0, 1.6 * r]]])
    vertices = (p[:, None] + body).reshape(-1, 3)
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    every = (faces + 4 * np.arange(len(p))[:, None, None]).reshape(-1, 3)
    found = [draw.mesh(item.name, vertices, every, style.theme.color(item.role))]
    names = zip(item.labels, p, strict=False)
    found += [draw.label(f"{item.name}.label{i}", name, at - np.array([0, 1.6 * r, 0]), style, 1.0, "top")
              for i, (name, at) in enumerate(names)]
    return found


def polygon(item: scene.Polygon, style: Style) -> list[Primitive]:
    p = points3(item.vertices)
    color = style.theme.color(item.role)
    return [draw.mesh(item.name, p, triangulate(p), color, item.opacity),
            draw.lines(f"{item.name}.edge", draw.chain(p, closed=True), color, 1.5, style)]


def heat_map(item: scene.HeatMap, style: Style) -> list[Primitive]:
    """An image of the role's colour whose opacity is the value relative to the largest."""
    values = np.asarray(item.values, dtype=np.float64)
    top = values.max(initial=0.0)
    share = values / top if top > 0 else values
    image = np.empty((*values.shape, 4), np.uint8)
    image[..., :3] = style.theme.color(item.role)
    image[..., 3] = np.rint(255 * item.opacity * np.clip(share, 0, 1))
    x, y = np.asarray(item.x), np.asarray(item.y)
    # cells are centred on the grid points
    width, height = np.ptp(x) * len(x) / (len(x) - 1), np.ptp(y) * len(y) / (len(y) - 1)
    at = (float(x[0] + x[-1]) / 2, float(y[0] + y[-1]) / 2, 0.0)
    return [Primitive(item.name, "image", {"image": image[::-1], "render_width": float(width),
                                           "render_height": float(height)}, at)]


def _lines(name: str, pairs: Array, color: draw.Rgb, width: float, style: Style) -> list[Primitive]:
    return [draw.lines(name, pairs, color, width, style)] if len(pairs) else []
