"""A copy of reports that is safe to send."""

from __future__ import annotations

import getpass
import os
import warnings
from pathlib import Path

import click

from wildlab.commands.shared import FILE, FOLDER, terminal_console
from wildlab.errors import WildlabError
from wildlab.terminal import shown

#: Where a password may stand that nobody types: never on the command line, which others can see.
VARIABLE = "WILDLAB_SHARE_PASSWORD"


@click.command(short_help="A copy of reports that is safe to send.")
@click.argument("report", type=click.Path(path_type=Path))
@click.option(
    "--for",
    "tier",
    type=click.Choice(["public", "partner", "team"]),
    default="public",
    show_default=True,
    help="Who gets it.",
)
@click.option("--flight", type=FOLDER, help="The flight's folder.  [default: found in flights/]")
@click.option("--out", type=FILE, help="The file to make.  [default: flight-public.html, here]")
@click.option("--zip", "zipped", is_flag=True, help="A zip with a page for each flight and study.")
@click.option(
    "--encrypt",
    is_flag=True,
    help=f"A zip with a password: asked for, or in {VARIABLE}.",
)
@click.option("--edition", help="On one sheet in plain words: en, nb, sv, or a file of texts.")
@click.option("--overwrite", is_flag=True, help="Replace the copy that is there.")
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
    """Make one file of REPORT that can be mailed: a report, a folder of reports, or a flight with reports.

    All reports on a flight go together: those of `wildlab evaluate`, and that of `wildlab track --many`.

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
    from wildlab.sharing.share import share as make

    password = None
    if encrypt:
        password = os.environ.get(VARIABLE) or _asked()
    made = make(
        report,
        tier,  # type: ignore[arg-type]  # click has checked it
        flight=flight,
        out=out,
        zipped=zipped,
        password=password,
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
