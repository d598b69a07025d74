"""Detections against labels: which belong together, and what share was found, with intervals.

A label is a box; a point is a box without extent. A detection and a label belong together where their centres
are near, one to one, so that the sum of the distances is smallest. Frames of a clip are alike: intervals draw
clips, or frames where each is a clip of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import Interval, share_interval

Array = NDArray[np.float64]
Index = NDArray[np.intp]

#: How far apart the centres of a small label and its detection are at most.
TOLERANCE_PX = 10.0
#: Draws of a bootstrap, and the fewest clips that it can draw from: of fewer it is far too narrow.
DRAWS, FEWEST = 2000, 5


class Matches(NamedTuple):
    """One frame.

    Attributes
    ----------
    pairs
        (K, 2) rows of detections and of labels that belong together.
    invented
        Rows of detections that belong to no label.
    missed
        Rows of labels that belong to no detection.
    ignored
        Rows of detections that belong to no label and lie in a region that is not judged.
    """

    pairs: Index
    invented: Index
    missed: Index
    ignored: Index

    @property
    def counts(self) -> Index:
        """(3,) found, invented and missed."""
        return np.array([len(self.pairs), len(self.invented), len(self.missed)])


def match(found: ArrayLike, labels: ArrayLike, ignore: ArrayLike | None = None) -> Matches:
    """Detections and labels of one frame that belong together.

    Centres are apart by `TOLERANCE_PX` at most, or half of the label's diagonal where that is more.

    Parameters
    ----------
    found
        (N, 4) boxes: left, top, width, height, px; or (N, 2) points.
    labels
        (M, 4) or (M, 2), likewise.
    ignore
        (I, 4) boxes whose content is not judged: a detection with its centre inside one is neither right nor
        wrong, unless it belongs to a label.

    Returns
    -------
    Matches

    Raises
    ------
    WildlabError
        Where boxes are neither (N, 4) nor (N, 2), or not finite.

    Examples
    --------
    >>> match([[0, 0, 10, 10], [80, 80, 4, 4]], [[2, 0, 10, 10]]).counts.tolist()
    [1, 1, 0]
    """
    a, b = _boxes(found, "detections"), _boxes(labels, "labels")
    apart = np.linalg.norm(_centres(a)[:, None] - _centres(b)[None], axis=2)
    reach = np.maximum(TOLERANCE_PX, np.hypot(b[:, 2], b[:, 3]) / 2)
    cost, allowed = apart / reach, apart <= reach
    # A pair that is not allowed costs as much as all that are, so that as many as possible belong together.
    rows, columns = linear_sum_assignment(np.where(allowed, cost, 1.0 + min(len(a), len(b)) * 2.0))
    fits = allowed[rows, columns]
    pairs = np.stack([rows[fits], columns[fits]], axis=1).astype(np.intp)
    alone = np.setdiff1d(np.arange(len(a)), pairs[:, 0])
    inside = _inside(_centres(a[alone]), _boxes([] if ignore is None else ignore, "regions"))
    missed = np.setdiff1d(np.arange(len(b)), pairs[:, 1])
    return Matches(pairs, alone[~inside], missed, alone[inside])


class Rates(NamedTuple):
    """What was found, with 95 % intervals.

    Attributes
    ----------
    precision, recall, f1
        Shares from 0 to 1; NaN where there is nothing to divide by.
    found, invented, missed
        How many, over all frames.
    groups
        How many clips or frames the intervals draw from; below `FEWEST` there are none.
    """

    precision: Interval
    recall: Interval
    f1: Interval
    found: int
    invented: int
    missed: int
    groups: int


def rates(counts: ArrayLike, groups: Sequence[object] | None = None) -> Rates:
    """Precision, recall and F1 over frames, with intervals by drawing clips with replacement.

    Draws know nothing of an error that has not been seen yet: of 16 found of 16 they give 1 to 1. So an
    interval is never narrower than Wilson's of as many independent things; F1 is the share of found in
    found and half of the errors.

    Parameters
    ----------
    counts
        (F, 3) found, invented and missed of each frame, as of `Matches.counts`.
    groups
        (F,) to which clip a frame belongs; None takes each for its own.

    Returns
    -------
    Rates

    Raises
    ------
    WildlabError
        Where counts are not (F, 3), or there is not one group for each frame.

    Examples
    --------
    >>> round(rates([[8, 2, 2], [8, 2, 2]]).f1.estimate, 2)
    0.8
    """
    sums = group_sums(np.asarray(counts, float).reshape(-1, 3), groups)
    of_all = shares(sums.sum(axis=0))
    weights = group_draws(len(sums))
    if weights is not None:
        drawn = shares(weights @ sums)
        with np.errstate(invalid="ignore"):
            low, high = (np.array([percentile(column, at) for column in drawn.T]) for at in (2.5, 97.5))
    else:
        low = high = np.full(3, np.nan)
    found, invented, missed = (int(one) for one in sums.sum(axis=0))
    of = (found + invented, found + missed, found + (invented + missed) / 2)
    if weights is not None:
        at_least = [share_interval(found, max(n, 1)) if n else (np.nan,) * 3 for n in of]
        low = np.fmin(low, [one[1] for one in at_least])
        high = np.fmax(high, [one[2] for one in at_least])
    one = [Interval(float(e), float(a), float(b)) for e, a, b in zip(of_all, low, high, strict=True)]
    return Rates(one[0], one[1], one[2], found, invented, missed, len(sums))


def group_sums(counts: Array, groups: Sequence[object] | None = None) -> Array:
    """Counts of frames summed over the clips that they belong to.

    Parameters
    ----------
    counts
        (F, ...) of each frame.
    groups
        (F,) to which clip a frame belongs; None takes each for its own.

    Returns
    -------
    (G, ...)

    Raises
    ------
    WildlabError
        Where there is not one group for each frame.
    """
    names = list(range(len(counts))) if groups is None else list(groups)
    if len(names) != len(counts):
        raise WildlabError(
            f"{len(counts)} frames have counts and {len(names)} have a clip", "give one clip for each frame"
        )
    place = {name: row for row, name in enumerate(dict.fromkeys(names))}
    sums = np.zeros((len(place), *counts.shape[1:]))
    np.add.at(sums, [place[name] for name in names], counts)
    return sums


def group_draws(groups: int) -> Array | None:
    """How often each clip is in each draw with replacement, the same for the same number of clips.

    Parameters
    ----------
    groups
        How many clips there are.

    Returns
    -------
    (DRAWS, G) or None
        None below `FEWEST` clips.
    """
    if groups < FEWEST:
        return None
    rng = np.random.default_rng(1)
    return rng.multinomial(groups, np.full(groups, 1 / groups), DRAWS).astype(float)


def percentile(values: Array, at: float) -> float:
    """Percentile of what is finite.

    Parameters
    ----------
    values
        (N,).
    at
        0 to 100.

    Returns
    -------
    float
        NaN where nothing is finite.
    """
    some = values[np.isfinite(values)]
    return float(np.percentile(some, at)) if len(some) else float("nan")


def shares(sums: Array) -> Array:
    """Precision, recall and F1 of counts.

    Parameters
    ----------
    sums
        (..., 3) found, invented and missed.

    Returns
    -------
    (..., 3)
        NaN where there is nothing to divide by.

    Examples
    --------
    >>> shares(np.array([3.0, 1.0, 2.0])).round(2).tolist()
    [0.75, 0.6, 0.67]
    """
    found, invented, missed = np.moveaxis(np.asarray(sums, float), -1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.stack(
            [
                found / (found + invented),
                found / (found + missed),
                2 * found / (2 * found + invented + missed),
            ],
            axis=-1,
        )


def _boxes(given: ArrayLike, what: str) -> Array:
    boxes = np.asarray(given, float)
    if not boxes.size:
        return np.zeros((0, 4))
    if boxes.ndim != 2 or boxes.shape[1] not in (2, 4):
        raise WildlabError(f"the {what} have the shape {boxes.shape}", "give (N, 4) boxes or (N, 2) points")
    if not np.isfinite(boxes).all():
        raise WildlabError(f"the {what} hold numbers that are none", "leave such rows out")
    return boxes if boxes.shape[1] == 4 else np.concatenate([boxes, np.zeros_like(boxes)], axis=1)


def _centres(boxes: Array) -> Array:
    return np.asarray(boxes[:, :2] + boxes[:, 2:] / 2)


def _inside(points: Array, boxes: Array) -> NDArray[np.bool_]:
    beyond = points[:, None] - boxes[None, :, :2]
    within = np.all((beyond >= 0) & (beyond <= boxes[None, :, 2:]), axis=2)
    return np.asarray(np.any(within, axis=1))


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


def score_levels(scores: ArrayLike) -> Array:
    """Scores to compute a curve at: all that occur, or `MOST_LEVELS`, with the first and the last.

    Parameters
    ----------
    scores
        (N,), finite.

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
    if len(known) <= MOST_LEVELS:
        return known
    return np.asarray(known[np.unique(np.linspace(0, len(known) - 1, MOST_LEVELS).round().astype(int))])


def curve_along_score(frames: Sequence[ScoredFrame], groups: Sequence[object] | None = None) -> Curve:
    """Precision and recall of detections along their score.

    Parameters
    ----------
    frames
        All frames that are judged, those without detections too.
    groups
        (F,) to which clip a frame belongs; None takes each for its own.

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
            int(count): match(one.boxes[order[:count]], one.labels, one.ignore).counts
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
