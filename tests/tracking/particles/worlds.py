"""Small worlds for trackers: a fence, and the exact answer on a grid (the point mass filter, F 4.2)."""

from typing import NamedTuple

import numpy as np

from wildlab.tracking.particles import Rules, move, stay_inside, walk_of

SIZE = np.array([120.0, 90.0])
WALK = walk_of(0.5, 1.0)
NOISE = 2.0  # m


def inside(places):
    return ((places > 0) & (places < SIZE)).all(axis=-1)


def moves(cloud, seen, dt, rng):
    return stay_inside(cloud, move(cloud, WALK, dt, rng), inside)


RULES = Rules(moves, particles=400)


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
