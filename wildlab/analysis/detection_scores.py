"""Detections of a run beside labels of the same frames, and detectors beside each other: what was found and
missed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis import Fact, fact
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import Interval, share_interval
from wildlab.evaluation.matching import (
    Curve,
    Rates,
    ScoredFrame,
    curve_along_score,
    difference_of_f1,
    match,
    rates,
)
from wildlab.flight.files import printable
from wildlab.flight.readers.labels import Labels, choose_classes, read_labels
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.frames import Indices, Mask

#: Probability of the ellipses that are held against labels.
ELLIPSE = 0.9
#: Columns of a table of detections.
COVARIANCE = ["cov_uu_px2", "cov_uv_px2", "cov_uv_px2", "cov_vv_px2"]
BOX = ["left_px", "top_px", "width_px", "height_px"]


@dataclass(frozen=True, eq=False)
class DetectorScore:
    """What a run is worth on labelled frames.

    Attributes
    ----------
    rates
        Precision, recall and F1 over these frames, intervals over their groups.
    things
        One row for each detection and each missed label of the judged frames: ``frame_id``, ``verdict``
        (``found``, ``invented``, ``missed`` or ``not judged``), the box (of a missed label its own) and
        ``score``.
    frames
        How many were judged.
    without_labels
        Frames of the run that the labels do not name.
    unusable
        Frames that are labelled and could not be used; their labels count as missed.
    absent
        Names of labelled frames that the run does not have; their labels count nowhere.
    outside
        Labels that lie wholly outside their image.
    ellipse
        Of the labels that were found, the share whose middle lies in the detection's `ELLIPSE`; Wilson's
        interval. None where detections have no covariance, or nothing was found. Errors of the labels count.
    """

    rates: Rates
    things: pd.DataFrame
    frames: int
    without_labels: int
    unusable: int
    absent: tuple[str, ...]
    outside: int
    ellipse: Interval | None

    def as_plain(self) -> dict[str, Any]:
        """Numbers for JSON, without those that are none.

        Returns
        -------
        dict
        """
        found: dict[str, Any] = plain_rates(self.rates)
        found |= {"frames": self.frames, "frames_without_labels": self.without_labels}
        if self.ellipse is not None:
            found["ellipse_coverage_90"] = plain_interval(self.ellipse)
        return found | {"frames_unusable": self.unusable, "labelled_frames_absent": len(self.absent)}


def plain_rates(given: Rates) -> dict[str, Any]:
    """Rates for JSON, None in place of NaN.

    Parameters
    ----------
    given
        From `wildlab.evaluation.matching.rates`.

    Returns
    -------
    dict
    """
    found: dict[str, Any] = {name: getattr(given, name) for name in ("found", "invented", "missed", "groups")}
    return found | {name: plain_interval(getattr(given, name)) for name in ("precision", "recall", "f1")}


def plain_interval(values: Sequence[float]) -> dict[str, float | None]:
    """An estimate with its interval for JSON, None in place of NaN."""
    named = zip(("estimate", "low", "high"), values, strict=True)
    return {key: round(one, 4) if np.isfinite(one) else None for key, one in named}


def rate_words(one: Mapping[str, float | None] | None, sign: str = "") -> str:
    """A rate, or a difference of two, with its interval; "" where it is not defined.

    Parameters
    ----------
    one
        ``estimate``, ``low`` and ``high``, as of `plain_rates`.
    sign
        ``+`` shows that of a difference.

    Returns
    -------
    str

    Examples
    --------
    >>> rate_words({"estimate": 0.5, "low": 0.25, "high": 0.75})
    '0.50 (0.25 to 0.75)'
    """
    if one is None or one["estimate"] is None:
        return ""
    span = "" if one["low"] is None else f" ({one['low']:{sign}.2f} to {one['high']:{sign}.2f})"
    return f"{one['estimate']:{sign}.2f}{span}"


def left_out(labels: Labels) -> list[Fact]:
    """What of a file of labels is not used."""
    parts = [f"{count} x {reason}" for reason, count in labels.marked.left_out.items()]
    return [fact("detect-left-out", parts="; ".join(parts))] if parts else []


def rates_fact(key: str, given: Mapping[str, Any], **more: str) -> Fact:
    """Rates from `plain_rates`, as a fact."""
    shown = {name: rate_words(given[name]) or "not defined" for name in ("f1", "precision", "recall")}
    counts = {name: str(given[name]) for name in ("found", "invented", "missed")}
    return fact(key, **shown, **counts, **more)


def judge_detections(detections: pd.DataFrame, frames: pd.DataFrame, labels: Labels) -> DetectorScore:
    """Hold the detections of a run against labels.

    Parameters
    ----------
    detections, frames
        As `wildlab.analysis.detectors.Detected` has them.
    labels
        Of the same frames.

    Returns
    -------
    Judged

    Raises
    ------
    WildlabError
        Where no frame of the run is labelled.
    """
    counts: list[Indices] = []
    groups: list[str] = []
    rows: list[tuple[Any, ...]] = []
    inside: list[Mask] = []
    unusable = outside = 0
    judged = judged_frames(detections, frames, labels)
    for frame, name, (width, height), problem, own, scored in judged:
        unusable += problem
        true, boxes = scored.labels, own[BOX].to_numpy(float)
        if width and height:
            beyond = (true[:, :2] >= [width, height]) | (true[:, :2] + true[:, 2:] < 0)
            outside += int(beyond.any(axis=1).sum())
        found = match(scored.boxes, true, ignore=scored.ignore)
        if set(COVARIANCE) <= set(own.columns) and len(found.pairs):
            covariance = own[COVARIANCE].to_numpy(float)[found.pairs[:, 0]].reshape(-1, 2, 2)
            middle = true[:, :2] + true[:, 2:] / 2
            off = middle[found.pairs[:, 1]] - own[["u_px", "v_px"]].to_numpy(float)[found.pairs[:, 0]]
            known = np.isfinite(covariance).all(axis=(1, 2))
            inside.append(inside_ellipse(off[known], covariance[known], ELLIPSE))
        counts.append(found.counts)
        groups.append(labels.group[name])
        verdicts = (("found", found.pairs[:, 0]), ("invented", found.invented), ("not judged", found.ignored))
        rows += [(frame, word, *boxes[row], scored.scores[row]) for word, which in verdicts for row in which]
        rows += [(frame, "missed", *true[row], np.nan) for row in found.missed]
    if not counts:
        raise labels.of_other_frames(frames["frame_id"])
    things = pd.DataFrame(rows, columns=["frame_id", "verdict", *BOX, "score"])
    absent = tuple(sorted(set(labels.boxes) - {one.name for one in judged}))
    return DetectorScore(
        rates(np.array(counts), groups), things, len(counts), len(frames) - len(counts), unusable, absent,
        outside, _share(inside),
    )  # fmt: skip


def _share(inside: list[Mask]) -> Interval | None:
    all_of = np.concatenate([np.zeros(0, bool), *inside])
    return share_interval(int(all_of.sum()), len(all_of)) if len(all_of) else None


class JudgedFrame(NamedTuple):
    """A labelled frame of a run: its name in the labels, width and height, whether it could not be used,
    the rows of its detections, and boxes about their centroids, which are what is judged."""

    frame: str
    name: str
    size: tuple[int, int]
    problem: bool
    own: pd.DataFrame
    scored: ScoredFrame


def judged_frames(detections: pd.DataFrame, frames: pd.DataFrame, labels: Labels) -> list[JudgedFrame]:
    """The frames of a run that labels name, in order."""
    by_frame = dict(tuple(detections.groupby("frame_id", sort=False))) if len(detections) else {}
    found = []
    columns = (frames[one] for one in ("frame_id", "width_px", "height_px"))
    for frame, width, height, problem in zip(*columns, frames["problem"].fillna(""), strict=True):
        name = labels.name_of(str(frame))
        if name is None:
            continue
        own, size = by_frame.get(frame, detections.iloc[:0]), (int(width), int(height))
        true, ignore = labels.boxes_of(str(frame), name, *size)
        sides = own[["width_px", "height_px"]].to_numpy(float)
        boxes = np.concatenate([own[["u_px", "v_px"]].to_numpy(float) - sides / 2, sides], axis=1)
        scored = ScoredFrame(boxes, own["score"].to_numpy(float), true, ignore)
        found.append(JudgedFrame(str(frame), name, size, bool(problem), own, scored))
    return found


NOTHING = np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class Other:
    """What another detector found.

    Attributes
    ----------
    name
        How it is called.
    boxes
        Its boxes, of the classes that are judged.
    told
        Facts on what was made of its file.
    """

    name: str
    boxes: Labels
    told: tuple[Fact, ...]


@dataclass(frozen=True, eq=False)
class Compared:
    """What a detector is worth on the frames that are judged.

    Attributes
    ----------
    name
        How it is called.
    rates
        Of all its boxes.
    curve
        Along its score; None where not each box has one.
    lowest
        The lowest score of a box that is judged; NaN where boxes have none.
    beyond
        F1 of this detector minus that of the first one, with an interval over the same draws.
    told
        Facts on what is not judged.
    """

    name: str
    rates: Rates
    curve: Curve | None
    lowest: float
    beyond: Interval
    told: tuple[Fact, ...]

    def as_plain(self) -> dict[str, Any]:
        """Numbers for JSON, None in place of NaN.

        Returns
        -------
        dict
        """

        found: dict[str, Any] = {"name": self.name, **plain_rates(self.rates)}
        found["average_precision"] = (
            None if self.curve is None else plain_interval(self.curve.average_precision)
        )
        found["lowest_score"] = self.lowest if np.isfinite(self.lowest) else None
        return found | {"f1_beyond_ours": plain_interval(self.beyond), "told": list(self.told)}


def named_file(text: str) -> tuple[str, Path]:
    """Name and file of another detector, from ``name=file`` or a file alone.

    Parameters
    ----------
    text
        As it was given; a file that is there is never taken apart.

    Returns
    -------
    str, Path

    Examples
    --------
    >>> named_file("yolo=runs/labels")
    ('yolo', PosixPath('runs/labels'))
    """
    name, sign, rest = text.partition("=")
    if sign and name and rest and not _exists(Path(text)):
        return name, Path(rest)
    return Path(text).stem or text, Path(text)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name that is too long, a folder that is closed
        return False


def read_others(
    files: Sequence[str], labels: Labels, classes: tuple[str, ...] = (), own: tuple[str, ...] = ()
) -> list[Other]:
    """Boxes of other detectors.

    Parameters
    ----------
    files
        As `named_file` takes them.
    labels
        The truth.
    classes
        Which classes of the labels are looked for.
    own
        Which classes of the other detectors are meant by that; empty takes those of the same names, or all
        where a detector has none of these.

    Returns
    -------
    list of Other

    Raises
    ------
    WildlabError
        As `read_labels`, and where two have one name, or a detector has none of its own classes.
    """
    found: list[Other] = []
    for text in files:
        name, path = named_file(text)
        if name in {one.name for one in found}:
            raise WildlabError(
                f"two detectors are called {printable(name)!r}",
                "name them, as in --also one=FILE",
            )
        every = read_labels(path, truth=labels)
        known = tuple(one for one in every.marked.known_kinds if one)
        taken = tuple(one for one in own or classes if one in known)
        if own and not taken:
            there = ", ".join(printable(one) for one in known[:20]) or "none"
            raise WildlabError(f"has none of the classes {', '.join(own)}", f"there are {there}", file=path)
        told = left_out(every)
        if classes and not taken and known:
            some = ", ".join(printable(one) for one in known[:8])
            told.append(fact("detect-all-classes", some=some, classes=", ".join(classes)))
        boxes = choose_classes(every.marked, path, taken) if taken else every
        found.append(Other(printable(name), boxes, tuple(told)))
    return found


def compare_detectors(
    name: str,
    detections: pd.DataFrame,
    others: Sequence[Other],
    frames: pd.DataFrame,
    labels: Labels,
) -> list[Compared]:
    """Our detections and those of others, each against the same labels.

    Parameters
    ----------
    name
        What ours are called.
    detections, frames
        As `wildlab.analysis.detectors.Detected` has them.
    others
        From `read_others`.
    labels
        The truth. All frames that it names and the run has are judged, for everyone.

    Returns
    -------
    list of Compared
        Ours first.

    Raises
    ------
    WildlabError
        Where a file says that a frame is of another size.
    """
    judged = judged_frames(detections, frames, labels)
    groups = [labels.group[one.name] for one in judged]
    sets: list[tuple[str, list[Any], tuple[Fact, ...]]] = [
        (name, [(one.scored.boxes, one.scored.scores) for one in judged], ())
    ]
    for other in others:
        boxes, told = _of_other(other, judged, labels.marked.relative)
        sets.append((other.name, boxes, (*other.told, *told)))
    result: list[Compared] = []
    first = None
    for called, found, told in sets:
        scored = [
            one.scored._replace(boxes=boxes, scores=scores)
            for one, (boxes, scores) in zip(judged, found, strict=True)
        ]
        counts = np.array([match(one.boxes, one.labels, ignore=one.ignore).counts for one in scored])
        first = counts if first is None else first
        scores = np.concatenate([np.zeros(0), *(one.scores for one in scored)])
        complete = bool(np.isfinite(scores).all())
        curve = curve_along_score(scored, groups) if complete else None
        lowest = float(scores.min()) if complete and len(scores) else float("nan")
        beyond = difference_of_f1(counts, first, groups)
        result.append(Compared(called, rates(counts, groups), curve, lowest, beyond, told))
    return result


def _of_other(
    other: Other, judged: list[JudgedFrame], relative: bool
) -> tuple[list[tuple[Any, Any]], tuple[Fact, ...]]:
    """Boxes and scores of each judged frame, and what is to be told of the others."""
    boxes, seen = [], set()
    without, sizeless = 0, 0
    for one in judged:
        name = other.boxes.name_of(one.frame)
        if name is None:
            without += 1
            boxes.append((NOTHING, np.zeros(0)))
            continue
        seen.add(name)
        own, scores = other.boxes.boxes_of(one.frame, name, *one.size)[0], other.boxes.scores[name]
        if not one.size[0] and (relative or other.boxes.marked.relative):
            # Shares of an image that could not be read are nowhere: boxes on it cannot be right or wrong.
            sizeless += len(own)
            own, scores = NOTHING, np.zeros(0)
        boxes.append((own, scores))
    told = list[Fact]()
    beside = {name: len(own) for name, own in other.boxes.boxes.items() if name not in seen}
    if beside:
        told.append(fact("detect-beside", boxes=sum(beside.values()), images=len(beside), judged=len(judged)))
    if without:
        told.append(fact("detect-silent", without=without, judged=len(judged)))
    if sizeless:
        told.append(fact("detect-sizeless", boxes=sizeless))
    return boxes, tuple(told)


def curve_table(compared: Sequence[Compared]) -> pd.DataFrame:
    """Precision and recall along the score, of all detectors that have scores.

    Parameters
    ----------
    compared
        From `compare_detectors`.

    Returns
    -------
    DataFrame
        ``detector``, ``score``, ``found``, ``invented``, ``missed``, ``precision``, ``recall``, ``f1``; a row
        for each level.
    """
    columns = ["detector", "score", "found", "invented", "missed", "precision", "recall", "f1"]
    rows: list[tuple[Any, ...]] = []
    for one in compared:
        if one.curve is not None:
            numbers = np.column_stack([one.curve.levels, one.curve.counts, *one.curve[2:5]])
            rows += [(one.name, *row) for row in numbers.tolist()]
    table = pd.DataFrame(rows, columns=columns)
    return table.astype({"found": int, "invented": int, "missed": int})


def facts_of(one: Compared, first: Compared) -> list[Fact]:
    """What came out for a detector beside ours, which is the first, whose rates are said already."""
    plain = one.as_plain()
    area, beyond = plain["average_precision"], plain["f1_beyond_ours"]
    found = [] if one is first else [rates_fact("detect-other", plain, name=one.name)]
    if area is not None and area["estimate"] is not None and plain["lowest_score"] is not None:
        found.append(fact("detect-average-precision", name=one.name, area=rate_words(area)))
    if one is not first and beyond["estimate"] is not None:
        found.append(fact("detect-beyond", name=one.name, first=first.name, beyond=rate_words(beyond, "+")))
    return found + [(key, values | {"name": one.name}) for key, values in one.told]
