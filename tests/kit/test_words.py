"""A lesson's words: front matter, sections, and what is said where they are silent."""

from pathlib import Path

import pytest

from lessons.kit.roles import ROLE_NAMES, ROLES
from lessons.kit.words import SECTIONS, Words, load, parse

TEXT = """---
title: "A title: with a colon"
summary: One line.
params:
  kappa: {label: "κ", hint: "Spread."}
  seed: Seed of chance
options: {map: {polar: "range, bearing"}}
presets: {"kappa = 3 - n": "Shows: this."}
figures: {error: {title: Error, x: "t (s)", traces: {ekf: "extended"}}, plain: Plain}
legend: {b: second, a: first}
empty:
---
Before the first heading.

# Idea
Some *text*.

```python
# no heading in code
```

## A smaller heading
# What to try

- one

# Empty
"""


@pytest.fixture
def words() -> Words:
    return parse(TEXT)


def test_front_matter(words):
    assert (words.title, words.summary, words.language) == ("A title: with a colon", "One line.", "en")
    assert words.label("params", "kappa") == "κ" and words.label("params", "seed") == "Seed of chance"
    assert words.hint("kappa") == "Spread." and words.hint("seed") is None and words.hint("none") is None
    assert words.option("map", "polar") == "range, bearing"
    assert words.label("presets", "kappa = 3 - n") == "Shows: this."
    assert words.axis("error", "x") == "t (s)" and words.axis("error", "y") == "" and words.axis("plain", "x") == ""
    assert words.label("figures", "error") == "Error" and words.label("figures", "plain") == "Plain"
    assert list(words.legend.items()) == [("b", "second"), ("a", "first")]   # the order of the legend
    assert words.has("params", "kappa") and not words.has("params", "none") and not words.has("none", "kappa")


def test_where_the_words_are_silent(words):
    assert words.label("params", "range_sigma_m") == "range sigma m"
    assert words.label("none", "a_b") == "a b" and words.label("empty", "a") == "a"
    assert words.option("map", "other") == "other" and words.option("none", "x") == "x"
    assert words.trace("error", "ekf", "ekf") == "extended"
    assert words.trace("error", "pf", "pf") == ROLE_NAMES["en"]["pf"] == "particle filter"
    assert words.trace("plain", "key", "no role") == "key"
    assert Words().title == "" and Words().legend == {}


def test_sections_split_at_headings_but_not_in_code(words):
    assert list(words.body) == ["", "Idea", "What to try"]
    assert words.body["Idea"].startswith("Some *text*.") and "# no heading in code" in words.body["Idea"]
    assert words.body["Idea"].endswith("## A smaller heading")
    assert words.body["What to try"] == "- one"


@pytest.mark.parametrize(("text", "expected"), [
    ("# Idea\n", "begins with '---'"), ("---\ntitle: x\n", "ends the front matter"), ("---\na: [\n---\n", "not YAML"),
    ("---\n- a\n---\n", "mapping.*list"), ("", "begins with '---'"), 
    ("---\n!!python/object:os.system {}\n---\n", "YAML"),
])
def test_unreadable_words_are_an_error_that_names_the_file(text, expected):
    with pytest.raises(ValueError, match=f"kalman.en.md: .*{expected}"):
        parse(text, "en", "kalman.en.md")


def test_every_role_has_a_name():
    for names in ROLE_NAMES.values():
        assert set(names) == set(ROLES) and all(names.values())


def test_the_file_beside_the_module(tmp_path: Path):
    module = tmp_path / "unscented.py"
    assert load(str(module)) == Words()
    (tmp_path / "unscented.en.md").write_text("---\ntitle: English\n---\n# Idea\nx\n", encoding="utf-8")
    load.cache_clear()
    assert load(str(module)).title == "English"
    assert (load(str(module), "fi").title, load(str(module), "fi").language) == ("English", "en")
    (tmp_path / "unscented.fi.md").write_bytes("---\r\ntitle: Hajustamaton\r\n---\r\n# Idea\r\nä\r\n".encode())
    load.cache_clear()
    finnish = load(str(module), "fi")
    assert (finnish.title, finnish.language, finnish.body) == ("Hajustamaton", "fi", {"Idea": "ä"})
    load.cache_clear()


def test_the_sections_of_a_lesson():
    assert SECTIONS == ("Idea", "What to try", "Questions")
