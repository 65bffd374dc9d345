"""p(x) = sum_i w_i N(x; mu_i, P_i): a bank of Kalman filters that splits, reweights and merges.

MAT 3.5, Example 22, exercise 3.11 and its lemma.  The notes do not give the true track of Example 22; it is
x(t) = [-150 + 3 t, -30 + 3 t] m here, as in the lesson on the particle filter.
"""

from dataclasses import dataclass

from lessons.filtering import _mixture_exercise as exercise
from lessons.filtering import _mixture_view as example
from lessons.filtering._lab_worlds import STEPS
from lessons.filtering._mixture_model import Track, run_filters
from lessons.kit.lesson import Lesson, Moment, Progress, Timeline, View
from lessons.kit.params import Point, choice, draggable, seed, slider, switch

ONLY = {
    "example_22": ("components", "split_m", "parts", "merge_nats", "sigma_m", "n_particles", "cloud", "ekf", "zoom"),
    "exercise_3_11": ("alpha", "sigma", "q_1", "q_2", "mu_1", "mu_2", "f_1", "f_2", "probe"),
}


@dataclass(frozen=True, slots=True)
class Params:
    """The filter's choices on Example 22, or the numbers of exercise 3.11."""

    problem: str = choice("example_22", tuple(ONLY), group="problem")
    components: int = slider(12, low=1, high=32, group="mixture")
    split_m: float = slider(12.0, low=4.0, high=80.0, log=True, unit="m", group="mixture")
    parts: int = slider(3, low=2, high=5, group="mixture")
    merge_nats: float = slider(0.02, low=0.001, high=1.0, log=True, unit="nat", group="mixture")
    sigma_m: float = slider(10.0, low=2.0, high=50.0, step=1.0, unit="m", group="world")
    cloud: bool = switch(True, group="compare")
    ekf: bool = switch(True, group="compare")
    n_particles: int = slider(20_000, low=200, high=50_000, log=True, group="compare")
    alpha: float = slider(0.3, low=0.0, high=1.0, step=0.05, group="law")
    sigma: float = slider(1.0, low=0.2, high=2.0, step=0.1, group="law")
    q_1: float = slider(0.5, low=0.05, high=4.0, step=0.05, group="law")
    q_2: float = slider(0.2, low=0.05, high=4.0, step=0.05, group="law")
    mu_1: Point = draggable((0.0, 0.0), low=-10.0, high=10.0, unit="", role="prior", group="points")
    mu_2: Point = draggable((4.0, 2.0), low=-10.0, high=10.0, unit="", role="prior", group="points")
    f_1: Point = draggable((1.0, 0.0), low=-3.0, high=3.0, unit="", role="vector", group="points")
    f_2: Point = draggable((1.0, 1.0), low=-3.0, high=3.0, unit="", role="vector", group="points")
    probe: Point = draggable((3.0, 1.0), low=-20.0, high=20.0, unit="", role="measurement", group="points")
    seed: int = seed(2681, group="world")
    zoom: str = choice("track", ("track", "tree", "crossing"), group="view")


def compute(p: Params, progress: Progress) -> Track | exercise.Blurred:
    """The filters on Example 22, or the exercise in closed form and by draws."""
    return run_filters(p, progress) if p.problem == "example_22" else exercise.solve(p)


def view(p: Params, r: Track | exercise.Blurred, at: Moment) -> View:
    """A step of the filter, or of the exercise."""
    return example.view(p, r, at) if isinstance(r, Track) else exercise.view(p, r, at)


def timeline(p: Params) -> Timeline:
    """Forty seconds of six stages each, or the exercise's four steps; the end is shown first."""
    if p.problem == "exercise_3_11":
        return Timeline(exercise.LAW, start=exercise.LAW, unit_name="step")
    return Timeline(STEPS, example.STAGES, start=STEPS, unit="s")


def unused(p: Params) -> tuple[str, ...]:
    """The controls of the other problem."""
    return next(names for problem, names in ONLY.items() if problem != p.problem)


LESSON = Lesson(
    Params, compute, view, timeline=timeline, unused=unused,
    refs=("MAT 3.5", "MAT exercise 3.11", "MAT Example 22", "MAT (3.18)", "MAT 3.3.1"),
    presets={
        "Example 22": {},
        "the crossing in slow motion": {"zoom": "crossing", "cloud": False, "step": 10, "stage": "reduce"},
        "one component is an EKF": {"components": 1, "split_m": 80.0},
        "one component, but split": {"components": 1},
        "two components are too few": {"components": 2},
        "split too finely": {"split_m": 4.0},
        "exercise 3.11": {"problem": "exercise_3_11"},
    },
)
