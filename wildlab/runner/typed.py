"""A command as somebody types it again, in the folder where it was typed first."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wildlab.paths import REPORTS


def typed(command: str, *arguments: str | Path, **options: str | Path | bool | Sequence[str] | None) -> str:
    """A command line for a shell, with quotes where names have blanks.

    Parameters
    ----------
    command
        As ``wildlab track``, taken as it is.
    arguments
        What follows. Paths are written from the folder that this is run in where they lie below it.
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


def typed_in_report(
    command: str, *arguments: str | Path, **options: str | Path | bool | Sequence[str | Path] | None
) -> str:
    """As `typed`; of a path that does not lie below the folder this is run in only the last name.

    A report may be passed on, and does not say where on which machine something lies.

    Examples
    --------
    >>> typed_in_report("wildlab track", Path("flights/tuesday"), settings=Path("/home/me/settings.toml"))
    'wildlab track flights/tuesday --settings settings.toml'
    """

    def named(value: Any) -> Any:
        if isinstance(value, Path):
            written = Path(_written(value))
            return written.name if written.is_absolute() else str(written)
        return [named(one) for one in value] if isinstance(value, list | tuple) else value

    return typed(command, *map(named, arguments), **{name: named(one) for name, one in options.items()})


def other_reports(reports: Path) -> Path | None:
    """The folder of reports where it is not the usual one, and so has to be typed."""
    return None if reports.resolve() == REPORTS.resolve() else reports


def _written(one: str | Path) -> str:
    if not isinstance(one, Path):
        return one
    whole, here = one.resolve(), Path.cwd()
    return str(whole.relative_to(here)) if whole.is_relative_to(here) and whole != here else str(whole)
