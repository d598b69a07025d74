"""Pixel -> ground plane and ground -> pixel, one pose per pixel (H 5.13, 5.7).

Terrain: heights on a grid in n, and where rays meet them.

The surface is bilinear between nodes. Heights are metres above the plane ``down = 0`` of n, not a datum:
what the curvature of the Earth takes away is settled where a map is resampled into n, and rays are straight.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, normalise, project
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.rays import RAY_STATUS


def georeference_pixels(poses: CameraPoses, uv: ArrayLike, plane_down: ArrayLike) -> Array:
    """Where the rays of pixels meet a horizontal plane, one pose per pixel: direct georeferencing, H (5.13).

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) pixels.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).

    Returns
    -------
    (N, 3) metres in n. Rows are NaN where the ray does not meet the plane in front of the camera.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.

    Examples
    --------
    >>> from wildlab.geometry.camera_poses import Mount
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -100.0]), np.eye(3))
    >>> georeference_pixels(poses, [[320.0, 156.0]], 0.0)
    array([[10.,  0.,  0.]])
    """
    pixels, planes = matching(poses, uv, plane_down)
    return pixel_to_plane(poses.camera, pixels, poses.p_nc, poses.R_nc, planes)


def matching(poses: CameraPoses, uv: ArrayLike, plane_down: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Pixels and planes as arrays that go with the poses.

    Parameters
    ----------
    poses
        The camera, with a pose for each pixel or one for all.
    uv
        (N, 2) or (2,) pixels.
    plane_down
        Scalar or (N,).

    Returns
    -------
    The pixels, and the planes.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.
    """
    pixels, planes = np.asarray(uv, float), np.asarray(plane_down, float)
    if pixels.shape[-1:] != (2,):
        raise WildlabError(f"pixels of the shape {pixels.shape}", "give two columns, u and v", field="uv")
    rows = pixels.shape[:-1]
    poses.require_rows(rows, "uv")
    if planes.ndim and planes.shape != rows:
        raise WildlabError(
            f"planes of the shape {planes.shape} for pixels of the shape {pixels.shape}",
            "give one plane for each pixel, or one for all",
            field="plane_down",
        )
    return pixels, planes


def pixel_rays(camera: Camera, uv: ArrayLike, R_nc: ArrayLike) -> Array:
    """Directions in n in which pixels look, not normalised: depth 1 along the lens.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    uv
        (N, 2) pixels.
    R_nc
        Attitude of the camera, (N, 3, 3), or (3, 3) for all.

    Returns
    -------
    (N, 3), no unit.
    """
    xy = normalise(camera, uv)
    R = np.asarray(R_nc, float)
    return np.asarray(R[..., :, 0] * xy[..., :1] + R[..., :, 1] * xy[..., 1:] + R[..., :, 2])


def pixel_to_plane(
    camera: Camera, uv: ArrayLike, p_nc: ArrayLike, R_nc: ArrayLike, plane_down: ArrayLike
) -> Array:
    """Where the rays of pixels meet a horizontal plane: direct georeferencing, H (5.13).

    Cutting the ray with the plane is the same as inverting the homography ``G_NE`` of H (5.14), and does
    not need a plane through the origin.

    Parameters
    ----------
    camera
        The intrinsic parameters.
    uv
        (N, 2) pixels.
    p_nc, R_nc
        Pose of the camera: (N, 3) metres and (N, 3, 3), or one pose for all.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).

    Returns
    -------
    (N, 3) metres in n. Rows are NaN where the ray does not meet the plane in front of the camera: at or above
    the horizon, or a camera below the plane.
    """
    return intersect_plane(pixel_rays(camera, uv, R_nc), p_nc, plane_down)


def intersect_plane(rays: ArrayLike, p_nc: ArrayLike, plane_down: ArrayLike) -> Array:
    """Where rays meet a horizontal plane.

    Parameters
    ----------
    rays
        (N, 3) directions in n, of any length.
    p_nc
        Where they start, (N, 3) or (3,), metres.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).

    Returns
    -------
    (N, 3) metres in n; misses are NaN.

    Examples
    --------
    >>> intersect_plane([[0.5, 0.0, 1.0], [0.0, 0.0, -1.0]], [0.0, 0.0, -100.0], 0.0)
    array([[50.,  0.,  0.],
           [nan, nan, nan]])
    """
    d, p, plane = (np.asarray(a, float) for a in (rays, p_nc, plane_down))
    drop = plane - p[..., 2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        depth = np.where((d[..., 2] > 0) & (drop > 0), drop / d[..., 2], np.nan)
        ground = np.asarray(p + depth[..., None] * d)
    ground[..., 2] = plane + 0.0 * depth
    return ground


def ground_to_pixel(camera: Camera, p_nt: ArrayLike, p_nc: ArrayLike, R_nc: ArrayLike) -> Array:
    """Pixels at which points in n appear, H (5.7).

    Parameters
    ----------
    camera
        The intrinsic parameters.
    p_nt
        The points, (N, 3) or (3,), metres in n.
    p_nc, R_nc
        Pose of the camera: (N, 3) metres and (N, 3, 3), or one pose for all.

    Returns
    -------
    (N, 2) pixels; NaN behind the camera. A pixel may lie outside the image: see
    :func:`wildlab.geometry.camera.in_image`.

    Examples
    --------
    10 m north of a camera that looks straight down from 100 m, top of the image to the north:

    >>> from wildlab.geometry.camera_poses import Mount, camera_pose
    >>> camera = Camera(640, 512, 1000.0, 1000.0, 320.0, 256.0)
    >>> p_nc, R_nc = camera_pose(Mount("down"), [0.0, 0.0, -100.0], np.eye(3))
    >>> ground_to_pixel(camera, [10.0, 0.0, 0.0], p_nc, R_nc)
    array([320., 156.])
    """
    offset = np.asarray(p_nt, float) - np.asarray(p_nc, float)
    R = np.asarray(R_nc, float)
    p_c = (
        R[..., 0, :] * offset[..., 0:1] + R[..., 1, :] * offset[..., 1:2] + R[..., 2, :] * offset[..., 2:3]
    )  # R transposed times the offset
    return project(camera, p_c)


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
        h = self.height
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

    Examples
    --------
    >>> import numpy as np
    >>> flat = Terrain(np.full((3, 3), 5.0, np.float32), north=-100.0, east=-100.0, step=100.0)
    >>> print(intersect_terrain(flat, [[0.5, 0.0, 1.0]], [0.0, 0.0, -105.0]).points)
    [[50.  0. -5.]]
    """
    directions = np.atleast_2d(np.asarray(rays, float))
    starts = np.broadcast_to(np.asarray(p_nc, float), directions.shape)
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.
    from wildlab.geometry.kernels import walk_all

    # Columns, rows, metres upwards.
    scale = [terrain.step, terrain.step, -1.0]
    grid, along = (
        np.ascontiguousarray(vectors[:, [1, 0, 2]] / scale)
        for vectors in (starts - [terrain.north, terrain.east, 0.0], directions)
    )
    blocks, shapes = terrain._blocks
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


def _pyramid(height: NDArray[np.float32], top: float) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Highest nodes of blocks of 4, 8, 16, ... cells a side, one after the other, and each level's shape."""
    from wildlab.geometry.kernels import FIRST, highest, highest_of_blocks

    levels = [highest_of_blocks(height, 1 << FIRST, top)]
    while max(levels[-1].shape) > 1:
        levels.append(highest(levels[-1]))
    shapes = np.array([one.shape for one in levels], np.int64)
    begins = np.concatenate([[0], np.cumsum(shapes.prod(axis=1))[:-1]])
    return np.concatenate([one.ravel() for one in levels]), np.column_stack([shapes, begins])
