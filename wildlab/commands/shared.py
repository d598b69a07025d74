"""What commands share: kinds of paths, where reports go, where progress is shown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from rich.console import Console

FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)


def reports_folder(out: Path | None) -> Path:
    from wildlab.paths import REPORTS

    return REPORTS if out is None else out


def terminal_console() -> Console:
    from rich.console import Console

    # Progress goes to standard error: standard output is the path of the result.
    return Console(stderr=True)
