"""How commands write: paths, sentences, tables and JSON on standard output."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click


def shown(path: Path) -> str:
    """A path, relative where it lies below the working directory."""
    path = path.resolve()
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


def count(n: int, what: str) -> str:
    """ "no problems", "1 problem", "2 problems"."""
    return f"{n or 'no'} {what}{'' if n == 1 else 's'}"


def sentence(clause: str) -> str:
    """The rooms give clauses, so that they can be joined; a reader gets a capital and a full stop."""
    return stopped(clause[:1].upper() + clause[1:])


def stopped(clause: str) -> str:
    """With a full stop, where there is anything to stop."""
    return clause if not clause or clause.endswith((".", "!", "?")) else f"{clause}."


def print_json(content: Any) -> None:
    """Plain JSON; NaN is refused."""
    click.echo(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, err: bool = False) -> None:
    """Columns of text under bold headings, on standard output, or standard error with `err`."""
    widths = [max(len(row[column]) for row in [headings, *rows]) for column in range(len(headings))]
    for index, row in enumerate([headings, *rows]):
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        click.echo(click.style(line, bold=True) if index == 0 else line, err=err)
