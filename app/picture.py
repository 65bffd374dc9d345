"""The scene as a PNG: drawn again at the size asked for, with everything enlarged in proportion."""

import io
import logging
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.camera import Pose, Room, fit
from app.draw.primitives import style_for
from app.draw.space import space_for
from app.theme import LIGHT
from app.web import adapter
from lessons.kit.scene import Camera

if TYPE_CHECKING:
    from app.session import Session

SIZES = {"1920 \u00d7 1080": (1920, 1080), "3840 \u00d7 2160": (3840, 2160)}
MAX_SIDE = 8192
SETTLE_SECONDS = 60.0
log = logging.getLogger(__name__)


def take(session: "Session", width: int, height: int, transparent: bool, with_legend: bool = True) -> bytes:
    """PNG bytes of what the session shows, on white or on nothing.

    Dark pictures are for screens: a saved one has the light colours.  RuntimeError when nothing is shown yet or the
    browser does not answer.
    """
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
        raise ValueError(f"size: expected 1 to {MAX_SIDE} pixels a side, got {width}x{height}")
    with session.render_lock:
        view, shown = session.view, session.shown
        if view is None or shown is None:
            raise RuntimeError("there is no picture yet")
        canvas = session.camera.canvas
        now = session.camera.pose(view.camera, shown.camera)
        legend = session.legend_of(view, shown, LIGHT) if with_legend else []
        pose, enlarge = framed(view.camera, now, canvas, (width, height), shown.camera is not None, legend)
        client = session.client
        try:
            with client.atomic():
                adapter.call_page(client, "setDark", False)
                # viser's text grows with the height of the picture by itself, its lines and dots do not
                grown = height / canvas[1]
                style = style_for(view.camera, LIGHT, lines=enlarge, text=enlarge / grown, dots=grown)
                session.draw_scene(view, style, shown)
            client.flush()
            if not adapter.wait_drawn(client, session.has_labels, SETTLE_SECONDS):
                log.warning("the browser was still drawing; some labels may be missing")
            placed = pose.placed(space_for(view.camera))
            pixels = client.get_render(height, width, wxyz=placed.wxyz(), position=placed.position, fov=placed.fov,
                                       transport_format="png", timeout=120.0)
        finally:
            with client.atomic():
                adapter.call_page(client, "setDark", shown.theme == "dark")
                session.redraw_scene(view, shown)
            client.flush()
    return compose(pixels, transparent, view.caption if with_legend else "", legend, enlarge)


def framed(camera: Camera, now: Pose, canvas: tuple[int, int], size: tuple[int, int], by_user: bool,
           legend: list[tuple[str, str]]) -> tuple[Pose, float]:
    """The pose for the picture, and how many of its pixels a pixel on the screen becomes.

    The legend gets room at the right where that costs the scene little of its size.
    """
    width, height = size
    pose, enlarge = now, height / canvas[1]
    for _ in range(1 if by_user else 3):
        if not by_user:
            pose = fit(camera, width, height, Room(right=legend_width(legend, enlarge), text=enlarge))
        enlarge = (height / pose.visible_height) / (canvas[1] / now.visible_height)
        # text neither vanishes nor fills the picture, whatever the shape of the canvas
        enlarge = float(np.clip(enlarge, height / 1100, height / 560))
    return pose, enlarge


def compose(pixels: np.ndarray, transparent: bool, caption: str, legend: list[tuple[str, str]],
            enlarge: float) -> bytes:
    """The render (h, w, 4) with caption and legend, on white unless transparent, as PNG."""
    image = Image.fromarray(np.ascontiguousarray(pixels), "RGBA")
    if not transparent:
        image = Image.alpha_composite(Image.new("RGBA", image.size, (255, 255, 255, 255)), image)
    draw = ImageDraw.Draw(image)
    if caption:
        draw.text((14 * enlarge, 10 * enlarge), caption, fill=LIGHT.text, font=_font(round(16 * enlarge)))
    if legend:
        _draw_legend(image, draw, legend, enlarge)
    out = io.BytesIO()
    (image if transparent else image.convert("RGB")).save(out, "PNG", optimize=False)
    return out.getvalue()


def legend_width(legend: list[tuple[str, str]], k: float) -> float:
    """Pixels that the legend takes at the right of a picture."""
    font = _font(round(13 * k))
    return max((font.getlength(text) for _, text in legend), default=-54 * k) + 54 * k


def _draw_legend(image: Image.Image, draw: ImageDraw.ImageDraw, legend: list[tuple[str, str]], k: float) -> None:
    font, row = _font(round(13 * k)), 20 * k
    x, y = image.width - legend_width(legend, k), 12 * k
    for at, (color, text) in enumerate(legend):
        top = y + at * row
        draw.rounded_rectangle((x + 8 * k, top + 6 * k, x + 22 * k, top + 16 * k), 2 * k, fill=color)
        draw.text((x + 30 * k, top + 11 * k), text, fill=LIGHT.text, font=font, anchor="lm")


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    """DejaVu Sans comes with the formula renderer and knows the Greek letters."""
    import ziafont

    return ImageFont.truetype(str(Path(ziafont.__file__).parent / "fonts" / "DejaVuSans.ttf"), size)
