"""Pictures for slides: the button in the page, the plots' own bars, and `paikka export`."""

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.browser.visit import Visit, colors

pytestmark = pytest.mark.browser

SIZES = {"1920 × 1080": (1920, 1080), "3840 × 2160": (3840, 2160)}
ROOT = Path(__file__).parents[2]


def saved_picture(visit: Visit, size: str, background: str) -> Image.Image:
    """What the button saves."""
    page = visit.page
    for label, value in (("Size", size), ("Background", background)):
        field = page.get_by_role("combobox", name=label)
        if field.input_value() != value:
            field.click()
            page.get_by_role("option", name=value, exact=True).click()
            # viser forgets a widget's message when another follows within 50 ms
            visit.until(lambda field=field, value=value: visit.server_value(field) == value, f"{label} = {value}")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save picture").click()
    assert download.value.suggested_filename == f"{visit.scenario.lesson}.png"
    return Image.open(io.BytesIO(Path(download.value.path()).read_bytes()))


def ink(picture: np.ndarray) -> float:
    """The share of the picture that is strongly coloured: lines, dots and bodies, not text or grid."""
    rgb = picture[..., :3].astype(int)
    return float((rgb.max(axis=-1) - rgb.min(axis=-1) > 60).mean())


@pytest.mark.parametrize("lesson", ["filtering.kalman", "background.rotation_vector"])
def test_save_picture(visit: Visit, lesson: str) -> None:
    """White or transparent, in both sizes, and nothing thinner in the larger one."""
    visit.open(f"lesson={lesson}")
    visit.page.get_by_role("tab", name="Picture").click()
    coloured = {}
    for name, size in SIZES.items():
        white = saved_picture(visit, name, "white")
        assert white.size == size and white.mode == "RGB"
        pixels = np.asarray(white)
        assert all((pixels[y, x] == 255).all() for y in (0, -1) for x in (0, -1))
        assert colors(pixels[::4, ::4]) > 50
        coloured[name] = ink(pixels)
        assert coloured[name] > 0.005
    small, large = coloured.values()
    assert large == pytest.approx(small, rel=0.05)  # a quarter is lost where lines do not grow

    clear = saved_picture(visit, "1920 × 1080", "transparent")
    assert clear.size == (1920, 1080) and clear.mode == "RGBA"
    pixels = np.asarray(clear)
    assert all(pixels[y, x, 3] == 0 for y in (0, -1) for x in (0, -1))
    assert (pixels[..., 3] == 0).mean() > 0.5 and (pixels[..., 3] == 255).mean() > 0.005
    opaque = pixels[pixels[..., 3] == 255]
    assert ((opaque[:, :3].max(axis=1).astype(int) - opaque[:, :3].min(axis=1)) > 60).mean() > 0.2, "colours stay"
    # the scene on the screen is again what it was
    assert colors(visit.canvas()) > 100


def test_transparent_picture_at_full_size(visit: Visit) -> None:
    visit.open("lesson=filtering.particle_vs_ekf&theme=dark")
    visit.page.get_by_role("tab", name="Picture").click()
    picture = saved_picture(visit, "3840 × 2160", "transparent")
    assert picture.size == (3840, 2160) and picture.mode == "RGBA"
    pixels = np.asarray(picture)
    assert all(pixels[y, x, 3] == 0 for y in (0, -1) for x in (0, -1))
    assert (pixels[..., 3] > 0).mean() > 0.01
    visit.drawn()
    assert visit.page.evaluate("window.paikka.labels.dark"), "the screen is dark again"


def test_plot_saves_itself_and_goes_to_no_cloud(visit: Visit) -> None:
    visit.open("lesson=filtering.kalman", drawn=False)
    plot = visit.page.locator(".js-plotly-plot")
    plot.hover()
    buttons = [b.get_attribute("data-title") for b in plot.locator(".modebar-btn").all()]
    assert buttons and not any("cloud" in (b or "").lower() or "chart studio" in (b or "").lower() for b in buttons)
    assert plot.locator(".modebar-btn--logo").count() == 0
    with visit.page.expect_download() as download:
        plot.locator(".modebar-btn").filter(has=visit.page.locator("svg")).first.click()
    assert download.value.suggested_filename.endswith(".svg")
    text = Path(download.value.path()).read_text(encoding="utf-8")
    assert text.startswith("<svg") and text.count("<path") > 5


def export(tmp_path: Path, name: str, *options: str) -> bytes:
    target = tmp_path / name
    done = subprocess.run([sys.executable, "-m", "app.cli", "export", *options, "--to", str(target)], cwd=ROOT,
                          env={**os.environ, "CI": "1"}, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return target.read_bytes()


def test_export_scene(tmp_path: Path) -> None:
    png = export(tmp_path, "scene.png", "filtering.kalman", "--step", "12", "--size", "1280x720", "--transparent")
    picture = Image.open(io.BytesIO(png))
    assert picture.size == (1280, 720) and picture.mode == "RGBA"
    pixels = np.asarray(picture)
    assert pixels[0, 0, 3] == 0 and colors(pixels) > 100 and ink(pixels) > 0.002


@pytest.mark.parametrize("kind", ["svg", "pdf", "png"])
def test_export_plot(tmp_path: Path, kind: str) -> None:
    data = export(tmp_path, f"plot.{kind}", "filtering.kalman", "--figure", "error", "--size", "800x500")
    if kind == "svg":
        text = data.decode()
        assert "<svg" in text and 'width="800"' in text and 'height="500"' in text and text.count("<path") > 5
    elif kind == "pdf":
        assert data.startswith(b"%PDF-") and len(data) > 5000
    else:
        picture = Image.open(io.BytesIO(data))
        assert picture.size == (800, 500) and colors(np.asarray(picture.convert("RGB"))) > 50
