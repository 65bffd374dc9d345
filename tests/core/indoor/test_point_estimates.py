"""Point estimates: oracle G-17."""

import numpy as np
import pytest

from core.indoor import estimates, floor_rate, object_weights, office_building, place, project, scatter
from core.indoor.cloud import gather
from core.indoor.geometry import contains
from core.indoor.point_estimates import (
    density_mode,
    floor_weights,
    mean_and_cov,
    medoid,
    most_likely_floor,
    nearest_particle,
    nearest_to_mean,
)
from core.types import Array
from tests.core.indoor.maps import M0, M1
from tests.oracle import entry

OFFICE = office_building()


def bimodal() -> tuple[Array, Array]:
    i = entry("G-17")["inputs"]
    return np.array(i["particles"], float), np.array(i["w"])


def test_four_answers_for_one_cloud():                                                   # oracle G-17
    want = entry("G-17")["expected"]
    x, w = bimodal()
    mean, _ = mean_and_cov(x, w)
    assert mean == pytest.approx(want["mean"], abs=1e-10)
    on_map = project(M0, mean, 0)
    assert on_map.object_id == want["projection"]["link"]
    assert on_map.xy_m == pytest.approx(want["projection"]["xy"], abs=1e-10)
    assert on_map.distance_m == pytest.approx(want["projection"]["distance"], abs=1e-10)
    assert medoid(x, w) == want["medoid"] and nearest_to_mean(x, w) == want["nearest_to_mean"]
    d = np.sqrt(np.square(x[:, None] - x).sum(axis=-1))
    assert (d @ w).argmin() == want["medoid"] and (d**2 @ w).argmin() == want["nearest_to_mean"]
    answers = [tuple(mean), tuple(on_map.xy_m), tuple(x[medoid(x, w)]), tuple(x[nearest_to_mean(x, w)])]
    assert len(set(answers)) == 4


def test_all_of_them_on_a_cloud():
    e, d = M0.nodes["n3"], M0.nodes["n2"]
    clouds = [place(M0, "e", offset_m=6.0), place(M0, "d", offset_m=4.0), place(M0, "d", offset_m=2.0),
              place(M0, "e", offset_m=3.0), place(M0, "b", offset_m=16.0)]
    cloud = type(clouds[0])(*(np.concatenate(a) for a in zip(*clouds, strict=True)))
    x, w = bimodal()
    np.testing.assert_allclose(cloud.position_m[:, :2], x, atol=1e-12)
    out = estimates(M0, cloud, 18 * w)
    assert out.floor == 0 and out.medoid == 3 and out.projection.object_id == "b" and e != d
    assert out.mode in (1, 3) and out.mode == density_mode(x, w)
    assert object_weights(M0, cloud, w) == pytest.approx({"a": 0, "b": 1 / 18, "c": 0, "d": 8 / 18, "e": 0.5, "f": 0})
    np.testing.assert_allclose(out.cov, np.cov(x.T, aweights=w, bias=True))


def test_projection_against_a_fine_search():
    rng = np.random.default_rng(1)
    for g, floor in ((M1, 0), (OFFICE, 0), (OFFICE, 1)):
        fine = []
        for link in g.links.values():
            a, b = (g.nodes[n] for n in link.nodes)
            if floor in (a.floor, b.floor):
                t = np.linspace(0, 1, 2001)[:, None]
                fine.append((1 - t) * np.array(a[:2]) + t * np.array(b[:2]))
        fine = np.concatenate(fine)
        areas = [a.polygon for a in g.areas.values() if a.floor == floor]
        for x in rng.uniform([-30, -30], [100, 40], (60, 2)):
            p = project(g, x, floor)
            if any(contains(P, x) for P in areas):
                assert p.distance_m == 0.0 and (p.xy_m == x).all()
                continue
            assert p.distance_m == pytest.approx(np.sqrt(np.square(p.xy_m - x).sum()))
            assert p.distance_m <= np.sqrt(np.square(fine - x).sum(axis=1)).min() + 1e-9
    with pytest.raises(ValueError, match="floor"):
        project(OFFICE, [0, 0], 2)


def test_the_floor_comes_first():
    cloud = scatter(OFFICE, 400, np.random.default_rng(1))
    w = np.where(cloud.floor == 1, 3.0, 1.0)
    shares = floor_weights(cloud.floor, w)
    assert list(shares) == [0, 1] and sum(shares.values()) == pytest.approx(1.0)
    out = estimates(OFFICE, cloud, w)
    assert out.floor == most_likely_floor(cloud.floor, w) == max(shares, key=shares.get)
    here = cloud.floor == out.floor
    assert out.mean == pytest.approx(cloud.position_m[here, :2].mean(axis=0))
    assert all(here[k] for k in (out.nearest, out.medoid, out.mode))
    assert floor_rate([0, 1, 1, 0], [0, 1, 0, 0]) == 0.75


def test_a_straight_corridor_has_a_nearest_particle():
    x = np.column_stack([np.linspace(0, 10, 21), np.zeros(21)])
    assert nearest_particle(x, np.ones(21)) == 10 and nearest_particle(x[:1], [1.0]) == 0
    rng = np.random.default_rng(1)
    x = rng.standard_normal((50, 2)) @ np.array([[3.0, 1.0], [0.0, 0.5]])
    mean, cov = mean_and_cov(x, np.ones(50))
    squares = np.einsum("ij,ji->i", x - mean, np.linalg.solve(cov, (x - mean).T))
    assert nearest_particle(x, np.ones(50)) == squares.argmin()


def test_large_clouds_are_thinned_and_come_near():
    cloud = scatter(M0, 6000, np.random.default_rng(1))
    x, w = cloud.position_m[:, :2], np.exp(-0.5 * np.square(cloud.position_m[:, 0] - 20.0) / 25.0)
    exact = np.array([np.sqrt(np.square(x - p).sum(axis=1)) @ w for p in x[::60]]).min() / w.sum()
    ours = np.sqrt(np.square(x - x[medoid(x, w)]).sum(axis=1)) @ w / w.sum()
    assert ours <= exact * 1.02
    assert abs(x[density_mode(x, w), 0] - 20.0) < 3.0


def test_bad_weights():
    cloud = gather(scatter(M0, 5, np.random.default_rng(1)), np.arange(5))
    for w in ([1, 1], [-1, 1, 1, 1, 1], np.zeros(5), [np.nan] * 5, np.ones((5, 1))):
        with pytest.raises(ValueError, match="w: expected"):
            estimates(M0, cloud, w)
    with pytest.raises(ValueError, match="bandwidth"):
        density_mode([[0.0, 0.0]], [1.0], 0.0)
    for truth in ([0, 1, 1], []):
        with pytest.raises(ValueError, match="floor"):
            floor_rate([0, 1], truth)
