"""An elevation map for a flight that is there, and the options that say what a map does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from wildlab.commands.shared import FILE, FOLDER
from wildlab.errors import WildlabError
from wildlab.terminal import shown, stopped

if TYPE_CHECKING:
    from wildlab.flight.manifest_parts import TerrainSays

Command = TypeVar("Command", bound=Callable[..., Any])

#: By the keys of `TerrainSays`: kind, and what it says.
_OPTIONS: dict[str, tuple[Any, str]] = {
    "heights": (str, "What its heights count from: ellipsoid, flight (what the flight's own do), or metres "
                     "of the geoid above the ellipsoid there."),
    "crs": (str, "Of a map that states none: EPSG:32633 for instance."),
    "unit": (click.Choice(["m", "ft", "us-ft"]), "Of its heights.  [default: what it says, else m]"),
    "nodata": (float, "A value that stands for a hole and that the map does not declare."),
    "sd": (float, "Standard deviation of its heights, metres."),
    "step": (float, "Of the grid that is kept, metres.  [default: the map's cell]"),
    "margin": (float, "How far beyond the flight it is kept, metres.  [default: by the height above ground]"),
    "cell": (float, "Of a PNG: side of a pixel, metres."),
    "corner": ((float, float), "Of a PNG: easting and northing of its upper left corner."),
}  # fmt: skip
_METRES = {"sd": "sd_m", "step": "step_m", "margin": "margin_m", "cell": "cell_m"}


def terrain_options(prefix: str, *names: str) -> Callable[[Command], Command]:
    """Options for what a map does not say of itself, each with a prefix: those named, or all."""

    def decorate(command: Command) -> Command:
        for name, (kind, text) in reversed(_OPTIONS.items()):
            if names and name not in names:
                continue
            command = click.option(f"{prefix}{name}", f"terrain_{name}", type=kind, help=text)(command)
        return command

    return decorate


def says_of(map_: Path | None, stated: Mapping[str, Any], prefix: str) -> TerrainSays | None:
    """What the options say of a map; None without a map.

    Raises
    ------
    WildlabError
        Where an option is there without a map, or its value is wrong.
    """
    if map_ is None:
        given = [name for name, one in stated.items() if one is not None]
        if given:
            raise WildlabError(
                "something is said of a map, and no map is named",
                "add --terrain",
                field=prefix + given[0].removeprefix("terrain_"),
            )
        return None
    return says_of_map(map_, stated, prefix)


def says_of_map(map_: Path, stated: Mapping[str, Any], prefix: str) -> TerrainSays:
    """What the options say of a map.

    Raises
    ------
    WildlabError
        Where a value is wrong.
    """
    from wildlab.flight.files import check_model
    from wildlab.flight.manifest_parts import TerrainSays

    given = {name.removeprefix("terrain_"): one for name, one in stated.items() if one is not None}
    if "heights" in given:
        given["heights"] = _heights(given["heights"], prefix)
    data = {_METRES.get(name, name): value for name, value in given.items()}
    try:
        return check_model(TerrainSays, {"file": str(map_), **data}, None)
    except WildlabError as error:
        raise WildlabError(
            error.problem, error.fix, field=prefix + (error.field or "").removesuffix("_m")
        ) from None


def _heights(text: str, prefix: str) -> str | float:
    if text in ("ellipsoid", "flight"):
        return text
    try:
        return float(text)
    except ValueError:
        raise WildlabError(
            f"{text!r} is nothing that heights count from",
            "give ellipsoid, flight, or how many metres the geoid is above the ellipsoid there",
            field=f"{prefix}heights",
        ) from None


@click.command(short_help="Lay an elevation map under a flight.")
@click.argument("flight", type=FOLDER)
@click.argument("map_", metavar="MAP", type=FILE)
@terrain_options("--")
def terrain(flight: Path, map_: Path, **stated: Any) -> None:
    """Lay the part of an elevation map (GeoTIFF, or the PNG of F 6.3.2) that is near FLIGHT under it.

    Pixels are put on its ground from then on. The map is only read; a terrain that is there is replaced.

    \b
    Examples:
      wildlab terrain flights/tuesday dem.tif --heights 46.2
      wildlab terrain flights/tuesday map.png --crs EPSG:3006 --cell 2 --corner 571000 6502000 --heights 25
    """
    from wildlab.flight.checks.camera import terrain_sentence
    from wildlab.flight.store import load_flight, save_flight
    from wildlab.flight.terrain import lay_terrain

    laid = lay_terrain(load_flight(flight), map_, says_of_map(map_, stated, "--"))
    save_flight(laid, flight, overwrite=True)
    click.echo(stopped(terrain_sentence(laid)))
    click.echo(f'Next: wildlab check "{shown(flight)}"', err=True)
