"""Time of a call: the best of a few, for the machine's other work only ever adds."""

from __future__ import annotations

import time
from collections.abc import Callable


def best_of(call: Callable[[], object], repeats: int = 7) -> float:
    """Seconds of the fastest of ``repeats`` calls, after one that does not count."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)
