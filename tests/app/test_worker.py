"""One thread that works on the latest item only."""

import logging
import threading
from collections.abc import Iterator

import pytest

from app.worker import LatestWins

SECONDS = 10.0


class Bench:
    """Work that waits for the test: `begun` is set when an item is taken, `go` lets it end."""

    def __init__(self) -> None:
        self.done: list[object] = []
        self.begun, self.go = threading.Event(), threading.Event()

    def __call__(self, item: object) -> None:
        self.begun.set()
        assert self.go.wait(SECONDS)
        if isinstance(item, Exception):
            raise item
        self.done.append(item)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def worker(bench: Bench) -> Iterator[LatestWins]:
    made = LatestWins(bench, "test worker")
    yield made
    bench.go.set()
    made.close()
    made._thread.join(SECONDS)
    assert not made._thread.is_alive()


def test_items_are_worked_on_one_by_one(worker, bench):
    bench.go.set()
    assert worker.idle and worker.pending is None
    for item in range(3):
        worker.submit(item)
        assert worker.wait_idle(SECONDS)
    assert bench.done == [0, 1, 2]


def test_the_latest_wins(worker, bench):
    worker.submit("first")
    assert bench.begun.wait(SECONDS)
    for item in range(50):
        worker.submit(item)
        assert worker.pending == item and not worker.idle
    bench.go.set()
    assert worker.wait_idle(SECONDS)
    assert bench.done == ["first", 49]
    assert worker.idle and worker.pending is None


def test_waiting_gives_up_in_time(worker, bench):
    worker.submit("first")
    assert bench.begun.wait(SECONDS)
    assert not worker.wait_idle(0.01)


def test_an_item_is_never_lost_between_threads(worker, bench):
    bench.go.set()
    threads = [threading.Thread(target=lambda k=k: [worker.submit((k, i)) for i in range(200)]) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    worker.submit("last")
    assert worker.wait_idle(SECONDS)
    assert bench.done[-1] == "last"


def test_work_may_submit_more(bench):
    order: list[int] = []

    def work(item: int) -> None:
        order.append(item)
        if item < 3:
            worker.submit(item + 1)

    worker = LatestWins(work, "chain")
    worker.submit(0)
    assert worker.wait_idle(SECONDS)
    assert order == [0, 1, 2, 3]
    worker.close()


def test_an_error_is_logged_and_the_next_item_is_worked_on(worker, bench, caplog):
    bench.go.set()
    with caplog.at_level(logging.ERROR):
        worker.submit(RuntimeError("a loose screw"))
        assert worker.wait_idle(SECONDS)
    assert "a loose screw" in caplog.text and "test worker" in caplog.text
    worker.submit("next")
    assert worker.wait_idle(SECONDS)
    assert bench.done == ["next"]


def test_close_drops_what_waits_and_ends_the_thread(worker, bench):
    worker.submit("first")
    assert bench.begun.wait(SECONDS)
    worker.submit("second")
    worker.close()
    assert worker.closed and worker.pending is None
    bench.go.set()
    worker._thread.join(SECONDS)
    assert not worker._thread.is_alive()
    assert bench.done == ["first"]


def test_close_of_an_idle_worker_ends_the_thread(worker):
    worker.close()
    worker._thread.join(SECONDS)
    assert not worker._thread.is_alive()


def test_a_closed_worker_takes_nothing(worker, bench):
    bench.go.set()
    worker.close()
    worker.submit("late")
    assert worker.pending is None
    assert worker.wait_idle(SECONDS)
    assert bench.done == []
