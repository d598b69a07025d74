"""Targets followed through a flight."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wildlab.commands.shared import FILE, FOLDER, terminal_console
from wildlab.terminal import shown

if TYPE_CHECKING:
    from wildlab.runner.processes.scheduling import Outcome


@click.command(short_help="Follow targets by any sensor, and how far to believe that.")
@click.argument("flight", type=FOLDER)
@click.option("--tune", type=FOLDER, help="Another flight, that teaches what the sensors' errors are like.")
@click.option(
    "--against",
    type=click.Choice(["truth", "innovations"]),
    help="What the other flight's detections are held against.  [default: truth, where it has any]",
)
@click.option("--filter", "filters", multiple=True, help="A filter; may be given several times.")
@click.option("--target", "targets", multiple=True, help="A target; all if not given.")
@click.option("--sensor", "sensors", multiple=True, help="A sensor; all that detected something.")
@click.option("--settings", type=FILE, help="A settings.toml: noise, clocks, considered errors, targets.")
@click.option("--many", is_flag=True, help="All targets at once, whatever detections name.")
@click.option("--smooth", is_flag=True, help="Also backwards in time, for use after the flight.")
@click.option("--source", help="Which poses, where the flight has several (its nav/NAME.parquet).")
@click.option(
    "--into",
    type=FOLDER,
    help="The report's folder.  [default: reports/NAME-tracking, with --many NAME-many]",
)
def track(
    flight: Path,
    tune: Path | None,
    against: str | None,
    filters: tuple[str, ...],
    targets: tuple[str, ...],
    sensors: tuple[str, ...],
    settings: Path | None,
    many: bool,
    smooth: bool,
    source: str | None,
    into: Path | None,
) -> None:
    """Follow the targets of FLIGHT by their detections: pixels, bearings, ranges, positions, velocities.

    Filters: ekf (errors are new at every look), ukf, imm (two motions), coloured (errors are alike from look
    to look), schmidt (platform, clock or range are wrong by something that lasts), thinned. Left out: ekf,
    and schmidt beside it where there are errors to consider. The report says whether they know how wrong
    they are; estimates.parquet and .csv beside it have states, covariances and innovations.

    With --many nobody says whose a detection is: tracks begin and end by themselves, and where true places
    are known the report says which targets were lost or mixed up. Bearings move tracks that another sensor
    began.

    \b
    Examples:
      wildlab track flights/tuesday
      wildlab track flights/wednesday --tune flights/tuesday --filter schmidt --filter coloured
      wildlab track flights/harbour --settings settings.toml --target boat --sensor radar
      wildlab track flights/harbour --many --settings settings.toml
    """
    from wildlab.runner.track import refuse_unfit, track_flight, track_many

    if many:
        refuse_unfit({"--tune": tune, "--against": against, "--filter": filters, "--target": targets,
                      "--smooth": smooth})  # fmt: skip
        found = track_many(
            flight, sensors=sensors, settings=settings, source=source, into=into, console=terminal_console()
        )
        _end(found)
        return
    outcome = track_flight(
        flight,
        tune=tune,
        against=against,
        filters=filters,
        targets=targets,
        sensors=sensors,
        settings=settings,
        smooth=smooth,
        source=source,
        into=into,
        console=terminal_console(),
    )
    _end(outcome)


def _end(outcome: Outcome) -> None:
    if outcome.folder is not None:
        click.echo(shown(outcome.folder / "report.html"))
    if outcome.state == "failed":
        sys.exit(1)
