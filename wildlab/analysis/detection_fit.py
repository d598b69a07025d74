"""Thresholds, shapes and parts chosen from labelled frames, and judged on frames that they were not chosen
from.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.detection_scores import ELLIPSE, plain_interval
from wildlab.analysis.detectors import METHODS, detect_frame
from wildlab.detection.contrast import PERMISSIVE, Contrast, Proposals, Shape, choose, fit_shape, propose
from wildlab.detection.detections import Detections
from wildlab.detection.floating import FloatingThresholds
from wildlab.detection.warm import Warm, to_grey
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import Interval, share_interval
from wildlab.evaluation.matching import Rates, match, rates
from wildlab.flight.readers.frames import Frame
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.paths import DATA

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
    wanted: Mask
    judged: Mask


def fit_shapes(samples: Sequence[Sample], *, tell: Callable[[int, int], None] | None = None) -> Fitted:
    """Learn a classifier of shapes, and judge each frame with one that did not see its group.

    Parameters
    ----------
    samples
        Labelled frames of three groups or more: thresholds are chosen inside those that it learns from.
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
    seen: list[list[_Seen]] = []
    for at, sample in enumerate(samples):
        seen.append([_look(sample, number) for number in range(len(REGIONS))])
        if tell:
            tell(at + 1, len(samples))

    def count(learnt: Shape, row: int) -> Indices:
        proposals = seen[row][REGIONS.index(learnt.regions)].proposals
        return _count(choose(proposals, learnt), samples[row])

    raw = [_count(own[-1].proposals.detections, sample) for own, sample in zip(seen, samples, strict=True)]
    tried = len(REGIONS) * len(APART) * len(LEAST)
    return _judged(groups, lambda rows: _learn(seen, samples, groups, rows), count, np.array(raw), tried)


def _judged(
    groups: NDArray[np.str_],
    learn: Callable[[Indices], Any],
    count: Callable[[Any, int], Indices],
    plain: Indices,
    tried: int,
) -> Fitted:
    """What is learnt of some frames, each frame judged with what was learnt without its group.

    ``learn`` takes rows of frames to thresholds, ``count`` these and a row to found, invented and missed, and
    ``plain`` (F, 3) has these of the defaults.
    """
    of = groups.tolist()
    chosen = {name: learn(np.flatnonzero(groups != name)) for name in dict.fromkeys(of)}
    final = learn(np.arange(len(of)))
    held_out = np.array([count(chosen[name], row) for row, name in enumerate(of)])
    inside = np.array([count(final, row) for row in range(len(of))])
    out, at_home, before = (rates(one, of) for one in (held_out, inside, plain))
    return Fitted(final, out, at_home, before, chosen, tried)


def _look(sample: Sample, number: int) -> _Seen:
    frame = sample.frame
    regions = replace(REGIONS[number], warm_is_bright=frame.polarity != "black-hot")
    image = frame.image if frame.image.ndim == 2 else to_grey(frame.image)
    proposals = propose(image, frame.valid, regions)
    found = match(_boxes(proposals.detections), sample.boxes, ignore=sample.ignore)
    wanted = np.zeros(len(proposals.detections), bool)
    wanted[found.pairs[:, 0]] = True
    judged = np.ones(len(wanted), bool)
    judged[found.ignored] = False
    return _Seen(proposals, wanted, judged)


def _learn(
    seen: Sequence[Sequence[_Seen]],
    samples: Sequence[Sample],
    groups: NDArray[np.str_],
    rows: Indices,
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
                counts += _counts_of(seen[row][number].proposals, learnt, samples[row])
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


def _fit(seen: Sequence[Sequence[_Seen]], number: int, rows: Indices) -> Shape | None:
    some = [seen[row][number] for row in rows.tolist()]
    wanted = np.concatenate([one.wanted[one.judged] for one in some]) if some else np.zeros(0, bool)
    if not 0 < wanted.sum() < len(wanted):
        return None
    features = np.concatenate([one.proposals.features[one.judged] for one in some])
    return fit_shape(features, wanted, REGIONS[number])


def _counts_of(proposals: Proposals, learnt: Shape, sample: Sample) -> Indices:
    """(A, L, 3) found, invented and missed for every distance and every sureness."""
    result = np.zeros((len(APART), len(LEAST), 3), np.intp)
    for a, apart in enumerate(APART):
        # The surest of those that are near each other is the same for every limit below it.
        kept = choose(proposals, replace(learnt, least=LEAST[0], apart_px=apart))
        for b, least in enumerate(LEAST):
            result[a, b] = _count(kept.select(kept.score >= least), sample)
    return result


def _count(found: Detections, sample: Sample) -> Indices:
    return match(_boxes(found), sample.boxes, ignore=sample.ignore).counts


def _boxes(found: Detections) -> Array:
    return np.concatenate([found.uv - found.box[:, 2:] / 2, found.box[:, 2:]], axis=1)


def part_of(needed: ArrayLike) -> float:
    """The part that holds the next label with the ellipses' probability.

    Parameters
    ----------
    needed
        (N,) of `parts_needed`.

    Returns
    -------
    float
        Of N + 1 that are alike the next is any: so it is the one at nine tenths of these, not of N. NaN of
        fewer than nine, which no part can be said of.

    Examples
    --------
    >>> part_of([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]), part_of([0.1] * 8)
    (0.9, nan)
    """
    ordered = np.sort(np.asarray(needed, float))
    at = int(np.ceil(ELLIPSE * (len(ordered) + 1) - 1e-9))
    return float(ordered[at - 1]) if at <= len(ordered) else float("nan")


def parts_needed(off: Array, covariance: Array, major: Array) -> Array:
    """The part with which each ellipse just reaches its label.

    Parameters
    ----------
    off
        (N, 2) from the detection to the middle of its label, px.
    covariance
        (N, 2, 2) of the detection without any part, px^2.
    major
        (N,) its major axis, px.

    Returns
    -------
    (N,) shares of the major axis; 0 where the ellipse is wide enough without.
    """
    reach = -2 * np.log(1 - ELLIPSE)
    powers, directions = np.linalg.eigh(covariance)
    a, b = np.moveaxis(np.einsum("nij,ni->nj", directions, off) ** 2 / reach, -1, 0)
    first, second = np.moveaxis(powers, -1, 0)
    # Of a / (first + s) + b / (second + s) = 1 the larger s.
    half = (first + second - a - b) / 2
    rest = first * second - a * second - b * first
    s = -half + np.sqrt(np.maximum(half**2 - rest, 0.0))
    return np.sqrt(np.maximum(s, 0.0)) / major


def _parts_in(sample: Sample, method: str, thresholds: Any) -> Array:
    """`parts_needed` of the labels of a frame that are found."""
    found = detect_frame(sample.frame, method, with_part(thresholds, 0.0))
    own, label = match(_boxes(found), sample.boxes, ignore=sample.ignore).pairs.T
    middle = sample.boxes[label, :2] + sample.boxes[label, 2:] / 2
    return parts_needed(middle - found.uv[own], found.covariance[own], found.axes[own, 0])


def part_in(thresholds: Any) -> float | None:
    """The part of thresholds; None of such that have none."""
    own = getattr(thresholds, "regions", thresholds)
    return getattr(own, "part", None)


def with_part(thresholds: Any, part: float) -> Any:
    """The same thresholds with another part."""
    if hasattr(thresholds, "regions"):
        return replace(thresholds, regions=replace(thresholds.regions, part=part))
    return replace(thresholds, part=part)


class PartFit(NamedTuple):
    """A part, and what choosing it so is worth.

    Attributes
    ----------
    part
        Chosen by all labels that were found; NaN of too few.
    labels
        How many these are.
    held_out
        Which share of labels the ellipses hold, each with a part that was chosen without its group; None
        where there were too few.
    """

    part: float
    labels: int
    held_out: Interval | None

    def as_plain(self) -> dict[str, Any]:
        """For a JSON file."""
        return {
            "part": round(self.part, 5) if np.isfinite(self.part) else None,
            "labels_found": self.labels,
            "held_out_coverage_90": None if self.held_out is None else plain_interval(self.held_out),
        }


def fit_part(
    method: str,
    samples: Sequence[Sample],
    thresholds: Any,
) -> PartFit | None:
    """The part of ellipses from labelled frames, judged on groups that it was not chosen from.

    Parameters
    ----------
    method, thresholds
        What finds them.
    samples
        Labelled frames of two groups or more.

    Returns
    -------
    PartFit, or None for a method whose ellipses have no part.
    """
    if part_in(thresholds) is None:
        return None
    needed = [_parts_in(one, method, thresholds) for one in samples]
    groups = np.repeat([one.group for one in samples], [len(one) for one in needed])
    every = np.concatenate(needed)
    # An ellipse holds its label with the part that it needs, and with any larger one.
    parts = {name: part_of(every[groups != name]) for name in set(groups.tolist())}
    limits = np.array([parts[name] for name in groups])
    held = (every <= limits)[np.isfinite(limits)]
    share = share_interval(int(held.sum()), len(held)) if len(held) else None
    return PartFit(part_of(every), len(every), share)


#: What is tried of each threshold, by method.
GRIDS: dict[str, dict[str, list[Any]]] = tomllib.loads((DATA / "thresholds.toml").read_text("utf-8"))
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
    chosen
        By group: the thresholds that its samples were judged with.
    tried
        How many sets of thresholds.
    """

    thresholds: Any
    held_out: Rates
    inside: Rates
    defaults: Rates
    chosen: dict[str, Any]
    tried: int


def candidates(method: str, count: int = TRIED, seed: int = 1) -> list[Any]:
    """Sets of thresholds to try: the defaults, then each threshold drawn from `GRIDS`, none twice.

    Parameters
    ----------
    method
        One of `wildlab.analysis.detectors.METHODS`.
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
    sets = list(tried) if tried is not None else candidates(method)
    counts = np.zeros((len(sets), len(samples), 3), np.intp)
    for at, sample in enumerate(samples):
        for row, thresholds in enumerate(sets):
            counts[row, at] = _count(detect_frame(sample.frame, method, thresholds), sample)
        if tell:
            tell(at + 1, len(samples))

    def best(rows: Indices) -> Any:
        """That of the largest F1 over some frames; of equal ones the first."""
        found, invented, missed = counts[:, rows].sum(axis=1).T.astype(float)
        return sets[int(np.argmax(2 * found / np.maximum(2 * found + invented + missed, 1)))]

    return _judged(groups, best, lambda one, row: counts[sets.index(one), row], counts[0], len(sets))


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
