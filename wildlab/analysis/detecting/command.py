"""What `wildlab detect` does and says: fit where that is asked for, detect, judge, and leave tables and
pictures.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from wildlab.analysis.detecting.detect import (
    METHODS,
    Detected,
    for_distance,
    read_thresholds,
    run_detection,
    write_thresholds,
)
from wildlab.analysis.detecting.fit import (
    MOST_FRAMES,
    Fitted,
    PartFit,
    Sample,
    fit_part,
    fit_shapes,
    fit_thresholds,
    part_sentence,
    with_part,
)
from wildlab.analysis.detecting.pictures import write_pictures
from wildlab.analysis.detecting.scores import (
    DetectorScore,
    compare_detectors,
    compared_sentences,
    curve_table,
    ellipse_sentence,
    judge_detections,
    labels_sentences,
    plain_rates,
    rates_sentence,
    read_others,
)
from wildlab.detection.detections import PART
from wildlab.errors import WildlabError
from wildlab.files import write_csv, write_json
from wildlab.flight.clocks import frame_times
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.frames import Frames, Polarity, open_frames
from wildlab.flight.readers.frames.sequence import CORRECTIONS
from wildlab.flight.readers.labels import Labels, read_labels
from wildlab.flight.store import load_flight

#: Detections an image from which on defaults are said to fit badly: more than anyone looks through.
MANY = 10


def not_judged(judged: DetectorScore) -> list[str]:
    """Sentences on frames and labels that say nothing, or count as missed for a reason of their own.

    Parameters
    ----------
    judged
        A run beside its labels.

    Returns
    -------
    list of str
    """
    said = []
    if judged.without_labels:
        said.append(f"{judged.without_labels} of the frames are not judged: the labels do not name them.")
    if judged.outside:
        said.append(
            f"{judged.outside} labels lie wholly outside their image and count as missed: are they of these "
            "images, at this size?"
        )
    if judged.unusable:
        said.append(f"{judged.unusable} labelled frames could not be used; what is labelled there is missed.")
    if judged.absent:
        first = ", ".join(printable(one) for one in judged.absent[:3])
        more = len(judged.absent) - 3
        said.append(
            f"{len(judged.absent)} labelled frames are not here and count nowhere: {first}"
            + (f" and {more} more." if more > 0 else ".")
        )
    return said


def too_few_or_many(method: str, polarity: Polarity, found: int, usable: int, *, chosen: bool) -> list[str]:
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
    list of str

    Examples
    --------
    >>> too_few_or_many("warm", "unknown", 900, 30, chosen=True)
    []
    """
    if not usable:
        return []
    if not found and method != "colour" and polarity != "black-hot":
        return ["Nothing stands out as warm. Where what is warm looks dark, say --polarity black-hot."]
    if found > MANY * usable and not chosen:
        return [
            f"That is {found / usable:.0f} an image: the defaults fit no camera in particular. Sizes follow "
            "from --distance and --focal, and --fit chooses thresholds from labels."
        ]
    return []


def frames_said(frames: Frames, detected: Detected) -> list[str]:
    """Sentences on what was found of the camera itself: its shutter, its pixels, its corners.

    Parameters
    ----------
    frames
        That were looked at.
    detected
        What came out of them.

    Returns
    -------
    list of str
        None of them where there is nothing to be said.
    """
    kept = frames.kept
    said = [f"{note[0].upper()}{note[1:]}." for note in kept.notes]
    problems = detected.frames["problem"].fillna("").astype(str)
    corrections = problems.str.contains("|".join(CORRECTIONS)).sum()
    if corrections:
        said.append(f"Taken during a flat-field correction: {corrections} of {len(problems)} frames.")
    if kept.dead is not None and kept.dead.any():
        number = int(kept.dead.sum())
        word = "1 pixel does not" if number == 1 else f"{number} pixels do not"
        said.append(f"{word} see the scene and {'is' if number == 1 else 'are'} masked.")
    if frames.even and kept.vignetting is None:
        said.append("No fall of brightness towards the corners could be measured, and none is taken off.")
    elif kept.vignetting is not None:
        corner, sd = kept.vignetting.corner, kept.vignetting.sd
        word = "darker" if corner < 0 else "brighter"
        said.append(
            f"The corners are {abs(corner):.3g} (standard deviation {sd:.2g}) {word} than the middle, by "
            f"{kept.vignetting.images} frames; that is taken off."
        )
    return said


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
        One of `wildlab.analysis.detecting.detect.METHODS`.
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
        For JSON: numbers, problems of frames, and sentences to be printed.

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
    if (request.classes or request.group) and not (request.labels or request.fit):
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
    to_fit = _labels(request.fit, request)
    others = (
        [] if labels is None else read_others(request.also, labels, request.classes, request.also_classes)
    )
    thresholds = METHODS[request.method].thresholds()
    if request.distance_m is not None and request.focal_px is not None:
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
            frames, request.out, request.method, thresholds, lambda done: tell(done, None)
        )
    judged = judge_detections(detected.detections, detected.frames, labels) if labels is not None else None
    things = _as_found(detected.detections) if judged is None else judged.things
    names = [str(one) for one in detected.frames["frame_id"]]
    with _progress(console, "drawing", None) as tell:
        pictures = write_pictures(
            frames, names, things, request.out, request.overlays, lambda done: tell(done, None)
        )
    result = _result(request, thresholds, detected, judged, fitted, part, pictures, labels)
    usable = result["frames"]["usable"]
    chosen = bool(request.fit or request.thresholds or request.distance_m is not None)
    result["notes"] = [
        *frames_said(frames, detected),
        *too_few_or_many(request.method, request.polarity, len(detected.detections), usable, chosen=chosen),
    ]
    result["sentences"] = [*result["notes"], *result["sentences"]]
    if others and labels is not None:
        ours = f"wildlab {request.method}"
        compared = compare_detectors(ours, detected.detections, others, detected.frames, labels)
        result["compared"] = [one.as_plain() for one in compared]
        result["sentences"] += [line for one in compared for line in compared_sentences(one, compared[0])]
        write_csv(request.out / "compared.csv", curve_table(compared))
    write_json(request.out / "result.json", result)
    return result


def _refuse_folder(request: DetectRequest) -> None:
    """Results neither among the images, where the next run would read them, nor over another folder's."""
    images = request.images.resolve()
    if request.out.resolve() in (images, images / "images"):
        raise WildlabError(
            "the results would lie among the images, and count as images the next time",
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
    for frame in frames:
        name = labels.name_of(frame.name)
        if name is None or not frame.usable:
            continue
        seen += 1
        if (seen - 1) % step:
            continue
        height, width = frame.image.shape[:2]
        boxes, ignore = labels.boxes_of(frame.name, name, width, height)
        found.append(Sample(frame, boxes, ignore, labels.group[name]))
    return found


def _labels(path: Path | None, request: DetectRequest) -> Labels | None:
    return None if path is None else read_labels(path, classes=request.classes, group=request.group)


def _as_found(detections: pd.DataFrame) -> pd.DataFrame:
    columns = ["frame_id", "left_px", "top_px", "width_px", "height_px", "score"]
    return detections[columns].assign(verdict="detected")


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
        "sentences": [],
    }
    say = result["sentences"]
    if detected.kept:
        say.append(f"{detected.kept} frames are kept from an earlier run with the same settings.")
    if fitted is not None:
        result["fit"] = {
            "sets_tried": fitted.tried,
            "held_out": plain_rates(fitted.held_out),
            "where_chosen": plain_rates(fitted.inside),
            "defaults": plain_rates(fitted.defaults),
        }
        say.append(
            f"On frames that thresholds were not chosen from: {rates_sentence(result['fit']['held_out'])}"
        )
        say.append(f"Where they were chosen: {rates_sentence(result['fit']['where_chosen'])}")
        without = "Without a classifier" if request.method == "shape" else "With the defaults"
        say.append(f"{without}: {rates_sentence(result['fit']['defaults'])}")
        if part is not None:
            result["fit"]["ellipses"] = part.as_plain()
            say.append(part_sentence(part, PART))
    if judged is not None and labels is not None:
        result["judged"] = judged.as_plain()
        chosen_here = fitted is not None and request.labels == request.fit
        result["chosen_here"] = chosen_here
        where = (
            "Beside the labels that the thresholds were chosen by (too good)"
            if chosen_here
            else "Beside the labels"
        )
        say.append(f"{where}: {rates_sentence(result['judged'])}")
        by_these = chosen_here and part is not None and np.isfinite(part.part)
        if "ellipse_coverage_90" in result["judged"] and not by_these:
            say.append(ellipse_sentence(result["judged"]["ellipse_coverage_90"]))
        say += labels_sentences(labels)
        kinds = labels.marked.known_kinds
        if len(kinds) > 1 and not request.classes:
            some = ", ".join(printable(one) for one in kinds[:5])
            say.append(f"Labels of {len(kinds)} classes count alike ({some}); --class chooses.")
        if judged.without_labels or judged.unusable or judged.absent:
            say += not_judged(judged)
    return result


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
