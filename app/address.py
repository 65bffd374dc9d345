"""The page's address bar follows the scenario, no more often than browsers allow."""

import threading
import time
from collections.abc import Callable

SECONDS_BETWEEN = 0.3


class AddressBar:
    """Sends the newest query at most every 0.3 s; the last one is always sent."""

    def __init__(self, send: Callable[[str], None]) -> None:
        self._send = send
        self._lock = threading.Lock()
        self._wanted = ""
        self._sent = ""
        self._sent_at = 0.0
        self._timer: threading.Timer | None = None
        self._closed = False

    def show(self, query: str) -> None:
        """Make the address `query`, now or soon."""
        with self._lock:
            self._wanted = query
            if self._closed or self._timer is not None or query == self._sent:
                return
            wait = self._sent_at + SECONDS_BETWEEN - time.monotonic()
            if wait > 0:
                self._timer = threading.Timer(wait, self._late)
                self._timer.daemon = True
                self._timer.start()
                return
            self._now()

    def close(self) -> None:
        """Send nothing more."""
        with self._lock:
            self._closed = True
            if self._timer is not None:
                self._timer.cancel()

    def _late(self) -> None:
        with self._lock:
            self._timer = None
            if self._wanted != self._sent and not self._closed:
                self._now()

    def _now(self) -> None:
        self._sent, self._sent_at = self._wanted, time.monotonic()
        self._send(self._wanted)
