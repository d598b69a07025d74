"""The classifier of shapes, learnt from labelled frames and judged on others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.detecting.fit import Fitted, Sample, checked_groups
from wildlab.detection.contrast import Proposals, propose
from wildlab.detection.detections import Detections
from wildlab.detection.shape import PERMISSIVE, Shape, choose, fit_shape
from wildlab.detection.warm import to_grey
from wildlab.evaluation.matching import Rule, match, rates

Counts = NDArray[np.intp]

#: What is tried: where regions come from and end, how far detections are apart, how sure they are at least.
REGIONS = tuple(
    replace(PERMISSIVE, window_px=window, of_peak=share) for window in (41, 81) for share in (0.0, 0.4, 0.6)
)
APART = (0.0, 10.0, 20.0)
LEAST = tuple(np.arange(-3.0, 2.1, 0.5).tolist())


@dataclass(frozen=True, eq=False)
class _Seen:
    """Regions of one frame, which of them belong to a label, and which are judged at all."""

    proposals: Proposals
    wanted: NDArray[np.bool_]
    judged: NDArray[np.bool_]


def fit_shapes(
    samples: Sequence[Sample], *, rule: Rule | None = None, tell: Callable[[int, int], None] | None = None
) -> Fitted:
    """Learn a classifier of shapes, and judge each frame with one that did not see its group.

    Parameters
    ----------
    samples
        Labelled frames of three groups or more: thresholds are chosen inside those that it learns from.
    rule
        When a detection and a label belong together.
    tell
        Called with how many steps are done, and of how many.

    Returns
    -------
    Fitted
        ``defaults`` is that of regions without a classifier.

    Raises
    ------
    WildlabError
        Where there are fewer than three groups, or no label at all.
    """
    groups = checked_groups(samples, 3)
    names = list(dict.fromkeys(groups.tolist()))
    seen: list[list[_Seen]] = []
    for at, sample in enumerate(samples):
        seen.append([_look(sample, number, rule) for number in range(len(REGIONS))])
        if tell:
            tell(at + 1, len(samples) + len(names) + 1)
    held_out = np.zeros((len(samples), 3), np.intp)
    chosen: dict[str, Shape] = {}
    for at, name in enumerate(names):
        learnt = _learn(seen, samples, groups, np.flatnonzero(groups != name), rule)
        chosen[name] = learnt
        for row in np.flatnonzero(groups == name).tolist():
            held_out[row] = _count(choose(_of(seen[row], learnt), learnt), samples[row], rule)
        if tell:
            tell(len(samples) + at + 1, len(samples) + len(names) + 1)
    everywhere = range(len(samples))
    final = _learn(seen, samples, groups, np.arange(len(samples)), rule)
    inside = [_count(choose(_of(seen[row], final), final), samples[row], rule) for row in everywhere]
    raw = [_count(seen[row][-1].proposals.detections, samples[row], rule) for row in everywhere]
    if tell:
        tell(len(samples) + len(names) + 1, len(samples) + len(names) + 1)
    labels = groups.tolist()
    tried = len(REGIONS) * len(APART) * len(LEAST)
    out, at_home, plain = (rates(one, labels) for one in (held_out, np.array(inside), np.array(raw)))
    return Fitted(final, out, at_home, plain, held_out, chosen, tried)


def _look(sample: Sample, number: int, rule: Rule | None) -> _Seen:
    frame = sample.frame
    regions = replace(REGIONS[number], warm_is_bright=frame.polarity != "black-hot")
    image = frame.image if frame.image.ndim == 2 else to_grey(frame.image)
    proposals = propose(image, frame.valid, regions)
    found = match(_boxes(proposals.detections), sample.boxes, rule, sample.ignore)
    wanted = np.zeros(len(proposals.detections), bool)
    wanted[found.pairs[:, 0]] = True
    judged = np.ones(len(wanted), bool)
    judged[found.ignored] = False
    return _Seen(proposals, wanted, judged)


def _of(seen: Sequence[_Seen], learnt: Shape) -> Proposals:
    """The regions of a frame that a classifier was learnt for."""
    return seen[REGIONS.index(learnt.regions)].proposals


def _learn(
    seen: Sequence[Sequence[_Seen]],
    samples: Sequence[Sample],
    groups: NDArray[np.str_],
    rows: NDArray[np.intp],
    rule: Rule | None,
) -> Shape:
    """The classifier of some frames; how sure and how far apart by leaving out group after group."""
    best: tuple[float, Shape] | None = None
    inner = list(dict.fromkeys(groups[rows].tolist()))
    for number, regions in enumerate(REGIONS):
        counts = np.zeros((len(APART), len(LEAST), 3), np.intp)
        for name in inner:
            learnt = _fit(seen, number, rows[groups[rows] != name])
            if learnt is None:
                continue
            for row in rows[groups[rows] == name].tolist():
                counts += _counts_of(seen[row][number].proposals, learnt, samples[row], rule)
        found, invented, missed = np.moveaxis(counts, -1, 0).astype(float)
        f1 = 2 * found / np.maximum(2 * found + invented + missed, 1)
        a, b = np.unravel_index(int(np.argmax(f1)), f1.shape)
        whole = _fit(seen, number, rows)
        if whole is not None and (best is None or f1[a, b] > best[0]):
            best = float(f1[a, b]), replace(whole, regions=regions, apart_px=APART[a], least=LEAST[b])
    # Without a label in these frames nothing can be learnt: nothing is found then.
    return best[1] if best is not None else _nothing()


def _nothing() -> Shape:
    columns = 2 * 9
    return Shape(REGIONS[0], (0.0,) * columns, (1.0,) * columns, (0.0,) * columns, -100.0)


def _fit(seen: Sequence[Sequence[_Seen]], number: int, rows: NDArray[np.intp]) -> Shape | None:
    some = [seen[row][number] for row in rows.tolist()]
    wanted = np.concatenate([one.wanted[one.judged] for one in some]) if some else np.zeros(0, bool)
    if not 0 < wanted.sum() < len(wanted):
        return None
    features = np.concatenate([one.proposals.features[one.judged] for one in some])
    return fit_shape(features, wanted, REGIONS[number])


def _counts_of(proposals: Proposals, learnt: Shape, sample: Sample, rule: Rule | None) -> Counts:
    """(A, L, 3) found, invented and missed for every distance and every sureness."""
    result = np.zeros((len(APART), len(LEAST), 3), np.intp)
    for a, apart in enumerate(APART):
        # The surest of those that are near each other is the same for every limit below it.
        kept = choose(proposals, replace(learnt, least=LEAST[0], apart_px=apart))
        for b, least in enumerate(LEAST):
            result[a, b] = _count(kept.select(kept.score >= least), sample, rule)
    return result


def _count(found: Detections, sample: Sample, rule: Rule | None) -> Counts:
    return match(_boxes(found), sample.boxes, rule, sample.ignore).counts


def _boxes(found: Detections) -> NDArray[np.float64]:
    return np.concatenate([found.uv - found.box[:, 2:] / 2, found.box[:, 2:]], axis=1)
