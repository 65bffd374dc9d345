"""Level lines of a grid: on the level, connected, and of the right length."""

import numpy as np
import pytest

from core.level_lines import level_lines

X, Y = np.linspace(-2.0, 2.0, 81), np.linspace(-1.5, 1.5, 61)


def test_a_plane_gives_a_straight_line():
    f = 2.0 * X + Y[:, None] - 0.3
    pairs = level_lines(X, Y, f, 0.5)
    np.testing.assert_allclose(2.0 * pairs[..., 0] + pairs[..., 1], 0.8, atol=1e-12)
    length = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1).sum()
    assert length == pytest.approx(3.0 * np.sqrt(1.25))                  # y from -1.5 to 1.5, x = (0.8 - y) / 2


def test_a_circle_is_closed_and_as_long_as_it_should_be():
    pairs = level_lines(X, Y, np.hypot(X, Y[:, None]), 1.1)
    assert np.abs(np.hypot(*np.moveaxis(pairs, -1, 0)) - 1.1).max() < 1e-3
    assert np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1).sum() == pytest.approx(2.2 * np.pi, rel=1e-3)
    ends, counts = np.unique(pairs.reshape(-1, 2).round(9), axis=0, return_counts=True)
    assert (counts % 2 == 0).all() and len(ends) > 100


def test_nothing_and_the_edge_cases():
    assert level_lines(X, Y, np.ones((61, 81)), 2.0).shape == (0, 2, 2)
    assert level_lines(X, Y, np.zeros((61, 81))).shape == (0, 2, 2)      # on the level counts as below it
    f = np.zeros((61, 81))
    f[30, 40] = 1.0
    assert np.isfinite(level_lines(X, Y, f)).all()
    with pytest.raises(ValueError, match="shape"):
        level_lines(X, Y, np.zeros((81, 61)))
    with pytest.raises(ValueError, match="finite"):
        level_lines(X, Y, np.full((61, 81), np.nan))
