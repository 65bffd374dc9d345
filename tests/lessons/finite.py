"""Whether a view shows numbers only."""

import numpy as np

from lessons.kit.lesson import View

FIELDS = ("positions", "points", "pairs", "vertices", "values", "segments", "z")


def assert_finite(view: View) -> None:
    """Positions in the scene, plotted values and readouts are finite; a readout may be empty."""
    for item in view.scene:
        for field in FIELDS:
            assert np.isfinite(np.asarray(getattr(item, field, 0.0), dtype=float)).all(), (item.name, field)
    for name, figure in view.figures.items():
        assert all(np.isfinite(np.asarray(trace.y, dtype=float)).all() for trace in figure.data), name
    assert all(np.isfinite(r.value) for r in view.readouts if isinstance(r.value, float))
