"""How probable measurements, and their absence, are where a particle is: F (4.11), F 4.2.2."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.validation import check_covariance

#: Places (..., 2) m -> probability that an image has a detection of an animal that is there.
Sight = Callable[[Array], Array]
#: Places (..., 2) m -> what a sensor would measure of an animal there, (..., m).
Measure = Callable[[Array], Array]


def log_likelihood(positions: ArrayLike, z: ArrayLike, R: ArrayLike, measure: Measure | None = None) -> Array:
    """Of all measurements that a track was given, F (4.11): each one's, multiplied.

    Several measurements of one animal in one image count as independent looks at it. Where they are pieces of
    one outline, or of animals side by side, the estimate is surer of itself than it should be.

    Parameters
    ----------
    positions
        (..., 2) m of the particles.
    z
        (M, m), or (m,) for one: on the ground, m, or what ``measure`` gives, such as pixels.
    R
        Their covariances, (M, m, m) or (m, m) for all.
    measure
        What a sensor would have measured of an animal at each place; NaN where it can not be seen.
        Measurements are positions where not given.

    Returns
    -------
    (...) with the constant of the normal distribution; 0 for no measurement, minus infinity where an animal
    could not have been measured.

    Raises
    ------
    WildlabError
        Where an ``R`` is no covariance or has no inverse.

    Examples
    --------
    >>> print(np.round(log_likelihood([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0]], np.eye(2)), 3))
    [-1.838 -3.838]
    """
    x, found = np.asarray(positions, float), np.atleast_2d(np.asarray(z, float))
    total = np.zeros(x.shape[:-1])
    if not found.size:
        return total
    m = found.shape[-1]
    covariances = np.broadcast_to(np.asarray(R, float), (len(found), m, m))
    check_covariance(covariances, "R")
    try:
        roots = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError as error:
        raise WildlabError(
            "the covariance of a measurement has no inverse", "give noise in every direction", field="R"
        ) from error
    expected = x if measure is None else np.asarray(measure(x), float)
    for one, root in zip(found, roots, strict=True):
        white = (one - expected) @ np.linalg.inv(root).T
        constant = m / 2 * np.log(2 * np.pi) + np.log(np.diagonal(root)).sum()
        total -= 0.5 * np.einsum("...i,...i->...", white, white) + constant
    return np.asarray(np.where(np.isnan(total), -np.inf, total))


def sight_of(mask: ArrayLike, north: float, east: float, step: float, probability: float = 1.0) -> Sight:
    """A footprint as a function of places, from the nodes of a grid that an image shows.

    Parameters
    ----------
    mask
        (rows to the north, columns to the east): bool where a node is in the footprint and nothing hides it,
        or the probability of detection there.
    north, east
        Of the first node, m.
    step
        Between nodes, m.
    probability
        With which the detector finds an animal that is in sight.

    Returns
    -------
    Sight
        Of the node nearest to a place; 0 off the grid.

    Raises
    ------
    WildlabError
        Where a probability is not from 0 to 1, or the step not above zero.

    Examples
    --------
    >>> sight = sight_of([[True, False], [True, True]], north=0.0, east=0.0, step=10.0, probability=0.8)
    >>> print(sight(np.array([[1.0, 2.0], [1.0, 8.0], [-20.0, 0.0]])))
    [0.8 0.  0. ]
    """
    shown = probability * np.asarray(mask, float)
    if not ((shown >= 0) & (shown <= 1)).all() or not step > 0:
        raise WildlabError(
            "a mask of probabilities outside 0 to 1, or a step that is not above zero",
            "give bools or probabilities of detection, and metres between nodes",
            field="mask",
        )
    rows, columns = shown.shape

    def sight(places: Array) -> Array:
        at = np.asarray(places, float)
        i, j = (np.rint((at[..., a] - start) / step) for a, start in enumerate((north, east)))
        on = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        row, column = (np.where(on, one, 0).astype(np.intp) for one in (i, j))
        return np.asarray(np.where(on, shown[row, column], 0.0))

    return sight
