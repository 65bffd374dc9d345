"""The joint density as a hill over the floor, cut by a vertical plane; the laws of x and of y on the walls."""

from typing import TYPE_CHECKING

import numpy as np

from core.gaussian import log_density
from core.types import Array, Gaussian
from lessons.background._conditioning_figures import equations, figures, readouts
from lessons.kit.lesson import Moment, View
from lessons.kit.panels import nice_step
from lessons.kit.scene import Item, Label, Orbit, Points, Polyline, Segments, Surface, Walls

if TYPE_CHECKING:
    from lessons.background.conditioning import Params, Result

JOINT, CUT, SCALE, COMPARE, REGRESSION = range(5)
HILL, CURVES = 12.0, 14.0                # heights of the highest joint density and of the highest curve, scene units
MESH = 49                                # points of the hill along each axis
LINE = 161                               # points of a curve
SHOWN = 700                              # samples on the floor


def view(p: "Params", r: "Result", at: Moment) -> View:
    """Everything up to this stage."""
    mean, sd = float(r.given.mean[0]), float(np.sqrt(r.given.cov[0, 0]))
    caption = f"y = {p.probe[1]:.3g} m: x = {mean:.2f} ± {sd:.2f} m; before ± {p.sigma_x_m:.2f} m (1σ)"
    far = abs(p.probe[1]) / float(np.sqrt(r.y_law.cov[0, 0]))
    note = f"This y lies {far:.1f}σ from its mean: it would hardly ever be measured." if far > 3.5 else (
        "H = 0: y does not depend on x, and every slice has the law of x." if p.gain == 0.0 else "")
    return View(
        scene=_scene(p, r, at.stage), camera=Orbit((0.0, 0.0, 4.5), 22.5, azimuth_deg=-71.0, elevation_deg=26.0),
        figures=figures(p, r), readouts=readouts(p, r), equations=equations(p, r, at.stage),
        caption=caption.replace("-", "−") if at.stage >= SCALE else f"before: x = 0 ± {p.sigma_x_m:.2f} m (1σ)",
        note=note)


def _scene(p: "Params", r: "Result", stage: int) -> list[Item]:
    x_p, y = p.probe
    items = [*_floor(), *_samples(r, stage), *_hill(p, r, stage)]
    t = np.linspace(-_half(), _half(), LINE)
    unit = CURVES / max(_peak(r.x_law), _peak(r.given))    # scene units for 1/m
    if stage == JOINT:
        items.append(Label("hill_name", "f(x, y) (1/m²)", (0.0, 0.0, HILL + 1.3), 1.0))
    if stage >= CUT:
        slice_ = _joint(r, np.column_stack([t, np.full(LINE, y)])) * _hill_unit(r)
        items += [Walls("plane", np.array([[[-_half(), y], [_half(), y]]]), height=CURVES, role="measurement",
                        opacity=0.1),
                  _upright("slice", t, y, slice_, "measurement", 4.0),
                  Segments("cut_face", _hatch(t[::2], y, slice_[::2]), role="measurement", width=2.0, fade=0.35),
                  *_y_law(r, unit, y), *_scale(unit)]
    if stage >= SCALE:
        given = _density(r.given, t) * unit
        tail = t <= x_p
        items += [_upright("given", t, y, given, "posterior", 5.0),
                  Segments("below", _hatch(t[tail], y, given[tail]), role="posterior", width=1.5, fade=0.45),
                  Label("given_name", "f(x | y) (1/m)", (float(r.given.mean[0]), y, _peak(r.given) * unit + 1.3), 1.0)]
    if stage >= COMPARE:
        back = _half()
        alone = _density(r.x_law, t) * unit
        items += [_upright("x_law", t, back, alone, "prior", 5.0),
                  Label("x_law_name", "f(x) (1/m)", (0.0, back, _peak(r.x_law) * unit + 1.2), 1.0),
                  _upright("given_shadow", t, back, _density(r.given, t) * unit, "posterior", 2.5, dashed=True)]
    if stage >= REGRESSION:
        items += _regression(r, y)
    return items


def _half() -> float:
    from lessons.background.conditioning import HALF_M

    return HALF_M


def _joint(r: "Result", points: Array) -> Array:
    return np.exp(log_density(r.joint, points))


def _density(g: Gaussian, t: Array) -> Array:
    return np.exp(log_density(g, t[:, None]))


def _peak(g: Gaussian) -> float:
    """Largest density of a law of one component."""
    return float(1.0 / np.sqrt(2.0 * np.pi * g.cov[0, 0]))


def _hill_unit(r: "Result") -> float:
    """Scene units for 1/m² of the joint density."""
    return HILL / float(_joint(r, np.zeros((1, 2)))[0])


def _upright(name: str, t: Array, y: float, heights: Array, role: str, width: float, dashed: bool = False) -> Polyline:
    """A curve over the line y = const; only where it leaves the floor."""
    rows = np.column_stack([t, np.full(len(t), y), heights])
    seen = np.flatnonzero(heights >= 1e-3 * heights.max())
    return Polyline(name, rows[max(seen[0] - 1, 0):seen[-1] + 2], role=role, width=width,  # type: ignore[arg-type]
                    dashed=dashed)


def _hatch(t: Array, y: float, heights: Array) -> Array:
    """Vertical segments from the floor to the curve."""
    seen = heights > 0.02
    foot = np.column_stack([t[seen], np.full(int(seen.sum()), y), np.zeros(int(seen.sum()))])
    return np.stack([foot, foot + np.column_stack([0.0 * heights[seen], 0.0 * heights[seen], heights[seen]])], axis=1)


def _hill(p: "Params", r: "Result", stage: int) -> list[Item]:
    """The joint density; once it is cut, what lies before the plane is taken away."""
    h, y = _half(), p.probe[1]
    low = y if stage >= CUT and not p.whole else -h
    if low > h - 0.5:
        return []
    sd_x, sd_y = np.sqrt(np.diagonal(r.joint.cov))
    xs = np.linspace(-1.0, 1.0, MESH) * min(h, 3.2 * float(sd_x))
    ys = np.linspace(max(low, -3.2 * float(sd_y)), min(h, 3.2 * float(sd_y)), MESH)
    if ys[-1] - ys[0] < 0.2:
        return []
    z = _joint(r, np.stack(np.meshgrid(xs, ys), axis=-1)) * _hill_unit(r)
    return [Surface("hill", xs, ys, z, role="prior", opacity=0.45, contours=8)]


def _samples(r: "Result", stage: int) -> list[Item]:
    seen = (np.abs(r.draws) < _half()).all(axis=1)
    near = r.near & (stage >= SCALE)
    items: list[Item] = [Points("samples", r.draws[seen & ~near][:SHOWN], role="monte_carlo", size=3.0, fade=0.3)]
    if stage >= SCALE:
        items.append(Points("near", r.draws[seen & near][:SHOWN], role="posterior", size=4.0))
    return items


def _y_law(r: "Result", unit: float, y: float) -> list[Item]:
    """f_y on the left wall; its height at y is the area of the slice."""
    h = _half()
    t = np.linspace(-h, h, LINE)
    wall = np.column_stack([np.full(LINE, -h), t, _density(r.y_law, t) * unit])
    return [Polyline("y_law", wall, role="reference", width=3.5),
            Segments("f_y", np.array([[[-h, y, 0.0], [-h, y, r.f_y * unit]]]), role="measurement", width=5.0),
            Label("y_law_name", "f(y) (1/m)", (-h, 0.0, _peak(r.y_law) * unit + 1.2), 1.0)]


def _scale(unit: float) -> list[Item]:
    """An upright ruler for the curves at the right end of the back wall; the hill has a scale of its own."""
    h = _half()
    step = nice_step(CURVES / unit / 4.0)
    at = np.arange(0.0, CURVES / unit * 1.001, step)
    foot = np.array([h, h, 0.0])
    ticks = foot + np.column_stack([np.zeros(len(at)), np.zeros(len(at)), at * unit])
    lines = [[foot, foot + np.array([0.0, 0.0, CURVES])], *([t, t + np.array([0.8, 0.0, 0.0])] for t in ticks)]
    return [Segments("ruler", np.array(lines), role="reference", width=1.5),
            *(Label(f"ruler_{i}", f"{v:.3g}", t + np.array([1.0, 0.0, 0.0]), 0.75, "left")
              for i, (v, t) in enumerate(zip(at[1:], ticks[1:], strict=True)))]


def _regression(r: "Result", y: float) -> list[Item]:
    """E(x | y) on the floor with one standard deviation to each side, and where it is now."""
    h, sd = _half(), float(np.sqrt(r.given.cov[0, 0]))
    t = np.linspace(-h, h, 2)
    found: list[Item] = []
    for name, shift, width, dashed in (("mean_line", 0.0, 4.0, False), ("low_line", -sd, 2.0, True),
                                       ("high_line", sd, 2.0, True)):
        ends = np.column_stack([r.K * t + shift, t, np.full(2, 0.05)])
        found.append(Polyline(name, _on_floor(ends), role="vector", width=width, dashed=dashed))
    mean = float(r.given.mean[0])
    return [*found, Points("mean", [[mean, y, 0.05]], role="vector", size=12.0),
            Label("mean_name", "E(x | y)", (r.K * 0.86 * h + 1.8, 0.86 * h, 0.0), 0.95)]


def _on_floor(ends: Array) -> Array:
    """The part of a segment with |x| inside the floor."""
    h = _half()
    x0, d = float(ends[0, 0]), float(ends[1, 0] - ends[0, 0])
    if abs(d) < 1e-12:
        return ends
    shares = np.sort([(-h - x0) / d, (h - x0) / d])
    low, high = max(0.0, float(shares[0])), min(1.0, float(shares[1]))
    return ends[0] + np.array([[low], [high]]) * (ends[1] - ends[0])


def _floor() -> list[Item]:
    """The plane of (x, y) with a grid and numbers every 8 m."""
    h = _half()
    at = np.arange(-h, h + 1.0, 8.0)
    lines = [[[v, -h, 0.0], [v, h, 0.0]] for v in at] + [[[-h, v, 0.0], [h, v, 0.0]] for v in at]
    return [Segments("grid", np.array(lines), role="muted", width=1.0, fade=0.5),
            *(Label(f"x_{i}", f"{v:.0f}".replace("-", "−"), (v, -h - 1.4, 0.0), 0.8) for i, v in enumerate(at)),
            *(Label(f"y_{i}", f"{v:.0f}".replace("-", "−"), (h + 1.4, v, 0.0), 0.8) for i, v in enumerate(at)),
            Label("x_title", "x (m)", (0.0, -h - 3.8, 0.0), 1.0), Label("y_title", "y (m)", (h + 3.6, 0.0, 0.0), 1.0)]
