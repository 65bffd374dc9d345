"""What the README says is true: its lesson runs, its pictures are there, its commands exist."""

import re
from pathlib import Path

import pytest

from app import check, cli
from lessons.kit.lesson import no_progress
from lessons.registry import Registry

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path):
    """The README's lesson as files."""
    blocks = re.findall(r"<!-- lesson: (\S+) -->\n```\w+\n(.*?)```", README, flags=re.DOTALL)
    assert [name for name, _ in blocks] == ["mean.py", "mean.en.md"]
    for name, text in blocks:
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_the_example_lesson_is_without_fault(folder):
    entry = next(e for e in Registry(folder) if e.path is not None)
    assert [p.text for p in check.check(entry) if not p.translation] == []


def test_the_example_lesson_shows_what_it_claims(folder):
    entry = next(e for e in Registry(folder) if e.path is not None)

    def radius(n):
        params = entry.lesson.Params(n=n)
        result = entry.lesson.compute(params, no_progress)
        return entry.lesson.view(params, result, None).scene[1].gaussian.cov[0, 0] ** 0.5

    assert radius(10) / radius(1000) == pytest.approx(10.0)


def test_the_example_is_short():
    code = re.search(r"<!-- lesson: mean.py -->\n```python\n(.*?)```", README, flags=re.DOTALL).group(1)
    written = [line for line in code.splitlines() if line.strip() and not line.startswith(("from", "import", '"""'))]
    assert len(written) <= 30


def test_pictures_exist():
    for path in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README):
        assert (ROOT / path).stat().st_size > 10_000


def test_commands_exist():
    """Every `paikka COMMAND` that the README shows has help, and every --option in those lines is one of its own."""
    shown = re.findall(r"paikka (serve|list|run|export|check|study)\b([^\n`|]*)", README)
    assert {name for name, _ in shown} >= {"serve", "list", "run", "export", "check"}
    parser = cli._parser()
    commands = next(a for a in parser._actions if a.choices).choices
    for name, rest in shown:
        known = {option for action in commands[name]._actions for option in action.option_strings}
        assert set(re.findall(r"--[a-z-]+", rest)) <= known
