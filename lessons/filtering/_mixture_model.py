"""Example 22 through a Gaussian mixture filter, one EKF and a particle cloud, all on the same measurements."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from core import extended, mixture, particle
from core.forms import half_space_probability
from core.mixture import Mixture, MixtureStep, Upkeep
from core.sensors import Range
from core.types import Array, Gaussian
from lessons.filtering._histogram import weighted_density
from lessons.filtering._lab_worlds import STEPS, World, world
from lessons.filtering._with_start import with_start
from lessons.kit.lesson import Progress

if TYPE_CHECKING:
    from lessons.filtering.mixture import Params

WORLD = "example_22"
ENTRIES = (0, 1)                         # a component counts as wide by its position
PRUNE_BELOW = 1e-4
DRAWN = 700                              # particles kept for the picture
EDGES = np.linspace(-160.0, 160.0, 81)   # of the histogram of x2, in m
BELOW = np.array([0.0, 1.0, 0.0, 0.0])   # P(BELOW . x <= 0) is the probability of x2 <= 0


class Track(NamedTuple):
    """Three filters on one track; time runs over 0..STEPS, the start included."""

    stations: Array              # (2, 2)
    truth: Array                 # (STEPS + 1, 2)
    y: Array                     # (STEPS, 2) ranges in m
    initial: Mixture
    steps: tuple[MixtureStep, ...]
    law: Gaussian                # (STEPS + 1, 4), (STEPS + 1, 4, 4) moments of the mixture
    ekf: Gaussian
    pf: Gaussian
    cloud: Array                 # (STEPS + 1, M, 2) drawn particles before resampling
    cloud_weights: Array         # (STEPS + 1, M)
    histogram: Array             # (STEPS + 1, 80) density of x2 by the particles, in 1/m
    share: Array                 # (STEPS + 1,) P(x2 > 0) by the mixture
    share_ekf: Array
    share_pf: Array

    def posterior(self, k: int) -> Mixture:
        """The components that go on after step k."""
        return self.steps[k - 1].posterior if k else self.initial


def run_filters(p: "Params", progress: Progress) -> Track:
    """Measures along the straight track of the lesson on the particle filter, with the same noise for the same seed."""
    w = world(WORLD)
    measure, draw = np.random.default_rng(p.seed).spawn(2)
    sensor = Range(w.stations, p.sigma_m)
    truth = straight(w)
    y = sensor.h(truth[1:]) + p.sigma_m * measure.standard_normal((STEPS, 3))[:, :2]
    run = mixture.run(w.initial, y, w.motion, sensor, upkeep(p), progress=lambda done: progress(0.7 * done))
    ekf = extended.run(w.initial, y, w.motion, sensor).posterior
    pf = particle.run(
        w.initial, y, w.motion, sensor, p.n_particles, draw, subsample=DRAWN,
        keep=lambda k, step: (float(step.weights_before[step.predicted[:, 1] > 0.0].sum()),
                              weighted_density(step.predicted[:, 1], step.weights_before, EDGES)),
        progress=lambda done: progress(0.7 + 0.3 * done))
    shares, histograms = zip(*pf.kept, strict=True)
    start = pf.initial[:, 1]
    equal = np.full(len(start), 1.0 / len(start))
    ekf = with_start(w.initial, ekf)
    return Track(
        w.stations, truth[:, :2], y, run.initial, run.steps, with_start(w.initial, Gaussian(run.means, run.covs)),
        ekf, with_start(w.initial, Gaussian(pf.mean, pf.cov)),
        np.concatenate([pf.initial[None, :, :2], pf.predicted[..., :2]]), np.vstack([equal, pf.weights_before]),
        np.vstack([weighted_density(start, equal, EDGES), *histograms]),
        np.array([share_above(run.initial), *(share_above(s.update.posterior) for s in run.steps)]),
        _above(ekf), np.array([float((start > 0.0).mean()), *shares]))


def upkeep(p: "Params") -> Upkeep:
    """Split, prune and merge as the sliders say."""
    return Upkeep(p.split_m, ENTRIES, p.parts, prune_below=PRUNE_BELOW, merge_below=p.merge_nats,
                  max_components=p.components)


def share_above(m: Mixture) -> float:
    """P(x2 > 0), the probability of the side on which the walk ends."""
    return float(m.weights @ _above(Gaussian(m.means, m.covs)))


def side(m: Mixture, above: bool) -> tuple[float, Gaussian] | None:
    """Weight and moments of the components whose mean lies on one side of the stations' line; None without any."""
    chosen = (m.means[:, 1] > 0.0) == above
    w = m.weights * chosen
    total = float(w.sum())
    if total <= 0.0:
        return None
    return total, mixture.moments(mixture.mixture(w / total, m.means, m.covs))


def straight(w: World) -> Array:
    """x(t) = [-150 + 3 t, -30 + 3 t] m: the initial mean without noise, (STEPS + 1, 4)."""
    track = [w.initial.mean]
    for _ in range(STEPS):
        track.append(w.motion.f(track[-1]))
    return np.array(track)


def _above(g: Gaussian) -> Array:
    return 1.0 - half_space_probability(g, BELOW, 0.0)
