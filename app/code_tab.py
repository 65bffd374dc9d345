"""The code behind a lesson: the functions of `core` that it calls, and a script that reproduces its numbers."""

import ast
import html
import importlib
import inspect
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

from app.scenario import Scenario
from lessons.kit import files
from lessons.kit.params import values
from lessons.registry import Entry

_LEXER, _FORMATTER = PythonLexer(), HtmlFormatter(nowrap=True)


def core_functions(entry: Entry) -> list[tuple[str, str]]:
    """Qualified name and source of what the lesson uses of `core`, its private siblings included, in order."""
    found: dict[str, Any] = {}
    for module in _modules(entry):
        for thing in _used(module):
            if (inspect.isfunction(thing) or inspect.isclass(thing)) and thing.__module__.startswith("core."):
                found[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return [(name, inspect.getsource(thing)) for name, thing in found.items()]


def script(entry: Entry, scenario: Scenario) -> str:
    """A complete script whose output is the lesson's readouts at this scenario: `name value unit` in each line."""
    if entry.path is None:
        load = f"from {entry.module_name} import LESSON"
    else:
        load = (f"import runpy\n\nLESSON = runpy.run_path({str(entry.path.name)!r})[\"LESSON\"]"
                "  # run this in the lesson's folder")
    loaded = [files.get(str(value)) for name, value in values(scenario.params).items()
              if entry.parameters[name].kind == "file" and value]
    given = "".join(f"    {name}={value!r},\n" for name, value in values(scenario.params).items())
    return (f'"""{entry.words().title}: the numbers of one scenario."""\n\n'
            f"{load}\n"
            f"{'from lessons.kit import files' + chr(10) if loaded else ''}"
            "from lessons.kit.lesson import Moment, no_progress\n\n"
            + "".join(f"files.put({f.name!r}, open({f.name!r}, \"rb\").read())  # the loaded file, beside this script\n"
                      for f in loaded) +
            f"p = LESSON.Params(\n{given})\n"
            "result = LESSON.compute(p, no_progress)\n"
            f"view = LESSON.view(p, result, Moment(step={scenario.moment.step}, stage={scenario.moment.stage}))\n"
            "for readout in view.readouts:\n"
            "    print(readout.name, readout.value, readout.unit)\n")


def script_html(entry: Entry, scenario: Scenario) -> str:
    """The script with its copy button."""
    return ('<div class="pk"><h1>These numbers in Python</h1>'
            '<button class="pk-copy" onclick="window.paikka.copy(this)">Copy</button>'
            f'<pre class="pk-code">{_colored(script(entry, scenario))}</pre></div>')


@cache
def functions_html(entry: Entry) -> str:
    """The sources, folded."""
    parts = [f"<details><summary><code>{html.escape(name)}</code></summary>"
             f'<pre class="pk-code">{_colored(source)}</pre></details>' for name, source in core_functions(entry)]
    return f'<div class="pk"><h1>What it calls in core</h1>{"".join(parts)}</div>' if parts else ""


def _colored(source: str) -> str:
    return highlight(source, _LEXER, _FORMATTER)


def _modules(entry: Entry) -> Iterator[ModuleType]:
    """The lesson's module and the private siblings that it imports, and those that these import."""
    package = entry.module.__name__.rpartition(".")[0]
    waiting, seen = [entry.module], {entry.module.__name__}
    while waiting:
        module = waiting.pop(0)
        yield module
        for node in ast.walk(_tree(module)):
            if not isinstance(node, ast.ImportFrom) or not node.module:
                continue
            names = [node.module] if node.module.startswith(f"{package}._") else [
                f"{package}.{alias.name}" for alias in node.names if node.module == package and alias.name[0] == "_"]
            for name in names:
                if name not in seen:
                    seen.add(name)
                    waiting.append(importlib.import_module(name))


def _used(module: ModuleType) -> Iterator[Any]:
    """What is imported from core modules, and attributes of imported core modules."""
    aliases: dict[str, ModuleType] = {}
    tree = _tree(module)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "core":
            source = importlib.import_module(node.module)
            for name in node.names:
                thing = getattr(source, name.name, None)
                if thing is None or inspect.ismodule(thing):
                    aliases[name.asname or name.name] = importlib.import_module(f"{node.module}.{name.name}")
                else:
                    yield thing
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in aliases:
            thing = getattr(aliases[node.value.id], node.attr, None)
            if thing is not None:
                yield thing


@cache
def _tree(module: ModuleType) -> ast.Module:
    return ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
