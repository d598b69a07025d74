"""How wide pixels' ellipses have to be, from labelled frames: what is not seen of what is looked for.

What a detector sees of an animal is the warm part of it, and no image says how far the middle of that is
from the middle of the whole. Labels do: the part is the smallest with which the ellipses of nine in ten
labels that were found hold the label's middle, counted so that the next label has that chance too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.detecting.detect import detect_frame
from wildlab.analysis.detecting.fit import Array, Sample
from wildlab.analysis.detecting.judged import ELLIPSE
from wildlab.evaluation.matching import Rule, match
from wildlab.evaluation.runs import Interval, share_interval
from wildlab.geometry.ellipses import inside_ellipse


class Found(NamedTuple):
    """Labels that were found: where from the detection they lie, and what is known of the detection.

    Attributes
    ----------
    off
        (N, 2) from the detection to the middle of its label, px.
    covariance
        (N, 2, 2) of the detection without any part, px^2.
    major
        (N,) its major axis, px.
    """

    off: Array
    covariance: Array
    major: Array

    def inside(self, part: float) -> NDArray[np.bool_]:
        """(N,) bool: whether the 90 % ellipses with that part hold the labels."""
        wider = (part * self.major)[:, None, None] ** 2 * np.eye(2)
        return inside_ellipse(self.off, self.covariance + wider, ELLIPSE)


def parts_needed(found: Found) -> Array:
    """The part with which each ellipse just reaches its label.

    Parameters
    ----------
    found
        N of them.

    Returns
    -------
    (N,) shares of the major axis; 0 where the ellipse is wide enough without.
    """
    reach = -2 * np.log(1 - ELLIPSE)
    powers, directions = np.linalg.eigh(found.covariance)
    a, b = np.moveaxis(np.einsum("nij,ni->nj", directions, found.off) ** 2 / reach, -1, 0)
    first, second = np.moveaxis(powers, -1, 0)
    # Of a / (first + s) + b / (second + s) = 1 the larger s.
    half = (first + second - a - b) / 2
    rest = first * second - a * second - b * first
    s = -half + np.sqrt(np.maximum(half**2 - rest, 0.0))
    return np.asarray(np.sqrt(np.maximum(s, 0.0)) / found.major)


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


def found_labels(method: str, samples: Sequence[Sample], thresholds: Any, rule: Rule | None = None) -> Found:
    """Labels that a method finds, with its ellipses as they are without any part.

    Parameters
    ----------
    method, thresholds
        Of those that have a part.
    samples
        Labelled frames.
    rule
        When a detection and a label belong together.

    Returns
    -------
    Found
    """
    bare = with_part(thresholds, 0.0)
    parts: list[tuple[Array, Array, Array]] = []
    for sample in samples:
        found = detect_frame(sample.frame, method, bare)
        boxes = np.concatenate([found.uv - found.box[:, 2:] / 2, found.box[:, 2:]], axis=1)
        pairs = match(boxes, sample.boxes, rule, sample.ignore).pairs
        if len(pairs):
            own, label = pairs.T
            middle = sample.boxes[label, :2] + sample.boxes[label, 2:] / 2
            parts.append((middle - found.uv[own], found.covariance[own], found.axes[own, 0]))
    if not parts:
        return Found(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))
    return Found(*(np.concatenate(one) for one in zip(*parts, strict=True)))


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
        names = ("estimate", "low", "high")
        return {
            "part": round(self.part, 5) if np.isfinite(self.part) else None,
            "labels_found": self.labels,
            "held_out_coverage_90": None
            if self.held_out is None
            else {name: round(value, 4) for name, value in zip(names, self.held_out, strict=True)},
        }


def fit_part(
    method: str,
    samples: Sequence[Sample],
    thresholds: Any,
    rule: Rule | None = None,
) -> PartFit | None:
    """The part of ellipses from labelled frames, judged on groups that it was not chosen from.

    Parameters
    ----------
    method, thresholds
        What finds them.
    samples
        Labelled frames of two groups or more.
    rule
        When a detection and a label belong together.

    Returns
    -------
    PartFit, or None for a method whose ellipses have no part.
    """
    if part_in(thresholds) is None:
        return None
    found = [found_labels(method, [one], thresholds, rule) for one in samples]
    needed = [parts_needed(one) for one in found]
    groups = [one.group for one in samples]
    inside: list[NDArray[np.bool_]] = []
    for name in dict.fromkeys(groups):
        part = part_of(np.concatenate([n for n, group in zip(needed, groups, strict=True) if group != name]))
        if np.isfinite(part):
            inside += [one.inside(part) for one, group in zip(found, groups, strict=True) if group == name]
    held = np.concatenate([np.zeros(0, bool), *inside])
    every = np.concatenate(needed)
    share = share_interval(int(held.sum()), len(held)) if len(held) else None
    return PartFit(part_of(every), len(every), share)


def part_sentence(fit: PartFit, default: float) -> str:
    """What was chosen, from how many labels, and what it holds of others.

    Parameters
    ----------
    fit
        Of a run.
    default
        What holds where nothing could be chosen.

    Returns
    -------
    str
    """
    if not np.isfinite(fit.part):
        return (
            f"Ellipses keep the default part of {100 * default:.3g} % of the length: {fit.labels} labels "
            "were found, and nine are the fewest that one can be chosen from."
        )
    start = (
        f"So that 90 % ellipses hold the labels' middles, {100 * fit.part:.2g} % of the length is taken for "
        f"what is not seen ({fit.labels} labels were found)"
    )
    if fit.held_out is None:
        return f"{start}; what it holds of others is not known."
    share = fit.held_out
    return (
        f"{start}; of labels that it was not chosen from they hold {100 * share.estimate:.0f} % "
        f"({100 * share.low:.0f} to {100 * share.high:.0f})."
    )
