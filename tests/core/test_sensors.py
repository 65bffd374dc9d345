"""Sensors: oracle numbers, derivatives, normalised likelihoods, batches, and what must be refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.rotation import dcm_from_rotation_vector
from core.sensors import (
    Bearing,
    BinarySector,
    Fingerprint,
    Linear,
    Position,
    Pseudorange,
    Quantised,
    Range,
    RangeDifference,
    RangeRate,
    SignalStrength,
    SquaredRange,
    Stack,
    UniformNoise,
    wrap_angle,
)
from tests.oracle import entry

pytestmark = pytest.mark.filterwarnings("error")

STATIONS = np.array([[0.0, 0.0], [70.0, 0.0], [-20.0, 45.0]])
SPACE = np.array([[0.0, 0.0, 90.0], [70.0, 0.0, 80.0], [-20.0, 45.0, 70.0], [30.0, -60.0, 95.0]])

SMOOTH = {
    "range": Range(STATIONS, [1.0, 2.0, 5.0]),
    "range in space": Range(SPACE, 3.0),
    "pseudorange": Pseudorange(SPACE, 2.0),
    "difference": RangeDifference(STATIONS, [1.0, 3.0]),
    "bearing": Bearing(STATIONS, [0.1, 0.2, 0.5]),
    "rate": RangeRate(STATIONS, 0.5, [[1.0, 0.0], [0.0, -2.0], [0.3, 0.4]]),
    "position": Position(2, [30.0, 50.0]),
    "linear": Linear([[1.0, 0.5, 0.0, 0.0], [0.0, 2.0, -1.0, 1.0]], [[4.0, 1.0], [1.0, 2.0]]),
    "signal": SignalStrength(STATIONS, [-40.0, -38.0, -45.0], [2.5, 2.0, 3.0], [6.0, 4.0, 5.0]),
    "squared": SquaredRange([5.0, -3.0], 2.0),
    "stack": Stack([Range(STATIONS, 1.0), Bearing(STATIONS[:1], 0.1), Position(1, 2.0)]),
}
STEPS = {
    "quantised": Quantised(0.7, axis=1, step=3.0),
    "sector": BinarySector(STATIONS, [50.0, 60.0, 30.0], [0.0, 1.0, 2.0], 0.3, [7.0, 2.0, 3.0]),
    "uniform": UniformNoise(Range(STATIONS, 1.0), [4.0, 5.0, 6.0]),
    "fingerprint": Fingerprint(STATIONS, [[-50.0, -60.0], [-70.0, -40.0], [-55.0, -65.0]], 4.0),
}
ALL = SMOOTH | STEPS


def states(n, shape=(), seed=0):
    return np.random.default_rng(seed).uniform(-60, 60, (*shape, n))


def a_measurement(name, x):
    """A measurement that is possible at x."""
    y = ALL[name].h(x)
    if name in ("quantised", "sector", "fingerprint"):
        return y
    return y + 0.3 * np.sqrt(ALL[name].R.diagonal())


# --- numbers -----------------------------------------------------------------------------------------------------


def test_c2_01_measurement_models():
    e = entry("C2-01")
    x, s1, s2 = (np.array(e["inputs"][k]) for k in ("x", "s1", "s2"))
    assert Linear([[0.0, 1.0]], 1.0).h(x)[0] == pytest.approx(e["expected"]["a"], rel=1e-9)
    assert Range([s1], 1.0).h(x)[0] == pytest.approx(e["expected"]["b"], rel=1e-9)
    assert np.degrees(Bearing([s1], 0.1).h(x)[0]) == pytest.approx(e["expected"]["c_deg"], rel=1e-9)
    assert RangeDifference([s1, s2], 1.0).h(x)[0] == pytest.approx(e["expected"]["d"], rel=1e-9)


def test_c2_03_velocity_in_the_body_frame():
    e = entry("C2-03")
    C = dcm_from_rotation_vector(np.array(e["inputs"]["p"]))       # body to local
    y = Linear(C.T, np.eye(3)).h(np.array(e["inputs"]["v_L"]))
    np.testing.assert_allclose(y, e["expected"]["y"], atol=1e-11)


def test_c2_18_range_jacobian_points_from_station_to_user():
    e = entry("C2-18")
    sensor, x = Range(e["inputs"]["stations"], 1.0), np.array(e["inputs"]["x"])
    np.testing.assert_allclose(sensor.jacobian(x), e["expected"]["J"], atol=1e-10)
    np.testing.assert_allclose(sensor.h(x), e["expected"]["h"], atol=1e-10)


def test_c2_19_rotating_radar():
    e = entry("C2-19")
    x, t = np.array(e["inputs"]["x"]), e["inputs"]["t"]
    s, rate = [[np.cos(t), np.sin(t)]], [[-np.sin(t), np.cos(t)]]
    radar = Stack([Range(s, 1.0), RangeRate(s, 1.0, rate)])
    np.testing.assert_allclose(radar.h(x), e["expected"]["h"], atol=1e-9)
    np.testing.assert_allclose(radar.jacobian(x), e["expected"]["J"], atol=1e-9)


def test_c2_19_range_rate_is_the_derivative_of_the_range():
    dt, x = 1e-6, np.array([3.0, 4.0, 1.0, -0.5])

    def rho(t):
        s = np.array([np.cos(t), np.sin(t)])
        return np.linalg.norm(x[:2] + t * x[2:] - s)

    sensor = RangeRate([[1.0, 0.0]], 1.0, [[0.0, 1.0]])
    assert sensor.h(x)[0] == pytest.approx((rho(dt) - rho(-dt)) / (2 * dt), abs=1e-8)


def test_c2_25_fingerprints():
    e = entry("C2-25")
    i, want = e["inputs"], e["expected"]
    f, y = Fingerprint(i["points"], i["a"], i["sigma"]), np.array(i["y"])
    np.testing.assert_allclose(f.squared_distances(y), want["d2"], rtol=1e-9)
    assert np.argmin(f.squared_distances(y)) == want["nn"]
    np.testing.assert_allclose(f.posterior(y), want["posterior"], rtol=1e-9)
    np.testing.assert_allclose(f.posterior(y) @ f.points_m, want["posterior_mean"], rtol=1e-9)
    np.testing.assert_allclose(f.weighted_neighbours(y, 3), want["wknn3"], rtol=1e-9)
    np.testing.assert_allclose(f.weighted_neighbours(y, 1), f.points_m[want["nn"]])
    # The likelihood near a point is that of the point, and leads to the same posterior.
    near = f.log_likelihood(y, f.points_m + 0.1)
    np.testing.assert_allclose(np.exp(near) / np.exp(near).sum(), want["posterior"], rtol=1e-9)
    np.testing.assert_allclose(f.weighted_neighbours(f.powers_dbm[2], 3), f.points_m[2])


class Square:
    """y = x^2, the model of exercise 2.10(a)."""

    R = np.eye(1)

    def h(self, x):
        return np.square(x)

    def jacobian(self, x):
        return 2 * x[..., None]

    def innovation(self, y, y_hat):
        return y - y_hat


def test_c2_26_unusual_likelihoods():
    e = entry("C2-26")
    i, want = e["inputs"], e["expected"]
    x = np.array(i["a"]["x"])[:, None]
    a = UniformNoise(Square(), 1.0)
    np.testing.assert_allclose(np.exp(a.log_likelihood([i["a"]["y"]], x)), want["a"], rtol=1e-12)
    for key, sigma in (("c", 0.0), ("d", 1.0)):
        x = np.array([[r, 0.0] for r in i[key]["r"]], dtype=float)
        sensor = BinarySector([[0.0, 0.0]], 100.0, sigma)
        p1 = np.exp(sensor.log_likelihood([1.0], x))
        np.testing.assert_allclose(p1, want[key], rtol=1e-7, atol=1e-15)
        np.testing.assert_allclose(np.exp(sensor.log_likelihood([0.0], x)), 1 - p1, rtol=1e-7, atol=1e-15)
    x = np.array([np.sqrt(i["e"]["lam"]), 0.0])
    y = np.array(i["e"]["y"], dtype=float)[:, None]
    p = np.exp(SquaredRange(np.zeros(i["e"]["n"]), 1.0).log_likelihood(y, x))
    np.testing.assert_allclose(p, want["e"], rtol=1e-7)


def test_c2_28_quantised():
    e = entry("C2-28")
    sensor = Quantised(0.5)
    x = np.array(e["inputs"]["x"], dtype=float)[:, None]
    p = np.exp(sensor.log_likelihood([e["inputs"]["y"]], x))
    np.testing.assert_allclose(p, e["expected"]["P"], atol=1e-9)
    ys = np.arange(-30.0, 30.0)[:, None]
    assert np.exp(sensor.log_likelihood(ys, np.array([0.3]))).sum() == pytest.approx(1.0, abs=1e-12)
    grid = np.arange(-10, 10, 0.01)[:, None]
    assert np.exp(sensor.log_likelihood([0.0], grid)).sum() * 0.01 == pytest.approx(1.0, abs=1e-9)


def test_c2_30_likelihood_is_weighted_least_squares():
    e, data = entry("C2-30"), entry("C2-14")["inputs"]
    sensor = Range(data["stations"], np.sqrt([1.0, 25.0, 100.0]))
    x, y = np.array([50.0, 30.0]), np.array(data["y"])
    log = sensor.log_likelihood(y, x)
    C = (2 * np.pi) ** -1.5 * 2500**-0.5
    assert -2 * (log - np.log(C)) == pytest.approx(e["expected"]["wls_cost"], rel=1e-9)
    assert np.exp(log) == pytest.approx(9.99494685e-09, rel=1e-8)


def test_c2_30_ring_wedge_and_their_product():
    e = entry("C2-30")
    i, want = e["inputs"], e["expected"]
    x = np.array(i["x"], dtype=float)
    ring = Range([i["station"]], i["sd_range"])
    wedge = Bearing([i["station"]], np.radians(i["sd_bearing_deg"]))
    r, b = [float(i["range"])], [np.radians(i["bearing_deg"])]
    peak = np.array(want["peak"])
    assert np.exp(ring.log_likelihood(r, x) - ring.log_likelihood(r, peak)) == pytest.approx(want["range_lik"])
    assert np.exp(wedge.log_likelihood(b, x) - wedge.log_likelihood(b, peak)) == pytest.approx(want["bearing_lik"])
    both = Stack([ring, wedge])
    np.testing.assert_allclose(both.h(peak), [*r, *b], rtol=1e-12)
    assert both.log_likelihood([*r, *b], x) == pytest.approx(ring.log_likelihood(r, x) + wedge.log_likelihood(b, x))


def test_g_10_path_loss():
    e = entry("G-10")
    i, want = e["inputs"], e["expected"]
    sensor = SignalStrength([[0.0, 0.0]], i["A"], i["n"], i["sigma"])
    x = np.array([[d, 0.0] for d in i["d"]], dtype=float)
    np.testing.assert_allclose(sensor.h(x)[:, 0], want["mu"], rtol=1e-9)
    assert sensor.log_likelihood([i["y"]], np.array([10.0, 0.0])) == pytest.approx(want["logpdf"], rel=1e-9)
    assert sensor.h(np.array([want["d_ml"], 0.0]))[0] == pytest.approx(i["y"], rel=1e-12)
    assert sensor.h(np.array([0.3, 0.0]))[0] == i["A"]                          # nearer than 1 m counts as 1 m


# --- derivatives -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SMOOTH)
def test_jacobian_is_the_derivative(name):
    sensor = SMOOTH[name]
    for x in states(4, (5,), seed=3):
        J = sensor.jacobian(x)
        steps = 1e-5 * np.eye(4)
        differences = sensor.innovation(sensor.h(x + steps), sensor.h(x - steps)) / 2e-5
        np.testing.assert_allclose(J, differences.T, atol=2e-7 * max(1.0, np.abs(J).max()))


@pytest.mark.parametrize("name", [n for n in STEPS if n != "uniform"])
def test_steps_have_no_slope(name):
    J = STEPS[name].jacobian(states(4, (6,)))
    assert J.shape == (6, len(STEPS[name].R), 4) and not J.any()


@pytest.mark.parametrize("name", ["range", "bearing", "difference", "signal", "position"])
def test_states_after_the_position_have_zero_columns(name):
    sensor, x = SMOOTH[name], states(4)
    assert not sensor.jacobian(x)[..., 2:].any()
    np.testing.assert_array_equal(sensor.h(x), sensor.h(x[:2]))
    np.testing.assert_array_equal(sensor.jacobian(x)[..., :2], sensor.jacobian(x[:2]))


def test_pseudorange_finds_the_clock_after_the_position():
    x = states(8)
    J = SMOOTH["pseudorange"].jacobian(x)
    np.testing.assert_array_equal(J[:, 3], np.ones(4))
    assert not J[:, 4:].any()
    np.testing.assert_allclose(SMOOTH["pseudorange"].h(x), SMOOTH["range in space"].h(x) + x[3])


@pytest.mark.parametrize("name", ["range", "bearing", "rate", "signal", "pseudorange", "difference", "squared"])
def test_at_a_station_nothing_is_nan_and_the_row_is_zero(name):
    sensor = SMOOTH[name]
    place = {"pseudorange": [*SPACE[0], 1.0], "squared": [5.0, -3.0, 1.0, 2.0]}.get(name, [0.0, 0.0, 1.0, 2.0])
    for x in (np.array(place), np.tile(place, (40, 1))):
        J, h = sensor.jacobian(x), sensor.h(x)
        assert np.isfinite(J).all() and np.isfinite(h).all()
        if name == "pseudorange":
            assert not J[..., 0, :3].any() and (J[..., 0, 3] == 1).all()
        elif name != "difference":
            assert not J[..., 0, :].any()


@pytest.mark.parametrize("name", ["range", "bearing", "rate", "signal"])
def test_almost_at_a_station(name):
    for distance in (1e-300, 1e-160, 1e-100, 1e-20):
        x = np.array([distance, -distance, 1.0, 2.0])
        assert np.isfinite(SMOOTH[name].h(x)).all() and np.isfinite(SMOOTH[name].jacobian(x)).all()


# --- likelihoods -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["range", "pseudorange", "bearing", "rate", "position", "signal", "difference"])
def test_likelihood_of_each_row_is_normalised(name):
    """The density factorises; every factor integrates to 1 over its own measurement."""
    sensor = SMOOTH[name]
    x = states(4, seed=1)
    y_hat, sd = sensor.h(x), np.sqrt(sensor.R.diagonal())
    base = sensor.log_likelihood(y_hat, x)
    product = 1.0
    for i in range(len(sd)):
        width = np.pi if name == "bearing" else 12 * sd[i]
        t, dt = np.linspace(-width, width, 4001, retstep=True)
        y = np.tile(y_hat, (len(t), 1))
        y[:, i] += t
        product *= np.trapezoid(np.exp(sensor.log_likelihood(y, x) - base), dx=dt)
    assert product * np.exp(base) == pytest.approx(1.0, rel=1e-6)


def test_bearing_likelihood_is_normalised_on_the_circle_even_when_wide():
    sensor = Bearing([[0.0, 0.0]], 2.0)
    t, dt = np.linspace(-np.pi, np.pi, 20001, retstep=True)
    p = np.exp(sensor.log_likelihood(t[:, None], np.array([3.0, -4.0])))
    assert np.trapezoid(p, dx=dt) == pytest.approx(1.0, rel=1e-7)


def test_linear_likelihood_with_correlated_noise():
    sensor, x = SMOOTH["linear"], states(4)
    y1, y2 = np.meshgrid(np.linspace(-12, 12, 301), np.linspace(-12, 12, 301), indexing="ij")
    y = np.stack([y1, y2], axis=-1)
    p = np.exp(sensor.log_likelihood(y + sensor.h(x), x))
    assert p.sum() * (24 / 300) ** 2 == pytest.approx(1.0, rel=1e-8)
    moments = np.einsum("abi,abj,ab->ij", y, y, p) * (24 / 300) ** 2
    np.testing.assert_allclose(moments, sensor.R, atol=1e-6)


@pytest.mark.parametrize("dim", [1, 2, 3, 5])
@pytest.mark.parametrize("far", [0.0, 1e-7, 3.0, 200.0])
def test_squared_range_likelihood_is_normalised(dim, far):
    sensor = SquaredRange(np.zeros(dim), 0.5)
    x = np.zeros(dim)
    x[0] = far
    root = np.linspace(max(1e-9, far - 8), far + 8, 40001)                      # integrate over sqrt(y): no pole
    p = np.exp(sensor.log_likelihood((root**2)[:, None], x)) * 2 * root
    assert np.trapezoid(p, root) == pytest.approx(1.0, abs=1e-5)


def test_squared_range_at_zero():
    p = np.exp(SquaredRange([0.0, 0.0], 1.0).log_likelihood([0.0], np.array([[0.0, 0.0], [1.0, 0.0]])))
    np.testing.assert_allclose(p, [0.5, 0.5 * np.exp(-0.5)], rtol=1e-12)


def test_binary_sector_probabilities_sum_to_one_and_know_the_direction():
    sensor = BinarySector([[0.0, 0.0]], 100.0, 0.0, np.pi / 2, np.pi / 2)       # a quarter circle around east
    x = np.array([[50.0, 10.0], [50.0, 60.0], [-50.0, 0.0], [120.0, 0.0]])
    np.testing.assert_array_equal(sensor.h(x)[:, 0], [1, 0, 0, 0])
    np.testing.assert_array_equal(np.exp(sensor.log_likelihood([1.0], x)), [1, 0, 0, 0])
    np.testing.assert_array_equal(np.exp(sensor.log_likelihood([0.0], x)), [0, 1, 1, 1])
    soft = STEPS["sector"]
    total = sum(np.exp(soft.log_likelihood([a, b, c], states(2, (20,)))) for a in (0.0, 1.0) for b in (0.0, 1.0)
                for c in (0.0, 1.0))
    np.testing.assert_allclose(total, 1.0, rtol=1e-12)


def test_quantised_likelihood_far_out_is_finite():
    log = Quantised(0.5).log_likelihood([0.0], np.array([[30.0], [-30.0], [3000.0]]))
    assert np.isfinite(log).all()
    # log Phi(-58) = -x^2/2 - log(x sqrt(2 pi)) + log(1 - 1/x^2 + ...), the other edge is negligible
    assert log[0] == pytest.approx(-58**2 / 2 - np.log(58 * np.sqrt(2 * np.pi)) + np.log1p(-(58.0**-2)), rel=1e-7)


def test_missing_access_points_are_left_out():
    y, x = np.array([-60.0, np.nan, -70.0]), states(2, (40,))
    heard = SignalStrength(STATIONS[[0, 2]], [-40.0, -45.0], [2.5, 3.0], [6.0, 5.0])
    np.testing.assert_allclose(SMOOTH["signal"].log_likelihood(y, x), heard.log_likelihood(y[[0, 2]], x), rtol=1e-13)
    assert not SMOOTH["signal"].log_likelihood(np.full(3, np.nan), x).any()
    for bad in ([np.nan, np.inf, -60.0], [np.nan, -60.0]):
        with pytest.raises(ValueError, match="y: expected"):
            SMOOTH["signal"].log_likelihood(bad, x)
    f = STEPS["fingerprint"]
    one = Fingerprint(STATIONS, f.powers_dbm[:, :1], 4.0)
    np.testing.assert_allclose(f.log_likelihood([-60.0, np.nan], x), one.log_likelihood([-60.0], x), rtol=1e-13)


def test_uniform_noise_set_of_possible_states():
    """C2-26 (a): y = 2 leaves 1 <= |x| <= sqrt 3."""
    x = np.linspace(-3, 3, 1201)[:, None]
    inside = np.isfinite(UniformNoise(Square(), 1.0).log_likelihood([2.0], x))
    np.testing.assert_array_equal(inside, (np.abs(x[:, 0]) >= 1) & (np.abs(x[:, 0]) <= np.sqrt(3)))


# --- angles ------------------------------------------------------------------------------------------------------


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles(a):
    w = wrap_angle(np.array(a))
    assert -np.pi < w <= np.pi + 1e-12
    assert np.cos(w) == pytest.approx(np.cos(a), abs=1e-9) and np.sin(w) == pytest.approx(np.sin(a), abs=1e-9)


def test_wrap_keeps_small_angles_exactly_and_takes_the_upper_end():
    small = np.array([1e-300, -1e-17, 3.0, np.pi])
    np.testing.assert_array_equal(wrap_angle(small), small)
    assert wrap_angle(-np.pi) == np.pi


def test_bearing_innovation_across_south():
    sensor = Bearing([[0.0, 0.0]], 0.1)
    y, x = np.array([np.radians(-179.0)]), np.array([np.sin(np.radians(179.0)), np.cos(np.radians(179.0))])
    assert sensor.innovation(y, sensor.h(x))[0] == pytest.approx(np.radians(2.0))
    same = sensor.log_likelihood(np.array([np.radians(177.0)]), x)
    assert sensor.log_likelihood(y, x) == pytest.approx(same)
    stack = Stack([Range([[0.0, 0.0]], 1.0), sensor])
    assert stack.innovation(np.array([5.0, y[0]]), np.array([4.0, np.pi]))[1] == pytest.approx(np.radians(1.0))


def test_bearings_are_clockwise_from_north():
    x = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    np.testing.assert_allclose(np.degrees(Bearing([[0.0, 0.0]], 1.0).h(x))[:, 0], [0, 90, 180, -90])


# --- batches -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1,), (7,), (2, 3)])
@pytest.mark.parametrize("layout", ["C", "F"])
@pytest.mark.parametrize("name", ALL)
def test_batch_equals_loop(name, layout, shape):
    sensor = ALL[name]
    x = np.array(states(4, shape), order=layout)
    before = x.copy()
    y = a_measurement(name, states(4, seed=8))
    h, J, log = sensor.h(x), sensor.jacobian(x), sensor.log_likelihood(y, x)
    m = len(sensor.R)
    assert h.shape == (*shape, m) and J.shape == (*shape, m, 4) and log.shape == shape
    for i in np.ndindex(*shape):
        np.testing.assert_allclose(h[i], sensor.h(x[i]), rtol=1e-12)
        np.testing.assert_allclose(J[i], sensor.jacobian(x[i]), rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(log[i], sensor.log_likelihood(y, x[i]), rtol=1e-11)
    np.testing.assert_array_equal(x, before)


@pytest.mark.parametrize("name", ALL)
def test_many_measurements_at_once(name):
    sensor = ALL[name]
    x = states(4, (6,))
    y = a_measurement(name, x)
    before = y.copy()
    log = sensor.log_likelihood(y, x)
    assert log.shape == (6,)
    np.testing.assert_allclose(log, [sensor.log_likelihood(a, b) for a, b in zip(y, x, strict=True)], rtol=1e-12)
    grid = sensor.log_likelihood(y[:, None], x)                                 # every measurement at every state
    assert grid.shape == (6, 6)
    np.testing.assert_allclose(grid.diagonal(), log, rtol=1e-12)
    np.testing.assert_array_equal(y, before)


@pytest.mark.parametrize("name", ALL)
def test_noise_covariance_and_immutability(name):
    sensor = ALL[name]
    m = len(sensor.R)
    assert sensor.R.shape == (m, m) and np.linalg.eigvalsh(sensor.R).min() > 0
    with pytest.raises(ValueError):
        sensor.R[0, 0] = 5.0
    with pytest.raises(AttributeError):
        sensor.R = np.eye(m)


def test_stack_of_stacks_is_the_flat_stack():
    a, b, c = Range(STATIONS, 2.0), Bearing(STATIONS, 0.1), Quantised(0.5, axis=2)
    nested, flat = Stack([a, Stack([b, c])]), Stack([a, b, c])
    x = states(4, (5,))
    y = flat.h(x)
    np.testing.assert_array_equal(nested.h(x), y)
    np.testing.assert_array_equal(nested.R, flat.R)
    np.testing.assert_allclose(nested.log_likelihood(y, x), flat.log_likelihood(y, x), rtol=1e-14)


def test_linear_with_a_perfect_row_has_no_density():
    sensor = Linear(np.eye(2), [1.0, 0.0])
    with pytest.raises(ValueError, match="positive definite"):
        sensor.log_likelihood([0.0, 0.0], np.zeros(2))
    np.testing.assert_array_equal(sensor.R, np.diag([1.0, 0.0]))


# --- refusals ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Range([1.0, 2.0], 1.0), r"stations_m: expected (shape|points)"),
        (lambda: Range(np.empty((0, 2)), 1.0), "stations_m: expected points"),
        (lambda: Range([[0.0, np.nan]], 1.0), "stations_m: expected finite"),
        (lambda: Range(STATIONS, 0.0), "sigma_m: expected positive"),
        (lambda: Range(STATIONS, [1.0, 2.0]), "sigma_m: expected a number or 3"),
        (lambda: Range(STATIONS, "wide"), "sigma_m: expected numbers"),
        (lambda: Pseudorange(SPACE, -1.0), "sigma_m: expected positive"),
        (lambda: Pseudorange(SPACE, 1.0).h(np.zeros(3)), "x: expected shape"),
        (lambda: RangeDifference(STATIONS[:1], 1.0), "at least 2 stations"),
        (lambda: Bearing([[1.0], [2.0]], 0.1), "east and north"),
        (lambda: RangeRate(STATIONS, 1.0, [1.0, 2.0, 3.0]), "velocities_mps"),
        (lambda: RangeRate(STATIONS, 1.0).h(np.zeros(3)), "x: expected shape"),
        (lambda: Position(0, 1.0), "dim: expected a positive integer"),
        (lambda: Position(3, 1.0).h(np.zeros(2)), "x: expected shape"),
        (lambda: Linear([[1.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]]), "R: expected shape"),
        (lambda: Linear(np.eye(2), [[1.0, 2.0], [2.0, 1.0]]), "R: expected a positive semidefinite"),
        (lambda: Linear(np.eye(2), np.eye(2)).h(np.zeros(3)), "x: expected shape"),
        (lambda: SignalStrength(STATIONS, [1.0, 2.0], 2.0, 6.0), "power_dbm: expected a number or 3"),
        (lambda: Quantised(0.0), "sigma: expected a positive"),
        (lambda: Quantised(1.0, axis=-1), "axis"),
        (lambda: Quantised(1.0).log_likelihood([0.5], np.zeros(1)), "whole numbers"),
        (lambda: BinarySector(STATIONS, 0.0), "radius_m: expected numbers > 0"),
        (lambda: BinarySector(STATIONS, 1.0, -1.0), "sigma_m: expected numbers >= 0"),
        (lambda: BinarySector(STATIONS, 1.0).log_likelihood([1.0, 2.0, 0.0], np.zeros(2)), "zeros and ones"),
        (lambda: UniformNoise(Range(STATIONS, 1.0), 0.0), "half_width: expected positive"),
        (lambda: SquaredRange([0.0], 0.0), "sigma_m > 0"),
        (lambda: SquaredRange([0.0], 1.0).log_likelihood([-1.0], np.zeros(1)), "squared distances >= 0"),
        (lambda: Fingerprint(STATIONS, [[1.0], [2.0]], 1.0), "powers_dbm: expected shape"),
        (lambda: STEPS["fingerprint"].log_likelihood([1.0], np.zeros(2)), "y: expected"),
        (lambda: STEPS["fingerprint"].weighted_neighbours([-50.0, -50.0], 9), "k: expected 1 to 3"),
        (lambda: STEPS["fingerprint"].posterior([-50.0, -50.0], [0.0, 0.0, 0.0]), "prior: expected weights"),
        (lambda: Stack([]), "at least one sensor"),
        (lambda: SMOOTH["stack"].log_likelihood([1.0], np.zeros(4)), "y: expected shape"),
    ],
)
def test_bad_parameters(build, words):
    with pytest.raises(ValueError, match=words):
        build()


@pytest.mark.parametrize("name", ALL)
def test_bad_states_and_measurements(name):
    sensor, x = ALL[name], states(4)
    y = a_measurement(name, x)
    for bad in (np.nan, np.inf):
        broken = x.copy()
        broken[:2] = bad
        for call in (sensor.h, sensor.jacobian, lambda v: sensor.log_likelihood(y, v)):
            with pytest.raises(ValueError, match="x: expected finite"):
                call(broken)
            with pytest.raises(ValueError, match="x: expected finite"):
                call(np.tile(broken, (50, 1)))
    with pytest.raises(ValueError, match="y: expected"):
        sensor.log_likelihood(np.full_like(y, np.inf), x)
    with pytest.raises(ValueError, match="y: expected"):
        sensor.log_likelihood(np.append(y, 0.0), x)
    with pytest.raises(ValueError, match="x: expected shape"):
        sensor.h(np.array(1.0))
