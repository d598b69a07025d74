"""The point mass filter: the exact answer in small worlds, which particles are held against (F 4.2).

A world is a grid of C cells; an animal is in one of them. All is finite sums, so nothing is left to chance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.particles.clouds import Inside

#: More cells are no small world: the matrix of moves has as many entries squared.
MOST_CELLS = 6000


class Grid(NamedTuple):
    """Cells of an enclosure.

    Attributes
    ----------
    places
        (C, 2) m, the middle of each cell.
    step
        Side of a cell, m.
    """

    places: Array
    step: float


def grid_over(inside: Inside, low: ArrayLike, high: ArrayLike, step: float) -> Grid:
    """The cells whose middle lies in an enclosure.

    Parameters
    ----------
    inside
        The enclosure: (..., 2) m -> (...) bool.
    low, high
        (2,) m: a rectangle that holds it.
    step
        Side of a cell, m.

    Returns
    -------
    Grid

    Raises
    ------
    WildlabError
        Where there is no cell, or are more than `MOST_CELLS`.
    """
    corner, far = np.asarray(low, float), np.asarray(high, float)
    axes = [np.arange(corner[a] + step / 2, far[a], step) for a in range(2)]
    every = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    places = every[np.asarray(inside(every), bool)] if len(every) else every
    if not 0 < len(places) <= MOST_CELLS:
        raise WildlabError(
            f"{len(places)} cells of {step} m", f"choose a step that gives 1 to {MOST_CELLS}", field="step"
        )
    return Grid(places, step)


def walk_matrix(grid: Grid, density: float, dt: float) -> Array:
    """How a random walk moves between cells; a step that leads out of the enclosure is not taken.

    Parameters
    ----------
    grid
        Cells.
    density
        Of the walk, m/sqrt(s), above zero.
    dt
        s, above zero.

    Returns
    -------
    (C, C) probability of going to the row's cell from the column's; columns sum to one.
    """
    sd = density * np.sqrt(dt)
    # What falls on one axis of each cell, without the area of a cell being small beside the walk.
    reach = int(np.ceil(8 * sd / grid.step)) + 1
    offsets = grid.step * np.arange(-reach, reach + 1)
    line = np.exp(-0.5 * (offsets / sd) ** 2)
    line /= line.sum()
    steps = np.rint((grid.places[:, None] - grid.places[None]) / grid.step).astype(np.intp)
    near = np.asarray((np.abs(steps) <= reach).all(axis=-1))
    at = np.where(near[..., None], steps + reach, 0)
    matrix = np.where(near, line[at[..., 0]] * line[at[..., 1]], 0.0)
    matrix[np.diag_indices(len(matrix))] += 1 - matrix.sum(axis=0)
    return np.asarray(matrix)


def grid_weigh(p: ArrayLike, likelihood: ArrayLike) -> tuple[Array, float]:
    """Measurement update of a grid, F (4.9)-(4.10) with all cells as particles.

    Parameters
    ----------
    p
        (C,) probability of each cell; sums to one.
    likelihood
        (C,) of the measurement given each cell; of seeing nothing, one minus the probability of detection.

    Returns
    -------
    p, evidence
        (C,) and the sum before it was made one.

    Raises
    ------
    WildlabError
        Where no cell can have made the measurement.
    """
    raw = np.asarray(p, float) * np.asarray(likelihood, float)
    total = float(raw.sum())
    if not total > 0:
        raise WildlabError(
            "no cell can have made the measurement",
            "leave it out, or give every cell some likelihood",
            field="likelihood",
        )
    return raw / total, total


def grid_moments(grid: Grid, p: ArrayLike) -> tuple[Array, Array]:
    """Mean and covariance of the middles of the cells.

    Parameters
    ----------
    grid
        Cells.
    p
        (C,) probability of each; sums to one.

    Returns
    -------
    mean, covariance
        (2,) m and (2, 2) m^2.
    """
    weights = np.asarray(p, float)
    mean = weights @ grid.places
    off = grid.places - mean
    return mean, np.asarray((off * weights[:, None]).T @ off)
