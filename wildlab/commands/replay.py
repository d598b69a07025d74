"""A flight played back."""

from __future__ import annotations

from pathlib import Path

import click

from wildlab.commands.shared import FOLDER, terminal_console
from wildlab.terminal import shown, stopped


@click.command(short_help="Play a flight back: map, images, tracks and errors over time.")
@click.argument("folder", metavar="DIR", type=FOLDER)
@click.option(
    "--html", is_flag=True, help="Also replay.html: one file that opens in a browser, without a network."
)
@click.option(
    "--images",
    type=click.Path(path_type=Path),
    help="Its images, or a video.  [default: images in the flight]",
)
@click.option("--source", help="Which poses, where the flight has several (its nav/NAME.parquet).")
@click.option(
    "--into", type=FOLDER, help="The folder to write to.  [default: the report, or reports/NAME-replay]"
)
def replay(folder: Path, html: bool, images: Path | None, source: str | None, into: Path | None) -> None:
    """Write DIR, a flight or a report made from one, as replay.rrd for rerun's viewer.

    It shows the aircraft, what its camera saw of the ground, the images, what was detected, tracks with
    their 90 % ellipses where wildlab track left some, the truth, and errors and NEES over time. What the
    flight lacks is said. Everything is in metres from an origin that is not told, and in seconds from the
    first pose; images are reduced, and nothing but their pixels is kept. What the pixels show still may tell
    where it was.

    \b
    Examples:
      wildlab replay flights/tuesday --html
      wildlab replay flights/tuesday --images card/DCIM
      wildlab replay reports/tuesday-tracking
      rerun reports/tuesday-replay/replay.rrd       the viewer as a program
    """
    from wildlab.runner.replay import replay as write_replay

    written, scene = write_replay(
        folder, into=into, images=images, source=source, html=html, console=terminal_console()
    )
    for clause in scene.lacks:
        click.echo(stopped(f"Not shown: {clause}"), err=True)
    for path in written:
        click.echo(shown(path))
