"""Which photos, marks or clicks are far out? By what a photo's points, or a mark's sightings, share.

A mark whose surveyed place is wrong is off by the same in every photo; a photo whose pose is wrong shifts all
its marks; a wrong click stands alone. Each is held against the robust spread of its like, so that what is far
out does not set the measure. Marks first: a wrong mark pulls on photos that are right.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.robust import student_scale

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Names = NDArray[np.str_]
Kind = Literal["mark", "photo", "click"]

#: With normal errors a flight has a click, a photo or a mark that is far out with this probability each; what
#: several points share is far out only beyond so many spreads of a single point, too.
CHANCE, WORTH = 1e-3, 2.0
#: As few of a kind have no spread of their own.
FEWEST = 5
#: Standard error of a median over that of a mean.
_MEDIAN = 1.25


class Outlier(NamedTuple):
    """Something far out.

    Attributes
    ----------
    kind
        ``mark``, ``photo`` or ``click``.
    photo, mark
        Names; the photo of a mark in several photos is "", and so is the mark of a photo with several.
    points
        How many points it holds.
    off_m
        Length of the median of their errors, m.
    """

    kind: Kind
    photo: str
    mark: str
    points: int
    off_m: float


def find_outliers(
    whitened: ArrayLike, metres: ArrayLike, photo: ArrayLike, mark: ArrayLike
) -> tuple[tuple[Outlier, ...], Mask]:
    """What is far out, and the points that are not.

    Parameters
    ----------
    whitened
        (N, 2) residuals of equal standard deviation.
    metres
        (N, 2) the same in metres, north-east.
    photo, mark
        (N,) names; the mark is "" where it is not known.

    Returns
    -------
    outliers, inliers
        Largest first, and (N,) bool.

    Examples
    --------
    >>> z = np.random.default_rng(0).normal(size=(60, 2))
    >>> marks = np.tile(["a", "b", "c", "d", "e", "f"], 10)
    >>> z[marks == "b"] += 20.0
    >>> found, rest = find_outliers(z, z, np.repeat(np.arange(10).astype(str), 6), marks)
    >>> [(one.kind, one.mark, one.points) for one in found], int(rest.sum())
    ([('mark', 'b', 10)], 50)
    """
    z, e = np.asarray(whitened, float), np.asarray(metres, float)
    photos, marks = np.asarray(photo, str), np.asarray(mark, str)
    rest = np.ones(len(z), bool)
    found: list[Outlier] = []
    scale, every = student_scale((z**2).sum(axis=1)), len(np.unique(photos))

    def out(kind: Kind, rows: Mask) -> None:
        names = {"photo": np.unique(photos[rows]), "mark": np.unique(marks[rows])}
        one = {key: str(values[0]) if len(values) == 1 else "" for key, values in names.items()}
        off = float(np.hypot(*np.median(e[rows], axis=0)))
        found.append(Outlier(kind, one["photo"], one["mark"], int(rows.sum()), off))

    for name in _far_marks(z, e, marks, photos, rest & (marks != ""), scale):
        rows = rest & (marks == name)
        out("mark", rows)
        rest &= ~rows
    for name in _far_photos(z, photos, rest, scale):
        rows = rest & (photos == name)
        out("photo", rows)
        rest &= ~rows
    for row in np.flatnonzero(rest & (np.hypot(*z.T) > far_limit(len(z), every) * scale)):
        only = np.arange(len(z)) == row
        out("click", only)
        rest &= ~only
    return tuple(sorted(found, key=lambda one: -one.off_m)), rest


def far_limit(count: int, photos: int) -> float:
    """How many spreads the largest of so many normal errors in the plane exceeds with probability `CHANCE`.

    The spread is estimated itself, and points of a photo share its pose: it is known as well as from one
    error of each photo. The square over twice the spread's is distributed as F with 2 and ``2 photos``
    degrees of freedom, whose quantile has a closed form.

    Examples
    --------
    >>> round(far_limit(200, 40), 2), round(far_limit(200, 4000), 2)
    (5.34, 4.94)
    """
    return float(np.sqrt(2 * photos * np.expm1(np.log(max(count, 1) / CHANCE) / photos)))


def _far_marks(z: Array, e: Array, marks: Names, photos: Names, rows: Mask, scale: float) -> list[str]:
    """Names of the marks in several photos whose middle is far out, and about which most of its points lie.

    The middle is one of metres, for a wrong place is off by the same metres however near the camera was. It
    is held against the standard error of such a middle, in the metres that a standard deviation has there,
    and against the spread of the middles of all marks.
    """
    names = [name for name in np.unique(marks[rows]) if len(np.unique(photos[rows & (marks == name)])) > 1]
    sizes, errors, agree = np.zeros((3, len(names)))
    for i, name in enumerate(names):
        own = rows & (marks == name)
        middle = np.median(e[own], axis=0)
        length = np.hypot(*middle)
        with np.errstate(divide="ignore", invalid="ignore"):
            unit = np.nanmedian(np.hypot(*e[own].T) / np.hypot(*z[own].T))
        count = len(np.unique(photos[own]))
        sizes[i] = length / unit
        errors[i] = scale * (_MEDIAN if count > 2 else 1.0) / np.sqrt(count)
        agree[i] = (np.hypot(*(e[own] - middle).T) < length / 2).mean() > 0.5
    if len(names) >= FEWEST:
        errors = np.maximum(errors, student_scale(sizes**2))
    far = (
        (agree > 0)
        & (sizes > far_limit(len(names), len(np.unique(photos))) * errors)
        & (sizes > WORTH * scale)
    )
    return [str(name) for name, out in zip(names, far, strict=True) if out]


def _far_photos(z: Array, photos: Names, rows: Mask, scale: float) -> list[str]:
    """Names of the photos with several points whose middle is far out for photos (points share the pose)."""
    names, count = np.unique(photos[rows], return_counts=True)
    if len(names) < FEWEST:
        return []
    length = np.array([np.hypot(*np.median(z[rows & (photos == name)], axis=0)) for name in names])
    far = (
        (count > 1)
        & (length > far_limit(len(names), len(names)) * student_scale(length**2))
        & (length > WORTH * scale)
    )
    return [str(name) for name in names[far]]


#: A click is ambiguous where the nearest mark is not this many times as likely as the second nearest.
ODDS = 19.0


def largest_visible(marks: ArrayLike) -> float:
    """The error beyond which the nearest mark is usually another one: half the median spacing of the marks.

    Parameters
    ----------
    marks
        (M, 2) m.

    Returns
    -------
    float
        Infinite for one mark.

    Examples
    --------
    >>> largest_visible([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    5.0
    """
    xy = np.unique(np.asarray(marks, float), axis=0)
    if len(xy) < 2:
        return float("inf")
    apart = np.linalg.norm(xy[:, None] - xy, axis=2)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)) / 2)
