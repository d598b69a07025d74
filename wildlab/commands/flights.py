"""A flight folder: made of raw files, with points marked in its images, and an elevation map under it."""

from __future__ import annotations

import sys
import webbrowser
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wildlab.commands import shared
from wildlab.commands.shared import (
    ANY,
    FILE,
    FOLDER,
    count,
    print_json,
    print_table,
    sentence,
    shown,
    stopped,
    tell_contradictions,
    terrain_of,
    terrain_options,
)
from wildlab.errors import WildlabError

if TYPE_CHECKING:
    from wildlab.flight.card import Proposal, Wishes
    from wildlab.flight.store import Flight

#: Images without a frame that are named.
SHOWN = 5


@click.command("import")
@click.argument("raw", type=ANY, nargs=-1, required=True)
@shared.out(FOLDER, "Folder of the flight to make.")
@click.option("--dry-run", is_flag=True, help="Only say what was found, and print the recipe.")
@click.option(
    "--role", "roles", multiple=True, metavar="FILE=ROLE", help="own, camera, receiver, target:NAME, "
    "triggers, images, marks, clicks or nothing.",
)  # fmt: skip
@click.option("--name", help="Of the flight.  [default: the folder's]")
@click.option("--camera", type=FILE, help="A camera.toml of `wildlab camera`.")
@click.option("--focal", type=click.FloatRange(1, 1e6), metavar="PX", help="Focal length, without one.")
@click.option("--zone", help="Of wall clocks that state none: Europe/Oslo, or +02:00.")
@click.option("--camera-offset", type=float, metavar="SECONDS", help="To add to the images' stamps.")
@click.option("--geoid", type=float, metavar="METRES", help="Of the geoid above the ellipsoid there.")
@click.option("--take-off", type=float, metavar="METRES", help="Of the take-off above sea level.")
@click.option("--start", help="Zero of a clock without UTC: 2026-05-01T06:00:00Z.")
@click.option("--source", type=FOLDER, help="Of a recipe: folder of the raw files.")
@click.option("--calibration", type=FILE, help="Of `wildlab calibrate`, kept with the flight.")
@shared.overwrite
@shared.as_json
@click.option("--terrain", "map_", type=FILE, help="An elevation map: GeoTIFF or PNG.")
@terrain_options("--terrain-")
def import_(
    raw: tuple[Path, ...],
    out: Path | None,
    dry_run: bool,
    source: Path | None,
    calibration: Path | None,
    overwrite: bool,
    as_json: bool,
    map_: Path | None,
    **stated: Any,
) -> None:
    """Make a flight folder from RAW files, a card, or a recipe.

    RAW are logs, folders of images, a whole memory card; or one recipe. Files are known by their content.
    What each was taken for is said, with the reason, and written as a recipe beside the flight: change it
    there, or with --role, and import it again. Raw files are only read. Formats: ArduPilot (.bin, .log,
    .tlog), PX4 (.ulg), GPX, NMEA, u-blox, RTKLIB .pos, DJI (.SRT, .MRK, AirData), images with EXIF and XMP,
    points as KML, GeoJSON or CSV, clicks as COCO, CVAT, YOLO or CSV.

    A recipe (.toml) says the same of plain tables: see data/recipes/README.md, which `wildlab doctor` finds.
    With --calibration, what was learnt on another flight is kept with this one and applied when it is
    evaluated. With --terrain, pixels are put on the ground of an elevation map; it must say what its heights
    count from, or you do with --terrain-heights. --json goes with --dry-run. A flight that contradicts itself
    is written, to be looked at; the exit code of a problem is 2.

    \b
    Examples:
      wildlab import CARD/ --out flights/tuesday
      wildlab import flight.bin boat.gpx DCIM --camera camera.toml --out flights/mine
      wildlab import flight.bin boat.bin --role boat.bin=target:boat --out flights/mine
      wildlab import CARD/ --dry-run
      wildlab import recipe.toml --source logs --out flights/mine
    """
    wishes = {name: value for name, value in stated.items() if not name.startswith("terrain_")}
    terrain = terrain_of(map_, {name: stated[name] for name in stated.keys() - wishes.keys()}, "--terrain-")
    recipe = len(raw) == 1 and raw[0].suffix.lower() == ".toml"
    if recipe:
        given = [name for name, value in wishes.items() if value] + ["dry-run"] * dry_run
        if given:
            option = "--" + given[0].replace("_", "-").replace("roles", "role")
            raise click.UsageError(f"{option} is for raw files; a recipe says that itself.")
    elif source is not None:
        raise click.UsageError("--source is for a recipe; raw files are named themselves.")
    if out is None and not dry_run:
        raise click.UsageError("Name the folder of the flight to make: --out FLIGHT (or --dry-run).")
    if as_json and not dry_run and not recipe:
        raise click.UsageError("--json goes with --dry-run.")
    if recipe and out is not None:
        from wildlab.flight.importing import import_flight

        _report(import_flight(raw[0], source, out, overwrite, calibration, terrain), out)
        return
    card = _card(raw, out, wishes)
    _say(card, as_json)
    if dry_run or out is None:
        if not as_json:
            click.echo(card.recipe, nl=False)
        return
    from wildlab.flight.card import import_card, recipe_beside

    flight = import_card(card, out, overwrite, calibration, terrain)
    again = f'wildlab import "{shown(recipe_beside(out))}" --source "{shown(card.source)}"'
    _report(
        flight, out,
        f'What was decided stands in "{shown(recipe_beside(out))}"; change it, and then:',
        f'  {again} --out "{shown(out)}" --overwrite',
    )  # fmt: skip


def _report(flight: Flight, out: Path, *decided: str) -> None:
    click.echo(shown(out))
    problem = tell_contradictions(flight)
    for line in (*decided, f'Next: wildlab check "{shown(out)}"'):
        click.echo(line, err=True)
    if problem:
        sys.exit(2)


def _card(raw: tuple[Path, ...], out: Path | None, wishes: dict[str, Any]) -> Proposal:
    from wildlab.flight.card import read_card
    from wildlab.flight.files import printable

    roles = {}
    for one in wishes["roles"]:
        name, equals, role = one.rpartition("=")
        if not equals:
            raise WildlabError(
                f"{one!r} names no role", "write FILE=ROLE, as boat.gpx=target", field="--role"
            )
        roles[name] = role
    tell = lambda name: click.echo(f"reading {printable(name)}", err=True)  # noqa: E731
    return read_card(raw, _wishes(raw, out, wishes), roles, tell)


def _wishes(raw: tuple[Path, ...], out: Path | None, wishes: dict[str, Any]) -> Wishes:
    from wildlab.flight.calibration_files import read_camera
    from wildlab.flight.card import Wishes
    from wildlab.flight.clock_fitting import find_zone
    from wildlab.flight.files import safe_name

    start = None
    if wishes["start"] is not None:
        try:
            start = datetime.fromisoformat(wishes["start"])
        except ValueError:
            start = None
        if start is None or start.tzinfo is None:
            problem = f"{wishes['start']!r} is no time with a zone"
            raise WildlabError(problem, "write it as 2026-05-01T06:00:00Z", field="--start")
    if wishes["zone"] is not None:
        find_zone(wishes["zone"], "--zone")
    return Wishes(
        name=wishes["name"] or safe_name(raw[0].resolve().stem if out is None else out.resolve().name),
        camera=None if wishes["camera"] is None else read_camera(wishes["camera"]).camera,
        focal_px=wishes["focal"],
        camera_offset_s=wishes["camera_offset"],
        geoid_m=wishes["geoid"],
        take_off_m=wishes["take_off"],
        start=start,
        zone=wishes["zone"],
    )


def _say(card: Proposal, as_json: bool) -> None:
    from wildlab.flight.card import HEADINGS, rows_of, sentences_of

    rows = rows_of(card.choices)
    said = [stopped(one) for one in (*sentences_of(card.choices), *card.notes)]
    if as_json:
        print_json({"files": [dict(zip(HEADINGS, row, strict=True)) for row in rows], "said": said})
        return
    print_table(HEADINGS, rows, err=True)
    for one in said:
        click.echo(one, err=True)


@click.command("click")
@click.argument("flight", type=FOLDER)
@click.option("--images", type=FOLDER, help="Folder of its images.  [default: images in FLIGHT]")
@click.option("--take", is_flag=True, help="Write what was marked into the flight, as its detections.")
def click_(flight: Path, images: Path | None, take: bool) -> None:
    """Mark points in the images of FLIGHT.

    On a page that only this machine can open. What is marked is saved at every click, in FLIGHT.clicks.csv
    beside the flight. Name a point as the known point that it is of. Then --take makes detections of it:
    images are told by the names of their files. FLIGHT may be a mere folder of images, too: import it with
    its clicks later.

    \b
    Examples:
      wildlab click flights/tuesday --images card/DCIM/100MEDIA
      wildlab click flights/tuesday --take
    """
    if take:
        if images is not None:
            raise WildlabError("takes what was marked, and no images", "leave one out", field="--images")
        _take(flight)
        return
    from wildlab.flight.manifest import FILE_NAME
    from wildlab.runner.annotation import ClickServer, open_session

    session = open_session(flight, images)
    server = ClickServer(session)
    click.echo(server.address)
    click.echo("Open this address in a browser of this machine; Ctrl-C ends.", err=True)
    click.echo(f"What is marked is saved in {shown(session.table)} at every click.", err=True)
    if sys.stdout.isatty():
        webbrowser.open(server.address)
    try:
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        # How one ends: everything is saved.
        click.echo(err=True)
    finally:
        server.server_close()
    marked = {image: several for image, several in session.points.items() if several}
    said = f"{count(sum(map(len, marked.values())), 'point')} in {count(len(marked), 'image')}"
    click.echo(sentence(said), err=True)
    if (flight / FILE_NAME).is_file() and marked:
        click.echo(f'Next: wildlab click "{shown(flight)}" --take', err=True)


def _take(flight: Path) -> None:
    from wildlab.flight.files import printable
    from wildlab.runner.annotation import take_clicks

    taken = take_clicks(flight)
    said = f"{count(taken.points, 'point')} in {count(taken.frames, 'frame')} taken as detections"
    if taken.replaced:
        said += f", in place of {taken.replaced} from before"
    click.echo(sentence(said))
    if taken.left:
        names = ", ".join(printable(one) for one in list(taken.left)[:SHOWN])
        several = f"{count(sum(taken.left.values()), 'point')} in {count(len(taken.left), 'image')}"
        click.echo(sentence(f"{several} not taken, since the flight has no such frame: {names}"), err=True)
    click.echo(f'Next: wildlab check "{shown(flight)}"', err=True)


@click.command()
@click.argument("flight", type=FOLDER)
@click.argument("map_", metavar="MAP", type=FILE)
@terrain_options("--")
def terrain(flight: Path, map_: Path, **stated: Any) -> None:
    """Lay an elevation map under FLIGHT.

    A GeoTIFF, or the PNG of F 6.3.2, as far as it is near. Pixels are put on its ground from then on. The map
    is only read; a terrain that is there is replaced.

    \b
    Examples:
      wildlab terrain flights/tuesday dem.tif --heights 46.2
      wildlab terrain flights/tuesday map.png --crs EPSG:3006 --cell 2 --corner 571000 6502000 --heights 25
    """
    from wildlab.flight.checks.sensors import terrain_sentence
    from wildlab.flight.store import load_flight, save_flight
    from wildlab.flight.terrain import lay_terrain

    says = terrain_of(map_, stated, "--")
    assert says is not None  # noqa: S101 - for the type checker: there is a map
    laid = lay_terrain(load_flight(flight), map_, says)
    save_flight(laid, flight, overwrite=True)
    click.echo(stopped(terrain_sentence(laid)))
    click.echo(f'Next: wildlab check "{shown(flight)}"', err=True)
