"""A lesson's plot as SVG, PDF, PNG or self-contained HTML."""

import os
from pathlib import Path

import plotly.graph_objects as go

from app.export.chromium import find
from app.figure_renderer import CONFIG

FORMATS = ("svg", "pdf", "png", "html")


def write(figure: go.Figure, path: Path, size: tuple[int, int]) -> None:
    """Write the figure to `path`, in the format of its ending; RuntimeError when a tool for it is missing."""
    kind = path.suffix[1:].lower()
    if kind == "html":  # to_html takes entries out of the config that it is given
        path.write_text(figure.to_html(config=dict(CONFIG), include_plotlyjs=True), encoding="utf-8")
        return
    try:
        import kaleido  # noqa: F401
    except ImportError:
        raise RuntimeError("pictures of plots need the extra `export`: pip install 'paikka[export]'") from None
    os.environ["BROWSER_PATH"] = find()
    path.write_bytes(figure.to_image(format=kind, width=size[0], height=size[1]))
