"""How the true and a computed attitude are drawn: two triads on a sphere, and the paths of their axes."""

from typing import TYPE_CHECKING

import numpy as np

from core.types import Array
from lessons.background._attitude_rate_figures import ROLES, equations, figures, readouts
from lessons.background._attitude_rate_model import motion_of
from lessons.kit.lesson import Moment, View
from lessons.kit.scene import Arrow, Frame, Globe, Item, Label, Orbit, Points, Polyline

if TYPE_CHECKING:
    from lessons.background.attitude_rate import Params, Result

FRAMES = 40                                  # of the timeline in a turn
PATH = 400                                   # points of a path at most
NAMES = {"naive": "naive", "start": "start", "middle": "middle", "bortz": "Bortz"}


def view(p: "Params", r: "Result", at: Moment) -> View:
    """The attitudes at step / FRAMES of a turn; the computed one is that of the latest sample."""
    sample = latest_sample(p, at.step)
    error = float(r.track.error_deg[p.method][sample])
    items = [*_truth(p, r, at.step), *_computed(p, r, sample)]
    if error > 12.0:                                     # else its name would cover that of the computed axis
        items.append(Label("true_x_name", "x true", 1.13 * r.true_C[at.step][:, 0] + [0.0, 0.0, 0.1], 0.95))
    return View(
        scene=items,
        camera=Orbit(centre=(0.0, 0.0, 0.1), radius=1.5, azimuth_deg=28.0, elevation_deg=32.0),
        figures=figures(r, at.step), readouts=readouts(p, r, sample), equations=equations(p, r, at.step, sample),
        caption=f"turn {at.step / FRAMES:.2f}, error of the drawn attitude {_degrees(error)}", note=_note(p))


def latest_sample(p: "Params", step: int) -> int:
    """Index of the last gyro sample at or before this step."""
    return min(step * p.samples // FRAMES, p.turns * p.samples)


def _degrees(angle: float) -> str:
    return "below 10⁻⁹ °" if angle < 1e-9 else f"{angle:.3g}°"


def _note(p: "Params") -> str:
    if p.motion == "fixed" and np.linalg.norm(p.axis) <= 1e-6:
        return "The axis has no direction; the z axis is taken."
    return ""


def _truth(p: "Params", r: "Result", step: int) -> list[Item]:
    """The sphere, the inertial axes, the true triad with the paths of its z and x axes, p and w."""
    motion = motion_of(p)
    t, C = r.frames_s[step], r.true_C[step]
    vector, rate = motion.p(t), C @ motion.w(t)
    turn = r.true_C[:FRAMES + 1]
    items: list[Item] = [
        Globe("sphere", role="reference", opacity=0.08),
        Frame("I", np.eye(3), size=1.3, labels=("x", "y", "z"), role="frame_a1", width=2.5, fade=0.4),
        Polyline("z_circle", turn[:, :, 2], role="muted", width=2.0),
        Polyline("x_circle", turn[:, :, 0], role="muted", width=2.0),
        Frame("truth", C, size=1.0, labels=("", "", ""), role="truth", width=5.0),
        Label("true_name", "z true", 1.13 * C[:, 2], 0.95),
    ]
    items += [Polyline(f"{axis}_path", r.true_C[max(0, step - FRAMES):step + 1, :, i], role="truth", width=3.0)
              for axis, i in (("z", 2), ("x", 0)) if step]
    if np.linalg.norm(vector) > 1e-6:
        shown = vector * min(1.0, 0.7 / np.linalg.norm(vector)) if p.motion == "fixed" else 2.5 * vector
        shown = shown * min(1.0, 1.2 / np.linalg.norm(shown))
        items.append(Arrow("p", np.zeros(3), shown, role="rotation", width=5.0))
        items.append(Label("p_name", "p", 1.12 * shown + [0.0, 0.0, 0.04]))
    rate = 0.9 * rate / np.linalg.norm(rate)
    items += [Arrow("w", np.zeros(3), rate, role="vector", width=5.0),
              Label("w_name", "w", 1.1 * rate + [0.0, 0.0, 0.04])]
    return items


def _computed(p: "Params", r: "Result", sample: int) -> list[Item]:
    """The triad of the chosen method at its latest sample, and the way of its axes."""
    role, C = ROLES[p.method], r.track.C[p.method]
    now = C[sample]
    items: list[Item] = [Frame("computed", now, size=0.9, labels=("", "", ""), role=role, width=7.0, fade=0.15),
                         Label("computed_name", f"x {NAMES[p.method]}", 1.1 * now[:, 0] + [0.0, 0.0, -0.08], 0.95)]
    way = C[:sample + 1: max(1, len(C) // PATH)]
    for axis, i in (("z", 2), ("x", 0)):
        points: Array = 1.005 * way[:, :, i]
        if len(points) > 1:
            items.append(Polyline(f"computed_{axis}_path", points, role=role, width=2.5))
        items.append(Points(f"computed_{axis}_samples", points[-40:], role=role, size=6.0))
    return items
