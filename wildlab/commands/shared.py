"""What commands share: kinds of values, options that many have, options of an elevation map, where progress
is shown, and how paths, sentences, tables and JSON are written."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from wildlab.errors import WildlabError
from wildlab.paths import REPORTS

if TYPE_CHECKING:
    from rich.console import Console

    from wildlab.flight.manifest import TerrainSays
    from wildlab.flight.store import Flight

Command = TypeVar("Command", bound=Callable[..., Any])

FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)
ANY = click.Path(path_type=Path)

source = click.option("--source", help="Which poses, of several (nav/NAME.parquet).")
seed = click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=1, show_default=True)
overwrite = click.option("--overwrite", is_flag=True, help="Replace what is there.")
as_json = click.option("--json", "as_json", is_flag=True, help="As JSON.")
reports = click.option(
    "--out", "reports", type=FOLDER, default=REPORTS, help="Where reports are, and go.  [default: reports]"
)


def out(kind: click.ParamType[Path], text: str, **more: Any) -> Callable[[Command], Command]:
    """The option for the file or folder that is written."""
    return click.option("--out", type=kind, help=text, **more)


timeout = click.option(
    "--timeout", type=click.FloatRange(0, 525_600, min_open=True), help="Minutes for a notebook or a seed.  "
    "[default: 30]",
)  # fmt: skip


def pair(kind: Callable[[str], Any], between: str, example: str) -> Callable[[str], tuple[Any, Any]]:
    """A kind of value: two numbers with something between them, 640x512, or 58.66,16.46."""

    def convert(text: str) -> tuple[Any, Any]:
        try:
            one, other = map(kind, re.split(rf"\s*[{between}]\s*", text.strip()))
        except ValueError:
            raise click.BadParameter(f"{text!r} is not two numbers: write {example}.") from None
        return one, other

    return convert


def refuse_existing(file: Path | None, overwrite: bool) -> None:
    """Refuse to write over a file unasked.

    Raises
    ------
    WildlabError
        Where it is there already.
    """
    if file is not None and file.exists() and not overwrite:
        raise WildlabError("this file is there already", "name another, or add --overwrite", file=file)


def terminal_console() -> Console:
    from rich.console import Console

    # Progress goes to standard error: standard output is the path of the result.
    return Console(stderr=True)


def tell_contradictions(flight: Flight) -> bool:
    """Say in what a flight contradicts itself, beside what is written; whether a problem is among it."""
    from wildlab.flight.checks.check import sense_sentences

    lines = sense_sentences(flight)
    for line in lines:
        click.echo(line, err=True)
    return any(line.startswith("problem") for line in lines)


#: By the keys of `TerrainSays`: kind, and what it says.
_OPTIONS: dict[str, tuple[Any, str]] = {
    "heights": (str, "What its heights count from: ellipsoid, flight, or the geoid's height in m."),
    "crs": (str, "Of a map that states none: EPSG:32633."),
    "unit": (click.Choice(["m", "ft", "us-ft"]), "Of its heights.  [default: m]"),
    "nodata": (float, "Value of a hole that the map does not declare."),
    "sd": (float, "Standard deviation of its heights, m."),
    "step": (float, "Of the grid that is kept, m.  [default: the map's]"),
    "margin": (float, "How far beyond the flight, m.  [default: by height]"),
    "cell": (float, "Of a PNG: side of a pixel, m."),
    "corner": ((float, float), "Of a PNG: easting and northing, upper left."),
}
_METRES = {"sd": "sd_m", "step": "step_m", "margin": "margin_m", "cell": "cell_m"}


def terrain_options(prefix: str, *names: str) -> Callable[[Command], Command]:
    """Options for what a map does not say of itself, each with a prefix: those named, or all."""

    def decorate(command: Command) -> Command:
        for name, (kind, text) in reversed(_OPTIONS.items()):
            if not names or name in names:
                command = click.option(f"{prefix}{name}", f"terrain_{name}", type=kind, help=text)(command)
        return command

    return decorate


def terrain_of(map_: Path | None, stated: Mapping[str, Any], prefix: str) -> TerrainSays | None:
    """What the options say of a map; None without a map.

    Raises
    ------
    WildlabError
        Where an option is there without a map, or its value is wrong.
    """
    from wildlab.flight.files import check_model
    from wildlab.flight.manifest import TerrainSays

    given = {name.removeprefix("terrain_"): one for name, one in stated.items() if one is not None}
    if map_ is None:
        if given:
            raise WildlabError("no map is named", "add --terrain", field=prefix + next(iter(given)))
        return None
    heights = given.get("heights")
    if heights is not None and heights not in ("ellipsoid", "flight"):
        try:
            given["heights"] = float(heights)
        except ValueError:
            raise WildlabError(
                f"{heights!r} is nothing that heights count from",
                "give ellipsoid, flight, or how many metres the geoid is above the ellipsoid there",
                field=f"{prefix}heights",
            ) from None
    data = {_METRES.get(name, name): value for name, value in given.items()}
    try:
        return check_model(TerrainSays, {"file": str(map_), **data}, None)
    except WildlabError as error:
        field = prefix + (error.field or "").removesuffix("_m")
        raise WildlabError(error.problem, error.fix, field=field) from None


# -- how commands write
# ------------------------------------------------------------------------------------


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
