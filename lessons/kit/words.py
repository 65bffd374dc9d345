"""A lesson's words: Markdown beside its module, with a front matter for the labels of what the code names.

    ---
    title: The unscented transform
    summary: One line for the list of lessons.
    params:   {kappa: {label: "κ", hint: "Spread of the sigma points."}}
    options:  {map: {polar: "range, bearing → x, y"}}
    groups:   {filter: "The filter assumes"}
    presets:  {"kappa = 3 - n": "What this preset shows."}
    stages:   {predict: Predict}
    readouts: {mean_error: Error of the mean}
    equations: {gain: Gain}
    figures:  {error: {title: Error, x: "time t (s)", y: "error (m)", traces: {ekf: EKF}}}
    legend:   {prior: "prior, 68 % ellipse"}
    ---
    # Idea ... # What to try ... # Questions ...

`legend` names scene items, in the order of the legend; items that are not named there have no entry.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from lessons.kit.roles import ROLE_NAMES

SECTIONS = ("Idea", "What to try", "Questions")


@dataclass(frozen=True, slots=True)
class Words:
    """The front matter by section, and the Markdown body by its first-level headings."""

    front: Mapping[str, Any] = field(default_factory=dict)
    body: Mapping[str, str] = field(default_factory=dict)
    language: str = "en"

    @property
    def title(self) -> str:
        return str(self.front.get("title", ""))

    @property
    def summary(self) -> str:
        return str(self.front.get("summary", ""))

    def label(self, section: str, key: str) -> str:
        """The text of `key` in a section of the front matter; the key itself where the words are silent."""
        found = self._section(section).get(key)
        if isinstance(found, Mapping):
            found = found.get("label", found.get("title"))
        return key.replace("_", " ") if found is None else str(found)

    def hint(self, key: str) -> str | None:
        """What a parameter does, for its tooltip."""
        found = self._section("params").get(key)
        return str(found["hint"]) if isinstance(found, Mapping) and "hint" in found else None

    def option(self, parameter: str, option: str) -> str:
        return str(self._section("options").get(parameter, {}).get(option, option))

    def has(self, section: str, key: str) -> bool:
        return key in self._section(section)

    def axis(self, figure: str, axis: str) -> str:
        found = self._section("figures").get(figure, {})
        return str(found.get(axis, "")) if isinstance(found, Mapping) else ""

    def trace(self, figure: str, key: str, role: str) -> str:
        """The name of a trace: from the figure's words, else the role's name."""
        found = self._section("figures").get(figure, {})
        traces = found.get("traces", {}) if isinstance(found, Mapping) else {}
        return str(traces.get(key, ROLE_NAMES.get(self.language, ROLE_NAMES["en"]).get(role, key)))

    @property
    def legend(self) -> dict[str, str]:
        return {str(k): str(v) for k, v in self._section("legend").items()}

    def _section(self, name: str) -> Mapping[str, Any]:
        found = self.front.get(name)
        return found if isinstance(found, Mapping) else {}


def parse(text: str, language: str = "en", source: str = "words") -> Words:
    """Words from the text of a Markdown file; ValueError naming `source` when its front matter cannot be read."""
    if not text.startswith("---\n"):
        raise ValueError(f"{source}: expected a front matter that begins with '---' on the first line")
    head, found, tail = text[4:].partition("\n---\n")
    if not found:
        raise ValueError(f"{source}: expected a line '---' that ends the front matter")
    try:
        front = yaml.safe_load(head)
    except yaml.YAMLError as error:
        raise ValueError(f"{source}: the front matter is not YAML: {error}") from None
    if not isinstance(front, dict):
        raise ValueError(f"{source}: expected a mapping in the front matter, got {type(front).__name__}")
    body: dict[str, str] = {}
    heading, fenced = "", False
    for row in tail.splitlines(keepends=True):
        fenced ^= row.startswith("```")
        if row.startswith("# ") and not fenced:
            heading = row[2:].strip()
            body[heading] = ""
        else:
            body[heading] = body.get(heading, "") + row
    return Words(front, {k: v.strip() for k, v in body.items() if v.strip()}, language)


@cache
def load(module_file: str, language: str = "en") -> Words:
    """The words beside a lesson's module file; English where `language` has none; empty where there are none."""
    module = Path(module_file)
    for code in dict.fromkeys((language, "en")):
        path = module.with_name(f"{module.stem}.{code}.md")
        if path.is_file():
            return parse(path.read_text(encoding="utf-8"), code, path.name)
    return Words()
