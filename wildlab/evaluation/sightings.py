"""Several sightings of the same thing: what averaging them gains, and how consistent they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.runs import Interval, mean_interval
from wildlab.geometry.robust import student_scale

Array = NDArray[np.float64]

#: Fewer things than this say nothing for the others.
FEWEST = 5


class Averaged(NamedTuple):
    """What averaging sightings of the same thing gained.

    Attributes
    ----------
    k
        How many images were averaged.
    single, averaged
        Mean error of one image and of the average, m, over the same things.
    ratio
        Averaged over single, with its interval over the things.
    things
        How many there are.
    """

    k: int
    single: float
    averaged: float
    ratio: Interval
    things: int

    @property
    def helps(self) -> bool:
        """Whether the interval of the ratio lies below one."""
        return self.ratio.high < 1

    @property
    def halves(self) -> bool:
        """Whether the ratio is a half, within a tenth of it, and known to lie below two thirds."""
        return 0.45 <= self.ratio.estimate <= 0.55 and self.ratio.high < 2 / 3


def try_averaging(
    errors: ArrayLike,
    thing: ArrayLike,
    image: ArrayLike,
    rng: np.random.Generator,
    k: int = 4,
    draws: int = 40,
) -> Averaged | None:
    """Average ``k`` sightings of the same thing from different images, and see how far off that is.

    Parameters
    ----------
    errors
        (N, 2) north-east, m; rows with NaN are left out.
    thing, image
        (N,) names; "" is a thing that is not known.
    rng
        Picks the images.
    k
        How many are averaged.
    draws
        How often, for each thing.

    Returns
    -------
    Averaged or None
        None where fewer than five things are in ``k`` images.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> things, images = np.repeat(np.arange(30), 8), np.tile(np.arange(8), 30)
    >>> try_averaging(rng.normal(size=(240, 2)), things, images, rng).halves
    True
    """
    e, names, images = np.asarray(errors, float), np.asarray(thing).astype(str), np.asarray(image).astype(str)
    keep = np.isfinite(e).all(axis=1) & (names != "")
    singles, averages = [], []
    for name in np.unique(names[keep]):
        rows = np.flatnonzero(keep & (names == name))
        # One sighting of each image: those of one share its pose.
        rows = rows[np.unique(images[rows], return_index=True)[1]]
        if len(rows) < k:
            continue
        picked = np.stack([rng.permutation(rows)[:k] for _ in range(draws)])
        singles.append(np.hypot(*e[rows].T).mean())
        averages.append(np.hypot(*e[picked].mean(axis=1).T).mean())
    if len(singles) < FEWEST:
        return None
    single, averaged = float(np.mean(singles)), float(np.mean(averages))
    # The ratio of the means, with the spread over the things of what is left of it.
    left = mean_interval(np.array(averages) - averaged / single * np.array(singles), 0.9)
    half = (left.high - left.low) / 2 / single
    ratio = averaged / single
    return Averaged(k, single, averaged, Interval(ratio, ratio - half, ratio + half), len(singles))


class Spread(NamedTuple):
    """How far sightings of the same thing lie apart, where nobody knows where it is.

    Attributes
    ----------
    sd
        Robust standard deviation of one sighting about the middle of its thing, m per axis.
    consistent
        Ratio of that spread to what the ellipses say, one where they are honest; NaN without ellipses.
    things, sightings
        What it rests on.
    """

    sd: float
    consistent: float
    things: int
    sightings: int


def spread_of_sightings(
    positions: ArrayLike, thing: ArrayLike, image: ArrayLike, covariances: ArrayLike | None = None
) -> Spread | None:
    """Spread of sightings of the same things from different images.

    A thing seen in n images scatters about its own middle by ``sqrt((n - 1) / n)`` of the standard deviation;
    that is put right. What all images share is not seen.

    Parameters
    ----------
    positions
        (N, 2) north-east, m; rows with NaN are left out.
    thing, image
        (N,) names; "" is a thing that is not known.
    covariances
        (N, 2, 2) m^2, what the ellipses say.

    Returns
    -------
    Spread or None
        None where nothing was seen in two images.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> things, images = np.repeat(np.arange(50), 6), np.tile(np.arange(6), 50)
    >>> found = spread_of_sightings(rng.normal(0, 3.0, (300, 2)), things, images)
    >>> bool(abs(found.sd - 3.0) < 0.3)
    True
    """
    p, names, images = (
        np.asarray(positions, float),
        np.asarray(thing).astype(str),
        np.asarray(image).astype(str),
    )
    keep = np.isfinite(p).all(axis=1) & (names != "")
    apart, scaled, things = [], [], 0
    for name in np.unique(names[keep]):
        rows = np.flatnonzero(keep & (names == name))
        n = len(np.unique(images[rows]))
        if n < 2:
            continue
        things += 1
        d = (p[rows] - p[rows].mean(axis=0)) * np.sqrt(n / (n - 1))
        apart.append((d**2).sum(axis=1))
        if covariances is not None:
            P = np.asarray(covariances, float)[rows]
            scaled.append(np.einsum("ni,ni->n", d, np.linalg.solve(P, d[..., None])[..., 0]))
    if not things:
        return None
    squared = np.concatenate(apart)
    ratio = student_scale(np.concatenate(scaled)) if scaled else float("nan")
    return Spread(student_scale(squared), ratio, things, len(squared))
