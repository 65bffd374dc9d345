"""Words, formulas and numbers as HTML: nothing raw gets through, and nothing broken stops a lesson."""

import logging
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.page import error_html, lesson_html
from app.text.formula import FormulaError, typeset, typeset_or_show
from app.text.markdown import formulas_in, to_html
from app.text.numbers import MINUS, equations_html, readout_text, readouts_html, significant
from lessons.kit.equations import Equation
from lessons.kit.lesson import Readout
from lessons.kit.words import Words, parse
from lessons.registry import Registry

properties = settings(deadline=None, max_examples=100)
EVIL = '<img src=x onerror="alert(1)">&\'"'
BROKEN = r"\frac{1}{"


# -- formulas -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("latex", [
    "x", r"\hat{x}_k^-", r"P = \Phi P \Phi^T + Q", r"\begin{bmatrix} a & b \\ c & d \end{bmatrix}",
    r"\sqrt{\frac{1}{2\pi}}\,e^{-\frac{1}{2}x^2}", r"\left(\frac{a}{b}\right)", r"\mathbf{p}^{A1}",
    r"\sum_{i=1}^n w_i"])
@pytest.mark.parametrize("display", [False, True])
def test_a_formula_is_a_picture_that_scales_with_the_text(latex, display):
    svg = typeset(latex, display)
    root = ElementTree.fromstring(svg)           # well formed
    assert svg.startswith('<svg class="pk-f"')
    assert root.get("aria-label") == latex
    style = dict(part.split(":") for part in root.get("style").split(";"))
    assert style.keys() == {"width", "height", "vertical-align"}
    assert all(value.endswith("em") for value in style.values()) and float(style["height"][:-2]) > 0.2
    assert "currentColor" in svg                 # dark mode
    assert "<symbol" not in svg and "<use" not in svg and " id=" not in svg     # ids of two formulas would collide
    assert "http" not in svg.replace("http://www.w3.org/", "")


def test_brackets_stretch():
    def height(latex: str) -> float:
        return float(ElementTree.fromstring(typeset(latex)).get("viewBox").split()[3])

    tall = height(r"\left[\begin{matrix} 1 \\ 2 \\ 3 \\ 4 \end{matrix}\right]")
    assert tall > 2.5 * height("[1]")


@pytest.mark.parametrize("latex", [BROKEN, r"\notacommand{x}", r"\begin{bmatrix} 1", "}{", r"\left(x", "x^", ""])
def test_broken_latex_is_shown_or_set_but_never_raised(latex):
    shown = typeset_or_show(latex)
    assert shown.startswith(("<svg", '<code class="pk-bad">'))
    assert to_html(f"Before ${latex} x$ after.").startswith("<p>Before")


def test_broken_latex_is_an_error_for_the_check_and_shown_to_the_reader(caplog):
    with pytest.raises(FormulaError, match="frac"):
        typeset(BROKEN)
    with caplog.at_level(logging.ERROR):
        assert typeset_or_show(BROKEN) == f'<code class="pk-bad">{BROKEN}</code>'
    assert BROKEN in caplog.text or "frac" in caplog.text


def test_latex_cannot_smuggle_html():
    for latex in (rf"\text{{{EVIL}}}", EVIL, rf"\frac{{<script>{EVIL}"):
        shown = typeset_or_show(latex)
        assert "<img" not in shown and "<script" not in shown
        ElementTree.fromstring(shown)


# -- Markdown -------------------------------------------------------------------------------------------------------


def test_markdown():
    found = to_html("One *two* **three**\n\n- a\n- b\n\n| x | y |\n|---|---|\n| 1 | 2 |\n")
    for piece in ("<em>two</em>", "<strong>three</strong>", "<li>a</li>", "<table>", "<td>2</td>"):
        assert piece in found


@pytest.mark.parametrize("text", [
    EVIL, f"a {EVIL} b", f"<script>alert(1)</script>\n\n{EVIL}", f"*{EVIL}*", f"- {EVIL}", f"| a |\n|---|\n| {EVIL} |",
    f"`{EVIL}`", f"```\n{EVIL}\n```", "<div onclick='x'>\n\ntext\n\n</div>", f"$x$ {EVIL} $y$", "<!-- x --><iframe>"])
def test_raw_html_is_escaped(text):
    found = to_html(text)
    for tag in ("<img", "<script", "<div", "<iframe", "<!--"):
        assert tag not in found
    assert "&lt;" in found


@pytest.mark.parametrize("link", ["javascript:alert(1)", "vbscript:x", "data:text/html;base64,PHN2Zz4="])
def test_links_that_would_run_are_not_links(link):
    assert "href" not in to_html(f"[text]({link})") and "src" not in to_html(f"![text]({link})")


def test_formulas_in_the_line_and_on_their_own():
    found = to_html("The gain $K$ is\n\n$$K = P H^T\nS^{-1}$$\n\nand \\$5 or 5 \\$.")
    assert found.count("<svg") == 2 and found.count('<span class="pk-display">') == 1
    assert 'aria-label="K"' in found and "$5 or 5 $" in found
    assert "K = P" not in found.replace('aria-label="K = P H^T\nS^{-1}"', "")


def test_markdown_inside_formulas_is_left_alone():
    found = to_html("$a_1 * b_2 * c_3$ and $x < y$ and $[a](b)$")
    assert found.count("<svg") == 3 and "<em>" not in found and "<a " not in found


@pytest.mark.parametrize("code", ["`$x$`", "``$x$ ` $y$``", "```\n$x$\n$$y$$\n```", "```python\na = '$x$'\n```"])
def test_code_is_left_alone(code):
    found = to_html(code)
    assert "<svg" not in found and "$x$" in found and "<code" in found


def test_formulas_in_lists_what_is_typeset():
    text = "$a$ `$b$` \\$c $$d$$ $e$\n```\n$f$\n```\n"
    assert formulas_in(text) == ["a", "d", "e"]
    assert to_html(text).count("<svg") == 3


@properties
@given(st.text(alphabet=st.sampled_from("ab $`\\*_<>&\n|#-x^"), max_size=40))
def test_any_text_becomes_html_without_tags_of_its_own(text):
    allowed = {"p", "em", "strong", "code", "pre", "ul", "li", "h1", "h2", "h3", "h4", "h5", "h6", "hr", "br", "span",
               "svg", "g", "path", "rect", "line", "blockquote", "table", "thead", "tbody", "tr", "th", "td", "a"}
    root = ElementTree.fromstring(f"<p>{to_html(text)}</p>")
    assert {element.tag.rpartition("}")[2] for element in root.iter()} <= allowed


# -- numbers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("value", "digits", "text"), [
    (0.0, 4, "0.000"), (-0.0, 3, "0.00"), (1.0, 1, "1"), (12.0, 4, "12.00"), (-1234.567, 3, f"{MINUS}1235"),
    (0.00123, 2, "0.0012"), (123456.7, 4, "123457"), (1.5e8, 3, "1.50\u00b710\u2078"),
    (-2.5e-7, 2, f"{MINUS}2.5\u00b710\u207b\u2077"), (math.inf, 3, "\u221e"), (-math.inf, 3, f"{MINUS}\u221e"),
    (math.nan, 3, "\u2013"), (1e-300, 3, "1.00\u00b710\u207b\u00b3\u2070\u2070"),
])
def test_significant_digits(value, digits, text):
    assert significant(value, digits) == text


@properties
@given(st.floats(-1e300, 1e300), st.integers(1, 8))
def test_significant_text_is_the_number_and_has_no_hyphen(value, digits):
    text = significant(value, digits)
    assert "-" not in text and "e" not in text
    plain = text.replace(MINUS, "-")
    if "\u00b710" in plain:
        mantissa, exponent = plain.split("\u00b710")
        digit = "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
        exponent = "".join("-" if c == "\u207b" else str(digit.index(c)) for c in exponent)
        plain = f"{mantissa}e{exponent}"
    assert float(plain) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits), abs=0)


def test_readouts():
    words = parse("---\nreadouts: {error: 'Error <of> mean'}\n---\n")
    shown = Readout("error", -1.5, "m", 3), Readout("none", None), Readout("text", "2 < 3", "<b>")
    found = readouts_html(shown, words)
    assert "Error &lt;of&gt; mean" in found and f"{MINUS}1.50" in found and "\u2013" in found
    assert "2 &lt; 3" in found and "&lt;b&gt;" in found and "<b>" not in found
    assert readouts_html((), words) == ""
    assert readout_text(Readout("a", np.float64(2.0), digits=2)) == "2.0"
    assert readout_text(Readout("a", 7, digits=1)) == "7"


def test_readouts_are_escaped():
    found = readouts_html((Readout(EVIL, EVIL, EVIL),), Words())
    assert "<img" not in found
    ElementTree.fromstring(found)


def test_equations():
    words = parse(f"---\nequations: {{gain: 'Gain {EVIL.replace(chr(39), '')}'}}\n---\n")
    K = np.array([[0.5, -0.25], [0.0, 100.0]])
    found = equations_html((Equation("gain", ("K =", K), current=True), Equation("scalar", ("s =", -0.00004, "<", 2.0)),
                            Equation("vector", (np.array([1.0, math.nan]),))), words)
    assert "<img" not in found
    root = ElementTree.fromstring(found)
    assert found.count("pk-now") == 1 and found.index("pk-now") < found.index('aria-label="K ="')
    cells = [cell.text for cell in root.iter("td")]
    assert cells[:4] == ["0.5", f"{MINUS}0.2", "0.0", "100.0"]     # one number of decimals in a matrix
    assert len(cells) == 6 and cells[4] == "1.000"
    assert [len(row) for table in root.iter("table") for row in table] == [2, 2, 1, 1]
    assert f"{MINUS}0.000040" in found
    assert f"{MINUS}0.00<" not in equations_html((Equation("a", (np.array([-1e-9, 2.0]),), digits=3),), words)


def test_broken_formulas_in_equations_are_shown():
    assert "pk-bad" in equations_html((Equation("gain", (BROKEN, 1.0)),), Words())


@properties
@given(st.lists(st.floats(), min_size=1, max_size=4), st.integers(1, 8))
def test_any_numbers_can_be_set(numbers, digits):
    pieces = (np.array(numbers), np.array([numbers, numbers]), numbers[0])
    ElementTree.fromstring(equations_html((Equation("a", pieces, digits=digits),), Words()))


# -- pages ----------------------------------------------------------------------------------------------------------


def test_an_error_message_is_escaped():
    found = error_html(EVIL, f"ValueError: {EVIL}")
    assert "<img" not in found and found.count("&lt;img") == 2


@pytest.mark.parametrize("entry", list(Registry()), ids=lambda entry: entry.id)
def test_the_text_of_every_lesson_is_well_formed(entry):
    found = lesson_html(entry, entry.words())
    ElementTree.fromstring(found)
    assert "src=" not in found                   # nothing is loaded from anywhere
    assert "pk-bad" not in found and "<h1>Idea</h1>" in found and "<h1>Questions</h1>" in found
