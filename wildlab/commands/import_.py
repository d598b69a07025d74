"""Raw logs, folders of images, a memory card, or a recipe: in, as a flight folder."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wildlab.commands.shared import FILE, FOLDER
from wildlab.commands.terrain import says_of, terrain_options
from wildlab.errors import WildlabError
from wildlab.terminal import print_json, print_table, shown, stopped

if TYPE_CHECKING:
    from wildlab.flight.card.importing import Card
    from wildlab.flight.card.proposal import Wishes

ANYTHING = click.Path(path_type=Path)


@click.command("import", short_help="Raw logs and images, a whole card, or a recipe, as a flight folder.")
@click.argument("raw", type=ANYTHING, nargs=-1, required=True)
@click.option("--into", type=FOLDER, help="Folder of the flight to make.")
@click.option("--dry-run", is_flag=True, help="Only say what was found, and print the recipe.")
@click.option(
    "--role", "roles", multiple=True, metavar="FILE=ROLE", help="What a file is: own, camera, receiver, "
    "target:NAME, triggers, images, marks, clicks or nothing.",
)  # fmt: skip
@click.option("--name", help="Of the flight.  [default: that of the folder]")
@click.option("--camera", type=FILE, help="A camera.toml of `wildlab camera`.  [default: what images say]")
@click.option(
    "--focal",
    type=click.FloatRange(1, 1e6),
    metavar="PX",
    help="Focal length in pixels, without a camera.toml.",
)
@click.option("--zone", help="Of wall clocks that state none: Europe/Oslo, or +02:00.")
@click.option("--camera-offset", type=float, metavar="SECONDS", help="To add to the stamps of the images.")
@click.option("--geoid", type=float, metavar="METRES", help="How far the geoid is above the ellipsoid there.")
@click.option("--take-off", type=float, metavar="METRES", help="Height of the take-off above sea level.")
@click.option("--start", help="When the clock of a log without UTC stood at zero: 2026-05-01T06:00:00Z.")
@click.option("--source", type=FOLDER, help="Of a recipe: folder of the raw files.  [default: the recipe's]")
@click.option("--calibration", type=FILE, help="What `wildlab calibrate` learnt, to be kept with the flight.")
@click.option("--overwrite", is_flag=True, help="Replace the flight that is there.")
@click.option("--json", "as_json", is_flag=True, help="With --dry-run: what was found, as JSON.")
@click.option(
    "--terrain", "map_", type=FILE, help="An elevation map, GeoTIFF or PNG, to lay under the flight."
)
@terrain_options("--terrain-")
def import_(
    raw: tuple[Path, ...],
    into: Path | None,
    dry_run: bool,
    source: Path | None,
    calibration: Path | None,
    overwrite: bool,
    as_json: bool,
    map_: Path | None,
    **stated: Any,
) -> None:
    """Make a flight folder from RAW: logs, folders of images, a whole memory card; or from one recipe.

    Files are known by their content. What each was taken for is said, with the reason, and written as a
    recipe beside the flight: change it there, or with --role, and import it again. Raw files are only read.
    Formats: ArduPilot (.bin, .log, .tlog), PX4 (.ulg), GPX, NMEA, u-blox, RTKLIB .pos, DJI (.SRT, .MRK,
    AirData), images with EXIF and XMP, points as KML, GeoJSON or CSV, clicks as COCO, CVAT, YOLO or CSV.

    A recipe (.toml) says the same of plain tables: see data/recipes/README.md, which `wildlab doctor` finds.
    With --calibration, what was learnt on another flight is kept with this one and applied when it is
    evaluated. With --terrain, pixels are put on the ground of an elevation map; it must say what its heights
    count from, or you do with --terrain-heights.

    \b
    Examples:
      wildlab import CARD/ --into flights/tuesday
      wildlab import flight.bin boat.gpx DCIM --camera camera.toml --into flights/mine
      wildlab import flight.bin boat.bin --role boat.bin=target:boat --into flights/mine
      wildlab import CARD/ --dry-run
      wildlab import recipe.toml --source logs --into flights/mine
    """
    options = {
        name: stated.pop(name) for name in ("roles", "name", "camera", "focal", "zone", "camera_offset")
    }
    options |= {name: stated.pop(name) for name in ("geoid", "take_off", "start")}
    terrain = says_of(map_, stated, "--terrain-")
    recipe = len(raw) == 1 and raw[0].suffix.lower() == ".toml"
    if into is None and not dry_run:
        raise click.UsageError("Name the folder of the flight to make: --into FLIGHT (or --dry-run).")
    if recipe:
        given = [name for name, value in options.items() if value]
        if given or dry_run:
            option = "--" + (given[0] if given else "dry-run").replace("_", "-").replace("roles", "role")
            raise click.UsageError(f"{option} is for raw files; a recipe says that itself.")
        _flight(raw[0], source, into, calibration, overwrite, terrain)
        return
    if source is not None:
        raise click.UsageError("--source is for a recipe; raw files are named themselves.")
    if as_json and not dry_run:
        raise click.UsageError("--json goes with --dry-run.")
    card = _card(raw, into, options)
    _say(card, as_json)
    if dry_run:
        if not as_json:
            click.echo(card.recipe, nl=False)
        return
    from wildlab.flight.card.importing import import_card, recipe_beside
    from wildlab.flight.checks.check import sense_sentences

    if into is None:
        raise click.UsageError("Name the folder of the flight to make: --into FLIGHT.")
    flight = import_card(card, into, overwrite, calibration, terrain)
    click.echo(shown(into))
    for line in sense_sentences(flight):
        click.echo(line, err=True)
    click.echo(f'What was decided stands in "{shown(recipe_beside(into))}"; change it, and then:', err=True)
    again = f'wildlab import "{shown(recipe_beside(into))}" --source "{shown(card.source)}"'
    click.echo(f'  {again} --into "{shown(into)}" --overwrite', err=True)
    click.echo(f'Next: wildlab check "{shown(into)}"', err=True)


def _flight(
    recipe: Path,
    source: Path | None,
    into: Path | None,
    calibration: Path | None,
    overwrite: bool,
    terrain: Any,
) -> None:
    from wildlab.flight.checks.check import sense_sentences
    from wildlab.flight.recipe.importing import import_flight

    if into is None:
        raise click.UsageError("Name the folder of the flight to make: --into FLIGHT.")
    flight = import_flight(recipe, source, into, overwrite, calibration, terrain)
    click.echo(shown(into))
    for line in sense_sentences(flight):
        click.echo(line, err=True)
    click.echo(f'Next: wildlab check "{shown(into)}"', err=True)


def _card(raw: tuple[Path, ...], into: Path | None, options: dict[str, Any]) -> Card:
    from wildlab.flight.card.importing import read_card

    roles = {}
    for one in options["roles"]:
        name, equals, role = one.rpartition("=")
        if not equals:
            raise WildlabError(
                f"{one!r} names no role", "write FILE=ROLE, as boat.gpx=target", field="--role"
            )
        roles[name] = role
    return read_card(raw, _wishes(raw, into, options), roles, _tell)


def _tell(name: str) -> None:
    from wildlab.flight.files import printable

    click.echo(f"reading {printable(name)}", err=True)


def _wishes(raw: tuple[Path, ...], into: Path | None, options: dict[str, Any]) -> Wishes:
    from wildlab.flight.calibration_files import read_camera
    from wildlab.flight.card.importing import safe_name
    from wildlab.flight.card.proposal import Wishes
    from wildlab.flight.recipe.quantities import parse_zone

    named = into if into is not None else raw[0]
    start = None
    if options["start"] is not None:
        try:
            start = datetime.fromisoformat(options["start"])
        except ValueError:
            start = None
        if start is None or start.tzinfo is None:
            problem = f"{options['start']!r} is no time with a zone"
            raise WildlabError(problem, "write it as 2026-05-01T06:00:00Z", field="--start")
    if options["zone"] is not None:
        try:
            parse_zone(options["zone"])
        except ValueError as error:
            problem, _, fix = str(error).partition("; ")
            raise WildlabError(problem, fix, field="--zone") from None
    return Wishes(
        name=options["name"] or safe_name(named.resolve().stem if into is None else named.resolve().name),
        camera=None if options["camera"] is None else read_camera(options["camera"]).camera,
        focal_px=options["focal"],
        camera_offset_s=options["camera_offset"],
        geoid_m=options["geoid"],
        take_off_m=options["take_off"],
        start=start,
        zone=options["zone"],
    )


def _say(card: Card, as_json: bool) -> None:
    from wildlab.flight.card.description import HEADINGS, rows_of, sentences_of

    rows = rows_of(card.choices)
    said = [*sentences_of(card.choices), *card.proposal.notes]
    if as_json:
        files = [dict(zip(HEADINGS, row, strict=True)) for row in rows]
        print_json({"files": files, "said": [stopped(one) for one in said]})
        return
    # The rest of each row is told in sentences: a terminal is narrow.
    short = [HEADINGS.index(one) for one in ("file", "format", "begins (UTC)", "lasts", "role")]
    print_table([HEADINGS[i] for i in short], [[row[i] for i in short] for row in rows], err=True)
    for one in said:
        click.echo(stopped(one), err=True)
