"""Particles against exact answers: Kalman's filter and a grid."""

from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, norm

from tests.tracking.poses import GENERATORS
from wildlab.tracking import kalman
from wildlab.tracking.motion import constant_velocity
from wildlab.tracking.particles import (
    Cloud,
    draw,
    log_likelihood,
    mahalanobis_squared,
    moments,
    move,
    nearest_animal,
    resample,
    start_gaussian,
    weigh,
    weigh_unseen,
)

MOTION = partial(constant_velocity, sd_acceleration=0.4)
START, P0 = np.array([0.0, 0.0, 1.0, 0.5]), np.diag([16.0, 16.0, 0.5, 0.5])
R = np.diag([9.0, 4.0])


def measurements():
    rng = np.random.default_rng(11)
    F, Q = MOTION(1.0)
    x, found = rng.multivariate_normal(START, P0), []
    for _ in range(8):
        x = rng.multivariate_normal(F @ x, Q + 1e-12 * np.eye(4))
        found.append(x[:2] + rng.multivariate_normal([0, 0], R))
    return np.array(found)


def exact(z):
    x, P, log_evidence = START, P0, 0.0
    for one in z:
        step = kalman.update(*kalman.predict(x, P, *MOTION(1.0)), one, np.eye(2, 4), R)
        x, P = step.x, step.P
        nis = step.innovation @ np.linalg.solve(step.S, step.innovation)
        log_evidence += -0.5 * (nis + np.log(np.linalg.det(2 * np.pi * step.S)))
    return x, P, log_evidence


def by_particles(z, particles, runs, threshold, seed):
    """Many filters at once, one in each row, that differ in their random numbers alone."""
    rng = np.random.default_rng(seed)
    cloud = start_gaussian(np.tile(START, (runs, 1)), P0, particles, rng)
    log_evidence = np.zeros(runs)
    for one in z:
        cloud = move(cloud, MOTION, 1.0, rng)
        cloud, gained = weigh(cloud, log_likelihood(cloud.x[..., :2], one, R))
        log_evidence += gained
        estimate = moments(cloud)
        cloud, _ = resample(cloud, rng, threshold)
    return *estimate, log_evidence


@pytest.mark.parametrize("threshold", [1.0, 2 / 3])
def test_particles_become_the_kalman_filter_at_the_rate_of_monte_carlo(threshold):
    z = measurements()
    x, P, log_evidence = exact(z)
    sizes, off, spread = [250, 1000, 4000], [], []
    for N in sizes:
        mean, covariance, gained = by_particles(z, N, 100, threshold, N)
        off.append(np.sqrt(((mean - x) ** 2 / np.diag(P)).mean()))
        spread.append(np.sqrt(((covariance - P) ** 2).mean() / (P**2).mean()))
        # The product of (4.10)'s sums estimates the measurements' likelihood without bias, for any N.
        ratio = np.exp(gained - log_evidence)
        assert abs(ratio.mean() - 1) < 4 * ratio.std(ddof=1) / np.sqrt(len(ratio))
    # In units of the Kalman filter's own standard deviation: c / sqrt(N).
    for errors in (off, spread):
        rate = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        assert -0.6 < rate < -0.4
    assert off[-1] < 0.1


class Grid(NamedTuple):
    """The middles (C, 2) m of the cells of an enclosure, and the side of a cell, m."""

    places: np.ndarray
    step: float


def grid_over(inside, low, high, step):
    """The cells whose middle lies in an enclosure."""
    axes = [np.arange(low[a] + step / 2, high[a], step) for a in range(2)]
    every = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return Grid(every[inside(every)], step)


def walk_matrix(grid, density, dt):
    """(C, C) probability of going to the row's cell from the column's; a step that leads out is not taken."""
    sd = density * np.sqrt(dt)
    reach = int(np.ceil(8 * sd / grid.step)) + 1
    line = np.exp(-0.5 * (grid.step * np.arange(-reach, reach + 1) / sd) ** 2)
    line /= line.sum()
    steps = np.rint((grid.places[:, None] - grid.places[None]) / grid.step).astype(int)
    near = (np.abs(steps) <= reach).all(axis=-1)
    at = np.where(near[..., None], steps + reach, 0)
    matrix = np.where(near, line[at[..., 0]] * line[at[..., 1]], 0.0)
    matrix[np.diag_indices(len(matrix))] += 1 - matrix.sum(axis=0)
    return matrix


def grid_weigh(p, likelihood):
    """Measurement update of a grid, F (4.9)-(4.10) with all cells as particles; and the evidence."""
    raw = p * likelihood
    return raw / raw.sum(), raw.sum()


# A small world: a fence with a corner cut off, images that look at parts of it, something that hides a part.
STEP = 4.0


def cut_corner(places):
    inside = (places[..., 0] > 0) & (places[..., 0] < 40) & (places[..., 1] > 0) & (places[..., 1] < 48)
    return inside & (places.sum(axis=-1) < 72)


GRID = grid_over(cut_corner, [0, 0], [40, 48], STEP)


def sight_of(shown):
    """The probability of detection at places, from that of each cell (10, 12)."""
    return lambda places: shown[tuple(np.moveaxis((places / STEP).astype(int), -1, 0))]


def looks():
    """Six images: a half of the world each, a hidden block in it, a detector that misses some."""
    rng = np.random.default_rng(9)
    for k in range(6):
        mask = np.zeros((10, 12))
        mask[:, 6:] = k % 2
        mask[:, :6] = 1 - k % 2
        mask[3:6, 2:9] = 0.0
        yield sight_of(mask * rng.uniform(0.5, 0.95))


def test_seeing_nothing_is_the_grid_filter_within_the_error_of_the_draws():
    """Particles that sit on the cells and move as the matrix says live in the grid filter's very world."""
    runs, N, rng = 400, 500, np.random.default_rng(12)
    C = len(GRID.places)
    T = walk_matrix(GRID, 1.5, 6.0)
    ways = np.cumsum(T, axis=0)
    p, total = np.full(C, 1 / C), 0.0
    cells, cloud_w = rng.integers(0, C, (runs, N)), np.full((runs, N), 1 / N)
    gained = np.zeros(runs)
    for k, sight in enumerate(looks()):
        p = T @ p
        u = rng.random((runs, N))
        cells = np.array([(v[:, None] >= ways[:, c].T).sum(axis=1) for c, v in zip(cells, u, strict=True)])
        cloud = Cloud(GRID.places[np.minimum(cells, C - 1)], cloud_w)
        if k == 4:  # one detection among the images without
            z, noise = np.array([14.0, 30.0]), 36.0 * np.eye(2)
            p, c = grid_weigh(p, np.exp(log_likelihood(GRID.places, z, noise)))
            cloud, log_c = weigh(cloud, log_likelihood(cloud.x, z, noise))
        else:
            p, c = grid_weigh(p, 1 - sight(GRID.places))
            cloud, log_c = weigh_unseen(cloud, sight(cloud.x))
        total, gained = total + np.log(c), gained + log_c
        share = np.stack([np.bincount(a, b, C) for a, b in zip(cells, cloud.w, strict=True)])
        # The estimate is a ratio; weighing the runs by their evidence makes it one of unbiased sums.
        weight = np.exp(gained - total)
        often = runs * N * p > 50  # the others together: an error cannot be read off a handful of visits
        mine = weight[:, None] * np.column_stack(
            [share[:, often], share[:, ~often].sum(axis=1), np.ones(runs)]
        )
        wanted = np.append(p[often], [p[~often].sum(), 1.0])
        error = mine.std(axis=0, ddof=1) / np.sqrt(runs)
        # Six images of some hundred cells: one in a million by chance, each.
        assert (np.abs(mine.mean(axis=0) - wanted) <= norm.isf(5e-7) * error + 1e-12).all()
        chosen = draw(cloud.w, rng)
        cells, cloud_w = np.take_along_axis(cells, chosen, axis=1), np.full((runs, N), 1 / N)


def test_a_walk_in_a_grid_keeps_all_and_spreads_as_the_walk():
    T = walk_matrix(GRID, 1.5, 6.0)
    np.testing.assert_allclose(T.sum(axis=0), 1, atol=1e-12)
    assert (T >= 0).all() and np.allclose(T, T.T)  # symmetric: even in the long run
    wide = Grid(np.stack(np.meshgrid(*[np.arange(-24.0, 25.0)] * 2, indexing="ij"), -1).reshape(-1, 2), 1.0)
    from_middle = walk_matrix(wide, 1.5, 6.0)[:, len(wide.places) // 2]
    covariance = np.cov(wide.places.T, aweights=from_middle, ddof=0)
    np.testing.assert_allclose(covariance, 13.5 * np.eye(2), atol=1e-6)


def covariances(rng, count, n):
    A = rng.normal(size=(count, n, n + 1))
    return A @ np.swapaxes(A, 1, 2)


@given(rng=GENERATORS, animals=st.integers(0, 5), detections=st.integers(0, 6))
def test_each_detection_takes_its_closest_track(rng, animals, detections):
    mean, P = rng.normal(0, 3, (animals, 4)), covariances(rng, animals, 4)
    z, R = rng.normal(0, 3, (detections, 2)), covariances(rng, detections, 2)
    squared = mahalanobis_squared(mean, P, z, R)
    assert squared.shape == (animals, detections)
    taken = nearest_animal(squared, 0.9)
    for j in range(detections):
        roots = []
        for a in range(animals):
            off = z[j] - mean[a, :2]
            roots.append(np.sqrt(off @ np.linalg.inv(P[a, :2, :2] + R[j]) @ off))
            assert np.isclose(roots[a], np.sqrt(squared[a, j]))
        best = int(np.argmin(roots)) if roots else -1
        inside = animals and roots[best] ** 2 <= chi2.ppf(0.9, 2)
        assert taken[j] == (best if inside else -1)
