"""The simulation of the Kalman filter thesis."""

from dataclasses import replace

import numpy as np
import pytest

from core import grid
from core import random_walk as rw
from core.gaussian import log_density
from core.metrics import rmse
from core.types import Gaussian
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")


def test_t_01_bayes_theorem():
    e = entry("T-01")
    step = grid.multiply(grid.GridDensity(np.arange(3.0), e["inputs"]["prior"]), np.log(e["inputs"]["lik"]))
    assert step.evidence == pytest.approx(e["expected"]["evidence"], abs=1e-12)
    np.testing.assert_allclose(step.posterior.weights, e["expected"]["posterior"], atol=1e-12)


def test_t_02_bayes_filter_in_a_corridor():
    e = entry("T-02")
    T, L = np.array(e["inputs"]["T"]), np.array(e["inputs"]["L"])
    p = np.array(e["inputs"]["p0"])
    for reading, want in zip(e["inputs"]["readings_1based"], e["expected"]["steps"], strict=True):
        prior = p @ T                                                           # (2.11)
        step = grid.multiply(grid.GridDensity(np.arange(3.0), prior), np.log(L[:, reading - 1]))
        p = step.posterior.weights
        np.testing.assert_allclose(prior, want["prior"], atol=1e-10)
        np.testing.assert_allclose(p, want["posterior"], atol=1e-10)
        assert step.evidence == pytest.approx(want["Z"], abs=1e-10)             # (2.12)


def test_t_18_normaliser_of_the_normal_density():
    e = entry("T-18")
    g = Gaussian(np.zeros(2), np.array(e["inputs"]["Sigma"], dtype=float))
    assert np.exp(log_density(g, g.mean)) == pytest.approx(e["expected"]["correct"], rel=1e-10)
    printed = 1 / np.linalg.det(np.sqrt(2 * np.pi) * g.cov)                     # erratum K3
    assert printed == pytest.approx(e["expected"]["printed"], rel=1e-10)


def test_t_13_walk_with_given_increments():
    e = entry("T-13")
    path = rw.walk(e["inputs"]["increments_deg"])
    np.testing.assert_allclose(path.points, e["expected"]["points"], atol=1e-10)
    assert path.headings_deg[-1] == e["expected"]["final_heading"]
    np.testing.assert_array_equal(np.flatnonzero(path.reset), [10])
    assert rw.cross_track_sigma() == pytest.approx(0.050383, abs=1e-6)


def test_t_12_start_up_error():
    e = entry("T-12")
    i = e["inputs"]
    ys = np.column_stack([np.arange(30.0), np.zeros(30)])
    samples = np.array(i["samples"]) - 1
    for sigma in i["sigma"]:
        for v0 in i["v0"]:
            steps = rw.track(ys, rw.Setting(sigma_xy=sigma, v0_mps=tuple(v0)))
            errors = steps.posterior.mean[samples, :2] - ys[samples]
            want = e["expected"][f"sigma={sigma}, v0=({v0[0]}, {v0[1]})"]
            np.testing.assert_allclose(errors, want, atol=1e-8)


def test_t_12_the_clean_start_uses_the_first_sample_once():
    ys = np.column_stack([np.arange(5.0), np.zeros(5)])
    clean = rw.track(ys, replace(rw.STIFF, start_twice=False))
    assert len(clean.y_hat) == 4
    np.testing.assert_allclose(clean.prior.mean[0], [3.0, 4.0, 0.0, 3.0, 4.0, 0.0])
    np.testing.assert_allclose(clean.y_hat[0] + clean.innovation[0], ys[1])


def test_t_15_five_measurements():
    e = entry("T-15")
    i = e["inputs"]
    steps = rw.track(i["Y"], rw.Setting(sigma_xy=i["sigma_xy"], v0_mps=tuple(i["v0"])))
    np.testing.assert_allclose(steps.posterior.mean, e["expected"]["x"], atol=1e-8)


CASES = {
    "stiff as printed (0.01; v0=(3,4); R=diag(1,16); noise sd 1,1)": rw.STIFF,
    "flexible as printed (0.1; v0=(15,25))": rw.FLEXIBLE,
    "sigma 0.05, v0=(3,4)": replace(rw.STIFF, sigma_xy=0.05),
    "stiff, consistent R=I": replace(rw.STIFF, R_sd_m=(1.0, 1.0)),
    "sigma 0.05, consistent R=I": replace(rw.STIFF, sigma_xy=0.05, R_sd_m=(1.0, 1.0)),
    "flexible, consistent R=I, v0=(3,4)": replace(rw.STIFF, sigma_xy=0.1, R_sd_m=(1.0, 1.0)),
    "stiff, noise sd (1,4) = R": replace(rw.STIFF, noise_sd_m=(1.0, 4.0)),
    "flexible v0=(3,4), noise sd (1,4) = R": replace(rw.STIFF, sigma_xy=0.1, noise_sd_m=(1.0, 4.0)),
    "sigma 0.05, noise sd (1,4) = R": replace(rw.STIFF, sigma_xy=0.05, noise_sd_m=(1.0, 4.0)),
}


@pytest.mark.parametrize("case", CASES)
def test_t_17_track_rmse_over_seeds(case):
    """400 runs; the mean within 3.5 standard errors: false alarm 9 * 0.05 % = 0.4 %.  Means are printed to 0.001."""
    want = entry("T-17")["expected"][case]
    run = rw.simulate(CASES[case], np.random.default_rng(7), n=entry("T-17")["inputs"]["n"], runs=(400,))
    per_run = rmse(run.errors, np.zeros(2), axis=0)
    assert per_run.shape == (400,)
    assert abs(per_run.mean() - want["rmse_mean"]) < 3.5 * want["rmse_sd"] / 20 + 5e-4
    assert per_run.std() == pytest.approx(want["rmse_sd"], rel=0.3)


def test_t_17_covers_every_case():
    assert set(CASES) == set(entry("T-17")["expected"])


def test_random_walk_statistics():
    """20,000 increments of variance 25 / 3 deg^2: the mean square within 4 standard errors, false alarm 0.006 %."""
    path = rw.random_walk(101, np.random.default_rng(0), (200,))
    assert path.points.shape == (200, 101, 2) and path.headings_deg.shape == (200, 100)
    assert np.abs(path.headings_deg).max() <= 45
    np.testing.assert_allclose(np.linalg.norm(np.diff(path.points, axis=1), axis=-1), 1.0)
    d = np.diff(path.headings_deg, axis=1, prepend=0.0)[~path.reset]
    assert abs(np.square(d).mean() - 25 / 3) < 4 * 25 * np.sqrt(1 / 5 - 1 / 9) / np.sqrt(d.size) + 0.1
    again = rw.random_walk(101, np.random.default_rng(0), (200,))
    np.testing.assert_array_equal(path.points, again.points)


def test_a_reset_keeps_the_side():
    np.testing.assert_array_equal(rw.walk([-30.0, -20.0, 5.0]).headings_deg, [-30, -40, -35])
    np.testing.assert_array_equal(rw.walk([45.0]).headings_deg, [45])           # only beyond the limit


def test_noise_inputs_are_independent():
    """The measurements depend on the noise drawn, not on the noise assumed; the walk on neither."""
    a, b, c = (rw.simulate(s, np.random.default_rng(3)) for s in (
        rw.STIFF, replace(rw.STIFF, R_sd_m=(7.0, 7.0), v0_mps=(15.0, 25.0), sigma_xy=0.3),
        replace(rw.STIFF, noise_sd_m=(2.0, 2.0))))
    np.testing.assert_array_equal(a.ys, b.ys)
    np.testing.assert_array_equal(a.walk.points, c.walk.points)
    np.testing.assert_allclose(c.ys - c.walk.points, 2 * (a.ys - a.walk.points))
    assert not np.allclose(a.errors, b.errors)


def test_batch_equals_loop():
    run = rw.simulate(rw.FLEXIBLE, np.random.default_rng(0), n=20, runs=(3, 4))
    assert run.errors.shape == (20, 3, 4, 2)
    one = rw.track(run.ys[:, 1, 2], rw.FLEXIBLE)
    np.testing.assert_allclose(run.steps.posterior.mean[:, 1, 2], one.posterior.mean, rtol=1e-10, atol=1e-10)
    clean = rw.simulate(replace(rw.STIFF, start_twice=False), np.random.default_rng(0), n=20)
    assert clean.errors.shape == (19, 2)
    np.testing.assert_allclose(clean.errors, clean.steps.posterior.mean[:, :2] - clean.walk.points[1:])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: rw.walk([np.nan]), "increments_deg: expected finite"),
        (lambda: rw.random_walk(0, np.random.default_rng()), "n: expected at least one point"),
        (lambda: rw.track([[1.0, 2.0]], rw.STIFF), "n >= 2"),
        (lambda: rw.track([[1.0, 2.0, 3.0]] * 3, rw.STIFF), "ys: expected shape"),
        (lambda: rw.simulate(rw.Setting(noise_sd_m=(-1.0, 1.0)), np.random.default_rng()), "noise_sd_m"),
        (lambda: rw.simulate(rw.Setting(R_sd_m=(0.0, 1.0)), np.random.default_rng()), "sigma_m: expected positive"),
        (lambda: rw.simulate(rw.Setting(sigma_xy=-1.0), np.random.default_rng()), "sigma: expected non-negative"),
    ],
)
def test_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call()
