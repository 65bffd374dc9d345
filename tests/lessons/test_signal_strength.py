"""Signal strength: the likelihood of one scan, what more transmitters, shadows and silence do to it."""

from dataclasses import replace

import numpy as np
import pytest

from core.indoor import AccessPoints
from lessons.indoor import signal_strength as lesson
from lessons.indoor._signal_model import SHADOW_M, shadows
from tests.lessons.support import Desk

DESK = Desk(lesson)


def seeds(n=12, **changes):
    return [DESK.result(DESK.params(seed=k, **changes)) for k in range(1, n + 1)]


def errors(results):
    return np.array([np.sqrt(np.square(r.mean[-1] - DESK.default.truth).sum()) for r in results])


def test_laws_are_probabilities_and_start_flat():
    r = DESK.result(DESK.default)
    np.testing.assert_allclose(r.maps.sum(axis=(1, 2, 3)), 1.0)
    assert np.ptp(r.maps[0]) == 0.0 and r.right[0] == pytest.approx(0.5)
    assert r.right[-1] > 0.99 and len(r.order) >= lesson.USED_MOST


def test_the_last_law_is_that_of_core():
    """After all transmitters used: exp of the sum of their log-likelihoods, by AccessPoints itself."""
    r = DESK.result(DESK.default)
    used = r.order[:lesson.USED_MOST]
    some = AccessPoints(r.points.xy_m[used], r.points.floor[used], r.points.power_dbm[used], r.points.exponent[used],
                        r.points.sigma_db[used])
    xx, yy = np.meshgrid(*r.axes)
    here = np.stack([xx, yy, np.zeros_like(xx)], axis=-1)
    log_p = some.log_likelihood(r.y[used], here, np.zeros(xx.shape, dtype=int))
    np.testing.assert_allclose(np.diff(np.log(r.maps[-1, 0]).ravel()), np.diff(log_p.ravel()), atol=1e-6)


def test_more_transmitters_make_the_law_narrower():
    spread = DESK.result(DESK.default).spread
    assert spread[0] > 40.0 > 12.0 > spread[1] > spread[6] > spread[-1] and spread[-1] < 0.8 * spread[1]


def test_one_transmitter_is_a_ring():
    """The likelihood of one strength depends on the distance alone: mean and mode lie apart."""
    r = DESK.result(DESK.default)
    a, law = r.order[0], r.maps[1, 0]
    d = np.sqrt((r.axes[0] - r.points.xy_m[a, 0]) ** 2 + (r.axes[1][:, None] - r.points.xy_m[a, 1]) ** 2)
    ring = (d > 4.0) & (d < 4.5)
    assert ring.sum() > 3 and np.ptp(np.log(law[ring])) < 0.6


def test_beacons_are_few_but_near():
    wlan, ble = (DESK.result(DESK.preset(n)) for n in ("one scan, WLAN", "BLE"))
    far = [np.sqrt(np.square(r.points.xy_m[r.order] - DESK.default.truth).sum(axis=1)).mean() for r in (wlan, ble)]
    assert len(ble.order) < len(wlan.order) / 2 and far[1] < 22.0 < 30.0 < far[0]
    assert ble.spread[-1] < wlan.spread[-1]


def test_shadows_make_an_overconfident_likelihood_miss():
    """Mean error grows, and the claimed spread does not tell: over 12 seeds, ratio 1.5 asked for, about 3 seen."""
    calm, shaded = seeds(sigma_db=3.0), seeds(sigma_db=3.0, shadow_db=8.0)
    assert errors(shaded).mean() > 1.5 * errors(calm).mean()
    honest = np.mean([e / r.spread[-1] for e, r in zip(errors(shaded), shaded, strict=True)])
    assert honest > 1.5


def test_shadows_have_the_deviation_and_the_smoothness_they_claim():
    shade = shadows(40, 6.0, np.random.default_rng(1))
    x = np.random.default_rng(2).uniform(-500.0, 500.0, (400, 2))
    assert shade.at(x).std() == pytest.approx(6.0, rel=0.03)
    near = shade.at(x + np.array([0.5, 0.0])) - shade.at(x)
    assert near.std() < 6.0 * 2 * np.pi * 0.5 / SHADOW_M[0]
    assert not shadows(3, 0.0, np.random.default_rng(1)).at(x).any()


def test_silence_counts_only_when_asked_for():
    ignore, counted = (DESK.result(DESK.params(technology="ble", sigma_db=5.0, unheard=u))
                       for u in ("ignore", "censored"))
    np.testing.assert_array_equal(ignore.y, counted.y)
    np.testing.assert_array_equal(ignore.maps[:-1], counted.maps[:-1])
    assert counted.spread[-1] < ignore.spread[-1]


def test_without_a_loss_the_floor_is_uncertain():
    glass = np.array([r.right[-1] for r in seeds(floor_loss_db=0.0)])
    concrete = np.array([r.right[-1] for r in seeds()])
    assert glass.min() < 0.9 < 0.999 < concrete.min()


def test_a_transmitter_is_chosen_by_a_click_and_dragged():
    target = next(t for t in DESK.view().targets if t.changes["transmitter"] == ("ap3",))
    p = DESK.params(**target.changes, show="field")
    assert DESK.view(p).caption.startswith("mean signal strength of ap3")
    moved = DESK.result(replace(p, place=(0.0, 0.0)))
    assert tuple(moved.points.xy_m[2]) == (0.0, 0.0) and moved.field.argmax() != DESK.result(p).field.argmax()
    assert "no transmitter xyz" in DESK.view(DESK.params(transmitter=("xyz",))).note
    assert "place" in DESK.lesson.unused_at(DESK.default) and "place" not in DESK.lesson.unused_at(p)


def test_nobody_is_heard_far_away():
    r = DESK.result(DESK.params(technology="ble", truth=(400.0, 400.0)))
    assert len(r.order) == 0 and len(r.maps) == 1
    assert DESK.readouts(DESK.params(technology="ble", truth=(400.0, 400.0)))["level"] is None
