"""The residual norm as a surface over the plane, as in exercise 2.16, and what the straight lines make of it."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.kit.lesson import Moment
from lessons.kit.scene import Item, Label, Orbit, Points, Polyline, Segments, Stations, Surface
from lessons.static._gauss_newton_model import residual_norms

if TYPE_CHECKING:
    from lessons.static.gauss_newton import Params, Result

HEIGHT = 0.55                                # of the surface's highest point, in sides of the picture
MODEL_CELLS = 33
SOLVE = 1


def surface(p: "Params", r: "Result", at: Moment, done: Array) -> tuple[list[Item], Orbit]:
    """The surface, the linearised one at x_k, and the iterates on it."""
    (x0, y0), (x1, y1) = r.box.tolist()
    side = max(x1 - x0, y1 - y0)
    rise = HEIGHT * side / float(r.norms.max())
    items: list[Item] = [
        *_floor(p, r, rise),
        Surface("norm_surface", *r.axes, rise * r.norms, role="prior", opacity=0.6, contours=12),
    ]
    if r.fix is not None:
        if at.stage <= SOLVE:
            items += _model(p, r, at.step, rise)
        seen = done[((done >= r.box[0]) & (done <= r.box[1])).all(axis=1)]
        if len(seen):
            high = np.column_stack([seen, rise * residual_norms(p, seen)])
            low = np.column_stack([seen, np.zeros(len(seen))])
            items += [Points("surface_iterates", high, role="vector", size=12),
                      Segments("poles", np.stack([low, high], axis=1), role="vector", width=2.0),
                      Polyline("surface_path", low, role="vector", width=2.5)]
    for i, end in enumerate(r.ends):
        if ((end >= r.box[0]) & (end <= r.box[1])).all():
            items.append(Label(f"surface_end_{'abc'[i]}", "ABC"[i], (*end, -0.04 * side), 1.1))
    stations = np.asarray(r.sensor.stations_m)
    items.append(Stations("stations", stations, tuple(f"S{k + 1}" for k in range(len(stations)))))
    camera = Orbit((0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.2 * side), 0.78 * side, azimuth_deg=-62.0, elevation_deg=36.0)
    return items, camera


def _model(p: "Params", r: "Result", k: int, rise: float) -> list[Item]:
    """|p(x_k) + J (x - x_k)| near x_k, cut off where it is higher than the surface ever is."""
    x, J, residual = r.fix.iterates[k], r.fix.jacobians[k], r.fix.residuals[k]
    if ((x < r.box[0]) | (x > r.box[1])).any():
        return []
    middle = np.clip(x + r.fix.steps[k], *r.box)
    half = 0.35 * float((r.box[1] - r.box[0]).max())
    axes = [np.linspace(max(c - half, low), min(c + half, high), MODEL_CELLS)
            for c, (low, high) in zip(middle, r.box.T, strict=True)]
    points = np.stack(np.meshgrid(*axes), axis=-1)
    gone = residual + (points - x) @ J.T
    norms = np.linalg.norm(gone / np.sqrt(np.diagonal(r.sensor.R)) if p.weighted else gone, axis=-1)
    return [Surface("model_surface", *axes, rise * np.minimum(norms, float(r.norms.max())), role="linearised",
                    opacity=0.45, contours=8)]


def _floor(p: "Params", r: "Result", rise: float) -> list[Item]:
    """The rim of the map with its numbers, and an upright for the residual norm."""
    (x0, y0), (x1, y1) = r.box.tolist()
    pad = 0.05 * max(x1 - x0, y1 - y0)
    top = float(r.norms.max())
    unit = "" if p.weighted else " m"
    xs, ys = (np.arange(np.ceil(low / 50.0), np.floor(high / 50.0) + 1) * 50.0 for low, high in r.box.T)
    return [
        Polyline("rim", [(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)], role="muted", width=1.5,
                 closed=True),
        Segments("upright", np.array([[(x0, y0, 0.0), (x0, y0, rise * top)]]), role="muted", width=2.0),
        *(Label(f"x_{i}", f"{x:.0f}".replace("-", "−"), (x, y0 - pad, 0.0), 0.8) for i, x in enumerate(xs)),
        *(Label(f"y_{i}", f"{y:.0f}".replace("-", "−"), (x1 + pad, y, 0.0), 0.8) for i, y in enumerate(ys)),
        Label("x_title", "x₁, east (m)", (0.5 * (x0 + x1), y0 - 2.6 * pad, 0.0), 0.9),
        Label("y_title", "x₂, north (m)", (x1 + 3.2 * pad, 0.5 * (y0 + y1), 0.0), 0.9),
        Label("height_title", f"‖p‖ up to {top:.3g}{unit}", (x0, y0, rise * top + pad), 0.9, "left"),
    ]
