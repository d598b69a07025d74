"""Several flights on one page."""

from __future__ import annotations

from pathlib import Path

import click

from wildlab.commands.shared import FOLDER, reports_folder, terminal_console
from wildlab.terminal import shown


@click.command(short_help="Several flights on one page, and as a table.")
@click.argument("flights", nargs=-1, required=True, type=FOLDER, metavar="DIR...")
@click.option("--into", type=FOLDER, help="The folder to write to.  [default: reports/comparison]")
@click.option("--out", type=FOLDER, help="Where the reports on the flights are, and go.  [default: reports]")
def compare(flights: tuple[Path, ...], into: Path | None, out: Path | None) -> None:
    """Compare flights: what each is, how accurate and consistent, where it pauses, what it comes to.

    Each DIR is a flight, or a report on one. A flight that has no overview yet, or was changed since, is
    evaluated first. Beside the page, flights.csv has a row for each flight. What a flight lacks is shown as
    not measured, with the reason.

    \b
    Examples:
      wildlab compare flights/tuesday flights/wednesday
      wildlab compare flights/tuesday reports/monday-overview --into together
    """
    from wildlab.runner.compare import compare_flights

    page = compare_flights(flights, into=into, reports=reports_folder(out), console=terminal_console())
    click.echo(shown(page))
