"""The plane geometry of drawing: level lines, triangles, ticks, dashes, and the space that scenes are scaled to."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from app.draw.axes import ticks
from app.draw.lower import backdrop
from app.draw.primitives import dashes, style_for
from app.draw.space import HEIGHT, space_for
from app.draw.triangulate import triangulate
from app.theme import LIGHT
from core.level_lines import level_lines
from lessons.kit import scene
from lessons.kit.scene import Orbit, Plane

properties = settings(deadline=None, max_examples=80)
X, Y = np.linspace(0.0, 4.0, 9), np.linspace(0.0, 3.0, 7)
HILL = np.exp(-((X - 2) ** 2) - (Y[:, None] - 1) ** 2)


# -- contours -------------------------------------------------------------------------------------------------------


def test_contours_of_a_plane_are_exact():
    z = 2 * X + 3 * Y[:, None]
    found = level_lines(X, Y, z, 7.1)
    np.testing.assert_allclose(found @ [2.0, 3.0], 7.1, rtol=1e-12)
    # from y = 3 to y = 0 (x = 3.55) or the border
    np.testing.assert_allclose([found[..., 0].min(), found[..., 0].max()], [0.0, 3.55], atol=1e-9)
    lengths = np.linalg.norm(found[:, 1] - found[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(math.hypot(3.55, 7.1 / 3), rel=1e-9)


def test_contours_of_a_bowl_are_circles():
    at = np.linspace(-2.0, 2.0, 81)
    found = level_lines(at, at, at**2 + at[:, None] ** 2, 1.0)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1.0, atol=1e-3)
    assert np.linalg.norm(found[:, 1] - found[:, 0], axis=1).sum() == pytest.approx(2 * np.pi, rel=1e-2)


@pytest.mark.parametrize("level", [-1.0, 2.0])
def test_no_contours_outside_the_range(level):
    assert level_lines(X, Y, HILL, level).shape == (0, 2, 2)


@properties
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.5, 1.0]))
def test_contours_are_closed_or_end_at_the_border(seed, level):
    """Every end is shared by two segments, or lies on the border: also where whole numbers hit the level exactly."""
    z = np.random.default_rng(seed).integers(-2, 4, (6, 7)).astype(float)
    found = level_lines(np.arange(7.0), np.arange(6.0), z, level)
    assert np.isfinite(found).all()
    ends: dict[tuple[float, ...], int] = {}
    for segment in np.round(found, 9):
        if (segment[0] != segment[1]).any():
            for end in segment:
                ends[tuple(end)] = ends.get(tuple(end), 0) + 1
    for (x, y), count in ends.items():
        assert count % 2 == 0 or x in (0.0, 6.0) or y in (0.0, 5.0)


# -- polygons -------------------------------------------------------------------------------------------------------


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def areas(polygon: np.ndarray, faces: np.ndarray) -> np.ndarray:
    (a, b, c) = (polygon[faces[:, i]] for i in range(3))
    u, v = b - a, c - a
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def assert_filled(polygon: np.ndarray) -> None:
    faces = triangulate(polygon)
    assert faces.shape == (len(polygon) - 2, 3) and set(faces.ravel().tolist()) == set(range(len(polygon)))
    found = areas(polygon, faces)
    assert (found >= -1e-9).all()                # no face is turned over, so equal areas mean no overlap
    assert found.sum() == pytest.approx(abs(area(polygon)), rel=1e-9, abs=1e-9)


@st.composite
def stars(draw: st.DrawFn) -> np.ndarray:
    """Simple polygons, not convex, in either direction."""
    n = draw(st.integers(3, 24))
    radii = np.array(draw(st.lists(st.integers(2, 100), min_size=n, max_size=n))) / 10
    angles = 2 * np.pi * (np.arange(n) + draw(st.floats(0, 1))) / n
    star = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]) + draw(st.integers(-50, 50))
    return star[::-1] if draw(st.booleans()) else star


@st.composite
def floors(draw: st.DrawFn) -> np.ndarray:
    """Outlines of towers side by side: right angles, and many vertices on one line."""
    heights = draw(st.lists(st.integers(1, 4), min_size=1, max_size=12))
    top = [corner for i, h in enumerate(heights) for corner in ((i, h), (i + 1, h))]
    return np.array([(0, 0), *top, (len(heights), 0)], dtype=float)


@properties
@given(stars())
def test_the_faces_fill_a_star(polygon):
    assert_filled(polygon)


@properties
@given(floors())
def test_the_faces_fill_a_floor_plan(polygon):
    assert_filled(polygon)


def test_a_spiral_corridor_is_filled():
    n = 20
    angle = np.linspace(0, 4 * np.pi, n)
    outer = np.column_stack([(2 + angle) * np.cos(angle), (2 + angle) * np.sin(angle)])
    inner = np.column_stack([(1 + angle) * np.cos(angle), (1 + angle) * np.sin(angle)])
    assert_filled(np.concatenate([outer, inner[::-1]]))


def test_too_few_vertices():
    with pytest.raises(ValueError, match="at least 3 vertices, got 2"):
        triangulate(np.zeros((2, 2)))


# -- axes, dashes ---------------------------------------------------------------------------------------------------


@properties
@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.integers(2, 12))
def test_ticks_are_round_inside_and_about_as_many_as_asked(low, span, count):
    high = low + span
    found = ticks(low, high, count)
    assert (found >= low - 1e-6 * span).all() and (found <= high + 1e-6 * span).all()
    assert (count - 1) / 2.6 - 1 <= len(found) <= count + 1
    if len(found) > 1:
        step = (found[-1] - found[0]) / (len(found) - 1)
        mantissa = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
        assert min(abs(mantissa - m) for m in (1, 2, 5, 10)) < 1e-6
        np.testing.assert_allclose(found / step, np.rint(found / step), atol=1e-6)


def test_axes_say_numbers_and_units():
    camera = Plane((-0.1, 0.5), (0.0, 1000.0), "error (m)", "time (s)")
    texts = [p.props["text"] for p in backdrop(camera, style_for(camera, LIGHT)) if p.kind == "label"]
    assert {"error (m)", "time (s)", "0", "1000"} <= {t.removesuffix(".0") for t in texts}
    assert not any("e" in t or "-" in t for t in texts if t[-1].isdigit())
    bare = Plane((0.0, 1.0), (0.0, 1.0), axes=False)
    assert backdrop(bare, style_for(bare, LIGHT)) == []


@properties
@given(st.lists(st.tuples(*[st.integers(-100, 100)] * 3), min_size=2, max_size=12), st.floats(1e-3, 50.0))
def test_dashes_lie_on_the_line(corners, length):
    p = np.array(corners, dtype=float)
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    found = dashes(p, length)
    assert np.isfinite(found).all() and found.shape[1:] == (2, 3) and len(found) <= 401
    if steps.sum() == 0:
        assert len(found) == 0
        return
    used = max(length, steps.sum() / 800)
    assert abs(len(found) - steps.sum() / (2 * used)) <= 1
    np.testing.assert_allclose(found[0, 0], p[0], atol=1e-9)
    # an end of a dash is at a corner or between two neighbouring corners
    for end in found.reshape(-1, 3)[:20]:
        a, b = p[:-1], p[1:]
        off = np.linalg.norm(end - a, axis=1) + np.linalg.norm(end - b, axis=1) - steps
        assert off.min() < 1e-6


# -- space ----------------------------------------------------------------------------------------------------------

coordinates = st.floats(-1e8, 1e8, allow_subnormal=False)


@st.composite
def cameras(draw: st.DrawFn) -> scene.Camera:
    if draw(st.booleans()):
        x, y, w, h = (draw(coordinates), draw(coordinates), draw(st.floats(1e-2, 1e7)), draw(st.floats(1e-2, 1e7)))
        assume(x + w > x and y + h > y)
        return Plane((x, x + w), (y, y + h))
    return Orbit((draw(coordinates), draw(coordinates), draw(coordinates)), draw(st.floats(1e-2, 1e8)))


@properties
@given(cameras(), st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 3), min_size=1, max_size=5))
def test_space_and_back(camera, offsets):
    space = space_for(camera)
    size = HEIGHT / space.scale
    at = np.array(space.origin) + size * np.array(offsets)
    np.testing.assert_allclose(space.scene(space.display(at)), at, rtol=1e-12, atol=1e-9 * size)
    ulp = np.spacing(np.abs(at).max()) / size * HEIGHT
    np.testing.assert_allclose(space.display(at), HEIGHT * np.array(offsets), atol=1e-9 + 4 * ulp)


def test_what_a_camera_shows_is_ten_high():
    space = space_for(Plane((0.0, 1400.0), (100.0, 200.0)))      # limited by its width
    np.testing.assert_allclose(space.display((0.0, 150.0, 0.0)), (-7.0, 0.0, 0.0))
    space = space_for(Orbit((1.0, 2.0, 3.0), 50.0))
    np.testing.assert_allclose(space.display((1.0, 2.0, 53.0)), (0.0, 0.0, 5.0))
