"""Finding a Chromium, and running it headless on our own pages."""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = (
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--disable-background-networking", "--no-first-run", "--no-default-browser-check", "--disable-component-update",
    "--disable-sync", "--disable-default-apps", "--disable-extensions", "--disable-domain-reliability", "--mute-audio",
    "--disable-features=Translate,OptimizationHints,MediaRouter,AutofillServerCommunication",
)
ADVICE = ("no Chromium found: install one (Debian: `apt-get install chromium`; anywhere: "
          "`pip install playwright && playwright install chromium`) or name it in PAIKKA_CHROMIUM")


class NoChromium(RuntimeError):
    """There is no browser to draw with; the message says how to get one."""


def find() -> str:
    """The executable: PAIKKA_CHROMIUM, else the PATH's, else Playwright's own; NoChromium otherwise."""
    named = os.environ.get("PAIKKA_CHROMIUM")
    if named:
        if not os.access(named, os.X_OK):
            raise NoChromium(f"PAIKKA_CHROMIUM: expected an executable, got {named}")
        return named
    for name in NAMES:
        if found := shutil.which(name):
            return found
    if found := _playwrights_own():
        return found
    raise NoChromium(ADVICE)


@contextlib.contextmanager
def visit(url: str, width: int, height: int) -> Iterator[subprocess.Popen[bytes]]:
    """A headless Chromium that shows `url` in a window of this size; it ends with the block."""
    with tempfile.TemporaryDirectory(prefix="paikka-", ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [find(), "--headless=new", *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}",
             "--hide-scrollbars", "--remote-debugging-port=0", url],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _playwrights_own() -> str | None:
    root = os.environ.get("PLAYWRIGHT_BROWSERS_PATH")
    base = Path(root) if root and root != "0" else {
        "darwin": Path.home() / "Library" / "Caches", "win32": Path.home() / "AppData" / "Local",
    }.get(sys.platform, Path.home() / ".cache") / "ms-playwright"
    patterns = ("chromium-*/chrome-linux*/chrome", "chromium-*/chrome-mac*/*.app/Contents/MacOS/*",
                "chromium-*/chrome-win*/chrome.exe")
    found = sorted(p for pattern in patterns for p in base.glob(pattern))
    return str(found[-1]) if found else None
