"""Speed, as ratios against references measured in the same run.

`make bench` checks the targets and prints one table; an ordinary test run leaves them out, as they need idle cores.
"""

import gc
import time
from collections.abc import Callable

from tests.bench.report import record


def medians(rounds: int, *, batch: int = 1, **calls: Callable[[], object]) -> dict[str, float]:
    """Median time of each call in milliseconds.

    In every round each call runs `batch` times after a pause and two runs that are not counted: the threads of BLAS
    spin for some 30 ms after their last product, on a core that the next call would need, and a pause cools memory.
    """
    times: dict[str, list[float]] = {name: [] for name in calls}
    gc.disable()
    try:
        for _ in range(rounds):
            for name, call in calls.items():
                time.sleep(0.1)
                call()
                call()
                for _ in range(batch):
                    start = time.perf_counter()
                    result = call()
                    times[name].append(1e3 * (time.perf_counter() - start))
                    del result
    finally:
        gc.enable()
    return {name: sorted(t)[len(t) // 2] for name, t in times.items()}


def at_most(name: str, ours_ms: float, reference_ms: float, target: float) -> None:
    """Records ours / reference, and requires it to be at most target."""
    record(name, ours_ms, reference_ms, ours_ms / reference_ms, f"<= {target:g}", ours_ms / reference_ms <= target)


def faster(name: str, ours_ms: float, reference_ms: float, target: float) -> None:
    """Records reference / ours, and requires it to be at least target."""
    record(name, ours_ms, reference_ms, reference_ms / ours_ms, f">= {target:g}", reference_ms / ours_ms >= target)
