"""What commands share: kinds of paths, where reports go, where progress is shown."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rich.console import Console

FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)


class Minutes(click.ParamType[float]):
    """A number of minutes above zero; nan and infinity, which pass for numbers, are refused."""

    name = "minutes"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            minutes = float(value)
        except ValueError:
            minutes = math.nan
        if not 0 < minutes <= MOST_MINUTES:
            self.fail(f"{value!r} is not a number of minutes: give one above 0, at most {MOST_MINUTES}.")
        return minutes


#: A year.
MOST_MINUTES = 525_600


def reports_folder(out: Path | None) -> Path:
    from wildlab.paths import REPORTS

    return REPORTS if out is None else out


def terminal_console() -> Console:
    from rich.console import Console

    # Progress goes to standard error: standard output is the path of the result.
    return Console(stderr=True)
