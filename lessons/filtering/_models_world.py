"""A track that stands, drives and turns, and the filters that follow it: one per model, and the IMM of all three."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core import imm, kalman, metrics
from core.imm import ImmStep
from core.mixture import Mixture
from core.motion import LinearMotion, constant_velocity
from core.sensors import Position
from core.turn import known_turn, standing
from core.types import Array, Gaussian
from lessons.filtering._with_start import with_start
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.filtering.multiple_models import Params

STAND, DRIVE, TURN = range(3)
PHASES = ((STAND, 15), (DRIVE, 20), (TURN, 20), (DRIVE, 20), (STAND, 15))     # model, seconds
STEPS = sum(seconds for _, seconds in PHASES)
CHANGES = tuple(np.cumsum([seconds for _, seconds in PHASES])[:-1].tolist())  # the last second of each phase
STAND_DRIFT_M = 0.1                      # of a standing position, per square root of a second
STAND_SPEED_MPS = 3.0                    # 1 sigma with which a standing filter may start again
RUNS = 20                                # of the comparison with other noises
NOISES = np.geomspace(0.05, 5.0, 11)     # sigma_c of one straight model, m/s per square root of a second


class Result(NamedTuple):
    """One run with all its intermediates; arrays with STEPS entries begin one second after the start."""

    truth: Array                 # (STEPS + 1, 4) position and velocity
    model: Array                 # (STEPS + 1,) which model the truth obeys in the second that ends there
    y: Array                     # (STEPS, 2) measured positions
    transition: Array            # (3, 3)
    initial: Mixture
    imm: ImmStep                 # arrays (STEPS, ...)
    alone: tuple[Gaussian, ...]  # one Kalman filter for each model, (STEPS + 1, ...)
    combined: Gaussian           # the IMM's estimate, (STEPS + 1, ...)
    errors: dict[str, Array]     # (STEPS + 1,) of the position, in m: imm, stand, drive, turn
    noise_rmse: Array            # (11,) of one straight model over RUNS runs, for each of NOISES
    imm_rmse: float              # of the IMM over the same runs

    @property
    def probabilities(self) -> Array:
        """(STEPS + 1, 3) of the models, the start included."""
        return np.vstack([self.initial.weights, self.imm.probabilities])


def track(p: "Params") -> tuple[Array, Array]:
    """The true states (STEPS + 1, 4), east first, and the model of each second (STEPS + 1,)."""
    turn = np.radians(p.turn_deg_s)
    moves = {DRIVE: constant_velocity(1.0, 0.0, 2), TURN: known_turn(1.0, 0.0, turn)}
    position, velocity = np.zeros(2), np.array([p.speed_mps, 0.0])
    states, models = [np.zeros(4)], [PHASES[0][0]]
    for model, seconds in PHASES:
        for _ in range(seconds):
            if model != STAND:
                moved = moves[model].f(np.concatenate([position, velocity]))
                position, velocity = moved[:2], moved[2:]
            states.append(np.concatenate([position, np.zeros(2) if model == STAND else velocity]))
            models.append(model)
    return np.array(states), np.array(models)


def motions(p: "Params", sigma_c: float | None = None) -> tuple[LinearMotion, ...]:
    """Standing, straight and turning, with the noise of the slider or another."""
    s = p.sigma_c if sigma_c is None else sigma_c
    return (standing(1.0, STAND_DRIFT_M, STAND_SPEED_MPS), constant_velocity(1.0, s, 2),
            known_turn(1.0, s, float(np.radians(p.model_turn_deg_s))))


def run_filters(p: "Params", progress: Progress) -> Result:
    """Measures along the track, then runs the IMM, each model alone, and the comparison over more runs."""
    truth, model = track(p)
    shown, more = np.random.default_rng(p.seed).spawn(2)
    y = truth[1:, :2] + p.sigma_m * shown.standard_normal((STEPS, 2))
    initial = Gaussian(np.zeros(4), np.diag([10.0, 10.0, 3.0, 3.0]) ** 2)
    sensor, models = Position(2, p.sigma_m), motions(p)
    transition = imm.sojourn_transition([p.stay_stand_s, p.stay_drive_s, p.stay_turn_s])
    start = imm.bank(initial, np.full(3, 1.0 / 3.0))
    run = imm.run(start, y, models, transition, sensor, progress=lambda done: progress(0.3 * done))
    alone = tuple(with_start(initial, kalman.run(initial, y, m, sensor).posterior) for m in models)
    combined = with_start(initial, run.estimate)
    ys = truth[1:, None, :2] + p.sigma_m * more.standard_normal((STEPS, RUNS, 2))
    many = imm.run(start, ys, models, transition, sensor, progress=lambda done: progress(0.3 + 0.5 * done))
    noise_rmse = []
    for i, s in enumerate(NOISES):
        g = kalman.run(initial, ys, motions(p, float(s))[DRIVE], sensor).posterior
        noise_rmse.append(_rmse(g.mean, truth))
        progress(0.8 + 0.2 * (i + 1) / len(NOISES))
    errors = {name: np.linalg.norm(g.mean[:, :2] - truth[:, :2], axis=1)
              for name, g in (("imm", combined), *zip(("stand", "drive", "turn"), alone, strict=True))}
    return Result(truth, model, y, transition, start, run, alone, combined, errors, np.array(noise_rmse),
                  _rmse(many.estimate.mean, truth))


def _rmse(means: Array, truth: Array) -> float:
    """Over all runs and seconds, of the position: means (STEPS, RUNS, 4)."""
    return float(metrics.rmse(means[..., :2], np.broadcast_to(truth[1:, None, :2], (*means.shape[:-1], 2))))
