"""Features that two images share, and how far they moved: within one thing (H 4.2, 5.4), or of the whole
scene.

Of a vessel, SIFT features within its filled outline alone (H 4.3 says that this solves what features
elsewhere spoil), paired by a FLANN nearest-neighbour search. Of the scene, corners followed by Lucas and
Kanade's flow. What H does not print is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array, Indices, Mask

#: Pixels around a mask that are looked at too: features are described by what is around them.
_MARGIN = 24


#: Of SIFT: how much a feature stands out, of the grey levels' range. Half of OpenCV's 0.04, for images with
#: few levels. This and what follows is chosen.
CONTRAST = 0.02
#: A match is kept if the nearest descriptor is nearer than that share of the second nearest: Lowe (2004) has
#: 0.8.
RATIO = 0.8
#: How far, px, a feature may lie from where the motion of the whole (shift, turn and scale) has it.
AGREEMENT = 2.0
#: Of that motion, how far it may turn (rad) and scale (share) from one image to the next: any two pairs make
#: some motion, but a camera seldom turns by more than 60 deg/s.
LARGEST_TURN = 0.15
#: Features that must be left; with more than two the scatter about a motion of four numbers is known, and of
#: few that fit each other some do so by chance.
FEWEST = 4
#: Standard deviation of a displacement, px, where the scatter of features says less.
SMALLEST_SD = 0.1


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


def find_features(image: NDArray[Any], inside: Mask) -> Features:
    """SIFT features of one thing in one image.

    Parameters
    ----------
    image
        (H, W) grey levels, counts or kelvin. They become 256 levels over the range of what is inside.
    inside
        (H, W) where the thing is: the filled object of a detector.

    Returns
    -------
    Features
        Each place once, also where a feature has two directions.
    """
    seen, mask = np.asarray(image), np.asarray(inside, bool)
    none = Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return none
    top, left = max(int(rows[0]) - _MARGIN, 0), max(int(columns[0]) - _MARGIN, 0)
    here = slice(top, int(rows[-1]) + _MARGIN + 1), slice(left, int(columns[-1]) + _MARGIN + 1)
    sift = cv2.SIFT.create(contrastThreshold=CONTRAST)
    points, descriptors = sift.detectAndCompute(as_grey(seen[here], mask[here]), mask[here].astype(np.uint8))
    if not points:
        return none
    uv = np.array([point.pt for point in points], float)
    _, once = np.unique(uv, axis=0, return_index=True)
    once.sort()
    return Features(uv[once] + [left, top], np.asarray(descriptors, np.float32)[once])


def match_features(first: Features, second: Features) -> Matches:
    """The same features in two images.

    Parameters
    ----------
    first, second
        From `find_features`.

    Returns
    -------
    Matches
        None at all where fewer than `FEWEST` are left.

    Notes
    -----
    The search among the descriptors visits every leaf of the tree: the same pairs as by comparing all with
    all, and the same each time.
    """
    if min(len(first), len(second)) < FEWEST:
        return _none()
    here, there = nearest_by_ratio(first.descriptors, second.descriptors, RATIO)
    return agreeing(first.uv[here], second.uv[there])


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
) -> tuple[Indices, Indices]:
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


def agreeing(first: ArrayLike, second: ArrayLike) -> Matches:
    """Those of some matches that moved with most of the others, by shift, turn and scale.

    Parameters
    ----------
    first, second
        (N, 2) px in either image.

    Returns
    -------
    Matches
        Without rows where too few agree.
    """
    here, there = np.asarray(first, float), np.asarray(second, float)
    if len(here) < FEWEST:
        return _none()
    motion, kept = cv2.estimateAffinePartial2D(
        here, there, method=cv2.RANSAC, ransacReprojThreshold=AGREEMENT, maxIters=500
    )
    rows = np.zeros(len(here), bool) if kept is None else np.asarray(kept).ravel() > 0
    if motion is None or rows.sum() < FEWEST:
        return _none()
    along, across = float(motion[0, 0]), float(motion[1, 0])
    turned, scaled = np.arctan2(across, along), np.hypot(along, across) - 1
    if max(abs(turned), abs(scaled)) > LARGEST_TURN:
        return _none()
    here, there = here[rows], there[rows]
    left = there - moved_together(here, there)
    sd = float(np.sqrt((left**2).sum() / (left.size - 4)))
    return Matches(here, there, max(sd, SMALLEST_SD))


def moved_together(first: Array, second: Array) -> Array:
    """Where the shift, turn and scale that fit best (least squares) take the first (N, 2) px."""
    centre_first, centre_second = first.mean(axis=0), second.mean(axis=0)
    a, b = (first - centre_first) @ [1, 1j], (second - centre_second) @ [1, 1j]
    turned = a * (np.vdot(a, b) / max(np.vdot(a, a).real, 1e-12))
    return np.asarray(centre_second + np.stack([turned.real, turned.imag], axis=1))


def _none() -> Matches:
    return Matches(np.zeros((0, 2)), np.zeros((0, 2)), float("nan"))


Grey = NDArray[np.uint8]
#: Features that are followed at most, and that have to agree on one motion at least.
MOST_CORNERS, FEWEST_CORNERS = 400, 12
#: How far (px) a feature may be from where it began when it is followed back, and from the common motion.
BACK_PX, AGREEMENT_PX = 0.7, 1.5
#: Share of the followed features that has to agree.
AGREE = 0.4
#: Window and levels of the pyramid: displacements up to about a sixth of 640 px are followed.
WINDOW, LEVELS = 21, 4


def as_grey(image: NDArray[Any], valid: Mask) -> Grey:
    """An image (H, W) or (H, W, 3) in 256 levels over the range of what can be seen.

    Parameters
    ----------
    image
        Grey levels, counts, kelvin, or red-green-blue.
    valid
        (H, W) where there is a scene.

    Returns
    -------
    (H, W) uint8
    """
    values = np.asarray(image, np.float32)
    values = values.mean(axis=2) if values.ndim == 3 else values
    shown = values[valid & np.isfinite(values)]
    low, high = np.quantile(shown, [0.01, 0.99]) if len(shown) else (0.0, 1.0)
    grey = (np.nan_to_num(values, nan=float(low)) - low) * (255.0 / max(float(high - low), 1e-6))
    return np.ascontiguousarray(np.clip(np.rint(grey), 0, 255).astype(np.uint8))


def image_motion(first: Grey, second: Grey, camera: Camera, valid: Mask | None = None) -> Array:
    """How the scene moved from one image to the next: a shift at the principal point, and a turn.

    Parameters
    ----------
    first, second
        (H, W) grey images of one size, from `as_grey`.
    camera
        Its lens: the motion is fitted to directions, not to pixels.
    valid
        (H, W) where features are looked for; everywhere, if not given.

    Returns
    -------
    (3,)
        Tangents along the columns and the rows, and the turn from the columns' to the rows' axis (rad); NaN
        where too few features agree.
    """
    here, there = followed_corners(first, second, valid)
    a, b = normalise(camera, here), normalise(camera, there)
    known = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    moved, rows = common_homography(a[known], b[known], AGREEMENT_PX / camera.fx)
    return plane_motion(a[known][rows], b[known][rows]) if np.isfinite(moved).all() else np.full(3, np.nan)


def followed_corners(first: Grey, second: Grey, valid: Mask | None = None) -> tuple[Array, Array]:
    """Corners of one image, (N, 2) px, and where they are in the other: those that are also followed back.

    Parameters
    ----------
    first, second, valid
        As of `image_motion`.
    """
    mask = None if valid is None else np.asarray(valid, np.uint8)
    found = cv2.goodFeaturesToTrack(first, MOST_CORNERS, 0.01, 8, mask=mask)
    if found is None or not len(found):
        return np.zeros((0, 2)), np.zeros((0, 2))
    points = np.asarray(found, np.float32)
    there, followed = _follow(first, second, points)
    back, followed_back = _follow(second, first, there)
    good = followed & followed_back & (np.linalg.norm(back - points, axis=2)[:, 0] < BACK_PX)
    return points[good, 0].astype(float), there[good, 0].astype(float)


def common_homography(first: Array, second: Array, agreement: float) -> tuple[Array, Mask]:
    """The homography (3, 3) that takes most of some points (N, 2) to others, and which it takes there.

    Parameters
    ----------
    first, second
        Of the same things in two images.
    agreement
        How far a point may be from where it takes it, in the unit of the points.

    Returns
    -------
    NaN where too few agree.
    """
    lost = np.full((3, 3), np.nan), np.zeros(len(first), bool)
    if len(first) < FEWEST_CORNERS:
        return lost
    found, kept = cv2.findHomography(first, second, cv2.RANSAC, agreement, maxIters=500)
    rows = np.zeros(len(first), bool) if kept is None else np.asarray(kept).ravel() > 0
    enough = rows.sum() >= max(FEWEST_CORNERS, AGREE * len(rows))
    return (np.asarray(found, float), rows) if enough else lost


def plane_motion(first: Array, second: Array) -> Array:
    """Fit the motion of a plane to directions: its shift at the optical axis, and its turn.

    In the middle between two images a plane moves by ``d(x) = s + A x + x (q . x)``, whether the camera turns
    or travels. Without ``q``, or from the first image instead of the middle, what lies off the axis makes a
    shift of a turn: an error in proportion to the time between the images.

    Parameters
    ----------
    first, second
        (N, 2) tangents of the same features in both images.

    Returns
    -------
    (3,)
        As `image_motion`.
    """
    x, y = (first + second).T / 2
    one, none = np.ones_like(x), np.zeros_like(x)
    along_x = [one, none, x, y, none, none, x * x, x * y]
    along_y = [none, one, none, none, x, y, x * y, y * y]
    fitted = np.linalg.lstsq(np.hstack([along_x, along_y]).T, (second - first).T.ravel())[0]
    return np.array([fitted[0], fitted[1], (fitted[4] - fitted[3]) / 2])


def _follow(first: Grey, second: Grey, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], Mask]:
    """Where points (N, 1, 2) of one image are in the other, and which were found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        first, second, points, np.empty_like(points), winSize=(WINDOW, WINDOW), maxLevel=LEVELS
    )
    return np.asarray(there, np.float32), np.asarray(found)[:, 0] == 1
