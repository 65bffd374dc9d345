"""Which lessons there are: our own in teaching order, those of installed packages, those of a folder."""

import importlib
import importlib.metadata
import importlib.util
import logging
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from lessons.kit import words
from lessons.kit.lesson import Lesson
from lessons.kit.params import Parameter, parameters
from lessons.kit.words import Words

log = logging.getLogger(__name__)

CHAPTERS: dict[str, tuple[str, ...]] = {
    "background": (
        "matrix_root", "least_squares", "normal_distribution", "independence", "sample_mean", "chi_square",
        "conditioning", "rotation_vector", "rotation_order", "geodetic", "rotating_frames", "attitude_rate",
    ),
    "static": (
        "measurement_surfaces", "closed_form", "gauss_newton", "dilution_of_precision", "garbage_measurements",
        "likelihood", "bayes", "confidence", "fingerprint", "gnss_fix",
    ),
    "filtering": (
        "constant_velocity", "kalman", "innovation", "extended", "unscented", "nonlinear_compared",
        "bayes_filter", "monte_carlo", "degeneracy", "resampling", "particle_vs_ekf", "mixture", "multiple_models",
        "filter_lab",
    ),
    "bayes_kalman": ("bayes_theorem", "map_and_mmse", "gain", "random_walk"),
    "indoor": ("floor_graph", "link_choice", "signal_strength", "graph_filter", "convergence"),
}

CHAPTER_NAMES: dict[str, dict[str, str]] = {
    "en": {
        "background": "Background", "static": "Static positioning", "filtering": "Filtering",
        "bayes_kalman": "Bayes and Kalman", "indoor": "Indoor positioning",
    },
}


@dataclass(frozen=True)
class Entry:
    """One lesson with its id; its module is imported when it is first needed."""

    id: str
    module_name: str = ""
    path: Path | None = None
    given: Mapping[str, str] = field(default_factory=dict, compare=False)  # kind of file -> key in kit.files

    @property
    def chapter(self) -> str:
        return self.id.rpartition(".")[0]

    @cached_property
    def module(self) -> ModuleType:
        if self.path is None:
            return importlib.import_module(self.module_name)
        name = f"paikka_lessons_{self.id.replace('.', '_')}"
        spec = importlib.util.spec_from_file_location(name, self.path)
        if spec is None or spec.loader is None:
            raise ValueError(f"{self.path}: expected a Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        return module

    @cached_property
    def lesson(self) -> Lesson:
        found = getattr(self.module, "LESSON", None)
        if not isinstance(found, Lesson):
            raise ValueError(f"{self.id}: expected a module with LESSON = Lesson(...), got {type(found).__name__}")
        return found

    @cached_property
    def start(self) -> Any:
        """The parameters with which the lesson opens: its defaults, with the files that were given for all lessons."""
        return replace(self.lesson.Params(), **{name: self.given[p.file.name] for name, p in self.parameters.items()
                                                if p.file is not None and p.file.name in self.given})

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        return parameters(self.lesson.Params)

    def words(self, language: str = "en") -> Words:
        return words.load(str(self.module.__file__), language)


class Registry:
    """The lessons by id, in teaching order."""

    def __init__(self, folder: Path | None = None, given: Mapping[str, str] | None = None) -> None:
        """folder: more lessons, `chapter/name.py` or `name.py` (chapter: the folder's name).

        given: kind of file -> key of the file that lessons open with instead of their own data.  Raises
        ValueError when the folder does not exist or holds no lesson.
        """
        found = [Entry(f"{chapter}.{name}", f"lessons.{chapter}.{name}")
                 for chapter, names in CHAPTERS.items() for name in names]
        found += list(_installed())
        if folder is not None:
            found += list(_in_folder(folder))
        self._entries = {entry.id: replace(entry, given=given or {}) for entry in found}

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._entries.values())

    def __contains__(self, lesson_id: object) -> bool:
        return lesson_id in self._entries

    def __getitem__(self, lesson_id: str) -> Entry:
        """The lesson with this id; KeyError naming the closest ids."""
        if lesson_id not in self._entries:
            import difflib

            close = difflib.get_close_matches(lesson_id, self._entries, n=3, cutoff=0.3)
            raise KeyError(f"unknown lesson {lesson_id!r}; "
                           + ("did you mean " + " or ".join(close) + "?" if close else "see `paikka list`"))
        return self._entries[lesson_id]

    @property
    def first(self) -> Entry:
        return next(iter(self))

    def chapters(self) -> dict[str, list[Entry]]:
        """Chapters that have lessons, in teaching order."""
        found: dict[str, list[Entry]] = {}
        for entry in self:
            found.setdefault(entry.chapter, []).append(entry)
        return found


def _installed() -> Iterator[Entry]:
    for point in importlib.metadata.entry_points(group="paikka.lessons"):
        yield Entry(point.name, point.value)


def _in_folder(folder: Path) -> Iterator[Entry]:
    if not folder.is_dir():
        raise ValueError(f"expected a folder with lessons, got {folder}")
    paths = sorted(p for p in [*folder.glob("*.py"), *folder.glob("*/*.py")] if not p.name.startswith("_"))
    if not paths:
        raise ValueError(f"expected lessons (name.py or chapter/name.py) in {folder}, found none")
    for path in paths:
        chapter = path.parent.name if path.parent != folder else folder.resolve().name
        yield Entry(f"{chapter}.{path.stem}", path=path)
