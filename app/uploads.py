"""A file parameter as controls: what is loaded, a button that loads another file, and one that goes back."""

import logging
from collections.abc import Callable, Mapping
from typing import Any

from lessons.kit import files
from lessons.kit.params import Parameter

log = logging.getLogger(__name__)


class FileControl:
    """Behaves like a widget with `value` (the file's key) and `visible`."""

    def __init__(self, gui: Any, parameter: Parameter, label: str, hint: str | None, value: str,
                 change: Callable[[Mapping[str, object]], None], notify: Callable[[str, str], None]) -> None:
        assert parameter.file is not None
        self._parameter, self._change, self._notify = parameter, change, notify
        self._root = gui.add_folder(None)     # viser's upload button cannot be hidden by itself
        with self._root:
            self._name = gui.add_text(label, "", disabled=True, hint=hint)
            load = gui.add_upload_button(f"Load {parameter.file.name} \u2026",
                                         mime_type=",".join(parameter.file.suffixes), hint=hint)
            self._back = gui.add_button("Back to the lesson's own data", color="gray")
        load.on_upload(self._loaded)
        self._back.on_click(self._go_back)
        self.value = value

    @property
    def value(self) -> str:
        return self._value

    @value.setter
    def value(self, key: str) -> None:
        self._value = key
        self._name.value = files.get(key).name if key else "the lesson's own"
        self._back.visible = bool(key)

    @property
    def visible(self) -> bool:
        return self._root.visible

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._root.visible = shown

    def remove(self) -> None:
        self._root.remove()

    def _loaded(self, event: Any) -> None:
        """Runs in a thread of viser's pool: a check may take a second."""
        given = event.target.value
        try:
            key = accepted(self._parameter, given.name, given.content)
        except ValueError as error:
            self._notify("This file cannot be used", str(error))
            return
        except Exception:
            log.exception("the check of a file failed")
            self._notify("This file cannot be used", f"{plain_name(given.name)}: expected {self._parameter.file.name}")
            return
        self._change({self._parameter.name: key})

    async def _go_back(self, event: Any) -> None:
        self._change({self._parameter.name: ""})


def accepted(parameter: Parameter, name: str, content: bytes) -> str:
    """The key of a file that has passed its check; ValueError that names the file otherwise."""
    kind, name = parameter.file, plain_name(name)
    assert kind is not None
    if 0 < len(content) <= files.MAX_FILE_BYTES:  # else `put` says it
        if not kind.recognise(content):
            raise ValueError(f"{name}: expected {kind.name} ({', '.join(kind.suffixes)})")
        try:
            kind.check(content)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return files.put(name, content)


def plain_name(name: str) -> str:
    """The last part of a path, short and printable."""
    last = name.replace("\\", "/").rpartition("/")[2]
    return "".join(c for c in last if c.isprintable())[:80] or "file"
