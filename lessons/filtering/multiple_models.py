"""mu_j ~ sum_i mu_i Pi_ij N(nu_j; 0, S_j): interacting multiple models, a filter for each way of moving.

MAT 3.1 mentions the method; Blom and Bar-Shalom 1988.  The track and its numbers are ours: 15 s standing, 20 s
straight on, 20 s turning left, 20 s straight on, 15 s standing.
"""

from dataclasses import dataclass

from lessons.filtering._models_view import STAGES, view
from lessons.filtering._models_world import STEPS, Result, run_filters
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import choice, seed, slider


@dataclass(frozen=True, slots=True)
class Params:
    """What the filter believes of the models, and how the user really moves."""

    stay_stand_s: float = slider(30.0, low=1.5, high=300.0, log=True, unit="s", group="models")
    stay_drive_s: float = slider(30.0, low=1.5, high=300.0, log=True, unit="s", group="models")
    stay_turn_s: float = slider(30.0, low=1.5, high=300.0, log=True, unit="s", group="models")
    model_turn_deg_s: float = slider(9.0, low=-20.0, high=20.0, step=0.5, unit="°/s", group="models")
    sigma_c: float = slider(0.2, low=0.02, high=3.0, log=True, unit="m/s/√s", group="models")
    sigma_m: float = slider(3.0, low=0.5, high=20.0, log=True, unit="m", group="world")
    speed_mps: float = slider(5.0, low=0.5, high=15.0, step=0.5, unit="m/s", group="world")
    turn_deg_s: float = slider(9.0, low=-20.0, high=20.0, step=0.5, unit="°/s", group="world")
    seed: int = seed(40, group="world")
    alone: str = choice("drive", ("none", "stand", "drive", "turn"), group="view")


def compute(p: Params, progress: Progress) -> Result:
    """The IMM and its rivals on one track."""
    return run_filters(p, progress)


def timeline(p: Params) -> Timeline:
    """Ninety seconds of five stages each; shown first: two seconds after the stop."""
    return Timeline(STEPS, STAGES, start=77, unit="s")


LESSON = Lesson(
    Params, compute, view, timeline=timeline, refs=("MAT 3.1", "MAT 3.5", "MAT (3.18)"),
    presets={
        "stop, drive, turn": {},
        "into the turn, stage by stage": {"step": 40, "stage": "predict"},
        "a turn that nobody expects": {"turn_deg_s": -9.0, "step": 55},
        "models that hardly last": {"stay_stand_s": 2.0, "stay_drive_s": 2.0, "stay_turn_s": 2.0},
        "models that nearly never change": {"stay_stand_s": 300.0, "stay_drive_s": 300.0, "stay_turn_s": 300.0},
        "positions too poor to tell": {"sigma_m": 15.0},
    },
)
