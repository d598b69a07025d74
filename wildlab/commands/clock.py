"""What to add to the stamps of a flight's images, estimated or stated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wildlab.commands.shared import FILE, FOLDER
from wildlab.errors import WildlabError
from wildlab.terminal import print_json, shown

if TYPE_CHECKING:
    from wildlab.analysis.camera_clock import CameraClock
    from wildlab.flight.store import Flight


@click.command(short_help="The offset of the camera's clock: estimate it, or set it.")
@click.argument("flight", type=FOLDER)
@click.option("--images", type=click.Path(exists=True, path_type=Path), help="Its images: folder or video.")
@click.option("--offset", type=float, help="Seconds to add to the camera's stamps, in place of an estimate.")
@click.option("--set", "set_", is_flag=True, help="Write the offset into the flight.")
@click.option("--source", help="Which poses, where the flight has several (its nav/NAME.parquet).")
@click.option("--curve", type=FILE, help="CSV file for the curve: offset, and how well it fits.")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
def clock(
    flight: Path,
    images: Path | None,
    offset: float | None,
    set_: bool,
    source: str | None,
    curve: Path | None,
    as_json: bool,
) -> None:
    """Estimate what has to be added to the stamps of FLIGHT's images so that they meet the log.

    With --images, from the motion of the images against the turning that the log has; without, or where that
    does not tell it, from known points that were seen. --offset takes a number that is known otherwise (F
    6.3.3). An offset that does not stand out is said to be uncertain, and --set refuses it.

    \b
    Examples:
      wildlab clock flights/tuesday
      wildlab clock flights/tuesday --images card/DCIM --curve curve.csv --set
      wildlab clock flights/tuesday --offset 0.42 --set
    """
    from wildlab.files import write_csv
    from wildlab.flight.store import load_flight

    loaded = load_flight(flight)
    if offset is not None:
        if images is not None or curve is not None:
            raise WildlabError(
                "an offset is stated and an estimate asked for", "leave one out", field="--offset"
            )
        said = {"offset_s": offset, "certain": True, "method": "stated"}
    else:
        found = _estimate(loaded, images, source)
        if curve is not None:
            write_csv(curve, found.curve)
        said = {**found.numbers, "sentence": found.sentence}
    if as_json:
        print_json(said)
    else:
        click.echo(said.get("sentence", f"The stamps of the images get {said['offset_s']:+.3f} s."))
    if not set_:
        return
    if not said["certain"]:
        raise WildlabError(
            "the offset is not certain, so it is not set",
            "state it yourself with --offset if you know it",
            file=flight,
            field="clocks.camera_offset_s",
        )
    _set(loaded, flight, float(str(said["offset_s"])))
    click.echo(f'Next: wildlab check "{shown(flight)}"', err=True)


def _estimate(flight: Flight, images: Path | None, source: str | None) -> CameraClock:
    from wildlab.analysis.camera_clock import by_motion_in_words, by_points_in_words

    if images is None:
        return by_points_in_words(flight, source)
    from wildlab.flight.readers.frames import open_frames

    ids = [] if flight.frames is None else [str(one) for one in flight.frames["frame_id"]]
    frames = open_frames(images, ids=ids)
    try:
        found = by_motion_in_words(flight, frames, source)
    except WildlabError as error:
        why = f"By the motion of the images it cannot be told: {error.problem}."
        other = _by_points(flight, source)
        if other is None:
            raise
    else:
        why = found.sentence
        other = None if found.numbers["certain"] else _by_points(flight, source)
        if other is None or not other.numbers["certain"]:
            return found
    return other._replace(sentence=f"{why} So known points are used: {other.sentence}")


def _by_points(flight: Flight, source: str | None) -> CameraClock | None:
    """The estimate from known points; None where there is none."""
    from wildlab.analysis.camera_clock import by_points_in_words

    try:
        return by_points_in_words(flight, source)
    except WildlabError:
        return None


def _set(flight: Flight, folder: Path, offset: float) -> None:
    from dataclasses import replace

    from wildlab.flight.manifest import replace_in_manifest
    from wildlab.flight.store import save_flight

    manifest = replace_in_manifest(flight.manifest, {"clocks": {"camera_offset_s": round(offset, 4)}})
    save_flight(replace(flight, manifest=manifest), folder, overwrite=True)
