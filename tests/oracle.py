"""The numeric answers of the source documents, as data of our own tests."""

import json
from functools import cache
from pathlib import Path
from typing import Any


@cache
def entries() -> dict[str, dict[str, Any]]:
    path = Path(__file__).parent / "data" / "oracle.json"
    return {e["id"]: e for e in json.loads(path.read_text(encoding="utf-8"))}


def entry(identifier: str) -> dict[str, Any]:
    """The entry with this id: `inputs`, `expected` and `tolerance` (a sentence)."""
    return entries()[identifier]
