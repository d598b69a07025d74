"""Ground with the heights of a terrain: what is rendered stands where the terrain says, in every view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.terrain import Terrain
from wildlab.simulation.scene.ground import Land

#: Cells of covers and of heights along a side at most: more would not fit into a small computer's memory.
MOST_CELLS = 4096


def land_on(terrain: Terrain, land: Land, cover_cell: float = 1.0) -> Land:
    """The same covers and weather on a terrain's heights.

    Everywhere the heights are those of `Terrain.heights_at`. Beyond the terrain the ground is as high as its
    border; it repeats after a power of two of the terrain's steps, at least half as far again as it is long.

    Parameters
    ----------
    terrain
        Whose heights.
    land
        Whose covers, which repeat, unevenness and weather.
    cover_cell
        How finely the covers are kept, m, at least.

    Returns
    -------
    Land

    Raises
    ------
    WildlabError
        Where a height of the terrain is missing, its nodes do not lie on multiples of its step, or it is too
        large.

    Examples
    --------
    >>> from wildlab.simulation.scene.ground import EVEN_LAND
    >>> from wildlab.simulation.scene.land import height_at
    >>> hill = Terrain(np.array([[0.0, 0.0], [10.0, 10.0]], np.float32), north=-20.0, east=0.0, step=20.0)
    >>> height_at(land_on(hill, EVEN_LAND), [-10.0, 5.0])
    5.0
    """
    if not np.isfinite(terrain.height).all():
        raise WildlabError(
            "a height of the terrain is missing", "fill it, or give another map", field="height"
        )
    beside = [abs(np.remainder(one / terrain.step + 0.5, 1) - 0.5) for one in (terrain.north, terrain.east)]
    if max(beside) > 1e-6:
        raise WildlabError(
            f"nodes of the terrain {max(beside) * terrain.step:g} m beside multiples of {terrain.step:g} m",
            "move its corner to multiples of its step",
            field="north",
        )
    # At least half as much again as the terrain, so that its two borders do not meet.
    cells = 1 << int(np.ceil(np.log2(1.5 * max(terrain.height.shape))))
    if cells > MOST_CELLS:
        raise WildlabError(
            f"a terrain of {max(terrain.height.shape)} nodes along a side",
            f"cut it to at most {2 * MOST_CELLS // 3}",
            field="height",
        )
    side = cells * terrain.step
    south, north, west, east = terrain.extent
    axes, rows = [], []
    for low, high in ((south, north), (west, east)):
        node = np.arange(cells) + int(np.round((low + high) / 2 / terrain.step)) - cells // 2
        axes.append(np.clip(node * terrain.step, low, high))
        rows.append(np.argsort(node % cells))
    grid = np.stack(np.meshgrid(axes[0][rows[0]], axes[1][rows[1]], indexing="ij"), axis=-1)
    heights = terrain.heights_at(grid.reshape(-1, 2)).reshape(cells, cells)
    count = min(1 << int(np.ceil(np.log2(side / cover_cell))), MOST_CELLS)
    at = ((np.arange(count) + 0.5) * (side / count)) % land.side
    cell = (at / (land.side / len(land.cover))).astype(np.intp)
    return replace(land, heights=heights, cover=np.asarray(land.cover)[np.ix_(cell, cell)], side=side)
