"""A new set of particles from the old one, where too few of them carry the weight; F 4.2.4."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.particles.clouds import Cloud, effective_size
from wildlab.tracking.particles.kernels import pick, take

#: ``multinomial`` draws with replacement, as F has it; ``systematic`` takes points at equal distances.
SCHEMES = ("multinomial", "systematic")
#: F's share of the particles at which SIS resamples, beside (4.14).
FLODELL_THRESHOLD = 2 / 3


def resample(
    cloud: Cloud,
    rng: np.random.Generator,
    scheme: str = "multinomial",
    threshold: float = FLODELL_THRESHOLD,
) -> tuple[Cloud, NDArray[np.bool_]]:
    """Draw the particles anew of those animals whose effective size has fallen to the threshold.

    Parameters
    ----------
    cloud
        Of A animals.
    rng
        Random numbers.
    scheme
        One of `SCHEMES`. Both give a particle N times its weight of copies in the mean; systematic ones
        differ from that by less than one copy.
    threshold
        Share of the number of particles. 1 resamples always, which is SIR; less is SIS, with F's 2/3.

    Returns
    -------
    cloud, resampled
        Where it was resampled, (A,) bool, weights are equal.

    Raises
    ------
    WildlabError
        For a scheme that there is not, or a threshold that is not from 0 to 1.
    """
    if not 0 <= threshold <= 1:
        raise WildlabError(
            f"a threshold of {threshold} of the particles", "give 0 to 1, where 1 is SIR", field="threshold"
        )
    N = cloud.w.shape[1]
    due = effective_size(cloud.w) <= threshold * N * (1 + 1e-9)  # sums are rounded
    if not due.any():
        return cloud, due
    chosen = draw(cloud.w[due], rng, scheme)
    if due.all():
        return Cloud(take(np.ascontiguousarray(cloud.x), chosen), np.full_like(cloud.w, 1 / N)), due
    x, w = cloud.x.copy(), cloud.w.copy()
    x[due] = take(cloud.x[due], chosen)
    w[due] = 1 / N
    return Cloud(x, w), due


def draw(w: ArrayLike, rng: np.random.Generator, scheme: str = "multinomial") -> NDArray[np.int64]:
    """Which particles to take, as many as there were.

    Parameters
    ----------
    w
        (A, N) weights that sum to one.
    rng
        Random numbers.
    scheme
        One of `SCHEMES`.

    Returns
    -------
    (A, N) indices along the last axis, ascending; never one of a particle without weight.

    Raises
    ------
    WildlabError
        For a scheme that there is not.

    Examples
    --------
    >>> print(draw([[0.0, 0.5, 0.0, 0.5]], np.random.default_rng(1), "systematic"))
    [[1 1 3 3]]
    """
    weights = np.atleast_2d(np.asarray(w, float))
    A, N = weights.shape
    if scheme == "systematic":
        points = (np.arange(N) + rng.random((A, 1))) / N
    elif scheme == "multinomial":
        points = _sorted_uniform(A, N, rng)
    else:
        raise WildlabError(
            f"there is no resampling called {scheme!r}", f"take one of {', '.join(SCHEMES)}", field="scheme"
        )
    cumulative = np.cumsum(weights, axis=1)
    cumulative /= cumulative[:, -1:]
    return pick(cumulative, np.minimum(points, np.nextafter(1.0, 0.0)))


def _sorted_uniform(A: int, N: int, rng: np.random.Generator) -> Array:
    """Independent numbers from 0 to 1 in order, (A, N): sums of exponential gaps, without sorting."""
    gaps = np.cumsum(rng.standard_exponential((A, N + 1)), axis=1)
    return np.asarray(gaps[:, :-1] / gaps[:, -1:])
