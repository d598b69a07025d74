"""Thresholds chosen from labelled frames, and judged on frames that they were not chosen from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.detecting.detect import detect_frame
from wildlab.analysis.detecting.methods import METHODS
from wildlab.detection.contrast import Contrast
from wildlab.detection.thresholds import FloatingThresholds
from wildlab.detection.warm import Warm
from wildlab.errors import WildlabError
from wildlab.evaluation.matching import Rates, Rule, match, rates
from wildlab.flight.readers.frames import Frame

Array = NDArray[np.float64]

#: What is tried of each threshold. Lengths in px and levels go up by about a half, as what they gain does.
GRIDS: dict[str, dict[str, tuple[Any, ...]]] = {
    "contrast": {
        "window_px": (31, 61, 101),
        "smooth_px": (0.7, 1.0, 2.0),
        "deviation": ("image", "window"),
        "peak": (4.0, 6.0, 9.0, 13.0, 18.0, 26.0),
        "edge": (2.5, 4.0),
        "of_peak": (0.0, 0.3, 0.5, 0.6),
        "of_image": (0.0, 0.3, 0.6),
        "smallest_px": (4.0, 10.0, 20.0, 40.0, 80.0),
        "largest_px": (300.0, 600.0, 1200.0, 4000.0),
        "longest": (2.5, 4.0, 8.0),
    },
    "warm": {
        "background": ("none", "enhance", "mean", "median"),
        "threshold": ("constant", "adaptive"),
        "level": (25.0, 40.0, 65.0, 90.0, 120.0, 160.0, 200.0),
        "level_is": ("floor", "offset"),
        "block_px": (51, 101, 251, 451),
        "smallest_px": (4.0, 10.0, 20.0, 40.0, 80.0),
        "largest_px": (300.0, 600.0, 1200.0, 4000.0),
        "apart_px": (0.0, 10.0, 20.0),
    },
    "floating": {
        "gradient": (60.0, 110.0, 160.0, 230.0),
        "gradient_gain": (0.5, 1.0, 2.0, 4.0),
        "scaling": ("fixed", "stretched"),
        "smallest_range_k": (2.0, 4.0, 8.0),
        "smallest_area": (5.0, 15.0, 50.0, 120.0),
        "largest_area": (None, 1000.0, 4000.0),
        "area_of": ("edges", "filled"),
        "nested": ("boxes", "contours"),
    },
}
#: Sets of thresholds that are tried, the defaults among them; and most labelled frames that are looked at.
TRIED, MOST_FRAMES = 160, 200


@dataclass(frozen=True, eq=False)
class Sample:
    """One labelled frame.

    Attributes
    ----------
    frame
        One that can be used.
    boxes, ignore
        (N, 4) and (I, 4): what is in it, and where it is not judged.
    group
        What it is alike to: folds keep these together.
    """

    frame: Frame
    boxes: Array
    ignore: Array
    group: str


@dataclass(frozen=True, eq=False)
class Fitted:
    """Thresholds, and what choosing them so is worth.

    Attributes
    ----------
    thresholds
        Chosen by all samples.
    held_out
        Over all samples, each judged with thresholds that were chosen without its group.
    inside
        Over all samples with the thresholds that were chosen by them: too good.
    defaults
        Over all samples with the defaults.
    counts
        (F, 3) found, invented and missed of each sample, held out.
    chosen
        By group: the thresholds that its samples were judged with.
    tried
        How many sets of thresholds.
    """

    thresholds: Any
    held_out: Rates
    inside: Rates
    defaults: Rates
    counts: NDArray[np.intp]
    chosen: dict[str, Any]
    tried: int


def candidates(method: str, count: int = TRIED, seed: int = 1) -> list[Any]:
    """Sets of thresholds to try: the defaults, then each threshold drawn from `GRIDS`, none twice.

    Parameters
    ----------
    method
        One of `wildlab.analysis.detection_methods.METHODS`.
    count
        How many at most.
    seed
        Of the draws.

    Returns
    -------
    list
        Of the method's thresholds.

    Raises
    ------
    WildlabError
        Where there is nothing to choose for the method.
    """
    if method not in GRIDS:
        raise WildlabError(
            f"there is nothing to fit for the method {method!r}", f"take one of {', '.join(GRIDS)}"
        )
    rng = np.random.default_rng(seed)
    found = [METHODS[method].thresholds()]
    for _ in range(50 * count):
        if len(found) >= count:
            break
        drawn = {name: values[rng.integers(len(values))] for name, values in GRIDS[method].items()}
        one = replace(found[0], **drawn)
        if one not in found:
            found.append(one)
    return found


def fit_thresholds(
    method: str,
    samples: Sequence[Sample],
    *,
    tried: Sequence[Contrast | Warm | FloatingThresholds] | None = None,
    rule: Rule | None = None,
    tell: Callable[[int, int], None] | None = None,
) -> Fitted:
    """Choose thresholds by F1 over labelled frames, and judge each frame without its own group.

    Parameters
    ----------
    method
        One of `GRIDS`.
    samples
        Labelled frames, of two groups or more.
    tried
        Sets of thresholds; None takes `candidates`. The first are the defaults.
    rule
        When a detection and a label belong together.
    tell
        Called with how many frames are done, and of how many.

    Returns
    -------
    Fitted

    Raises
    ------
    WildlabError
        Where there are fewer than two groups, or no label at all.
    """
    groups = checked_groups(samples, 2)
    names = list(dict.fromkeys(groups.tolist()))
    sets = list(tried) if tried is not None else candidates(method)
    counts = np.zeros((len(sets), len(samples), 3), np.intp)
    for at, sample in enumerate(samples):
        for row, thresholds in enumerate(sets):
            found = detect_frame(sample.frame, method, thresholds)
            boxes = np.concatenate([found.uv - found.box[:, 2:] / 2, found.box[:, 2:]], axis=1)
            counts[row, at] = match(boxes, sample.boxes, rule, sample.ignore).counts
        if tell:
            tell(at + 1, len(samples))
    held_out = np.zeros((len(samples), 3), np.intp)
    chosen = {}
    for name in names:
        best = _best(counts[:, groups != name])
        chosen[name] = sets[best]
        held_out[groups == name] = counts[best][groups == name]
    best = _best(counts)
    labels = groups.tolist()
    return Fitted(
        sets[best],
        rates(held_out, labels),
        rates(counts[best], labels),
        rates(counts[0], labels),
        held_out,
        chosen,
        len(sets),
    )


def checked_groups(samples: Sequence[Sample], fewest: int) -> NDArray[np.str_]:
    """The group of each sample, where there are enough of them and something is labelled.

    Parameters
    ----------
    samples
        Labelled frames.
    fewest
        How many groups there have to be.

    Returns
    -------
    (F,) of str

    Raises
    ------
    WildlabError
        Where there are fewer groups, or no label at all.
    """
    groups = np.array([one.group for one in samples], dtype=np.str_)
    count = len(set(groups.tolist()))
    if count < fewest:
        raise WildlabError(
            f"the labelled frames that can be used are of {count} group{'' if count == 1 else 's'}",
            f"give labels of {fewest} frames or clips at least: what is chosen is judged on others",
        )
    if not sum(len(one.boxes) for one in samples):
        raise WildlabError("the labels mark nothing", "give frames with boxes in them")
    return groups


def _best(counts: NDArray[np.intp]) -> int:
    """Which of (C, F, 3) has the largest F1 over its frames; of equal ones the first."""
    found, invented, missed = counts.sum(axis=1).T.astype(float)
    return int(np.argmax(2 * found / np.maximum(2 * found + invented + missed, 1)))
