"""Detections of a run beside labels of the same frames: what was found, missed and invented."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.matching import Rates, Rule, match, rates
from wildlab.evaluation.runs import Interval, share_interval
from wildlab.flight.readers.labels import Labels
from wildlab.geometry.ellipses import inside_ellipse

#: Probability of the ellipses that are held against labels.
ELLIPSE = 0.9
_COVARIANCE = ["cov_uu_px2", "cov_uv_px2", "cov_uv_px2", "cov_vv_px2"]
_BOX = ["left_px", "top_px", "width_px", "height_px"]


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
            names = zip(("estimate", "low", "high"), self.ellipse, strict=True)
            found["ellipse_coverage_90"] = {name: round(value, 4) for name, value in names}
        return found | {"frames_unusable": self.unusable, "labelled_frames_absent": len(self.absent)}


def ellipse_sentence(share: Mapping[str, float]) -> str:
    """Whether the stated ellipses of pixels can be believed.

    Parameters
    ----------
    share
        ``estimate``, ``low`` and ``high`` of what they hold.

    Returns
    -------
    str

    Examples
    --------
    >>> ellipse_sentence({"estimate": 0.6, "low": 0.5, "high": 0.7})
    'The stated 90 % ellipses hold the middle of 60 % (50 to 70) of the labels found: they are too small.'
    """
    word = (
        "they are too small" if share["high"] < ELLIPSE else "they are too large" if share["low"] > ELLIPSE
        else "90 % is within that"
    )  # fmt: skip
    span = f"{100 * share['estimate']:.0f} % ({100 * share['low']:.0f} to {100 * share['high']:.0f})"
    return f"The stated 90 % ellipses hold the middle of {span} of the labels found: {word}."


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
        return f"{name} {rate_words(rates[name]) or 'not defined'}"

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
) -> DetectorScore:
    """Hold the detections of a run against labels.

    Parameters
    ----------
    detections, frames
        As `wildlab.analysis.detect.Detected` has them.
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
    inside: list[NDArray[np.bool_]] = []
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
        if own is not None and set(_COVARIANCE) <= set(own.columns) and len(found.pairs):
            covariance = own[_COVARIANCE].to_numpy(float)[found.pairs[:, 0]].reshape(-1, 2, 2)
            middle = true[:, :2] + true[:, 2:] / 2
            off = middle[found.pairs[:, 1]] - own[["u_px", "v_px"]].to_numpy(float)[found.pairs[:, 0]]
            known = np.isfinite(covariance).all(axis=(1, 2))
            inside.append(inside_ellipse(off[known], covariance[known], ELLIPSE))
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
    return DetectorScore(
        rates(np.array(counts), groups), things, len(counts), len(frames) - len(counts), unusable, absent,
        outside, _share(inside),
    )  # fmt: skip


def _share(inside: list[NDArray[np.bool_]]) -> Interval | None:
    all_of = np.concatenate([np.zeros(0, bool), *inside])
    return share_interval(int(all_of.sum()), len(all_of)) if len(all_of) else None


def boxes_by_frame(
    detections: pd.DataFrame,
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Boxes about the centroids, and scores, by the name of the frame.

    Parameters
    ----------
    detections
        As `wildlab.analysis.detect.Detected` has them.

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
