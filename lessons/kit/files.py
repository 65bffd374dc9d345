"""Files that users give, by the hash of their bytes: the same scenario means the same bytes for everybody.

The store belongs to the running program and forgets the oldest files when it is full; a lesson that is asked for
bytes that are not here says so.
"""

import hashlib
import threading
from collections import OrderedDict
from typing import NamedTuple

MAX_FILE_BYTES = 16 * 2**20
MAX_TOTAL_BYTES = 256 * 2**20


class GivenFile(NamedTuple):
    """The bytes, and the name under which they came."""

    name: str
    content: bytes


_files: OrderedDict[str, GivenFile] = OrderedDict()
_lock = threading.Lock()


def put(name: str, content: bytes) -> str:
    """Keep the bytes and return their key, 16 hexadecimal digits.  ValueError for an empty or too large file."""
    if not content:
        raise ValueError(f"{name}: the file is empty")
    if len(content) > MAX_FILE_BYTES:
        raise ValueError(f"{name}: expected at most {MAX_FILE_BYTES // 2**20} MiB, got {len(content) / 2**20:.1f} MiB")
    key = hashlib.sha256(content).hexdigest()[:16]
    with _lock:
        _files[key] = GivenFile(name, content)
        _files.move_to_end(key)
        while sum(len(f.content) for f in _files.values()) > MAX_TOTAL_BYTES:
            _files.popitem(last=False)
    return key


def has(key: str) -> bool:
    """Whether the file of this key is here."""
    with _lock:
        return key in _files


def get(key: str) -> GivenFile:
    """The file of this key.  LookupError when it is not here (any more)."""
    with _lock:
        if key not in _files:
            raise LookupError(f"the file {key} is not on this server (any more): give it again")
        _files.move_to_end(key)
        return _files[key]
