from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.indoor import inscribed_disc, is_open_area
from core.indoor.discs import disc_area_in_polygon, length_in_disc
from core.indoor.geometry import (
    border,
    contains,
    exits,
    is_simple,
    nearest_in_polygon,
    nearest_on_border,
    signed_area,
)
from core.indoor.triangles import sample_polygon, triangulate
from core.indoor.visibility import shortest_path, visible
from tests.oracle import entry

L = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]], float)
COMB = np.array([[0, 0], [9, 0], [9, 5], [8, 5], [8, 1], [6, 1], [6, 5], [4, 5], [4, 1], [2, 1], [2, 5], [0, 5]], float)


def star(seed, V=14):
    """A star-shaped polygon with random radii: simple, usually far from convex."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, 2 * np.pi, V)) + np.arange(V) * 1e-3
    r = rng.uniform(1.0, 10.0, V)
    P = np.stack([r * np.cos(t), r * np.sin(t)], axis=1)
    gaps = np.diff(t, append=t[0] + 2 * np.pi)
    return P if gaps.max() < np.pi - 0.1 else star(seed + 1000, V)


def test_areas_and_orientation():
    assert signed_area(L) == 7.0 and signed_area(L[::-1]) == -7.0
    assert signed_area(L + 1e6) == pytest.approx(7.0, abs=1e-6)


def test_inside_a_polygon_that_is_not_convex():
    x = np.array([[0.5, 0.5], [3, 0.5], [0.5, 3], [3, 3], [1, 2], [1.001, 2], [4, 1], [-1, 0], [2, 1], [5, 0.5]])
    assert contains(L, x).tolist() == [True, True, True, False, True, False, True, False, True, False]
    assert contains(L, x.reshape(2, 5, 2)).shape == (2, 5)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_triangles_tile_the_polygon(seed):
    P = star(seed)
    T = triangulate(P)
    assert len(T) == len(P) - 2
    areas = [signed_area(t) for t in T]
    assert min(areas) >= -1e-12
    assert sum(areas) == pytest.approx(signed_area(P), rel=1e-9)
    middles = T.mean(axis=1)
    assert contains(P, middles[np.array(areas) > 1e-6]).all()


def test_an_l_is_tiled_by_triangles_inside_it():
    hall = [(60, -10), (84, -10), (84, 16), (74, 16), (74, 4), (60, 4)]
    for P in (hall, L, COMB):
        assert contains(P, triangulate(P).mean(axis=1)).all()


def test_points_are_uniform_in_a_polygon():
    x = sample_polygon(COMB, 20_000, np.random.default_rng(1))
    assert contains(COMB, x).all()
    cells = [(c, r) for c in range(9) for r in range(5) if contains(COMB, [c + 0.5, r + 0.5])]
    counts = np.array([((x >= c) & (x < np.add(c, 1))).all(axis=1).sum() for c in cells])
    expected = 20_000 / len(cells)
    assert counts.sum() == 20_000
    chi2, n = (np.square(counts - expected) / expected).sum(), len(cells) - 1
    assert chi2 < n + 4.5 * np.sqrt(2 * n)                # false alarm below 1e-4


def test_a_broken_border_cannot_be_tiled():
    with pytest.raises(ValueError, match="cross"):
        triangulate([[2, 5], [5, 1], [0, 3], [4, 4], [3, 4], [5, 5]])


@pytest.mark.parametrize("seed", range(30))
def test_a_random_star_is_simple_and_is_not_after_a_swap(seed):
    P = star(seed)
    assert is_simple(P) == (True, "")
    far = P.copy()
    far[[2, 9]] = far[[9, 2]]
    assert not is_simple(far)[0]


def test_nearest_points():
    near = nearest_on_border(L, [[3, 3], [2, -1], [0.5, 2]])
    assert near.distance.tolist() == [2.0, 1.0, 0.5]
    assert near.point[1].tolist() == [2.0, 0.0]
    assert nearest_in_polygon(L, [[0.5, 2], [2, -1]]).tolist() == [[0.5, 2.0], [2.0, 0.0]]


def test_exits_of_segments():
    edges = border(L)
    p = np.array([[0.5, 0.5]] * 5 + [[4, 0.5], [1.0, 2.0], [1.0, 2.0]])
    q = np.array([[3.5, 0.5], [5, 0.5], [0.5, 5], [3.5, 3.5], [-1, 0.5], [3, 0.5], [1.0, 3.0], [1.5, 2.0]])
    first = np.full(len(p), np.inf)
    for s, t in zip(*(exits(edges, p, q)[k] for k in (0, 2)), strict=True):
        first[s] = min(first[s], t)
    assert np.isinf(first[[0, 5, 6]]).all()               # inside; away from the border; along it
    assert first[1] == pytest.approx(3.5 / 4.5) and first[2] == pytest.approx(3.5 / 4.5)
    assert first[3] == pytest.approx(0.5 / 3.0) and first[4] == pytest.approx(1 / 3) and first[7] == 0.0


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_a_segment_without_exit_stays_inside_and_one_with_exit_does_not(seed):
    P, rng = star(seed), np.random.default_rng(seed)
    p, q = sample_polygon(P, 60, rng), rng.uniform(-10, 10, (60, 2))
    out = exits(border(P), p, q)
    first = np.full(60, np.inf)
    np.minimum.at(first, out.segment, out.fraction)
    t = np.linspace(0, 1, 201)[:, None, None]
    inside = contains(P, p + t * (q - p))
    sampled = np.where(inside.all(axis=0), np.inf, (~inside).argmax(axis=0) / 200)
    left = np.isfinite(first)
    assert not np.isfinite(sampled[~left]).any()
    assert (sampled[left] >= first[left] - 1e-9).all()


def test_sight():
    assert visible(L, [0.5, 3.5], [0.5, 0.5]) and visible(L, [1, 4], [1, 1]) and visible(L, [0, 0], [4, 0])
    assert not visible(L, [0.5, 3.5], [3.5, 0.5]) and not visible(L, [1, 4], [4, 1])
    assert visible(L, [2, 0.5], [2, 0.5]) and not visible(L, [3, 3], [3, 3])
    assert not visible(COMB, [1, 4], [5, 4]) and visible(COMB, [1, 0.5], [8.5, 0.5])


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6))
def test_sight_is_mutual_and_agrees_with_samples(seed):
    P, rng = star(seed), np.random.default_rng(seed)
    p, q = sample_polygon(P, 12, rng), sample_polygon(P, 12, rng)
    for a, b in zip(p, q, strict=True):
        seen = visible(P, a, b)
        assert seen == visible(P, b, a)
        if seen:
            assert contains(P, a + np.linspace(0, 1, 101)[:, None] * (b - a)).all()


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10**6))
def test_a_shortest_path_stays_inside_and_cannot_be_cut_short(seed):
    P, rng = star(seed), np.random.default_rng(seed)
    p, q = sample_polygon(P, 2, rng)
    way = shortest_path(P, p, q)
    length = np.sqrt(np.square(np.diff(way, axis=0)).sum(axis=1)).sum()
    assert (way[0] == p).all() and (way[-1] == q).all()
    assert length >= np.sqrt(np.square(q - p).sum()) - 1e-12
    for a, b in pairwise(way):
        assert visible(P, a, b)
    for k in range(len(way) - 2):                         # every bend is needed
        assert not visible(P, way[k], way[k + 2])
    back = shortest_path(P, q, p)
    assert np.sqrt(np.square(np.diff(back, axis=0)).sum(axis=1)).sum() == pytest.approx(length, rel=1e-12)


def test_the_way_out_of_a_comb():
    way = shortest_path(COMB, [1, 4.5], [8.5, 4.5])
    assert way.tolist() == [[1, 4.5], [2, 1], [8, 1], [8.5, 4.5]]
    with pytest.raises(ValueError, match="outside"):
        shortest_path(COMB, [3, 4], [1, 1])


def test_rolling_disc():                                                                 # oracle G-23
    e = entry("G-23")
    for (a, b), r, opened in zip(e["inputs"]["rects"], e["expected"]["radius"], e["expected"]["open"], strict=True):
        P = [[0, 0], [a, 0], [a, b], [0, b]]
        assert inscribed_disc(P).radius_m == pytest.approx(r, abs=1e-9)
        assert is_open_area(P) is opened
    a, b, c = e["inputs"]["triangle"]
    assert a * a + b * b == c * c
    P = [[0, 0], [a, 0], [0, b]]
    assert inscribed_disc(P).radius_m == pytest.approx(e["expected"]["tri_radius"], abs=1e-9) and is_open_area(P)


def test_the_largest_disc_of_an_l_leans_on_its_inner_corner():
    P = [[0, 0], [10, 0], [10, 4], [4, 4], [4, 10], [0, 10]]
    r = 4 * np.sqrt(2) / (1 + np.sqrt(2))                 # centre (r, r), sqrt(2) (4 - r) = r
    disc = inscribed_disc(P)
    assert disc.radius_m == pytest.approx(r, rel=1e-9) and disc.centre == pytest.approx([r, r])


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10**6))
def test_no_point_of_a_fine_grid_has_a_larger_disc(seed):
    P = star(seed, 9)
    x = np.stack(np.meshgrid(*[np.linspace(-10, 10, 161)] * 2), axis=-1).reshape(-1, 2)
    best = nearest_on_border(P, x[contains(P, x)]).distance.max(initial=0.0)
    disc = inscribed_disc(P)
    assert disc.radius_m >= best - 0.01 * 20              # the search is exact to 1 % of the size
    assert contains(P, disc.centre) and nearest_on_border(P, disc.centre).distance >= disc.radius_m - 1e-9


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6))
def test_disc_and_polygon_overlap_as_darts_say(seed):
    P, rng = star(seed), np.random.default_rng(seed)
    c, r = rng.uniform(-6, 6, 2), rng.uniform(0.5, 8)
    area = disc_area_in_polygon(P, c, r)
    x = sample_polygon(P, 4000, rng)
    share = (np.square(x - c).sum(axis=1) <= r * r).mean()
    assert 0.0 <= area <= min(np.pi * r * r, signed_area(P)) + 1e-9
    p = min(area / signed_area(P), 1.0)                   # rounding may leave it a hair above
    assert abs(share - p) <= 5.5 * np.sqrt(p * (1 - p) / 4000) + 1e-3     # false alarm below 1e-6 for the whole test
    assert disc_area_in_polygon(P[::-1], c, r) == pytest.approx(area, abs=1e-9)


def test_disc_and_polygon_when_one_holds_the_other():
    assert disc_area_in_polygon(L, [0.5, 0.5], 0.25) == pytest.approx(np.pi / 16)
    assert disc_area_in_polygon(L, [2, 2], 50) == pytest.approx(7.0)
    assert disc_area_in_polygon(L, [30, 2], 5) == pytest.approx(0.0, abs=1e-12)


def test_segments_in_a_disc():
    s, e = np.array([[0, 0], [-10, 0], [0, 3], [0, 6], [2, 0]]), np.array([[10, 0], [10, 0], [10, 3], [10, 6], [2, 0]])
    assert length_in_disc(s, e, [0, 0], 5.0) == pytest.approx([5, 10, 4, 0, 0])


@pytest.mark.parametrize("bad", [[[0, 0], [1, 0]], [0, 0, 1], [[0, 0], [1, np.nan], [0, 1]], "x"])
def test_what_is_no_polygon(bad):
    for f in (signed_area, border, triangulate, inscribed_disc):
        with pytest.raises(ValueError, match="polygon"):
            f(bad)


def test_inputs_are_left_alone():
    P, x = COMB[::-1].copy(), np.array([[1.0, 1.0]])
    P0, x0 = P.copy(), x.copy()
    for f in (triangulate, inscribed_disc, border, is_simple):
        f(P)
    contains(P, x), nearest_on_border(P, x), shortest_path(P, x[0], [5.0, 0.5]), disc_area_in_polygon(P, x[0], 2.0)
    assert (P == P0).all() and (x == x0).all()


@pytest.mark.parametrize("r", [0.0, -1.0, np.nan])
def test_radii_must_be_positive(r):
    with pytest.raises(ValueError, match="radius_m"):
        disc_area_in_polygon(L, [0, 0], r)
