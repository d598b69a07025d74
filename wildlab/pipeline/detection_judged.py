"""Detections of a run beside labels of the same frames: what was found, missed and invented."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.matching import Rates, Rule, match, rates
from wildlab.flight.readers.labels import Labels

_BOX = ["left_px", "top_px", "width_px", "height_px"]


@dataclass(frozen=True, eq=False)
class Judged:
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
    """

    rates: Rates
    things: pd.DataFrame
    frames: int
    without_labels: int
    unusable: int
    absent: tuple[str, ...]
    outside: int

    def as_plain(self) -> dict[str, Any]:
        """Numbers for JSON, without those that are none.

        Returns
        -------
        dict
        """
        found: dict[str, Any] = plain_rates(self.rates)
        found |= {"frames": self.frames, "frames_without_labels": self.without_labels}
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
    for name in ("precision", "recall", "f1"):
        value = getattr(given, name)
        numbers = zip(("estimate", "low", "high"), value, strict=True)
        found[name] = {key: round(number, 4) if np.isfinite(number) else None for key, number in numbers}
    return found


def rates_sentence(rates: dict[str, Any]) -> str:
    """Rates as a line that is printed.

    Parameters
    ----------
    rates
        From `plain_rates`.

    Returns
    -------
    str
    """

    def shown(name: str) -> str:
        one = rates[name]
        if one["estimate"] is None:
            return f"{name} not defined"
        span = "" if one["low"] is None else f" ({one['low']:.2f} to {one['high']:.2f})"
        return f"{name} {one['estimate']:.2f}{span}"

    counts = f"{rates['found']} found, {rates['invented']} invented, {rates['missed']} missed"
    return f"{shown('f1')}, {shown('precision')}, {shown('recall')}; {counts}.".replace("f1", "F1")


def labels_sentences(labels: Labels) -> list[str]:
    """What of a file of labels is not used, and what it says that truth does not have.

    Parameters
    ----------
    labels
        The truth.

    Returns
    -------
    list of str
    """
    said = [f"{count} x {reason}" for reason, count in labels.marked.left_out.items()]
    found = [f"Left out of the labels: {'; '.join(said)}."] if said else []
    scores = np.concatenate([np.zeros(0), *labels.scores.values()])
    scores = scores[np.isfinite(scores)]
    if len(scores):
        found.append(
            f"The labels have scores ({scores.min():.2g} to {scores.max():.2g}), and all are taken for true."
        )
    return found


def judge_detections(
    detections: pd.DataFrame, frames: pd.DataFrame, labels: Labels, rule: Rule | None = None
) -> Judged:
    """Hold the detections of a run against labels.

    Parameters
    ----------
    detections, frames
        As `wildlab.pipeline.detect.Detected` has them.
    labels
        Of the same frames.
    rule
        When a detection and a label belong together.

    Returns
    -------
    Judged

    Raises
    ------
    WildlabError
        Where no frame of the run is labelled.
    """
    by_frame = dict(tuple(detections.groupby("frame_id", sort=False))) if len(detections) else {}
    counts: list[NDArray[np.intp]] = []
    groups: list[str] = []
    rows: list[tuple[Any, ...]] = []
    named = set()
    unusable = outside = 0
    columns = (frames[one] for one in ("frame_id", "width_px", "height_px"))
    for frame, width, height, problem in zip(*columns, frames["problem"].fillna(""), strict=True):
        name = labels.name_of(str(frame))
        if name is None:
            continue
        named.add(name)
        unusable += bool(problem)
        own = by_frame.get(frame)
        boxes = np.zeros((0, 4)) if own is None else own[_BOX].to_numpy(float)
        scores = [] if own is None else own["score"].tolist()
        centred = boxes if own is None else _about(own, boxes)
        true, ignore = labels.boxes_of(str(frame), name, int(width), int(height))
        if width and height:
            beyond = (true[:, :2] >= [width, height]) | (true[:, :2] + true[:, 2:] < 0)
            outside += int(beyond.any(axis=1).sum())
        found = match(centred, true, rule, ignore)
        counts.append(found.counts)
        groups.append(labels.group[name])
        verdicts = (("found", found.pairs[:, 0]), ("invented", found.invented), ("not judged", found.ignored))
        rows += [(frame, word, *boxes[row], scores[row]) for word, which in verdicts for row in which]
        rows += [(frame, "missed", *true[row], np.nan) for row in found.missed]
    if not counts:
        raise WildlabError(
            f"the labels name {len(labels.boxes)} frames, and none of them is here",
            "give the labels of these frames: names are file names, numbers count a clip's frames from 0",
        )
    things = pd.DataFrame(rows, columns=["frame_id", "verdict", *_BOX, "score"])
    absent = tuple(sorted(set(labels.boxes) - named))
    return Judged(
        rates(np.array(counts), groups), things, len(counts), len(frames) - len(counts), unusable, absent,
        outside,
    )  # fmt: skip


def boxes_by_frame(
    detections: pd.DataFrame,
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Boxes about the centroids, and scores, by the name of the frame.

    Parameters
    ----------
    detections
        As `wildlab.pipeline.detect.Detected` has them.

    Returns
    -------
    dict
        (N, 4) left, top, width, height, px, and (N,).
    """
    if not len(detections):
        return {}
    return {
        str(frame): (_about(own, own[_BOX].to_numpy(float)), own["score"].to_numpy(float))
        for frame, own in detections.groupby("frame_id", sort=False)
    }


def _about(own: pd.DataFrame, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Boxes of the same sizes about the centroids: it is these that are the detections."""
    uv = own[["u_px", "v_px"]].to_numpy(float)
    return np.concatenate([uv - boxes[:, 2:] / 2, boxes[:, 2:]], axis=1)
