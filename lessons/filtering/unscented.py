"""The unscented transform of a normal law.  MAT 3.3.2, (3.16), (3.17), exercise 3.8."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.gaussian import sample
from core.linalg import cholesky_psd, sqrt_psd
from core.types import Array, Gaussian
from core.unscented import Transform, transform
from lessons.filtering._unscented_figures import BEST, DEGREES, KAPPAS
from lessons.filtering._unscented_maps import linearised, map_of, prior_of, reference, weighted_cov
from lessons.filtering._unscented_view import view
from lessons.kit.lesson import Lesson, Progress, Timeline
from lessons.kit.params import Point, choice, draggable, seed, slider

DRAWN = 1000                                 # of the Monte Carlo points
UNUSED = {"polar": ("degree", "station_2"), "two_ranges": ("degree",), "polynomial": ("station_1", "station_2")}


@dataclass(frozen=True, slots=True)
class Params:
    """The map, the spread of the sigma points, and the prior in the map's own units."""

    map: str = choice("polar", ("polar", "two_ranges", "polynomial"))
    kappa: float = slider(1.0, low=-1.9, high=8.0, step=0.1)
    mean: Point = draggable((0.0, 100.0), unit="m", role="prior")
    sigma_1: float = slider(2.0, low=0.1, high=300.0, unit="m", log=True)
    sigma_2: float = slider(15.0, low=0.1, high=300.0, unit="° or m", log=True)
    correlation: float = slider(0.0, low=-0.95, high=0.95, step=0.05, group="more")
    root: str = choice("cholesky", ("cholesky", "symmetric"), group="more")
    degree: int = slider(2, low=1, high=6, group="more")
    station_1: Point = draggable((0.0, 0.0), low=-500.0, high=500.0, unit="m", role="station", group="more")
    station_2: Point = draggable((60.0, 0.0), low=-500.0, high=500.0, unit="m", role="station", group="more")
    samples: int = slider(20_000, low=1000, high=200_000, log=True, group="more")
    seed: int = seed(1, group="more")


class Errors(NamedTuple):
    """Distances of an approximation from the reference."""

    mean_m: float                # |m - m_ref|
    cov_percent: float           # |P - P_ref| / |P_ref|, Frobenius norms


class Result(NamedTuple):
    """The same law through the map in four ways, and how far each is off."""

    prior: Gaussian
    L: Array                     # (2, 2) the root of P that the sigma points use
    ut: Transform
    ut_cov: Array                # (2, 2) as (3.16) has it: ut.cov unless that is indefinite
    linear: Gaussian
    sampled: Gaussian            # moments of all Monte Carlo points
    truth: Gaussian              # quadrature
    cloud: Array                 # (DRAWN, 2)
    cloud_images: Array          # (DRAWN, 2)
    ut_errors: Errors
    linear_errors: Errors
    sampled_errors: Errors
    sweep: Array                 # (k, 2) the UT's errors at KAPPAS
    degree_errors: Array         # (3, 6) percent: UT here, UT with n + kappa = 3, linearised; x^d, d = 1..6


def compute(p: Params, progress: Progress) -> Result:
    """Transforms the prior by sigma points, by the tangent, by sampling and by quadrature."""
    prior, m = prior_of(p), map_of(p)
    ut = transform(m.f, prior, p.kappa, root=p.root)
    ut_cov = weighted_cov(ut.images, ut.weights, ut.mean)
    linear, truth = linearised(m, prior), reference(m.f, prior)
    progress(0.2)

    cloud = sample(prior, p.samples, np.random.default_rng(p.seed))
    images = m.f(cloud)
    sampled = Gaussian(images.mean(axis=0), np.cov(images.T))
    progress(0.5)

    sweep = np.empty((len(KAPPAS), 2))
    for i, kappa in enumerate(KAPPAS):
        t = transform(m.f, prior, kappa, root=p.root)
        sweep[i] = errors(t.mean, weighted_cov(t.images, t.weights, t.mean), truth)
    progress(0.9)
    return Result(prior, (sqrt_psd if p.root == "symmetric" else cholesky_psd)(prior.cov), ut, ut_cov, linear, sampled,
                  truth, cloud[:DRAWN], images[:DRAWN], errors(ut.mean, ut_cov, truth), errors(*linear, truth),
                  errors(*sampled, truth), sweep, errors_by_degree(p.kappa))


def errors(mean: Array, cov: Array, truth: Gaussian) -> Errors:
    """Distances of (mean, cov) from the reference."""
    size = max(float(np.linalg.norm(truth.cov)), 1e-300)
    return Errors(float(np.linalg.norm(mean - truth.mean)), 100.0 * float(np.linalg.norm(cov - truth.cov)) / size)


def errors_by_degree(kappa: float, mu: float = 1.0, sigma: float = 2.0) -> Array:
    """|approximation - E x^d| / |E x^d| in percent for x ~ N(mu, sigma^2): exercise 3.8, oracle C3-15.

    kappa belongs to n = 2.  One coordinate of those five sigma points is a one-dimensional set with the same
    n + kappa, that is with kappa + 1.
    """
    def powers(x: Array) -> Array:
        return x**DEGREES

    law = Gaussian(np.array([mu]), np.array([[sigma**2]]))
    exact = reference(powers, law).mean
    found = [transform(powers, law, kappa + 1.0).mean, transform(powers, law, BEST + 1.0).mean, mu**DEGREES]
    return 100.0 * np.abs(np.array(found) - exact) / np.abs(exact)


def timeline(p: Params) -> Timeline:
    """One step, opened into what is computed one after the other."""
    return Timeline(0, ("prior", "sigma", "images", "moments"))


LESSON = Lesson(
    Params, compute, view, timeline=timeline, refs=("MAT 3.3.2", "MAT (3.16)", "MAT (3.17)", "MAT exercise 3.8"),
    unused=lambda p: UNUSED[p.map],
    presets={
        "polar to Cartesian: 100 m, 90° ± 15°": {},
        "κ = 3 − n": {"kappa": 1.0, "sigma_2": 30.0},
        "κ below zero: a negative weight": {"kappa": -1.5},
        "two ranges near the baseline": {"map": "two_ranges", "mean": (0.0, 104.0), "sigma_1": 6.0, "sigma_2": 15.0,
                                         "station_1": (-40.0, 100.0), "station_2": (40.0, 100.0)},
        "two ranges, gently curved": {"map": "two_ranges", "mean": (10.0, 100.0), "sigma_1": 8.0, "sigma_2": 12.0,
                                      "station_1": (-60.0, 0.0), "station_2": (60.0, 0.0)},
        "exercise 3.8: degree 4": {"map": "polynomial", "degree": 4, "mean": (100.0, 100.0), "sigma_1": 200.0,
                                   "sigma_2": 200.0},
        "squares at zero": {"map": "polynomial", "degree": 2, "mean": (0.0, 0.0), "sigma_1": 40.0, "sigma_2": 40.0},
    },
)
