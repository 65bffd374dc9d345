"""A telephone with twelve keys in its own frame: x along the keys 9-6-3, y along 9-8-7, z out of the screen."""

import numpy as np

from core.types import Array
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Polygon, Segments

LENGTH, WIDTH, DEPTH = 1.0, 0.52, 0.09         # half the edges along x, y and z
SCREEN = ((0.16, -0.42), (0.88, 0.42))         # corners (x, y) on the front
ROWS, COLUMNS = (-0.04, -0.3, -0.56, -0.82), (0.31, 0.0, -0.31)
KEY = (0.1, 0.12)                              # half the edges of a key
LIFT = 0.012                                   # what lies on the front stands off by this
LEAN = 1e-3                                    # see `face`

# Strokes of the digits on a grid 1 wide and 2 high, as chains of (right, up).
STROKES: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "1": (((0.2, 1.6), (0.6, 2), (0.6, 0)),),
    "2": (((0, 2), (1, 2), (1, 1), (0, 1), (0, 0), (1, 0)),),
    "3": (((0, 2), (1, 2), (1, 0), (0, 0)), ((0.2, 1), (1, 1))),
    "4": (((0, 2), (0, 1), (1, 1)), ((1, 2), (1, 0))),
    "5": (((1, 2), (0, 2), (0, 1), (1, 1), (1, 0), (0, 0)),),
    "6": (((1, 2), (0, 2), (0, 0), (1, 0), (1, 1), (0, 1)),),
    "7": (((0, 2), (1, 2), (0.4, 0)),),
    "8": (((0, 0), (0, 2), (1, 2), (1, 0), (0, 0)), ((0, 1), (1, 1))),
    "9": (((1, 1), (0, 1), (0, 2), (1, 2), (1, 0), (0, 0)),),
    "*": (((0.1, 0.6), (0.9, 1.4)), ((0.1, 1.4), (0.9, 0.6)), ((0.5, 0.4), (0.5, 1.6))),
    "0": (((0, 0), (0, 2), (1, 2), (1, 0), (0, 0)),),
    "#": (((0.3, 0.3), (0.3, 1.7)), ((0.7, 0.3), (0.7, 1.7)), ((0, 0.7), (1, 0.7)), ((0, 1.3), (1, 1.3))),
}


def phone(name: str, C: Array, origin: Array, scale: float, *, detailed: bool = True,
          chosen: bool = True) -> list[Item]:
    """The phone with the attitude C = C_B^scene at `origin`; without details: no sides, no digits."""
    quads = FACES if detailed else FACES[:2]
    items: list[Item] = [face(f"{name}_face{k}", quad, C, origin, scale, "muted") for k, quad in enumerate(quads)]
    items.append(face(f"{name}_screen", _rectangle(*SCREEN, DEPTH + LIFT), C, origin, scale,
                      "frame_a2" if chosen else "frame_a1"))
    edges = BOX if detailed else BOX[:8]
    items.append(Segments(f"{name}_edges", place(edges, C, origin, scale), role="truth", width=2.0 if detailed else 1.5,
                          fade=0.1 if chosen else 0.3))
    lines = np.concatenate([KEYS, DIGITS]) if detailed else KEYS
    items.append(Segments(f"{name}_keys", place(lines, C, origin, scale), role="truth",
                          width=2.0 if detailed else 1.2, fade=0.15))
    return items


def outline(name: str, C: Array, origin: Array, scale: float) -> Segments:
    """The edges of the box alone, faint."""
    return Segments(name, place(BOX, C, origin, scale), role="muted", width=1.5, fade=0.2)


def place(points: Array, C: Array, origin: Array, scale: float) -> Array:
    """Body coordinates (..., 3) in the scene."""
    return origin + scale * np.matvec(C, points)


def face(name: str, corners: Array, C: Array, origin: Array, scale: float, role: Role) -> Polygon:
    """A flat quadrilateral in space.

    Polygons are filled by the shape that their corners have on the ground; one that stands upright has none there, so
    that every face leans over by a thousandth, towards its own normal.
    """
    at = place(corners, C, origin, scale)
    normal = np.cross(at[1] - at[0], at[3] - at[0])
    normal /= np.linalg.norm(normal)
    at[:, :2] += LEAN * (at[:, 2:] - at[:, 2].mean()) * normal[:2]
    return Polygon(name, at, role=role, opacity=1.0)


def _rectangle(low: tuple[float, float], high: tuple[float, float], z: float) -> Array:
    """Corners (4, 3) in a plane parallel to the screen, anticlockwise as seen from the user."""
    (x0, y0), (x1, y1) = low, high
    return np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])


def _closed(points: Array) -> Array:
    """The sides (n, 2, 3) of a polygon."""
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def _box() -> tuple[list[Array], Array]:
    """Faces, the front first, and edges (the front's four, the back's four, the four between them)."""
    front, back = (_rectangle((-LENGTH, -WIDTH), (LENGTH, WIDTH), z) for z in (DEPTH, -DEPTH))
    sides = [np.array([front[i], front[j], back[j], back[i]]) for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    edges = np.concatenate([_closed(front), _closed(back), np.stack([front, back], axis=1)])
    return [front, back, *sides], edges * (1.0 + 0.5 * LIFT)


def _keys() -> tuple[Array, Array]:
    """Outlines of the keys and the strokes of their digits, each (n, 2, 3)."""
    outlines, strokes, height = [], [], DEPTH + LIFT
    for k, chains in enumerate(STROKES.values()):
        x, y = ROWS[k // 3], COLUMNS[k % 3]
        outlines.append(_closed(_rectangle((x - KEY[0], y - KEY[1]), (x + KEY[0], y + KEY[1]), height)))
        for chain in chains:
            right, up = np.array(chain, dtype=np.float64).T
            at = np.column_stack([x + 0.065 * (up - 1.0), y - 0.09 * (right - 0.5), np.full(len(up), height)])
            strokes.append(np.stack([at[:-1], at[1:]], axis=1))
    return np.concatenate(outlines), np.concatenate(strokes)


FACES, BOX = _box()
KEYS, DIGITS = _keys()
