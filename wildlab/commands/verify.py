"""Whether a report is as it was written, from raw files to pages."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from wildlab.commands.shared import FOLDER
from wildlab.terminal import count, print_json, sentence


@click.command(short_help="Is a report as it was written?")
@click.argument("report", type=FOLDER)
@click.option("--flight", type=FOLDER, help="The flight it was made from, where it is not found.")
@click.option("--raw", type=FOLDER, help="The folder that the flight was imported from.")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def verify(report: Path, flight: Path | None, raw: Path | None, as_json: bool) -> None:
    """Compute all digests of a report again: of its files, kept seeds, flight and raw files.

    Says what does not fit, and what to do. Exits with 1 where something does not fit.

    \b
    Examples:
      wildlab verify reports/tuesday-overview
      wildlab verify reports/tuesday-overview --raw card/DCIM
    """
    from wildlab.runner.verification import verify_report

    found = verify_report(report, flight, raw)
    if as_json:
        misfits = [
            {"file": one.file, "field": one.field, "problem": one.problem, "fix": one.fix}
            for one in found.misfits
        ]
        print_json(
            {
                "fits": not misfits,
                "misfits": misfits,
                "checked": list(found.checked),
                "not_checked": list(found.unchecked),
            }
        )
    else:
        for one in found.misfits:
            click.echo(str(one))
        click.echo(sentence(f"checked: {', '.join(found.checked) or 'nothing'}"))
        for what in found.unchecked:
            click.echo(sentence(f"not checked: {what}"))
        click.echo(sentence(f"{count(len(found.misfits), 'misfit')}"))
    if found.misfits:
        sys.exit(1)
