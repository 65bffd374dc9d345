"""Triangles that fill a simple polygon, by ear clipping."""

import numpy as np

from core.types import Array


def triangulate(vertices: Array) -> Array:
    """Faces (n-2, 3), indices into the vertices (n, 2) of a simple polygon in either direction.

    ValueError for fewer than three vertices.  The faces of a polygon that crosses itself overlap.
    """
    n = len(vertices)
    if n < 3:
        raise ValueError(f"a polygon needs at least 3 vertices, got {n}")
    x, y = np.asarray(vertices, dtype=np.float64)[:, :2].T
    area = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    left = list(range(n)) if area > 0 else list(range(n))[::-1]

    def turn(i: int, j: int, k: int) -> float:
        return (x[j] - x[i]) * (y[k] - y[i]) - (y[j] - y[i]) * (x[k] - x[i])

    def is_ear(i: int, j: int, k: int) -> bool:
        if turn(i, j, k) < 0:
            return False
        others = [m for m in left if m not in (i, j, k) and (x[m], y[m]) not in {(x[v], y[v]) for v in (i, j, k)}]
        return not any(turn(i, j, m) >= 0 and turn(j, k, m) >= 0 and turn(k, i, m) >= 0 for m in others)

    faces = []
    while len(left) > 3:
        for at in range(len(left)):
            i, j, k = left[at - 1], left[at], left[(at + 1) % len(left)]
            if is_ear(i, j, k):
                faces.append((i, j, k))
                del left[at]
                break
        else:
            raise ValueError("expected a simple polygon, got one without ears")
    faces.append(tuple(left))
    return np.array(faces, dtype=np.uint32)
