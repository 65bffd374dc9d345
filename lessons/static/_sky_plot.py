"""A sky plot: north up, east at the right; the centre is straight up, the rim the horizon."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit import figures as fig
from lessons.kit.roles import Role

if TYPE_CHECKING:
    import plotly.graph_objects as go


def place(azimuth_deg: Array, elevation_deg: Array) -> Array:
    """Points (n, 2) of the plot, in degrees from straight up."""
    a = np.radians(azimuth_deg)
    return (90.0 - np.asarray(elevation_deg))[:, None] * np.column_stack([np.sin(a), np.cos(a)])


def sky_plot(azimuth_deg: Array, elevation_deg: Array, names: Sequence[str],
             groups: Mapping[str, tuple[Sequence[int] | Array, Role]], rim: Array | None = None) -> "go.Figure":
    """groups: key -> numbers of satellites and their role; rim (k, 2): azimuth and elevation of what hides the sky."""
    rings = fig.line("rings", *_rings(), "muted", width=1.2)
    rings.showlegend = False
    traces = [rings]
    if rim is not None:
        edge = place(rim[:, 0], rim[:, 1])
        traces.append(fig.line("mask", edge[:, 0], edge[:, 1], "warning"))
    at = place(azimuth_deg, elevation_deg)
    for key, (members, role) in groups.items():
        chosen = np.asarray(members, dtype=int)
        trace = fig.markers(key, at[chosen, 0], at[chosen, 1], role, size=13)
        trace.mode, trace.text, trace.textposition = "markers+text", [names[i] for i in chosen], "top center"
        traces.append(trace)
    chart = fig.chart(*traces, equal=True, x_range=(-100.0, 100.0), y_range=(-100.0, 100.0))
    ticks = {"tickvals": [-90, -60, -30, 0, 30, 60, 90], "ticktext": ["90", "60", "30", "0", "30", "60", "90"],
             "showgrid": False, "zeroline": False}
    chart.layout.xaxis.update(**ticks, constrain="domain")
    chart.layout.yaxis.update(**ticks, constrain="domain")
    return chart


def _rings() -> tuple[Array, Array]:
    """Circles of elevation 60, 30 and 0 degrees and the cross of north, east, south and west, in one stroke."""
    t = np.radians(np.linspace(0.0, 360.0, 73))
    circle = np.column_stack([np.sin(t), np.cos(t)])
    quarter = circle[36:55]                                  # from south to west
    path = np.concatenate([30.0 * circle, 60.0 * circle, 90.0 * circle, [[0.0, -90.0]], 90.0 * quarter, [[90.0, 0.0]]])
    return path[:, 0], path[:, 1]
