"""A study whose flights fail in every way."""

from __future__ import annotations

import os
import signal

from wildlab.errors import WildlabError
from wildlab.studies import walk


def trial(seed: int, *, steps: int, seconds: float) -> dict[tuple[str, str], float]:
    """Seed 2 raises, seed 3 ends its process, seed 5 takes for ever."""
    if seed == 2:
        raise WildlabError(f"the flight of seed {seed} has no solution", "look at it")
    if seed == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return walk.trial(seed, steps=steps, seconds=600.0 if seed == 5 else seconds)
