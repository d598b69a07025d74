"""Ten animals of two thousand particles each, one step for each image, on one core.

A step moves the particles, weighs those of the half that was detected by a detection and those of the others
by the footprint that did not show them, takes means and covariances, and resamples what has run thin. The
readable twin goes through the animals one after the other as F chapter 4 is written; it draws by numpy's
``choice``. Same numbers of particles, same images, numbers drawn anew.
"""

from __future__ import annotations

import numpy as np

from benchmarks.timing import best_of
from wildlab.geometry.frames import Array
from wildlab.tracking.kalman import predict, update
from wildlab.tracking.particles import (
    Cloud,
    log_likelihood,
    moments,
    move,
    resample,
    start_gaussian,
    walk_of,
    weigh,
)

ANIMALS, PARTICLES, STEPS = 10, 2000, 50
WALK, R, DT = walk_of(0.5, 1.0), 4.0 * np.eye(2), 4.0


def sight(places: Array) -> Array:
    """Probability of detection: in a footprint of 80 m."""
    return 0.8 * ((places > 38.0) & (places < 118.0)).all(axis=-1)


def start(rng: np.random.Generator) -> Cloud:
    middles = rng.uniform(0, 200, (ANIMALS, 2))
    return start_gaussian(middles, 100 * np.eye(2), PARTICLES, rng)


def together() -> list[tuple[Array, Array]]:
    """All animals at once."""
    rng = np.random.default_rng(0)
    cloud, kept = start(rng), []
    seen = np.arange(ANIMALS) % 2 == 0
    z = moments(cloud)[0]
    for _ in range(STEPS):
        cloud = move(cloud, WALK, DT, rng)
        given = np.log1p(-sight(cloud.x))
        for a in np.flatnonzero(seen):
            given[a] = log_likelihood(cloud.x[a], z[a], R)
        cloud, _ = weigh(cloud, given)
        kept.append(moments(cloud))
        cloud, _ = resample(cloud, rng)
    return kept


def one_by_one() -> list[tuple[Array, Array]]:
    """F chapter 4 as it is written: animal by animal, formula by formula."""
    rng = np.random.default_rng(0)
    cloud, kept = start(rng), []
    z = moments(cloud)[0]
    x, w = cloud.x.copy(), cloud.w.copy()
    for _ in range(STEPS):
        means, covariances = [], []
        for a in range(ANIMALS):
            F, Q = WALK(DT)
            x[a] = x[a] @ F.T + rng.multivariate_normal(np.zeros(2), Q, PARTICLES)
            if a % 2 == 0:
                off = z[a] - x[a]
                w[a] *= np.exp(-0.5 * np.sum(off @ np.linalg.inv(R) * off, axis=1))
            else:
                w[a] *= 1 - sight(x[a])
            w[a] /= w[a].sum()
            means.append(w[a] @ x[a])
            covariances.append(np.cov(x[a].T, aweights=w[a], ddof=0))
            if 1 / np.sum(w[a] ** 2) <= 2 * PARTICLES / 3:
                x[a] = x[a][rng.choice(PARTICLES, PARTICLES, p=w[a])]
                w[a] = 1 / PARTICLES
        kept.append((np.array(means), np.array(covariances)))
    return kept


def kalman_filter() -> list[tuple[Array, Array]]:
    """What F 8.3 calls cheaper: an estimate and covariance of each, which an empty image leaves alone."""
    rng = np.random.default_rng(0)
    x, P = moments(start(rng))
    z, seen, kept = x.copy(), np.arange(ANIMALS) % 2 == 0, []
    for _ in range(STEPS):
        x, P = predict(x, P, *WALK(DT))
        x, P = x.copy(), P.copy()
        x[seen], P[seen], *_ = update(x[seen], P[seen], z[seen], np.eye(2), R)
        kept.append((x, P))
    return kept


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds of a step, ratio to the readable twin, what is wanted)."""
    slow = best_of(one_by_one, repeats=5) / STEPS
    rows = [(f"one after the other, readable numpy, {1 / slow:.0f} steps/s", slow, 1.0, "")]
    fast = best_of(together, repeats=5) / STEPS
    rows.append((f"wildlab, {1 / fast:.0f} steps/s", fast, fast / slow, "at least 100 steps/s"))
    cheap = best_of(kalman_filter, repeats=5) / STEPS
    rows.append((f"a Kalman filter instead, {1 / cheap:.0f} steps/s", cheap, cheap / slow, ""))
    return f"Particle filter, {ANIMALS} animals of {PARTICLES} particles, one core", rows
