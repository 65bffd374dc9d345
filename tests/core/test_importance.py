import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.importance import importance_weights, integrate, monte_carlo, running, self_normalised, truncated_normal
from tests.oracle import entry


def parabola(z):
    return np.where(np.abs(z) <= 1, 0.75 * (1 - z * z), 0.0)


def normal(z):
    return np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)


def quadrature(f):
    z, w = np.polynomial.legendre.leggauss(60)
    return (w * f(z)).sum()


def test_example_21_closed_values_c3_24():
    e = entry("C3-24")["expected"]
    n = entry("C3-24")["inputs"]["n"]
    assert quadrature(parabola) == pytest.approx(e["I"], rel=1e-12)
    var_h = quadrature(lambda z: parabola(z) ** 2 / normal(z)) - 1
    assert var_h == pytest.approx(e["var_h"], rel=1e-8)
    assert var_h / n == pytest.approx(e["var_mean"], rel=1e-8)
    assert np.sqrt(var_h / n) == pytest.approx(e["sd_mean"], rel=1e-8)
    inside = quadrature(normal)
    assert (var_h - 1 + inside) / n == pytest.approx(e["value_without_zeros"], rel=1e-8)


def test_example_21_by_simulation_c3_24():
    e = entry("C3-24")["expected"]
    rng = np.random.default_rng(21)
    means, variances = [], []
    for _ in range(10):
        z = rng.standard_normal((100, 10_000))
        estimate = integrate(parabola, normal, z)
        means.append(estimate.mean)
        variances.append(estimate.variance)
    means, variances = np.concatenate(means), np.concatenate(variances)
    # Bands of the oracle for 1000 repetitions: 3 standard errors, false alarm 0.3 % each; the seed is fixed.
    assert abs(means.mean() - 1) < 0.00075
    assert means.std() == pytest.approx(e["sd_mean"], rel=0.07)
    # Erratum M20: all samples count.  The mean of the variance estimates is sharp to 0.1 %.
    assert variances.mean() == pytest.approx(e["var_mean"], rel=0.01)
    z = rng.standard_normal(200_000)
    h = parabola(z) / normal(z)
    without_zeros = np.square(h[np.abs(z) <= 1] - h.mean()).sum() / len(z) ** 2 * len(z) / 10_000
    assert without_zeros == pytest.approx(e["value_without_zeros"], rel=0.02)
    assert without_zeros < 0.6 * monte_carlo(h).variance * len(z) / 10_000


def test_error_falls_as_one_over_root_n_c3_24():
    rng = np.random.default_rng(2)
    sizes = np.array([100, 1000, 10_000, 100_000])
    errors = []
    for n in sizes:
        z = rng.standard_normal((100, n)) if n < 1e5 else rng.standard_normal((40, n))
        errors.append(np.sqrt(np.square(integrate(parabola, normal, z).mean - 1).mean()))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert abs(slope + 0.5) < 0.05                            # sd of the slope about 0.013: false alarm below 1e-3


def test_a_better_density_has_less_variance():
    rng = np.random.default_rng(4)
    u = rng.uniform(-1, 1, 20_000)
    uniform = integrate(parabola, lambda z: np.full_like(z, 0.5), u)
    wide = integrate(parabola, normal, rng.standard_normal(20_000))
    assert uniform.variance < 0.5 * wide.variance             # exactly 0.2 against 0.62
    perfect = integrate(parabola, parabola, u)                # h = 1: no variance at all
    assert perfect.mean == pytest.approx(1.0) and perfect.variance < 1e-30


def test_exercise_3_13_exact_c3_26():
    e = entry("C3-26")
    law = truncated_normal(*np.transpose(e["inputs"]["A"]))
    np.testing.assert_allclose(law.mean, e["expected"]["I"], rtol=1e-9)
    np.testing.assert_allclose(law.variance, e["expected"]["var"], rtol=1e-9)
    assert law.probability.prod() == pytest.approx(e["expected"]["P_A"], rel=1e-9)


def test_exercise_3_13_by_rejection_c3_26():
    e = entry("C3-26")["expected"]
    z = np.random.default_rng(13).standard_normal((100_000, 2))
    inside = ((z >= 0) & (z <= 2)).all(axis=1)
    with np.errstate(divide="ignore"):
        posterior = self_normalised(z.T, np.log(inside.astype(float)))
    sd = np.sqrt(e["var"] / (len(z) * e["P_A"]))
    assert np.abs(posterior.mean - e["I"]).max() < 4 * sd     # false alarm 1.3e-4
    np.testing.assert_allclose(posterior.variance, sd**2, rtol=0.05)
    assert posterior.n_eff == pytest.approx(inside.sum())
    assert np.exp(posterior.log_mean_weight) == pytest.approx(e["P_A"], abs=4 * 0.0014)


def test_truncated_normal_in_the_tails_and_unbounded():
    far = truncated_normal(8.0, np.inf)
    hazard = 8.0                                              # 8 + 1/(8 + 2/(8 + 3/(8 + ...)))
    for k in range(60, 0, -1):
        hazard = 8.0 + k / hazard
    assert far.mean == pytest.approx(hazard, rel=1e-12)
    assert 0 < far.variance < 1 / 64
    mirrored = truncated_normal(-np.inf, -8.0)
    assert mirrored.mean == pytest.approx(-far.mean) and mirrored.probability == pytest.approx(far.probability)
    everything = truncated_normal(-np.inf, np.inf)
    assert (everything.mean, everything.variance, everything.probability) == (0, 1, 1)
    for low, high in ((1.0, 1.0), (2.0, 1.0), (np.nan, 1.0), (50.0, 51.0)):
        with pytest.raises(ValueError, match="low"):
            truncated_normal(low, high)


def test_importance_weights_c3_34():
    e = entry("C3-34")
    x_prev, x, y = (np.array(e["inputs"][k], dtype=float) for k in ("x_prev", "x", "y"))
    log_normal = lambda d, sd: -0.5 * (d / sd) ** 2 - np.log(sd * np.sqrt(2 * np.pi))  # noqa: E731
    w = importance_weights(
        np.full(3, 1 / 3), log_normal(y - x, 0.5), log_normal(x - x_prev, 1.0),
        log_normal(x - (x_prev + 0.5 * (y - x_prev)), 0.8),
    )
    np.testing.assert_allclose(w, e["expected"]["w"], rtol=1e-9)
    assert w @ x == pytest.approx(e["expected"]["mean"], rel=1e-9)


def test_importance_weights_do_not_underflow():
    w = importance_weights([0.5, 0.25, 0.25], [-1e5, -1e5, -np.inf])
    np.testing.assert_allclose(w, [2 / 3, 1 / 3, 0])
    batch = importance_weights(np.full((2, 3), 1 / 3), np.array([[0.0, 1.0, 2.0], [0.0, 0.0, -800.0]]))
    np.testing.assert_allclose(batch.sum(axis=-1), 1)
    np.testing.assert_allclose(batch[1], importance_weights(np.full(3, 1 / 3), [0.0, 0.0, -800.0]))
    with pytest.raises(ValueError, match="at least one positive"):
        importance_weights([0.5, 0.5], [-np.inf, -np.inf])
    with pytest.raises(ValueError, match="log weights"):
        importance_weights([0.5, 0.5], [0.0, np.nan])
    with pytest.raises(ValueError, match="log weights"):
        importance_weights([0.5, 0.5], [0.0, 0.0], 0.0, [0.0, -np.inf])
    with pytest.raises(ValueError, match="numbers >= 0"):
        importance_weights([0.5, -0.5], [0.0, 0.0])


def test_self_normalised_coverage():
    rng = np.random.default_rng(8)
    z = 2.0 * rng.standard_normal((400, 2000))                # N(0, 4) samples for N(0, 1), mean of z^2
    hits = 0
    for row in z:
        e = self_normalised(row**2, -0.5 * row**2 + row**2 / 8 + 123.0)
        hits += abs(e.mean - 1) < 2 * np.sqrt(e.variance)
    assert 362 <= hits <= 396                                 # binomial(400, 0.954): false alarm below 1e-3


@given(st.integers(2, 30), st.integers(1, 3), st.integers(0, 99))
def test_batches_running_and_shift(n, k, seed):
    h = np.random.default_rng(seed).normal(size=(k, n)) + 1e6
    estimate, path = monte_carlo(h), running(h)
    assert estimate.mean.shape == (k,) and path.variance.shape == (k, n)
    np.testing.assert_allclose(path.mean[:, -1], estimate.mean, rtol=1e-12)
    np.testing.assert_allclose(path.variance[:, -1], estimate.variance, rtol=1e-6)
    np.testing.assert_allclose(estimate.variance, h.var(axis=-1) / n)
    np.testing.assert_allclose(monte_carlo(h[0]).mean, estimate.mean[0])
    assert (path.variance[:, 0] == 0).all()
    equal = self_normalised(h, np.zeros(n))
    np.testing.assert_allclose(equal.mean, estimate.mean, rtol=1e-12)
    np.testing.assert_allclose(equal.variance, estimate.variance, rtol=1e-6)
    assert equal.n_eff == pytest.approx(n)


def test_bad_input():
    with pytest.raises(ValueError, match="at least 2"):
        monte_carlo([1.0])
    with pytest.raises(ValueError, match="finite"):
        monte_carlo([1.0, np.nan])
    with pytest.raises(ValueError, match="positive values"):
        integrate(parabola, parabola, [0.5, 2.0])
    with pytest.raises(ValueError, match="log_w"):
        self_normalised([1.0, 2.0], [0.0])
    with pytest.raises(ValueError, match="at least one positive"):
        self_normalised([1.0, 2.0], [-np.inf, -np.inf])
    with pytest.raises(ValueError, match="at least one sample"):
        running(np.zeros((2, 0)))
