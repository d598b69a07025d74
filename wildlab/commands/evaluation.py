"""What a flight is worth, several on one page, where its detections lie, its targets tracked, and it played
back."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wildlab.commands import shared
from wildlab.commands.shared import (
    ANY,
    FILE,
    FOLDER,
    refuse_existing,
    shown,
    stopped,
    tell_contradictions,
    terminal_console,
)
from wildlab.errors import WildlabError
from wildlab.paths import REPORTS
from wildlab.runner.processes import start_server

if TYPE_CHECKING:
    from wildlab.runner.scheduling import Outcome


@click.command()
@click.argument("flight", type=FOLDER)
@shared.source
@click.option("--calibration", type=FILE, help="Apply first what `wildlab calibrate` learnt elsewhere.")
@shared.reports
@shared.timeout
def evaluate(
    flight: Path, source: str | None, calibration: Path | None, reports: Path, timeout: float | None
) -> None:
    """Say what FLIGHT is worth, in reports on all that its data allow.

    It is a folder made by `wildlab import` or `wildlab simulate`. First an overview, whatever the flight
    lacks: where it flew and what is wrong on the way, what was recorded and where it pauses, what the images
    showed, and the three things most worth fixing, each with its measured gain. Then a report on the accuracy
    of its georeferencing, and one on its navigation, as far as the data go. All flights evaluated are listed
    in reports/flights.html.

    \b
    Examples:
      wildlab evaluate flights/tuesday
      wildlab evaluate flights/antenna --source autopilot
      wildlab evaluate flights/wednesday --calibration calibration.toml
    """
    start_server()
    from wildlab.runner.evaluate import evaluate_flight, left_from_before

    outcomes = evaluate_flight(
        flight,
        source=source,
        calibration=calibration,
        reports=reports,
        timeout_s=None if timeout is None else timeout * 60,
        console=terminal_console(),
    )
    for outcome in outcomes:
        if outcome.folder is not None:
            click.echo(shown(outcome.folder / "report.html"))
    for folder in left_from_before(flight, reports):
        click.echo(f"{shown(folder)} is of an earlier evaluation: flights.html says so.", err=True)
    if any(outcome.state == "failed" for outcome in outcomes):
        sys.exit(1)


@click.command()
@click.argument("flights", nargs=-1, required=True, type=FOLDER, metavar="DIR...")
@shared.out(FOLDER, "The page's folder.  [default: reports/comparison]")
@click.option("--reports", type=FOLDER, default=REPORTS, help="Where reports on flights are, and go.")
def compare(flights: tuple[Path, ...], out: Path | None, reports: Path) -> None:
    """Compare flights on one page, and as a table.

    How accurate and consistent each is, where it pauses, what it comes to. Each DIR is a flight, or a report
    on one. A flight that has no overview yet, or was changed since, is evaluated first. Beside the page,
    flights.csv has a row for each flight. What a flight lacks is shown as not measured, with the reason.

    \b
    Examples:
      wildlab compare flights/tuesday flights/wednesday
      wildlab compare flights/tuesday reports/monday-overview --out together
    """
    from wildlab.runner.evaluate import compare_flights

    click.echo(shown(compare_flights(flights, into=out, reports=reports, console=terminal_console())))


@click.command()
@click.argument("flight", type=FOLDER)
@shared.out(FILE, "The file to write: .csv or .geojson.", required=True)
@shared.overwrite
@shared.source
@shared.seed
def georeference(flight: Path, out: Path, overwrite: bool, source: str | None, seed: int) -> None:
    """Put the pixel detections of FLIGHT on the ground.

    Each has its 90 % ellipse, on its terrain where it has one, else on a level plane at the height that it
    states, or that of the target. A CSV holds metres north and east of the flight's origin and no
    coordinates; a GeoJSON holds the places themselves, so send it to nobody who may not know them. It has the
    ellipses as polygons, and opens in QGIS as it is.

    \b
    Examples:
      wildlab georeference flights/tuesday --out points.csv
      wildlab georeference flights/tuesday --out points.geojson
    """
    import numpy as np

    from wildlab.analysis import fact
    from wildlab.analysis.accuracy import observe_calibrated
    from wildlab.analysis.georeference import SUFFIXES, ground_facts, write_points
    from wildlab.analysis.georeference import georeference as to_ground
    from wildlab.flight.store import load_flight
    from wildlab.messages.catalogue import words
    from wildlab.runner.evaluate import tell_source

    if out.suffix not in SUFFIXES:
        raise WildlabError(f"nobody can write {out.suffix!r}", f"use {' or '.join(SUFFIXES)}", file=out)
    refuse_existing(out, overwrite)
    data = load_flight(flight)
    observations, errors = observe_calibrated(data, source)
    tell_source(data, source, terminal_console())
    points = to_ground(observations, np.random.default_rng(seed), errors)
    write_points(data, points, out, observations.source)
    tell_contradictions(data)
    kept = [] if data.calibration is None else [fact("calibration-kept")]
    for line in words("terminal", [*kept, *ground_facts(observations, points)]):
        click.echo(line)
    click.echo(shown(out))


@click.command()
@click.argument("flight", type=FOLDER)
@click.option(
    "--tune",
    type=FOLDER,
    multiple=True,
    help="Another flight, that teaches the sensors' errors; several are allowed.",
)
@click.option("--against", type=click.Choice(["truth", "innovations"]), help="What --tune learns from.")
@click.option("--filter", "filters", multiple=True, help="A filter; several are allowed.")
@click.option("--target", "targets", multiple=True, help="A target; all if not given.")
@click.option("--sensor", "sensors", multiple=True, help="A sensor; all if not given.")
@click.option("--settings", type=FILE, help="A settings.toml: noise, clocks, considered errors.")
@click.option("--many", is_flag=True, help="All targets at once, whatever detections name.")
@click.option("--smooth", is_flag=True, help="Also backwards in time.")
@shared.source
@shared.out(FOLDER, "The report's folder.  [default: reports/NAME-tracking, or NAME-many]")
@shared.overwrite
def track(
    flight: Path,
    tune: tuple[Path, ...],
    against: str | None,
    filters: tuple[str, ...],
    targets: tuple[str, ...],
    sensors: tuple[str, ...],
    settings: Path | None,
    many: bool,
    smooth: bool,
    source: str | None,
    out: Path | None,
    overwrite: bool,
) -> None:
    """Track the targets of FLIGHT by any sensor.

    Detections are pixels, bearings, ranges, positions or velocities. Filters: ekf (white noise), ukf, imm
    (two motions), coloured (correlated noise), schmidt (platform, clock or range have a bias), thinned. Left
    out: ekf, and schmidt and coloured beside it where there are errors to consider. The report says
    whether they are consistent; estimates.parquet and .csv beside it have states, covariances and
    innovations. --tune learns from the truth, where there is any, or from innovations.

    With --many nobody says whose a detection is: tracks begin and end by themselves, and where true places
    are known the report says which targets were lost or mixed up. Bearings move tracks that another sensor
    began.

    \b
    Examples:
      wildlab track flights/tuesday
      wildlab track flights/wednesday --tune flights/tuesday --filter schmidt --filter coloured
      wildlab track flights/harbour --settings settings.toml --target boat --sensor radar
      wildlab track flights/harbour --many --tune flights/monday --tune flights/tuesday
    """
    if out is not None:
        refuse_existing(out / "report.html", overwrite)
    start_server()
    from wildlab.runner.evaluate import refuse_unfit, track_flight, track_many

    console = terminal_console()
    outcome: Outcome
    if many:
        refuse_unfit({"--filter": filters, "--target": targets, "--smooth": smooth})
        outcome = track_many(
            flight, tune=tune, against=against, sensors=sensors, settings=settings, source=source, into=out,
            console=console,
        )  # fmt: skip
    else:
        outcome = track_flight(
            flight, tune=tune, against=against, filters=filters, targets=targets, sensors=sensors,
            settings=settings, smooth=smooth, source=source, into=out, console=console,
        )  # fmt: skip
    if outcome.folder is not None:
        click.echo(shown(outcome.folder / "report.html"))
    if outcome.state == "failed":
        sys.exit(1)


@click.command()
@click.argument("folder", metavar="DIR", type=FOLDER)
@click.option("--images", type=ANY, help="Its images, or a video.  [default: images in the flight]")
@shared.source
@shared.out(FOLDER, "The folder to write to.  [default: the report, or reports/NAME-replay]")
def replay(folder: Path, images: Path | None, source: str | None, out: Path | None) -> None:
    """Play DIR back, a flight or a report made from one.

    Writes replay.html, for any browser, and replay.rrd, for rerun's viewer. They show the aircraft, what its
    camera saw of the ground, the images, what was detected, tracks with their 90 % ellipses where wildlab
    track left some, the truth, and errors and NEES over time. What the flight lacks is said. Everything is in
    metres from an origin that is not told, and in seconds from the first pose; images are reduced, and
    nothing but their pixels is kept. What the pixels show still may tell where it was.

    \b
    Examples:
      wildlab replay flights/tuesday
      wildlab replay flights/tuesday --images card/DCIM
      wildlab replay reports/tuesday-tracking
      rerun reports/tuesday-replay/replay.rrd       the viewer as a program
    """
    from wildlab.runner.replay import replay as write_replay

    written, scene = write_replay(folder, into=out, images=images, source=source, console=terminal_console())
    for clause in scene.lacks:
        click.echo(stopped(f"Not shown: {clause}"), err=True)
    for path in written:
        click.echo(shown(path))
