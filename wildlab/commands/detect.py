"""What is in the images of a flight: detections, pictures of them, and what they are worth beside labels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wildlab.commands.shared import FILE, FOLDER, terminal_console
from wildlab.terminal import count, print_json, sentence, shown

ANY = click.Path(path_type=Path)
#: Overlays that the page shows, evenly over the run.
ON_PAGE = 8
#: Frames that cannot be used of which the terminal tells.
SHOWN = 10
ABOVE_ZERO = click.FloatRange(0, min_open=True)


@click.command(short_help="Find animals, people or vessels in images or a video.")
@click.argument("images", type=ANY, metavar="IMAGES")
@click.option("--into", type=FOLDER, required=True, help="Folder for tables and pictures.")
@click.option(
    "--method",
    type=click.Choice(["contrast", "warm", "shape", "floating", "colour"]),
    default="contrast",
    show_default=True,
)
@click.option(
    "--labels",
    type=ANY,
    help="Boxes or points in these images (CSV, COCO, MegaDetector, folder of YOLO): what was missed, what "
    "invented?",
)
@click.option(
    "--fit", type=ANY, help="Labels likewise: choose the thresholds by them, and judge them where not chosen."
)
@click.option(
    "--also",
    multiple=True,
    metavar="[NAME=]FILE",
    help="Boxes of another detector, with scores or without: judged beside ours by the same labels.",
)
@click.option(
    "--also-class", "also_classes", multiple=True, help="Class of the other detectors that is looked for."
)
@click.option("--thresholds", type=FILE, help="thresholds.json of another run, in place of the defaults.")
@click.option(
    "--class", "classes", multiple=True, help="Class of labels that is looked for; others are not judged."
)
@click.option(
    "--group", help="Column of the labels (field of COCO's images) that says which frames belong together."
)
@click.option("--polarity", type=click.Choice(["white-hot", "black-hot", "unknown"]), default="unknown")
@click.option(
    "--overlays", type=click.IntRange(0, 100_000), default=40, show_default=True, help="How many pictures."
)
@click.option("--distance", type=ABOVE_ZERO, help="From the camera to the ground, m: sizes follow from it.")
@click.option("--focal", type=ABOVE_ZERO, help="Focal length, px; with --distance.")
@click.option(
    "--animal", type=ABOVE_ZERO, default=1.5, show_default=True, help="Length of what is looked for, m."
)
@click.option(
    "--even", is_flag=True, help="Take off first that corners are darker, as far as the frames tell."
)
@click.option("--json", "as_json", is_flag=True, help="What came out, as JSON.")
def detect(
    images: Path,
    into: Path,
    method: str,
    labels: Path | None,
    fit: Path | None,
    also: tuple[str, ...],
    also_classes: tuple[str, ...],
    thresholds: Path | None,
    classes: tuple[str, ...],
    group: str | None,
    polarity: Any,
    overlays: int,
    distance: float | None,
    focal: float | None,
    animal: float,
    even: bool,
    as_json: bool,
) -> None:
    """Find warm or floating things in IMAGES: a folder of images, one image, a video (MP4, MOV, AVI,
    MKV), or a flight with a folder images.

    contrast takes what stands out from what lies about it, warm is the chain of F 3.2, shape a classifier
    that has to be learnt with --fit first, floating the chain of H 4.3 for what floats on an even sea, and
    colour the blue tarpaulin of H 4.4.2 in colour images.

    Leaves report.html, detections.csv and .parquet, frames.csv, thresholds.json, pictures in overlays, and
    with labels what was missed and invented. With --also, compared.csv has precision and recall of each
    detector along its score. A run that was broken off goes on where it stopped.

    \b
    Examples:
      wildlab detect flights/tuesday/images --into found
      wildlab detect clip.mp4 --method warm --into found
      wildlab detect images --distance 60 --focal 765 --animal 1.5 --into found
      wildlab detect images --fit labels.csv --class Person --into found
      wildlab detect images --labels coco.json --also megadetector=batch.json --also yolo=labels --into found
      wildlab detect sea --method floating --into found
    """
    from wildlab.analysis.detecting.command import Wanted, detect_images
    from wildlab.flight.files import printable

    wanted = Wanted(
        images,
        into,
        method,
        labels,
        fit,
        thresholds,
        classes,
        group,
        polarity,
        overlays,
        distance,
        focal,
        animal,
        also,
        also_classes,
        even,
    )
    result = detect_images(wanted, terminal_console())
    write_page(into, images.resolve().name, result)
    if as_json:
        print_json(result)
        return
    of = result["frames"]
    said = f"{count(result['detections'], 'detection')} in {count(of['usable'], 'frame')} of {of['all']}"
    click.echo(sentence(said))
    problems = result["problems"]
    for name, problem in problems[:SHOWN]:
        click.echo(f"{printable(name)}: {problem}", err=True)
    if len(problems) > SHOWN:
        more = count(len(problems) - SHOWN, "more frame")
        click.echo(f"{more} cannot be used; frames.csv says why of each.", err=True)
    for line in result["sentences"]:
        click.echo(line)
    click.echo(shown(into / "report.html"))


def write_page(into: Path, name: str, result: dict[str, Any]) -> None:
    """Write ``report.html`` from what a run left in its folder.

    Parameters
    ----------
    into
        The folder.
    name
        Of what was looked at.
    result
        Of the run.
    """
    import json

    from wildlab.files import read_csv, write_atomic
    from wildlab.reporting.detections import SHEETS, detections_page

    frames = read_csv(into / "frames.csv", ("frame_id", "problem"))
    sheets = {key: (into / f"{key}.jpg").read_bytes() for key in SHEETS if key in result["pictures"]}
    # In the order of their names, which is that of the frames; a few, evenly over the run.
    drawn = sorted((into / "overlays").glob("*.jpg"))
    step = max(1, -(-len(drawn) // ON_PAGE))
    overlays = [(one.stem, one.read_bytes()) for one in drawn[::step]]
    thresholds = json.loads((into / "thresholds.json").read_text(encoding="utf-8"))["thresholds"]
    curves = read_csv(into / "compared.csv", ("detector",)) if "compared" in result else None
    page = detections_page(name, result, frames, sheets, overlays, thresholds, curves)
    write_atomic(into / "report.html", page)
