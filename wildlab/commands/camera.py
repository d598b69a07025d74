"""A camera out of images of a board."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from wildlab.commands.shared import FILE, terminal_console
from wildlab.errors import WildlabError
from wildlab.terminal import print_json, print_table, shown, stopped

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


class Grid(click.ParamType[tuple[int, int]]):
    """Columns and rows: 9x6."""

    name = "CxR"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        found = re.fullmatch(r"(\d{1,3})\s*[x×X]\s*(\d{1,3})", str(value))
        if found is None:
            self.fail(f"{value!r} is no number of columns and rows: write 9x6.")
        return int(found[1]), int(found[2])


class Size(click.ParamType[float]):
    """A length with its unit: 25mm; metres come out."""

    name = "LENGTH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        found = re.fullmatch(r"(\d+(?:\.\d+)?|\.\d+)\s*(mm|cm|m)", str(value))
        if found is None or not 0 < float(found[1]) * LENGTHS[found[2]] <= 100:
            self.fail(f"{value!r} is no length above zero with its unit: write 25mm, 2.5cm or 0.025m.")
        return float(found[1]) * LENGTHS[found[2]]


@click.command(short_help="Calibrate a camera from images of a chessboard or a grid of circles.")
@click.argument("images", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--board", type=Grid(), help="A chessboard's inner corners, columns x rows: 9x6.")
@click.option("--circles", type=Grid(), help="A grid of circles, columns x rows: 7x7.")
@click.option("--staggered", is_flag=True, help="Every other row of circles is moved by half a step (4x11).")
@click.option(
    "--square",
    type=Size(),
    required=True,
    help="Side of a square, or from circle to circle in a row (staggered: half of that): 25mm.",
)
@click.option("--into", type=FILE, help="The file to write, camera.toml for instance; a recipe may name it.")
@click.option("--overwrite", is_flag=True, help="Replace the file that is there.")
@click.option("--name", default="camera", show_default=True, help="What the camera is called.")
@click.option(
    "--lens",
    type=click.Choice(["auto", "none", "k1", "k1-k2", "k1-k2-k3", "tangential", "full"]),
    default="auto",
    show_default=True,
    help="How the lens may bend; auto takes the simplest that is no worse than the best on views held out.",
)
@click.option("--square-pixels", is_flag=True, help="One focal length for columns and rows.")
@click.option("--without", multiple=True, metavar="NAME", help="Leave an image out; may be given again.")
@click.option("--json", "as_json", is_flag=True, help="What was found, as JSON.")
def camera(
    images: tuple[Path, ...],
    board: tuple[int, int] | None,
    circles: tuple[int, int] | None,
    staggered: bool,
    square: float,
    into: Path | None,
    overwrite: bool,
    name: str,
    lens: str,
    square_pixels: bool,
    without: tuple[str, ...],
    as_json: bool,
) -> None:
    """Calibrate a camera from IMAGES of a flat board: files, or folders of them.

    Thermal and colour images, dark on light or light on dark. Focal lengths, principal point and distortion
    come with intervals, from how far they move when a view is left out. Take 20 views or
    more, from all sides.

    \b
    Examples:
      wildlab camera boards/ --board 9x6 --square 25mm --into camera.toml
      wildlab camera warm/*.png --circles 7x7 --square 30mm --into camera.toml
    Then, in a recipe: camera = "camera.toml"
    """
    if (board is None) == (circles is None):
        raise click.UsageError("Give either --board or --circles.")
    if staggered and circles is None:
        raise click.UsageError("--staggered is for --circles.")
    if into is not None and into.exists() and not overwrite:
        raise WildlabError("this file is there already", "name another, or add --overwrite", file=into)
    from rich.progress import track

    from wildlab.analysis.camera import calibrate_images, camera_file, sentences
    from wildlab.detection.boards import Board
    from wildlab.flight.calibration_files import write_camera
    from wildlab.flight.readers.frames.image import still_files

    columns, rows = board or circles or (0, 0)
    pattern = "chessboard" if board else "staggered circles" if staggered else "circles"
    console = terminal_console()
    found = calibrate_images(
        still_files(list(images)),
        Board(pattern, columns, rows, square),  # type: ignore[arg-type]
        lens,
        square_pixels,
        without,
        lambda paths: track(paths, "looking for boards", console=console, transient=True),
    )
    content = camera_file(found, name)
    if into is not None:
        write_camera(content, into)
    left = [one for one in found.images if one.problem]
    said = sentences(found)
    if as_json:
        dumped = content.model_dump(mode="json")
        unused = [{"name": one.name, "why": one.problem} for one in left]
        print_json({**dumped, "left_out": unused, "odd": list(found.odd), "sentences": said})
        return
    for one in left:
        click.echo(f"{one.name}: {stopped(one.problem)}", err=True)
    for line in said:
        click.echo(line)
    print_table(
        ["", "estimate", "95 % interval", "unit"],
        [
            [
                p.name,
                _number(p.value),
                f"{_number(p.low)} to {_number(p.high)}",
                "px" if p.name[0] in "fcs" else "",
            ]
            for p in content.parameter
        ],
    )
    if into is not None:
        click.echo(shown(into))


def _number(value: float) -> str:
    return f"{value:.1f}" if abs(value) >= 10 else f"{value:.4f}"
