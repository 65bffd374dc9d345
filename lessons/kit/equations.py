"""Formulas with live numbers in them."""

from dataclasses import dataclass

import numpy as np

Piece = str | int | float | np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    r"""A line such as  x = x^- + K nu = [numbers].

    pieces: a str is LaTeX (keep these constant: they are typeset once and cached); a float is a number, an int a whole
    one; an array (n,) is a column vector; an array (m, n) a matrix.  name: its label stands in the words under
    `equations`.
    current: this is the line that the timeline's stage executes now.  digits: significant digits of the largest
    entry; every entry of an array gets the same number of decimals.

    Equation("gain", (r"K = P^- H^T S^{-1} =", K), current=stage == "gain")
    """

    name: str
    pieces: tuple[Piece, ...]
    current: bool = False
    digits: int = 4
