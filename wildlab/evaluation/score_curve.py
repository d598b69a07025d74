"""What detections are worth as their score is asked to be higher: precision beside recall, and their area.

At each score the detections of at least that score are matched anew by the rule of
`wildlab.evaluation.matching`, so that one curve and one table of rates rest on the same pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.matching import Rule, group_draws, group_sums, match, percentile, shares
from wildlab.evaluation.runs import Interval

Array = NDArray[np.float64]

#: Scores that a curve is computed at, at most; of more distinct ones evenly many lie between any two.
MOST_LEVELS = 200
#: Recalls that average precision is a mean over, as in the evaluation of COCO.
RECALLS = np.linspace(0, 1, 101)


class ScoredFrame(NamedTuple):
    """One frame with what was found and what is true.

    Attributes
    ----------
    boxes
        (N, 4) left, top, width, height, px.
    scores
        (N,).
    labels, ignore
        (M, 4) and (I, 4): what is in it, and where it is not judged.
    """

    boxes: Array
    scores: Array
    labels: Array
    ignore: Array


class Curve(NamedTuple):
    """What detections are worth along their score.

    Attributes
    ----------
    levels
        (L,) scores, falling; detections of at least that score are taken.
    counts
        (L, 3) found, invented and missed.
    precision, recall, f1
        (L,) shares; NaN where there is nothing to divide by.
    average_precision
        Mean over `RECALLS` of the largest precision at that recall or a larger one, 0 where none is reached;
        with a 95 % interval over clips.
    """

    levels: Array
    counts: Array
    precision: Array
    recall: Array
    f1: Array
    average_precision: Interval


def score_levels(scores: ArrayLike, most: int = MOST_LEVELS) -> Array:
    """Scores to compute a curve at: all that occur, or as many as wanted, with the first and the last.

    Parameters
    ----------
    scores
        (N,), finite.
    most
        How many at most, 2 or more.

    Returns
    -------
    (L,)
        Falling.

    Examples
    --------
    >>> score_levels([0.2, 0.9, 0.2, 0.5]).tolist()
    [0.9, 0.5, 0.2]
    """
    known = np.unique(np.asarray(scores, float))[::-1]
    if len(known) <= most:
        return known
    return np.asarray(known[np.unique(np.linspace(0, len(known) - 1, most).round().astype(int))])


def curve_along_score(
    frames: Sequence[ScoredFrame], groups: Sequence[object] | None = None, rule: Rule | None = None
) -> Curve:
    """Precision and recall of detections along their score.

    Parameters
    ----------
    frames
        All frames that are judged, those without detections too.
    groups
        (F,) to which clip a frame belongs; None takes each for its own.
    rule
        When a detection and a label belong together.

    Returns
    -------
    Curve
        Without any level where there is no detection; its average precision is then 0.

    Raises
    ------
    WildlabError
        Where a score is not finite, or there is not one group for each frame.

    Examples
    --------
    >>> box = np.array([[0.0, 0.0, 4.0, 4.0], [90.0, 90.0, 4.0, 4.0]])
    >>> one = ScoredFrame(box, np.array([0.9, 0.4]), box[:1], np.zeros((0, 4)))
    >>> curve = curve_along_score([one])
    >>> curve.precision.tolist(), curve.recall.tolist(), curve.average_precision.estimate
    ([1.0, 0.5], [1.0, 1.0], 1.0)
    """
    every = np.concatenate([np.zeros(0), *(one.scores for one in frames)])
    if not np.isfinite(every).all():
        raise WildlabError("a score is no number", "give each detection one, or leave the curve out")
    levels = score_levels(every)
    counts = np.zeros((len(frames), len(levels), 3))
    for row, one in enumerate(frames):
        taken = (one.scores[None] >= levels[:, None]).sum(axis=1)
        order = np.argsort(-one.scores, kind="stable")
        of_count = {
            int(count): match(one.boxes[order[:count]], one.labels, rule, one.ignore).counts
            for count in np.unique(taken)
        }
        counts[row] = np.array([of_count[int(count)] for count in taken]).reshape(-1, 3)
    sums = group_sums(counts, groups)
    whole = sums.sum(axis=0)
    labelled = float(sum(len(one.labels) for one in frames))
    estimate = average_precision(whole) if labelled and len(levels) else 0.0 if labelled else np.nan
    low = high = np.nan
    weights = group_draws(len(sums))
    if weights is not None and labelled and len(levels):
        drawn = np.tensordot(weights, sums, axes=1)
        areas = np.array([average_precision(one) for one in drawn])
        low, high = percentile(areas, 2.5), percentile(areas, 97.5)
    precision, recall, f1 = shares(whole).T
    return Curve(levels, whole, precision, recall, f1, Interval(float(estimate), low, high))


def average_precision(counts: Array) -> float:
    """Area below precision beside recall, as COCO's evaluation takes it.

    Parameters
    ----------
    counts
        (L, 3) found, invented and missed at falling scores.

    Returns
    -------
    float
        From 0 to 1; NaN where nothing is labelled.

    Examples
    --------
    >>> round(average_precision(np.array([[1.0, 0, 1], [1, 1, 1], [2, 1, 0]])), 3)
    0.835
    """
    precision, recall, _ = shares(counts).T
    if not len(recall) or not np.isfinite(recall).all():
        return float("nan")
    best = np.maximum.accumulate(np.nan_to_num(precision)[::-1])[::-1]
    # A recall of 3 in 10 reaches 0.3, however that is rounded.
    at = np.searchsorted(recall, RECALLS - 1e-9)
    return float(np.append(best, 0.0)[at].mean())


def difference_of_f1(
    counts: ArrayLike, others: ArrayLike, groups: Sequence[object] | None = None
) -> Interval:
    """F1 of one detector minus that of another on the same frames, with an interval over the same draws.

    Clips that are hard for one are hard for the other: the difference is better known than either. Draws know
    nothing of what no clip shows yet; of few clips that all differ alike they give too narrow an interval.

    Parameters
    ----------
    counts, others
        (F, 3) found, invented and missed of each frame.
    groups
        (F,) to which clip a frame belongs; None takes each for its own.

    Returns
    -------
    Interval
        Without limits below `wildlab.evaluation.matching.FEWEST` clips.

    Raises
    ------
    WildlabError
        Where there is not one group for each frame.
    """
    a, b = (group_sums(np.asarray(one, float).reshape(-1, 3), groups) for one in (counts, others))
    estimate = float(shares(a.sum(axis=0))[2] - shares(b.sum(axis=0))[2])
    weights = group_draws(len(a))
    if weights is None:
        return Interval(estimate, float("nan"), float("nan"))
    drawn = shares(weights @ a)[:, 2] - shares(weights @ b)[:, 2]
    return Interval(estimate, percentile(drawn, 2.5), percentile(drawn, 97.5))
