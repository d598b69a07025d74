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
    """

    rates: Rates
    things: pd.DataFrame
    frames: int
    without_labels: int
    unusable: int
    absent: tuple[str, ...]

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
    unusable = 0
    for frame, problem in zip(frames["frame_id"], frames["problem"].fillna(""), strict=True):
        name = labels.name_of(str(frame))
        if name is None:
            continue
        named.add(name)
        unusable += bool(problem)
        own = by_frame.get(frame)
        boxes = np.zeros((0, 4)) if own is None else own[_BOX].to_numpy(float)
        scores = [] if own is None else own["score"].tolist()
        centred = boxes if own is None else _about(own, boxes)
        found = match(centred, labels.boxes[name], rule, labels.ignore[name])
        counts.append(found.counts)
        groups.append(labels.group[name])
        verdicts = (("found", found.pairs[:, 0]), ("invented", found.invented), ("not judged", found.ignored))
        rows += [(frame, word, *boxes[row], scores[row]) for word, which in verdicts for row in which]
        rows += [(frame, "missed", *labels.boxes[name][row], np.nan) for row in found.missed]
    if not counts:
        raise WildlabError(
            f"the labels name {len(labels.boxes)} frames, and none of them is here",
            "give the labels of these frames: names are file names, numbers count a clip's frames from 0",
        )
    things = pd.DataFrame(rows, columns=["frame_id", "verdict", *_BOX, "score"])
    absent = tuple(sorted(set(labels.boxes) - named))
    return Judged(
        rates(np.array(counts), groups), things, len(counts), len(frames) - len(counts), unusable, absent
    )


def _about(own: pd.DataFrame, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Boxes of the same sizes about the centroids: it is these that are the detections."""
    uv = own[["u_px", "v_px"]].to_numpy(float)
    return np.concatenate([uv - boxes[:, 2:] / 2, boxes[:, 2:]], axis=1)
