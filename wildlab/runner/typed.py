"""A command as somebody types it again; it names no folder."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from wildlab.paths import REPORTS


def typed(command: str, *arguments: str | Path, **options: str | Path | bool | Sequence[str] | None) -> str:
    """A command line for a shell, with quotes where names have blanks.

    Parameters
    ----------
    command
        As ``wildlab track``, taken as it is.
    arguments
        What follows. Of paths only the last name is written: a report names no folder of this machine.
    options
        By name without dashes: a value, several, or True; what is None, False or empty is left out.

    Examples
    --------
    >>> typed("wildlab track", "my flight", filter=("ekf", "ukf"), smooth=True, source=None)
    "wildlab track 'my flight' --filter ekf --filter ukf --smooth"
    """
    words = [shlex.quote(_written(one)) for one in arguments]
    for name, value in options.items():
        if value is True:
            words.append(f"--{name}")
        elif value:
            several = [value] if isinstance(value, str | Path) else list(value) if value else []
            words += [f"--{name} {shlex.quote(_written(one))}" for one in several]
    return " ".join([command, *words])


def other_reports(reports: Path) -> Path | None:
    """The folder of reports where it is not the usual one, and so has to be typed."""
    return None if reports.resolve() == REPORTS.resolve() else reports


def _written(one: str | Path) -> str:
    # A report names no folder: it may be passed on.
    return one.name if isinstance(one, Path) else one
