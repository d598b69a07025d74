"""Warm things by how far they stand out from what lies about them.

A median over a window wider than an animal is the background; what is left is divided by its own robust
standard deviation. A region begins where that is above a limit and holds a pixel that is above a higher
one; it ends where its contrast has fallen to a share of its largest, which takes animals apart that stand
together.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from wildlab.detection.detections import PART, Detections, describe, no_detections, remove_near
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Mask

#: The most regions of one image that are looked at further: an image of noise has tens of thousands.
MOST_REGIONS = 5000


@dataclass(frozen=True)
class Contrast:
    """Thresholds of the local-contrast chain.

    Attributes
    ----------
    window_px
        Side of the window of the median, px: at least twice as long as what is looked for.
    smooth_px
        Standard deviation of the Gaussian that the image is smoothed with first; 0 for none.
    deviation
        Whether contrast is measured in standard deviations of the whole image, or of the window.
    peak
        Standard deviations that the strongest pixel has at least.
    edge
        Standard deviations that all pixels have at least.
    of_peak
        Share of its own strongest pixel that a region's pixels have at least; 0 for none.
    of_image
        Share of the image's own strong contrast (its 99.9 per cent) that the strongest pixel has at least; 0
        for none. Where automatic gain stretches the image this says more than its noise.
    smallest_px, largest_px
        Limits of the area, px^2.
    longest
        The largest ratio of major to minor axis.
    hottest
        What the mean of a region is at most, in the unit of the image (F 8.4).
    warm_is_bright
        False for black-hot images.
    part
        How far the middle of an animal is from that of what is warm of it
        (`wildlab.detection.detections.describe`).
    """

    window_px: int = 61
    smooth_px: float = 1.0
    deviation: Literal["image", "window"] = "image"
    peak: float = 9.0
    edge: float = 3.0
    of_peak: float = 0.5
    of_image: float = 0.0
    smallest_px: float = 12.0
    largest_px: float = 1500.0
    longest: float = 6.0
    hottest: float = float("inf")
    warm_is_bright: bool = True
    part: float = PART


class Proposals(NamedTuple):
    """Regions with what tells animals from other things.

    Attributes
    ----------
    detections
        N of them; their score is the contrast of the strongest pixel in standard deviations.
    features
        (N, FEATURES), without unit, near 1 in size.
    """

    detections: Detections
    features: Array


#: Columns of `Proposals.features`, in order:
#: log contrast of the strongest pixel, standard deviations;
#: log area, px^2;
#: log ratio of the axes;
#: area over that of the ellipse with the same axes;
#: mean contrast over that of the strongest pixel;
#: largest contrast in the ring about it, over that of the strongest pixel;
#: mean contrast in that ring, over that of the strongest pixel;
#: contrast of the strongest pixel over the image's 99.9 per cent;
#: brightness of the strongest pixel between the image's 1 and 99.9 per cent.
FEATURES = 9


def find_by_contrast(image: NDArray[Any], valid: Mask, thresholds: Contrast | None = None) -> Detections:
    """Things that stand out from what lies about them.

    Parameters
    ----------
    image
        (H, W) grey levels, counts or K.
    valid
        (H, W) bool: where there is a scene.
    thresholds
        None takes the defaults.

    Returns
    -------
    Detections
        The score is the contrast of the strongest pixel in standard deviations.

    Raises
    ------
    WildlabError
        Where nothing is valid, or the shapes are not alike.

    Examples
    --------
    >>> image = np.random.default_rng(1).normal(100, 2, (120, 160))
    >>> image[60:66, 40:50] += 40
    >>> found = find_by_contrast(image, np.ones((120, 160), bool))
    >>> len(found), np.round(found.uv[0]).tolist()
    (1, [44.0, 62.0])
    """
    return propose(image, valid, thresholds or Contrast(), with_features=False).detections


def propose(
    image: NDArray[Any], valid: Mask, thresholds: Contrast, *, with_features: bool = True
) -> Proposals:
    """The same, with features for a classifier.

    Parameters
    ----------
    image, valid, thresholds
        As for `find_by_contrast`.
    with_features
        Whether they are computed; they take as long again.

    Returns
    -------
    Proposals
        Features of shape (N, 0) where they were not asked for.

    Raises
    ------
    WildlabError
        As `find_by_contrast`.
    """
    t = thresholds
    filled = fill_invalid(image, valid)
    if not t.warm_is_bright:
        filled = -filled
    smooth: Image = filled
    if t.smooth_px > 0:
        smooth = np.asarray(cv2.GaussianBlur(filled, (0, 0), t.smooth_px), np.float32)
    contrast = smooth - median_background(filled, t.window_px)
    least = ROUNDING if image.dtype.kind in "ui" else 1e-6
    noise = robust_deviation(contrast, valid, least)
    if t.deviation == "window":
        ratio: Image = contrast / local_deviation(contrast, valid, 2 * t.window_px + 1, least)
    else:
        ratio = contrast / np.float32(noise)
    # Beside a border smoothing has mixed in what was filled in.
    if not valid.all():
        ratio[~valid] = 0
    if t.of_image > 0:
        strong = float(np.percentile(ratio[::2, ::2][valid[::2, ::2]], 99.9))
        t = replace(t, peak=max(t.peak, t.of_image * strong))
    labels, wholes, peaks = _regions(ratio, t)
    if not len(peaks):
        return Proposals(no_detections(), np.zeros((0, FEATURES if with_features else 0)))
    blur = float(np.hypot(1.0, t.smooth_px))
    found = describe(
        labels, image, valid, contrast=contrast, noise=noise, blur_px=blur, part=t.part, score=peaks
    )
    # What is warmer than half the peak may be the whole thing, or the warmest part of all that stands out.
    # That blur moves the outline further out where a body is warmer is not in the ellipse.
    apart = _centroids(wholes, len(found), found.uv) - found.uv
    found = replace(found, covariance=found.covariance + apart[:, :, None] * apart[:, None, :])
    keep = found.axes[:, 0] <= t.longest * found.axes[:, 1]
    keep &= found.intensity <= t.hottest
    features = _features(labels, ratio, smooth, valid, found) if with_features else np.zeros((len(found), 0))
    return Proposals(found.select(keep), features[keep])


def _centroids(labels: NDArray[np.int32], count: int, instead: Array) -> Array:
    """(N, 2) centroids of regions 1 to N, px; ``instead`` of those that have no pixel."""
    where = np.flatnonzero(labels)
    of = labels.ravel()[where] - 1
    area = np.bincount(of, minlength=count)
    place = np.stack([where % labels.shape[1], where // labels.shape[1]]).astype(float)
    sums = np.stack([np.bincount(of, one, count) for one in place], axis=1)
    return np.where(area[:, None] > 0, sums / np.maximum(area, 1)[:, None], instead)


def _regions(ratio: Image, t: Contrast) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Labels (H, W) of regions that pass all but the gates of shape, of all that stands out about each by
    the same number where that has no other region in it, and the largest ratio in each."""
    above = ratio > min(t.edge, t.peak)
    count, labels = _components(above)
    where = np.flatnonzero(above.ravel())
    values, of = ratio.ravel()[where], labels.ravel()[where]
    all_of, everywhere = of, where
    peaks = _largest(values, of, count, t.peak)
    area = np.bincount(of, minlength=count)
    good = (peaks >= t.peak) & (area >= t.smallest_px)
    good[0] = False
    if good.any() and t.of_peak > 0:
        limit = np.where(good, t.of_peak * peaks, np.inf).astype(np.float32)
        keep = values >= limit[of]
        where, values = where[keep], values[keep]
        inner = np.zeros(ratio.size, bool)
        inner[where] = True
        count, labels = _components(inner.reshape(ratio.shape))
        of = labels.ravel()[where]
        peaks = _largest(values, of, count, t.peak)
        good, area = peaks >= t.peak, np.bincount(of, minlength=count)
    good &= (area >= t.smallest_px) & (area <= t.largest_px)
    good[0] = False
    if good.sum() > MOST_REGIONS:
        good &= peaks >= np.sort(peaks[good])[-MOST_REGIONS]
    number = np.zeros(count, np.int32)
    number[good] = np.arange(1, good.sum() + 1)
    # Few pixels are above a threshold: the others stay as they are.
    result = np.zeros(ratio.size, np.int32)
    result[where] = number[of]
    outer = np.zeros(ratio.size, np.int32)
    outer[everywhere] = all_of
    wholes = np.zeros(ratio.size, np.int32)
    wholes[everywhere] = _alone_in(outer[where], number[of], int(all_of.max(initial=0)) + 1)[all_of]
    return result.reshape(ratio.shape), wholes.reshape(ratio.shape), peaks[good]


def _alone_in(outer: NDArray[np.int32], inner: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """(count,) the number of the one region (P,) in each outer component (P,); 0 for none or several."""
    least = np.full(count, np.iinfo(np.int32).max, np.int32)
    most = np.zeros(len(least), np.int32)
    chosen = inner > 0
    np.minimum.at(least, outer[chosen], inner[chosen])
    np.maximum.at(most, outer[chosen], inner[chosen])
    return np.where(least == most, most, 0).astype(np.int32)


def _components(mask: Mask) -> tuple[int, NDArray[np.int32]]:
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    return count, np.asarray(labels, np.int32)


def _largest(values: Image, of: NDArray[np.int32], count: int, least: float) -> Array:
    """(count,) largest of values (P,) in each region; -inf where none is at least as large as ``least``."""
    high = values >= least
    found = np.full(count, -np.inf)
    np.maximum.at(found, of[high], values[high].astype(float))
    return found


def _features(
    labels: NDArray[np.int32], ratio: Image, smooth: Image, valid: Mask, found: Detections
) -> Array:
    count, peak = len(found), found.score
    inside = np.flatnonzero(labels)
    of = labels.ravel()[inside].astype(np.intp) - 1
    mean = np.bincount(of, ratio.ravel()[inside], count) / found.area
    bright = np.full(count, -np.inf)
    np.maximum.at(bright, of, smooth.ravel()[inside].astype(float))
    ring_largest, ring_mean = np.zeros(count), np.zeros(count)
    for row, (left, top, width, height) in enumerate(np.rint(found.box + 0.1).astype(int)):
        by = 4 + max(width, height) // 4
        part = np.s_[max(0, top - by) : top + height + by, max(0, left - by) : left + width + by]
        own = (labels[part] == row + 1).astype(np.uint8)
        near = cv2.dilate(own, np.ones((5, 5), np.uint8))
        far = cv2.dilate(near, np.ones((2 * (by - 2) + 1,) * 2, np.uint8))
        ring = ratio[part][(far > 0) & (near == 0)]
        if ring.size:
            ring_largest[row], ring_mean[row] = np.percentile(ring, 90), ring.mean()
    some = valid[::4, ::4]
    top_ratio = max(float(np.percentile(ratio[::4, ::4][some], 99.9)), 1.0)
    low, high = np.percentile(smooth[::4, ::4][some], [1, 99.9])
    return np.stack(
        [
            np.log(peak),
            np.log(found.area) / 2,
            np.log(found.axes[:, 0] / found.axes[:, 1]),
            found.area / (np.pi / 4 * found.axes.prod(axis=1)),
            mean / peak,
            ring_largest / peak,
            ring_mean / peak,
            np.log(peak / top_ratio),
            (bright - low) / max(float(high - low), 1e-9),
        ],
        axis=1,
    )


Image = NDArray[np.float32]
#: What a standard deviation is to the median absolute deviation, for normal noise.
MAD = 1.4826
#: Standard deviation of what rounding to whole numbers takes away.
ROUNDING = 12**-0.5
#: Pixels of a window's side after it was made smaller: finer says nothing of a median over so many.
COARSE = 15


def fill_invalid(image: NDArray[Any], valid: Mask) -> Image:
    """An image whose invalid pixels have the value of the nearest valid one.

    Parameters
    ----------
    image
        (H, W).
    valid
        (H, W) bool, some of it True.

    Returns
    -------
    (H, W) float32

    Raises
    ------
    WildlabError
        Where no pixel is valid.

    Examples
    --------
    >>> fill_invalid(np.array([[5.0, 0.0]]), np.array([[True, False]])).tolist()
    [[5.0, 5.0]]
    """
    if not valid.any():
        raise WildlabError("no pixel of the image is valid", "leave such frames out")
    plain = image.astype(np.float32)
    if valid.all():
        return plain
    labels = cv2.distanceTransformWithLabels(
        (~valid).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    values = np.zeros(int(labels.max()) + 1, np.float32)
    values[labels[valid]] = plain[valid]
    return np.asarray(values[labels])


def median_background(image: Image, window_px: int) -> Image:
    """Median over a square window about each pixel.

    Parameters
    ----------
    image
        (H, W), filled where it is not valid.
    window_px
        Side of the window, px.

    Returns
    -------
    (H, W) float32

    Notes
    -----
    The image is made smaller by whole numbers until the window has about `COARSE` pixels, and its numbers are
    put into 254 steps between its 0.1 and 99.9 per cent: coarser than the image, much finer than its noise.

    Examples
    --------
    >>> image = np.full((40, 40), 7, np.float32)
    >>> image[20, 20] = 900
    >>> float(median_background(image, 15)[20, 20])
    7.0
    """
    low, high = np.percentile(image[::4, ::4], [0.1, 99.9])
    step = max(float(high - low), 1e-6) / 254
    shrink = max(1, window_px // COARSE)
    size = (max(1, image.shape[1] // shrink), max(1, image.shape[0] // shrink))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if shrink > 1 else image
    steps = np.clip(np.rint((small - low) / step), 0, 255).astype(np.uint8)
    blurred = cv2.medianBlur(steps, max(3, (window_px // shrink) | 1))
    found = blurred.astype(np.float32) * np.float32(step) + np.float32(low)
    if shrink > 1:
        found = cv2.resize(found, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(found, np.float32)


def robust_deviation(contrast: Image, valid: Mask, least: float = 1e-6) -> float:
    """Standard deviation of an image about zero, by its median absolute value.

    Parameters
    ----------
    contrast
        (H, W).
    valid
        (H, W) bool.
    least
        What it is at least: of whole numbers `ROUNDING`, or even ground would have no noise at all.

    Returns
    -------
    float
        Of every fourth pixel in both directions.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(0, 3, (400, 400)).astype(np.float32)
    >>> round(robust_deviation(noise, np.ones((400, 400), bool)))
    3
    """
    some = contrast[::4, ::4][valid[::4, ::4]]
    some = some if some.size else contrast[valid]
    return max(MAD * float(np.median(np.abs(some))), least)


def local_deviation(contrast: Image, valid: Mask, window_px: int, least: float = 1e-6) -> Image:
    """The same about each pixel, at least 0.7 of that of the whole image.

    Parameters
    ----------
    contrast, valid, least
        As for `robust_deviation`.
    window_px
        Side of the window, px.

    Returns
    -------
    (H, W) float32
    """
    everywhere = robust_deviation(contrast, valid, least)
    there = MAD * median_background(np.abs(contrast), window_px)
    return np.asarray(np.maximum(there, 0.7 * everywhere), np.float32)


#: What lets through nearly all that is warm: the regression decides.
PERMISSIVE = Contrast(
    window_px=41, peak=4.0, edge=2.5, of_peak=0.6, smallest_px=6.0, largest_px=3000.0, longest=12.0
)
#: Half the weight of a squared coefficient beside the mean log loss: coefficients stay small where regions
#: are few. Chosen, not fitted.
RIDGE = 0.01


@dataclass(frozen=True)
class Shape:
    """A fitted regression, and what its regions come from.

    Attributes
    ----------
    regions
        Thresholds of the chain that gives the regions.
    mean, scale
        Of the features and their squares, that they are brought to one size by.
    weights
        Of each; empty: not fitted.
    bias
        What is added.
    least
        The log odds that a detection has at least.
    apart_px
        Of detections nearer than this the surest stays.
    """

    regions: Contrast = field(default=PERMISSIVE)
    mean: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    bias: float = 0.0
    least: float = 0.0
    apart_px: float = 10.0


def fit_shape(features: ArrayLike, wanted: ArrayLike, regions: Contrast) -> Shape:
    """Learn which regions are what was labelled.

    Parameters
    ----------
    features
        (N, F), of `wildlab.detection.contrast.Proposals`.
    wanted
        (N,) bool: which regions belong to a label.
    regions
        What the regions come from.

    Returns
    -------
    Shape

    Raises
    ------
    WildlabError
        Where all regions are wanted, or none is.

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=(200, FEATURES))
    >>> learnt = fit_shape(x, x[:, 1] > 0, PERMISSIVE)
    >>> print(np.mean((log_odds(learnt, x) > 0) == (x[:, 1] > 0)) > 0.95)
    True
    """
    X, y = _expanded(features), np.asarray(wanted, float)
    if not 0 < y.sum() < len(y):
        raise WildlabError(
            f"{int(y.sum())} of {len(y)} warm regions belong to a label",
            "give labelled frames that show what is looked for, and something else that is warm",
        )
    mean, scale = X.mean(axis=0), X.std(axis=0) + 1e-9
    Z = (X - mean) / scale

    def loss(w: Array) -> tuple[float, Array]:
        odds = Z @ w[1:] + w[0]
        over = 1 / (1 + np.exp(-np.clip(odds, -60, 60))) - y
        value = float(np.mean(np.logaddexp(0, odds) - y * odds) + RIDGE * w[1:] @ w[1:])
        return value, np.concatenate([[over.mean()], Z.T @ over / len(y) + 2 * RIDGE * w[1:]])

    w = minimize(loss, np.zeros(Z.shape[1] + 1), jac=True, method="L-BFGS-B").x
    plain = [tuple(float(one) for one in part) for part in (mean, scale, w[1:])]
    return Shape(regions, plain[0], plain[1], plain[2], float(w[0]))


def log_odds(learnt: Shape, features: ArrayLike) -> Array:
    """How sure the regression is of each region.

    Parameters
    ----------
    learnt
        From `fit_shape`.
    features
        (N, F).

    Returns
    -------
    (N,)

    Raises
    ------
    WildlabError
        Where nothing was fitted, or for other features.
    """
    X = _expanded(features)
    if len(learnt.weights) != X.shape[1] or not len(learnt.mean) == len(learnt.scale) == X.shape[1]:
        raise WildlabError(
            f"a classifier of shapes has {len(learnt.weights)} weights, and {X.shape[1]} are needed",
            "fit it to labelled frames, or name the thresholds.json of such a run",
        )
    return np.asarray(
        (X - np.array(learnt.mean)) / np.array(learnt.scale) @ np.array(learnt.weights) + learnt.bias
    )


def find_by_shape(image: NDArray[Any], valid: Mask, thresholds: Shape) -> Detections:
    """Things that stand out and have the shape of what was labelled.

    Parameters
    ----------
    image, valid
        As for `wildlab.detection.contrast.find_by_contrast`.
    thresholds
        From `fit_shape`.

    Returns
    -------
    Detections
        The score is the log odds.

    Raises
    ------
    WildlabError
        As `log_odds`, and where nothing is valid.
    """
    return choose(propose(image, valid, thresholds.regions), thresholds)


def choose(proposals: Proposals, learnt: Shape) -> Detections:
    """Of regions those that are sure enough.

    Parameters
    ----------
    proposals
        From `wildlab.detection.contrast.propose`.
    learnt
        From `fit_shape`.

    Returns
    -------
    Detections
        The score is the log odds.

    Raises
    ------
    WildlabError
        As `log_odds`.
    """
    odds = log_odds(learnt, proposals.features)
    found = proposals.detections.with_score(odds).select(odds >= learnt.least)
    return remove_near(found, learnt.apart_px)


def _expanded(features: ArrayLike) -> Array:
    x = np.asarray(features, float).reshape(-1, FEATURES)
    return np.concatenate([x, x**2], axis=1)
