"""{0..N-1} = B_0 + B_1 + ...: large clouds are worked on in blocks, by as many threads as there are free cores.

A block is the unit of randomness and of floating-point sums, so a result depends on the seed and never on the number
of threads.  65,536 particles are enough for numpy to work without Python's lock for most of the time, and few enough
for the vectors of a block to stay in the cache.
"""

import os
import sys
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

BLOCK = 65_536
LONG = 4 * BLOCK         # for cheap exact work, where the threads would otherwise mostly wait for each other
T = TypeVar("T")
S = TypeVar("S")


def spans(N: int, size: int = BLOCK) -> list[slice]:
    """[0, N) as consecutive slices of at most `size` elements (a multiple of 64), as few and as equal as possible.

    >>> spans(70_000)
    [slice(0, 35008, None), slice(35008, 70000, None)]
    """
    count = -(-N // size)
    length = -(-N // (64 * max(count, 1))) * 64           # whole cache lines
    return [slice(start, min(start + length, N)) for start in range(0, N, max(length, 1))]


def for_each(work: Callable[[T], S], items: Sequence[T], threads: int | None = None) -> list[S]:
    """[work(item) for item in items], in order, on `threads` threads (None: one for each core of this process).

    The caller is one of the threads; one item or one thread needs no other.  An exception of `work` ends the rest and
    is passed on.  ValueError for threads < 1.

    >>> for_each(abs, [-1, 2, -3])
    [1, 2, 3]
    """
    if threads is not None and threads < 1:
        raise ValueError(f"threads: expected a positive number or None, got {threads}")
    _keep_freed_memory()
    count = min(threads or _cores(), len(items))
    if count <= 1:
        return [work(item) for item in items]
    results: list = [None] * len(items)
    waiting = iter(range(len(items)))                     # shared: next() is atomic

    def share() -> None:
        try:
            for i in waiting:
                results[i] = work(items[i])
        except BaseException:
            for _ in waiting:                             # nobody need start another one
                pass
            raise

    helpers = [_pool(count - 1).submit(share) for _ in range(count - 1)]
    try:
        share()
    finally:
        for helper in helpers:                            # one that has not begun has nothing left to do
            helper.cancel() or helper.exception()
    for helper in helpers:
        if not helper.cancelled():
            helper.result()
    return results


@cache
def _keep_freed_memory() -> None:
    """Asks glibc to keep up to 256 MB of freed memory, and to serve arrays below 32 MB from it.

    By default it returns the temporaries of every step to the kernel and faults them in again at the next one: half of
    the time of a step of 10,000 to 100,000 particles.  `malloc_trim(0)` still returns the memory at any time.
    """
    if sys.platform == "linux":
        import ctypes

        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)   # musl has none
        if mallopt:
            mallopt(-3, 32 << 20)                                # M_MMAP_THRESHOLD
            mallopt(-1, 256 << 20)                               # M_TRIM_THRESHOLD


@cache
def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool(threads: int) -> "ThreadPoolExecutor":
    from concurrent.futures import ThreadPoolExecutor  # imports logging: not while core is imported

    return ThreadPoolExecutor(threads, thread_name_prefix="paikka-block")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)   # a forked child inherits the pool but not its threads
