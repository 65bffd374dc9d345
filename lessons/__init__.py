"""The lessons in teaching order, found by their ids: `chapter.module`, the path of the module."""

from lessons.registry import CHAPTERS, Entry, Registry

__all__ = ["CHAPTERS", "Entry", "Registry"]
