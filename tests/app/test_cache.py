"""The shared cache: one computation for many who ask, nobody left waiting, errors forgotten, memory bounded."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
import pytest

from app.cache import ResultCache, size_of
from lessons.kit.lesson import Cancelled, Progress, no_progress

SECONDS = 10.0


class Work:
    """A computation that the test lets begin, report and end."""

    def __init__(self, result: object = "result") -> None:
        self.calls = 0
        self.begun, self.finish = threading.Event(), threading.Event()
        self._result = result

    def __call__(self, progress: Progress) -> object:
        self.calls += 1
        self.begun.set()
        while not self.finish.wait(0.002):
            progress(0.5)
        if isinstance(self._result, BaseException):
            raise self._result
        return self._result


class Caller:
    """A progress callable that can be cancelled, and that tells when it was first called."""

    def __init__(self) -> None:
        self.waits, self.cancelled = threading.Event(), threading.Event()
        self.fraction = -1.0

    def __call__(self, fraction: float) -> None:
        self.fraction = fraction
        self.waits.set()
        if self.cancelled.is_set():
            raise Cancelled


@pytest.fixture
def start() -> Iterator[Callable[..., Future]]:
    """start(function, *arguments) runs it in a thread."""
    with ThreadPoolExecutor(20) as pool:
        yield pool.submit


def test_a_result_is_computed_once():
    cache, calls = ResultCache(), []

    def compute(progress: Progress) -> list[int]:
        calls.append(1)
        return [len(calls)]

    first = cache.get("a", compute, no_progress)
    assert cache.get("a", compute, no_progress) is first and len(calls) == 1
    assert cache.get("b", compute, no_progress) == [2]


def test_none_is_a_result_too():
    cache, calls = ResultCache(), []
    for _ in range(3):
        assert cache.get("a", lambda progress: calls.append(1), no_progress) is None
    assert len(calls) == 1


def test_single_flight(start):
    cache, work = ResultCache(), Work(object())
    callers = [Caller() for _ in range(12)]
    found = [start(cache.get, "a", work, caller) for caller in callers]
    assert work.begun.wait(SECONDS)
    for caller in callers:
        assert caller.waits.wait(SECONDS)        # those who wait are asked too, and see how far it is
    assert all(caller.fraction in (0.0, 0.5) for caller in callers)
    work.finish.set()
    results = {id(future.result(SECONDS)) for future in found}
    assert len(results) == 1 and work.calls == 1


def test_other_keys_do_not_wait(start):
    cache, work = ResultCache(), Work()
    slow = start(cache.get, "slow", work, no_progress)
    assert work.begun.wait(SECONDS)
    assert start(cache.get, "quick", lambda progress: 1, no_progress).result(SECONDS) == 1
    assert not slow.done()
    work.finish.set()
    assert slow.result(SECONDS) == "result"


def test_who_waits_can_leave(start):
    cache, work, leader, other = ResultCache(), Work(), Caller(), Caller()
    leading = start(cache.get, "a", work, leader)
    assert work.begun.wait(SECONDS)
    waiting = start(cache.get, "a", work, other)
    assert other.waits.wait(SECONDS)
    other.cancelled.set()
    assert isinstance(waiting.exception(SECONDS), Cancelled)
    work.finish.set()
    assert leading.result(SECONDS) == "result" and work.calls == 1


def test_another_takes_over_when_the_one_who_computes_is_cancelled(start):
    cache, work, leader = ResultCache(), Work(), Caller()
    leading = start(cache.get, "a", work, leader)
    assert work.begun.wait(SECONDS)
    others = [Caller() for _ in range(4)]
    waiting = [start(cache.get, "a", work, caller) for caller in others]
    assert all(caller.waits.wait(SECONDS) for caller in others)
    work.begun.clear()
    leader.cancelled.set()
    assert isinstance(leading.exception(SECONDS), Cancelled)
    assert work.begun.wait(SECONDS)
    work.finish.set()
    assert [future.result(SECONDS) for future in waiting] == ["result"] * 4
    assert work.calls == 2


def test_a_cancelled_result_is_not_kept():
    cache = ResultCache()

    def stop(fraction: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        cache.get("a", lambda progress: progress(0.1), stop)
    assert cache.get("a", lambda progress: 5, no_progress) == 5


def test_an_error_reaches_everyone_and_is_not_kept(start):
    cache, work = ResultCache(), Work(ValueError("no such matrix"))
    callers = [Caller() for _ in range(5)]
    found = [start(cache.get, "a", work, caller) for caller in callers]
    assert all(caller.waits.wait(SECONDS) for caller in callers)
    work.finish.set()
    for future in found:
        error = future.exception(SECONDS)
        assert isinstance(error, ValueError) and str(error) == "no such matrix"
    assert work.calls == 1
    assert cache.get("a", lambda progress: 5, no_progress) == 5


def test_even_an_interrupt_frees_the_key():
    cache = ResultCache()

    def interrupted(progress: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cache.get("a", interrupted, no_progress)
    assert cache.get("a", lambda progress: 5, no_progress) == 5


def test_memory_is_bounded_and_the_least_recently_used_goes_first():
    cache, calls = ResultCache(max_bytes=10_000), []

    def get(key: str, count: int = 400) -> None:
        def compute(progress: Progress) -> np.ndarray:
            calls.append(key)
            return np.zeros(count)

        cache.get(key, compute, no_progress)

    for key in "abc":                            # 3300 bytes each
        get(key)
    get("a")
    assert calls == ["a", "b", "c"]
    get("d")                                     # b was used least recently
    assert sum(size_of(np.zeros(400)) for _ in "acd") <= 10_000
    calls.clear()
    get("a"), get("c"), get("d")
    assert calls == []
    get("b")
    assert calls == ["b"]


def test_a_result_larger_than_the_bound_is_the_only_one_kept():
    cache, calls = ResultCache(max_bytes=1000), []
    for key, size in (("small", 10), ("large", 1000), ("large", 1000), ("small", 10), ("large", 1000)):
        cache.get(key, lambda progress, key=key, size=size: calls.append(key) or np.zeros(size), no_progress)
    assert calls == ["small", "large", "small", "large"]


class Pair(NamedTuple):
    a: np.ndarray
    b: object


@dataclass(frozen=True, slots=True)
class Slotted:
    a: np.ndarray


@dataclass(frozen=True, slots=True)
class Longer(Slotted):
    b: np.ndarray


@dataclass
class Plain:
    a: np.ndarray


@pytest.mark.parametrize("value", [
    np.zeros(1000), Pair(np.zeros(1000), None), Slotted(np.zeros(1000)), Plain(np.zeros(1000)),
    [np.zeros(500), np.ones(500)], {"x": (np.zeros(1000),)},
    Pair(np.zeros(500), Slotted(np.zeros(500))), Longer(np.zeros(900), np.zeros(100)),
], ids=lambda value: type(value).__name__)
def test_size_counts_the_arrays_inside(value):
    assert 8000 <= size_of(value) < 8600


class Choice(Enum):
    ONE = 1


def test_size_of_what_refers_to_itself():
    ring = [np.zeros(1000), Choice.ONE, Slotted]
    ring.append(ring)
    assert 8000 <= size_of(ring) < 9000
    assert size_of([ring[0]] * 50) < 9000        # one array in memory
    assert ResultCache().get("a", lambda progress: ring, no_progress) is ring


def test_many_threads_many_keys(start):
    cache, lock = ResultCache(max_bytes=2000), threading.Lock()
    running: dict[int, int] = {}

    def compute(key: int, progress: Progress) -> int:
        with lock:
            running[key] = running.get(key, 0) + 1
            assert running[key] == 1
        progress(0.5)
        with lock:
            running[key] -= 1
        return key * key

    def ask(seed: int) -> bool:
        keys = np.random.default_rng(seed).integers(0, 25, 300).tolist()
        return all(cache.get(k, lambda p, k=k: compute(k, p), no_progress) == k * k for k in keys)

    assert all(future.result(SECONDS) for future in [start(ask, seed) for seed in range(8)])
