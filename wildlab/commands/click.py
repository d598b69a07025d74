"""Points marked by hand in the images of a flight, on a page of this machine."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

import click

from wildlab.commands.shared import FOLDER
from wildlab.errors import WildlabError
from wildlab.terminal import count, sentence, shown

#: Images without a frame that are named.
SHOWN = 5


@click.command("click", short_help="Mark points in the images of a flight.")
@click.argument("flight", type=FOLDER)
@click.option("--images", type=FOLDER, help="Folder of its images.  [default: images in FLIGHT]")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="On 127.0.0.1.  [default: a free one]")
@click.option("--take", is_flag=True, help="Write what was marked into the flight, as its detections.")
def click_(flight: Path, images: Path | None, port: int, take: bool) -> None:
    """Mark points in the images of FLIGHT on a page that only this machine can open.

    What is marked is saved at every click, in FLIGHT.clicks.csv beside the flight. Name a point as the known
    point that it is of. Then --take makes detections of it: images are told by the names of their files.
    FLIGHT may be a mere folder of images, too: import it with its clicks later.

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
    from wildlab.runner.annotation.server import open_server
    from wildlab.runner.annotation.session import open_session

    session = open_session(flight, images)
    server = open_server(session, port)
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
    from wildlab.runner.annotation.session import take_clicks

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
