"""Features of one thing in two images, and how far each has moved: H 4.2, 5.4.

SIFT features within the filled vessel alone (H 4.3 says that this solves what features elsewhere spoil),
paired by a FLANN nearest-neighbour search. What H does not print is chosen: see `FlowThresholds`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Pixels around a mask that are looked at too: features are described by what is around them.
_MARGIN = 24


@dataclass(frozen=True)
class FlowThresholds:
    """What counts as a feature, as the same feature, and as a usable pair of images. All chosen.

    Attributes
    ----------
    contrast
        Of SIFT: how much a feature stands out, of the grey levels' range. Half of OpenCV's 0.04, for images
        with few levels.
    ratio
        A match is kept if the nearest descriptor is nearer than that share of the second nearest: Lowe (2004)
        has 0.8.
    agreement
        How far, px, a feature may lie from where the motion of the whole (shift, turn and scale) has it.
    largest_turn
        Of that motion, how far it may turn (rad) and scale (share) from one image to the next: any two pairs
        make some motion, but a camera seldom turns by more than 60 deg/s.
    fewest
        Features that must be left; with more than two the scatter about a motion of four numbers is known,
        and of few that fit each other some do so by chance.
    largest_gimbal_rate
        Pairs of images between which the gimbal turned faster than that are dropped, rad/s (H 5.6.3 proposes
        such a limit and does not apply it).
    largest_speed
        Velocities above it are dropped, m/s: 25 m/s are 49 kn (H 5.6.3, as before).
    smallest_sd
        Standard deviation of a displacement, px, where the scatter of features says less.
    """

    contrast: float = 0.02
    ratio: float = 0.8
    agreement: float = 2.0
    largest_turn: float = 0.15
    fewest: int = 4
    largest_gimbal_rate: float = float(np.radians(3.0))
    largest_speed: float = 25.0
    smallest_sd: float = 0.1

    def __post_init__(self) -> None:
        limits = (
            ("contrast", self.contrast > 0, "give a share above 0"),
            ("ratio", 0 < self.ratio <= 1, "give a share from above 0 to 1"),
            ("agreement", self.agreement > 0, "give one above 0, in pixels"),
            ("largest_turn", self.largest_turn > 0, "give an angle above 0, in rad"),
            ("fewest", self.fewest >= 3, "give at least 3 features"),
            ("largest_gimbal_rate", self.largest_gimbal_rate > 0, "give one above 0, in rad/s"),
            ("largest_speed", self.largest_speed > 0, "give one above 0, in m/s"),
            ("smallest_sd", self.smallest_sd > 0, "give one above 0, in pixels"),
        )
        for field, fine, fix in limits:
            if not fine:
                raise WildlabError(f"{field} is {getattr(self, field)!r}", fix, field=field)


@dataclass(frozen=True, eq=False)
class Matches:
    """The same features in two images.

    Attributes
    ----------
    first, second
        (N, 2) px in either image; (0, 0) is the middle of the upper left pixel.
    sd
        Standard deviation per axis of a displacement, px: the scatter about one motion of all. NaN where
        there are too few to know.
    """

    first: Array
    second: Array
    sd: float

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True, eq=False)
class Features:
    """Features of one image: where, (N, 2) px, and their descriptors, (N, 128)."""

    uv: Array
    descriptors: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.uv)


def find_features(image: NDArray[Any], inside: Mask, thresholds: FlowThresholds | None = None) -> Features:
    """SIFT features of one thing in one image.

    Parameters
    ----------
    image
        (H, W) grey levels, counts or kelvin. They become 256 levels over the range of what is inside.
    inside
        (H, W) where the thing is: the filled object of a detector.
    thresholds
        None takes the default ones.

    Returns
    -------
    Features
        Each place once, also where a feature has two directions.

    Raises
    ------
    WildlabError
        Where the image is no grey image, or the mask has another size.
    """
    given = thresholds or FlowThresholds()
    seen, mask = np.asarray(image), np.asarray(inside, bool)
    if seen.ndim != 2 or seen.dtype.kind not in "uif":
        raise WildlabError(
            f"an image of the shape {seen.shape} and type {seen.dtype}",
            "give a grey image: rows by columns of grey levels, counts or kelvin",
            field="image",
        )
    if mask.shape != seen.shape:
        raise WildlabError(
            f"a mask of the shape {mask.shape} for an image of the shape {seen.shape}",
            "give one value for each pixel",
            field="inside",
        )
    none = Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return none
    top, left = max(int(rows[0]) - _MARGIN, 0), max(int(columns[0]) - _MARGIN, 0)
    here = slice(top, int(rows[-1]) + _MARGIN + 1), slice(left, int(columns[-1]) + _MARGIN + 1)
    sift = cv2.SIFT.create(contrastThreshold=given.contrast)
    points, descriptors = sift.detectAndCompute(_grey(seen[here], mask[here]), mask[here].astype(np.uint8))
    if not points:
        return none
    uv = np.array([point.pt for point in points], float)
    _, once = np.unique(uv, axis=0, return_index=True)
    once.sort()
    return Features(uv[once] + [left, top], np.asarray(descriptors, np.float32)[once])


def match_features(first: Features, second: Features, thresholds: FlowThresholds | None = None) -> Matches:
    """The same features in two images.

    Parameters
    ----------
    first, second
        From `find_features`.
    thresholds
        None takes the default ones.

    Returns
    -------
    Matches
        None at all where fewer than ``fewest`` are left.

    Notes
    -----
    The search among the descriptors visits every leaf of the tree: the same pairs as by comparing all with
    all, and the same each time.
    """
    given = thresholds or FlowThresholds()
    if min(len(first), len(second)) < given.fewest:
        return _none()
    here, there = nearest_by_ratio(first.descriptors, second.descriptors, given.ratio)
    return agreeing(first.uv[here], second.uv[there], given)


def filled_outlines(labels: NDArray[np.integer]) -> Mask:
    """Where things are, by the convex outline of each: what H 4.3 does not fill has an open contour.

    Parameters
    ----------
    labels
        (H, W), 0 for nothing: as `wildlab.detection.floating.find_objects` gives them.

    Returns
    -------
    (H, W) bool.

    Examples
    --------
    >>> labels = np.zeros((5, 5), np.int32)
    >>> labels[1:4, 1], labels[3, 1:4] = 1, 1
    >>> print(filled_outlines(labels).sum())
    6
    """
    inside = np.zeros(labels.shape, np.uint8)
    for number in range(1, int(labels.max(initial=0)) + 1):
        places = cv2.findNonZero((labels == number).astype(np.uint8))
        if places is not None:
            cv2.fillConvexPoly(inside, cv2.convexHull(places), 1)
    return inside > 0


def nearest_by_ratio(
    first: NDArray[np.float32], second: NDArray[np.float32], ratio: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of two sets of descriptors that belong together: nearest by far, and each taken once.

    Parameters
    ----------
    first, second
        (N, D) and (M, D) descriptors, M at least two.
    ratio
        Largest distance to the nearest, over that to the second nearest.

    Returns
    -------
    (rows of the first, rows of the second), (K,) each. Of several that chose the same, the nearest keeps it.
    """
    search = cv2.FlannBasedMatcher({"algorithm": 1, "trees": 1}, {"checks": -1})
    pairs = search.knnMatch(np.ascontiguousarray(first), np.ascontiguousarray(second), k=2)
    best: dict[int, tuple[float, int]] = {}
    for pair in pairs:
        if len(pair) < 2 or not pair[0].distance < ratio * pair[1].distance:
            continue
        known = best.get(pair[0].trainIdx)
        if known is None or pair[0].distance < known[0]:
            best[pair[0].trainIdx] = (pair[0].distance, pair[0].queryIdx)
    there = sorted(best)
    return np.array([best[row][1] for row in there], np.intp), np.array(there, np.intp)


def agreeing(first: ArrayLike, second: ArrayLike, thresholds: FlowThresholds) -> Matches:
    """Those of some matches that moved with most of the others, by shift, turn and scale.

    Parameters
    ----------
    first, second
        (N, 2) px in either image.
    thresholds
        With ``agreement``, ``fewest`` and ``smallest_sd``.

    Returns
    -------
    Matches
        Without rows where too few agree.
    """
    here, there = np.asarray(first, float), np.asarray(second, float)
    if len(here) < thresholds.fewest:
        return _none()
    motion, kept = cv2.estimateAffinePartial2D(
        here, there, method=cv2.RANSAC, ransacReprojThreshold=thresholds.agreement, maxIters=500
    )
    rows = np.zeros(len(here), bool) if kept is None else np.asarray(kept).ravel() > 0
    if motion is None or rows.sum() < thresholds.fewest:
        return _none()
    along, across = float(motion[0, 0]), float(motion[1, 0])
    turned, scaled = np.arctan2(across, along), np.hypot(along, across) - 1
    if max(abs(turned), abs(scaled)) > thresholds.largest_turn:
        return _none()
    here, there = here[rows], there[rows]
    left = there - moved_together(here, there)
    sd = float(np.sqrt((left**2).sum() / (left.size - 4)))
    return Matches(here, there, max(sd, thresholds.smallest_sd))


def moved_together(first: Array, second: Array) -> Array:
    """Where the shift, turn and scale that fit best (least squares) take the first (N, 2) px."""
    centre_first, centre_second = first.mean(axis=0), second.mean(axis=0)
    a, b = (first - centre_first) @ [1, 1j], (second - centre_second) @ [1, 1j]
    turned = a * (np.vdot(a, b) / max(np.vdot(a, a).real, 1e-12))
    return np.asarray(centre_second + np.stack([turned.real, turned.imag], axis=1))


def slow_gimbal(gimbal_rates: ArrayLike, thresholds: FlowThresholds) -> Mask:
    """Pairs of images between which the gimbal hardly moved: (N, 2) rad/s of pan and tilt -> (N,).

    Examples
    --------
    >>> slow_gimbal([[0.0, 0.01], [0.0, -0.2]], FlowThresholds()).tolist()
    [True, False]
    """
    rates = np.asarray(gimbal_rates, float)
    return np.asarray(np.hypot(rates[..., 0], rates[..., 1]) <= thresholds.largest_gimbal_rate)


def likely_speed(velocities: ArrayLike, thresholds: FlowThresholds) -> Mask:
    """Velocities (N, 2) m/s that a vessel can have; NaN is none.

    Examples
    --------
    >>> likely_speed([[3.0, 4.0], [40.0, 0.0]], FlowThresholds()).tolist()
    [True, False]
    """
    v = np.asarray(velocities, float)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.hypot(v[..., 0], v[..., 1]) <= thresholds.largest_speed)


def _none() -> Matches:
    return Matches(np.zeros((0, 2)), np.zeros((0, 2)), float("nan"))


def _grey(image: NDArray[Any], inside: Mask) -> NDArray[np.uint8]:
    """In 256 levels, over the range of what is inside."""
    values = image.astype(np.float32)
    shown = values[inside & np.isfinite(values)]
    low, high = np.quantile(shown, [0.01, 0.99]) if len(shown) else (0.0, 1.0)
    grey = (np.nan_to_num(values, nan=float(low)) - low) * (255.0 / max(high - low, 1e-6))
    return np.ascontiguousarray(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
