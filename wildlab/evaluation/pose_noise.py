"""How noisy were poses and pixels? Standard deviations estimated from the errors of known points.

Every image has a pose error of its own: position (three axes), two tilts and a heading. It moves all points
of the image together, each through its own derivative, and that tells it from the error of single pixels,
where clicking and an imperfect lens model end up. The standard deviations are those under which the observed
errors are most likely, with a broad prior about the ones assumed, so that what the data cannot decide stays
put.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

Array = NDArray[np.float64]

#: Which of the six pose errors (north, east, down, two tilts, heading) share a standard deviation. The
#: pixel's (both axes) stands last and is each point's own.
KINDS: dict[str, tuple[int, ...]] = {
    "position_horizontal": (0, 1),
    "position_vertical": (2,),
    "tilt": (3, 4),
    "heading": (5,),
    "pixel": (),
}
#: Standard deviation of the prior on the logarithm: a factor of three either way.
PRIOR = np.log(3.0)
#: How many times as far off as the others an image is that is far out.
FAR = 10.0


class PoseNoise(NamedTuple):
    """Estimated standard deviations by :data:`KINDS` (metres, radians, pixels) and how well each is decided.

    ``factor`` is what one standard deviation of the estimate multiplies or divides by: near 3 the data said
    nothing, near 1 they decided.
    """

    sd: dict[str, float]
    factor: dict[str, float]


def estimate_pose_noise(
    errors: ArrayLike,
    derivatives: ArrayLike,
    pixel_derivatives: ArrayLike,
    noise: ArrayLike,
    image: ArrayLike,
    assumed: dict[str, float],
    far_out: float = 0.0,
) -> PoseNoise:
    """Most likely standard deviations of the pose and pixel errors behind the errors of known points.

    Parameters
    ----------
    errors
        (N, 2) north-east in n, metres, computed minus known. A row with NaN here, in ``derivatives`` or in
        ``noise`` is left out.
    derivatives
        (N, 2, 6) of each point with respect to north, east, down (m), two tilts and the heading (rad).
    pixel_derivatives
        (N, 2, 2) of each point with respect to its pixel, m per pixel.
    noise
        (N, 2, 2) covariance, m^2, of what else is each point's own and known: plane height, survey.
    image
        (N,) which image each belongs to.
    assumed
        Standard deviations by :data:`KINDS` about which the prior lies, above zero: m, rad, pixels.
    far_out
        Share of the images, below one, that is taken to be :data:`FAR` times as far off as the others
        (Tukey's contaminated normal distribution); zero takes all for normal.

    Returns
    -------
    PoseNoise

    Raises
    ------
    ValueError
        Where fewer than three images have a usable point.
    """
    e, J, Ju, R = (np.asarray(a, float) for a in (errors, derivatives, pixel_derivatives, noise))
    keep = np.isfinite(e).all(axis=1) & np.isfinite(J).all(axis=(1, 2)) & np.isfinite(R).all(axis=(1, 2))
    labels = np.asarray(image)[keep]
    e, J, R, own_pixel = e[keep], J[keep], R[keep], (Ju @ np.swapaxes(Ju, 1, 2))[keep]
    blocks = _by_points(labels, e, J, R, own_pixel)
    if sum(len(residual) for residual, *_ in blocks) < 3:
        raise ValueError("fewer than three images with known points: their noise cannot be estimated")
    start = np.log([assumed[kind] for kind in KINDS])

    def log_density(squared: Array, size: int) -> Array:
        if not far_out:
            return -0.5 * squared
        usual = np.log1p(-far_out) - 0.5 * squared
        far = np.log(far_out) - size * np.log(FAR) - 0.5 * squared / FAR**2
        return np.asarray(np.logaddexp(usual, far))

    def negative_log_posterior(log_sd: Array) -> float:
        variance = np.empty(6)
        for kind, value in zip(KINDS, log_sd, strict=True):
            variance[list(KINDS[kind])] = np.exp(2 * value)
        pixel = np.exp(2 * log_sd[-1])
        total = 0.5 * np.sum(((log_sd - start) / PRIOR) ** 2)
        for residual, derivative, own, of_pixel in blocks:
            spread = derivative * variance @ np.swapaxes(derivative, 1, 2)
            L = np.linalg.cholesky(own + pixel * of_pixel + spread)
            z = np.linalg.solve(L, residual[..., None])
            squared = (z**2).sum(axis=(1, 2))
            total += np.log(np.diagonal(L, axis1=1, axis2=2)).sum() - log_density(squared, z.shape[1]).sum()
        return float(total)

    # Bounded, for the first step along a steep slope would otherwise leap to where no prior brings it back.
    bounds = [(s - 4 * PRIOR, s + 4 * PRIOR) for s in start]
    found = minimize(negative_log_posterior, start, method="L-BFGS-B", bounds=bounds)
    curvature = _second_derivatives(negative_log_posterior, found.x)
    factor = np.exp(np.sqrt(np.clip(np.diag(np.linalg.inv(curvature)), 0, None)))
    return PoseNoise(
        sd=dict(zip(KINDS, map(float, np.exp(found.x)), strict=True)),
        factor=dict(zip(KINDS, map(float, factor), strict=True)),
    )


def _by_points(
    labels: NDArray[Any], e: Array, J: Array, R: Array, own_pixel: Array
) -> list[tuple[Array, Array, Array, Array]]:
    """Residuals (K, 2m), derivatives (K, 2m, 6) and both covariances (K, 2m, 2m) of the K images that have m
    points each, for every m: images of one size are worked on together."""
    _, which, points = np.unique(labels, return_inverse=True, return_counts=True)
    order = np.argsort(which, kind="stable")
    blocks = []
    for m in np.unique(points):
        rows = order[points[which[order]] == m].reshape(-1, m)
        k = len(rows)
        each = np.zeros((2, k, m, 2, m, 2))
        for i in range(m):
            each[0, :, i, :, i], each[1, :, i, :, i] = R[rows[:, i]], own_pixel[rows[:, i]]
        own, of_pixel = each.reshape(2, k, 2 * m, 2 * m)
        blocks.append((e[rows].reshape(k, 2 * m), J[rows].reshape(k, 2 * m, 6), own, of_pixel))
    return blocks


def _second_derivatives(function: Callable[[Array], float], x: Array, h: float = 1e-3) -> Array:
    """Hessian (n, n) by central differences."""
    steps = h * np.eye(len(x))
    return np.array(
        [
            [
                (function(x + a + b) - function(x + a - b) - function(x - a + b) + function(x - a - b))
                / (4 * h * h)
                for b in steps
            ]
            for a in steps
        ]
    )


#: Samples in a row of which a parabola leaves one residual.
SAMPLES = 4
#: Samples further apart than this many usual intervals are no neighbours.
NEIGHBOURS = 3.0


def estimate_position_noise(times: ArrayLike, positions: ArrayLike) -> Array:
    """Standard deviation of white noise that makes a smooth motion as rough as logged positions are.

    Residuals of a parabola through each four successive positions, by their root mean square. It is no bound
    on the whole error: of an error that wanders over seconds or minutes, as satellite positions have, only
    what changes between samples is seen, and what is constant not at all. Where a target turns within few
    samples, its motion is in it.

    Parameters
    ----------
    times
        (N,) s; a repeated or earlier stamp is left out.
    positions
        (N, k) m; rows with NaN are left out.

    Returns
    -------
    (k,)
        m, of each axis; NaN where there are no four samples in a row.

    Examples
    --------
    A receiver at rest, positions in steps of a metre, one of them wrong by one:

    >>> estimate_position_noise(range(5), [[0.0], [0.0], [1.0], [0.0], [0.0]]).round(2)
    array([0.67])
    """
    at, z = np.asarray(times, float), np.asarray(positions, float)
    good = np.isfinite(at) & np.isfinite(z).all(axis=1)
    at, z = at[good], z[good]
    later = np.diff(np.maximum.accumulate(at), prepend=-np.inf) > 0 if len(at) else good[:0]
    at, z = at[later], z[later]
    if len(at) < SAMPLES:
        return np.full(z.shape[1], np.nan)
    rows = np.arange(len(at) - SAMPLES + 1)[:, None] + np.arange(SAMPLES)
    steps = np.diff(at)
    rows = rows[np.diff(at[rows], axis=1).max(axis=1) <= NEIGHBOURS * np.median(steps)]
    if not len(rows):
        return np.full(z.shape[1], np.nan)
    # Lagrange's weights of the third divided difference: orthogonal to every parabola.
    apart = at[rows][:, :, None] - at[rows][:, None, :]
    apart[:, range(SAMPLES), range(SAMPLES)] = np.median(steps)
    weights = 1 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    residuals = np.einsum("ns,nsk->nk", weights, z[rows] - z[rows[:, :1]])
    return np.asarray(np.sqrt(np.mean(residuals**2, axis=0)))
