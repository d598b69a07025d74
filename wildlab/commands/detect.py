"""What is in the images of a flight: detections, pictures of them, and what they are worth beside labels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wildlab.commands import shared
from wildlab.commands.shared import ANY, FILE, FOLDER, count, print_json, sentence, shown, terminal_console

#: Overlays that the page shows, evenly over the run.
ON_PAGE = 8
#: Frames that cannot be used of which the terminal tells.
SHOWN = 10
ABOVE_ZERO = click.FloatRange(0, min_open=True)


@click.command()
@click.argument("images", type=ANY, metavar="IMAGES")
@shared.out(FOLDER, "Folder for tables and pictures.", required=True)
@click.option(
    "--method",
    type=click.Choice(["contrast", "warm", "shape", "floating", "colour"]),
    default="contrast",
    show_default=True,
)
@click.option("--labels", type=ANY, help="CSV, COCO, MegaDetector, or folder of YOLO: what was missed?")
@click.option("--fit", type=ANY, help="Labels: choose thresholds by them, judge where not chosen.")
@click.option("--also", multiple=True, metavar="[NAME=]FILE", help="Boxes of another detector, judged too.")
@click.option("--also-class", "also_classes", multiple=True, help="Class of its boxes to look for.")
@click.option("--thresholds", type=FILE, help="thresholds.json of another run.")
@click.option("--class", "classes", multiple=True, help="Class of labels to look for.")
@click.option("--group", help="Column of the labels: frames that belong together.")
@click.option("--polarity", type=click.Choice(["white-hot", "black-hot", "unknown"]), default="unknown")
@click.option("--overlays", type=click.IntRange(0, 100_000), default=40, show_default=True)
@click.option("--distance", "distance_m", type=ABOVE_ZERO, help="To the ground, m: sizes follow from it.")
@click.option("--focal", "focal_px", type=ABOVE_ZERO, help="Focal length, px; with --distance.")
@click.option("--animal", "animal_m", type=ABOVE_ZERO, default=1.5, show_default=True, help="Length, m.")
@click.option("--even", is_flag=True, help="Correct corners that are darker.")
@click.option("--boxes", type=ANY, help="Boxes of another detector, in place of a method's.")
@click.option("--tracks", is_flag=True, help="Which boxes are the same animal, and how many are there?")
@shared.as_json
def detect(as_json: bool, **asked: Any) -> None:
    """Find animals, people or vessels in IMAGES.

    A folder, one image, a video, or a flight with its images. contrast takes what stands out from what lies
    about it, warm is the chain of F 3.2, shape a classifier that has to be learnt with --fit first, floating
    the chain of H 4.3 for what floats on an even sea, and colour the blue tarpaulin of H 4.4.2 in colour
    images. Videos are MP4, MOV, AVI or MKV; a flight has them in its folder images.

    Leaves report.html, detections.csv and .parquet, frames.csv, thresholds.json, pictures in overlays, and
    with labels what was missed and invented. With --also, compared.csv has precision and recall of each
    detector along its score. With --tracks, tracks.csv says which boxes are the same animal, and the page how
    many animals there are; nothing need be known of the camera. A run that was broken off goes on where it
    stopped.

    \b
    Examples:
      wildlab detect flights/tuesday/images --out found
      wildlab detect clip.mp4 --method warm --out found
      wildlab detect clip.mp4 --tracks --out found
      wildlab detect clip.mp4 --boxes megadetector.json --tracks --out found
      wildlab detect images --distance 60 --focal 765 --animal 1.5 --out found
      wildlab detect images --fit labels.csv --class Person --out found
      wildlab detect images --labels coco.json --also megadetector=batch.json --also yolo=labels --out found
      wildlab detect sea --method floating --out found
    """
    from wildlab.analysis.detection_command import DetectRequest, detect_images
    from wildlab.flight.files import printable
    from wildlab.messages.catalogue import words

    request = DetectRequest(**asked)
    result = detect_images(request, terminal_console())
    write_page(request.out, request.images.resolve().name, result)
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
        click.echo(f"{more} cannot be used: see frames.csv.", err=True)
    for line in words("terminal", result["facts"]):
        click.echo(line)
    click.echo(shown(request.out / "report.html"))


def write_page(out: Path, name: str, result: dict[str, Any]) -> None:
    """Write ``report.html`` from what a run left in its folder.

    Parameters
    ----------
    out
        The folder.
    name
        Of what was looked at.
    result
        Of the run.
    """
    import json

    from wildlab.files import read_csv, write_atomic
    from wildlab.reporting.detections import SHEETS, detections_page

    frames = read_csv(out / "frames.csv", ("frame_id", "problem"))
    sheets = {key: (out / f"{key}.jpg").read_bytes() for key in SHEETS if key in result["pictures"]}
    # In the order of their names, which is that of the frames; a few, evenly over the run.
    drawn = sorted((out / "overlays").glob("*.jpg"))
    step = max(1, -(-len(drawn) // ON_PAGE))
    overlays = [(one.stem, one.read_bytes()) for one in drawn[::step]]
    thresholds = json.loads((out / "thresholds.json").read_text(encoding="utf-8"))["thresholds"]
    curves = read_csv(out / "compared.csv", ("detector",)) if "compared" in result else None
    tracks = read_csv(out / "tracks.csv", ("frame_id",)) if "tracks" in result else None
    page = detections_page(name, result, frames, sheets, overlays, thresholds, curves, tracks)
    write_atomic(out / "report.html", page)
