"""Live numbers in formulas: small HTML tables between stretching brackets."""

import html
import math

import numpy as np

from app.text.formula import typeset_or_show
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout
from lessons.kit.words import Words

MINUS = "\u2212"


def equations_html(equations: tuple[Equation, ...], words: Words) -> str:
    """The algorithm's lines; the current one is marked."""
    rows = []
    for equation in equations:
        name = html.escape(words.label("equations", equation.name))
        pieces = "".join(_piece(piece, equation.digits) for piece in equation.pieces)
        mark = " pk-now" if equation.current else ""
        rows.append(f'<div class="pk-eq{mark}"><div class="pk-eq-name">{name}</div>'
                    f'<div class="pk-eq-body">{pieces}</div></div>')
    return f'<div class="pk-eqs">{"".join(rows)}</div>'


def readouts_html(readouts: tuple[Readout, ...], words: Words) -> str:
    """A table: label, value, unit."""
    rows = "".join(
        f"<tr><td>{html.escape(words.label('readouts', r.name))}</td>"
        f'<td class="pk-num">{html.escape(readout_text(r))}</td><td>{html.escape(r.unit)}</td></tr>'
        for r in readouts
    )
    return f'<table class="pk-readouts">{rows}</table>' if rows else ""


def readout_text(readout: Readout) -> str:
    if readout.value is None:
        return "\u2013"
    if isinstance(readout.value, str):
        return readout.value
    if isinstance(readout.value, int):
        return _sign(f"{readout.value:,}")
    return significant(float(readout.value), readout.digits)


def significant(value: float, digits: int) -> str:
    """value with `digits` significant digits, never as 1e3 between 0.001 and a million.

    >>> significant(-1234.567, 3), significant(0.00123, 2), significant(12.0, 4), significant(math.inf, 3)
    ('−1235', '0.0012', '12.00', '∞')
    """
    if math.isnan(value):
        return "\u2013"
    if math.isinf(value):
        return "\u221e" if value > 0 else MINUS + "\u221e"
    size = abs(value)
    if size != 0 and not 1e-3 <= size < 1e7:
        mantissa, exponent = f"{value:.{max(digits - 1, 0)}e}".split("e")
        return f"{mantissa.replace('-', MINUS)}\u00b710{_superscript(int(exponent))}"
    places = max(0, digits - 1 - (math.floor(math.log10(size)) if size else 0))
    return _sign(f"{value:.{places}f}")


SUPERSCRIPTS = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")


def _superscript(number: int) -> str:
    return str(number).translate(SUPERSCRIPTS)


def _piece(piece: object, digits: int) -> str:
    if isinstance(piece, str):
        return f'<span class="pk-tex">{typeset_or_show(piece)}</span>'
    places = _places(np.asarray(piece, dtype=np.float64), digits) if np.asarray(piece).dtype.kind == "f" else 0
    array = np.asarray(piece, dtype=np.float64)
    if array.ndim == 0:
        return f'<span class="pk-num">{_sign(f"{float(array):.{places}f}")}</span>'
    matrix = array[:, None] if array.ndim == 1 else array
    rows = "".join("<tr>" + "".join(f"<td>{_sign(f'{v:.{places}f}')}</td>" for v in row) + "</tr>" for row in matrix)
    return f'<table class="pk-matrix">{rows}</table>'


def _places(array: np.ndarray, digits: int) -> int:
    finite = np.abs(array[np.isfinite(array)])
    top = float(finite.max(initial=0.0))
    return min(6, max(0, digits - 1 - (math.floor(math.log10(top)) if top > 0 else 0)))


def _sign(text: str) -> str:
    """A true minus sign, and no minus before a zero."""
    return text.replace("-", MINUS) if text.strip("-0.") else text.lstrip("-")
