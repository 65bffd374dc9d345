"""Scene items become primitives: every kind, both themes, finite, named apart, at any scale."""

import math
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import settings

from app.draw.curves import CLOUD_SIZES
from app.draw.lower import DRAW, lower
from app.draw.primitives import Kind, Primitive, style_for
from app.draw.space import space_for
from app.theme import DARK, LIGHT, THEMES
from core.types import Gaussian
from lessons.kit import scene
from lessons.kit.lesson import View
from lessons.kit.roles import ROLES
from lessons.kit.scene import Orbit, Plane

properties = settings(deadline=None, max_examples=80)
PLANE, ORBIT = Plane((-2.0, 8.0), (-3.0, 3.0)), Orbit((1.0, 2.0, 0.5), 5.0, ground=4.0)
CAMERAS = {"plane": PLANE, "bare plane": Plane((0.0, 1.0), (0.0, 1.0), axes=False), "orbit": ORBIT}
FLAT = Gaussian(np.array([1.0, 2.0]), np.array([[2.0, 0.6], [0.6, 1.0]]))
SOLID = Gaussian(np.arange(3.0), np.diag([1.0, 2.0, 0.5]))
X, Y = np.linspace(0.0, 4.0, 9), np.linspace(0.0, 3.0, 7)
HILL = np.exp(-((X - 2) ** 2) - (Y[:, None] - 1) ** 2)
SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

# More than one of a kind where it has more than one way to be drawn.
ITEMS: dict[str, Any] = {
    "points": scene.Points("a", SQUARE),
    "points in space": scene.Points("a", np.eye(3), fade=0.5, shape="diamond"),
    "fading points": scene.Points("a", SQUARE, fade=np.array([0.0, 0.3, 1.0, 2.0])),
    "no points": scene.Points("a", np.zeros((0, 2))),
    "particles": scene.Particles("a", SQUARE),
    "weighted particles": scene.Particles("a", SQUARE, np.array([0.7, 0.2, 0.1, 0.0])),
    "dead particles": scene.Particles("a", SQUARE, np.zeros(4)),
    "no particles": scene.Particles("a", np.zeros((0, 3)), np.zeros(0)),
    "polyline": scene.Polyline("a", SQUARE),
    "closed dashed polyline": scene.Polyline("a", SQUARE, dashed=True, closed=True, fade=0.4),
    "polyline of one point": scene.Polyline("a", SQUARE[:1], dashed=True),
    "segments": scene.Segments("a", np.array([SQUARE[:2], SQUARE[2:]])),
    "segments in space": scene.Segments("a", np.arange(12.0).reshape(2, 2, 3)),
    "no segments": scene.Segments("a", np.zeros((0, 2, 2))),
    "ellipse": scene.LevelEllipse("a", FLAT),
    "filled dashed ellipse of a longer state": scene.LevelEllipse("a", SOLID, filled=True, dashed=True, cross=False),
    "flat ellipse": scene.LevelEllipse("a", Gaussian(np.zeros(2), np.diag([1.0, 0.0])), filled=True),
    "ellipsoid": scene.Ellipsoid("a", SOLID),
    "flat ellipsoid": scene.Ellipsoid("a", Gaussian(np.zeros(3), np.diag([1.0, 0.0, 2.0]))),
    "axes": scene.CovarianceAxes("a", FLAT),
    "axes in space": scene.CovarianceAxes("a", SOLID, scale=2.0),
    "arrow": scene.Arrow("a", (0.0, 0.0), (1.0, 2.0)),
    "arrow without length": scene.Arrow("a", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)),
    "rotation vector": scene.RotationVector("a", (0.3, -0.2, 0.5)),
    "rotation by two turns": scene.RotationVector("a", (0.0, 0.0, 4 * np.pi), start=(1.0, 0.0, 1.0)),
    "rotation from its own axis": scene.RotationVector("a", (0.0, 0.0, 1.0), start=(0.0, 0.0, 2.0)),
    "no rotation": scene.RotationVector("a", (0.0, 0.0, 0.0)),
    "frame": scene.Frame("a", TURN),
    "frame of one colour": scene.Frame("a", TURN, (1.0, 0.0, 2.0), 2.0, ("e", "", "u"), role="frame_a1", fade=0.5),
    "stations": scene.Stations("a", SQUARE, ("A", "B", "C", "D")),
    "stations without names": scene.Stations("a", np.zeros((0, 2))),
    "satellites": scene.Satellites("a", 3.0 * np.eye(3), ("S1", "S2", "S3")),
    "surface": scene.Surface("a", X, Y, HILL),
    "flat surface": scene.Surface("a", X, Y, np.zeros_like(HILL)),
    "surface without contours": scene.Surface("a", X, Y, HILL, contours=0),
    "heat map": scene.HeatMap("a", X, Y, HILL),
    "cold map": scene.HeatMap("a", X, Y, np.zeros_like(HILL)),
    "polygon": scene.Polygon("a", SQUARE),
    "polygon in space": scene.Polygon("a", [(*v, 2.0) for v in SQUARE]),
    "walls": scene.Walls("a", np.array([SQUARE[:2], SQUARE[2:]])),
    "no walls": scene.Walls("a", np.zeros((0, 2, 2))),
    "globe": scene.Globe("a"),
    "turned globe": scene.Globe("a", 6378.0, 6357.0, TURN),
    "label": scene.Label("a", "x\u0302", (1.0, 2.0), 1.5, "left"),
    "label in space": scene.Label("a", "\u03c3", (1.0, 2.0, 3.0)),
}


def drawn(*items: Any, camera: scene.Camera = PLANE, theme: Any = LIGHT) -> list[Primitive]:
    return lower(View(items, camera), style_for(camera, theme))


def own(item: Any, **options: Any) -> list[Primitive]:
    """The primitives of one item, without axes and grid."""
    return [p for p in drawn(item, **options) if p.name == item.name or p.name.startswith(f"{item.name}.")]


def assert_well_made(primitives: list[Primitive]) -> None:
    names = [p.name for p in primitives]
    assert len(set(names)) == len(names)
    for p in primitives:
        assert p.kind in get_args(Kind)
        assert np.isfinite(p.position).all()
        for key, value in p.props.items():
            if isinstance(value, np.ndarray):
                assert np.isfinite(value).all(), (p.name, key)
            elif isinstance(value, float):
                assert math.isfinite(value) and value >= 0, (p.name, key)
        colors = np.asarray(p.props.get("colors", p.props.get("color", ())))
        if colors.size:
            assert np.issubdtype(colors.dtype, np.integer) and colors.min() >= 0 and colors.max() <= 255
        if p.kind == "mesh":
            faces = p.props["faces"]
            assert faces.ndim == 2 and faces.shape[1] == 3
            assert faces.size == 0 or faces.max() < len(p.props["vertices"])
        if p.kind in ("lines", "arrows"):
            assert p.props["points"].shape[1:] == (2, 3)
        if p.kind == "points":
            assert p.props["points"].shape[1:] == (3,)
            assert p.props["colors"].shape in ((3,), p.props["points"].shape)


# -- every item -----------------------------------------------------------------------------------------------------


def test_every_kind_of_item_is_tried_and_can_be_drawn():
    assert {type(item) for item in ITEMS.values()} == set(get_args(scene.Item)) == set(DRAW)


@pytest.mark.parametrize("theme", THEMES.values(), ids=list(THEMES))
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))
@pytest.mark.parametrize("item", ITEMS.values(), ids=list(ITEMS))
def test_every_item(item, camera, theme):
    made = drawn(item, camera=camera, theme=theme)
    assert_well_made(made)
    placed = space_for(camera).place(made)
    assert_well_made(placed)
    assert [p.name for p in placed] == [p.name for p in made]


@pytest.mark.parametrize("item", ITEMS.values(), ids=list(ITEMS))
def test_inputs_are_not_changed(item):
    arrays = {name: (value, value.copy()) for name in item.__slots__
              if isinstance(value := getattr(item, name), np.ndarray)}
    space_for(PLANE).place(drawn(item))
    for value, before in arrays.values():
        np.testing.assert_array_equal(value, before)


@pytest.mark.parametrize("name", ["points", "ellipse", "arrow", "frame of one colour", "polygon", "surface", "globe",
                                  "stations", "heat map", "rotation vector"])
@pytest.mark.parametrize("theme", THEMES.values(), ids=list(THEMES))
def test_the_role_is_the_colour(name, theme):
    found = own(ITEMS[name], theme=theme)[0]
    color = theme.color(ITEMS[name].role, getattr(ITEMS[name], "fade", 0.0))
    if found.kind == "arrows":        # viser takes these as linear light
        color = np.rint(255 * (np.array(color) / 255) ** 2.2)
    if found.kind == "image":
        assert (found.props["image"][..., :3] == color).all()
    else:
        shown = np.asarray(found.props.get("colors", found.props.get("color")))
        assert (shown == color).all()


def test_every_role_differs_between_the_themes_only_in_colour():
    for role in ROLES:
        a, b = (own(scene.Points("a", SQUARE, role=role), theme=theme)[0] for theme in (LIGHT, DARK))
        assert a.props["point_size"] == b.props["point_size"]
        np.testing.assert_array_equal(a.props["points"], b.props["points"])


def test_fade_goes_to_the_background():
    for theme in (LIGHT, DARK):
        assert theme.color("truth", 1.0) == theme.background
        found = own(ITEMS["fading points"], theme=theme)[0].props["colors"]
        np.testing.assert_array_equal(found[[0, 2, 3]],
                                      [theme.roles["measurement"], theme.background, theme.background])


def test_two_items_of_one_name_are_refused():
    with pytest.raises(ValueError, match="'a'"):
        drawn(ITEMS["points"], ITEMS["arrow"])


@pytest.mark.parametrize("items", [(scene.Polygon("b", SQUARE), scene.Polyline("b.edge", SQUARE)),
                                   (scene.Points("axes.grid", SQUARE),)], ids=["part of another item", "axes"])
def test_a_name_that_another_item_s_part_has_is_refused(items):
    with pytest.raises(ValueError, match=r"b\.edge|axes\.grid"):
        drawn(*items)


def test_later_items_lie_above_earlier_ones_in_a_plane_and_where_they_are_in_space():
    items = [scene.Points(name, SQUARE) for name in "abc"]
    heights = [p.position[2] for p in drawn(*items, camera=CAMERAS["bare plane"])]
    assert heights[0] < heights[1] < heights[2] < 0.01
    assert all(p.position == (0.0, 0.0, 0.0) for p in drawn(*items, camera=ORBIT) if p.name != "ground")


def test_sizes_are_pixels_of_the_picture():
    for camera, height in ((PLANE, 10.0 / 1.4), (ORBIT, 11.0)):
        pixel = style_for(camera, LIGHT).pixel
        assert pixel == pytest.approx(height / 900)
        dots, = own(scene.Points("a", SQUARE, size=9.0), camera=camera)
        assert dots.props["point_size"] == pytest.approx(9 * pixel)


def test_heavier_particles_are_larger_and_none_is_lost():
    w = np.random.default_rng(1).exponential(size=500) ** 3
    found = own(scene.Particles("a", np.column_stack([w, w]), w, size=4.0))
    sizes = [p.props["point_size"] for p in found]
    assert sizes == sorted(sizes) and 2 <= len(found) <= len(CLOUD_SIZES)
    lightest = [p.props["points"][:, 0].min() for p in found]
    assert lightest == sorted(lightest)
    assert sum(len(p.props["points"]) for p in found) == 500


def test_the_ellipse_holds_its_probability():
    rim = own(scene.LevelEllipse("a", FLAT, probability=0.95))[0].props["points"][:, 0, :2]
    d = rim - FLAT.mean
    np.testing.assert_allclose((d * np.linalg.solve(FLAT.cov, d.T).T).sum(axis=1), 5.991464547, rtol=1e-6)


def test_the_ellipsoid_holds_its_probability():
    at = own(scene.Ellipsoid("a", SOLID, probability=0.95))[0].props["vertices"] - SOLID.mean
    np.testing.assert_allclose((at**2 / np.diag(SOLID.cov)).sum(axis=1), 7.814727903, rtol=1e-6)


def test_covariance_axes_reach_one_standard_deviation():
    pairs = own(scene.CovarianceAxes("a", SOLID))[0].props["points"]
    lengths = np.sort(np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1))
    np.testing.assert_allclose(lengths, 2 * np.sqrt([0.5, 1.0, 2.0]))


def test_the_arc_ends_where_the_rotation_takes_its_start():
    p = np.array([0.0, 0.0, np.pi / 2])
    arc = next(q for q in own(scene.RotationVector("a", p, start=(1.0, 0.0, 0.0))) if q.name == "a.arc").props["points"]
    np.testing.assert_allclose(arc[0, 0] / np.linalg.norm(arc[0, 0]), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(arc[-1, 1] / np.linalg.norm(arc[-1, 1]), [0, 1, 0], atol=1e-12)


def test_a_heat_map_lies_over_its_cells():
    values = np.zeros((3, 5))
    values[0, 0] = 2.0                           # the cell at the smallest x and y
    found = own(scene.HeatMap("a", np.arange(5.0), 10 + np.arange(3.0), values, opacity=0.5), camera=ORBIT)[0]
    assert found.position == (2.0, 11.0, 0.0)
    assert (found.props["render_width"], found.props["render_height"]) == (5.0, 3.0)
    alpha = found.props["image"][..., 3]
    assert alpha[-1, 0] == 128 and alpha.sum() == 128   # the image's last row is the lowest y


def test_a_surface_of_the_wrong_shape_is_refused():
    with pytest.raises(ValueError, match=r"a: .*\(7, 9\).*\(9, 7\)"):
        drawn(scene.Surface("a", X, Y, HILL.T))
    with pytest.raises(ValueError, match=r"\(n, 2\)"):
        drawn(scene.Points("a", np.zeros((3, 4))))


# -- large coordinates ------------------------------------------------------------------------------------------------

CENTRE = np.array([2_892_571.0, 1_311_843.0, 5_512_634.0])       # a place in Finland, from the Earth's centre
LOCAL = np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [3.0, -4.0, 1.25]])


@pytest.mark.parametrize("make", [
    lambda p: scene.Points("a", p), lambda p: scene.Polyline("a", p), lambda p: scene.Arrow("a", p[0], p[2]),
    lambda p: scene.Stations("a", p), lambda p: scene.Frame("a", np.eye(3), p[2]),
    lambda p: scene.Label("a", "x", p[2]), lambda p: scene.Ellipsoid("a", Gaussian(p[2], np.eye(3))),
], ids=["points", "polyline", "arrow", "stations", "frame", "label", "ellipsoid"])
def test_millimetres_survive_at_the_distance_of_the_earth_s_centre(make):
    """What arrives in the browser (float32) is what the same scene near the origin would give."""
    def placed(origin: np.ndarray) -> list[Primitive]:
        camera = Orbit(tuple(origin.tolist()), 10.0)
        return space_for(camera).place(drawn(make(origin + LOCAL), camera=camera))

    for far, near in zip(placed(CENTRE), placed(np.zeros(3)), strict=True):
        assert far.name == near.name and far.props.keys() == near.props.keys()
        np.testing.assert_allclose(far.position, near.position, atol=1e-6)
        for key in ("points", "vertices"):
            if key in near.props:
                assert far.props[key].dtype == np.float32
                np.testing.assert_allclose(far.props[key], near.props[key], atol=2e-6)   # 4 micrometres of 10 m


def test_every_length_is_scaled():
    camera = Orbit((0.0, 0.0, 0.0), 5000.0)
    space = space_for(camera)
    for before, after in zip(made := drawn(*[ITEMS["points"]], camera=camera), space.place(made), strict=True):
        if before.kind == "points":
            assert after.props["point_size"] == pytest.approx(before.props["point_size"] * space.scale)
    arrow = scene.Arrow("a", (0.0, 0.0), (4000.0, 0.0))
    before, = own(arrow, camera=camera)
    after, = space.place([before])
    for key in ("shaft_radius", "head_radius", "head_length"):
        assert after.props[key] == pytest.approx(before.props[key] * space.scale)
    np.testing.assert_allclose(after.props["points"], before.props["points"] * space.scale)
