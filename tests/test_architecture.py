"""The house rules that can be read from the source: which way imports point, what core may load, what is written."""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("core", "lessons", "app", "tests")
# What a layer may import besides Python's own library and itself.
ALLOWED = {
    "core": {"numpy", "scipy"},
    "lessons": {"core", "numpy", "scipy", "plotly", "yaml", "pyrtklib"},    # the last: the optional reader of RINEX
}
BROWSER = {"viser", "websockets", "plotly", "PIL", "ziamath", "markdown_it", "rich"}
SKIPPED = {"build", "dist", "node_modules", "__pycache__"}
TEXT = {".py", ".md", ".toml", ".txt", ".json", ".js", ".css", ".yml", ".yaml", ".cfg", ".ini", ".sh", ".html", ""}


def modules(layer: str) -> list[Path]:
    return sorted((ROOT / layer).rglob("*.py"))


def imported(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Full names of the modules that are imported anywhere below `tree`, with their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: names are imported as they lie, not relative to a module"
            yield node.module or "", node.lineno


def at_module_level(tree: ast.Module) -> Iterator[ast.stmt]:
    """Statements that run when the module is imported; not those inside functions."""
    waiting: list[ast.stmt] = list(tree.body)
    while waiting:
        statement = waiting.pop()
        if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        yield statement
        for field in ("body", "orelse", "finalbody"):
            waiting += getattr(statement, field, [])
        waiting += [s for handler in getattr(statement, "handlers", []) for s in handler.body]


def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def files() -> Iterator[Path]:
    """Every text file of the repository; not what tools have made."""
    waiting = [ROOT]
    while waiting:
        for path in waiting.pop().iterdir():
            if path.name.startswith(".") and path.name not in (".ci", ".github", ".gitignore", ".gitlab-ci.yml"):
                continue
            if path.is_dir():
                if path.name not in SKIPPED and not path.name.endswith(".egg-info"):
                    waiting.append(path)
            elif path.suffix in TEXT:
                yield path


@pytest.mark.parametrize("layer", list(ALLOWED))
def test_imports_point_one_way(layer):
    """app -> lessons -> core: at no depth, not even inside a function, does a lower layer load a higher one."""
    wrong = []
    for path in modules(layer):
        for name, line in imported(parse(path)):
            top = name.partition(".")[0]
            if top != layer and top not in ALLOWED[layer] and top not in sys.stdlib_module_names:
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not wrong, "\n".join(wrong)


def test_nothing_but_tests_imports_tests():
    wrong = [f"{path.relative_to(ROOT)}:{line}" for layer in ("core", "lessons", "app") for path in modules(layer)
             for name, line in imported(parse(path)) if name.partition(".")[0] in ("tests", "pytest", "hypothesis")]
    assert not wrong, "\n".join(wrong)


def test_core_loads_only_numpy_when_it_is_imported():
    """scipy costs a tenth of a second and more for each of its parts: it is imported inside functions."""
    wrong = []
    for path in modules("core"):
        for statement in at_module_level(parse(path)):
            if isinstance(statement, (ast.Import, ast.ImportFrom)):
                for name, line in imported(statement):
                    top = name.partition(".")[0]
                    if top not in ("core", "numpy") and top not in sys.stdlib_module_names:
                        wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not wrong, "\n".join(wrong)


def test_lessons_load_plots_only_when_they_draw_them():
    """plotly takes longer to import than a lesson to compute; annotations may name it under TYPE_CHECKING."""
    wrong = []
    for path in modules("lessons"):
        for statement in parse(path).body:
            if isinstance(statement, (ast.Import, ast.ImportFrom)):
                wrong += [f"{path.relative_to(ROOT)}:{line} imports {name}" for name, line in imported(statement)
                          if name.partition(".")[0] in BROWSER]
    assert not wrong, "\n".join(wrong)


def test_viser_s_private_parts_are_used_in_one_module():
    wrong = []
    for path in modules("app"):
        if path.relative_to(ROOT).as_posix() == "app/web/adapter.py":
            continue
        wrong += [f"{path.relative_to(ROOT)}:{line} imports {name}" for name, line in imported(parse(path))
                  if re.match(r"viser\._|viser\.infra", name)]
        text = path.read_text(encoding="utf-8")
        wrong += [f"{path.relative_to(ROOT)} uses {found}" for found in re.findall(
            r"\b\w+\._(?:websock\w*|impl|incoming_handlers|gui_input_\w+|viser_server|connected_clients|handle_gui\w+)\b",
            text)]
    assert not wrong, "\n".join(wrong)


def test_everything_public_in_core_has_a_docstring():
    wrong = []
    for path in modules("core"):
        tree = parse(path)
        if not ast.get_docstring(tree) and tree.body:
            wrong.append(f"{path.relative_to(ROOT)} has no docstring")
        wrong += [f"{path.relative_to(ROOT)}:{node.lineno} {node.name} has no docstring" for node in tree.body
                  if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_")
                  and not ast.get_docstring(node)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("layer", ["lessons", "app"])
def test_every_module_says_what_it_is_for(layer):
    wrong = [str(path.relative_to(ROOT)) for path in modules(layer)
             if (tree := parse(path)).body and not ast.get_docstring(tree)]
    assert not wrong, "\n".join(wrong)


def test_no_file_names_a_home_or_the_place_where_this_copy_lies():
    places = ["/" + "home/", "/" + "Users/", "/" + "root/", ":\\" + "Users\\"]
    if len(ROOT.parts) > 2:
        places.append(ROOT.as_posix() + "/")
    wrong = []
    for path in files():
        text = path.read_text(encoding="utf-8", errors="replace")
        wrong += [f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, text.index(place)) + 1} names {place}"
                  for place in places if place in text]
    assert not wrong, "\n".join(wrong)


def test_the_walk_finds_the_repository():
    """The tests above say nothing about files that they do not see."""
    names = {path.relative_to(ROOT).as_posix() for path in files()}
    assert {"pyproject.toml", "Makefile", "core/kalman.py", "app/web/page.js", "tests/test_architecture.py"} <= names
    assert not any(name.startswith((".venv", ".git/", "build/")) for name in names)
    assert all(len(modules(layer)) > 5 for layer in LAYERS)


def test_dependencies_are_declared():
    """What the packages import is what pyproject.toml installs."""
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {re.split(r"[<>=\[ ]", text)[0].lower() for text in project["dependencies"]}
    for extra in ("export", "gnss"):
        declared |= {re.split(r"[<>=\[ ]", text)[0].lower() for text in project["optional-dependencies"][extra]}
    distribution = {"yaml": "pyyaml", "PIL": "pillow", "markdown_it": "markdown-it-py", "ziafont": "ziamath",
                    "websockets": "viser", "rich": "viser"}      # the last three come with those
    wrong = []
    for layer in ("core", "lessons", "app"):
        for path in modules(layer):
            for name, line in imported(parse(path)):
                top = name.partition(".")[0]
                if top in sys.stdlib_module_names or top in LAYERS:
                    continue
                if distribution.get(top, top).lower() not in declared:
                    wrong.append(f"{path.relative_to(ROOT)}:{line} imports {top}")
    assert not wrong, "\n".join(wrong)
