"""Primitives become viser nodes; what the client already shows is not sent again."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from app.draw.primitives import Primitive


class SceneRenderer:
    """The nodes of one client, by name.  `scene` is the client's viser scene."""

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self._nodes: dict[str, tuple[Primitive, Any]] = {}

    def render(self, primitives: Iterable[Primitive]) -> None:
        """Add, change and remove nodes so that exactly these are shown."""
        wanted = {p.name: p for p in primitives}
        for name in [name for name in self._nodes if name not in wanted]:
            self._nodes.pop(name)[1].remove()
        for name, primitive in wanted.items():
            shown = self._nodes.get(name)
            if shown is not None and _same_shape(shown[0], primitive):
                _assign(shown[1], shown[0], primitive)
                self._nodes[name] = (primitive, shown[1])
                continue
            if shown is not None:
                shown[1].remove()
            self._nodes[name] = (primitive, self._add(primitive))

    def clear(self) -> None:
        """Remove all nodes."""
        self.render(())

    def shows(self, kind: str) -> bool:
        """Whether a node of this kind is shown."""
        return any(p.kind == kind for p, _ in self._nodes.values())

    @property
    def names(self) -> list[str]:
        return list(self._nodes)

    def _add(self, p: Primitive) -> Any:
        name, place = f"/{p.name}", {"position": p.position}
        match p.kind:
            case "lines":
                return self._scene.add_line_segments(name, **p.props, **place)
            case "points":
                return self._scene.add_point_cloud(name, **p.props, **place)
            case "arrows":
                return self._scene.add_arrows(name, **p.props, **place)
            case "mesh":
                return self._scene.add_mesh_simple(name, **p.props, **place)
            case "label":
                return self._scene.add_label(name, **p.props, **place)
            case "image":
                # viser lays images in the x-y plane with the first row at y > 0 seen from below
                return self._scene.add_image(name, **p.props, format="png", cast_shadow=False, receive_shadow=False,
                                             wxyz=(0.0, 1.0, 0.0, 0.0), **place)


def _same_shape(old: Primitive, new: Primitive) -> bool:
    """Whether the node of `old` can become `new` by assigning properties."""
    if old.kind != new.kind:
        return False
    if old.kind in ("points", "arrows"):
        # colours per point and points must change together, or a frame between them has both lengths
        return old.props["colors"].shape == new.props["colors"].shape and (
            new.props["colors"].ndim == 1 or len(old.props["points"]) == len(new.props["points"]))
    if old.kind == "mesh":
        return len(old.props["vertices"]) == len(new.props["vertices"]) and np.array_equal(
            old.props["faces"], new.props["faces"])
    return True


def _assign(node: Any, old: Primitive, new: Primitive) -> None:
    for key, value in new.props.items():
        before = old.props[key]
        if not (np.array_equal(value, before) if isinstance(value, np.ndarray) else value == before):
            setattr(node, key, value)
    if new.position != old.position:
        node.position = new.position
