"""Position errors against truth: how large, how biased, and where they come from."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class ErrorSummary(NamedTuple):
    """Horizontal errors of N positions, metres.

    ``mae`` of H tables 5.4-5.7 is ``mean``: the mean of the distance to the truth.
    """

    n: int
    mean: float
    median: float
    p90: float
    max: float
    bias_north: float
    bias_east: float
    sd_north: float
    sd_east: float


def summarise(errors: ArrayLike) -> ErrorSummary:
    """Summary of horizontal errors.

    Parameters
    ----------
    errors
        (N, 2) north, east in n, m; rows with NaN are left out.

    Returns
    -------
    ErrorSummary
        All NaN beside an ``n`` of 0 where no row is left. Biases have the sign of the errors.
    """
    e = np.asarray(errors, float).reshape(-1, 2)
    e = e[np.isfinite(e).all(axis=1)]
    if not len(e):
        return ErrorSummary(0, *[float("nan")] * 8)
    distance = np.hypot(*e.T)
    sd = e.std(axis=0, ddof=1) if len(e) > 1 else np.full(2, np.nan)
    return ErrorSummary(
        len(e),
        *(
            float(x)
            for x in (distance.mean(), np.median(distance), np.quantile(distance, 0.9), distance.max())
        ),
        *(float(x) for x in (*e.mean(axis=0), *sd)),
    )


#: Errors beside another of their image from which the spread within images is estimated, at least: its
#: standard deviation is then known to about a quarter.
FEWEST_WITHIN = 10


class Scatter(NamedTuple):
    """Mean squared horizontal error split into what is constant, per image, and within images.

    Shares add up to one (up to the noise of the estimate of the middle one); ``between_sd``, ``within_sd``
    and ``bias``, the mean, are metres per axis (north, east).
    """

    bias_share: float
    image_share: float
    within_share: float
    between_sd: Array
    within_sd: Array
    bias: Array
    whole_m: float

    @property
    def parts_m(self) -> tuple[float, float, float]:
        """Root mean squares of the constant part, that of images and that within them: m, horizontal. The
        shares are those of their squares."""
        bias, image, within = (float(np.hypot(*of)) for of in (self.bias, self.between_sd, self.within_sd))
        return bias, image, within


def scatter_by_image(errors: ArrayLike, image: ArrayLike) -> Scatter:
    """Where errors come from: a constant, each image's own pose, or single clicks.

    One-way analysis of variance with images as the groups, per axis.

    Parameters
    ----------
    errors
        (N, 2) north, east in n, m; rows with NaN are left out.
    image
        (N,) which image each belongs to: numbers or names.

    Returns
    -------
    Scatter
        All NaN where fewer than two images are left, or fewer than `FEWEST_WITHIN` errors beside another of
        their image: how errors within an image differ is then anybody's guess.
    """
    e = np.asarray(errors, float).reshape(-1, 2)
    keep = np.isfinite(e).all(axis=1)
    e, group = e[keep], np.unique(np.asarray(image)[keep], return_inverse=True)[1]
    count = np.bincount(group)
    n, k = len(e), len(count)
    if n - k < FEWEST_WITHIN or k < 2:
        nan = np.full(2, np.nan)
        return Scatter(float("nan"), float("nan"), float("nan"), nan, nan, nan, float("nan"))
    mean = e.mean(axis=0)
    of_image = np.stack([np.bincount(group, weights=e[:, axis]) / count for axis in (0, 1)], axis=-1)
    within = ((e - of_image[group]) ** 2).sum(axis=0) / (n - k)
    mean_square = (count[:, None] * (of_image - mean) ** 2).sum(axis=0) / (k - 1)
    usual = (n - (count**2).sum() / n) / (k - 1)
    between = np.maximum((mean_square - within) / usual, 0.0)
    parts = np.array([(mean**2).sum(), between.sum(), within.sum()])
    bias, image_share, within_share = (float(x) for x in parts / parts.sum())
    whole = float(np.sqrt((e**2).sum(axis=1).mean()))
    return Scatter(bias, image_share, within_share, np.sqrt(between), np.sqrt(within), mean, whole)


def bootstrap_interval(
    statistic: Callable[[Array], float],
    errors: ArrayLike,
    image: ArrayLike,
    rng: np.random.Generator,
    draws: int = 1000,
    level: float = 0.9,
) -> tuple[float, float]:
    """Interval for a statistic of errors, by drawing whole images again and again.

    Errors of one image share its pose: drawing single clicks would give intervals that are far too narrow.

    Parameters
    ----------
    statistic
        Takes errors (M, 2) and gives a number. M changes from draw to draw where images have different
        numbers of errors.
    errors
        (N, 2) north, east in n, m; rows with NaN are left out.
    image
        (N,) which image each belongs to. It may name anything that shares its error, a minute of a flight
        for instance.
    rng
        What the images are drawn with.
    draws
        How often, at least once. Each draws as many images as there are, with replacement.
    level
        Share of the draws that the interval holds, between 0 and 1.

    Returns
    -------
    low, high
        Ends of the middle ``level`` of the draws, in the unit of the statistic; NaN where no error is left.
    """
    e = np.asarray(errors, float).reshape(-1, 2)
    keep = np.isfinite(e).all(axis=1)
    e, group = e[keep], np.unique(np.asarray(image)[keep], return_inverse=True)[1]
    if not len(e):
        return float("nan"), float("nan")
    members = [np.flatnonzero(group == g) for g in range(group.max() + 1)]
    values = []
    for _ in range(draws):
        picked = rng.integers(0, len(members), len(members))
        values.append(statistic(e[np.concatenate([members[g] for g in picked])]))
    low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
