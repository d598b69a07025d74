"""A program that runs studies over seeds whose flights are cheap, as a user's terminal runs `wildlab run`.

What stands outside ``main`` is also done in each process that the run starts (they import their parent's main
module), and a dask worker gets it with ``--preload``: there, too, the cases are known.
"""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path

from wildlab import studies

CASES = Path(__file__).resolve().parent / "cases"
studies.__path__.append(str(CASES))
studies.FOLDERS.append(CASES)


def main() -> None:
    from rich.console import Console

    from wildlab.errors import WildlabError
    from wildlab.runner.run import run_studies

    # In the background of a script Ctrl-C is ignored from birth; in a terminal it is not.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path, help="with notebooks/; reports go beside them")
    parser.add_argument("study", nargs="*", help="all, where none is named")
    parser.add_argument("--first-look", action="store_true")
    parser.add_argument("--out", default="reports")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seeds", type=int)
    parser.add_argument("--timeout", type=float)
    parser.add_argument("--scheduler")
    given = parser.parse_args()
    try:
        run_studies(
            given.study,
            everything=not given.study,
            first_look=given.first_look,
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
