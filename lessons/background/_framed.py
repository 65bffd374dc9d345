"""A panel whose vertical axis is named above its left edge, so that long names stay in the picture."""

from lessons.kit.panels import Panel
from lessons.kit.scene import Item, Label


def framed(panel: Panel, name: str, x_title: str, y_title: str, pixel: float, without: str = "") -> list[Item]:
    """Frame, grid, numbers and both titles; `without`: "x" or "y", the axis that a neighbour has."""
    hidden = {f"{name}_title", f"{name}_y_title"} | ({f"{name}_{without}_title"} if without else set())
    items = [item for item in panel.axes(name, ("", x_title, ""), pixel)
             if item.name not in hidden and not (without and _numbers(item.name, f"{name}_{without}"))]
    if without == "y":
        return items
    x, top = panel.corner[0], panel.corner[1] + panel.size[1]
    return [*items, Label(f"{name}_y_title", y_title, (x, top + 15.0 * pixel), 1.0, "left")]


def _numbers(item: str, axis: str) -> bool:
    return item.startswith(axis) and item[len(axis):].isdigit()
