"""A camera from images of a board, the offset of its clock, and what is constantly wrong with its poses."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wildlab.commands import shared
from wildlab.commands.shared import (
    ANY,
    FILE,
    FOLDER,
    pair,
    print_json,
    print_table,
    refuse_existing,
    shown,
    stopped,
)
from wildlab.errors import WildlabError

if TYPE_CHECKING:
    from wildlab.analysis.camera import CameraClock
    from wildlab.flight.store import Flight

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
#: What a check may find that `calibrate` estimates better: constants of clock and camera.
LEARNT = {"clock of the camera", "camera turned"}


def metres(text: str) -> float:
    """A length with its unit, 25mm, in metres."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?|\.\d+)\s*(mm|cm|m)", text)
    if found is None or not 0 < float(found[1]) * LENGTHS[found[2]] <= 100:
        raise click.BadParameter(f"{text!r} is no length above zero with its unit: write 25mm or 0.025m.")
    return float(found[1]) * LENGTHS[found[2]]


GRID = pair(int, "xX×", "9x6")


@click.command()
@click.argument("images", nargs=-1, required=True, type=ANY)
@click.option("--board", type=GRID, metavar="CxR", help="A chessboard's inner corners: 9x6.")
@click.option("--circles", type=GRID, metavar="CxR", help="A grid of circles: 7x7.")
@click.option("--staggered", is_flag=True, help="Every other row is moved by half a step (4x11).")
@click.option(
    "--square",
    type=metres,
    metavar="LENGTH",
    required=True,
    help="From corner to corner, or circle to circle.",
)
@shared.out(FILE, "The file to write: camera.toml.")
@shared.overwrite
@click.option("--name", default="camera", show_default=True)
@click.option(
    "--lens",
    type=click.Choice(["auto", "none", "k1", "k1-k2", "k1-k2-k3", "tangential", "full"]),
    default="auto",
    show_default=True,
    help="How it bends; auto: the simplest that fits as well.",
)
@click.option("--without", multiple=True, metavar="NAME", help="An image to leave out.")
@shared.as_json
def camera(
    images: tuple[Path, ...],
    board: tuple[int, int] | None,
    circles: tuple[int, int] | None,
    staggered: bool,
    square: float,
    out: Path | None,
    overwrite: bool,
    name: str,
    lens: str,
    without: tuple[str, ...],
    as_json: bool,
) -> None:
    """Calibrate a camera from IMAGES of a flat board.

    Files, or folders of them. Thermal and colour images, dark on light or light on dark. Focal lengths,
    principal point and distortion come with intervals, from how far they move when a view is left out. Take
    20 views or more, from all sides. Staggered circles are half a --square apart. --lens auto takes the
    simplest model that is no worse than the best on views held out.

    \b
    Examples:
      wildlab camera boards/ --board 9x6 --square 25mm --out camera.toml
      wildlab camera warm/*.png --circles 7x7 --square 30mm --out camera.toml
    Then, in a recipe: camera = "camera.toml"
    """
    if (board is None) == (circles is None):
        raise click.UsageError("Give either --board or --circles.")
    if staggered and circles is None:
        raise click.UsageError("--staggered is for --circles.")
    refuse_existing(out, overwrite)
    from rich.progress import track

    from wildlab.analysis.camera import calibrate_images, camera_file, facts_of
    from wildlab.detection.boards import Board
    from wildlab.flight.calibration_files import write_calibration
    from wildlab.flight.readers.frames.image import still_files
    from wildlab.messages.catalogue import words

    columns, rows = board or circles or (0, 0)
    pattern = "chessboard" if board else "staggered circles" if staggered else "circles"
    console = shared.terminal_console()
    found = calibrate_images(
        still_files(list(images)),
        Board(pattern, columns, rows, square),  # type: ignore[arg-type]
        lens,
        without,
        lambda paths: track(paths, "looking for boards", console=console, transient=True),
    )
    content = camera_file(found, name)
    if out is not None:
        write_calibration(content, out)
    left, said = [one for one in found.images if one.problem], words("terminal", facts_of(found))
    if as_json:
        unused = [{"name": one.name, "why": one.problem} for one in left]
        more = {"left_out": unused, "odd": list(found.odd), "sentences": said}
        print_json({**content.model_dump(mode="json"), **more})
        return
    for one in left:
        click.echo(f"{one.name}: {stopped(one.problem)}", err=True)
    for line in said:
        click.echo(line)
    rows_shown = [
        [p.name, *_interval(p.value, p.low, p.high), "px" if p.name[0] in "fcs" else ""]
        for p in content.parameter
    ]
    print_table(["", "estimate", "95 % interval", "unit"], rows_shown)
    if out is not None:
        click.echo(shown(out))


def _interval(*values: float) -> tuple[str, str]:
    value, low, high = (f"{one:.1f}" if abs(one) >= 10 else f"{one:.4f}" for one in values)
    return value, f"{low} to {high}"


@click.command()
@click.argument("flight", type=FOLDER)
@click.option("--images", type=click.Path(exists=True, path_type=Path), help="Its images: folder or video.")
@click.option("--offset", type=float, help="Seconds, in place of an estimate.")
@click.option("--set", "set_", is_flag=True, help="Write the offset into the flight.")
@shared.source
@shared.as_json
def clock(
    flight: Path,
    images: Path | None,
    offset: float | None,
    set_: bool,
    source: str | None,
    as_json: bool,
) -> None:
    """Estimate or set the offset of the camera's clock.

    It is what has to be added to the stamps of FLIGHT's images. With --images, from the motion of the images
    against the turning that the log has; without, or where that does not tell it, from known points that were
    seen. --offset takes a number that is known otherwise (F 6.3.3). An offset that does not stand out is said
    to be uncertain, and --set refuses it. One that is set takes the place of the clock of a calibration.

    \b
    Examples:
      wildlab clock flights/tuesday
      wildlab clock flights/tuesday --images card/DCIM --set
      wildlab clock flights/tuesday --offset 0.42 --set
    """
    from wildlab.analysis import Fact, fact
    from wildlab.flight.store import load_flight
    from wildlab.messages.catalogue import words

    loaded = load_flight(flight)
    if offset is not None:
        if images is not None:
            raise WildlabError(
                "an offset is stated and an estimate asked for", "leave one out", field="--offset"
            )
        said: dict[str, object] = {"offset_s": offset, "certain": True, "method": "stated"}
        facts: tuple[Fact, ...] = (fact("clock-stated", offset_s=f"{offset:+.3f}"),)
    else:
        found = _estimate(loaded, images, source)
        said, facts = found.numbers, found.facts
    sentence = " ".join(words("terminal", facts))
    if as_json:
        print_json({**said, "sentence": sentence})
    else:
        click.echo(sentence)
    if not set_:
        return
    if not said["certain"]:
        raise WildlabError(
            "the offset is not certain, so it is not set",
            "state it yourself with --offset if you know it",
            file=flight,
            field="clocks.camera_offset_s",
        )
    from dataclasses import replace

    from wildlab.flight.manifest import replace_in_manifest
    from wildlab.flight.store import save_flight

    own = {"camera_offset_s": round(float(str(said["offset_s"])), 4), "camera_set": True}
    changed = replace(loaded, manifest=replace_in_manifest(loaded.manifest, {"clocks": own}))
    save_flight(changed, flight, overwrite=True)
    click.echo(f'Next: wildlab check "{shown(flight)}"', err=True)


def _estimate(flight: Flight, images: Path | None, source: str | None) -> CameraClock:
    from wildlab.analysis import fact
    from wildlab.analysis.camera import clock_from_images, clock_from_points

    console = shared.terminal_console()

    def from_points() -> CameraClock:
        with console.status("trying offsets on known points"):
            return clock_from_points(flight, source)

    if images is None:
        return from_points()
    from rich.progress import track

    from wildlab.flight.readers.frames import open_frames

    ids = [] if flight.frames is None else [str(one) for one in flight.frames["frame_id"]]
    refused: WildlabError | None = None
    try:
        frames = open_frames(images, ids=ids)
        moving = track(frames, "how images move", frames.count, console=console, transient=True)
        found = clock_from_images(flight, moving, source)
        if found.numbers["certain"]:
            return found
        why = found.facts
    except WildlabError as error:
        refused, why = error, (fact("clock-motion-refused", problem=error.problem),)
    try:
        other = from_points()
    except WildlabError:
        other = None
    if other is None or (refused is None and not other.numbers["certain"]):
        if refused is not None:
            raise refused
        return found
    return other._replace(facts=(*why, fact("clock-so"), *other.facts))


@click.command()
@click.argument("flight", type=FOLDER)
@shared.out(FILE, "The file to write: calibration.toml.", required=True)
@shared.overwrite
@shared.source
@click.option("--despite-warnings", is_flag=True, help="Even if a check doubts its poses.")
@shared.seed
@shared.as_json
def calibrate(
    flight: Path,
    out: Path,
    overwrite: bool,
    source: str | None,
    despite_warnings: bool,
    seed: int,
    as_json: bool,
) -> None:
    """Learn on FLIGHT what the next one is corrected by.

    On its known points: what is constantly wrong with position, boresight, clock or lens. Without truth,
    things that several images show serve as well. Only what gained something for certain on images that it
    was not estimated from, and nothing else explains as well, is written down, with its covariance; how noisy
    the poses were always is. Judge it on another flight. A flight whose logs contradict each other, or of
    whose poses a check warns, teaches nothing.

    \b
    Examples:
      wildlab calibrate flights/tuesday --out calibration.toml
      wildlab evaluate flights/wednesday --calibration calibration.toml
    """
    import numpy as np

    from wildlab.analysis.accuracy import learn_flight
    from wildlab.flight.calibration_files import write_calibration
    from wildlab.flight.checks.check import find
    from wildlab.flight.store import load_flight
    from wildlab.messages.catalogue import words
    from wildlab.reporting.georeferencing import cause_message

    refuse_existing(out, overwrite)
    loaded = load_flight(flight)
    poses = {f"nav/{name}" for name in ([source] if source else loaded.estimated_sources)}
    for doubt in find(loaded, plain=False):
        if doubt.causes and set(doubt.causes) <= LEARNT:
            continue
        if doubt.level == "problem":
            raise WildlabError(f"its logs contradict each other: {doubt.clause}", doubt.remedy, file=flight)
        if doubt.level == "warning" and doubt.table in poses and not despite_warnings:
            remedy = f"{doubt.remedy}; or add --despite-warnings"
            raise WildlabError(
                f"its poses are in doubt: {doubt.clause}", remedy, file=flight, field=doubt.table
            )
    learnt, diagnosis = learn_flight(loaded, np.random.default_rng(seed), source)
    write_calibration(learnt, out)
    if as_json:
        print_json(learnt.model_dump())
        return
    gain = learnt.gain
    if gain is not None:
        click.echo(
            f"{diagnosis.winner.name}: mean error {gain.without_m:.2f} m as logged, {gain.with_m:.2f} m on "
            f"images held out (gain {gain.low_m:.2f} to {gain.high_m:.2f} m)."
        )
        rows = [
            [one.name, f"{one.value:+.3f}", f"{one.low:+.3f} to {one.high:+.3f}", one.unit]
            for one in learnt.parameter
        ]
        print_table(["to be added to", "estimate", "95 % interval", "unit"], rows)
    else:
        found = cause_message(diagnosis)
        click.echo(" ".join(words("georeferencing", [(found.key, found.values)])))
        click.echo(" ".join(words("terminal", [("calibrate-nothing", {})])))
    click.echo("The noise of its poses takes the place of the standard deviations that a flight states.")
    click.echo(shown(out))
