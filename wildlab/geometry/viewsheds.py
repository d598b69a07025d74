"""What a camera, and a flight, sees of a terrain: what is in the image, and not hidden by the ground.

What the camera sees of a map's grid points, as F 2.5 works it out.

A field of view by two angles (2.22)-(2.23), rays in fixed steps (algorithm 1), and depression angles along a
line of grid points (2.24, the extended Bresenham). They are kept because they are F's, beside the exact
`lines_clear`, which is what everything else here uses. As there, what the map does not know counts as high as
its highest node.

Coordinates of the compiled loops are those of the grid: ``x`` in columns (east), ``y`` in rows (north), ``z``
metres upwards.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, distort, normalise
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import Terrain, intersect_terrain, pixel_rays
from wildlab.geometry.rays import HIT, MISSED

#: A line of sight ends this share of its length before the point: the point lies on the ground itself.
SHORT_OF = 1e-7
#: Along each side of the image, rays that bound the footprint.
BORDER_RAYS = 9


def lines_clear(terrain: Terrain, points: ArrayLike, p_nc: ArrayLike) -> NDArray[np.bool_]:
    """Whether nothing known lies between a camera and points: exact on bilinear patches.

    Parameters
    ----------
    terrain
        In the same n.
    points
        (N, 3) metres in n, on the ground or above it.
    p_nc
        Where the camera is, (3,) or (N, 3) metres.

    Returns
    -------
    (N,) bool. False too where the line leads through what the map does not know, below its highest height,
    where the camera is below the ground, and for what is NaN.

    Examples
    --------
    A wall of 10 m between a camera and a point; a second point is higher.

    >>> import numpy as np
    >>> height = np.zeros((3, 5), np.float32)
    >>> height[:, 2] = 10.0
    >>> wall = Terrain(height, north=-1.0, east=0.0, step=1.0)
    >>> print(lines_clear(wall, [[0.0, 4.0, 0.0], [0.0, 4.0, -20.0]], [0.0, 0.0, -5.0]))
    [False  True]
    """
    targets, starts = (np.atleast_2d(np.asarray(each, float)) for each in (points, p_nc))
    met = intersect_terrain(terrain, targets - starts, starts, 1 - SHORT_OF)
    return np.asarray(met.became == MISSED)


def widest_view(camera: Camera) -> float:
    """How far from the axis an image shows anything.

    Parameters
    ----------
    camera
        Its lens may fold back: what lies further out than this is not shown, whatever its polynomial says.

    Returns
    -------
    float
        The tangent of the angle from the axis.
    """
    border = np.hypot(*normalise(camera, image_border(camera)).T)
    if np.isfinite(border).all():
        return float(border.max())
    # No ray comes to the corners: the image ends where a longer way from the axis comes no further out.
    r = np.linspace(0.0, 4.0, 4001)
    grows = np.diff(distort(np.stack([r, 0 * r], axis=1), camera.distortion)[:, 0]) > 0
    return float(r[-1] if grows.all() else r[int(np.argmin(grows))])


def image_border(camera: Camera) -> Array:
    """Pixels along the border of the image, its corners among them.

    Parameters
    ----------
    camera
        Of which the size counts.

    Returns
    -------
    (4 K, 2) px
    """
    along = np.linspace(0.0, 1.0, BORDER_RAYS)
    right, down = camera.width, camera.height
    zero, one = np.zeros(BORDER_RAYS), np.ones(BORDER_RAYS)
    sides = [(along, zero), (along, one), (zero, along), (one, along)]
    return np.concatenate([np.stack([u * right, v * down], axis=1) for u, v in sides])


class Footprint(NamedTuple):
    """The outline of what one image shows of the ground.

    Attributes
    ----------
    points
        (K, 2) metres north and east, in order about the image, not closed; NaN where a ray of the border
        ends nowhere and nothing is cut.
    became
        (K,) what became of the ray, a key of `RAY_STATUS`.
    cut
        (K,) bool, whether the point stands on the circle of the furthest distance, in place of a ray that
        comes no nearer.
    """

    points: Array
    became: NDArray[np.int8]
    cut: NDArray[np.bool_]


def footprint(
    terrain: Terrain, poses: CameraPoses, per_side: int = 16, furthest: float = np.inf
) -> Footprint:
    """The outline on the ground of one image: where the rays of its border meet the terrain.

    Safe at the horizon: a ray that does not come to the ground within the furthest distance has no point of
    its own. Runs of such rays are cut along the circle of that distance about the camera.

    Parameters
    ----------
    terrain
        In the same n.
    poses
        The camera, with one pose.
    per_side
        Rays along each side of the image.
    furthest
        Over the ground, metres; without one, nothing is cut.

    Returns
    -------
    Footprint
        What hides ground inside the outline is not cut out.

    Examples
    --------
    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.camera_poses import Mount
    >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0)
    >>> flat = Terrain(np.zeros((101, 101), np.float32), north=-100.0, east=-100.0, step=2.0)
    >>> pose = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -20.0]), np.eye(3))
    >>> print(footprint(flat, pose, per_side=1).points)
    [[ 10. -10.]
     [ 10.  10.]
     [-10.  10.]
     [-10. -10.]]
    """
    p, R = np.asarray(poses.p_nc, float), np.asarray(poses.R_nc, float)
    p, R = p.reshape(3), R.reshape(3, 3)
    met = intersect_terrain(terrain, pixel_rays(poses.camera, _outline(poses, per_side), R), p)
    points = met.points[:, :2].copy()
    with np.errstate(invalid="ignore"):
        near = (met.became == HIT) & (np.hypot(*(points - p[:2]).T) <= furthest)
    if not np.isfinite(furthest):
        return Footprint(points, met.became, np.zeros(len(points), bool))
    points[~near] = np.nan
    if near.any():
        points[~near] = _on_circle(points, near, p[:2], furthest)
    return Footprint(points, met.became, ~near & near.any())


def _outline(poses: CameraPoses, per_side: int) -> Array:
    """(4 K, 2) pixels about the border of the image, from the upper left clockwise."""
    along, zero = np.arange(per_side) / per_side, np.zeros(per_side)
    sides = [(along, zero), (zero + 1, along), (1 - along, zero + 1), (zero, 1 - along)]
    size = (poses.camera.width, poses.camera.height)
    return np.concatenate([np.stack(side, axis=1) for side in sides]) * size


def _on_circle(points: Array, near: NDArray[np.bool_], middle: Array, furthest: float) -> Array:
    """Points of a circle in place of those not near, evenly between the near ones beside each run."""
    bearing = np.arctan2(points[:, 1] - middle[1], points[:, 0] - middle[0])
    order = (int(np.flatnonzero(near)[0]) + np.arange(len(points) + 1)) % len(points)
    stops = np.flatnonzero(near[order])  # begins and ends with a near one
    angle = np.interp(np.arange(len(order)), stops, np.unwrap(bearing[order[stops]]))
    found = np.empty(points.shape)
    found[order] = middle + furthest * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return found[~near]


@compiled
def cast_all(
    height: Any,
    rows: Any,
    columns: Any,
    lens: Any,
    metres: float,
    step: float,
    near: float,
    top: float,
    lone: float,
) -> tuple[Any, Any]:
    """F algorithm 1 for each node: whether a ray to it ends near it, and how many steps that took.

    Rays begin at the height ``top``; where a node is missing, the ground is as high as ``lone``.
    """
    last_row, last_column = height.shape[0] - 1, height.shape[1] - 1
    clear, steps = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    x, y, z = lens
    for n in range(len(rows)):
        i, j = rows[n], columns[n]
        dx, dy, dz = j - x, i - y, height[i, j] - z
        length = np.sqrt((dx * dx + dy * dy) * metres * metres + dz * dz)
        if not length > 0:
            clear[n] = length == 0
            continue
        dx, dy, dz = dx / length, dy / length, dz / length
        # Nothing is above the highest ground: a ray from above begins there.
        t = (top - z) / dz if dz < 0 and z > top else 0.0
        while True:
            at_x, at_y = x + t * dx, y + t * dy
            if 0 <= at_x <= last_column and 0 <= at_y <= last_row:
                a, b = min(int(at_y), last_row - 1), min(int(at_x), last_column - 1)
                u, v = at_x - b, at_y - a
                low = (1 - u) * height[a, b] + u * height[a, b + 1]
                high = (1 - u) * height[a + 1, b] + u * height[a + 1, b + 1]
                ground = (1 - v) * low + v * high
                if not z + t * dz > (ground if ground == ground else lone):
                    break
            elif t >= length:
                break  # it has left the map; one that begins beside it goes on
            t += step
            steps[n] += 1
        clear[n] = abs(t - length) <= near
    return clear, steps


@compiled
def compare_all(
    height: Any,
    rows: Any,
    columns: Any,
    lens: Any,
    metres: float,
    itself: bool,
    signed: bool,
    lone: float,
) -> tuple[Any, Any]:
    """F (2.24) for each node: whether no grid point before it has an angle as small, and how many were asked.

    A count of -1 is a line that has no direction. A missing node counts as high as ``lone``.
    """
    last_row, last_column = height.shape[0] - 1, height.shape[1] - 1
    clear, asked = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    x, y, z = lens
    for n in range(len(rows)):
        i, j = rows[n], columns[n]
        if height[i, j] != height[i, j]:
            continue
        dx, dy = x - j, y - i
        own = np.arctan2(z - height[i, j], metres * np.sqrt(dx * dx + dy * dy))
        furthest = max(abs(dx), abs(dy))
        along_y = dx <= dy if signed else abs(dx) <= abs(dy)
        span = abs(dy) if along_y else abs(dx)
        if span == 0:
            # Straight below the camera there is nothing between; by the letter it is a division by zero.
            clear[n], asked[n] = furthest == 0 and not itself, -1 if signed else 0
            continue
        clear[n] = True
        for k in range(0 if itself else 1, int(np.ceil(furthest))):
            b, a = int(np.floor(j + k * dx / span + 0.5)), int(np.floor(i + k * dy / span + 0.5))
            if not (0 <= a <= last_row and 0 <= b <= last_column):
                continue
            asked[n] += 1
            ex, ey = x - b, y - a
            there = height[a, b] if height[a, b] == height[a, b] else lone
            if np.arctan2(z - there, metres * np.sqrt(ex * ex + ey * ey)) <= own:
                clear[n] = False
                break
    return clear, asked


def field_of_view(camera: Camera) -> tuple[float, float]:
    """Tangents of half the angles of view of F (2.23), across and down, of a camera without distortion.

    Its principal point, skew and distortion are left aside: (2.23) has none.
    """
    return camera.width / (2 * camera.fx), camera.height / (2 * camera.fy)


def in_field_of_view(
    halves: tuple[float, float], points: ArrayLike, p_nc: ArrayLike, R_nc: ArrayLike
) -> NDArray[np.bool_]:
    """Which points lie within the angles of view, F (2.22)-(2.23); what hides them is not asked.

    F's camera looks along its x axis: its ``(y_cam, z_cam) / x_cam`` is ``(x, y) / z`` here. By the print, a
    point behind the camera can lie inside, for a quotient does not know that both signs are turned; here it
    lies outside.

    Parameters
    ----------
    halves
        Tangents of half the angles, as of `field_of_view`.
    points
        (N, 3) metres in n.
    p_nc, R_nc
        Of the camera, (3,) metres and (3, 3): from c (z out of the lens) to n.

    Returns
    -------
    (N,) bool; False of a point that is NaN.

    Examples
    --------
    >>> in_field_of_view((1.0, 1.0), [[9.0, 0.0, 0.0], [11.0, 0.0, 0.0]], [0.0, 0.0, -10.0], np.eye(3))
    array([ True, False])
    """
    x, y, z = ((np.asarray(points, float) - np.asarray(p_nc, float)) @ np.asarray(R_nc, float)).T
    return np.asarray((np.abs(x) <= halves[0] * z) & (np.abs(y) <= halves[1] * z) & (z > 0))


class Looked(NamedTuple):
    """What a line of sight of F says of grid points, and what it took.

    Attributes
    ----------
    clear
        (N,) bool, whether the camera sees the point; False where its own height is not known.
    steps
        (N,) int32, steps of the ray, or grid points whose angle was asked; -1 where the line by the letter
        has no direction.
    """

    clear: NDArray[np.bool_]
    steps: NDArray[np.int32]


def cast_rays(
    terrain: Terrain,
    nodes: ArrayLike,
    p_nc: ArrayLike,
    step: float,
    tolerance: float,
    *,
    shorten: bool = True,
) -> Looked:
    """Line of sight by rays in fixed steps: F algorithm 1.

    A ray runs from the camera to the grid point in equal steps until it is below the ground; the point is
    seen if the ray ends near it. On a crest a ray may run over the point and end far behind it, and ground
    that is thinner than a step is run through: both are F's.

    Parameters
    ----------
    terrain
        In the same n; between nodes it is bilinear.
    nodes
        (N, 2) rows and columns of the grid points, those of the field of view.
    p_nc
        Of the camera, (3,) metres.
    step
        Of the ray, metres.
    tolerance
        How near the ray has to end, metres: "if the distance is too large" is all that F prints.
    shorten
        Whether rays begin at the height of the highest of these points (F's optimisation), or at the camera.

    Returns
    -------
    Looked

    Raises
    ------
    WildlabError
        Where a node is not on the map.

    Examples
    --------
    A wall of 9 m, itself in view, between the camera and the last point:

    >>> height = np.zeros((2, 6), np.float32)
    >>> height[:, 3] = 9.0
    >>> wall = Terrain(height, north=0.0, east=0.0, step=10.0)
    >>> print(cast_rays(wall, [[0, 2], [0, 3], [0, 5]], [0.0, 0.0, -12.0], step=0.5, tolerance=1.0).clear)
    [ True  True False]
    """
    rows, columns, lens = _prepared(terrain, nodes, p_nc)
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.

    known = terrain.height[rows, columns]
    top = float(np.nanmax(known, initial=-np.inf)) if shorten else np.inf
    found = cast_all(
        terrain.height,
        rows,
        columns,
        lens,
        terrain.step,
        float(step),
        float(tolerance),
        top,
        terrain._top,
    )
    return Looked(*found)


def compare_angles(
    terrain: Terrain, nodes: ArrayLike, p_nc: ArrayLike, *, itself: bool = False, signed: bool = False
) -> Looked:
    """Line of sight by depression angles along a line of grid points: F (2.24), the extended Bresenham.

    From the point towards the camera, one step along the longer of both sides each, the nearest grid point is
    taken. A point is hidden where one before it has an angle as small as its own or smaller. The print says
    something else in two places, which the last two arguments restore: both True is the letter.

    Parameters
    ----------
    terrain
        In the same n.
    nodes
        (N, 2) rows and columns of the grid points.
    p_nc
        Of the camera, (3,) metres.
    itself
        Whether the point is among those compared. No point has an angle larger than its own, so "exists
        theta <= theta_0" then hides everything.
    signed
        Whether the longer side is chosen by ``dx <= dy``, without absolute values: where dx is below zero
        that may be the shorter one. The line is then scaled to the wrong side, leaves points out, and runs on
        behind the camera; where that side is zero it has no direction.

    Returns
    -------
    Looked

    Raises
    ------
    WildlabError
        Where a node is not on the map.

    Examples
    --------
    >>> height = np.zeros((2, 6), np.float32)
    >>> height[:, 3] = 9.0
    >>> wall = Terrain(height, north=0.0, east=0.0, step=10.0)
    >>> compare_angles(wall, [[0, 2], [0, 5]], [0.0, 0.0, -12.0]).clear
    array([ True, False])
    >>> compare_angles(wall, [[0, 2], [0, 5]], [0.0, 0.0, -12.0], itself=True, signed=True).clear
    array([False, False])
    """
    rows, columns, lens = _prepared(terrain, nodes, p_nc)

    found = compare_all(terrain.height, rows, columns, lens, terrain.step, itself, signed, terrain._top)
    return Looked(*found)


def _prepared(
    terrain: Terrain, nodes: ArrayLike, p_nc: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows and columns, and the camera in columns, rows and metres upwards."""
    asked, p = np.asarray(nodes, np.int64).reshape(-1, 2), np.asarray(p_nc, float)
    if ((asked < 0) | (asked >= terrain.height.shape)).any():
        raise WildlabError(
            f"a grid point beyond the map of {terrain.height.shape[0]} by {terrain.height.shape[1]} nodes",
            "give rows and columns of the terrain, counted from 0",
            field="nodes",
        )
    north, east = (p[0] - terrain.north) / terrain.step, (p[1] - terrain.east) / terrain.step
    rows, columns = np.ascontiguousarray(asked[:, 0]), np.ascontiguousarray(asked[:, 1])
    return rows, columns, np.array([east, north, -p[2]])
