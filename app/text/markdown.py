"""A lesson's Markdown with $formulas$ becomes HTML; raw HTML in it is escaped."""

import re
from functools import lru_cache

from markdown_it import MarkdownIt

from app.text.formula import typeset_or_show

_MARKDOWN = MarkdownIt("commonmark", {"html": False, "typographer": False}).enable("table")
_CODE_OR_MATH = re.compile(r"(`+)(?:.|\n)*?\1|\\\$|\$\$((?:.|\n)+?)\$\$|\$((?:[^$\n]|\n(?!\s*\n))+?)\$")


@lru_cache(maxsize=512)
def to_html(text: str) -> str:
    """HTML of `text`: $...$ in the line, $$...$$ on a line of its own, \\$ a dollar sign; code is left alone."""
    formulas: list[str] = []

    def keep(match: re.Match[str]) -> str:
        if match.group(0) == r"\$":
            return "$"
        if match.group(1):
            return match.group(0)
        display = match.group(2) is not None
        svg = typeset_or_show((match.group(2) or match.group(3)).strip(), display)
        formulas.append(f'<span class="pk-display">{svg}</span>' if display else svg)
        return f"\ue000{len(formulas) - 1}\ue001"

    body = _MARKDOWN.render(_CODE_OR_MATH.sub(keep, text))
    return re.sub("\ue000(\\d+)\ue001", lambda m: formulas[int(m.group(1))], body)


def formulas_in(text: str) -> list[str]:
    """The LaTeX of every formula in `text`."""
    found = (m.group(2) or m.group(3) for m in _CODE_OR_MATH.finditer(text))
    return [latex.strip() for latex in found if latex]
