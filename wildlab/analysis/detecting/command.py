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

from wildlab.analysis import Fact, fact
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
    with_part,
)
from wildlab.analysis.detecting.pictures import write_pictures
from wildlab.analysis.detecting.scores import (
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
from wildlab.detection.detections import PART
from wildlab.errors import WildlabError
from wildlab.evaluation.runs import Interval
from wildlab.files import write_csv, write_json
from wildlab.flight.clocks import frame_times
from wildlab.flight.files import printable, read_regular
from wildlab.flight.readers.frames import Frames, Polarity, open_frames
from wildlab.flight.readers.frames.sequence import CORRECTIONS
from wildlab.flight.readers.labels import Labels, read_labels
from wildlab.flight.store import load_flight

#: Detections an image from which on defaults are said to fit badly: more than anyone looks through.
MANY = 10


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
        *facts_of_frames(frames, detected),
        *too_few_or_many(request.method, request.polarity, len(detected.detections), usable, chosen=chosen),
    ]
    result["facts"] = [*result["notes"], *result["facts"]]
    if others and labels is not None:
        ours = f"wildlab {request.method}"
        compared = compare_detectors(ours, detected.detections, others, detected.frames, labels)
        result["compared"] = [one.as_plain() for one in compared]
        result["facts"] += [line for one in compared for line in facts_of(one, compared[0])]
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
