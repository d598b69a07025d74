"""Errors of points whose poses wander: their covariance, estimated by restricted likelihood.

The errors of N points are ``r = J x + Z m + G a + e``. ``J x`` are constants that all images share, ``Z m``
the errors of the places of things, ``e`` is each point's own (pixel and ground height), and ``a`` is the pose
error of its image: position in n and rotation vector in n. Part of ``a`` is each image's own, the rest is a
first-order Gauss-Markov process, whose correlation falls by e in a time constant, one of positions, tilts
and headings each: a heading is seen less well than a tilt, and wanders for longer. A constant counts only
against that: what wanders for longer than a flight looks constant in it.

The standard deviations, the share that wanders and its time constants maximise the likelihood of what neither
``J x`` nor ``Z m`` can explain (REML: Patterson and Thompson 1971), with a broad prior about what was
assumed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from wildlab.evaluation.pose_noise import KINDS, PRIOR
from wildlab.geometry.compilation import compiled

Array = NDArray[np.float64]

#: Standard deviation of the prior on the logit of the share.
PRIOR_SHARE = 1.5
#: Time constants of positions, tilts and headings about which their priors lie, s: minutes for a satellite
#: fix and a heading, tens of seconds for a tilt (H 5.6). Where images have no times, images.
LASTS_S, LASTS_IMAGES = (60.0, 20.0, 60.0), (10.0, 3.0, 10.0)
#: Which of them each of the six pose errors has.
_LASTS = [0, 0, 0, 1, 1, 2]


class PosePoints(NamedTuple):
    """N points, as far as their covariance depends on them.

    Attributes
    ----------
    derivatives
        (N, 2, 6) of each point with respect to position (m) and rotation vector (rad) in n.
    pixel, own
        (N, 2, 2) covariance, m^2, of a pixel error of one pixel, and of what else is each point's own.
    time
        (N,) of its image, s; points of one image have the same.
    """

    derivatives: Array
    pixel: Array
    own: Array
    time: Array

    def take(self, rows: NDArray[np.bool_]) -> PosePoints:
        """Some of the points."""
        return PosePoints(*(values[rows] for values in self))


class Places(NamedTuple):
    """What N points are of, and how well it is known where that is.

    Attributes
    ----------
    of
        (N,) names.
    sd
        (N,) standard deviation of the place along either axis, m; infinite where nothing is known of it.
    moves
        (N,) whether the place is from a receiver's log: its error then wanders as that of logged positions
        does, with the same time constant. Others are off by the same all the time.
    """

    of: NDArray[np.generic]
    sd: Array
    moves: NDArray[np.bool_]

    def take(self, rows: NDArray[np.bool_]) -> Places:
        """Of some of the points."""
        return Places(self.of[rows], self.sd[rows], self.moves[rows])

    def loadings(self, moves: bool) -> Array:
        """(N, 2, 2 K) of the errors of the K places that move, or of the others, in their own sizes."""
        names = np.unique(self.of[self.moves == moves])
        size = np.where(self.moves == moves, np.where(np.isfinite(self.sd), self.sd, 1.0), 0.0)
        return np.kron(size[:, None] * (self.of[:, None] == names), np.eye(2)).reshape(len(size), 2, -1)


class WanderNoise(NamedTuple):
    """How noisy poses and pixels are.

    Attributes
    ----------
    sd
        Standard deviations by `wildlab.evaluation.pose_noise.KINDS`: m, rad, pixels.
    share
        Of the variance of pose errors that wanders; the rest is each image's own.
    lasts
        Time constants of what wanders in positions, tilts and headings, s.
    """

    sd: dict[str, float]
    share: float
    lasts: tuple[float, float, float]

    @property
    def logarithms(self) -> Array:
        """(9,) of standard deviations and time constants, and the logit of the share."""
        logit = np.log(self.share / (1 - self.share))
        return np.append(np.log([*self.sd.values(), *self.lasts]), logit)

    @staticmethod
    def from_logarithms(x: Array) -> WanderNoise:
        """The noise whose logarithms (9,) these are."""
        *sd, position, tilt, heading = map(float, np.exp(x[:-1]))
        share = float(1 / (1 + np.exp(-x[-1])))
        return WanderNoise(dict(zip(KINDS, sd, strict=True)), share, (position, tilt, heading))


@dataclass(frozen=True)
class WanderFit:
    """Estimated noise.

    Attributes
    ----------
    noise
        The most likely one.
    posterior
        Negative logarithm of the posterior of its logarithms (9,).
    """

    noise: WanderNoise
    posterior: Callable[[Array], float]

    @cached_property
    def uncertainty(self) -> Array:
        """(9, 9) covariance of these logarithms, by the curvature of the posterior."""
        return np.asarray(np.linalg.inv(_second_derivatives(self.posterior, self.noise.logarithms)))


class Covariance:
    """The covariance of the errors of N points; cost grows with the number of images.

    Parameters
    ----------
    points
        The points.
    noise
        Of their poses and pixels.
    places
        Of what the points are, where errors of their places are not negligible.

    Examples
    --------
    >>> points = PosePoints(np.zeros((1, 2, 6)), np.eye(2)[None], np.zeros((1, 2, 2)), np.zeros(1))
    >>> sd = {**dict.fromkeys(KINDS, 1.0), "pixel": 2.0}
    >>> Covariance(points, WanderNoise(sd, 0.5, LASTS_S)).weigh(np.ones((1, 2, 1)))[0].tolist()
    [[0.5]]
    """

    def __init__(self, points: PosePoints, noise: WanderNoise, places: Places | None = None) -> None:
        when, image = np.unique(points.time, return_inverse=True)
        self._order = np.argsort(image, kind="stable")
        self._image = image[self._order]
        sd = np.array([noise.sd[kind] for kind, axes in KINDS.items() for _ in axes])
        G, lasts = points.derivatives * sd, np.take(noise.lasts, _LASTS)
        self._places = None
        if places is not None:
            moving, still = places.loadings(True), places.loadings(False)
            G = np.concatenate([G, moving], axis=2)
            lasts = np.append(lasts, np.full(moving.shape[2], noise.lasts[0]))
            self._places = still, np.isfinite(places.sd).all() * np.eye(still.shape[2])
        self._G = np.ascontiguousarray(G[self._order])
        self._own = (points.own + noise.sd["pixel"] ** 2 * points.pixel)[self._order]
        self._rho = np.minimum(np.exp(-np.diff(when)[:, None] / lasts), 1 - 1e-6)
        self._share = np.where(np.arange(len(lasts)) < len(_LASTS), noise.share, 1.0)

    def weigh(self, B: Array) -> tuple[Array, float]:
        """Products of the columns of B by the inverse covariance; its logarithmic determinant.

        Parameters
        ----------
        B
            (N, 2, K); where places are not known, what they explain of it counts for nothing.

        Returns
        -------
        (K, K), float
        """
        if self._places is None:
            return self._weigh(B)
        Z, prior = self._places
        inner, logarithm = self._weigh(np.concatenate([Z, B], axis=-1))
        n = len(prior)
        information, across = inner[:n, :n] + prior, inner[:n, n:]
        factor = np.linalg.cholesky(information)
        explained = solve_triangular(factor, across, lower=True)
        logarithm += float(2 * np.log(np.diagonal(factor)).sum())
        return np.asarray(inner[n:, n:] - explained.T @ explained), logarithm

    def _weigh(self, B: Array) -> tuple[Array, float]:
        """The same with places that are known."""
        columns = np.ascontiguousarray(B[self._order])
        W, T, logarithm = weigh_chain(self._G, self._own, columns, self._image, self._rho, self._share)
        W, T = W.reshape(-1, B.shape[-1]), T.reshape(-1, B.shape[-1])
        return np.asarray(W.T @ W - T.T @ T), logarithm


class LinearFit(NamedTuple):
    """Generalised least squares.

    Attributes
    ----------
    x
        (P,) that makes ``r + J x`` least.
    information
        (P, P), inverse covariance of x.
    deviance
        Squared length of ``r + J x`` in units of the covariance.
    """

    x: Array
    information: Array
    deviance: float


def fit_generalised(J: Array, r: Array, covariance: Covariance) -> LinearFit:
    """The ``x`` under which residuals ``r + J x`` are least by their covariance.

    Parameters
    ----------
    J, r
        (N, 2, P) and (N, 2) m.
    covariance
        Of the N residuals.

    Returns
    -------
    LinearFit
    """
    both = np.concatenate([J, r[..., None]], axis=-1)
    inner, _ = covariance.weigh(both)
    information, gradient = inner[:-1, :-1], inner[:-1, -1]
    if not len(gradient):
        return LinearFit(gradient, information, float(inner[-1, -1]))
    x = np.asarray(-np.linalg.lstsq(information, gradient, rcond=None)[0], float)
    return LinearFit(x, information, float(inner[-1, -1] + gradient @ x))


#: A search that is begun again and makes noise likelier by less, in log-likelihood, was at the top.
LEAST_GAIN = 0.1


def estimate_wander(
    points: PosePoints,
    r: ArrayLike,
    J: ArrayLike,
    assumed: dict[str, float],
    lasts: tuple[float, float, float] = LASTS_S,
    places: Places | None = None,
) -> WanderFit:
    """Most likely noise behind residuals, whatever constants are behind them too.

    Parameters
    ----------
    points
        N points.
    r, J
        (N, 2) residuals, m, and (N, 2, P) their derivatives with respect to constants, each in a unit of
        which it is known to be a few at most: its prior has a standard deviation of one.
    assumed
        Standard deviations by the same names, above zero, about which the prior lies.
    lasts
        Time constants about which the priors lie, in the unit of the points' times.
    places
        Of what the points are, where errors of their places are not negligible.

    Returns
    -------
    WanderFit
    """
    residuals, constants = np.asarray(r, float), np.asarray(J, float)
    both = np.concatenate([constants, residuals[..., None]], axis=-1)
    start = np.log([*(assumed[kind] for kind in KINDS), *lasts])

    def negative_log_posterior(x: Array) -> float:
        inner, logarithm = Covariance(points, WanderNoise.from_logarithms(x), places).weigh(both)
        information = inner[:-1, :-1] + np.eye(len(inner) - 1)
        deviance = inner[-1, -1] - inner[-1, :-1] @ np.linalg.solve(information, inner[:-1, -1])
        prior = (((x[:-1] - start) / PRIOR) ** 2).sum() + (x[-1] / PRIOR_SHARE) ** 2
        freed = np.linalg.slogdet(information)[1]
        return float(0.5 * (logarithm + freed + deviance + prior))

    first = np.append(start, 0.0)
    bounds = [(value - 3 * PRIOR, value + 3 * PRIOR) for value in start] + [(-4.0, 4.0)]
    # Differences over less are lost in the rounding of thousands of images, and the search stops half way.
    # A search along a line may end short of the top: begun there again, it goes on.
    before = np.inf
    while True:
        found = minimize(
            negative_log_posterior,
            first,
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": 200, "ftol": 1e-9, "eps": 1e-5},
        )
        first = found.x
        if not before - found.fun >= LEAST_GAIN:
            return WanderFit(WanderNoise.from_logarithms(first), negative_log_posterior)
        before = found.fun


def degrees_of_freedom(
    J: Array, x: Array, points: PosePoints, found: WanderFit, places: Places | None = None
) -> tuple[float, Array]:
    """Degrees of freedom of tests of constants, for the noise is only estimated (Satterthwaite 1946).

    Parameters
    ----------
    J
        (N, 2, P) derivatives by the constants.
    x
        (P,) their estimate.
    points, places
        As for `estimate_wander`.
    found
        From it.

    Returns
    -------
    float, (P,)
        Of Wald's statistic of the estimate, and of each constant alone, one at least: two over the squared
        relative uncertainty of their variance.
    """
    at, step = found.noise.logarithms, 0.05

    def variances(noise: Array) -> Array:
        information = Covariance(points, WanderNoise.from_logarithms(noise), places).weigh(J)[0]
        return np.append(1 / (x @ information @ x), np.diagonal(np.linalg.inv(information)))

    e = step * np.eye(len(at))
    slopes = np.array([np.log(variances(at + one) / variances(at - one)) for one in e]) / (2 * step)
    squared = np.einsum("ip,ij,jp->p", slopes, found.uncertainty, slopes)
    freedom = np.maximum(2 / np.maximum(squared, 1e-6), 1.0)
    return float(freedom[0]), freedom[1:]


def _second_derivatives(function: Callable[[Array], float], x: Array, h: float = 0.05) -> Array:
    """Hessian (n, n) by central differences, at least that of the priors alone."""
    e, middle = h * np.eye(len(x)), function(x)
    out = np.empty((len(x), len(x)))
    for i in range(len(x)):
        out[i, i] = (function(x + e[i]) - 2 * middle + function(x - e[i])) / h**2
        for j in range(i):
            corners = (function(x + a * e[i] + b * e[j]) * a * b for a in (1, -1) for b in (1, -1))
            out[i, j] = out[j, i] = sum(corners) / (4 * h**2)
    # Where it is at a bound, or bent the other way, the prior is what is left.
    values, vectors = np.linalg.eigh(out)
    return np.asarray((vectors * np.maximum(values, 1 / PRIOR_SHARE**2)) @ vectors.T)


@compiled
def _factorise(A: Array) -> float:
    """Replace the lower half of A (n, n) by that of its Cholesky factor; the logarithm of the determinant."""
    n, logarithm = A.shape[0], 0.0
    for j in range(n):
        for i in range(j, n):
            value = A[i, j]
            for k in range(j):
                value -= A[i, k] * A[j, k]
            A[i, j] = np.sqrt(value) if i == j else value / A[j, j]
        logarithm += 2 * np.log(A[j, j])
    return logarithm


@compiled
def _forward(L: Array, B: Array) -> None:
    """Replace B (n, K) by the inverse of the lower factor L (n, n) times B."""
    for i in range(L.shape[0]):
        for k in range(i):
            for c in range(B.shape[1]):
                B[i, c] -= L[i, k] * B[k, c]
        for c in range(B.shape[1]):
            B[i, c] /= L[i, i]


@compiled
def _invert(L: Array, B: Array) -> None:
    """Write into B (n, n) the inverse of L L', L (n, n) a lower factor."""
    n = L.shape[0]
    for i in range(n):
        for c in range(n):
            B[i, c] = 1.0 if i == c else 0.0
        for k in range(i):
            for c in range(k + 1):
                B[i, c] -= L[i, k] * B[k, c]
        for c in range(i + 1):
            B[i, c] /= L[i, i]
    for j in range(n):
        for k in range(j + 1):
            B[j, k] *= B[j, j] if k < j else B[j, k]
        for i in range(j + 1, n):
            for k in range(j + 1):
                B[j, k] += B[i, j] * B[i, k]
        for k in range(j):
            B[k, j] = B[j, k]


@compiled
def weigh_chain(
    G: Array, own: Array, B: Array, image: NDArray[np.int64], rho: Array, share: Array
) -> tuple[Array, Array, float]:
    """What the weighed products of B need: with W (N, 2, K) and T (M, 2 D, K) they are ``W'W - T'T``.

    Parameters
    ----------
    G
        (N, 2, D) of each point by D errors of its image, each in its own standard deviation. Points are in
        the order of their images.
    own
        (N, 2, 2) covariance of what is each point's own.
    B
        (N, 2, K).
    image
        (N,) number of the image, from 0 to M - 1, none left out.
    rho
        (M - 1, D) correlation of what wanders from one image to the next, below 1.
    share
        (D,) of the variance of these errors that wanders; the rest is each image's own. Those with a rest
        stand first.

    Returns
    -------
    W, T, logarithm of the determinant of the covariance
    """
    N, K, M, D = B.shape[0], B.shape[2], rho.shape[0] + 1, G.shape[2]
    W, T = np.empty((N, 2, K)), np.zeros((M, 2 * D, K))
    information = np.zeros((M, D, D))
    g0, g1 = np.empty(D), np.empty(D)
    logarithm = 0.0
    for i in range(N):
        a = np.sqrt(own[i, 0, 0])
        b = own[i, 1, 0] / a
        d = np.sqrt(own[i, 1, 1] - b * b)
        logarithm += 2 * np.log(a * d)
        m = image[i]
        for j in range(D):
            g0[j] = G[i, 0, j] / a
            g1[j] = (G[i, 1, j] - b * g0[j]) / d
        for c in range(K):
            W[i, 0, c] = B[i, 0, c] / a
            W[i, 1, c] = (B[i, 1, c] - b * W[i, 0, c]) / d
        for j in range(D):
            if g0[j] == 0.0 and g1[j] == 0.0:
                continue
            for k in range(D):
                information[m, j, k] += g0[j] * g0[k] + g1[j] * g1[k]
            for c in range(K):
                T[m, j, c] += g0[j] * W[i, 0, c] + g1[j] * W[i, 1, c]
    # Each image's own part first: what is left over of its points then says something of what wanders.
    wanders, stays = np.sqrt(share), np.sqrt(1 - share)
    S = (stays > 0).sum()
    A, across, left, before = np.empty((S, S)), np.empty((S, D)), np.empty((D, D)), np.zeros((D, D))
    seen, carried = np.empty((S, K)), np.zeros((D, K))
    for m in range(M):
        for j in range(S):
            for k in range(D):
                across[j, k] = stays[j] * information[m, j, k]
            for k in range(S):
                A[j, k] = across[j, k] * stays[k]
            A[j, j] += 1.0
            for c in range(K):
                seen[j, c] = stays[j] * T[m, j, c]
        logarithm += _factorise(A)
        _forward(A, across)
        _forward(A, seen)
        for j in range(D):
            for k in range(j + 1):
                value = information[m, j, k]
                for i in range(S):
                    value -= across[i, j] * across[i, k]
                left[j, k] = wanders[j] * wanders[k] * value
                left[k, j] = left[j, k]
            for c in range(K):
                rest = T[m, j, c]
                for i in range(S):
                    rest -= across[i, j] * seen[i, c]
                T[m, D + j, c] = wanders[j] * rest
        T[m, :S] = seen
        T[m, S:D] = 0.0
        for j in range(D):
            come = 1 / (1 - rho[m - 1, j] ** 2) if m > 0 else 1.0
            go = rho[m, j] ** 2 / (1 - rho[m, j] ** 2) if m < M - 1 else 0.0
            left[j, j] += come + go
            if m > 0:
                q = rho[m - 1, j] / (1 - rho[m - 1, j] ** 2)
                logarithm += np.log(1 - rho[m - 1, j] ** 2)
                for k in range(D):
                    left[j, k] -= q * before[j, k] * rho[m - 1, k] / (1 - rho[m - 1, k] ** 2)
                for c in range(K):
                    T[m, D + j, c] += q * carried[j, c]
        logarithm += _factorise(left)
        _invert(left, before)
        carried[:] = 0.0
        for j in range(D):
            for k in range(D):
                for c in range(K):
                    carried[j, c] += before[j, k] * T[m, D + k, c]
        _forward(left, T[m, D:])
    return W, T, logarithm
