"""LaTeX becomes SVG that scales with the text and takes its colour."""

import html
import logging
import re
from functools import lru_cache

import ziamath
from ziamath.config import config

log = logging.getLogger(__name__)

SIZE = 20.0
# Glyphs as paths: shared <symbol> ids of two formulas on one page would collide.
config.svg2 = False

_VIEW_BOX = re.compile(r'<svg[^>]*?width="[^"]*" height="[^"]*" viewBox="([-\d.e]+) ([-\d.e]+) ([-\d.e]+) ([-\d.e]+)"')


class FormulaError(ValueError):
    """LaTeX that cannot be typeset."""


@lru_cache(maxsize=4096)
def typeset(latex: str, display: bool = False) -> str:
    """An inline <svg> of the formula, its size in em and its baseline on the text's; FormulaError when it cannot be.

    display: the style of a formula on a line of its own.
    """
    try:
        svg = ziamath.Latex(latex, size=SIZE, color="currentColor", inline=not display).svg()
    except Exception as error:
        raise FormulaError(f"cannot typeset {latex!r}: {error}") from error
    found = _VIEW_BOX.match(svg)
    if found is None:
        raise FormulaError(f"cannot typeset {latex!r}: no size in the picture")
    _, top, width, height = (float(v) for v in found.groups())
    depth = top + height
    style = f"width:{width / SIZE:.3f}em;height:{height / SIZE:.3f}em;vertical-align:{-depth / SIZE:.3f}em"
    box = " ".join(found.groups())
    return (f'<svg class="pk-f" role="img" aria-label="{html.escape(latex, quote=True)}" style="{style}" '
            f'viewBox="{box}"' + svg[found.end():])


def typeset_or_show(latex: str, display: bool = False) -> str:
    """The formula, or its source in red when it cannot be typeset (and a line in the log)."""
    try:
        return typeset(latex, display)
    except FormulaError as error:
        log.error("%s", error)
        return f'<code class="pk-bad">{html.escape(latex)}</code>'
