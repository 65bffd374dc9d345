"""What it costs to start: all of core against numpy alone, in fresh interpreters."""

import os
import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

import core
from tests.bench import at_most

pytestmark = pytest.mark.bench

ROOT = Path(core.__file__).parent.parent
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for path in (ROOT / "core").rglob("*.py"))
TIMED = "import time; start = time.perf_counter(); {}; print(1e3 * (time.perf_counter() - start))"
ROUNDS = 11


def test_import_of_core_against_numpy(tmp_path):
    """`import core` and each of its modules; bytecode is cached, as it is after a first start."""
    # An environment that forbids bytecode would time the compiler: it is written to a folder of this test instead.
    env = {**os.environ, "PYTHONPYCACHEPREFIX": str(tmp_path)}
    env.pop("PYTHONDONTWRITEBYTECODE", None)

    def milliseconds(statement):
        result = subprocess.run([sys.executable, "-c", TIMED.format(statement)], cwd=ROOT, env=env, check=True,
                                capture_output=True, text=True)
        return float(result.stdout)

    statements = ("import " + ", ".join(MODULES), "import numpy")
    assert "core.kalman" in MODULES and "core" in MODULES
    for statement in statements:
        milliseconds(statement)
    times = [[milliseconds(statement) for statement in statements] for _ in range(ROUNDS)]
    ours, reference = (median(column) for column in zip(*times, strict=True))
    at_most(f"import core and its {len(MODULES) - 1} modules / import numpy", ours, reference, 1.5)


def test_import_of_core_brings_no_scipy():
    """scipy is imported by the functions that need it, at their first call."""
    code = f"import {', '.join(MODULES)}, sys; print(*[m for m in sys.modules if m.split('.')[0] == 'scipy'])"
    found = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    assert found.split() == []
