"""A study whose flights are cheap."""

from __future__ import annotations

import os
import time
from pathlib import Path

#: Each flight adds a line with its seed and process here.
LOG = "SEEDS_TEST_LOG"


def trial(seed: int, *, steps: int, seconds: float) -> dict[tuple[str, str], float]:
    """A random walk; numbers whose last digit depends on the order in which they are added up."""
    import numpy as np

    with Path(os.environ[LOG]).open("a") as log:
        log.write(f"{seed} {os.getpid()}\n")
    time.sleep(seconds)
    walked = np.cumsum(np.random.default_rng(seed).standard_normal((steps, 40)), axis=0)
    return {
        ("walk", "end"): float(walked[-1] @ walked[-1]),
        ("walk", "spread"): float(np.linalg.svd(walked.T @ walked, compute_uv=False).sum()),
        ("walk", "none"): float("nan"),
        ("walk", "beyond"): float("-inf"),
    }
