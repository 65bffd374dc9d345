"""Results that all sessions share: a scenario that two students open is computed once."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lessons.kit.lesson import Cancelled, Progress


@dataclass(eq=False)
class _Flight:
    done: threading.Event = field(default_factory=threading.Event)
    fraction: float = 0.0
    result: Any = None
    error: BaseException | None = None


class ResultCache:
    """Least recently used results up to `max_bytes` of arrays; concurrent requests for one key compute it once."""

    def __init__(self, max_bytes: int = 512_000_000) -> None:
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._results: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._flights: dict[Hashable, _Flight] = {}

    def get(self, key: Hashable, compute: Callable[[Progress], Any], progress: Progress) -> Any:
        """The result for `key`, computed at most once at a time.

        `progress` is this caller's own: it may raise Cancelled.  When the caller that computes is cancelled, one of
        those who wait takes over.  Errors of `compute` reach everyone who waits and are not kept.
        """
        while True:
            with self._lock:
                if key in self._results:
                    self._results.move_to_end(key)
                    return self._results[key][0]
                flight = self._flights.get(key)
                leader = flight is None
                if flight is None:
                    flight = self._flights[key] = _Flight()
            if leader:
                return self._lead(key, flight, compute, progress)
            while not flight.done.wait(0.03):
                progress(flight.fraction)
            if flight.error is None:
                return flight.result
            if not isinstance(flight.error, Cancelled):
                raise flight.error

    def _lead(self, key: Hashable, flight: _Flight, compute: Callable[[Progress], Any], progress: Progress) -> Any:
        def report(fraction: float) -> None:
            flight.fraction = fraction
            progress(fraction)

        try:
            flight.result = compute(report)
        except BaseException as error:
            flight.error = error
            raise
        finally:
            with self._lock:
                del self._flights[key]
                if flight.error is None:
                    self._keep(key, flight.result)
            flight.done.set()
        return flight.result

    def _keep(self, key: Hashable, result: Any) -> None:
        self._results[key] = (result, size_of(result))
        total = sum(size for _, size in self._results.values())
        while total > self._max_bytes and len(self._results) > 1:
            _, (_, size) = self._results.popitem(last=False)
            total -= size


def size_of(value: Any) -> int:
    """Bytes of the arrays inside records, sequences and mappings, each once, plus a little for each object."""
    return _size(value, set())


def _size(value: Any, seen: set[int]) -> int:
    if id(value) in seen or isinstance(value, type):
        return 0
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        return value.nbytes + 100
    if isinstance(value, dict):
        return sum(_size(v, seen) for v in value.values()) + 100
    if isinstance(value, (tuple, list)):
        return sum(_size(v, seen) for v in value) + 100
    slots = {name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())}
    names = slots | set(getattr(value, "__dict__", ()))
    return 100 + sum(_size(getattr(value, n), seen) for n in names if hasattr(value, n))
