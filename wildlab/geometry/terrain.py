"""Terrain: heights on a grid in n, and where rays meet them.

The surface is bilinear between nodes. Heights are metres above the plane ``down = 0`` of n, not a datum:
what the curvature of the Earth takes away is settled where a map is resampled into n, and rays are straight.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import RAY_STATUS, matching, pixel_rays


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights on a grid whose rows run north and whose columns run east.

    Attributes
    ----------
    height
        (R, C) float32, metres above the plane ``down = 0`` of n; NaN where nothing is known.
    north, east
        Of the node (0, 0), metres in n.
    step
        Between neighbouring nodes, metres, the same both ways.
    sd
        Standard deviation of a height, metres; NaN where it is not known.

    Raises
    ------
    WildlabError
        Where there are fewer than two rows or columns, no height at all, or no step above zero.

    Examples
    --------
    >>> import numpy as np
    >>> hill = Terrain(np.array([[0.0, 0.0], [10.0, 10.0]], np.float32), north=0.0, east=0.0, step=20.0)
    >>> print(hill.heights_at([[10.0, 5.0]]))
    [5.]
    """

    height: NDArray[np.float32]
    north: float
    east: float
    step: float
    sd: float = float("nan")
    _blocks: tuple[NDArray[np.float32], NDArray[np.int64]] = field(init=False, repr=False)
    _top: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        height = np.ascontiguousarray(self.height, np.float32)
        if height.ndim != 2 or min(height.shape) < 2:
            raise WildlabError(
                f"heights of the shape {height.shape}",
                "give two rows and two columns at least",
                field="height",
            )
        if not (np.isfinite(self.step) and self.step > 0 and np.isfinite(self.north + self.east)):
            raise WildlabError(f"a step of {self.step} m", "give metres above zero", field="step")
        known = np.isfinite(height)
        if not known.any():
            raise WildlabError("the terrain has no height at all", "give another map", field="height")
        object.__setattr__(self, "height", height)
        object.__setattr__(self, "_top", float(np.max(height, where=known, initial=-np.inf)))
        object.__setattr__(self, "_blocks", _pyramid(height, self._top))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least and greatest north, least and greatest east, metres."""
        rows, columns = self.height.shape
        return (
            self.north, self.north + (rows - 1) * self.step,
            self.east, self.east + (columns - 1) * self.step,
        )  # fmt: skip

    def heights_at(self, north_east: ArrayLike) -> Array:
        """Heights of the surface.

        Parameters
        ----------
        north_east
            (N, 2) metres.

        Returns
        -------
        (N,) metres upwards; NaN off the map and where a node is missing.
        """
        i, j, u, v = self._cells(north_east)
        h = self.height
        with np.errstate(invalid="ignore"):
            low = h[i, j] + u * (h[i, j + 1].astype(float) - h[i, j])
            high = h[i + 1, j] + u * (h[i + 1, j + 1].astype(float) - h[i + 1, j])
            return np.asarray(low + v * (high - low))

    def slopes_at(self, north_east: ArrayLike) -> Array:
        """Slopes of the surface.

        Parameters
        ----------
        north_east
            (N, 2) metres.

        Returns
        -------
        (N, 2) metres upwards for a metre north, and for a metre east; NaN as `heights_at`.
        """
        i, j, u, v = self._cells(north_east)
        h = self.height.astype(float, copy=False) if self.height.size < 1e6 else self.height
        a, b, c, d = (np.asarray(h[p, q], float) for p, q in ((i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)))
        with np.errstate(invalid="ignore"):
            north = (1 - u) * (c - a) + u * (d - b)
            east = (1 - v) * (b - a) + v * (d - c)
        return np.stack([north, east], axis=-1) / self.step

    def _cells(self, north_east: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Rows and columns of cells, and where in them points lie; NaN outside."""
        points = np.asarray(north_east, float)
        y, x = (points[..., 0] - self.north) / self.step, (points[..., 1] - self.east) / self.step
        rows, columns = self.height.shape
        outside = ~((x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1))
        j = np.where(outside, 0, np.minimum(np.nan_to_num(x), columns - 2)).astype(np.intp)
        i = np.where(outside, 0, np.minimum(np.nan_to_num(y), rows - 2)).astype(np.intp)
        return i, j, np.where(outside, np.nan, x - j), np.where(outside, np.nan, y - i)


class Met(NamedTuple):
    """Where rays met the terrain.

    Attributes
    ----------
    points
        (N, 3) metres in n; NaN where a ray did not meet it.
    became
        (N,) a key of `RAY_STATUS`.
    """

    points: Array
    became: NDArray[np.int8]

    def counts(self) -> dict[str, int]:
        """How many rays became what, in the words of `RAY_STATUS`; those that none became are left out."""
        return {words: n for key, words in RAY_STATUS.items() if (n := int((self.became == key).sum()))}


def intersect_terrain(terrain: Terrain, rays: ArrayLike, p_nc: ArrayLike, furthest: float = np.inf) -> Met:
    """Where rays first meet the terrain: an exact walk from cell to cell.

    Parameters
    ----------
    terrain
        In the same n.
    rays
        (N, 3) directions in n, of any length.
    p_nc
        Where they start, (N, 3) or (3,), metres.
    furthest
        Lengths of the ray after which it is given up.

    Returns
    -------
    Met

    Raises
    ------
    WildlabError
        Where there are neither as many starts as rays, nor one.

    Examples
    --------
    >>> import numpy as np
    >>> flat = Terrain(np.full((3, 3), 5.0, np.float32), north=-100.0, east=-100.0, step=100.0)
    >>> print(intersect_terrain(flat, [[0.5, 0.0, 1.0]], [0.0, 0.0, -105.0]).points)
    [[50.  0. -5.]]
    """
    directions = np.atleast_2d(np.asarray(rays, float))
    starts = np.atleast_2d(np.asarray(p_nc, float))
    if directions.shape[-1] != 3 or starts.shape[-1] != 3 or len(starts) not in (1, len(directions)):
        raise WildlabError(
            f"starts of the shape {starts.shape} for rays of the shape {directions.shape}",
            "give one start for each ray, or one for all, three columns each",
            field="p_nc",
        )
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.
    from wildlab.geometry.compilation import announced
    from wildlab.geometry.terrain_kernels import walk_all

    grid = _to_grid(terrain, starts, whole=True)
    along = _to_grid(terrain, directions, whole=False)
    blocks, shapes = terrain._blocks
    with announced("the walk over terrain"):
        at, became = walk_all(terrain.height, blocks, shapes, grid, along, float(furthest), terrain._top)
    points = np.asarray(starts + at[:, None] * directions)
    return Met(points, became)


def pixels_to_terrain(poses: CameraPoses, uv: ArrayLike, terrain: Terrain) -> Met:
    """Where the rays of pixels meet the terrain, one pose per pixel.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    terrain
        In the same n.

    Returns
    -------
    Met

    Raises
    ------
    WildlabError
        Where there is another number of poses than of pixels.
    """
    pixels, _ = matching(poses, np.atleast_2d(np.asarray(uv, float)))
    return intersect_terrain(terrain, pixel_rays(poses.camera, pixels, poses.R_nc), poses.p_nc)


def _to_grid(terrain: Terrain, vectors: Array, *, whole: bool) -> Array:
    """(N, 3) of n as columns, rows, metres upwards; ``whole`` for points, not for directions."""
    origin = (terrain.east, terrain.north) if whole else (0.0, 0.0)
    return np.stack(
        [
            (vectors[:, 1] - origin[0]) / terrain.step,
            (vectors[:, 0] - origin[1]) / terrain.step,
            -vectors[:, 2],
        ],
        axis=-1,
    )


def _pyramid(height: NDArray[np.float32], top: float) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Highest nodes of blocks of 4, 8, 16, ... cells a side, one after the other, and each level's shape."""
    from wildlab.geometry.compilation import announced
    from wildlab.geometry.terrain_kernels import FIRST, highest_of_blocks, highest_of_four

    with announced("the walk over terrain"):
        levels = [highest_of_blocks(height, 1 << FIRST, top)]
        while max(levels[-1].shape) > 1:
            levels.append(highest_of_four(levels[-1]))
    shapes = np.array([one.shape for one in levels], np.int64)
    begins = np.concatenate([[0], np.cumsum(shapes.prod(axis=1))[:-1]])
    return np.concatenate([one.ravel() for one in levels]), np.column_stack([shapes, begins])
