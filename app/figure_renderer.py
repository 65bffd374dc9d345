"""A lesson's plots get the theme's colours and the words' titles, and go to their tabs."""

import copy
from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from app.theme import Theme, css
from lessons.kit.words import Words

CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "modeBarButtonsToRemove": ["sendChartToCloud", "lasso2d", "select2d", "autoScale2d"],
    "toImageButtonOptions": {"format": "svg"},
    "showSendToCloud": False,
    "plotlyServerURL": "",
}
FONT = "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif"


def themed(figure: go.Figure, name: str, words: Words, theme: Theme, *, size: float = 1.0,
           titled: bool = False) -> go.Figure:
    """A copy of the figure in the theme's colours, with the names of axes and traces from the words.

    size: enlargement of text and lines; titled: with the figure's title over it (on the screen its tab says it).
    """
    found = go.Figure(copy.deepcopy(figure.to_dict()), skip_invalid=False)
    for trace in found.data:
        _color_trace(trace, name, words, theme, size)
    text = css(theme.text)
    axis = {
        "gridcolor": css(theme.grid), "zerolinecolor": css(theme.color("muted")), "linecolor": css(theme.color("muted")),
        "tickfont": {"size": 12 * size}, "title": {"font": {"size": 13 * size}}, "automargin": True, "ticks": "outside",
        "tickcolor": css(theme.color("muted")), "zerolinewidth": 1,
    }
    background = "rgba(0,0,0,0)"
    if titled:
        found.update_layout(title={"text": words.label("figures", name), "font": {"size": 15 * size}, "x": 0.02,
                                   "xanchor": "left", "y": 0.985, "yanchor": "top"})
    found.update_layout(
        paper_bgcolor=background, plot_bgcolor=background,
        font={"family": FONT, "size": 13 * size, "color": text}, margin={"l": 12, "r": 14, "t": (70 if titled else 46) * size, "b": 12},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "font": {"size": 12 * size},
                "bgcolor": "rgba(0,0,0,0)"},
        hoverlabel={"font": {"size": 12}}, template="none", modebar={"bgcolor": "rgba(0,0,0,0)",
                                                                    "color": css(theme.color("muted")),
                                                                    "activecolor": text},
        showlegend=len(found.data) > 1, bargap=0.06,
    )
    found.update_xaxes(**axis)
    found.update_yaxes(**axis)
    for key, update in (("x", found.update_xaxes), ("y", found.update_yaxes)):
        if title := words.axis(name, key):
            update(title_text=title)
    for shape in found.layout.shapes or ():
        shape.line.color = css(theme.color("warning" if shape.name == "cursor" else "reference"))
        shape.line.width = (shape.line.width or 2) * size
    return found


def _color_trace(trace: Any, figure: str, words: Words, theme: Theme, size: float) -> None:
    meta = trace.meta
    if not isinstance(meta, Mapping) or "role" not in meta:
        return
    role, color = meta["role"], css(theme.color(meta["role"]))
    trace.name = words.trace(figure, meta.get("key", role), role)
    if trace.type == "bar":
        trace.marker.color = color
        return
    if trace.type not in ("scatter", "scattergl"):
        return
    if meta.get("fill"):
        trace.fillcolor = css(theme.color(role), 0.18)
        trace.line.color = "rgba(0,0,0,0)"
        return
    trace.line.color = color
    trace.line.width = (trace.line.width or 2) * size
    trace.marker.color = color
    if trace.marker.size is not None and not hasattr(trace.marker.size, "__len__"):
        trace.marker.size = trace.marker.size * size


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
            ready = themed(figure, name, words, theme)
            text = ready.to_json()
            if self._shown.get(name) == text:
                continue
            self._shown[name] = text
            if name in self._tabs:
                self._tabs[name][1].figure = ready
                continue
            tab = self._panel.add_tab(words.label("figures", name))
            with tab:
                self._tabs[name] = (tab, self._gui.add_plotly(ready, config=CONFIG, aspect=0.72))

    def clear(self) -> None:
        """Remove all tabs."""
        for tab, _ in self._tabs.values():
            tab.remove()
        self._tabs.clear()
        self._shown.clear()
