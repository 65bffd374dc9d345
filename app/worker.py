"""One thread that works on the latest request only."""

import logging
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

log = logging.getLogger(__name__)


class LatestWins(Generic[T]):
    """Runs `work(item)` in a thread of its own; while one runs, at most one newer item waits, the latest."""

    def __init__(self, work: Callable[[T], None], name: str) -> None:
        self._work = work
        self._condition = threading.Condition()
        self._pending: T | None = None
        self._busy = False
        self._closed = False
        self._thread = threading.Thread(target=self._loop, name=name, daemon=True)
        self._thread.start()

    def submit(self, item: T) -> None:
        """Work on `item` next; an item that still waits is dropped."""
        with self._condition:
            if self._closed:
                return
            self._pending = item
            self._condition.notify_all()

    @property
    def pending(self) -> T | None:
        """The newer item that waits, if any."""
        return self._pending

    @property
    def idle(self) -> bool:
        return not self._busy and self._pending is None

    @property
    def closed(self) -> bool:
        return self._closed

    def wait_idle(self, timeout: float) -> bool:
        """True when nothing runs or waits; False after `timeout` seconds."""
        with self._condition:
            return self._condition.wait_for(lambda: self.idle, timeout)

    def close(self) -> None:
        """Take no more work; what runs may notice `closed`."""
        with self._condition:
            self._closed = True
            self._pending = None
            self._condition.notify_all()

    def _loop(self) -> None:
        while True:
            with self._condition:
                self._busy = False
                self._condition.notify_all()
                self._condition.wait_for(lambda: self._pending is not None or self._closed)
                if self._closed:
                    return
                item, self._pending = self._pending, None
                self._busy = True
            try:
                self._work(item)  # type: ignore[arg-type]
            except Exception:
                log.exception("%s: unexpected error", self._thread.name)
