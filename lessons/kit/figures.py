"""Plots: ordinary plotly figures whose traces name a role; the app gives them its colours, light or dark.

The titles of axes and the names of traces stand in the lesson's words under the figure's id:
`figures: {error: {title: ..., x: ..., y: ..., traces: {ekf: ...}}}`; a trace without a name there is called after
its role.  Keep a figure to about four traces of a few hundred points.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lessons.kit.roles import Role

if TYPE_CHECKING:
    import plotly.graph_objects as go

Numbers = Sequence[float] | np.ndarray


def line(key: str, x: Numbers, y: Numbers, role: Role, *, dash: bool = False, width: float = 2.5,
         markers: bool = False) -> "go.Scatter":
    """A curve; `key` names it in the words."""
    import plotly.graph_objects as go

    return go.Scatter(
        x=_plain(x), y=_plain(y), mode="lines+markers" if markers else "lines", meta={"key": key, "role": role},
        line={"width": width, "dash": "dash" if dash else "solid"}, marker={"size": 6},
    )


def markers(key: str, x: Numbers, y: Numbers, role: Role, *, size: float = 7, symbol: str = "circle") -> "go.Scatter":
    """Separate points."""
    import plotly.graph_objects as go

    return go.Scatter(x=_plain(x), y=_plain(y), mode="markers", meta={"key": key, "role": role},
                      marker={"size": size, "symbol": symbol})


def band(key: str, x: Numbers, low: Numbers, high: Numbers, role: Role) -> "go.Scatter":
    """The area between two curves, for example -2 sigma to 2 sigma."""
    import plotly.graph_objects as go

    x, low, high = _plain(x), _plain(low), _plain(high)
    return go.Scatter(x=np.concatenate([x, x[::-1]]), y=np.concatenate([low, high[::-1]]), mode="lines",
                      fill="toself", line={"width": 0}, hoverinfo="skip", meta={"key": key, "role": role, "fill": True})


def bars(key: str, x: Numbers, y: Numbers, role: Role, *, width: float | None = None) -> "go.Bar":
    """Bars at x of height y: histograms, weights."""
    import plotly.graph_objects as go

    return go.Bar(x=_plain(x), y=_plain(y), width=width, meta={"key": key, "role": role})


def chart(*traces: Any, cursor: float | None = None, marks: Sequence[float] = (), log_x: bool = False,
          log_y: bool = False, x_range: tuple[float, float] | None = None,
          y_range: tuple[float, float] | None = None, equal: bool = False, categories: bool = False) -> "go.Figure":
    """A figure of the traces.  cursor: a vertical line at the current moment; marks: dotted lines at special x.

    Ranges are in data units also on a logarithmic axis.  equal: the same scale on both axes.
    """
    import plotly.graph_objects as go

    def axis(log: bool, limits: tuple[float, float] | None) -> dict[str, Any]:
        found: dict[str, Any] = {"type": "log", "exponentformat": "power"} if log else {"type": "linear"}
        if limits is not None:
            found["range"] = [float(np.log10(v)) if log else float(v) for v in limits]
        return found

    shapes = [_upright(at, "mark", 1.5, "dot") for at in marks]
    if cursor is not None:
        shapes.append(_upright(cursor, "cursor", 2, "solid"))
    figure = go.Figure(data=list(traces), layout={"xaxis": axis(log_x, x_range), "yaxis": axis(log_y, y_range),
                                                  "shapes": shapes})
    if categories:
        figure.layout.xaxis.type = "category"
    if equal:
        figure.layout.yaxis.scaleanchor = "x"
    return figure


def _upright(at: float, name: str, width: float, dash: str) -> dict[str, Any]:
    """A vertical line over the whole height; plotly's own add_vline takes ten times as long."""
    return {"type": "line", "x0": float(at), "x1": float(at), "y0": 0, "y1": 1, "xref": "x", "yref": "y domain",
            "name": name, "line": {"width": width, "dash": dash}}


def _plain(values: Numbers) -> np.ndarray:
    return np.asarray(values, dtype=np.float64)
