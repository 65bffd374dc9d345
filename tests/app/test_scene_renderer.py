"""The renderer against a scene that records: add once, assign only what changed, remove what is gone."""

from typing import Any

import numpy as np
import pytest

from app.draw.lower import lower
from app.draw.primitives import Primitive, style_for
from app.draw.space import space_for
from app.scene_renderer import SceneRenderer
from app.theme import DARK, LIGHT
from lessons.kit import scene
from lessons.kit.lesson import View
from tests.app.test_draw import CAMERAS, ITEMS

ADDERS = {"lines": "add_line_segments", "points": "add_point_cloud", "arrows": "add_arrows", "mesh": "add_mesh_simple",
          "label": "add_label", "image": "add_image"}


class Node:
    """Remembers its properties, and writes every assignment to the log."""

    def __init__(self, log: list[tuple[Any, ...]], name: str, props: dict[str, Any]) -> None:
        object.__setattr__(self, "log", log)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "props", dict(props))

    def __setattr__(self, key: str, value: Any) -> None:
        assert key in self.props, f"{self.name} has no {key}"
        self.log.append(("set", self.name, key))
        self.props[key] = value

    def remove(self) -> None:
        self.log.append(("remove", self.name))
        self.props.clear()


class Scene:
    """The methods of viser's scene that the renderer may call."""

    def __init__(self) -> None:
        self.log: list[tuple[Any, ...]] = []
        self.nodes: dict[str, Node] = {}

    def __getattr__(self, method: str) -> Any:
        assert method in ADDERS.values(), method

        def add(name: str, **props: Any) -> Node:
            self.log.append(("add", name, method))
            self.nodes[name] = Node(self.log, name, props)
            return self.nodes[name]

        return add

    def take(self) -> list[tuple[Any, ...]]:
        """What has been called since the last time."""
        found = list(self.log)
        self.log.clear()
        return found


@pytest.fixture
def shown() -> Scene:
    return Scene()


@pytest.fixture
def renderer(shown: Scene) -> SceneRenderer:
    return SceneRenderer(shown)


def points(n: int = 4, *, color: Any = (1, 2, 3), size: float = 0.1, name: str = "a",
           position: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Primitive:
    at = np.arange(3.0 * n, dtype=np.float32).reshape(n, 3)
    return Primitive(name, "points", {"points": at, "colors": np.asarray(color, np.uint8), "point_size": size,
                                      "point_shape": "circle", "precision": "float32"}, position)


def mesh(n: int = 4, flip: bool = False, color: tuple[int, int, int] = (1, 2, 3)) -> Primitive:
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Primitive("a", "mesh", {"vertices": np.arange(3.0 * n, dtype=np.float32).reshape(n, 3),
                                   "faces": faces[:, ::-1] if flip else faces, "color": color, "opacity": None})


def lines(n: int = 2, z: float = 0.0) -> Primitive:
    return Primitive("a", "lines", {"points": np.full((n, 2, 3), z, np.float32), "colors": np.zeros(3, np.uint8),
                                    "thickness": 2.5, "thickness_units": "screen"})


def label(text: str = "x", name: str = "a") -> Primitive:
    props = {"text": text, "font_screen_scale": 1.2, "anchor": "center-center"}
    return Primitive(name, "label", props, (1.0, 2.0, 3.0))


def everything(camera: scene.Camera, theme: Any = LIGHT) -> list[Primitive]:
    """All items of the kit under names of their own, freshly computed."""
    found = [Primitive(f"{at}.{p.name}", p.kind, p.props, p.position)
             for at, item in enumerate(ITEMS.values()) for p in lower(View([item], camera), style_for(camera, theme))]
    return space_for(camera).place(found)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))
def test_every_item_is_added_once_and_then_nothing_is_sent(renderer, shown, camera):
    made = everything(camera)
    renderer.render(made)
    assert shown.take() == [("add", f"/{p.name}", ADDERS[p.kind]) for p in made]
    for p in made:
        props = shown.nodes[f"/{p.name}"].props
        assert props["position"] == p.position
        assert all(props[key] is value for key, value in p.props.items())
    renderer.render(made)
    renderer.render(everything(camera))          # the same numbers in other objects
    assert shown.take() == []


def test_the_other_theme_changes_colours_only(renderer, shown):
    renderer.render(everything(CAMERAS["orbit"]))
    shown.take()
    renderer.render(everything(CAMERAS["orbit"], DARK))
    calls = shown.take()
    assert calls and all(call[0] == "set" and call[2] in ("color", "colors", "image") for call in calls)


@pytest.mark.parametrize(("before", "after", "keys"), [
    (points(), points(size=0.2), ["point_size"]),
    (points(), points(color=(9, 9, 9)), ["colors"]),
    (points(), points(position=(0.0, 0.0, 1.0)), ["position"]),
    (points(4), points(9), ["points"]),
    (points(4), points(0), ["points"]),
    (points(2, color=np.zeros((2, 3))), points(2, color=np.ones((2, 3))), ["colors"]),
    (lines(), lines(z=1.0), ["points"]),
    (lines(2), lines(7), ["points"]),
    (mesh(), mesh(color=(3, 2, 1)), ["color"]),
    (label(), label("y"), ["text"]),
], ids=lambda value: "" if isinstance(value, Primitive) else "+".join(value))
def test_only_what_changed_is_assigned(renderer, shown, before, after, keys):
    renderer.render([before])
    shown.take()
    renderer.render([after])
    assert sorted(shown.take()) == sorted(("set", "/a", key) for key in keys)
    node = shown.nodes["/a"].props
    assert node["position"] == after.position
    for key, value in after.props.items():
        np.testing.assert_array_equal(node[key], value)


@pytest.mark.parametrize(("before", "after"), [
    (points(), lines()), (lines(), mesh()), (mesh(), label()),                       # another kind of node
    (points(2, color=np.zeros((2, 3))), points(3, color=np.zeros((3, 3)))),          # a colour for each point
    (points(3), points(3, color=np.zeros((3, 3)))), (points(3, color=np.zeros((3, 3))), points(3)),
    (mesh(4), mesh(5)), (mesh(), mesh(flip=True)),
], ids=["points to lines", "lines to mesh", "mesh to label", "more coloured points", "one colour to many",
        "many colours to one", "more vertices", "other faces"])
def test_what_cannot_be_assigned_is_made_anew(renderer, shown, before, after):
    renderer.render([before, label(name="b")])
    shown.take()
    renderer.render([after, label(name="b")])
    assert shown.take() == [("remove", "/a"), ("add", "/a", ADDERS[after.kind])]
    assert sorted(renderer.names) == ["a", "b"]
    renderer.render([after, label(name="b")])
    assert shown.take() == []


def test_what_is_gone_is_removed_and_may_come_back(renderer, shown):
    renderer.render([points(), label(name="b")])
    shown.take()
    renderer.render([label(name="b")])
    assert shown.take() == [("remove", "/a")]
    assert renderer.names == ["b"] and not renderer.shows("points") and renderer.shows("label")
    renderer.render([label(name="b"), points()])
    assert shown.take() == [("add", "/a", "add_point_cloud")]


def test_clear_removes_everything(renderer, shown):
    renderer.render([points(), label(name="b")])
    shown.take()
    renderer.clear()
    assert sorted(shown.take()) == [("remove", "/a"), ("remove", "/b")]
    assert renderer.names == []
    renderer.clear()
    assert shown.take() == []


def test_a_slider_that_moves_one_thing_sends_one_thing(renderer, shown):
    def view(x: float) -> list[Primitive]:
        items = [scene.Polyline("track", [(0, 0), (4, 2)]), scene.Points("now", [(x, 1.0)]),
                 scene.Label("name", "P", (x, 1.0))]
        camera = CAMERAS["plane"]
        return space_for(camera).place(lower(View(items, camera), style_for(camera, LIGHT)))

    renderer.render(view(1.0))
    shown.take()
    renderer.render(view(2.0))
    assert shown.take() == [("set", "/now", "points"), ("set", "/name", "position")]
