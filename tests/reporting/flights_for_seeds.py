"""A program that runs studies over seeds whose flights are cheap, as a user's terminal runs `wildlab run`.

What stands outside ``main`` is also done in each process that the run starts (they import their parent's main
module), and a dask worker gets it with ``--preload``: there, too, the functions are known.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from wildlab.pipeline.flown import FLOWN, Flown

#: Each flight adds a line with its seed and process here.
LOG = "SEEDS_TEST_LOG"

FLOWN["walk"] = Flown("flights_for_seeds:walk", ("steps", "seconds"))
FLOWN["trouble"] = Flown("flights_for_seeds:trouble", ("steps", "seconds"))


def walk(seed: int, *, steps: int, seconds: float) -> dict[tuple[str, str], float]:
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


def trouble(seed: int, *, steps: int, seconds: float) -> dict[tuple[str, str], float]:
    """Seed 2 raises, seed 3 ends its process, seed 5 takes for ever."""
    from wildlab.errors import WildlabError

    if seed == 2:
        raise WildlabError(f"the flight of seed {seed} has no solution", "look at it")
    if seed == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return walk(seed, steps=steps, seconds=600.0 if seed == 5 else seconds)


def main() -> None:
    from rich.console import Console

    from wildlab.errors import WildlabError
    from wildlab.reporting.run import run_studies

    # In the background of a script Ctrl-C is ignored from birth; in a terminal it is not.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path, help="with notebooks/; reports go beside them")
    parser.add_argument("study", nargs="+")
    parser.add_argument("--out", default="reports")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seeds", type=int)
    parser.add_argument("--timeout", type=float)
    parser.add_argument("--scheduler")
    given = parser.parse_args()
    try:
        run_studies(
            given.study,
            notebooks=given.folder / "notebooks",
            reports=given.folder / given.out,
            parallel=given.jobs,
            seeds=given.seeds,
            timeout_s=given.timeout,
            scheduler=given.scheduler,
            console=Console(file=sys.stdout, force_terminal=False),
        )
    except WildlabError as error:
        print(error)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
