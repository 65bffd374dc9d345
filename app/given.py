"""Files named on the command line: which lessons take them is told by their content."""

import logging
from pathlib import Path

from app.uploads import accepted
from lessons.kit import files
from lessons.kit.params import Parameter
from lessons.registry import Registry

log = logging.getLogger(__name__)


def read(path: Path, registry: Registry) -> tuple[str, str]:
    """The kind of the file, and its key in `lessons.kit.files`.  ValueError naming the file and what was expected."""
    try:
        with path.open("rb") as file:
            content = file.read(files.MAX_FILE_BYTES + 1)
    except OSError as error:
        raise ValueError(f"{path}: expected a file that can be read: {error.strerror or error}") from None
    kinds = file_parameters(registry)
    for kind, parameter in kinds.items():
        assert parameter.file is not None
        if content and len(content) <= files.MAX_FILE_BYTES and not parameter.file.recognise(content):
            continue
        return kind, accepted(parameter, str(path), content)
    raise ValueError(f"{path}: expected {' or '.join(kinds) or 'nothing, as no lesson takes a file'}")


def file_parameters(registry: Registry) -> dict[str, Parameter]:
    """One parameter for each kind of file that the lessons take, by the kind's name."""
    found: dict[str, Parameter] = {}
    for entry in registry:
        try:
            found |= {p.file.name: p for p in entry.parameters.values() if p.file is not None}
        except Exception:  # one broken lesson does not keep the others from their files
            log.exception("lesson %s cannot be opened", entry.id)
    return found
