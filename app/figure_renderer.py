"""A lesson's plots get the theme's colours and the words' titles, and go to their tabs."""

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go
from plotly.io.json import to_json_plotly

from app.theme import Theme, css
from app.web import adapter
from lessons.kit.words import Words

CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "modeBarButtonsToRemove": ["sendChartToCloud", "lasso2d", "select2d", "autoScale2d"],
    "toImageButtonOptions": {"format": "svg"},
    "showSendToCloud": False,
    "plotlyServerURL": "",
}
EMPTY = go.Figure()
FONT = "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif"


def themed(figure: go.Figure, name: str, words: Words, theme: Theme, *, size: float = 1.0,
           titled: bool = False) -> dict[str, Any]:
    """The figure as plotly's JSON object, in the theme's colours, with the names of axes and traces from the words.

    size: enlargement of text and lines; titled: with the figure's title over it (on the screen its tab says it).
    Plain dictionaries: plotly's own update methods take fifty times as long.
    """
    found = figure.to_dict()
    for trace in found["data"]:
        _color_trace(trace, name, words, theme, size)
    layout, muted = found["layout"], css(theme.color("muted"))
    for key in [k for k in layout if k.startswith(("xaxis", "yaxis"))]:
        layout[key] = {
            "gridcolor": css(theme.grid), "zerolinecolor": muted, "linecolor": muted, "tickcolor": muted,
            "tickfont": {"size": 12 * size}, "automargin": True, "ticks": "outside", "zerolinewidth": 1,
            "title": {"text": words.axis(name, key[0]), "font": {"size": 13 * size}}, **layout[key],
        }
    for shape in layout.get("shapes", ()):
        line = shape.setdefault("line", {})
        line["color"] = css(theme.color("warning" if shape.get("name") == "cursor" else "reference"))
        line["width"] = line.get("width", 2) * size
    layout.pop("template", None)
    layout.update({
        "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": FONT, "size": 13 * size, "color": css(theme.text)},
        "margin": {"l": 12, "r": 14, "t": (70 if titled else 46) * size, "b": 12},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "font": {"size": 12 * size},
                   "bgcolor": "rgba(0,0,0,0)"},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": muted, "activecolor": css(theme.text)},
        "showlegend": len(found["data"]) > 1, "bargap": 0.06, "hoverlabel": {"font": {"size": 12}},
    })
    if titled:
        layout["title"] = {"text": words.label("figures", name), "font": {"size": 15 * size}, "x": 0.02,
                           "xanchor": "left", "y": 0.985, "yanchor": "top"}
    return found


def _color_trace(trace: dict[str, Any], figure: str, words: Words, theme: Theme, size: float) -> None:
    meta = trace.get("meta")
    if not isinstance(meta, Mapping) or "role" not in meta:
        return
    role, color = meta["role"], css(theme.color(meta["role"]))
    trace["name"] = words.trace(figure, meta.get("key", role), role)
    marker, line = trace.setdefault("marker", {}), trace.setdefault("line", {})
    if trace["type"] == "bar":
        del trace["line"]
        marker["color"] = color
    elif meta.get("fill"):
        trace["fillcolor"] = css(theme.color(role), 0.18)
        line["color"] = "rgba(0,0,0,0)"
    else:
        line.update(color=color, width=line.get("width", 2) * size)
        marker["color"] = color
        if isinstance(marker.get("size"), (int, float)):
            marker["size"] *= size


class FigureRenderer:
    """The plot tabs of one client: a tab for each figure, in a panel of their own."""

    def __init__(self, gui: Any, panel: Any) -> None:
        self._gui = gui
        self._panel = panel
        self._tabs: dict[str, tuple[Any, Any]] = {}
        self._shown: dict[str, str] = {}

    def render(self, figures: Mapping[str, go.Figure], words: Words, theme: Theme) -> None:
        """Show exactly these figures; a figure that has not changed is not sent."""
        self._panel.visible = bool(figures)
        if list(figures) != list(self._tabs):
            self.clear()
        for name, figure in figures.items():
            text = to_json_plotly({**themed(figure, name, words, theme), "config": CONFIG})
            if self._shown.get(name) == text:
                continue
            self._shown[name] = text
            if name not in self._tabs:
                tab = self._panel.add_tab(words.label("figures", name))
                with tab:
                    self._tabs[name] = (tab, self._gui.add_plotly(EMPTY, aspect=0.72))
            adapter.set_plot(self._tabs[name][1], text)

    def clear(self) -> None:
        """Remove all tabs."""
        for tab, _ in self._tabs.values():
            tab.remove()
        self._tabs.clear()
        self._shown.clear()
