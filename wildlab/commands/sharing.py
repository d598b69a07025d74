"""A copy of reports that is safe to send, and whether a report is as it was written."""

from __future__ import annotations

import getpass
import os
import sys
import warnings
from pathlib import Path

import click

from wildlab.commands import shared
from wildlab.commands.shared import ANY, FILE, FOLDER, count, print_json, sentence, shown, terminal_console
from wildlab.errors import WildlabError
from wildlab.runner.processes import start_server

#: Where a password may stand that nobody types: never on the command line, which others can see.
VARIABLE = "WILDLAB_SHARE_PASSWORD"


@click.command()
@click.argument("report", type=ANY)
@click.option(
    "--for", "tier", type=click.Choice(["public", "partner", "team"]), default="public", show_default=True
)
@click.option("--flight", type=FOLDER, help="The flight's folder.  [default: found in flights/]")
@shared.out(FILE, "The file to make.  [default: flight-public.html, here]")
@click.option("--zip", "zipped", is_flag=True, help="A zip with a page for each report.")
@click.option("--encrypt", is_flag=True, help=f"A zip with a password: asked for, or in {VARIABLE}.")
@click.option("--edition", help="One sheet in plain words: en, nb, sv, or a file of texts.")
@shared.overwrite
def share(
    report: Path,
    tier: str,
    flight: Path | None,
    out: Path | None,
    zipped: bool,
    encrypt: bool,
    edition: str | None,
    overwrite: bool,
) -> None:
    """Make a copy of REPORT that is safe to send.

    REPORT is a report, a folder of reports, or a flight with reports. All reports on a flight go together:
    those of `wildlab evaluate`, and that of `wildlab track --many`.

    For the public the place is withheld or is a cell of the flight's category (locations.category in
    flight.toml), dates are months, names are neutral, pictures are left out. For partners it may be what
    was agreed with them (locations.agreed_category). Reports are computed and drawn again from generalised
    data; a page is written from what is known to be ours alone, and looked through: where something else is
    found there is no copy. The team gets the reports as they are, without the names of this machine.

    7-Zip, WinZip, Keka and The Unarchiver open what --encrypt makes (AES-256); `unzip`, and often what
    Windows or macOS has built in, do not.

    What was removed is printed, and kept beside the copy in a file for you alone.

    \b
    Examples:
      wildlab share flights/tuesday
      wildlab share reports/tuesday --for partner --edition en
      wildlab share reports/tuesday --for partner --encrypt
      wildlab share reports --for team --zip
    """
    start_server()
    from wildlab.sharing.share import share as make

    made = make(
        report,
        tier,  # type: ignore[arg-type]  # click has checked it
        flight=flight,
        out=out,
        zipped=zipped,
        password=(os.environ.get(VARIABLE) or _asked()) if encrypt else None,
        edition=edition,
        overwrite=overwrite,
        console=terminal_console(),
    )
    for line in made.lines:
        click.echo(line, err=True)
    click.echo(shown(made.told), err=True)
    click.echo(shown(made.file))


def _asked() -> str:
    """The password, typed twice where nobody sees it.

    Raises
    ------
    WildlabError
        Where there is no terminal to type it at.
    """
    with warnings.catch_warnings():
        # Without a terminal it would be read from wherever, and shown.
        warnings.simplefilter("error", getpass.GetPassWarning)
        try:
            typed: str = click.prompt("Password", hide_input=True, confirmation_prompt=True, err=True)
        except getpass.GetPassWarning:
            click.echo(err=True)
            raise WildlabError(
                "there is no terminal to ask for the password at",
                f"put it into {VARIABLE}",
                field="--encrypt",
            ) from None
    return typed


@click.command()
@click.argument("report", type=FOLDER)
@click.option("--flight", type=FOLDER, help="The flight, where it is not found.")
@click.option("--raw", type=FOLDER, help="The folder that it was imported from.")
@shared.as_json
def verify(report: Path, flight: Path | None, raw: Path | None, as_json: bool) -> None:
    """Check that a REPORT is as it was written.

    Computes all digests again: of its files, kept seeds, flight and raw files. Says what does not fit, and
    what to do. Exits with 1 where something does not fit.

    \b
    Examples:
      wildlab verify reports/tuesday-overview
      wildlab verify reports/tuesday-overview --raw card/DCIM
    """
    from wildlab.runner.provenance import verify_report

    found = verify_report(report, flight, raw)
    if as_json:
        names = ("file", "field", "problem", "fix")
        misfits = [{name: getattr(one, name) for name in names} for one in found.misfits]
        checked = {"checked": list(found.checked), "not_checked": list(found.unchecked)}
        print_json({"fits": not misfits, "misfits": misfits} | checked)
    else:
        for one in found.misfits:
            click.echo(str(one))
        click.echo(sentence(f"checked: {', '.join(found.checked) or 'nothing'}"))
        for what in found.unchecked:
            click.echo(sentence(f"not checked: {what}"))
        click.echo(sentence(f"{count(len(found.misfits), 'misfit')}"))
    if found.misfits:
        sys.exit(1)
