"""What `wildlab detect` does and says: fit where that is asked for, detect, judge, and leave tables and
pictures.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from wildlab.analysis import Fact, fact
from wildlab.analysis.detection_fit import (
    MOST_FRAMES,
    Fitted,
    PartFit,
    Sample,
    fit_part,
    fit_shapes,
    fit_thresholds,
    with_part,
)
from wildlab.analysis.detection_scores import (
    BOX,
    ELLIPSE,
    DetectorScore,
    compare_detectors,
    curve_table,
    facts_of,
    judge_detections,
    left_out,
    plain_rates,
    rates_fact,
    read_others,
)
from wildlab.analysis.detectors import (
    METHODS,
    Detected,
    GivenBoxes,
    for_distance,
    read_thresholds,
    run_detection,
    write_thresholds,
)
from wildlab.analysis.tracks.video import camera_motion, track_video
from wildlab.detection.detections import PART
from wildlab.detection.warm import to_grey
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import Interval
from wildlab.files import write_atomic, write_csv, write_json
from wildlab.flight.clocks import frame_times
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.frames import CORRECTIONS, Frame, Frames, Polarity, open_frames
from wildlab.flight.readers.labels import Labels, read_labels
from wildlab.flight.store import load_flight
from wildlab.geometry.frames import Array

#: Detections an image from which on defaults are said to fit badly: more than anyone looks through.
MANY = 10
#: Images that tracks need at least: fewer than a track is believed from.
FEWEST_TRACKED = 3


#: Bytes of an earlier run's result.json at most.
MOST_BYTES = 50_000_000


@dataclass(frozen=True)
class DetectRequest:
    """What was asked for.

    Attributes
    ----------
    images, out
        Where frames are, and where what comes out goes.
    method
        One of `wildlab.analysis.detectors.METHODS`.
    labels
        By which the detections are judged.
    fit
        By which the thresholds are chosen.
    thresholds
        A file that an earlier run wrote.
    classes, group
        As for `wildlab.flight.readers.labels.read_labels`.
    polarity
        Of the camera.
    overlays
        How many pictures.
    distance_m, focal_px, animal_m
        From the camera to the ground, focal length, and length of what is looked for: they give the
        thresholds their lengths. None where that is not known.
    also
        Files of other detectors, ``name=file`` or a file alone, that are judged beside ours.
    also_classes
        Which of their classes are meant; empty takes those of the labels' names, or all.
    even
        Whether the fall of brightness towards the corners is taken off first.
    boxes
        A file of another detector, whose boxes are taken in place of a method's.
    tracks
        Whether it is asked which boxes are the same animal, and how many animals there are.
    """

    images: Path
    out: Path
    method: str = "contrast"
    labels: Path | None = None
    fit: Path | None = None
    thresholds: Path | None = None
    classes: tuple[str, ...] = ()
    group: str | None = None
    polarity: Polarity = "unknown"
    overlays: int = 40
    distance_m: float | None = None
    focal_px: float | None = None
    animal_m: float = 1.5
    also: tuple[str, ...] = ()
    also_classes: tuple[str, ...] = ()
    even: bool = False
    boxes: Path | None = None
    tracks: bool = False


def detect_images(request: DetectRequest, console: Console) -> dict[str, Any]:
    """Detect in images, and write tables and pictures.

    Parameters
    ----------
    request
        What was asked for.
    console
        Where progress is shown.

    Returns
    -------
    dict
        For JSON: numbers, problems of frames, and facts, whose words are in
        ``data/messages/en/terminal.toml``.

    Raises
    ------
    WildlabError
        Where images, labels or thresholds cannot be used.
    """
    if request.fit and request.thresholds:
        raise WildlabError("thresholds are both named and to be fitted", "leave --fit or --thresholds out")
    if request.method == "shape" and not (request.fit or request.thresholds):
        raise WildlabError(
            "a classifier of shapes has to be learnt first",
            "give --fit with labels, or --thresholds of such a run",
        )
    if request.boxes and (request.fit or request.thresholds):
        problem = "boxes that are given have no thresholds"
        raise WildlabError(problem, "leave out --boxes, or --fit and --thresholds", file=request.boxes)
    if (request.classes or request.group) and not (request.labels or request.fit or request.boxes):
        raise WildlabError(
            "there are no labels whose classes or groups are meant", "give --labels or --fit, or leave it out"
        )
    if request.also and not request.labels:
        raise WildlabError(
            "another detector can be judged by labels only", "give --labels, or leave --also out"
        )
    if request.also_classes and not request.also:
        raise WildlabError("there is no other detector whose classes these are", "give its file with --also")
    if (request.distance_m is None) is not (request.focal_px is None):
        raise WildlabError(
            "the distance to the ground and the focal length are of use together", "give both, or neither"
        )
    _refuse_folder(request)
    frames = _open(request)
    labels = _labels(request.labels, request)
    boxes = (
        None if request.boxes is None else read_labels(request.boxes, classes=request.classes, truth=labels)
    )
    to_fit = _labels(request.fit, request)
    others = (
        [] if labels is None else read_others(request.also, labels, request.classes, request.also_classes)
    )
    thresholds: Any = METHODS[request.method].thresholds()
    if boxes is not None:
        request = replace(request, method="boxes")
        thresholds = GivenBoxes(boxes.path.name, sha256(repr(boxes.boxes).encode()).hexdigest())
    elif request.distance_m is not None and request.focal_px is not None:
        if request.fit or request.thresholds:
            raise WildlabError(
                "lengths come from a distance and from a fit", "leave --distance or the other out"
            )
        thresholds = for_distance(
            request.method, thresholds, request.distance_m, request.focal_px, request.animal_m
        )
    if request.thresholds:
        thresholds = read_thresholds(request.thresholds, request.method)
    request.out.mkdir(parents=True, exist_ok=True)
    fitted, part = None, None
    if to_fit is not None:
        with _progress(console, "choosing thresholds", None) as tell:
            samples = samples_of(frames, to_fit)
            by_shape = request.method == "shape"
            fitted = (
                fit_shapes(samples, tell=tell)
                if by_shape
                else fit_thresholds(request.method, samples, tell=tell)
            )
        thresholds = fitted.thresholds
        part = fit_part(request.method, samples, thresholds)
        if part is not None and np.isfinite(part.part):
            thresholds = with_part(thresholds, part.part)
    write_thresholds(request.out / "thresholds.json", request.method, thresholds)
    with _progress(console, "detecting", frames.count) as tell:
        detected = run_detection(
            frames, request.out, request.method, thresholds, lambda done: tell(done, None), boxes
        )
    if boxes is not None and not any(boxes.name_of(one) for one in detected.frames["frame_id"]):
        raise boxes.of_other_frames(detected.frames["frame_id"])
    tracks = None
    (request.out / "tracks.csv").unlink(missing_ok=True)
    usable = int((detected.frames["problem"].fillna("") == "").sum())
    if request.tracks and usable < FEWEST_TRACKED:
        raise WildlabError(
            f"{usable} images can be used, and what is the same animal shows over {FEWEST_TRACKED} at least",
            "leave --tracks out, or give a video",
            file=request.images,
            field="--tracks",
        )
    if request.tracks:
        with _progress(console, "tracking", frames.count) as tell:
            tracks, tracked = _tracks(request, frames, detected, lambda done: tell(done, None))
    judged = judge_detections(detected.detections, detected.frames, labels) if labels is not None else None
    things = detected.detections.assign(verdict="detected") if judged is None else judged.things
    names = [str(one) for one in detected.frames["frame_id"]]
    with _progress(console, "drawing", None) as tell:
        pictures = write_pictures(
            frames, names, things, request.out, request.overlays, lambda done: tell(done, None), tracks
        )
    result = _result(request, thresholds, detected, judged, fitted, part, pictures, labels)
    chosen = bool(request.fit or request.thresholds or request.distance_m is not None)
    result["notes"] = [
        *facts_of_frames(frames, detected),
        *too_few_or_many(request.method, request.polarity, len(detected.detections), usable, chosen=chosen),
    ]
    result["facts"] = [*result["notes"], *result["facts"]]
    if tracks is not None:
        result["tracks"] = tracked
        result["facts"] += _facts_of_tracks(request, tracked)
    if others and labels is not None:
        ours = f"wildlab {request.method}" if boxes is None else printable(boxes.path.name)
        compared = compare_detectors(ours, detected.detections, others, detected.frames, labels)
        result["compared"] = [one.as_plain() for one in compared]
        result["facts"] += [line for one in compared for line in facts_of(one, compared[0])]
        write_csv(request.out / "compared.csv", curve_table(compared))
    write_json(request.out / "result.json", result)
    return result


def _tracks(
    request: DetectRequest, frames: Frames, detected: Detected, tell: Callable[[int], None]
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Write ``tracks.csv``; its table, and what is told of it."""
    found = detected.detections
    boxes = {str(name): own[BOX].to_numpy(float) for name, own in found.groupby("frame_id", sort=False)}

    def told() -> Iterator[Frame]:
        for done, frame in enumerate(frames, start=1):
            tell(done)
            yield frame

    to_first, unmoved = camera_motion(told(), boxes)
    if request.distance_m is not None and request.focal_px is not None:
        metres_per_px = request.distance_m / request.focal_px
    else:
        longest = found[["width_px", "height_px"]].max(axis=1)
        metres_per_px = request.animal_m / float(longest.median()) if len(found) else 1.0
    table, animals = track_video(found, detected.frames, to_first, metres_per_px)
    write_csv(request.out / "tracks.csv", table)
    count = {"animals": animals.mean, "low": animals.low, "high": animals.high}
    usable = detected.frames["problem"].fillna("") == ""
    untimed = bool(detected.frames.loc[usable, "time_s"].isna().any())
    return table, {"tracks": int(table["track"].nunique()), **count, "unmoved": unmoved, "untimed": untimed}


def _facts_of_tracks(request: DetectRequest, tracked: Mapping[str, Any]) -> list[Fact]:
    animals = {"animals": f"{tracked['animals']:.1f}", "low": tracked["low"], "high": tracked["high"]}
    found = [fact("detect-tracks", tracks=tracked["tracks"], **animals)]
    if tracked["unmoved"]:
        found.append(fact("detect-unmoved", n=tracked["unmoved"]))
    if tracked["untimed"]:
        found.append(fact("detect-untimed"))
    if (request.images / "flight.toml").is_file() and load_flight(request.images).nav:
        found.append(fact("detect-poses"))
    return found


def _refuse_folder(request: DetectRequest) -> None:
    """Results neither among the images, where the next run would read them, nor over another folder's."""
    images = request.images.resolve()
    if request.out.resolve() in (images, images / "images"):
        raise WildlabError(
            "the results would count as images the next time",
            "name another folder with --out",
            file=request.out,
        )
    earlier = request.out / "result.json"
    try:
        given = json.loads(read_regular(earlier, MOST_BYTES))
        before = given.get("of") if isinstance(given, dict) else None
    except (FileNotFoundError, ValueError, WildlabError):
        return
    if isinstance(before, str) and before != _place(images):
        raise WildlabError(
            f"the folder holds what was found in another folder, {printable(str(given.get('images')))}",
            "name another folder with --out, or remove this one",
            file=request.out,
        )


def _place(images: Path) -> str:
    """By which a folder is known again, without its path being told to whoever gets the results."""
    return sha256(str(images.resolve()).encode("utf-8", "surrogateescape")).hexdigest()[:16]


def _open(request: DetectRequest) -> Frames:
    """Frames; with flight times where they are those of a flight folder, whose images lie in ``images``."""
    if not (request.images / "flight.toml").is_file():
        return open_frames(request.images, polarity=request.polarity, even=request.even)
    inside = request.images / "images"
    if not inside.is_dir():
        raise WildlabError(
            "this flight has no folder 'images'",
            "put its images there, or name their own folder",
            file=inside,
        )
    flight = load_flight(request.images)
    frames = open_frames(inside, polarity=request.polarity, even=request.even)
    if flight.frames is None:
        return frames
    known = dict(zip(flight.frames["frame_id"].astype(str), frame_times(flight), strict=True))
    # Images may be named with or without their ending.
    names = {one.name: one.name if one.name in known else one.stem for one in frames.files}
    own = {file: (name, float(known[name])) for file, name in names.items() if name in known}
    return replace(frames, known=own)


def samples_of(frames: Frames, labels: Labels) -> list[Sample]:
    """Labelled frames that can be used, at most `MOST_FRAMES` of them, evenly taken.

    Parameters
    ----------
    frames, labels
        Of the same folder or clip.

    Returns
    -------
    list of Sample
    """
    step = max(1, -(-len(labels.boxes) // MOST_FRAMES))
    found = []
    seen = 0
    strange: list[str] = []
    for frame in frames:
        name = labels.name_of(frame.name)
        if name is None:
            strange.append(frame.name)
        if name is None or not frame.usable:
            continue
        seen += 1
        if (seen - 1) % step:
            continue
        height, width = frame.image.shape[:2]
        boxes, ignore = labels.boxes_of(frame.name, name, width, height)
        found.append(Sample(frame, boxes, ignore, labels.group[name]))
    if strange and not seen:
        raise labels.of_other_frames(strange)
    return found


def _labels(path: Path | None, request: DetectRequest) -> Labels | None:
    return None if path is None else read_labels(path, classes=request.classes, group=request.group)


def _result(
    request: DetectRequest,
    thresholds: Any,
    detected: Detected,
    judged: DetectorScore | None,
    fitted: Fitted | None,
    part: PartFit | None,
    pictures: dict[str, int],
    labels: Labels | None,
) -> dict[str, Any]:
    problems = detected.frames[detected.frames["problem"].fillna("") != ""]
    result: dict[str, Any] = {
        "method": request.method,
        "images": request.images.resolve().name,
        "of": _place(request.images),
        "frames": {
            "all": len(detected.frames),
            "usable": len(detected.frames) - len(problems),
            "kept": detected.kept,
        },
        "detections": len(detected.detections),
        "problems": [
            [str(a), str(b)] for a, b in zip(problems["frame_id"], problems["problem"], strict=True)
        ],
        "pictures": pictures,
        "facts": [],
    }
    said: list[Fact] = result["facts"]
    if detected.kept:
        said.append(fact("detect-kept", kept=detected.kept))
    if fitted is not None:
        result["fit"] = {
            "sets_tried": fitted.tried,
            "held_out": plain_rates(fitted.held_out),
            "where_chosen": plain_rates(fitted.inside),
            "defaults": plain_rates(fitted.defaults),
        }
        without = "unlearnt" if request.method == "shape" else "defaults"
        for key, name in (("held-out", "held_out"), ("where-chosen", "where_chosen"), (without, "defaults")):
            said.append(rates_fact(f"detect-{key}", result["fit"][name]))
        if part is not None:
            result["fit"]["ellipses"] = part.as_plain()
            said.append(part_fact(part))
    if judged is not None and labels is not None:
        result["judged"] = judged.as_plain()
        chosen_here = fitted is not None and request.labels == request.fit
        result["chosen_here"] = chosen_here
        key = "detect-labels-too-good" if chosen_here else "detect-labels"
        said.append(rates_fact(key, result["judged"]))
        by_these = chosen_here and part is not None and np.isfinite(part.part)
        if judged.ellipse is not None and not by_these:
            share = judged.ellipse
            word = "small" if share.high < ELLIPSE else "large" if share.low > ELLIPSE else "right"
            said.append(fact(f"detect-ellipses-{word}", **_percent(share)))
        said += left_out(labels)
        scores = np.concatenate([np.zeros(0), *labels.scores.values()])
        if np.isfinite(scores).any():
            low, high = np.nanmin(scores), np.nanmax(scores)
            said.append(fact("detect-scored", low=f"{low:.2g}", high=f"{high:.2g}"))
        kinds = labels.marked.known_kinds
        if len(kinds) > 1 and not request.classes:
            some = ", ".join(printable(one) for one in kinds[:5])
            said.append(fact("detect-classes", n=len(kinds), some=some))
        said += not_judged(judged)
    return result


def _percent(share: Interval) -> dict[str, str]:
    return {name: f"{100 * one:.0f}" for name, one in zip(("share", "low", "high"), share, strict=True)}


def part_fact(fit: PartFit) -> Fact:
    """What part of the length was chosen for ellipses, from how many labels, and what it holds of others."""
    if not np.isfinite(fit.part):
        return fact("detect-part-default", part=f"{100 * PART:.3g}", labels=fit.labels)
    part = f"{100 * fit.part:.2g}"
    if fit.held_out is None:
        return fact("detect-part-untried", part=part, labels=fit.labels)
    return fact("detect-part", part=part, labels=fit.labels, **_percent(fit.held_out))


def not_judged(judged: DetectorScore) -> list[Fact]:
    """Frames and labels that say nothing, or count as missed for a reason of their own."""
    counts = {
        "without-labels": judged.without_labels, "outside": judged.outside, "unusable": judged.unusable,
    }  # fmt: skip
    found = [fact(f"detect-{key}", n=n) for key, n in counts.items() if n]
    if judged.absent:
        first = ", ".join(printable(one) for one in judged.absent[:3])
        found.append(fact("detect-absent", n=len(judged.absent), first=first))
    return found


def too_few_or_many(method: str, polarity: Polarity, found: int, usable: int, *, chosen: bool) -> list[Fact]:
    """What may be wrong where nothing is found, or more than can be looked through.

    Parameters
    ----------
    method, polarity
        As they were asked for.
    found, usable
        Detections, and frames that could be used.
    chosen
        Whether thresholds were chosen for these images.

    Returns
    -------
    list of Fact

    Examples
    --------
    >>> too_few_or_many("warm", "unknown", 900, 30, chosen=True)
    []
    """
    if usable and not found and method != "colour" and polarity != "black-hot":
        return [fact("detect-nothing")]
    if usable and found > MANY * usable and not chosen:
        return [fact("detect-many", each=f"{found / usable:.0f}")]
    return []


def facts_of_frames(frames: Frames, detected: Detected) -> list[Fact]:
    """What was found of the camera itself: its shutter, its pixels, its corners."""
    kept = frames.kept
    found = [fact("detect-note", note=f"{note[0].upper()}{note[1:]}") for note in kept.notes]
    problems = detected.frames["problem"].fillna("").astype(str)
    corrections = int(problems.str.contains("|".join(CORRECTIONS)).sum())
    if corrections:
        found.append(fact("detect-corrections", n=corrections, of=len(problems)))
    if kept.dead is not None and kept.dead.any():
        found.append(fact("detect-dead", n=int(kept.dead.sum())))
    if kept.vignetting is not None:
        v = kept.vignetting
        key = "detect-corners-darker" if v.corner < 0 else "detect-corners-brighter"
        found.append(fact(key, corner=f"{abs(v.corner):.3g}", sd=f"{v.sd:.2g}", images=v.images))
    elif frames.even:
        found.append(fact("detect-corners-unknown"))
    return found


@contextmanager
def _progress(console: Console, what: str, total: int | None) -> Iterator[Callable[[int, int | None], None]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TextColumn(
            "{task.completed:.0f} of {task.total:.0f} frames" if total else "{task.completed:.0f} frames"
        ),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(what, total=total)
        yield lambda done, of: progress.update(task, completed=done, total=of or total)


Picture = NDArray[np.uint8]

#: Blue, green, red; of Okabe and Ito's palette, told apart by the colour-blind too.
COLOURS = {
    "found": (115, 158, 0),
    "invented": (0, 94, 213),
    "missed": (66, 228, 240),
    "not judged": (160, 160, 160),
    "detected": (233, 180, 86),
}
#: px of the image that a tile of a sheet shows, what it is enlarged to, and how many stand in a row.
AROUND, TILE, IN_A_ROW = 64, 160, 8
#: Tiles on one sheet at most.
MOST_TILES = 80
#: Of what was found, fewer: these are looked through, not searched for a mistake.
MOST_FOUND = 40


def overlay_picture(frame: Frame, things: pd.DataFrame, tracks: pd.DataFrame | None = None) -> Picture:
    """A frame with what was found in it, and the numbers of tracks.

    Parameters
    ----------
    frame
        One that can be used.
    things
        Rows with ``left_px``, ``top_px``, ``width_px``, ``height_px`` and ``verdict``, a word of `COLOURS`.
    tracks
        Rows with a box and ``track``.

    Returns
    -------
    (H, W, 3) uint8
        Blue, green, red. What is not valid is hatched.
    """
    picture = _picture(frame)
    hatched = ~frame.valid & (np.add.outer(*(np.arange(n) for n in frame.valid.shape)) % 8 < 2)
    picture[hatched] = (90, 60, 60)
    boxes = things[BOX].to_numpy(float)
    for box, verdict in zip(boxes, things["verdict"], strict=True):
        near, far = np.rint(box[:2] - 5).astype(int), np.rint(box[:2] + box[2:] + 5).astype(int)
        cv2.rectangle(picture, near.tolist(), far.tolist(), COLOURS[str(verdict)], 1, cv2.LINE_AA)
    for name, left, top in [] if tracks is None else tracks[["track", *BOX[:2]]].to_numpy():
        place = (int(left) - 5, int(top) - 8)
        cv2.putText(
            picture, f"{name:.0f}", place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, COLOURS["missed"], 1, cv2.LINE_AA
        )
    return picture


def contact_sheet(tiles: list[tuple[Picture, str, str]]) -> Picture:
    """Small pictures in rows, each with a line below it.

    Parameters
    ----------
    tiles
        (picture (TILE, TILE, 3), line, word of `COLOURS` for its frame).

    Returns
    -------
    (H, W, 3) uint8
    """
    below, gap = 18, 4
    rows = max(1, -(-len(tiles) // IN_A_ROW))
    height, width = rows * (TILE + below + gap) + gap, IN_A_ROW * (TILE + gap) + gap
    sheet = np.full((height, width, 3), 255, np.uint8)
    for number, (picture, line, word) in enumerate(tiles):
        top = gap + (number // IN_A_ROW) * (TILE + below + gap)
        left = gap + (number % IN_A_ROW) * (TILE + gap)
        sheet[top : top + TILE, left : left + TILE] = picture
        cv2.rectangle(sheet, (left, top), (left + TILE - 1, top + TILE - 1), COLOURS[word], 2)
        text = "".join(sign if sign.isascii() and sign.isprintable() else "?" for sign in line)[-26:]
        place = (left, top + TILE + below - 5)
        cv2.putText(sheet, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.36, (0, 0, 0), 1, cv2.LINE_AA)
    return sheet


def cut_tile(frame: Frame, box: Array, colour: tuple[int, int, int]) -> Picture:
    """The surroundings of a box, enlarged.

    Parameters
    ----------
    frame
        Whose.
    box
        (4,) left, top, width, height, px.
    colour
        Of the box.

    Returns
    -------
    (TILE, TILE, 3) uint8
    """
    side = int(max(AROUND, 2 * max(box[2], box[3])))
    centre = (float(box[0] + box[2] / 2), float(box[1] + box[3] / 2))
    scale = TILE / side
    turn = np.array([[scale, 0, TILE / 2 - scale * centre[0]], [0, scale, TILE / 2 - scale * centre[1]]])
    tile = cv2.warpAffine(_picture(frame), turn, (TILE, TILE), borderValue=(200, 200, 200))
    corner = scale * (box[:2] - centre) + TILE / 2
    far = corner + scale * box[2:]
    first, second = ((int(one[0]), int(one[1])) for one in (corner - 3, far + 3))
    cv2.rectangle(tile, first, second, colour, 1, cv2.LINE_AA)
    return np.asarray(tile, np.uint8)


def write_pictures(
    frames: Frames,
    names: Sequence[str],
    things: pd.DataFrame,
    into: Path,
    most: int,
    tell: Callable[[int], None] | None = None,
    tracks: pd.DataFrame | None = None,
) -> dict[str, int]:
    """Overlay pictures of some frames, evenly over the flight, and sheets of what was missed and invented.

    Parameters
    ----------
    frames
        Where they come from; only those that are drawn are read.
    names
        Of all frames, in order.
    things
        ``frame_id``, ``verdict``, the box and ``score``; from
        `wildlab.analysis.detection_scores.DetectorScore`, or all ``detected``.
    into
        Folder: ``overlays/NAME.jpg``, ``missed.jpg``, ``invented.jpg``, and ``found.jpg``, or
        ``detected.jpg`` where nothing is judged.
    most
        How many overlays.
    tell
        Called with the number of frames that were drawn.
    tracks
        As of `wildlab.analysis.tracks.video.track_video`: their numbers are drawn.

    Returns
    -------
    dict
        How many overlays there are, and tiles on each sheet that was written.
    """
    folder = into / "overlays"
    folder.mkdir(parents=True, exist_ok=True)
    files = picture_names(names)
    for file in files.values():
        # Of an earlier run: only what has a frame's name is taken away.
        (folder / file).unlink(missing_ok=True)
    evenly = np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int) if names else ()
    drawn = {names[number] for number in evenly}
    chosen = {word: _most_telling(things, word) for word in ("found", "detected", "missed", "invented")}
    on_sheets = {str(one) for rows in chosen.values() for one in things.loc[rows, "frame_id"]}
    wanted = [number for number, name in enumerate(names) if name in drawn or name in on_sheets]
    by_frame = dict(tuple(things.groupby("frame_id", sort=False))) if len(things) else {}
    tiles: dict[str, list[tuple[float, Picture, str]]] = {word: [] for word in chosen}
    overlays = 0
    for done, frame in enumerate(frames.some(wanted), start=1):
        if tell:
            tell(done)
        if not frame.usable:
            continue
        own = by_frame.get(frame.name, things.iloc[:0])
        if frame.name in drawn:
            numbers = None if tracks is None else tracks[tracks["frame_id"] == frame.name]
            write_atomic(folder / files[frame.name], _jpeg(overlay_picture(frame, own, numbers)))
            overlays += 1
        for word, rows in chosen.items():
            some = own.loc[own.index.intersection(rows)]
            ranks = np.nan_to_num(some["score"].to_numpy(float))
            for box, rank in zip(some[BOX].to_numpy(float), ranks, strict=True):
                tiles[word].append((float(rank), cut_tile(frame, box, COLOURS[word]), frame.name))
    counts = {"overlays": overlays}
    for word, cut in tiles.items():
        (into / f"{word}.jpg").unlink(missing_ok=True)
        if cut:
            ranked = sorted(cut, key=lambda one: -one[0])
            sheet = contact_sheet([(picture, name, word) for _, picture, name in ranked])
            write_atomic(into / f"{word}.jpg", _jpeg(sheet))
            counts[word] = len(cut)
    return counts


def _most_telling(things: pd.DataFrame, word: str) -> Any:
    """Which rows go on a sheet: the surest of what was invented, the first of what was missed, and some of
    all scores of what was found."""
    some = things[things["verdict"] == word].sort_values("score", ascending=False, kind="stable").index
    if word in ("found", "detected") and len(some) > MOST_FOUND:
        return some[np.linspace(0, len(some) - 1, MOST_FOUND).round().astype(int)]
    return some[:MOST_TILES]


def picture_names(names: Sequence[str]) -> dict[str, str]:
    """File names of the pictures of frames; a number tells those apart that would get the same.

    Parameters
    ----------
    names
        Of frames, in their order.

    Returns
    -------
    dict
        By the name of the frame.

    Examples
    --------
    >>> list(picture_names(["a.png", "a.jpg", "b c.png"]).values())
    ['a.jpg', 'a-2.jpg', 'b_c.jpg']
    """
    taken: set[str] = set()
    found = {}
    for name in dict.fromkeys(names):
        stem = file = safe_stem(name)
        number = 1
        # Names that differ in their case alone are one file on some systems.
        while file.lower() in taken:
            number += 1
            file = f"{stem}-{number}"
        taken.add(file.lower())
        found[name] = f"{file}.jpg"
    return found


def safe_stem(name: str) -> str:
    """A frame's name as that of a file on every system.

    Parameters
    ----------
    name
        Of a frame.

    Returns
    -------
    str

    Examples
    --------
    >>> safe_stem("DJI 01.JPG"), safe_stem("clip#000012")
    ('DJI_01', 'clip_000012')
    """
    stem = Path(name).stem if "#" not in name else name
    return "".join(sign if sign.isascii() and (sign.isalnum() or sign in "-_") else "_" for sign in stem)[
        :120
    ]


def _picture(frame: Frame) -> Picture:
    """(H, W, 3) blue, green, red, whatever the frame measures."""
    if frame.image.ndim == 3:
        return np.ascontiguousarray(frame.image[..., ::-1])
    shown = np.where(np.isfinite(frame.image), frame.image, np.nanmedian(frame.image))
    return np.asarray(cv2.cvtColor(to_grey(shown.astype(frame.image.dtype)), cv2.COLOR_GRAY2BGR), np.uint8)


def _jpeg(picture: Picture) -> bytes:
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes())
