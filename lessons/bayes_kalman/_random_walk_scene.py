"""The walk as a map, and under it one magnifying glass per filter round the point where the walker is now."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core.gaussian import chi_square_level, ellipse
from core.types import Array, Gaussian
from lessons.kit.curves import clipped, square
from lessons.kit.lesson import Moment
from lessons.kit.roles import Role
from lessons.kit.scene import Item, Label, LevelEllipse, Plane, Points, Polyline, Segments

if TYPE_CHECKING:
    from lessons.bayes_kalman.random_walk import Result, Track

PREDICT, GAIN, UPDATE = range(3)
ROLES: dict[str, Role] = {"stiff": "kf", "flexible": "ukf"}
CLOSEST_M, FARTHEST_M = 3.0, 15.0        # limits of what a glass shows to each side


class Glass(NamedTuple):
    """A square of the picture that shows what lies within `half` metres of `centre`, `scale` times as large."""

    middle: Array                # (2,) of the square, in the scene
    half: float                  # m
    scale: float
    centre: Array                # (2,) m: what is looked at

    def to_scene(self, points: Array) -> Array:
        return self.middle + self.scale * (points - self.centre)

    def law(self, g: Gaussian) -> Gaussian:
        return Gaussian(self.to_scene(g.mean[:2]), self.scale**2 * g.cov[:2, :2])

    def inside(self, points: Array) -> Array:
        """Which of the points (n, 2) it shows."""
        return (np.abs(points - self.centre) < 0.98 * self.half).all(axis=-1)

    @property
    def corners(self) -> Array:
        side = self.half * self.scale
        return self.middle + side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


class Layout(NamedTuple):
    """Where the map and the glasses lie; the same at every moment."""

    low: Array                   # (2,) corner of the map
    high: Array
    half: float                  # m: what a glass shows to each side
    side: float                  # of a glass in the scene
    gap: float


def layout(r: "Result") -> Layout:
    shown = np.vstack([r.truth, r.y, *(t.steps.posterior.mean[:, :2] for t in (r.stiff, r.flexible))])
    low, high = shown.min(axis=0), shown.max(axis=0)
    wide = max(float(high[0] - low[0]), 0.7 * float(high[1] - low[1]))
    gap = 0.03 * wide
    settled = [np.abs(t.errors[2:]).max() for t in (r.stiff, r.flexible)]
    half = float(np.clip(np.ceil(1.3 * max(settled) + 0.5), CLOSEST_M, FARTHEST_M))
    middle = (low[0] + high[0]) / 2
    return Layout(np.array([middle - wide / 2, low[1]]), np.array([middle + wide / 2, high[1]]), half,
                  (wide - gap) / 2, gap)


def camera(r: "Result") -> Plane:
    a = layout(r)
    return Plane((float(a.low[0] - 2.5 * a.gap), float(a.high[0] + a.gap)),
                 (float(a.low[1] - 4.5 * a.gap - a.side), float(a.high[1] + a.gap)), axes=False)


def scene(r: "Result", at: Moment) -> list[Item]:
    """Both filters up to this step; the step itself up to this stage."""
    k, stage = at.step, at.stage
    now = point_of(r, k)
    done = k if stage == UPDATE or k == 0 else k - 1
    seen = now if k == 0 or stage >= GAIN else now - 1
    a = layout(r)
    items = _ruler(a)
    if seen >= 0:
        items.append(Points("measurements", r.y[:seen + 1], role="measurement", size=5))
    items += [Polyline("truth", r.truth, role="truth", dashed=True, width=2.5),
              Points("truth_now", r.truth[[now]], role="truth", size=10, shape="diamond")]
    top = a.low[1] - 4.0 * a.gap
    for i, (name, t) in enumerate((("stiff", r.stiff), ("flexible", r.flexible))):
        path = np.vstack([t.start.mean[:2], t.steps.posterior.mean[:done, :2]])
        if len(path) > 1:
            items.append(Polyline(name, path, role=ROLES[name], width=3))
        middle = np.array([a.low[0] + a.side * (0.5 + i) + a.gap * i, top - a.side / 2])
        glass = Glass(middle, a.half, a.side / (2 * a.half), r.truth[now])
        items += _through(glass, name, t, r, path, at, seen)
    around = r.truth[now] + a.half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return [*items, Polyline("window", around, role="muted", width=1.5, closed=True)]


def _through(glass: Glass, name: str, t: "Track", r: "Result", path: Array, at: Moment, seen: int) -> list[Item]:
    """What one glass shows of its filter."""
    k, now = at.step, point_of(r, at.step)
    role = ROLES[name]
    items: list[Item] = [Polyline(f"{name}_frame", glass.corners, role="muted", width=1.5, closed=True)]
    near = r.y[:max(seen + 1, 0)]
    near = near[glass.inside(near)]
    if len(near):
        items.append(Points(f"{name}_measurements", glass.to_scene(near), role="measurement", size=7, fade=0.35))
    for key, line, width, of in (("truth", r.truth, 2.0, "truth"), ("path", path, 4.0, role)):
        pieces = clipped(line, square(glass.centre, glass.half))
        if len(pieces):
            items.append(Segments(f"{name}_{key}", glass.to_scene(pieces), role=of, width=width))
    early = k > 0 and at.stage < UPDATE
    g = (Gaussian(t.steps.prior.mean[k - 1], t.steps.prior.cov[k - 1]) if early
         else t.start if k == 0 else Gaussian(t.steps.posterior.mean[k - 1], t.steps.posterior.cov[k - 1]))
    items += _ellipse(glass, f"{name}_prior" if early else f"{name}_posterior", g, role, early)
    items.append(Points(f"{name}_truth_now", glass.middle[None], role="truth", size=12, shape="diamond"))
    if seen == now and glass.inside(r.y[[now]])[0]:
        y = glass.to_scene(r.y[now])
        items += [Points(f"{name}_y", y[None], role="measurement", size=13),
                  Label(f"{name}_y_label", "y", y + glass.scale * glass.half * 0.08)]
    corner = glass.corners[3] + np.array([0.04, -0.07]) * 2 * glass.half * glass.scale
    bar = glass.corners[0] + np.array([0.05, 0.06]) * 2 * glass.half * glass.scale
    return [*items, Label(f"{name}_name", name, corner, anchor="left", size=1.1),
            Segments(f"{name}_bar", np.array([[bar, bar + np.array([glass.scale, 0.0])]]), role="reference", width=4),
            Label(f"{name}_metre", "1 m", bar + np.array([1.25 * glass.scale, 0.0]), anchor="left", size=0.9)]


def _ellipse(glass: Glass, name: str, g: Gaussian, role: Role, early: bool) -> list[Item]:
    """The 68 % ellipse, or what the glass shows of it."""
    g = Gaussian(g.mean[:2], g.cov[:2, :2])
    rim = ellipse(g, chi_square_level(0.68, 2))
    if glass.inside(rim).all():
        return [LevelEllipse(name, glass.law(g), role=role, dashed=early, filled=not early)]
    pieces = clipped(rim, square(glass.centre, glass.half))
    return [Segments(name, glass.to_scene(pieces), role=role, width=3)] if len(pieces) else []


def _ruler(a: Layout) -> list[Item]:
    """Axes of the map alone: the glasses have their own scale."""
    wide = a.high[0] - a.low[0]
    step = min((s for s in (5.0, 10.0, 20.0, 50.0, 100.0, 200.0) if wide / s <= 8.0), default=500.0)
    y0, x0, tick = a.low[1] - 0.5 * a.gap, a.low[0] - 0.5 * a.gap, 0.3 * a.gap
    xs, ys = (np.arange(np.ceil(a.low[i] / h), np.floor(a.high[i] / h) + 1) * h + 0.0
              for i, h in enumerate((step, step / 2)))
    lines = [[[x0, y0], [a.high[0], y0]], [[x0, y0], [x0, a.high[1]]]]
    lines += [[[x, y0], [x, y0 - tick]] for x in xs] + [[[x0, y], [x0 - tick, y]] for y in ys]
    return [Segments("ruler", np.array(lines), role="reference", width=1.5),
            *(Label(f"x_{i}", f"{x:g}" + " m" * (i == len(xs) - 1), (x, y0 - 1.3 * a.gap), size=0.85)
              for i, x in enumerate(xs)),
            *(Label(f"y_{i}", f"{y:g}", (x0 - 1.2 * a.gap, y), size=0.85) for i, y in enumerate(ys))]


def point_of(r: "Result", k: int) -> int:
    """The point of the walk that the estimate of step k is about."""
    return max(k - 1 + r.offset, 0)
